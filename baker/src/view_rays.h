// Rays of ambient occlusion and first bounces in small pictures of a scene, to measure a bake with: what errs
// in one view may be rare elsewhere. Deterministic.
#pragma once

#include <cstdint>
#include <vector>

#include "bake.h"

namespace lsp {

// What the pixels of one view see: `count` points from `first` on, and nothing in the rest of `pixels`.
struct View {
  uint32_t first, count, pixels;
};

struct ViewRays {
  std::vector<View> views;
  std::vector<LspRay> rays;  // per_point cosine rays of each point, one after the other
};

// Up to `views` pictures of side x side pixels, a third each from close to a surface, from within the scene
// and from around it. A view sees mostly surfaces, none right before the eye, and one in four at least from
// in front: within a closed object all are seen from behind, in a room of careless winding some.
ViewRays view_rays(const Baked& baked, uint32_t views, uint32_t side, uint32_t per_point);

}  // namespace lsp
