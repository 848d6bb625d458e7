// Any bytes: the validator at its deepest level, the loader, and the agreement of the two.
#include "fuzz_input.h"

using namespace lsp;

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  fuzz::AlignedBytes bytes(data, size);
  const format::Report report = format::check_file(
      bytes.bytes(), {.level = format::Level::kGeometry, .memory_limit = fuzz::kMemoryLimit});
  const format::Report structure = format::check_file(
      bytes.bytes(), {.level = format::Level::kStructure, .memory_limit = fuzz::kMemoryLimit});
  if (report.verdict() == format::Verdict::kValid && structure.verdict() != format::Verdict::kValid)
    fuzz::found("a deeper level finds less");
  lsp_scene scene;
  lsp_error error;
  const lsp_status status = lsp_open(bytes.data(), bytes.size(), &scene, &error);
  if (structure.verdict() == format::Verdict::kValid) {
    if (status != LSP_OK && status != LSP_ERROR_UNSUPPORTED) fuzz::found("valid, but the loader refuses it");
  } else if (status == LSP_OK) {
    // Not validated: the tracer stays inside the bytes all the same.
    fuzz::trace_rays(scene, size, 4, false);
  }
  return 0;
}
