// Packed files: unpacked by the loader's library, whose result must be the file that the validator saw.
#include "fuzz_input.h"

using namespace lsp;

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  fuzz::AlignedBytes bytes(data, size);
  const format::Report report = format::check_file(
      bytes.bytes(), {.level = format::Level::kStructure, .memory_limit = fuzz::kMemoryLimit});
  const bool valid = report.verdict() == format::Verdict::kValid;
  uint64_t unpacked = 0;
  if (lsp_unpacked_size(bytes.data(), size, &unpacked, nullptr) != LSP_OK) {
    if (valid) fuzz::found("valid, but its unpacked size is refused");
    return 0;
  }
  if (unpacked > fuzz::kMemoryLimit) return 0;
  fuzz::AlignedBytes raw(unpacked);
  if (lsp_unpack(bytes.data(), size, raw.data(), unpacked, nullptr) != LSP_OK) {
    if (valid) fuzz::found("valid, but it does not unpack");
    return 0;
  }
  const format::Report again = format::check_file(
      raw.bytes(), {.level = format::Level::kStructure, .memory_limit = fuzz::kMemoryLimit});
  if (valid && again.verdict() != format::Verdict::kValid) fuzz::found("valid packed, but not unpacked");
  lsp_scene scene;
  if (lsp_open(raw.data(), raw.size(), &scene, nullptr) == LSP_OK) fuzz::trace_rays(scene, size, 4, valid);
  return 0;
}
