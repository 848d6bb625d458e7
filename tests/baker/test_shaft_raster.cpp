// Rays of shafts answered by projection, against every triangle tested in double precision.
#include <gtest/gtest.h>

#include <cmath>
#include <glm/glm.hpp>
#include <random>

#include "hits_by_definition.h"
#include "shaft_raster.h"

namespace lsp::test {
namespace {

struct Case {
  const char* name;
  float smallest, largest;  // size of the triangles, in boxes
  float reach;              // how far from the box's middle they lie, in boxes
  float scale;
};

class ShaftRasters : public testing::TestWithParam<Case> {};

TEST_P(ShaftRasters, HitWhatIsInTheWayFromEverySideToEverySide) {
  const Case& c = GetParam();
  std::mt19937 random(7);
  const auto uniform = [&](float lo, float hi) { return lo + (hi - lo) * float(random() >> 8) * 0x1p-24f; };
  const auto somewhere = [&](float r) { return glm::vec3(uniform(-r, r), uniform(-r, r), uniform(-r, r)); };
  const glm::vec3 middle = c.scale * glm::vec3(3, -2, 1), half = c.scale * glm::vec3(0.5f, 0.3f, 0.8f);
  const glm::vec3 lo = middle - half, hi = middle + half;
  const uint32_t n = 5;

  std::vector<LspTriangle> triangles;
  ShaftRaster raster(lo, hi, n);
  for (uint32_t i = 0; i < 60; ++i) {
    const glm::vec3 at = middle + somewhere(c.reach) * c.scale;
    const float size = uniform(c.smallest, c.largest) * c.scale;
    LspTriangle tri{};
    for (lsp_float3* corner : {&tri.v0, &tri.v1, &tri.v2}) {
      const glm::vec3 p = at + somewhere(size);
      *corner = {p.x, p.y, p.z};
    }
    raster.add(tri, i);
    triangles.push_back(tri);
  }
  EXPECT_EQ(raster.size(), triangles.size());

  size_t hits = 0, doubtful = 0, rays = 0;
  std::vector<glm::vec3> ends(n * n);
  std::vector<float> t(n * n);
  std::vector<uint32_t> records(n * n);
  for (uint32_t in = 0; in < 6; ++in)
    for (uint32_t out = 0; out < 6; ++out) {
      if (in == out) continue;
      for (int k = 0; k < 20; ++k) {
        glm::vec3 origin = lo + (hi - lo) * glm::vec3(uniform(0, 1), uniform(0, 1), uniform(0, 1));
        origin[int(in / 2)] = (in % 2 ? hi : lo)[int(in / 2)];
        const float x = uniform(0, 0.999f), y = uniform(0, 0.999f);
        const int axis = int(out / 2), u = axis == 0 ? 1 : 0, v = axis == 2 ? 1 : 2;
        for (uint32_t q = 0; q < n * n; ++q) {
          ends[q][axis] = (out % 2 ? hi : lo)[axis];
          ends[q][u] = lo[u] + (hi[u] - lo[u]) * (float(q % n) + x) / float(n);
          ends[q][v] = lo[v] + (hi[v] - lo[v]) * (float(q / n) + y) / float(n);
        }
        raster.cast(origin, out, x, y, ends, {t, records});
        for (uint32_t q = 0; q < n * n; ++q) {
          const Answer expected =
              by_definition(triangles, glm::dvec3(origin), glm::dvec3(ends[q]) - glm::dvec3(origin));
          ++rays;
          if (expected.doubtful || (t[q] > 1e-4f && t[q] < 3e-4f)) {
            ++doubtful;
            continue;
          }
          hits += expected.record != LSP_NONE ? 1 : 0;
          ASSERT_EQ(records[q], expected.record) << "from side " << in << " to patch " << q << " of side "
                                                 << out << ", t " << t[q] << " and " << expected.t;
          ASSERT_NEAR(t[q], expected.t, 1e-4);
        }
      }
    }
  EXPECT_GT(hits, rays / 20);
  EXPECT_LT(doubtful, rays / 10);
}

INSTANTIATE_TEST_SUITE_P(Sizes, ShaftRasters,
                         testing::Values(Case{"small", 0.05f, 0.3f, 0.5f, 1.0f},
                                         Case{"reaching_out", 0.5f, 3.0f, 1.0f, 1.0f},
                                         Case{"huge", 5.0f, 100.0f, 2.0f, 1.0f},
                                         Case{"in_micrometres", 0.05f, 3.0f, 0.7f, 1e-6f}),
                         [](const auto& info) { return info.param.name; });

TEST(ShaftRaster, OfEqualHitsTakesTheSmallestRecord) {
  const LspTriangle wall{{-9, -9, 0}, 0, {9, -9, 0}, 0, {0, 9, 0}, 0};
  for (const bool descending : {false, true}) {
    ShaftRaster raster({-1, -1, -1}, {1, 1, 1}, 1);
    for (uint32_t i = 0; i < 3; ++i) raster.add(wall, descending ? 7 - i : 5 + i);
    const std::vector<glm::vec3> ends = {{0, 0, 1}};
    std::vector<float> t(1);
    std::vector<uint32_t> records(1);
    raster.cast({0, 0, -1}, 5, 0.5f, 0.5f, ends, {t, records});
    EXPECT_EQ(records[0], 5u);
    EXPECT_EQ(t[0], 0.5f);
  }
}

}  // namespace
}  // namespace lsp::test
