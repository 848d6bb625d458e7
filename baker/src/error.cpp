#include "error.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "lsp/lsp.h"

namespace lsp {
namespace {

// PCG-RXS-M-XS 32 (O'Neill 2014) as a hash of a counter: any ray can be made without the ones before it.
double random(uint64_t ray, uint32_t dimension) {
  uint32_t x = uint32_t(ray) * 747796405u + uint32_t(ray >> 32) * 277803737u + dimension * 2891336453u + 1u;
  for (int i = 0; i < 2; ++i) {
    x = x * 747796405u + 2891336453u;
    x = ((x >> ((x >> 28) + 4)) ^ x) * 277803737u;
    x = (x >> 22) ^ x;
  }
  return (x + 0.5) / 4294967296.0;
}

glm::dvec3 vec(const lsp_float3& v) { return {v.x, v.y, v.z}; }

// A cosine-distributed direction about `n` with square roots only, so that every machine makes the same one:
// a point on the sphere about the normal's tip, its height and angle from a point in the unit disc.
glm::dvec3 cosine_direction(const glm::dvec3& n, uint64_t ray) {
  double x = 0, y = 0, square = 2;
  for (uint32_t attempt = 0; square >= 1 || square == 0; ++attempt) {
    x = 2 * random(ray, 3 + 2 * attempt) - 1;
    y = 2 * random(ray, 4 + 2 * attempt) - 1;
    square = x * x + y * y;
  }
  const double f = 2 * std::sqrt(1 - square);  // Marsaglia 1972
  const glm::dvec3 on_sphere(x * f, y * f, 1 - 2 * square);
  return glm::normalize(n * (1 + 1e-9) + on_sphere);
}

}  // namespace

MeasuredError measure_error(const Baked& baked, uint64_t rays) {
  constexpr uint32_t kNeeded = LSP_FEATURE_EXACT | LSP_FEATURE_LINE_SPACES;
  if ((baked.header.required_features & kNeeded) != kNeeded || baked.triangles.empty()) return {};
  const lsp_scene scene = view(baked);
  const glm::dvec3 extent = vec(baked.header.bounds_max) - vec(baked.header.bounds_min);
  const double diagonal = glm::length(extent);

  // Records that spatial splits repeat count more than once: harmless here, and it spares a set of
  // primitives.
  std::vector<double> area(baked.triangles.size());
  double total = 0;
  for (size_t i = 0; i < area.size(); ++i) {
    const LspTriangle& t = baked.triangles[i];
    total += glm::length(glm::cross(vec(t.v1) - vec(t.v0), vec(t.v2) - vec(t.v0)));
    area[i] = total;
  }

  struct Part {
    uint64_t wrong_hits = 0, wrong_misses = 0, both = 0;
    double depth = 0;
  };
  constexpr uint64_t kPart = 1024;
  std::vector<Part> parts((rays + kPart - 1) / kPart);
  tbb::parallel_for(size_t(0), parts.size(), [&](size_t p) {
    const uint64_t begin = p * kPart, end = std::min(rays, begin + kPart);
    std::vector<LspRay> batch;
    for (uint64_t r = begin; r < end; ++r) {
      const size_t i =
          size_t(std::lower_bound(area.begin(), area.end(), random(r, 0) * total) - area.begin());
      const LspTriangle& t = baked.triangles[std::min(i, area.size() - 1)];
      double u = random(r, 1), v = random(r, 2);
      if (u + v > 1) {
        u = 1 - u;
        v = 1 - v;
      }
      const glm::dvec3 a = vec(t.v1) - vec(t.v0), b = vec(t.v2) - vec(t.v0);
      const glm::dvec3 n = glm::normalize(glm::cross(a, b));
      const glm::dvec3 o = vec(t.v0) + a * u + b * v + n * (1e-4 * diagonal);
      const glm::dvec3 d = cosine_direction(n, r);
      batch.push_back(
          {{float(o.x), float(o.y), float(o.z)}, 0, {float(d.x), float(d.y), float(d.z)}, INFINITY});
    }
    std::vector<LspHit> exact(batch.size()), approximate(batch.size());
    const lsp_trace_options exact_options = {0, 0}, approximate_options = {LSP_TRACE_APPROXIMATE, 0};
    lsp_trace(&scene, &exact_options, batch.data(), exact.data(), batch.size(), nullptr, nullptr);
    lsp_trace(&scene, &approximate_options, batch.data(), approximate.data(), batch.size(), nullptr, nullptr);
    baked.line_spaces.words.release();
    baked.line_spaces.candidates.release();
    for (size_t i = 0; i < batch.size(); ++i) {
      const bool truth = exact[i].primitive != LSP_NONE, answer = approximate[i].primitive != LSP_NONE;
      parts[p].wrong_hits += answer && !truth;
      parts[p].wrong_misses += truth && !answer;
      if (!truth || !answer) continue;
      ++parts[p].both;
      parts[p].depth += std::fabs(double(approximate[i].t) - double(exact[i].t));
    }
  });
  MeasuredError error;
  error.rays = rays;
  uint64_t both = 0;
  double depth = 0;
  for (const Part& p : parts) {
    error.wrong_hits += p.wrong_hits;
    error.wrong_misses += p.wrong_misses;
    both += p.both;
    depth += p.depth;
  }
  error.depth_error = both && diagonal > 0 ? depth / double(both) / diagonal : 0;
  return error;
}

}  // namespace lsp
