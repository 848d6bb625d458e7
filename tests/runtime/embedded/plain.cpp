// An engine without exceptions and RTTI: the C headers, and nothing of C++'s library.
#include <stdio.h>

#include "lsp/lsp.h"

#if defined(__cpp_exceptions) || defined(__cpp_rtti)
#error "compiled with exceptions or RTTI"
#endif

int main(int argc, char** argv) {
  lsp_error error;
  lsp_mapping mapping;
  lsp_scene scene;
  if (argc < 2 || lsp_version() != LSP_LIBRARY_VERSION) return 1;
  const lsp_status status = lsp_map_file(argv[1], &mapping, &error);
  if (status != LSP_OK) return puts(lsp_status_string(status)), 2;
  if (lsp_open(mapping.bytes, mapping.size, &scene, &error) != LSP_OK) return 3;
  const lsp_trace_options options = {LSP_TRACE_APPROXIMATE, 0.0f};
  const LspRay ray = {scene.header->bounds_min, 0.0f, {1.0f, 1.0f, 1.0f}, 1e30f};
  LspHit hit;
  if (lsp_trace(&scene, &options, &ray, &hit, 1, nullptr, &error) != LSP_OK) return 4;
  lsp_unmap_file(&mapping);
  puts("embedded ok");
}
