// The tree for exact rays: what it must hold, whatever it was collapsed from.
#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "box.h"
#include "bvh.h"
#include "meshes.h"
#include "wide_tree.h"

namespace lsp::test {
namespace {

struct Child {
  uint32_t bits;
  double lo[3], hi[3];
};

Child child_of(const LspWideNode& n, uint32_t k) {
  Child c{};
  c.bits = n.children[k / 2] >> (k % 2 * 16) & 0xFFFFu;
  const auto byte = [&](size_t plane) { return n.planes[2 * plane + k / 4] >> (k % 4 * 8) & 0xFFu; };
  const float lo[3] = {n.lo.x, n.lo.y, n.lo.z}, step[3] = {n.step.x, n.step.y, n.step.z};
  for (size_t axis = 0; axis < 3; ++axis) {
    c.lo[axis] = double(lo[axis]) + double(byte(axis)) * step[axis];
    c.hi[axis] = double(lo[axis]) + double(byte(3 + axis)) * step[axis];
  }
  return c;
}

// In the order of the file: a node's leaves, then its nodes.
struct Walk {
  const Mesh& mesh;
  const Bvh& bvh;
  const WideTree& tree;
  uint32_t next_node = 1, next_record = 0, depth = 0, leaves = 0, children = 0;
  std::multiset<uint32_t> seen;

  // A part of every triangle is in its leaf, and all of a triangle that is in one.
  void visit_leaf(const Child& c) {
    ++leaves;
    const uint32_t count = (c.bits >> LSP_WIDE_LEAF_COUNT_SHIFT) + 1;
    for (uint32_t i = 0; i < count; ++i) {
      const uint32_t t = bvh.records[next_record++];
      seen.insert(t);
      Box box;
      for (int corner = 0; corner < 3; ++corner) box.grow(mesh.positions[mesh.triangles[t][corner]]);
      for (int axis = 0; axis < 3; ++axis) {
        ASSERT_LE(box.lo[axis], c.hi[axis]);
        ASSERT_GE(box.hi[axis], c.lo[axis]);
      }
    }
  }

  void visit(uint32_t at, uint32_t level) {
    const LspWideNode& n = tree.nodes[at];
    ASSERT_EQ(n.triangle_first, next_record);
    ASSERT_EQ(n.node_first, next_node);
    depth = std::max(depth, level + 1);
    uint32_t below = 0;
    for (uint32_t k = 0; k < LSP_WIDE_CHILDREN; ++k) {
      const Child c = child_of(n, k);
      if (c.bits == LSP_WIDE_NO_CHILD) {
        for (int axis = 0; axis < 3; ++axis) ASSERT_TRUE(c.lo[axis] > c.hi[axis] || (&n.step.x)[axis] == 0);
        continue;
      }
      ++children;
      if (c.bits & LSP_WIDE_NODE_BIT) {
        ASSERT_EQ(c.bits & ~LSP_WIDE_NODE_BIT, below++);
      } else {
        ASSERT_EQ(n.triangle_first + (c.bits & LSP_WIDE_LEAF_FIRST_MASK), next_record);
        visit_leaf(c);
        if (::testing::Test::HasFatalFailure()) return;
      }
    }
    next_node += below;
    uint32_t next = n.node_first;
    for (uint32_t k = 0; k < LSP_WIDE_CHILDREN; ++k) {
      const Child c = child_of(n, k);
      if (c.bits == LSP_WIDE_NO_CHILD || !(c.bits & LSP_WIDE_NODE_BIT)) continue;
      const LspWideNode& inner = tree.nodes[next];
      for (uint32_t i = 0; i < LSP_WIDE_CHILDREN; ++i) {
        const Child d = child_of(inner, i);
        if (d.bits == LSP_WIDE_NO_CHILD) continue;
        for (int axis = 0; axis < 3; ++axis) {
          const double slack = 1e-5 * (c.hi[axis] - c.lo[axis]) + (&inner.step.x)[axis];
          ASSERT_GE(d.lo[axis], c.lo[axis] - slack);
          ASSERT_LE(d.hi[axis], c.hi[axis] + slack);
        }
      }
      visit(next++, level + 1);
      if (::testing::Test::HasFatalFailure()) return;
    }
  }
};

void check(const Mesh& mesh, bool spatial_splits, double least_children) {
  BvhOptions options;
  options.spatial_splits = spatial_splits;
  Bvh bvh = build_bvh(mesh, options);
  const std::vector<uint32_t> records = bvh.records;
  const WideTree tree = build_wide_tree(mesh, bvh);
  Walk walk{mesh, bvh, tree, 1, 0, 0, 0, 0, {}};
  walk.visit(0, 0);
  if (::testing::Test::HasFatalFailure()) return;
  EXPECT_EQ(walk.next_node, tree.nodes.size());
  EXPECT_EQ(walk.next_record, bvh.records.size());
  EXPECT_EQ(walk.depth, tree.max_depth);
  EXPECT_EQ(walk.leaves + tree.nodes.size(), tree.max_steps);
  EXPECT_EQ(walk.seen, std::multiset<uint32_t>(records.begin(), records.end())) << "a triangle was lost";
  EXPECT_GE(double(walk.children) / double(tree.nodes.size()), least_children);
}

TEST(WideTree, HoldsEveryTriangle) {
  check(sphere(24), true, 5);
  check(soup(500, 0.5f), true, 5);
  check(soup(500, 0.5f), false, 5);
}

TEST(WideTree, OneTriangle) {
  Mesh mesh;
  add_triangle(mesh, {0, 0, 0}, {1, 0, 0}, {0, 1, 0});
  check(mesh, true, 1);
}

// Boxes without area, whose costs are all nothing.
TEST(WideTree, TrianglesOnALine) {
  Mesh mesh;
  for (int i = 0; i < 40; ++i) {
    const auto x = float(i);
    add_triangle(mesh, {x, 0, 0}, {x + 1, 0, 0}, {x + 0.5f, 0, 0});
  }
  check(mesh, true, 2);
}

TEST(WideTree, HugeAndTinyScenes) {
  for (const float scale : {1e-18f, 1e18f}) {
    Mesh mesh = sphere(10);
    for (glm::vec3& p : mesh.positions) p *= scale;
    check(mesh, true, 4);
  }
}

// The leaves of the BVH refer to the records where they are now.
TEST(WideTree, LeavesOfTheBvhMoveAlong) {
  const Mesh mesh = sphere(16);
  const Bvh before = build_bvh(mesh, {});
  Bvh after = before;
  build_wide_tree(mesh, after);
  ASSERT_EQ(before.nodes.size(), after.nodes.size());
  size_t leaves = 0;
  for (size_t i = 0; i < before.nodes.size(); ++i)
    for (const auto child : {&LspNode::child0, &LspNode::child1}) {
      const uint32_t a = before.nodes[i].*child, b = after.nodes[i].*child;
      if (!(a & LSP_LEAF_BIT)) continue;
      ASSERT_EQ(a & ~LSP_LEAF_FIRST_MASK, b & ~LSP_LEAF_FIRST_MASK);
      for (uint32_t k = 0; k <= (a >> LSP_LEAF_COUNT_SHIFT & LSP_LEAF_COUNT_MASK); ++k)
        ASSERT_EQ(before.records[(a & LSP_LEAF_FIRST_MASK) + k],
                  after.records[(b & LSP_LEAF_FIRST_MASK) + k]);
      ++leaves;
    }
  EXPECT_GT(leaves, 50u);
}

// A wall behind which a ball hides: an occlusion ray asks the wall, which costs two triangles, first.
TEST(WideTree, WhatEndsRaysSoonestComesFirst) {
  Mesh mesh = sphere(16);
  add_triangle(mesh, {3, -3, -3}, {3, 3, -3}, {3, -3, 3});
  add_triangle(mesh, {3, 3, 3}, {3, -3, 3}, {3, 3, -3});
  Bvh bvh = build_bvh(mesh, {});
  const WideTree tree = build_wide_tree(mesh, bvh);
  const Child first = child_of(tree.nodes[0], 0);
  ASSERT_FALSE(first.bits & LSP_WIDE_NODE_BIT);
  EXPECT_NEAR(first.lo[0], 3, 0.1);
}

}  // namespace
}  // namespace lsp::test
