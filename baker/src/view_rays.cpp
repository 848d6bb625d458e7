#include "view_rays.h"

#include <cmath>

#include "lsp/lsp.h"
#include "lsp/program.h"
#include "random.h"
#include "surface_rays.h"
#include "vectors.h"

namespace lsp {
namespace {

constexpr double kHalfWidth = 0.637;  // of a view of 65 degrees, at distance 1
constexpr double kTooNear = 0.015;    // of the diagonal
constexpr uint32_t kAttempts = 24;
constexpr uint64_t kSeed = uint64_t{1} << 41;

struct Eye {
  glm::dvec3 at, towards;
};

class Views {
 public:
  Views(const Baked& baked, uint32_t side)
      : baked_(baked),
        scene_(view(baked)),
        points_(baked),
        lo_(dvec(baked.header.bounds_min)),
        extent_(dvec(baked.header.bounds_max) - lo_),
        diagonal_(glm::length(extent_)),
        side_(side),
        records_(baked.header.primitive_count) {
    for (size_t i = 0; i < baked.triangles.size(); ++i)
      records_[baked.triangles[i].primitive] = static_cast<uint32_t>(i);
  }

  // The points that view number `number` sees, empty where none is found.
  std::vector<SurfacePoint> points(uint32_t number) const {
    for (uint32_t attempt = 0; attempt < kAttempts; ++attempt) {
      const uint64_t seed = kSeed + uint64_t{number} * kAttempts + attempt;
      Eye eye;
      if (!find_eye((number + attempt) % 3, seed, eye)) continue;
      std::vector<SurfacePoint> seen;
      if (look(eye, seed, seen)) return seen;
    }
    return {};
  }

 private:
  bool find_eye(uint32_t kind, uint64_t seed, Eye& eye) const {
    if (kind == 2) {
      eye.at = lo_ + 0.5 * extent_ + random_on_sphere(seed, 0) * diagonal_;
      eye.towards = lo_ + 0.5 * extent_ - eye.at;
      return true;
    }
    if (kind == 1) {
      eye.at = lo_ + extent_ * glm::dvec3(random(seed, 20), random(seed, 21), random(seed, 22));
      eye.towards = random_on_sphere(seed, 0);
      return true;
    }
    LspRay away = points_.make(seed, seed);
    away.tmax = static_cast<float>((0.06 + 0.06 * random(seed, 20)) * diagonal_);
    eye.at = dvec(away.origin) + dvec(away.direction) * double(away.tmax);
    eye.towards = -dvec(away.direction);
    return trace({away}).front().primitive == LSP_NONE;
  }

  // Whether it is a view, see view_rays.
  bool look(const Eye& eye, uint64_t seed, std::vector<SurfacePoint>& seen) const {
    const std::vector<LspRay> rays = pixels(eye, seed);
    const std::vector<LspHit> hits = trace(rays);
    size_t hit = 0, near = 0, fronts = 0;
    for (size_t i = 0; i < rays.size(); ++i) {
      if (hits[i].primitive == LSP_NONE) continue;
      ++hit;
      near += double(hits[i].t) < kTooNear * diagonal_;
      const glm::dvec3 normal = points_.normal_of(records_[hits[i].primitive]);
      const glm::dvec3 direction = dvec(rays[i].direction);
      const bool front = glm::dot(normal, direction) <= 0;
      fronts += front;
      seen.push_back({dvec(rays[i].origin) + direction * double(hits[i].t), front ? normal : -normal});
    }
    return 2 * hit >= rays.size() && 4 * fronts >= hit && 20 * near <= hit;
  }

  std::vector<LspRay> pixels(const Eye& eye, uint64_t seed) const {
    const glm::dvec3 ahead = glm::normalize(eye.towards);
    const glm::dvec3 up = std::fabs(ahead.y) < 0.999 ? glm::dvec3(0, 1, 0) : glm::dvec3(0, 0, 1);
    const glm::dvec3 right = glm::normalize(glm::cross(ahead, up)), above = glm::cross(right, ahead);
    std::vector<LspRay> rays;
    for (uint32_t y = 0; y < side_; ++y)
      for (uint32_t x = 0; x < side_; ++x) {
        const uint32_t dimension = 30 + 2 * (y * side_ + x);
        const double u = 2 * (x + random(seed, dimension)) / side_ - 1;
        const double v = 2 * (y + random(seed, dimension + 1)) / side_ - 1;
        const glm::dvec3 d = glm::normalize(ahead + kHalfWidth * (u * right + v * above));
        rays.push_back({f3(eye.at), 0, f3(d), INFINITY});
      }
    return rays;
  }

  std::vector<LspHit> trace(const std::vector<LspRay>& rays) const {
    std::vector<LspHit> hits(rays.size());
    const lsp_trace_options exact = {0, 0, 0, 0};
    if (lsp_trace(&scene_, &exact, rays.data(), hits.data(), rays.size(), nullptr, nullptr) != LSP_OK)
      throw Failure(Exit::kInternal, "", "the tracer refused the baker's own tree");
    return hits;
  }

  const Baked& baked_;
  const lsp_scene scene_;
  const SurfaceRays points_;
  const glm::dvec3 lo_, extent_;
  const double diagonal_;
  const uint32_t side_;
  std::vector<uint32_t> records_;  // by primitive
};

}  // namespace

ViewRays view_rays(const Baked& baked, uint32_t views, uint32_t side, uint32_t per_point) {
  const Views make(baked, side);
  const SurfaceRays rays(baked);
  ViewRays all;
  for (uint32_t v = 0; v < views; ++v) {
    const std::vector<SurfacePoint> seen = make.points(v);
    if (seen.empty()) continue;
    const auto first = static_cast<uint32_t>(all.rays.size() / per_point);
    all.views.push_back({first, static_cast<uint32_t>(seen.size()), side * side});
    for (const SurfacePoint& point : seen)
      for (uint32_t k = 0; k < per_point; ++k) all.rays.push_back(rays.from(point, kSeed + all.rays.size()));
  }
  return all;
}

}  // namespace lsp
