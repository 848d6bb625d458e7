// Rays such as indirect light casts, to measure a bake with. Deterministic; any ray can be made without those
// before.
#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <vector>

#include "bake.h"

namespace lsp {

struct SurfacePoint {
  glm::dvec3 position, normal;  // geometric
};

// Points spread evenly over the surfaces, and cosine-distributed directions about their geometric normals;
// rays begin a 1e-4 of the diagonal above the surface.
class SurfaceRays {
 public:
  explicit SurfaceRays(const Baked& baked);

  // Ray number `ray` from point number `point`.
  LspRay make(uint64_t point, uint64_t ray) const;
  // Likewise from a point of the caller's.
  LspRay from(const SurfacePoint& point, uint64_t ray) const;

  glm::dvec3 normal_of(uint32_t record) const;  // geometric, of a triangle record

 private:
  const Baked& baked_;
  double offset_;
  std::vector<double> area_;  // summed up
};

// per_point rays from each of `points` points of the surfaces, one after the other.
std::vector<LspRay> surface_rays(const Baked& baked, uint32_t points, uint32_t per_point);

// Likewise from what eyes see that are spread over the scene's box, and around it: details count by how large
// they look.
std::vector<LspRay> seen_rays(const Baked& baked, uint32_t points, uint32_t per_point);

}  // namespace lsp
