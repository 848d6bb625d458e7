// KHR_draco_mesh_compression.
#pragma once

#include "import/gltf_document.h"

namespace lsp {

// What is wanted of a compressed attribute. `id` is Draco's unique id, `normalized` what glTF's accessor says
// of integer values.
struct DracoAttribute {
  int id = -1;
  int components = 3;
  bool normalized = false;
  bool required = true;
};

struct DracoJob {
  Bytes bytes;
  std::vector<DracoAttribute> attributes;
};

struct DracoMesh {
  std::vector<uint32_t> indices;           // three a triangle
  std::vector<std::vector<float>> values;  // per attribute: its components for every vertex; empty: not there
};

// Decodes one primitive in this process. libdraco 1.5.5 allocates what the bytes declare before it knows that
// they hold it (10 KB made it ask for 850 MB), so this is for bytes that are trusted, or behind a fence.
// Throws Failure kInvalid naming `file` where the bytes are damaged or lack a required attribute, kLimit.
DracoMesh decode_draco(const std::string& file, const DracoJob& job, Budget& budget);

// Decodes hostile primitives in order: in a child process that may use what is left of the budget and a
// minute or two, so that no bytes can crash, hang or bloat this one. Throws as above.
std::vector<DracoMesh> decode_draco_fenced(const std::string& file, std::span<const DracoJob> jobs,
                                           Budget& budget);

}  // namespace lsp
