// The judges must be right before anything is judged by them.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <set>

#include "embree_scene.h"
#include "leaks.h"
#include "rays.h"
#include "verdict.h"

namespace lsp::bench {
namespace {

Soup soup_from(std::vector<std::array<glm::vec3, 3>> corners) {
  Soup soup;
  soup.corners = std::move(corners);
  soup.lo = glm::dvec3(INFINITY);
  soup.hi = glm::dvec3(-INFINITY);
  for (uint32_t i = 0; i < soup.size(); ++i) {
    soup.primitives.push_back(i);
    soup.triangle_of.push_back(i);
    for (const glm::vec3& c : soup.corners[i]) {
      soup.lo = glm::min(soup.lo, glm::dvec3(c));
      soup.hi = glm::max(soup.hi, glm::dvec3(c));
    }
  }
  soup.diagonal = glm::length(soup.hi - soup.lo);
  return soup;
}

// A sphere of bands and segments, corners shared bitwise: closed, outward.
Soup sphere(int bands, int segments, glm::vec3 centre = glm::vec3(0), float radius = 1) {
  const auto at = [&](int band, int segment) {
    const double theta = M_PI * band / bands, phi = 2 * M_PI * (segment % segments) / segments;
    if (band == 0) return centre + glm::vec3(0, radius, 0);
    if (band == bands) return centre + glm::vec3(0, -radius, 0);
    return centre + radius * glm::vec3(std::sin(theta) * std::cos(phi), std::cos(theta),
                                       -std::sin(theta) * std::sin(phi));
  };
  std::vector<std::array<glm::vec3, 3>> corners;
  for (int b = 0; b < bands; ++b) {
    for (int s = 0; s < segments; ++s) {
      if (b > 0) corners.push_back({at(b, s), at(b + 1, s), at(b, s + 1)});
      if (b + 1 < bands) corners.push_back({at(b, s + 1), at(b + 1, s), at(b + 1, s + 1)});
    }
  }
  return soup_from(corners);
}

LspHit hit_of(float t, uint32_t primitive) { return {t, primitive, 0, 0, {0, 0, 0}, 0}; }
const LspHit kMiss = hit_of(INFINITY, LSP_NONE);

TEST(Random, IsThePublishedGenerator) {
  // First outputs of pcg32_srandom_r(42, 54) in the authors' demo program.
  Random random(42, 54);
  EXPECT_EQ(random.next(), 0xa15c02b7u);
  EXPECT_EQ(random.next(), 0x7b47f409u);
  EXPECT_EQ(random.next(), 0xba1d3330u);
}

TEST(Soup, TellsClosedFromOpen) {
  Soup soup = sphere(8, 12);
  EXPECT_EQ(open_edges(soup), 0u);
  soup.corners.pop_back();
  EXPECT_EQ(open_edges(soup), 3u);
}

TEST(Rays, AreTheSameEverywhere) {
  const Soup soup = soup_from({{glm::vec3(0), glm::vec3(1, 0, 0), glm::vec3(0, 1, 0)}});
  const auto a = surface_rays(soup, 1000, 5), b = surface_rays(soup, 1000, 5),
             c = surface_rays(soup, 1000, 6);
  EXPECT_EQ(std::memcmp(a.data(), b.data(), a.size() * sizeof(LspRay)), 0);
  EXPECT_NE(std::memcmp(a.data(), c.data(), a.size() * sizeof(LspRay)), 0);
}

TEST(Rays, AreAreaWeightedAndCosineDistributed) {
  // Two triangles, areas 1 to 3, both facing +z.
  const Soup soup = soup_from({{glm::vec3(0), glm::vec3(1, 0, 0), glm::vec3(0, 1, 0)},
                               {glm::vec3(10, 0, 0), glm::vec3(13, 0, 0), glm::vec3(10, 1, 0)}});
  const size_t count = 40000;
  size_t on_first = 0;
  double mean_cosine = 0, mean_cosine_squared = 0;
  for (const LspRay& ray : surface_rays(soup, count, 1)) {
    on_first += ray.origin.x < 5;
    EXPECT_NEAR(ray.origin.z, 1e-4 * soup.diagonal, 1e-9);
    mean_cosine += ray.direction.z / count;
    mean_cosine_squared += ray.direction.z * ray.direction.z / count;
  }
  EXPECT_NEAR(static_cast<double>(on_first) / count, 0.25, 0.001);  // stratified
  EXPECT_NEAR(mean_cosine, 2.0 / 3, 0.005);
  EXPECT_NEAR(mean_cosine_squared, 1.0 / 2, 0.005);
}

TEST(Rays, ShuffledOrderHoldsTheSameRays) {
  const Soup soup = sphere(8, 12);
  Random random(3);
  const auto ordered = cosine_rays(soup, area_points(soup, 500, random), 2, random);
  auto shuffled = ordered;
  shuffle(shuffled, random);
  const auto key = [](const LspRay& ray) {
    return std::array<float, 4>{ray.origin.x, ray.origin.y, ray.direction.x, ray.direction.y};
  };
  std::multiset<std::array<float, 4>> a, b;
  for (const LspRay& ray : ordered) a.insert(key(ray));
  for (const LspRay& ray : shuffled) b.insert(key(ray));
  EXPECT_EQ(a, b);
  EXPECT_NE(std::memcmp(ordered.data(), shuffled.data(), ordered.size() * sizeof(LspRay)), 0);
}

TEST(Rays, ShadowRaysEndAtTheLight) {
  const Soup soup = sphere(8, 12);
  Random random(3);
  const auto points = area_points(soup, 400, random);
  const auto rays = shadow_rays(soup, points, 1, glm::dvec3(0, 5, 0), 0.5, random);
  EXPECT_GT(rays.size(), 100u);
  EXPECT_LT(rays.size(), 300u);  // the far side faces away
  for (const LspRay& ray : rays) {
    EXPECT_EQ(ray.tmax, 1.0f);
    const glm::vec3 end(ray.origin.x + ray.direction.x, ray.origin.y + ray.direction.y,
                        ray.origin.z + ray.direction.z);
    EXPECT_LT(glm::length(end - glm::vec3(0, 5, 0)), 0.51f);
  }
}

TEST(Camera, LooksFromInsideARoomAndFromOutsideAtAnObject) {
  const Soup ball = sphere(16, 24, glm::vec3(0), 5);
  Soup turned = ball;
  for (auto& corners : turned.corners) std::swap(corners[1], corners[2]);
  const Soup room = turned;
  const Soup object = soup_from({{glm::vec3(0), glm::vec3(1, 0, 0), glm::vec3(0, 1, 0)},
                                 {glm::vec3(0, 0, 1), glm::vec3(1, 0, 1), glm::vec3(0, 1, 1)}});
  for (const Soup* soup : {&room, &object, &ball}) {
    const EmbreeScene embree(*soup, EmbreeMode::kRobust, 1);
    const Camera camera = choose_camera(
        *soup, [&](auto rays, auto hits) { embree.closest(rays, hits); }, 32, 32);
    const bool inside =
        glm::all(glm::lessThan(camera.eye, soup->hi)) && glm::all(glm::greaterThan(camera.eye, soup->lo));
    EXPECT_EQ(inside, soup == &room);
    Random random(1);
    const auto rays = camera_rays(camera, random);
    std::vector<LspHit> hits(rays.size());
    embree.closest(rays, hits);
    EXPECT_GT(visible_points(*soup, rays, hits).size(), soup == &object ? 20u : 200u);
    for (const SurfacePoint& point : visible_points(*soup, rays, hits)) {
      EXPECT_GT(glm::dot(point.normal, camera.eye - point.position), 0);
    }
  }
}

TEST(IdealHit, KnowsInsideOutsideAndEdges) {
  const std::array<glm::vec3, 3> triangle = {glm::vec3(0), glm::vec3(1, 0, 0), glm::vec3(0, 1, 0)};
  const auto shoot = [&](float x, float y) { return ideal_hit({{x, y, 2}, 0, {0, 0, -4}, 1}, triangle); };
  EXPECT_TRUE(shoot(0.25f, 0.25f).inside);
  EXPECT_DOUBLE_EQ(shoot(0.25f, 0.25f).t, 0.5);
  EXPECT_NEAR(shoot(0.25f, 0.125f).edge_distance, 0.125, 1e-15);
  EXPECT_FALSE(shoot(-0.25f, 0.25f).inside);
  EXPECT_NEAR(shoot(-0.25f, 0.25f).edge_distance, -0.25, 1e-15);
  EXPECT_TRUE(shoot(0.5f, 0.5f).inside);
  EXPECT_TRUE(shoot(0.5f, 0.5f).graze());
  EXPECT_FALSE(shoot(0.25f, 0.25f).graze());
  EXPECT_TRUE(shoot(0.5f, -1e-7f).graze());
  EXPECT_FALSE(shoot(0.5f, -1e-7f).inside);
  EXPECT_FALSE(ideal_hit({{0.25f, 0.25f, 2}, 0, {0, 0, -4}, 0.25f}, triangle).inside);  // beyond tmax
}

TEST(IdealHit, GrazesWhatItRunsAlong) {
  const std::array<glm::vec3, 3> corners = {glm::vec3(0, 0, 0), glm::vec3(1, 0, 0), glm::vec3(0, 1, 0)};
  const auto along = [&](float y, float z) {
    return ideal_hit({{-1, y, z}, 0, {2, 0, 0}, INFINITY}, corners);
  };
  EXPECT_TRUE(along(0.25f, 0).graze());
  EXPECT_EQ(along(0.25f, 0).t, 0.5);
  EXPECT_TRUE(along(0, 0).graze());  // along an edge
  EXPECT_TRUE(along(0.25f, 1e-7f).graze());
  EXPECT_FALSE(along(0.25f, 0.1f).graze());  // above it
  EXPECT_NEAR(along(0.25f, 0.1f).edge_distance, -0.1, 1e-8);
  EXPECT_FALSE(along(1.5f, 0).graze());  // beside it
  EXPECT_NEAR(along(1.5f, 0).edge_distance, -0.5, 1e-12);
  for (const float z : {0.0f, 0.1f}) EXPECT_FALSE(along(0.25f, z).inside);
}

TEST(Verdict, TellsWhoIsRight) {
  const Soup soup = soup_from({{glm::vec3(0), glm::vec3(1, 0, 0), glm::vec3(0, 1, 0)},
                               {glm::vec3(0, 0, -1), glm::vec3(1, 0, -1), glm::vec3(0, 1, -1)}});
  const LspRay ray{{0.25f, 0.25f, 1}, 0, {0, 0, -1}, INFINITY};
  const LspHit near = hit_of(1, 0), far = hit_of(2, 1);
  EXPECT_EQ(judge(soup, ray, near, near), Verdict::kAgree);
  EXPECT_EQ(judge(soup, ray, near, far), Verdict::kReferenceWrong);
  EXPECT_EQ(judge(soup, ray, far, near), Verdict::kOursWrong);
  EXPECT_EQ(judge(soup, ray, kMiss, near), Verdict::kOursWrong);
  EXPECT_EQ(judge(soup, ray, kMiss, far), Verdict::kBothWrong);
  EXPECT_EQ(judge(soup, ray, hit_of(1, 0), hit_of(1.000001f, 1)), Verdict::kTie);
  const LspRay graze{{0.5f, 0.5f, 1}, 0, {0, 0, -1}, INFINITY};
  EXPECT_EQ(judge(soup, graze, kMiss, near), Verdict::kGraze);
  EXPECT_EQ(judge(soup, graze, far, near), Verdict::kGraze);
  // Two planes a float step apart at that distance.
  const Soup thin =
      soup_from({{glm::vec3(0, 0, 1000), glm::vec3(1, 0, 1000), glm::vec3(0, 1, 1000)},
                 {glm::vec3(0, 0, 999.99994f), glm::vec3(1, 0, 999.99994f), glm::vec3(0, 1, 999.99994f)}});
  const LspRay close{{0.25f, 0.25f, 1001}, 0, {0, 0, -1}, INFINITY};
  EXPECT_EQ(judge(thin, close, hit_of(1, 0), hit_of(1.00006f, 1)), Verdict::kUnresolved);
  // A graze excuses no one who misses what lies plainly there.
  Soup backed = soup;
  backed.corners[1] = {glm::vec3(-5, -5, -1), glm::vec3(9, -5, -1), glm::vec3(-5, 9, -1)};
  EXPECT_EQ(judge(backed, graze, kMiss, near), Verdict::kOursWrong);
}

TEST(Embree, EveryCallAgreesWithTheIdealTest) {
  const Soup soup = sphere(12, 16, glm::vec3(3, 1, 2), 2);
  auto rays = surface_rays(soup, 2003, 9);       // no multiple of any packet
  for (size_t i = 0; i < rays.size(); i += 2) {  // half of them inward, so that both answers occur
    rays[i].direction = {-rays[i].direction.x, -rays[i].direction.y, -rays[i].direction.z};
  }
  for (EmbreeMode mode : {EmbreeMode::kRobust, EmbreeMode::kFast}) {
    const EmbreeScene embree(soup, mode, 1);
    EXPECT_GT(embree.bytes(), 0u);
    for (EmbreeCall call :
         {EmbreeCall::kSingle, EmbreeCall::kPacket8, EmbreeCall::kPacket16, EmbreeCall::kStream}) {
      std::vector<LspHit> closest(rays.size()), any(rays.size());
      embree.closest(rays, closest, call);
      embree.any(rays, any, call);
      size_t hits = 0, wrong = 0;
      for (size_t i = 0; i < rays.size(); ++i) {
        IdealHit ideal;
        const auto triangle = ideal_closest(soup, rays[i], &ideal);
        hits += triangle.has_value();
        wrong += triangle.has_value() != (closest[i].primitive != LSP_NONE);
        wrong += triangle.has_value() != (any[i].primitive != LSP_NONE);
        if (triangle && closest[i].primitive != LSP_NONE) {
          EXPECT_NEAR(closest[i].t, ideal.t, 1e-4 * (ideal.t + 0.01));
        }
      }
      EXPECT_GT(hits, 500u);
      EXPECT_LT(hits, 1900u);
      EXPECT_LE(wrong, mode == EmbreeMode::kRobust ? 2u : 6u);
    }
  }
}

TEST(Leaks, RaysAimAtEdgesOfAClosedMesh) {
  const Soup soup = sphere(24, 32, glm::vec3(0.1f, -0.3f, 7), 0.7f);
  Random random(11);
  const auto origins = interior_points(soup, 8, random);
  ASSERT_EQ(origins.size(), 8u);
  for (const glm::dvec3& origin : origins) EXPECT_LT(glm::length(origin - glm::dvec3(0.1, -0.3, 7)), 0.7);
  const auto inside = inside_leak_rays(soup, origins, 3000);
  const auto outside = outside_leak_rays(soup, 6000, random);
  EXPECT_GT(inside.size(), 2000u);
  EXPECT_GT(outside.size(), 2000u);
  const EmbreeScene embree(soup, EmbreeMode::kRobust, 1);
  for (const auto* rays : {&inside, &outside}) {
    std::vector<LspHit> hits(rays->size());
    embree.closest(*rays, hits);
    // Embree's robust mode is not watertight to the last ray: what it may lose are grazes only.
    size_t lost = 0;
    for (size_t i = 0; i < rays->size(); ++i) {
      if (hits[i].primitive != LSP_NONE) continue;
      IdealHit ideal;
      EXPECT_FALSE(ideal_closest(soup, (*rays)[i], &ideal)) << "ray " << i;
      ++lost;
    }
    EXPECT_LE(lost, 3u);
  }
}

}  // namespace
}  // namespace lsp::bench
