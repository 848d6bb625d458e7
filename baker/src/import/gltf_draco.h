// KHR_draco_mesh_compression.
#pragma once

#include "import/gltf_document.h"

namespace lsp {

// A compressed primitive. The ids are Draco's unique ids of the attributes (negative: none); the flags say
// whether glTF's accessors call integer values normalised.
struct DracoJob {
  Bytes bytes;
  int position_id = -1;
  bool position_normalized = false;
  int normal_id = -1;
  bool normal_normalized = false;
};

struct DracoMesh {
  std::vector<uint32_t> indices;  // three a triangle
  std::vector<float> positions;   // three a vertex
  std::vector<float> normals;     // the same, or empty
};

// Decodes one primitive in this process. libdraco 1.5.5 allocates what the bytes declare before it knows that
// they hold it (10 KB made it ask for 850 MB), so this is for bytes that are trusted, or behind a fence.
// Throws Failure kInvalid naming `file` where the bytes are damaged or lack an attribute, kLimit.
DracoMesh decode_draco(const std::string& file, const DracoJob& job, Budget& budget);

// Decodes hostile primitives in order: in a child process that may use what is left of the budget and a
// minute or two, so that no bytes can crash, hang or bloat this one. Throws as above.
std::vector<DracoMesh> decode_draco_fenced(const std::string& file, std::span<const DracoJob> jobs,
                                           Budget& budget);

}  // namespace lsp
