// The base structure: what every tree must hold, whatever built it.
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <cstring>
#include <set>

#include "box.h"
#include "bvh.h"
#include "meshes.h"

namespace lsp::test {
namespace {

Box box_of(const lsp_float3& lo, const lsp_float3& hi) { return {{lo.x, lo.y, lo.z}, {hi.x, hi.y, hi.z}}; }

struct Walk {
  const Mesh& mesh;
  const Bvh& bvh;
  uint32_t next_node = 0, next_record = 0, depth = 0, leaves = 0;
  std::multiset<uint32_t> seen;

  void visit(uint32_t child, const Box& box, uint32_t level) {
    depth = std::max(depth, level);
    if (child & LSP_LEAF_BIT) {
      ++leaves;
      const uint32_t count = (child >> LSP_LEAF_COUNT_SHIFT & LSP_LEAF_COUNT_MASK) + 1;
      ASSERT_EQ(child & LSP_LEAF_FIRST_MASK, next_record) << "leaves are not in depth-first order";
      next_record += count;
      for (uint32_t i = next_record - count; i < next_record; ++i) {
        const uint32_t t = bvh.records[i];
        seen.insert(t);
        Box triangle;
        for (int c = 0; c < 3; ++c) triangle.grow(mesh.positions[mesh.triangles[t][c]]);
        ASSERT_FALSE(intersection(triangle, box).empty()) << "triangle " << t << " is not in its leaf";
      }
      return;
    }
    ASSERT_EQ(child, next_node++) << "nodes are not in depth-first order";
    const LspNode& n = bvh.nodes[child];
    const Box a = box_of(n.lo0, n.hi0), b = box_of(n.lo1, n.hi1);
    for (const Box& inner : {a, b})
      for (int axis = 0; axis < 3; ++axis) {
        ASSERT_GE(inner.lo[axis], box.lo[axis]);
        ASSERT_LE(inner.hi[axis], box.hi[axis]);
      }
    ASSERT_GE(a.half_area(), b.half_area()) << "child 0 is not the larger one";
    visit(n.child0, a, level + 1);
    if (::testing::Test::HasFatalFailure()) return;
    visit(n.child1, b, level + 1);
  }
};

void check(const Mesh& mesh, const Bvh& bvh) {
  Box bounds;
  for (const glm::vec3& p : mesh.positions) bounds.grow(p);
  Walk walk{mesh, bvh, 0, 0, 0, 0, {}};
  walk.visit(bvh.root, bounds, 0);
  if (::testing::Test::HasFatalFailure()) return;
  EXPECT_EQ(walk.next_node, bvh.nodes.size());
  EXPECT_EQ(walk.next_record, bvh.records.size());
  EXPECT_EQ(walk.depth, bvh.max_depth);
  EXPECT_EQ(walk.leaves, bvh.leaf_count);
  EXPECT_LE(bvh.max_depth, LSP_MAX_STACK);
  for (uint32_t t = 0; t < mesh.triangles.size(); ++t)
    ASSERT_TRUE(walk.seen.count(t)) << "triangle " << t << " lost";
}

double sah(const Bvh& bvh) {
  double cost = 0;
  for (const LspNode& n : bvh.nodes) {
    const auto add = [&](const lsp_float3& lo, const lsp_float3& hi, uint32_t child) {
      const uint32_t count =
          child & LSP_LEAF_BIT ? (child >> LSP_LEAF_COUNT_SHIFT & LSP_LEAF_COUNT_MASK) + 1 : 1;
      cost += box_of(lo, hi).half_area() * count;
    };
    add(n.lo0, n.hi0, n.child0);
    add(n.lo1, n.hi1, n.child1);
  }
  return cost;
}

TEST(Tree, HoldsEveryTriangleInDepthFirstOrder) {
  const Mesh mesh = soup(5000, 0.3f);
  for (const bool splits : {false, true}) {
    BvhOptions options;
    options.spatial_splits = splits;
    const Bvh bvh = build_bvh(mesh, options);
    check(mesh, bvh);
    if (!splits) {
      EXPECT_EQ(bvh.records.size(), mesh.triangles.size());
    }
  }
}

TEST(Tree, SpatialSplitsRepeatWithinTheBudgetAndPay) {
  // Long diagonal beams through many small things: the beams' boxes are large and nearly empty.
  Mesh mesh = soup(3000, 0.05f);
  for (int i = 0; i < 40; ++i) {
    const float x = float(i) / 40;
    const glm::vec3 a(x, 0, 0), b(1 - x, 1, 1), w(0.002f, -0.002f, 0);
    add_triangle(mesh, a, b, b + w);
    add_triangle(mesh, a, b + w, a + w);
  }
  BvhOptions plain, split;
  plain.spatial_splits = false;
  const Bvh a = build_bvh(mesh, plain), b = build_bvh(mesh, split);
  EXPECT_GT(b.records.size(), mesh.triangles.size());
  EXPECT_LE(double(b.records.size()), double(mesh.triangles.size()) * (1 + split.split_budget));
  EXPECT_LT(sah(b), 0.9 * sah(a));
}

TEST(Tree, IsTheSameOnOneThreadAndOnAll) {
  const Mesh mesh = soup(20000, 0.1f);
  const Bvh all = build_bvh(mesh, {});
  tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
  const Bvh single = build_bvh(mesh, {});
  ASSERT_EQ(all.nodes.size(), single.nodes.size());
  EXPECT_EQ(std::memcmp(all.nodes.data(), single.nodes.data(), all.nodes.size() * sizeof(LspNode)), 0);
  EXPECT_EQ(all.records, single.records);
}

TEST(Tree, SurvivesDegenerateScenes) {
  Mesh none;
  EXPECT_EQ(build_bvh(none, {}).root, LSP_NONE);

  Mesh one;
  add_triangle(one, {0, 0, 0}, {1, 0, 0}, {0, 1, 0});
  check(one, build_bvh(one, {}));

  Mesh stacked;  // equal triangles: no split separates them
  for (int i = 0; i < 3000; ++i) add_triangle(stacked, {0, 0, 0}, {1, 0, 0}, {0, 1, 0});
  const Bvh bvh = build_bvh(stacked, {});
  check(stacked, bvh);
  EXPECT_LE(bvh.max_leaf_triangles, BvhOptions().max_leaf_triangles);

  Mesh spread;  // sizes over 30 orders of magnitude
  for (int i = -50; i < 50; ++i) {
    const float s = std::ldexp(1.0f, i);
    add_triangle(spread, {s, 0, 0}, {2 * s, 0, 0}, {s, s, 0});
  }
  check(spread, build_bvh(spread, {}));
}

}  // namespace
}  // namespace lsp::test
