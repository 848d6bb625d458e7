// The NTree: the same answers as the BVH, and a structure that holds what its rules say.
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <array>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <random>

#include "bake.h"
#include "import/import.h"
#include "lsp/lsp.h"
#include "lsp/program.h"
#include "meshes.h"

namespace lsp::test {
namespace {

Baked bake_as(const Mesh& mesh, Base base, uint32_t branching, uint32_t levels, uint32_t leaf_triangles = 8) {
  BakeOptions options;
  options.base = base;
  options.line_spaces = false;
  options.ntree.branching = branching;
  options.ntree.levels = levels;
  options.ntree.leaf_triangles = leaf_triangles;
  return bake(mesh, options);
}

std::vector<LspHit> trace(const Baked& baked, const std::vector<LspRay>& rays, uint32_t flags = 0) {
  const lsp_scene scene = view(baked);
  const lsp_trace_options options = {flags, 0};
  std::vector<LspHit> hits(rays.size());
  EXPECT_EQ(lsp_trace(&scene, &options, rays.data(), hits.data(), rays.size(), nullptr, nullptr), LSP_OK);
  return hits;
}

// Rays from in and around the scene; every second one starts on a plane between cells, every third runs along
// an axis, and so many edges from the scene.
std::vector<LspRay> rays_about(const Baked& ntree, size_t count, float edges_away) {
  std::mt19937 random(5);
  const auto uniform = [&] { return float(random() >> 8) / 16777216.0f; };
  const LspHeader& h = ntree.header;
  const float cell = h.ntree_size / float(std::pow(h.ntree_branching, h.ntree_depth));
  std::vector<LspRay> rays;
  for (size_t i = 0; i < count; ++i) {
    const glm::vec3 lo(h.ntree_lo.x, h.ntree_lo.y, h.ntree_lo.z);
    const glm::vec3 first(h.bounds_min.x, h.bounds_min.y, h.bounds_min.z);
    const glm::vec3 last(h.bounds_max.x, h.bounds_max.y, h.bounds_max.z);
    const glm::vec3 target = first + (last - first) * glm::vec3(uniform(), uniform(), uniform());
    glm::vec3 d = glm::normalize(glm::vec3(uniform(), uniform(), uniform()) - 0.5f + 1e-6f);
    if (i % 3 == 0) {
      d = glm::vec3(0);
      d[int(i / 3 % 3)] = i & 1 ? 1.0f : -1.0f;
    }
    glm::vec3 o = target - d * h.ntree_size * edges_away;
    if (i % 2 == 0 && edges_away < 2)
      for (int a = 0; a < 3; ++a) o[a] = lo[a] + cell * std::round((o[a] - lo[a]) / cell);
    rays.push_back({{o.x, o.y, o.z}, 0, {d.x, d.y, d.z}, INFINITY});
  }
  return rays;
}

// Triangles that share an edge or lie on each other are hit at the same t: either is right.
void expect_same(const Mesh& mesh, uint32_t branching, uint32_t levels, size_t count = 20000) {
  SCOPED_TRACE(testing::Message() << "branching " << branching << ", levels " << levels);
  const Baked bvh = bake_as(mesh, Base::kBvh, 0, 0);
  const Baked ntree = bake_as(mesh, Base::kNTree, branching, levels);
  for (const float edges_away : {0.0f, 0.5f, 1.5f, 50.0f, 2000.0f, 1e6f}) {
    SCOPED_TRACE(edges_away);
    // Far away, rounding is as wide as the scene, and a ray has to look into every cell.
    const std::vector<LspRay> rays = rays_about(ntree, edges_away < 100 ? count : count / 200, edges_away);
    const std::vector<LspHit> truth = trace(bvh, rays), answer = trace(ntree, rays);
    const std::vector<LspHit> any = trace(ntree, rays, LSP_TRACE_ANY_HIT);
    size_t wrong = 0, hits = 0;
    for (size_t i = 0; i < rays.size(); ++i) {
      hits += truth[i].primitive != LSP_NONE;
      wrong +=
          truth[i].t != answer[i].t || (any[i].primitive == LSP_NONE) != (truth[i].primitive == LSP_NONE);
    }
    EXPECT_EQ(wrong, 0u);
    if (edges_away > 0 && edges_away < 2) {
      EXPECT_GT(hits, count / 50);
    }
  }
}

TEST(NTree, AnswersAsTheBvhDoes) {
  for (const uint32_t branching : {2u, 3u, 6u, 16u})
    for (const uint32_t levels : {1u, 2u, 4u}) expect_same(sphere(12), branching, levels, 4000);
  expect_same(soup(3000, 0.3f), 6, 3);
  expect_same(soup(200, 2.0f), 10, 3);
}

TEST(NTree, AnswersOnSceneThatAreFlatTinyOrFarAway) {
  Mesh flat = soup(500, 0.2f);
  for (glm::vec3& p : flat.positions) p.z = 0.25f;
  expect_same(flat, 6, 3);
  Mesh moved = sphere(16);
  for (glm::vec3& p : moved.positions) p += glm::vec3(1e4f, -3e4f, 2e3f);
  expect_same(moved, 6, 3);
  // Far from the origin for its size: rounding is as wide as a cell, then as the scene.
  for (const float away : {1e5f, 1e6f, 1e7f}) {
    Mesh lost = sphere(16);
    for (glm::vec3& p : lost.positions) p.x += away;
    std::erase_if(lost.triangles, [&](const glm::uvec3& t) {
      const glm::vec3 &a = lost.positions[t.x], &b = lost.positions[t.y], &c = lost.positions[t.z];
      return glm::length(glm::cross(b - a, c - a)) == 0;
    });
    const Baked ntree = bake_as(lost, Base::kNTree, 10, 3);
    EXPECT_LT(ntree.ntree.references.size(), 64 * lost.triangles.size()) << away;
    if (away < 1e7f) expect_same(lost, 10, 3, 500);
  }
  Mesh tiny = sphere(16);
  for (glm::vec3& p : tiny.positions) p *= 1e-6f;
  expect_same(tiny, 10, 3);
  Mesh one;
  add_triangle(one, {0, 0, 0}, {1, 0, 0}, {0, 1, 0});
  expect_same(one, 4, 2);
}

class NTreeOfScene : public testing::TestWithParam<const char*> {};
TEST_P(NTreeOfScene, AnswersAsTheBvhDoes) {
  const std::filesystem::path path = std::filesystem::path(LSP_SCENES_DIR) / GetParam();
  if (!std::filesystem::exists(path)) GTEST_SKIP() << path << " is not there";
  expect_same(import_meshes(std::array{path}, {}), 6, 3, 20000);
}
INSTANTIATE_TEST_SUITE_P(Paper, NTreeOfScene, testing::Values("paper/bunny.ply", "paper/sibenik.obj"),
                         [](const auto& info) { return std::filesystem::path(info.param).stem().string(); });

TEST(NTree, IsTheSameOnOneThreadAndOnAll) {
  const Mesh mesh = soup(5000, 0.1f);
  const Baked all = bake_as(mesh, Base::kNTree, 6, 3);
  const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
  const Baked single = bake_as(mesh, Base::kNTree, 6, 3);
  ASSERT_EQ(all.ntree.cells.size(), single.ntree.cells.size());
  EXPECT_EQ(
      memcmp(all.ntree.cells.data(), single.ntree.cells.data(), all.ntree.cells.size() * sizeof(LspCell)), 0);
  EXPECT_EQ(all.ntree.references, single.ntree.references);
}

TEST(NTree, CutsOnlyCellsWithMoreTrianglesThanALeafMayHave) {
  const Baked baked = bake_as(sphere(24), Base::kNTree, 4, 3, 5);
  size_t leaves = 0, cut = 0;
  for (const LspCell& c : baked.ntree.cells) (c.child & LSP_LEAF_BIT ? leaves : cut) += 1;
  EXPECT_EQ(cut + 1, baked.ntree.node_count);
  EXPECT_GT(cut, 0u);
  EXPECT_EQ(baked.ntree.levels, 3u);
  const Baked coarse = bake_as(sphere(24), Base::kNTree, 4, 3, 1u << 30);
  EXPECT_EQ(coarse.ntree.node_count, 1u);
}

TEST(NTree, StopsAtTheMemoryAllowed) {
  BakeOptions options;
  options.base = Base::kNTree;
  options.line_spaces = false;
  options.ntree = {16, 4, 1, 100000};
  try {
    bake(soup(2000, 0.5f), options);
    FAIL();
  } catch (const Failure& f) {
    EXPECT_EQ(f.exit(), Exit::kLimit);
  }
}

TEST(NTree, CarriesLineSpacesOnItsLowestNodes) {
  BakeOptions options;
  options.base = Base::kNTree;
  options.ntree.branching = 4;
  options.line_space.resolution = 5;  // its own, not the tree's
  options.line_space.depths = {1, 2};
  options.ntree.leaf_triangles = 2;
  const Baked baked = bake(sphere(16), options);
  size_t nodes = 0, carried = 0, terminal = 0;
  for (const LspCell& c : baked.ntree.cells) {
    nodes += !(c.child & LSP_LEAF_BIT);
    carried += c.line_space != LSP_NONE;
    terminal += c.line_space != LSP_NONE && (c.line_space & LSP_TERMINAL_BIT);
  }
  EXPECT_EQ(nodes, carried);
  EXPECT_EQ(carried, baked.line_spaces.records.size());
  EXPECT_GT(terminal, 0u);
  EXPECT_LT(terminal, carried);
  for (const LspLineSpace& r : baked.line_spaces.records)
    EXPECT_EQ(r.format & LSP_FORMAT_RESOLUTION_MASK, 5u);
}

TEST(NTree, AnswersApproximatelyWithoutItsExactPart) {
  BakeOptions options;
  options.base = Base::kNTree;
  options.ntree.branching = 6;
  options.line_space.depths = {1};
  options.line_space.resolution = 2;
  Baked baked = bake(sphere(30), options);
  const std::vector<LspRay> rays = rays_about(baked, 5000, 1.5f);
  const uint32_t flags = LSP_TRACE_APPROXIMATE | LSP_TRACE_NEAR_APPROXIMATE;
  const std::vector<LspHit> before = trace(baked, rays, flags);
  const size_t triangles = baked.triangles.size();
  keep_approximate_only(baked);
  EXPECT_LT(baked.triangles.size(), triangles);
  const std::vector<LspHit> after = trace(baked, rays, flags);
  for (size_t i = 0; i < rays.size(); ++i) EXPECT_EQ(memcmp(&before[i], &after[i], sizeof(LspHit)), 0) << i;
}

}  // namespace
}  // namespace lsp::test
