/* README's recipe for errors as noise, as it stands there (recipe.inc), with what it leaves to the reader. */
#include <math.h>
#include <stdint.h>

#include "lsp/lsp.h"

static float light_of(const LspRay* ray, const LspHit* hit, const lsp_trace_options* options) {
  (void)ray;
  (void)options;
  return isfinite(hit->t) ? 0.0f : 1.0f; /* ambient occlusion */
}

static float uniform(uint32_t* state) {
  *state = *state * 747796405u + 2891336453u;
  return (float)(*state >> 8) * 0x1p-24f;
}

void verified_light(lsp_scene scene, const LspRay* rays, LspHit* hits, float* light, LspRay* verified,
                    uint64_t* path_of, uint64_t count, float p);
void verified_light(lsp_scene scene, const LspRay* rays, LspHit* hits, float* light, LspRay* verified,
                    uint64_t* path_of, uint64_t count, float p) {
  const lsp_trace_options by_tables = {.flags = LSP_TRACE_APPROXIMATE};
  const lsp_trace_options exactly = {.flags = 0};
  uint32_t random_state = 1;
  lsp_error error;
#include "recipe.inc"
}
