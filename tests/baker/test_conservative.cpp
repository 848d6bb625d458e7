// Conservative Line Spaces: no ray that the tracer lets hit a triangle takes a shaft whose bit is clear, and
// rays that skip empty shafts get the answers of rays that do not.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <random>

#include "bake.h"
#include "conservative.h"
#include "import/import.h"
#include "lsp/lsp.h"
#include "shapes.h"
#include "trace_subset.h"

// The tracer's own text, to see which shaft a ray takes and which triangle it hits.
namespace lsp::test {
namespace {

using namespace lsp::subset;

struct Tracer {
#include "lsp/traverse.h"
};

class Numbers {
 public:
  explicit Numbers(uint32_t seed) : random_(seed) {}
  double uniform() { return double(random_() >> 5) / 134217728.0; }
  double between(double a, double b) { return a + (b - a) * uniform(); }
  uint32_t below(uint32_t n) { return uint32_t(random_() % n); }
  glm::dvec3 in(const glm::dvec3& lo, const glm::dvec3& hi) {
    return {between(lo.x, hi.x), between(lo.y, hi.y), between(lo.z, hi.z)};
  }
  glm::dvec3 direction() { return in(glm::dvec3(-1), glm::dvec3(1)); }

 private:
  std::mt19937 random_;
};

LspTriangle triangle(const glm::dvec3& a, const glm::dvec3& b, const glm::dvec3& c) {
  const auto f = [](const glm::dvec3& v) { return lsp_float3{float(v.x), float(v.y), float(v.z)}; };
  return {f(a), 0, f(b), 0, f(c), 0};
}
glm::dvec3 vec(const lsp_float3& v) { return {v.x, v.y, v.z}; }

// ---- one triangle and ideal lines
// ---------------------------------------------------------------------------

struct Box {
  glm::vec3 lo, hi;
  uint32_t n;
};

// The shaft that a line takes, in double precision; false: it misses the box.
bool ideal_shaft(const Box& box, const glm::dvec3& o, const glm::dvec3& d, uint32_t& shaft) {
  const glm::dvec3 lo(box.lo), hi(box.hi);
  double t_in = -INFINITY, t_out = INFINITY;
  uint32_t face[2] = {0, 0};
  for (uint32_t k = 0; k < 3; ++k) {
    if (d[k] == 0 && (o[k] < lo[k] || o[k] > hi[k])) return false;
    if (d[k] == 0) continue;
    const double a = (lo[k] - o[k]) / d[k], b = (hi[k] - o[k]) / d[k];
    if (std::min(a, b) > t_in) t_in = std::min(a, b), face[0] = 2 * k + (d[k] < 0);
    if (std::max(a, b) < t_out) t_out = std::max(a, b), face[1] = 2 * k + (d[k] > 0);
  }
  if (!(t_in < t_out)) return false;
  uint32_t patch[2];
  for (int i = 0; i < 2; ++i) {
    const glm::dvec3 p = o + d * (i ? t_out : t_in);
    const uint32_t axis = face[i] / 2, u = axis == 0 ? 1 : 0, v = axis == 2 ? 1 : 2;
    const auto index = [&](uint32_t k) {
      return uint32_t(
          std::clamp((p[int(k)] - lo[int(k)]) / (hi[int(k)] - lo[int(k)]) * box.n, 0.0, box.n - 0.5));
    };
    patch[i] = index(u) + box.n * index(v);
  }
  const int first = face[0] < face[1] ? 0 : 1;
  shaft = LSP_SHAFT_INDEX_SYMMETRIC(face[first], face[1 - first], patch[first], patch[1 - first], box.n);
  return true;
}

// A triangle of one of the kinds that are hard: tiny, a sliver, on the borders of patches, larger than the
// box.
LspTriangle hard_triangle(Numbers& r, const Box& box) {
  const glm::dvec3 lo(box.lo), hi(box.hi), e = hi - lo;
  const glm::dvec3 p = r.in(lo, hi);
  switch (r.below(6)) {
    case 0:
      return triangle(p, p + e * r.direction() * 1e-4, p + e * r.direction() * 1e-4);
    case 1: {  // a sliver along any direction
      const glm::dvec3 q = r.in(lo, hi);
      return triangle(p, q, 0.5 * (p + q) + e * r.direction() * 1e-5);
    }
    case 2: {  // a corner on the borders of patches, another beside them
      glm::dvec3 q = lo + e * glm::round((p - lo) / e * double(box.n)) / double(box.n);
      return triangle(q, q + e * r.direction() * 0.2, q + e * r.direction() * 0.2);
    }
    case 3: {  // in a plane between patches
      glm::dvec3 a = r.in(lo, hi), b = r.in(lo, hi), c = r.in(lo, hi);
      const int k = int(r.below(3));
      a[k] = b[k] = c[k] = lo[k] + e[k] * double(r.below(box.n + 1)) / box.n;
      return triangle(a, b, c);
    }
    case 4:
      return triangle(r.in(lo, hi), r.in(lo, hi), r.in(lo, hi));
    default:  // reaches far out
      return triangle(p, p + e * r.direction() * 3.0, p + e * r.direction() * 30.0);
  }
}

// Lines that pass a triangle by at most `off` along every axis and take a shaft whose bit, made for `margin`,
// is clear.
uint64_t missed_lines(double margin, double off, uint64_t* lines) {
  Numbers r(3);
  uint64_t missed = 0;
  for (int round = 0; round < 240; ++round) {
    Box box{glm::vec3(-1, 2, 5), glm::vec3(0.5, 3, 7), 2 + r.below(6)};
    if (round % 3 == 1) box.hi.y = box.lo.y + 1e-3f;  // a wall
    if (round % 3 == 2) box.hi.x = box.lo.x + 1e-3f, box.hi.z = box.lo.z + 1e-3f;
    const LspTriangle t = hard_triangle(r, box);
    TouchedShafts touched(box.lo, box.hi, margin, box.n);
    std::vector<uint32_t> shafts(15 * box.n * box.n * box.n * box.n, LSP_NONE);
    touched.add(t, 7, shafts);
    const glm::dvec3 extent = glm::dvec3(box.hi) - glm::dvec3(box.lo);
    for (int i = 0; i < 2000; ++i) {
      double u = r.uniform(), v = r.uniform();
      if (u + v > 1) u = 1 - u, v = 1 - v;
      if (i % 4 == 0) u = 0;           // an edge
      if (i % 8 == 0) v = r.below(2);  // a corner
      const glm::dvec3 q = vec(t.v0) + u * (vec(t.v1) - vec(t.v0)) + v * (vec(t.v2) - vec(t.v0));
      // Towards any point of the box: also the triangles that lie outside are seen through it.
      const glm::dvec3 d = r.in(box.lo, box.hi) - q + (i % 2 ? glm::dvec3(0) : 1e-3 * extent * r.direction());
      uint32_t shaft;
      if (!ideal_shaft(box, q + off * r.direction(), d, shaft)) continue;
      ++*lines;
      missed += shafts[shaft] == LSP_NONE;
    }
  }
  return missed;
}

TEST(Conservative, SetsTheBitOfEveryLineThatTouches) {
  uint64_t lines = 0;
  EXPECT_EQ(missed_lines(1e-6, 0, &lines), 0u);
  EXPECT_EQ(missed_lines(1e-4, 0.999e-4, &lines), 0u);
  EXPECT_GT(lines, 400000u);
}

TEST(Conservative, WouldNoticeAMarginThatIsTooSmall) {
  uint64_t lines = 0;
  EXPECT_GT(missed_lines(0.8e-4, 1e-4, &lines), 0u);
  EXPECT_GT(missed_lines(0, 1e-4, &lines), 100u);
}

// Bits beyond those that lines need are few: the clipping is exact but for the margin.
TEST(Conservative, SetsFewBitsThatNoLineNeeds) {
  Numbers r(11);
  uint64_t set = 0, needed = 0;
  for (int round = 0; round < 12; ++round) {
    const Box box{glm::vec3(0), glm::vec3(1), 4};
    const glm::dvec3 p = r.in(glm::dvec3(0.2), glm::dvec3(0.8));
    const LspTriangle t = triangle(p, p + 0.2 * r.direction(), p + 0.2 * r.direction());
    TouchedShafts touched(box.lo, box.hi, 1e-7, box.n);
    std::vector<uint32_t> shafts(15 * 256, LSP_NONE), seen(15 * 256, 0);
    touched.add(t, 7, shafts);
    for (int i = 0; i < 1000000; ++i) {
      double u = r.uniform(), v = r.uniform();
      if (u + v > 1) u = 1 - u, v = 1 - v;
      if (i % 3 == 0) u = 0;
      if (i % 6 == 0) v = r.below(2);
      const glm::dvec3 q = vec(t.v0) + u * (vec(t.v1) - vec(t.v0)) + v * (vec(t.v2) - vec(t.v0));
      uint32_t shaft;
      if (ideal_shaft(box, q, r.direction(), shaft)) seen[shaft] = 1;
    }
    for (size_t s = 0; s < shafts.size(); ++s) {
      set += shafts[s] != LSP_NONE;
      needed += seen[s];
    }
  }
  EXPECT_GE(set, needed);
  EXPECT_LT(double(set), 1.1 * double(needed));
}

// ---- whole bakes and the tracer's rounding ----

BakeOptions options_for(Base base, uint32_t n, std::vector<uint32_t> depths, bool directed = false) {
  BakeOptions options;
  options.purpose = Purpose::kVisibility;
  options.base = base;
  options.ntree.branching = 4;
  options.line_space.kind = LineSpaceKind::kBinary;
  options.line_space.conservative = true;
  options.line_space.directed = directed;
  options.line_space.resolution = n;
  options.line_space.depths = std::move(depths);
  return options;
}

// Rays that begin in or about the scene: from surfaces, through corners, along axes and in planes of the
// boxes.
std::vector<LspRay> rays_about(const lsp_scene& scene, size_t count, uint32_t seed) {
  Numbers r(seed);
  const LspHeader& h = *scene.header;
  const glm::dvec3 lo = vec(h.bounds_min), hi = vec(h.bounds_max), e = hi - lo;
  std::vector<LspRay> rays;
  for (size_t i = 0; i < count; ++i) {
    const LspTriangle& t = scene.triangles[r.below(h.triangle_count)];
    const glm::dvec3 corner[3] = {vec(t.v0), vec(t.v1), vec(t.v2)};
    const glm::dvec3 at = i % 3 == 0
                              ? corner[r.below(3)]
                              : glm::mix(corner[0], glm::mix(corner[1], corner[2], r.uniform()), r.uniform());
    glm::dvec3 o = r.in(lo - 0.5 * e, hi + 0.5 * e), d = at - o;
    if (i % 5 == 1) o = at, d = r.direction();
    if (i % 5 == 2) {
      d = glm::dvec3(0);
      d[int(r.below(3))] = r.below(2) ? 1 : -1;
      o = at - 2.0 * glm::length(e) * d * r.uniform();
    }
    if (i % 5 == 3 && h.line_space_count != 0) {  // on a side of a Line Space's box, or nearly
      const LspLineSpace& ls = scene.line_spaces[r.below(h.line_space_count)];
      const glm::dvec3 a = vec(ls.lo), b = vec(ls.hi);
      const int k = int(r.below(3));
      const double n = ls.format & LSP_FORMAT_RESOLUTION_MASK;
      o[k] = a[k] + (b[k] - a[k]) * double(r.below(uint32_t(n) + 1)) / n;
      d = at - o;
      if (r.below(2)) d[k] *= 1e-6;
    }
    if (d == glm::dvec3(0)) d.x = 1;
    rays.push_back({{float(o.x), float(o.y), float(o.z)},
                    0,
                    {float(d.x), float(d.y), float(d.z)},
                    i % 7 == 0 ? 0.8f : INFINITY});
  }
  return rays;
}

struct Checked {
  uint64_t hits = 0;   // triangles hit, of which the shaft was looked at
  uint64_t clear = 0;  // of these, shafts that were said to be empty
};

// Every ray against every Line Space of a BVH and all the triangles of its node; `bits(k, shaft, triangle)`
// is asked for the bits.
template <typename Bits>
Checked check_bits(const Baked& baked, size_t count, Bits&& bits) {
  const lsp_scene scene = view(baked);
  Checked checked;
  Tracer tracer;
  for (LspRay ray : rays_about(scene, count, 17)) {
    ray.tmin = -INFINITY;  // the whole line
    ray.tmax = INFINITY;
    const Tracer::LspSetup setup = tracer.lsp_setup(scene, ray);
    if (!setup.valid || !tracer.lsp_may_skip_empty(scene, setup)) continue;
    for (uint32_t k = 0; k < baked.header.line_space_count; ++k) {
      const LspLineSpace& ls = scene.line_spaces[k];
      const Tracer::LspPassage pass = tracer.lsp_pass(setup, ls);
      if (!(pass.t_in <= pass.t_out)) continue;
      for (uint32_t t = ls.triangle_first; t < ls.triangle_first + ls.triangle_count; ++t) {
        Tracer::LspBest best;
        best.t = INFINITY;
        best.triangle = LSP_NONE;
        best = tracer.lsp_triangle(scene, setup, t, best);
        if (best.triangle == LSP_NONE) continue;
        ++checked.hits;
        checked.clear += !bits(k, pass.shaft);
      }
    }
  }
  return checked;
}

bool file_bit(const Baked& baked, uint32_t k, uint32_t shaft) {
  return baked.line_spaces.words[baked.line_spaces.records[k].word_first + shaft / 32].bits >> shaft % 32 & 1;
}

// A soup far from the origin, where a rounding is a hundredth of a patch.
Mesh far_soup(uint32_t count, float size) {
  Mesh mesh = soup(count, size);
  for (glm::vec3& p : mesh.positions) p += glm::vec3(4000, -9000, 2000);
  return mesh;
}

TEST(Conservative, ProvesNothingEmptyThatTheTracerHits) {
  for (const bool directed : {false, true})
    for (const bool far : {false, true}) {
      const Mesh mesh = far ? far_soup(600, 0.15f) : soup(600, 0.15f);
      const Baked baked = bake(mesh, options_for(Base::kBvh, 5, {2, 4}, directed));
      ASSERT_FALSE(baked.line_spaces.records.empty());
      const Checked c =
          check_bits(baked, 6000, [&](uint32_t k, uint32_t s) { return file_bit(baked, k, s); });
      EXPECT_GT(c.hits, 10000u);
      EXPECT_LT(baked.line_spaces.filled, 9 * baked.line_spaces.shafts / 10);
      EXPECT_EQ(c.clear, 0u);
    }
}

// Hits that pass between two patches, far from the origin, where the points that choose them are rounded by
// more than what lies between: with the margin no hit takes a shaft whose bit is clear, without it some do.
TEST(Conservative, NeedsItsMargin) {
  constexpr uint32_t kN = 7;
  Numbers r(5);
  uint64_t hits = 0, clear[2] = {0, 0};  // with the margin, without
  for (int round = 0; round < 200; ++round) {
    const auto floats = [](const glm::dvec3& v) { return lsp_float3{float(v.x), float(v.y), float(v.z)}; };
    const glm::dvec3 corner = glm::dvec3(4000, -9000, 2000) + r.direction();
    LspHeader header{};
    header.bounds_min = floats(corner);
    header.bounds_max = floats(corner + 1.0);
    const glm::vec3 lo = vec(header.bounds_min), hi = vec(header.bounds_max), scale = float(kN) / (hi - lo);
    const glm::dvec3 extent = glm::dvec3(hi) - glm::dvec3(lo);
    const LspLineSpace ls = {header.bounds_min,
                             0,
                             header.bounds_max,
                             0,
                             {scale.x, scale.y, scale.z},
                             0,
                             kN | LSP_FORMAT_SYMMETRIC | LSP_FORMAT_CONSERVATIVE,
                             0,
                             1,
                             0};
    // An edge along a border between patches, the triangle on one side of it.
    const double border = lo.y + extent.y * (1 + r.below(kN - 1)) / kN, ulp = 0x1p-10;
    const auto end = [&](double x) {
      return glm::dvec3(lo.x + extent.x * x, border + ulp * r.between(-2, 2), lo.z + extent.z * 0.5);
    };
    const LspTriangle t =
        triangle(end(0.1), end(0.9), {lo.x + 0.5, border - (round % 2 ? 0.1 : -0.1), lo.z + 0.6});
    lsp_scene scene{};
    scene.header = &header;
    scene.triangles = &t;
    Tracer tracer;
    header.triangle_count = 1;
    std::vector<uint32_t> shafts[2];
    for (int without = 0; without < 2; ++without) {
      shafts[without].assign(15 * kN * kN * kN * kN, LSP_NONE);
      TouchedShafts(lo, hi, without ? 0 : empty_margin(header), kN).add(t, 0, shafts[without]);
    }
    for (int i = 0; i < 1000; ++i) {
      const glm::dvec3 q = glm::mix(vec(t.v0), vec(t.v1), r.uniform());
      const glm::dvec3 from = q + glm::dvec3(r.between(-0.2, 0.2), 0, i % 2 ? 1 : -1);
      const lsp_float3 o = floats(from);
      const LspRay ray = {o, 0, floats(q - vec(o)), INFINITY};
      const Tracer::LspSetup setup = tracer.lsp_setup(scene, ray);
      ASSERT_TRUE(setup.valid && tracer.lsp_may_skip_empty(scene, setup));
      Tracer::LspBest best{};
      best.t = INFINITY;
      best.triangle = LSP_NONE;
      best = tracer.lsp_triangle(scene, setup, 0, best);
      const Tracer::LspPassage pass = tracer.lsp_pass(setup, ls);
      if (best.triangle == LSP_NONE || !(pass.t_in <= pass.t_out)) continue;
      ++hits;
      for (int without = 0; without < 2; ++without) clear[without] += shafts[without][pass.shaft] == LSP_NONE;
    }
  }
  EXPECT_GT(hits, 10000u);
  EXPECT_EQ(clear[0], 0u);
  EXPECT_GT(clear[1], 100u);
}

void expect_same_answers(const Mesh& mesh, const BakeOptions& options, size_t count,
                         bool saves_nodes = true) {
  const Baked baked = bake(mesh, options);
  const lsp_scene scene = view(baked);
  const std::vector<LspRay> rays = rays_about(scene, count, 29);
  for (const uint32_t query : {0u, LSP_TRACE_ANY_HIT}) {
    SCOPED_TRACE(query);
    std::vector<LspHit> whole(rays.size()), skipped(rays.size());
    lsp_trace_counts of_whole{}, of_skipped{};
    const lsp_trace_options plain{query, 0}, skip{query | LSP_TRACE_SKIP_EMPTY, 0};
    ASSERT_EQ(lsp_trace(&scene, &plain, rays.data(), whole.data(), count, &of_whole, nullptr), LSP_OK);
    ASSERT_EQ(lsp_trace(&scene, &skip, rays.data(), skipped.data(), count, &of_skipped, nullptr), LSP_OK);
    size_t different = 0;
    for (size_t i = 0; i < count; ++i) different += std::memcmp(&whole[i], &skipped[i], sizeof(LspHit)) != 0;
    EXPECT_EQ(different, 0u);
    EXPECT_GT(of_whole.hits, count / 20);
    if (!saves_nodes) continue;
    EXPECT_GT(of_skipped.shafts, 0u);
    EXPECT_LT(of_skipped.nodes, of_whole.nodes);
    // Without counts another loop runs.
    ASSERT_EQ(lsp_trace(&scene, &skip, rays.data(), skipped.data(), count, nullptr, nullptr), LSP_OK);
    EXPECT_EQ(std::memcmp(whole.data(), skipped.data(), count * sizeof(LspHit)), 0);
  }
}

TEST(Conservative, LeavesTheAnswersOfExactRaysAsTheyAre) {
  Mesh flat = soup(1500, 0.2f);
  for (glm::vec3& p : flat.positions) p.z = 0.25f;
  Mesh tiny = sphere(20);
  for (glm::vec3& p : tiny.positions) p *= 1e-6f;
  for (const Base base : {Base::kBvh, Base::kNTree}) {
    SCOPED_TRACE(base == Base::kNTree ? "NTree" : "BVH");
    const std::vector<uint32_t> depths =
        base == Base::kNTree ? std::vector<uint32_t>{1, 2} : std::vector<uint32_t>{3, 6};
    expect_same_answers(sphere(24), options_for(base, 4, depths), 30000);
    expect_same_answers(sphere(24), options_for(base, 3, depths, true), 30000);
    expect_same_answers(soup(3000, 0.2f), options_for(base, 4, depths), 30000);
    expect_same_answers(far_soup(3000, 0.1f), options_for(base, 4, depths), 30000);
    expect_same_answers(flat, options_for(base, 4, depths), 30000, base == Base::kBvh);
    expect_same_answers(tiny, options_for(base, 4, depths), 30000);
  }
}

class ConservativeOfScene : public testing::TestWithParam<const char*> {};
TEST_P(ConservativeOfScene, LeavesTheAnswersOfExactRaysAsTheyAre) {
  const std::filesystem::path path = std::filesystem::path(LSP_SCENES_DIR) / GetParam();
  if (!std::filesystem::exists(path)) GTEST_SKIP() << path << " is not there";
  const Mesh mesh = import_meshes(std::array{path}, {});
  expect_same_answers(mesh, options_for(Base::kBvh, 4, {8}), 100000);
  expect_same_answers(mesh, options_for(Base::kNTree, 4, {1}), 50000);
}
INSTANTIATE_TEST_SUITE_P(Paper, ConservativeOfScene, testing::Values("paper/bunny.ply", "paper/sibenik.obj"),
                         [](const auto& info) { return std::filesystem::path(info.param).stem().string(); });

// ---- the bits in the file
// -----------------------------------------------------------------------------------

TEST(Conservative, SetsEveryBitThatTheCentroidRaysSet) {
  BakeOptions options = options_for(Base::kBvh, 4, {5});
  const Baked conservative = bake(sphere(24), options);
  options.line_space.conservative = false;
  const Baked centroid = bake(sphere(24), options);
  ASSERT_EQ(conservative.line_spaces.records.size(), centroid.line_spaces.records.size());
  for (size_t k = 0; k < centroid.line_spaces.records.size(); ++k) {
    EXPECT_TRUE(conservative.line_spaces.records[k].format & LSP_FORMAT_CONSERVATIVE);
    EXPECT_FALSE(centroid.line_spaces.records[k].format & LSP_FORMAT_CONSERVATIVE);
    for (uint32_t s = 0; s < 15 * 256; ++s)
      EXPECT_LE(file_bit(centroid, uint32_t(k), s), file_bit(conservative, uint32_t(k), s));
  }
  EXPECT_GT(conservative.line_spaces.filled, centroid.line_spaces.filled);
  EXPECT_LT(conservative.line_spaces.filled, conservative.line_spaces.shafts);
}

TEST(Conservative, DirectedLineSpacesSayTheSameOfEitherDirection) {
  const Baked one = bake(sphere(24), options_for(Base::kBvh, 3, {4}));
  const Baked two = bake(sphere(24), options_for(Base::kBvh, 3, {4}, true));
  ASSERT_EQ(one.line_spaces.records.size(), two.line_spaces.records.size());
  EXPECT_EQ(two.line_spaces.filled, 2 * one.line_spaces.filled);
  for (uint32_t k = 0; k < one.line_spaces.records.size(); ++k) {
    EXPECT_FALSE(two.line_spaces.records[k].format & LSP_FORMAT_SYMMETRIC);
    for (uint32_t a = 0; a < 6; ++a)
      for (uint32_t b = a + 1; b < 6; ++b)
        for (uint32_t p = 0; p < 9; ++p)
          for (uint32_t q = 0; q < 9; ++q) {
            const bool bit = file_bit(one, k, LSP_SHAFT_INDEX_SYMMETRIC(a, b, p, q, 3u));
            ASSERT_EQ(file_bit(two, k, LSP_SHAFT_INDEX(a, b, p, q, 3u)), bit);
            ASSERT_EQ(file_bit(two, k, LSP_SHAFT_INDEX(b, a, q, p, 3u)), bit);
          }
  }
}

}  // namespace
}  // namespace lsp::test
