// Materials of glTF documents and their textures.
#pragma once

#include <map>

#include "import/gltf_numbers.h"
#include "import/gltf_textures.h"

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
      : document_(document),
        builder_(builder),
        numbers_(document.file, builder),
        textures_(path, document, accessors, builder) {}

  // Made on first use; where the document has none by that number, glTF's default (white, a rough metal).
  const Entry& at(uint32_t index);

  // Forgets the pictures where they have come to take much memory.
  void trim();

 private:
  Entry read(const nlohmann::json& source, uint32_t known_id);
  void mean_roughness(const nlohmann::json& info, Material& material);
  const nlohmann::json* read_glossy(const nlohmann::json& glossy, float (&factor)[4], Material& material);
  AlphaRule alpha_rule(const nlohmann::json& source, float factor);
  float glass_share(const nlohmann::json& transmission, const Material& material);
  void note_unread_textures(const nlohmann::json& source);
  void note(const std::string& text) { builder_.note(document_.file + ": " + text); }

  const GltfDocument& document_;
  MeshBuilder& builder_;
  const GltfNumbers numbers_;
  GltfTextures textures_;
  std::map<uint32_t, Entry> materials_;
  std::map<uint32_t, uint32_t> ids_;  // what materials_ held before it was forgotten, too
};

}  // namespace lsp
