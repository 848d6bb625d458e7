// The peer that is a distance field: that it is a fair one.
#include <gtest/gtest.h>

#include <cmath>

#include "distance_field.h"
#include "rays.h"
#include "shapes.h"

namespace lsp::bench {
namespace {

// A sphere about the origin, smooth to a two-hundredth of its radius.
constexpr float kRadius = 2;
Soup ball() {
  Triangles triangles;
  add_sphere(triangles, 24, glm::vec3(0), kRadius);
  return soup_of(triangles);
}

TEST(DistanceField, PointQueriesFindTheNearestTriangle) {
  // Over its inside, an edge and a corner.
  const Soup soup = soup_of(Triangles{{glm::vec3(0), glm::vec3(4, 0, 0), glm::vec3(0, 4, 0)}});
  const EmbreeScene embree(soup);
  EXPECT_NEAR(embree.distance({1, 1, 3}, 10), 3, 1e-6);
  EXPECT_NEAR(embree.distance({1, 1, -3}, 10), 3, 1e-6);
  EXPECT_NEAR(embree.distance({2, -3, 4}, 10), 5, 1e-6);
  EXPECT_NEAR(embree.distance({-3, 2, 4}, 10), 5, 1e-6);
  EXPECT_NEAR(embree.distance({4, 4, 0}, 10), std::sqrt(8.0), 1e-6);
  EXPECT_NEAR(embree.distance({-1, -2, 2}, 10), 3, 1e-6);
  EXPECT_NEAR(embree.distance({7, 0, 4}, 10), 5, 1e-6);
  EXPECT_NEAR(embree.distance({0, 7, 4}, 10), 5, 1e-6);
  EXPECT_EQ(embree.distance({1, 1, 3}, 2), 2) << "none is nearer";
}

TEST(DistanceField, HoldsDistancesFineNearSurfaces) {
  const Soup soup = ball();
  const DistanceField field(soup, EmbreeScene(soup), 40, 2);
  EXPECT_EQ(field.size(), glm::uvec3(40));
  EXPECT_EQ(field.bytes(), size_t{40} * 40 * 40);
  EXPECT_GT(field.bake_seconds(), 0);
  EXPECT_NEAR(field.step(), 2 * kRadius / 36, 1e-3);
  Random random(3);
  for (int k = 0; k < 2000; ++k) {
    const glm::dvec3 p(4 * random.uniform() - 2, 4 * random.uniform() - 2, 4 * random.uniform() - 2);
    const double truth = std::abs(glm::length(p) - kRadius);
    const double near_the_surface = truth / field.step() < 4;
    // Trilinear in a cell that the surface passes, a distance is off by up to half a step.
    EXPECT_NEAR(field.distance(glm::vec3(p)), truth, (near_the_surface ? 0.6 : 1.2) * field.step())
        << p.x << " " << p.y << " " << p.z;
  }
}

TEST(DistanceField, RaysFindTheSurface) {
  const Soup soup = ball();
  const DistanceField field(soup, EmbreeScene(soup), 56, 2);
  uint64_t steps = 0;
  // A surface half way between two samples reads half a step at the least: under that threshold it may leak.
  const auto hit = [&](LspRay ray) { return field.trace(ray, 0.75f, &steps); };
  const double close = 0.8 * field.step();
  const LspRay from_outside{{-9, 0.3f, 0}, 0, {2, 0, 0}, INFINITY};  // t counts in lengths of the direction
  EXPECT_NEAR(hit(from_outside).t, (9 - std::sqrt(4 - 0.09)) / 2, close);
  EXPECT_EQ(hit(from_outside).primitive, 0u);
  // From the surface inward it is not its own surface that is met.
  EXPECT_NEAR(hit({{-1.999f, 0, 0}, 0, {1, 0, 0}, INFINITY}).t, 4, close);
  EXPECT_EQ(hit({{2.001f, 0, 0}, 0, {1, 0, 0}, INFINITY}).primitive, LSP_NONE);
  EXPECT_EQ(hit({{-9, 0, 0}, 0, {1, 0, 0}, 6}).primitive, LSP_NONE) << "ends before it";
  EXPECT_EQ(hit({{-9, 0, 0}, 12, {1, 0, 0}, INFINITY}).primitive, LSP_NONE) << "begins behind it";
  EXPECT_EQ(hit({{-9, 5, 0}, 0, {1, 0, 0}, INFINITY}).primitive, LSP_NONE) << "passes beside the grid";
  EXPECT_GT(steps, 10u);
  EXPECT_LT(steps, 1000u);
}

TEST(DistanceField, AFinerOneErrsLess) {
  const Soup soup = soup_of(room_of_spheres(2000));
  const EmbreeScene embree(soup);
  const std::vector<LspRay> rays = surface_rays(soup, 4000, 5);
  std::vector<LspHit> truth(rays.size()), hits(rays.size());
  embree.closest(rays, truth);
  double before = 1;
  for (const unsigned samples : {12, 30, 75}) {
    const DistanceField field(soup, embree, samples, 2);
    field_tracer(field, 0.5f, 2)->trace({}, rays, hits);
    double off = 0;
    for (size_t i = 0; i < rays.size(); ++i) {
      if (hits[i].primitive != LSP_NONE && truth[i].primitive != LSP_NONE)
        off += std::abs(hits[i].t - truth[i].t) / (soup.diagonal * static_cast<double>(rays.size()));
    }
    EXPECT_LT(off, 0.8 * before) << samples;
    before = off;
  }
}

}  // namespace
}  // namespace lsp::bench
