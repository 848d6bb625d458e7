/* The smallest use of liblsp: map a file, open it, trace one ray.
 *
 *   hello FILE.lsp
 *
 * The ray falls from above onto the centre of the scene. */
#include <math.h>
#include <stdio.h>

#include "lsp/lsp.h"

static int fail(const char* file, const lsp_error* error) {
  fprintf(stderr, "hello: %s: %s\n", file, error->message);
  return (int)error->status;
}

int main(int argc, char** argv) {
  if (argc != 2) {
    fprintf(stderr, "usage: hello FILE.lsp\n");
    return 1;
  }
  lsp_error error;
  lsp_mapping mapping;
  if (lsp_map_file(argv[1], &mapping, &error) != LSP_OK) return fail(argv[1], &error);

  lsp_scene scene;
  if (lsp_open(mapping.bytes, mapping.size, &scene, &error) != LSP_OK) return fail(argv[1], &error);

  const lsp_float3 lo = scene.header->bounds_min;
  const lsp_float3 hi = scene.header->bounds_max;
  const LspRay ray = {.origin = {0.5f * (lo.x + hi.x), hi.y + 0.1f * (hi.y - lo.y), 0.5f * (lo.z + hi.z)},
                      .tmin = 0.0f,
                      .direction = {0.0f, -1.0f, 0.0f},
                      .tmax = INFINITY};
  /* Approximate where the file has cells or Line Spaces, exact otherwise. */
  const lsp_trace_options options = {.flags = LSP_TRACE_APPROXIMATE};
  LspHit hit;
  if (lsp_trace(&scene, &options, &ray, &hit, 1, NULL, &error) != LSP_OK) return fail(argv[1], &error);

  if (hit.primitive == LSP_NONE) {
    printf("no hit\n");
  } else {
    printf("hit triangle %u at distance %g, normal (%g, %g, %g)%s\n", hit.primitive, (double)hit.t,
           (double)hit.normal.x, (double)hit.normal.y, (double)hit.normal.z,
           hit.flags & LSP_HIT_LINE_SPACE ? ", answered by a table" : "");
  }
  lsp_unmap_file(&mapping);
  return 0;
}
