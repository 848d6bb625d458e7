// Textures of glTF documents: their pictures, and how materials use them.
#pragma once

#include <map>
#include <optional>
#include <vector>

#include "import/gltf_accessor.h"
#include "import/mesh_builder.h"
#include "import/surface_color.h"

namespace lsp {

class GltfTextures {
 public:
  GltfTextures(const std::filesystem::path& path, const GltfDocument& document, GltfAccessors& accessors,
               MeshBuilder& builder)
      : path_(path), document_(document), accessors_(accessors), builder_(builder) {}

  // The texture that a member of a material names; none, with a note, where it cannot be had.
  TextureUse use(const nlohmann::json& info, const AlphaRule& rule);
  // The mean of its texels' four components, 0 to 1, as the picture has them.
  std::optional<glm::dvec4> mean(const nlohmann::json& info);

  // Forgets the pictures where they have come to take much memory. True where it did.
  bool trim();

 private:
  // The pictures of a texture, by their numbers, the one to be read first.
  using Images = std::vector<int64_t>;

  Images images_at(const nlohmann::json& info);
  std::shared_ptr<Texture> texture(const Images& images, const AlphaRule& rule);
  Picture read_first(const Images& images);
  Picture read_picture(int64_t image, std::string& why);
  std::string name_of(int64_t image) const;
  std::string picture_bytes(const nlohmann::json& image);
  Wrap wrap_of(const nlohmann::json& sampler, const char* key);
  void place(const nlohmann::json& info, TextureUse& use);
  void note(const std::string& text) { builder_.note(document_.file + ": " + text); }

  const std::filesystem::path& path_;
  const GltfDocument& document_;
  GltfAccessors& accessors_;
  MeshBuilder& builder_;
  std::map<Images, std::optional<glm::dvec4>> means_;
  std::map<std::pair<Images, AlphaRule>, std::shared_ptr<Texture>> textures_;
  uint64_t charged_ = 0;
};

}  // namespace lsp
