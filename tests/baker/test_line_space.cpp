// Line Spaces: where they sit, what their shafts hold, and what they answer.
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <bit>
#include <cmath>
#include <cstring>
#include <filesystem>

#include "bake.h"
#include "error.h"
#include "lsp/lsp.h"
#include "lsp/program.h"
#include "meshes.h"

namespace lsp::test {
namespace {

BakeOptions small(uint32_t n, std::vector<uint32_t> depths) {
  BakeOptions options;
  options.line_space.resolution = n;
  options.line_space.depths = std::move(depths);
  return options;
}

LspHit trace(const Baked& baked, const LspRay& ray, uint32_t flags, lsp_trace_counts* counts = nullptr) {
  const lsp_scene scene = view(baked);
  const lsp_trace_options options = {flags, 0};
  LspHit hit;
  EXPECT_EQ(lsp_trace(&scene, &options, &ray, &hit, 1, counts, nullptr), LSP_OK);
  return hit;
}

TEST(LineSpaces, SitOnEveryInnerNodeOfTheirDepth) {
  const Baked baked = bake(sphere(24), small(2, {3}));
  EXPECT_EQ(baked.line_spaces.records.size(), 8u);
  for (const LspLineSpace& r : baked.line_spaces.records) EXPECT_EQ(r.child & LSP_LEAF_BIT, 0u);
  const Baked root = bake(sphere(24), small(2, {0}));
  EXPECT_EQ(root.header.root_line_space, LSP_TERMINAL_BIT | 0u);
}

TEST(LineSpaces, OfSeveralDepthsAreTerminalOnlyAtTheLast) {
  const Baked baked = bake(sphere(24), small(2, {1, 3}));
  EXPECT_EQ(baked.line_spaces.records.size(), 2u + 8u);
  size_t terminal = 0, outer = 0;
  for (const LspNode& n : baked.nodes)
    for (const uint32_t reference : {n.line_space0, n.line_space1}) {
      if (reference == LSP_NONE) continue;
      (reference & LSP_TERMINAL_BIT ? terminal : outer) += 1;
    }
  EXPECT_EQ(terminal, 8u);
  EXPECT_EQ(outer, 2u);
}

TEST(LineSpaces, OfSmallNodesFollowT) {
  BakeOptions options = small(2, {6});
  options.line_space.triangles = 1u << 30;  // the root itself is small enough
  const Baked baked = bake(sphere(24), options);
  ASSERT_EQ(baked.line_spaces.records.size(), 1u);
  EXPECT_EQ(baked.line_spaces.records[0].triangle_count, baked.header.triangle_count);
}

// The filled shafts of a single square, by the paper's rule: those whose centroid ray passes it.
TEST(LineSpaces, FillTheShaftsWhoseCentroidRayHits) {
  Mesh mesh;
  // A square in the middle of a box that two far slivers span.
  add_triangle(mesh, {-0.5f, -0.5f, 0}, {0.5f, -0.5f, 0}, {0.5f, 0.5f, 0});
  add_triangle(mesh, {-0.5f, -0.5f, 0}, {0.5f, 0.5f, 0}, {-0.5f, 0.5f, 0});
  add_triangle(mesh, {-1, -1, -1}, {-1, -1, -0.999f}, {-1, -0.999f, -1});
  add_triangle(mesh, {1, 1, 1}, {1, 1, 0.999f}, {1, 0.999f, 1});
  BakeOptions options = small(3, {0});
  options.line_space.samples = 1;
  const Baked baked = bake(mesh, options);
  ASSERT_EQ(baked.line_spaces.records.size(), 1u);
  const LspLineSpace& r = baked.line_spaces.records[0];
  const auto filled = [&](uint32_t in, uint32_t out, uint32_t p, uint32_t q) {
    const uint32_t s = LSP_SHAFT_INDEX(in, out, p, q, 3u);
    return (baked.line_spaces.words[r.word_first + s / 32].bits >> (s % 32) & 1) != 0;
  };
  EXPECT_TRUE(filled(4, 5, 4, 4));   // straight up through the centre
  EXPECT_TRUE(filled(5, 4, 4, 4));   // and down
  EXPECT_FALSE(filled(4, 5, 0, 0));  // past the square, at the corner
  EXPECT_TRUE(filled(4, 5, 0, 8));   // from corner to opposite corner through the centre
  EXPECT_FALSE(filled(0, 1, 1, 1));  // level, below the square
  uint32_t bits = 0;
  for (const LspBitWord& w : baked.line_spaces.words) {
    EXPECT_EQ(w.offset, bits);
    bits += uint32_t(std::popcount(w.bits));
  }
  EXPECT_EQ(bits, r.filled);
}

// A wall is a node of zero thickness: entry and exit fall on one plane, where a naive version loses most
// rays.
TEST(LineSpaces, OfAFlatWallAnswerEveryRay) {
  Mesh mesh;
  constexpr int kCells = 24;
  const auto p = [](int i, int j) { return glm::vec3(float(i), float(j), 0) / float(kCells); };
  for (int i = 0; i < kCells; ++i)
    for (int j = 0; j < kCells; ++j) {
      add_triangle(mesh, p(i, j), p(i + 1, j), p(i + 1, j + 1));
      add_triangle(mesh, p(i, j), p(i + 1, j + 1), p(i, j + 1));
    }
  const Baked baked = bake(mesh, small(4, {0}));
  for (int i = 0; i < 500; ++i) {
    const float x = 0.05f + 0.9f * float(i % 25) / 25, y = 0.05f + 0.9f * float(i / 25) / 20;
    const LspRay ray = {{x + 0.4f, y - 0.3f, 1}, 0, {-0.4f, 0.3f, -1}, 10};
    const LspHit hit = trace(baked, ray, LSP_TRACE_APPROXIMATE);
    ASSERT_NE(hit.primitive, LSP_NONE) << "ray " << i;
    ASSERT_NEAR(hit.t, 1, 1e-3);
    ASSERT_TRUE(hit.flags & LSP_HIT_LINE_SPACE);
  }
}

TEST(LineSpaces, AnswerASphereWithASmallError) {
  const Baked baked = bake(sphere(100), small(6, {6}));
  const MeasuredError error = measure_error(baked, 1 << 16);
  EXPECT_EQ(error.rays, 1u << 16);
  EXPECT_LT(error.wrong_share(), 0.005);  // rays leave a convex body freely
  const MeasuredError coarse = measure_error(bake(sphere(100), small(2, {6})), 1 << 16);
  EXPECT_GT(coarse.wrong_share(), error.wrong_share());
}

TEST(LineSpaces, SkippingTheNearFieldSparesTriangles) {
  const Baked baked = bake(sphere(100), small(6, {6}));
  lsp_trace_counts exact{}, skip{};
  for (int i = 0; i < 1000; ++i) {
    const float a = float(i) * 0.37f, z = -0.9f + 1.8f * float(i) / 1000;
    const float r = std::sqrt(1 - z * z);
    const lsp_float3 n = {r * std::cos(a), r * std::sin(a), z};
    const LspRay ray = {{n.x * 1.001f, n.y * 1.001f, n.z * 1.001f}, 0, n, 10};
    trace(baked, ray, LSP_TRACE_APPROXIMATE, &exact);
    EXPECT_EQ(trace(baked, ray, LSP_TRACE_APPROXIMATE | LSP_TRACE_NEAR_SKIP, &skip).primitive, LSP_NONE);
  }
  EXPECT_LT(skip.triangles * 2, exact.triangles);
  EXPECT_LT(skip.nodes, exact.nodes);
}

TEST(LineSpaces, AreTheSameOnOneThreadAndOnAll) {
  const Mesh mesh = soup(4000, 0.1f);
  const Baked all = bake(mesh, small(3, {4, 6}));
  tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
  const Baked single = bake(mesh, small(3, {4, 6}));
  const auto same = [](const auto& a, const auto& b) {
    return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof a[0]) == 0;
  };
  EXPECT_TRUE(same(all.nodes, single.nodes));
  EXPECT_TRUE(same(all.line_spaces.records, single.line_spaces.records));
  EXPECT_TRUE(same(all.line_spaces.words, single.line_spaces.words));
  EXPECT_TRUE(same(all.line_spaces.candidates, single.line_spaces.candidates));
}

TEST(LineSpaces, WithoutTheExactTreeAnswerAsWithIt) {
  const Mesh mesh = sphere(60);
  for (const auto& depths : {std::vector<uint32_t>{5}, {2, 5}, {0}}) {
    const Baked whole = bake(mesh, small(4, depths));
    Baked less = bake(mesh, small(4, depths));
    keep_approximate_only(less);
    EXPECT_LT(less.triangles.size(), whole.triangles.size());
    EXPECT_EQ(less.header.required_features & LSP_FEATURE_EXACT, 0u);
    for (int i = 0; i < 2000; ++i) {
      const float a = float(i) * 0.61f, z = -1 + 2 * float(i) / 2000;
      const float r = std::sqrt(1 - z * z);
      const LspRay ray = {{3 * r * std::cos(a), 3 * r * std::sin(a), 3 * z},
                          0,
                          {-r * std::cos(a + 0.2f), -r * std::sin(a + 0.2f), -z},
                          100};
      const LspHit x = trace(whole, ray, LSP_TRACE_APPROXIMATE), y = trace(less, ray, LSP_TRACE_APPROXIMATE);
      ASSERT_EQ(x.primitive, y.primitive);
      ASSERT_EQ(std::bit_cast<uint32_t>(x.t), std::bit_cast<uint32_t>(y.t));
    }
  }
}

TEST(LineSpaces, BakeWithinAMemoryLimitOrSaySo) {
  BakeOptions options = small(6, {9});
  options.memory_limit = 1 << 20;
  EXPECT_THROW(bake(sphere(60), options), Failure);
}

TEST(LineSpaces, AreTheSameWhereTheyDoNotFitIntoMemory) {
  BakeOptions options = small(6, {5});
  const Baked whole = bake(sphere(24), options);
  options.folder = std::filesystem::temp_directory_path();
  const tbb::global_control two(tbb::global_control::max_allowed_parallelism, 2);
  options.memory_limit = 22u << 20;  // 16 MiB of it for the program
  const Baked spilled = bake(sphere(24), options);
  const auto same = [](const auto& a, const auto& b) {
    return a.size() == b.size() && memcmp(a.data(), b.data(), a.size() * sizeof a[0]) == 0;
  };
  EXPECT_TRUE(same(whole.line_spaces.words, spilled.line_spaces.words));
  EXPECT_TRUE(same(whole.line_spaces.candidates, spilled.line_spaces.candidates));
  EXPECT_TRUE(same(whole.line_spaces.records, spilled.line_spaces.records));
}

TEST(LargeArray, GrowsInMemoryAndInAFile) {
  for (const bool in_file : {false, true}) {
    LargeArray<uint32_t> array;
    if (in_file) array.keep_in_file(std::filesystem::temp_directory_path());
    EXPECT_TRUE(array.empty());
    std::vector<uint32_t> piece(100000);
    for (uint32_t i = 0; i < 30; ++i) {
      for (uint32_t j = 0; j < piece.size(); ++j) piece[j] = i * 100000 + j;
      array.append(piece);
    }
    array[7] = 70;
    array.release();
    ASSERT_EQ(array.size(), 3000000u);
    EXPECT_EQ(array[7], 70u);
    EXPECT_EQ(array[2999999], 2999999u);
    const LargeArray<uint32_t> moved = std::move(array);
    EXPECT_EQ(moved[1234567], 1234567u);
  }
  LargeArray<uint32_t> array;
  try {
    array.keep_in_file("/nonexistent");
    FAIL();
  } catch (const Failure& f) {
    EXPECT_EQ(f.exit(), Exit::kFile);
  }
}

}  // namespace
}  // namespace lsp::test
