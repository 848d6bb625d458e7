// Materials of glTF documents and their textures.
#pragma once

#include <map>
#include <tuple>

#include "import/gltf_accessor.h"
#include "import/mesh_builder.h"
#include "import/surface_color.h"

namespace lsp {

class GltfMaterials {
 public:
  // A material of the document: the builder's, and what decides its triangles' colours.
  struct Entry {
    uint32_t id = 0;
    Surface surface;
  };

  GltfMaterials(const std::filesystem::path& path, const GltfDocument& document, GltfAccessors& accessors,
                MeshBuilder& builder)
      : path_(path), document_(document), accessors_(accessors), builder_(builder) {}

  // Made on first use; where the document has none by that number, glTF's default (white, a rough metal).
  const Entry& at(uint32_t index);

  // Forgets the pictures where they have come to take much memory.
  void trim();

 private:
  Entry read(const nlohmann::json& source, uint32_t known_id);
  TextureUse texture(const nlohmann::json& info, const AlphaRule& rule);
  int64_t image_at(const nlohmann::json& info);
  std::shared_ptr<Texture> picture(int64_t image, const AlphaRule& rule);
  Picture read_picture(int64_t image);
  std::string picture_bytes(const nlohmann::json& image);
  void mean_roughness(const nlohmann::json& info, Material& material);
  // As their namesakes of json_member.h, with a note where something else is there.
  double number(const nlohmann::json& parent, const char* key, double fallback);
  template <typename T>
  void numbers(const nlohmann::json& parent, const char* key, size_t count, T* values);
  void note_unread_textures(const nlohmann::json& source);
  void note(const std::string& text) { builder_.note(document_.file + ": " + text); }

  const std::filesystem::path& path_;
  const GltfDocument& document_;
  GltfAccessors& accessors_;
  MeshBuilder& builder_;
  std::map<uint32_t, Entry> materials_;
  std::map<uint32_t, uint32_t> ids_;         // what materials_ held before it was forgotten, too
  std::map<int64_t, glm::dvec2> roughness_;  // means of pictures: roughness and metalness
  std::map<std::tuple<int64_t, AlphaMode, float, float>, std::shared_ptr<Texture>> pictures_;
  uint64_t charged_ = 0;
};

}  // namespace lsp
