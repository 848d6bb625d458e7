// The bytes of one KHR_draco_mesh_compression buffer view, any bytes: libdraco must decode them or fail by
// name. Without the fence of a child process, which would hide what happens in it (memory is libdraco's own
// affair here: run with -rss_limit_mb=0).
#include <cstdint>

#include "import/gltf_draco.h"
#include "lsp/program.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  lsp::Budget budget(256 << 20);
  try {
    lsp::decode_draco(
        "fuzz.glb", {{data, size}, {{0, 3, true, true}, {1, 3, false, false}, {2, 2, true, false}}}, budget);
  } catch (const lsp::Failure&) {
  }
  return 0;
}
