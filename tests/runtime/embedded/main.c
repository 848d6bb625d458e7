/* Opens the file named and traces a ray. */
#include <math.h>
#include <stdio.h>

#include "lsp/lsp.h"

int main(int argc, char** argv) {
  lsp_error error;
  lsp_mapping mapping;
  lsp_scene scene;
  if (argc < 2 || lsp_map_file(argv[1], &mapping, &error) != LSP_OK) return 1;
  if (lsp_open(mapping.bytes, mapping.size, &scene, &error) != LSP_OK) return 2;
  const lsp_float3 lo = scene.header->bounds_min;
  const lsp_float3 hi = scene.header->bounds_max;
  const LspRay ray = {lo, 0.0f, {hi.x - lo.x, hi.y - lo.y, hi.z - lo.z}, INFINITY};
  const lsp_trace_options options = {.flags = LSP_TRACE_APPROXIMATE};
  LspHit hit;
  lsp_trace_counts counts = {0};
  if (lsp_trace(&scene, &options, &ray, &hit, 1, &counts, &error) != LSP_OK || counts.rays != 1) return 3;
  lsp_unmap_file(&mapping);
  puts("embedded ok");
  return 0;
}
