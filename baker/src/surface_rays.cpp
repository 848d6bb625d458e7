#include "surface_rays.h"

#include <algorithm>
#include <cmath>

#include "lsp/lsp.h"
#include "random.h"
#include "vectors.h"

namespace lsp {
namespace {

constexpr double kOffset = 1e-4;  // of the diagonal
constexpr uint32_t kGlances = 4;  // of an eye that sees a back, for a front

double diagonal(const LspHeader& h) { return glm::length(dvec(h.bounds_max) - dvec(h.bounds_min)); }

// Cosine-distributed about `n`: a point on the sphere about the normal's tip.
glm::dvec3 cosine_direction(const glm::dvec3& n, uint64_t ray) {
  return glm::normalize(n * (1 + 1e-9) + random_on_sphere(ray, 3));
}

glm::dvec3 geometric_normal(const LspTriangle& t) {
  return glm::normalize(glm::cross(dvec(t.v1) - dvec(t.v0), dvec(t.v2) - dvec(t.v0)));
}

}  // namespace

SurfaceRays::SurfaceRays(const Baked& baked) : baked_(baked), offset_(kOffset * diagonal(baked.header)) {
  // Records that spatial splits repeat count more than once: harmless here, and it spares a set of
  // primitives.
  double total = 0;
  for (const LspTriangle& t : baked.triangles) {
    total += glm::length(glm::cross(dvec(t.v1) - dvec(t.v0), dvec(t.v2) - dvec(t.v0)));
    area_.push_back(total);
  }
}

LspRay SurfaceRays::make(uint64_t point, uint64_t ray) const {
  const double wanted = random(point, 0) * area_.back();
  const auto i = size_t(std::lower_bound(area_.begin(), area_.end(), wanted) - area_.begin());
  const LspTriangle& t = baked_.triangles[std::min(i, area_.size() - 1)];
  double u = random(point, 1), v = random(point, 2);
  if (u + v > 1) {
    u = 1 - u;
    v = 1 - v;
  }
  const glm::dvec3 a = dvec(t.v1) - dvec(t.v0), b = dvec(t.v2) - dvec(t.v0);
  return from({dvec(t.v0) + a * u + b * v, geometric_normal(t)}, ray);
}

LspRay SurfaceRays::from(const SurfacePoint& point, uint64_t ray) const {
  return {f3(point.position + point.normal * offset_), 0, f3(cosine_direction(point.normal, ray)), INFINITY};
}

glm::dvec3 SurfaceRays::normal_of(uint32_t record) const {
  return geometric_normal(baked_.triangles[record]);
}

std::vector<LspRay> surface_rays(const Baked& baked, uint32_t points, uint32_t per_point) {
  const SurfaceRays make(baked);
  std::vector<LspRay> rays;
  for (uint32_t p = 0; p < points; ++p)
    for (uint32_t k = 0; k < per_point; ++k) rays.push_back(make.make(p, uint64_t{p} * per_point + k));
  return rays;
}

std::vector<LspRay> seen_rays(const Baked& baked, uint32_t points, uint32_t per_point) {
  const LspHeader& h = baked.header;
  const SurfaceRays make(baked);
  const glm::dvec3 lo = dvec(h.bounds_min), extent = dvec(h.bounds_max) - lo;
  const lsp_scene scene = view(baked);
  std::vector<uint32_t> records(h.primitive_count);
  for (size_t i = 0; i < baked.triangles.size(); ++i) records[baked.triangles[i].primitive] = uint32_t(i);
  const auto meet = [&](const LspRay& ray) {
    LspHit hit;
    const lsp_trace_options exact = {0, 0, 0, 0};
    if (lsp_trace(&scene, &exact, &ray, &hit, 1, nullptr, nullptr) != LSP_OK) hit.primitive = LSP_NONE;
    return hit;
  };
  const auto sees_front = [&](const lsp_float3& eye, uint64_t seed) {
    for (uint32_t k = 0; k < kGlances; ++k) {
      const glm::dvec3 d = random_on_sphere(seed, 80 + 16 * k);
      const LspHit hit = meet({eye, 0, f3(d), INFINITY});
      if (hit.primitive != LSP_NONE && glm::dot(make.normal_of(records[hit.primitive]), d) < 0) return true;
    }
    return false;
  };
  std::vector<LspRay> rays;
  // A sixth of the eyes look from outside; of rays that see nothing there are others.
  for (uint64_t i = 1; rays.size() < size_t(points) * per_point && i < 16ull * points; ++i) {
    const uint64_t seed = i + (uint64_t{1} << 40);
    const glm::dvec3 inside = lo + extent * glm::dvec3(random(seed, 20), random(seed, 21), random(seed, 22));
    LspRay look{f3(inside), 0, f3(random_on_sphere(seed, 23)), INFINITY};
    if (i % 6 == 0) {
      const glm::dvec3 eye = lo + 0.5 * extent + random_on_sphere(seed, 63) * diagonal(h);
      look.origin = f3(eye);
      look.direction = f3(inside - eye);
    }
    const LspHit hit = meet(look);
    if (hit.primitive == LSP_NONE) continue;
    const glm::dvec3 d = dvec(look.direction);
    SurfacePoint point{dvec(look.origin) + d * double(hit.t), make.normal_of(records[hit.primitive])};
    if (glm::dot(point.normal, d) > 0) {
      // From within a closed object nobody sees it, but rooms show backs, too.
      if (!sees_front(look.origin, seed)) continue;
      point.normal = -point.normal;
    }
    for (uint32_t k = 0; k < per_point; ++k) rays.push_back(make.from(point, seed * per_point + k));
  }
  return rays;
}

}  // namespace lsp
