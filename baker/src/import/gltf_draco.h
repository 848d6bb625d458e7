// KHR_draco_mesh_compression.
#pragma once

#include "import/gltf_document.h"

namespace lsp {

struct DracoMesh {
  std::vector<uint32_t> indices;  // three a triangle
  std::vector<float> positions;   // three a vertex
  std::vector<float> normals;     // the same, or empty
};

// Decodes `bytes`; position_id and normal_id are Draco's unique ids of the attributes (negative: none). The
// flags say whether glTF's accessors call integer values normalised.
// Throws Failure kInvalid naming `file` where the bytes are damaged or lack an attribute, kLimit where they
// declare more than the budget holds. Memory is bounded before decoding by what the bytes declare.
DracoMesh decode_draco(const std::string& file, Bytes bytes, int position_id, bool position_normalized,
                       int normal_id, bool normal_normalized, Budget& budget);

}  // namespace lsp
