// Validated files: opened, and traced with many rays in every mode. No fault, no hang, no senseless hit.
#include "fuzz_input.h"

using namespace lsp;

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  fuzz::AlignedBytes bytes(data, size);
  const format::Report report = format::check_file(
      bytes.bytes(),
      {.level = format::Level::kStructure, .memory_limit = fuzz::kMemoryLimit, .examples_per_rule = 0});
  if (report.verdict() != format::Verdict::kValid) return -1;  // keep the corpus to files that are traced
  lsp_scene scene;
  if (lsp_open(bytes.data(), bytes.size(), &scene, nullptr) != LSP_OK) return -1;  // packed
  fuzz::trace_rays(scene, size, 32, true);
  return 0;
}
