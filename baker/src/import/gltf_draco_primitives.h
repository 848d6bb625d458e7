// The primitives of a glTF document that Draco has compressed.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "import/gltf_accessor.h"
#include "import/gltf_draco.h"
#include "import/mesh_builder.h"

namespace lsp {

class GltfDraco {
 public:
  struct Decoded {
    std::vector<uint32_t> indices;
    std::map<std::string, std::vector<float>> values;  // of attributes, by name
  };

  // Decodes the primitives of all meshes that some node places, in one go. Throws Failure.
  GltfDraco(const GltfDocument& document, GltfAccessors& accessors, MeshBuilder& builder);

  // Null where the primitive is not compressed.
  const Decoded* find(const tinygltf::Primitive& primitive) const;
  void forget(const tinygltf::Primitive& primitive) { decoded_.erase(&primitive); }
  // Whether a compressed primitive says that its compressed data have the attribute.
  static bool names(const tinygltf::Primitive& primitive, const std::string& attribute);

 private:
  DracoJob job_of(const tinygltf::Primitive& source, std::vector<std::string>& names);

  const GltfDocument& document_;
  GltfAccessors& accessors_;
  std::map<const tinygltf::Primitive*, Decoded> decoded_;
};

}  // namespace lsp
