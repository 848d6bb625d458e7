// Materials of glTF documents.
#pragma once

#include <map>

#include "import/gltf_document.h"
#include "import/mesh_builder.h"

namespace lsp {

class GltfMaterials {
 public:
  GltfMaterials(const GltfDocument& document, MeshBuilder& builder)
      : document_(document), builder_(builder) {}

  // The builder's number of a material of the document, made on first use; the default material's where the
  // document has none by that number.
  uint32_t at(uint32_t index);

 private:
  Material read(const nlohmann::json& source);

  const GltfDocument& document_;
  MeshBuilder& builder_;
  std::map<uint32_t, uint32_t> materials_;
};

}  // namespace lsp
