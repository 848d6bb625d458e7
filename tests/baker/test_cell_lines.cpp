// What lines through a cell meet first and last, against every triangle tested in double precision.
#include <gtest/gtest.h>

#include <numeric>
#include <random>

#include "cells/cell_lines.h"
#include "hits_by_definition.h"

namespace lsp::test {
namespace {

struct Case {
  const char* name;
  uint32_t count;           // of triangles
  float smallest, largest;  // size of the triangles, in cells
  float reach;              // how far from the cell's middle they lie, in cells
  float scale;
};

class CellLinesOf : public testing::TestWithParam<Case> {
 protected:
  float uniform(float lo, float hi) { return lo + (hi - lo) * float(random_() >> 8) * 0x1p-24f; }
  glm::vec3 somewhere(float r) { return {uniform(-r, r), uniform(-r, r), uniform(-r, r)}; }

  std::vector<LspTriangle> triangles(const glm::vec3& middle) {
    const Case& c = GetParam();
    std::vector<LspTriangle> all;
    for (uint32_t i = 0; i < c.count; ++i) {
      const glm::vec3 at = middle + somewhere(c.reach) * c.scale;
      const float size = uniform(c.smallest, c.largest) * c.scale;
      LspTriangle& t = all.emplace_back();
      for (lsp_float3* corner : {&t.v0, &t.v1, &t.v2}) {
        const glm::vec3 p = at + somewhere(size);
        *corner = {p.x, p.y, p.z};
      }
    }
    return all;
  }

  std::mt19937 random_{7};
};

TEST_P(CellLinesOf, MeetWhatIsInTheWayFirstAndLast) {
  const Case& c = GetParam();
  const glm::vec3 middle = c.scale * glm::vec3(3, -2, 1), lo = middle - 0.5f * c.scale,
                  hi = middle + 0.5f * c.scale;
  const std::vector<LspTriangle> all = triangles(middle);
  std::vector<uint32_t> records(all.size());
  std::iota(records.begin(), records.end(), 0u);
  CellLines lines(all, records, {lo, hi}, 1e-4f * c.scale);
  size_t hits = 0, doubtful = 0, rays = 0;
  CellLines::Hits first, last;
  for (uint32_t in = 0; in < 6; ++in)
    for (uint32_t out = 0; out < 6; ++out) {
      if (in == out) continue;
      for (uint32_t k = 0; k < 20; ++k) {
        glm::vec3 origin = lo + (hi - lo) * glm::vec3(uniform(0, 1), uniform(0, 1), uniform(0, 1));
        origin[int(in / 2)] = (in % 2 ? hi : lo)[int(in / 2)];
        std::vector<glm::vec3> ends(1 + k % CellLines::kMost);
        for (glm::vec3& end : ends) {
          end = lo + (hi - lo) * glm::vec3(uniform(0, 1), uniform(0, 1), uniform(0, 1));
          end[int(out / 2)] = (out % 2 ? hi : lo)[int(out / 2)];
        }
        const glm::vec3 part = c.scale * glm::vec3(0.05f + 0.3f * float(k % 4));
        Box from = {glm::max(origin - part, lo), glm::min(origin + part, hi)};
        from.lo[int(in / 2)] = from.hi[int(in / 2)] = origin[int(in / 2)];
        lines.aim(from, out);
        lines.cast(origin, ends, first, last);
        for (size_t q = 0; q < ends.size(); ++q) {
          const glm::dvec3 o(origin), e(ends[q]);
          const Answer expected = by_definition(all, o, e - o);
          ++rays;
          if (expected.doubtful || (first.t[q] > 1e-4f && first.t[q] < 3e-4f)) {
            ++doubtful;
            continue;
          }
          hits += expected.record != LSP_NONE ? 1 : 0;
          ASSERT_EQ(first.triangle[q], expected.record) << "from side " << in << " to side " << out;
          ASSERT_NEAR(first.t[q], expected.t, 1e-4);
          const Answer back = by_definition(all, e, o - e);
          if (back.doubtful || back.t > 1 - 3e-4 || last.t[q] > 1 - 3e-4f) continue;
          ASSERT_EQ(last.triangle[q], back.record) << "to side " << in << " from side " << out;
          if (back.record != LSP_NONE) {
            ASSERT_NEAR(1 - last.t[q], back.t, 1e-4);
          }
        }
      }
    }
  EXPECT_GT(hits, rays / 20);
  EXPECT_LT(doubtful, rays / 10);
}

INSTANTIATE_TEST_SUITE_P(Sizes, CellLinesOf,
                         testing::Values(Case{"small", 60, 0.05f, 0.3f, 0.5f, 1.0f},
                                         Case{"many", 700, 0.01f, 0.1f, 0.5f, 1.0f},
                                         Case{"one", 1, 0.5f, 0.6f, 0.1f, 1.0f},
                                         Case{"reaching_out", 60, 0.5f, 3.0f, 1.0f, 1.0f},
                                         Case{"huge", 60, 5.0f, 100.0f, 2.0f, 1.0f},
                                         Case{"in_micrometres", 60, 0.05f, 3.0f, 0.7f, 1e-6f}),
                         [](const auto& info) { return info.param.name; });

TEST(CellLines, OfEqualHitsTakeTheSmallestNumber) {
  const LspTriangle wall{{-9, -9, 0}, 0, {9, -9, 0}, 0, {0, 9, 0}, 0};
  const std::vector<LspTriangle> walls(40, wall);
  std::vector<uint32_t> records(walls.size());
  std::iota(records.begin(), records.end(), 0u);
  CellLines lines(walls, records, {glm::vec3(-1), glm::vec3(1)}, 1e-4f);
  CellLines::Hits first, last;
  lines.aim({{-1, -1, -1}, {1, 1, -1}}, 5);
  lines.cast({0, 0, -1}, std::vector<glm::vec3>{{0, 0, 1}}, first, last);
  EXPECT_EQ(first.triangle[0], 0u);
  EXPECT_EQ(last.triangle[0], 0u);
  EXPECT_EQ(first.t[0], 0.5f);
  EXPECT_EQ(last.t[0], 0.5f);
}

}  // namespace
}  // namespace lsp::test
