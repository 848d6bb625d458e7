// The bounds of runtime/NUMERICS.md against what the tracer does: the worst measured error of each step, in
// shares of its bound, is below one; and the margins are what the document says.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <iostream>

#include "variants.h"

namespace lsp::stress {
namespace {

using Real = long double;

uint64_t cases() {
  const char* text = std::getenv("LSP_STRESS_RAYS");
  return text ? std::strtoull(text, nullptr, 10) : 400000;
}

// A random triangle of any shape seen from anywhere, and a ray at it.
struct Trial {
  std::array<glm::vec3, 3> corners;
  LspRay ray;
};
Trial trial(Random& random) {
  const auto real = [&](double lo, double hi) { return lo + (hi - lo) * random.uniform(); };
  const auto vector = [&](double size) {
    return glm::dvec3(real(-size, size), real(-size, size), real(-size, size));
  };
  Trial result;
  const glm::dvec3 centre = vector(1);
  const double size = std::pow(10.0, real(-4, 0.5)), other = size * std::pow(10.0, real(-4, 0));
  const glm::dvec3 a = centre, b = centre + vector(size), c = centre + vector(other);
  result.corners = {glm::vec3(a), glm::vec3(b), glm::vec3(c)};
  double u = random.uniform(), v = random.uniform();
  if (u + v > 1) u = 1 - u, v = 1 - v;
  if (random.below(3) == 0) v = 0;  // at an edge
  const glm::dvec3 at = (1 - u - v) * a + u * b + v * c + vector(1e-7 * real(0, 1));
  const glm::dvec3 origin = random.below(2) == 0 ? vector(2) : at + vector(std::pow(10.0, real(-5, 0)));
  const glm::vec3 o(origin), d(at - glm::dvec3(o));
  result.ray = {{o.x, o.y, o.z}, -INFINITY, {d.x, d.y, d.z}, INFINITY};
  if (d == glm::vec3(0)) result.ray.direction.x = 1;
  return result;
}

// A scene of one triangle, as lsp_setup and lsp_triangle see it.
struct OneTriangle {
  LspHeader header{};
  LspTriangle record{};
  lsp_scene scene{};
  explicit OneTriangle(const Trial& trial) {
    const auto& c = trial.corners;
    record = {{c[0].x, c[0].y, c[0].z}, 0, {c[1].x, c[1].y, c[1].z}, 0, {c[2].x, c[2].y, c[2].z}, 0};
    const glm::vec3 lo = glm::min(c[0], glm::min(c[1], c[2])), hi = glm::max(c[0], glm::max(c[1], c[2]));
    header.bounds_min = {lo.x, lo.y, lo.z};
    header.bounds_max = {hi.x, hi.y, hi.z};
    header.triangle_count = 1;
    scene.header = &header;
    scene.triangles = &record;
  }
};

// The test of a triangle decides as exact arithmetic on corners moved by 5 sqrt(2) u R across the ray would,
// and its depth is within the bound of the ideal one.
TEST(Numerics, TriangleTestKeepsItsBounds) {
  Random random(3);
  double worst_edge = 0, worst_depth = 0;
  uint64_t hits = 0;
  for (uint64_t i = 0; i < cases(); ++i) {
    const Trial t = trial(random);
    const OneTriangle one(t);
    ReferenceRay ray;
    ASSERT_TRUE(reference_ray(t.ray, &ray));
    const Ideal it = ideal(ray, t.corners);
    float depth = 0;
    const bool hit = sound::triangle(one.scene, t.ray, 0, &depth);
    hits += hit;
    // A wrong decision is as wrong as the ray is far from the border.
    if (hit != (it.edge > 0)) worst_edge = std::max(worst_edge, std::abs(it.edge) / it.edge_band);
    if (hit && std::isfinite(it.t_band)) {
      worst_depth = std::max(worst_depth, std::abs(double{depth} - it.t) / it.t_band);
    }
  }
  std::cout << cases() << " triangles, " << hits << " hits: wrong side of an edge by at most " << worst_edge
            << " of the bound, depth off by at most " << worst_depth << " of the bound\n";
  EXPECT_GT(hits, cases() / 4);
  EXPECT_LT(worst_edge, 1);
  EXPECT_LT(worst_depth, 1);
  // Neither bound is so wide that it says nothing.
  EXPECT_GT(worst_edge, 0.05);
  EXPECT_GT(worst_depth, 0.05);
}

// From a point to a triangle (Ericson, "Real-Time Collision Detection", 2004, section 5.1.5).
double distance(const glm::dvec3& p, const std::array<glm::vec3, 3>& corners) {
  const glm::dvec3 a(corners[0]), b(corners[1]), c(corners[2]);
  const auto to_edge = [&](const glm::dvec3& from, const glm::dvec3& to) {
    const glm::dvec3 e = to - from;
    const double along = glm::dot(e, e) == 0 ? 0 : glm::dot(p - from, e) / glm::dot(e, e);
    return glm::distance(p, from + std::clamp(along, 0.0, 1.0) * e);
  };
  const glm::dvec3 n = glm::cross(b - a, c - a);
  const auto is_inside = [&](const glm::dvec3& from, const glm::dvec3& to) {
    return glm::dot(glm::cross(to - from, p - from), n) >= 0;
  };
  if (glm::dot(n, n) > 0 && is_inside(a, b) && is_inside(b, c) && is_inside(c, a))
    return std::abs(glm::dot(p - a, n)) / glm::length(n);
  return std::min({to_edge(a, b), to_edge(b, c), to_edge(c, a)});
}

// The farthest that a hit lies from its triangle, in u R, of rays along it: in its plane, or off it by
// anything from a rounding to a tenth.
using TriangleTest = bool (*)(const lsp_scene&, const LspRay&, uint32_t, float*);
double farthest_off(TriangleTest test, uint64_t count, uint64_t* hits) {
  Random random(11);
  double worst = 0;
  for (uint64_t i = 0; i < count; ++i) {
    Trial t = trial(random);
    const glm::dvec3 a(t.corners[0]), b(t.corners[1]), c(t.corners[2]);
    const auto in_plane = [&] {
      return a + (3 * random.uniform() - 1) * (b - a) + (3 * random.uniform() - 1) * (c - a);
    };
    const glm::dvec3 n = glm::cross(b - a, c - a);
    const double length = glm::length(n);
    if (length == 0) continue;
    const double off = glm::length(b - a) * std::pow(10.0, -1 - 8 * random.uniform());
    const glm::vec3 o(in_plane() + n / length * off), d(in_plane() - glm::dvec3(o));
    t.ray = {{o.x, o.y, o.z}, -INFINITY, {d.x, d.y, d.z}, INFINITY};
    const float largest = std::max({std::fabs(d.x), std::fabs(d.y), std::fabs(d.z)});
    const OneTriangle one(t);
    float depth = 0;
    if (largest == 0 || !test(one.scene, t.ray, 0, &depth)) continue;
    ++*hits;
    double reach = 0;
    for (const glm::vec3& corner : t.corners)
      for (int k = 0; k < 3; ++k) reach = std::max(reach, std::abs(double(corner[k]) - double(o[k])));
    const glm::dvec3 at = glm::dvec3(o) + glm::dvec3(d) * std::exp2(-std::ilogb(largest)) * double(depth);
    worst = std::max(worst, distance(at, t.corners) / (kU * reach));
  }
  return worst;
}

// A ray along a triangle meets it where it is, however little the plane says about where.
TEST(Numerics, HitsLieAtTheirTriangles) {
  uint64_t hits = 0;
  const double worst = farthest_off(sound::triangle, cases(), &hits);
  std::cout << hits << " hits: off their triangle by at most " << worst << " u R\n";
  EXPECT_GT(hits, cases() / 100);
  EXPECT_LT(worst, 40);
  // Each of the two things that see to it is missed where it is not.
  EXPECT_GT(farthest_off(hit_beside::triangle, 100000, &hits), 1000);
  EXPECT_GT(farthest_off(plane_alone::triangle, 100000, &hits), 1000);
}

// Where a triangle is hit its box is, and the entry is not behind the hit: what the margin is for. The margin
// that would have been needed, found by bisection on boxes shrunk by hand, stays below the one there is.
TEST(Numerics, BoxMarginIsEnough) {
  Random random(4);
  double most_needed = 0;
  uint64_t hits = 0;
  for (uint64_t i = 0; i < cases(); ++i) {
    Trial t = trial(random);
    if (random.below(2) == 0) {  // a wall: its box has no thickness
      const auto axis = static_cast<int>(random.below(3));
      t.corners[1][axis] = t.corners[2][axis] = t.corners[0][axis];
    }
    const OneTriangle one(t);
    float depth = 0;
    if (!sound::triangle(one.scene, t.ray, 0, &depth)) continue;
    ++hits;
    float entry = 0;
    ASSERT_TRUE(sound::box(one.scene, t.ray, one.header.bounds_min, one.header.bounds_max, &entry));
    ASSERT_LE(entry, depth) << "the box begins behind the hit";
    // How much of the margin it took: shrink the box by a share of the margin until it is missed.
    const lsp_float3 &lo = one.header.bounds_min, &hi = one.header.bounds_max, &o = t.ray.origin;
    const float reach = std::max({std::fabs(lo.x - o.x), std::fabs(hi.x - o.x), std::fabs(lo.y - o.y),
                                  std::fabs(hi.y - o.y), std::fabs(lo.z - o.z), std::fabs(hi.z - o.z)});
    const float largest = std::max({std::fabs(o.x), std::fabs(o.y), std::fabs(o.z)});
    const float margin = static_cast<float>(16 * kU) * reach + static_cast<float>(4 * kU) * largest;
    double share = 0, step = 0.5;
    for (int k = 0; k < 6; ++k, step /= 2) {
      const auto shrink = static_cast<float>(share + step) * margin;
      const lsp_float3 small_lo{lo.x + shrink, lo.y + shrink, lo.z + shrink};
      const lsp_float3 small_hi{hi.x - shrink, hi.y - shrink, hi.z - shrink};
      if (sound::box(one.scene, t.ray, small_lo, small_hi, &entry) && entry <= depth) share += step;
    }
    most_needed = std::max(most_needed, 1 - share);
  }
  std::cout << hits << " hits: at most " << most_needed << " of the margin was needed\n";
  EXPECT_GT(hits, cases() / 4);
  EXPECT_LT(most_needed, 0.9);
}

// The slab planes of the box test: off by at most 4 u R along the axis, margin apart.
TEST(Numerics, SlabPlanesKeepTheirBound) {
  Random random(5);
  double worst = 0;
  for (uint64_t i = 0; i < cases(); ++i) {
    const Trial t = trial(random);
    const OneTriangle one(t);
    ReferenceRay ray;
    ASSERT_TRUE(reference_ray(t.ray, &ray));
    // The entry plane of a box that the ray certainly enters: one slab alone decides when the others are
    // wide.
    const auto axis = static_cast<int>(random.below(3));
    if (std::abs(ray.direction[axis]) < 1e-3) continue;
    const bool up = ray.direction[axis] > 0;
    lsp_float3 lo{-100, -100, -100}, hi{100, 100, 100};
    const auto plane = static_cast<float>(2 * random.uniform() - 1);
    (&lo.x)[axis] = up ? plane : -50;
    (&hi.x)[axis] = up ? 50 : plane;
    float entry = 0;
    OneTriangle wide(t);
    wide.header.bounds_min = lo;
    wide.header.bounds_max = hi;
    LspRay line = t.ray;
    line.tmin = -1e30f;
    if (!sound::box(wide.scene, line, lo, hi, &entry)) continue;
    double reach = 0, largest = 0;
    for (int k = 0; k < 3; ++k) {
      reach = std::max({reach, std::abs((&lo.x)[k] - ray.origin[k]), std::abs((&hi.x)[k] - ray.origin[k])});
      largest = std::max(largest, std::abs(ray.origin[k]));
    }
    const double margin = 16 * kU * reach + 4 * kU * largest;
    const double ideal_entry = (plane + (up ? -margin : margin) - ray.origin[axis]) / ray.direction[axis];
    double others = -INFINITY;
    for (int k = 0; k < 3; ++k) {
      if (k == axis || ray.direction[k] == 0) continue;
      others = std::max(others, std::min(((&lo.x)[k] - ray.origin[k]) / ray.direction[k],
                                         ((&hi.x)[k] - ray.origin[k]) / ray.direction[k]));
    }
    if (others > ideal_entry - 1e-3) continue;
    // The plane, and the rounding of o + err.
    const double bound = 4 * kU * std::abs(plane - ray.origin[axis]) + 2 * kU * largest + 4 * kU * margin;
    worst = std::max(worst, std::abs(entry - ideal_entry) * std::abs(ray.direction[axis]) / bound);
  }
  std::cout << "slab planes off by at most " << worst << " of the bound\n";
  EXPECT_GT(worst, 0.1);
  EXPECT_LT(worst, 1);
}

}  // namespace
}  // namespace lsp::stress
