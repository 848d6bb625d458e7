/* Opens the file named and traces a ray, and another at an instance of it. */
#include <math.h>
#include <stdio.h>

#include "lsp/lsp_instances.h"

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
  const lsp_scene* const assets[] = {&scene};
  const lsp_instance place = {.transform = {2, 0, 0, 0, 0, 2, 0, 0, 0, 0, 2, 0}, .mask = 1};
  static _Alignas(16) unsigned char memory[512];
  lsp_instances instances;
  if (lsp_instances_build(assets, 1, &place, 1, memory, sizeof memory, &instances, &error) != LSP_OK)
    return 4;
  if (lsp_trace_instances(&instances, &options, 1, &ray, &hit, 1, &counts, &error) != LSP_OK) return 5;
  if (counts.rays != 2 || LSP_HIT_INSTANCE(hit) != 0) return 6;
  lsp_unmap_file(&mapping);
  puts("embedded ok");
  return 0;
}
