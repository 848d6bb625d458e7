// The bytes of one KHR_draco_mesh_compression buffer view, any bytes: libdraco behind our fence must decode
// them or fail by name, within a memory limit.
#include <cstdint>

#include "import/gltf_draco.h"
#include "lsp/program.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  lsp::Budget budget(256 << 20);
  try {
    lsp::decode_draco("fuzz.glb", {data, size}, 0, true, 1, false, budget);
  } catch (const lsp::Failure&) {
  }
  return 0;
}
