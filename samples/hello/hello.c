/* The smallest use of liblsp: opens FILE.lsp and traces one ray, from above onto the scene's centre. */
#include <math.h>
#include <stdio.h>

#include "lsp/lsp.h"

int main(int argc, char** argv) {
  if (argc != 2) return fprintf(stderr, "usage: hello FILE.lsp\n"), 1;
  lsp_error error;
  lsp_mapping mapping;
  lsp_scene scene;
  LspHit hit;
  lsp_status status = lsp_map_file(argv[1], &mapping, &error);
  if (status == LSP_OK) status = lsp_open(mapping.bytes, mapping.size, &scene, &error);
  if (status == LSP_OK) {
    const lsp_float3 lo = scene.header->bounds_min, hi = scene.header->bounds_max;
    const LspRay ray = {{(lo.x + hi.x) / 2, 2 * hi.y - lo.y, (lo.z + hi.z) / 2}, 0, {0, -1, 0}, INFINITY};
    const lsp_trace_options options = {.flags = LSP_TRACE_APPROXIMATE}; /* exact where there are no tables */
    status = lsp_trace(&scene, &options, &ray, &hit, 1, NULL, &error);
  }
  if (status != LSP_OK) return fprintf(stderr, "hello: %s: %s\n", argv[1], error.message), (int)status;
  if (hit.primitive == LSP_NONE) return puts("no hit"), 0;
  printf("hit triangle %u at distance %g%s\n", hit.primitive, (double)hit.t,
         hit.flags & LSP_HIT_LINE_SPACE ? ", answered by a table" : "");
  lsp_unmap_file(&mapping);
  return 0;
}
