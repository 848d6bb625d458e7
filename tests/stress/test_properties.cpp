// What holds of traces without a reference: nothing leaks, moving everything moves nothing, shafts are in
// range, no node boundary loses a surface, the two backends agree.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <iostream>

#include "lsp/vulkan_device.hpp"
#include "ray_errors.h"
#include "rays.h"
#include "scene_builder.h"
#include "variants.h"

namespace lsp::stress {
namespace {

// A room with a ball in it, fine enough for Line Spaces that matter; coordinates are multiples of 2^-12, so
// that scaling and moving by powers of two is exact.
Triangles ball_in_room() {
  Triangles t;
  const glm::vec3 x(4, 0, 0), y(0, 4, 0), z(0, 0, 4), o(0);
  bench::add_grid(t, 4, o, y, z);
  bench::add_grid(t, 4, x, z, y);
  bench::add_grid(t, 4, o, z, x);
  bench::add_grid(t, 4, y, x, z);
  bench::add_grid(t, 4, o, x, y);
  bench::add_grid(t, 4, z, y, x);
  bench::add_sphere(t, 16, glm::vec3(2.1f, 1.7f, 1.9f), 0.9f);
  for (auto& triangle : t) {
    for (glm::vec3& p : triangle) p = glm::round(p * 4096.0f) / 4096.0f;
  }
  std::erase_if(t, [](const auto& c) { return c[0] == c[1] || c[1] == c[2] || c[2] == c[0]; });
  return t;
}

const SceneOptions kBallOptions{Base::kBvh, 4, {3, 7}};

std::vector<LspRay> grid_rays(size_t count, uint64_t seed) {
  Random random(seed);
  const auto coordinate = [&](double lo, double hi) {
    return static_cast<float>(std::round((lo + (hi - lo) * random.uniform()) * 4096) / 4096);
  };
  std::vector<LspRay> rays;
  while (rays.size() < count) {
    const LspRay ray{{coordinate(-1, 5), coordinate(-1, 5), coordinate(-1, 5)},
                     0,
                     {coordinate(-1, 1), coordinate(-1, 1), coordinate(-1, 1)},
                     INFINITY};
    const float d[3] = {std::fabs(ray.direction.x), std::fabs(ray.direction.y), std::fabs(ray.direction.z)};
    if (d[0] == d[1] || d[1] == d[2] || d[2] == d[0]) continue;  // which axis is the largest would be a tie
    rays.push_back(ray);
  }
  return rays;
}

std::vector<LspHit> traced(const StressScene& scene, const std::vector<LspRay>& rays, uint32_t flags) {
  std::vector<LspHit> hits(rays.size());
  trace_ours(scene.scene(), flags, rays.data(), hits.data(), rays.size());
  return hits;
}

// ---- symmetries ------------------------------------------------------------------------------------------

struct Symmetry {
  const char* name;
  glm::vec3 (*point)(const glm::vec3&);
  glm::vec3 (*direction)(const glm::vec3&);
};
void PrintTo(const Symmetry& symmetry, std::ostream* out) { *out << symmetry.name; }
glm::vec3 same(const glm::vec3& v) { return v; }
glm::vec3 cycled(const glm::vec3& v) { return {v.y, v.z, v.x}; }
glm::vec3 swapped(const glm::vec3& v) { return {v.y, v.x, v.z}; }
glm::vec3 mirrored(const glm::vec3& v) { return {v.x, -v.y, v.z}; }
const Symmetry kSymmetries[] = {
    {"moved", [](const glm::vec3& v) { return v + glm::vec3(512, -256, 1024); }, same},
    {"scaled_up", [](const glm::vec3& v) { return v * 0x1p20f; },
     [](const glm::vec3& v) { return v * 0x1p20f; }},
    {"scaled_down", [](const glm::vec3& v) { return v * 0x1p-20f; },
     [](const glm::vec3& v) { return v * 0x1p-20f; }},
    {"longer_direction", same, [](const glm::vec3& v) { return v * 0x1p60f; }},
    {"cycled", cycled, cycled},
    {"swapped", swapped, swapped},
    {"mirrored", mirrored, mirrored},
};

class Symmetries : public testing::TestWithParam<Symmetry> {};

// The exact answer is the same to the bit (u, v and t; t counts in lengths of the direction): translation,
// powers of two, order and sign of the axes round nothing differently. Between hits at the same t any may
// win.
TEST_P(Symmetries, ChangeNoExactAnswer) {
  const Symmetry& symmetry = GetParam();
  const bool longer = std::string(symmetry.name) == "longer_direction";
  for (const Base base : {Base::kBvh, Base::kNTree, Base::kCells}) {
    Triangles triangles = ball_in_room();
    const StressScene before("before", triangles, {base, 1, {0}});
    for (auto& t : triangles) {
      for (glm::vec3& p : t) p = symmetry.point(p);
    }
    const StressScene after("after", triangles, {base, 1, {0}});
    std::vector<LspRay> rays = grid_rays(60000, 5), changed = rays;
    for (LspRay& ray : changed) {
      const glm::vec3 o = symmetry.point({ray.origin.x, ray.origin.y, ray.origin.z});
      const glm::vec3 d = symmetry.direction({ray.direction.x, ray.direction.y, ray.direction.z});
      ray.origin = {o.x, o.y, o.z};
      ray.direction = {d.x, d.y, d.z};
    }
    const std::vector<LspHit> a = traced(before, rays, 0), b = traced(after, changed, 0);
    size_t different = 0, ties = 0, hits = 0;
    for (size_t i = 0; i < rays.size(); ++i) {
      const float t = longer ? b[i].t * 0x1p60f : b[i].t;
      hits += a[i].primitive != LSP_NONE;
      if (a[i].primitive != b[i].primitive && a[i].t == t) {
        ++ties;
      } else if (a[i].primitive != b[i].primitive || a[i].t != t || a[i].u != b[i].u || a[i].v != b[i].v) {
        ++different;
      }
    }
    EXPECT_EQ(different, 0u) << "of " << rays.size();
    EXPECT_LT(ties, rays.size() / 50);
    EXPECT_GT(hits, rays.size() / 3);
  }
}
INSTANTIATE_TEST_SUITE_P(Stress, Symmetries, testing::ValuesIn(kSymmetries),
                         [](const auto& info) { return std::string(info.param.name); });

// ---- leaks -----------------------------------------------------------------------------------------------

TEST(Closed, RoomsOfEveryScaleDoNotLeak) {
  for (const Base base : {Base::kBvh, Base::kNTree, Base::kCells}) {
    for (const float scale : {1e-6f, 1e-3f, 1.0f, 1e3f, 1e6f}) {
      for (const float away : {0.0f, 0.7f, 1e3f, 1e5f}) {
        const StressScene scene("room", placed(room(), scale, scale * away * glm::vec3(1, -0.3f, 0.77f)),
                                {base, 4, {1, 3}});
        const Outcome outcome = check_closed(scene, trace_ours, 10000, 3);
        EXPECT_EQ(outcome.failures, 0u) << scale << " " << away << ": " << outcome.first_failure;
      }
    }
  }
}

// Rays at points of a surface that lie exactly on borders, edges and corners of nodes and cells.
TEST(Borders, OfNodesLoseNoSurface) {
  for (const Base base : {Base::kBvh, Base::kNTree}) {
    Triangles t;
    bench::add_grid(t, 32, glm::vec3(-1, 0, -1), glm::vec3(2, 0, 0), glm::vec3(0, 0, 2));
    const StressScene plane("plane", t, {base, 4, {2, 5}});
    const lsp_scene& s = plane.scene();
    std::vector<float> xs, zs;
    for (uint32_t i = 0; i < s.header->node_count && base == Base::kBvh; ++i) {
      xs.insert(xs.end(), {s.nodes[i].lo0.x, s.nodes[i].hi0.x, s.nodes[i].lo1.x, s.nodes[i].hi1.x});
      zs.insert(zs.end(), {s.nodes[i].lo0.z, s.nodes[i].hi0.z, s.nodes[i].lo1.z, s.nodes[i].hi1.z});
    }
    if (base == Base::kNTree) {
      const auto cells = static_cast<int>(s.header->ntree_branching);
      for (int i = 0; i <= cells * cells; ++i) {
        const float at = s.header->ntree_size / static_cast<float>(cells * cells) * static_cast<float>(i);
        xs.push_back(s.header->ntree_lo.x + at);
        zs.push_back(s.header->ntree_lo.z + at);
      }
    }
    Random random(9);
    std::vector<LspRay> rays;
    for (int i = 0; i < 100000; ++i) {
      const glm::vec3 at(xs[random.below(static_cast<uint32_t>(xs.size()))], 0,
                         zs[random.below(static_cast<uint32_t>(zs.size()))]);
      if (std::fabs(at.x) > 0.999f || std::fabs(at.z) > 0.999f) continue;
      glm::vec3 from(at.x, random.below(2) == 0 ? 1 : -1, at.z);
      // Straight down, in the plane of a border, or from anywhere.
      if (random.below(3) != 0) from.x = static_cast<float>(2 * random.uniform() - 1);
      if (random.below(3) != 0) from.z = static_cast<float>(2 * random.uniform() - 1);
      const glm::vec3 d = at - from;
      rays.push_back({{from.x, from.y, from.z}, 0, {d.x, d.y, d.z}, INFINITY});
    }
    ASSERT_GT(rays.size(), 50000u);
    for (const uint32_t flags : {0u, LSP_TRACE_ANY_HIT}) {
      size_t lost = 0;
      for (const LspHit& hit : traced(plane, rays, flags)) lost += hit.primitive == LSP_NONE;
      EXPECT_EQ(lost, 0u) << "of " << rays.size();
    }
  }
}

// ---- approximate answers ---------------------------------------------------------------------------------

TEST(Shafts, AreInRange) {
  for (const Base base : {Base::kBvh, Base::kNTree}) {
    for (const float scale : {1e-6f, 1.0f, 1e6f}) {
      const StressScene scene("room", placed(room(), scale, glm::vec3(scale)), {base, 5, {0, 2}});
      ASSERT_GT(scene.scene().header->line_space_count, 0u);
      const Outcome outcome = check_shafts(scene, sound::shaft, 3000, 21);
      EXPECT_GT(outcome.cases, 10000u);
      EXPECT_EQ(outcome.failures, 0u) << outcome.first_failure;
    }
  }
}

struct Errors {
  double wrong = 0, depth = 0;
};
Errors approximate_errors(const StressScene& scene) {
  const std::vector<LspRay> rays = bench::surface_rays(scene.soup(), 40000, 3);
  const std::vector<LspHit> truth = traced(scene, rays, 0),
                            answers = traced(scene, rays, LSP_TRACE_APPROXIMATE);
  const bench::RayErrors errors = bench::ray_errors(scene.soup(), rays, truth, answers);
  return {errors.wrong_share(), errors.depth_diagonal.mean};
}

// The approximate answers err everywhere as they do at home, within a tenth and one ray in a thousand, the
// depth within a tenth and 1e-4 of the diagonal; and far from the origin in proportion to the margin of the
// boxes, which is 20 u |o| there: with m = 20 u |o| / diagonal by 6 m and 2 m.
TEST(Approximate, ErrorsDoNotDependOnScaleAndLittleOnPlace) {
  const Errors home = approximate_errors(StressScene("home", ball_in_room(), kBallOptions));
  std::cout << "at home: wrong " << 100 * home.wrong << " %, depth " << 100 * home.depth << " %\n";
  EXPECT_LT(home.wrong, 0.02);
  for (const float scale : {1e-6f, 1.0f, 1e6f}) {
    for (const float away : {0.0f, 300.0f, 3000.0f}) {
      const glm::vec3 offset = scale * away * glm::vec3(1, 0.4f, -0.9f);
      const StressScene scene("away", placed(ball_in_room(), scale, offset), kBallOptions);
      const Errors errors = approximate_errors(scene);
      const double m = 20 * kU * double{offset.x} / scene.diagonal();
      std::cout << scale << ", " << away << " away: wrong " << 100 * errors.wrong << " %, depth "
                << 100 * errors.depth << " %\n";
      EXPECT_LE(errors.wrong, 1.1 * home.wrong + 1e-3 + 6 * m) << scale << " " << away;
      EXPECT_LE(errors.depth, 1.1 * home.depth + 1e-4 + 2 * m) << scale << " " << away;
    }
  }
}

// No approximate hit lies outside the scene.
TEST(Approximate, HitsLieInTheScene) {
  for (const Base base : {Base::kBvh, Base::kNTree}) {
    const StressScene scene("ball", ball_in_room(), {base, 4, {3, 7}});
    const double margin = 0.01 * scene.diagonal();
    for (const Family& f : families()) {
      if (std::string(f.name) == "far" || std::string(f.name) == "huge") continue;  // t itself is coarser
      const std::vector<LspRay> rays = rays_of(f, scene, 4000, 31);
      for (const uint32_t flags :
           {LSP_TRACE_APPROXIMATE, LSP_TRACE_APPROXIMATE | LSP_TRACE_NEAR_APPROXIMATE}) {
        const std::vector<LspHit> hits = traced(scene, rays, flags);
        for (size_t i = 0; i < rays.size(); ++i) {
          if (hits[i].primitive == LSP_NONE) continue;
          const glm::dvec3 d(rays[i].direction.x, rays[i].direction.y, rays[i].direction.z);
          const glm::dvec3 at =
              glm::dvec3(rays[i].origin.x, rays[i].origin.y, rays[i].origin.z) + double{hits[i].t} * d;
          for (int k = 0; k < 3; ++k) {
            ASSERT_GE(at[k], scene.soup().lo[k] - margin) << f.name << " ray " << i;
            ASSERT_LE(at[k], scene.soup().hi[k] + margin) << f.name << " ray " << i;
          }
        }
      }
    }
  }
}

TEST(Invalid, RaysAreCounted) {
  const StressScene scene("room", room());
  for (const Family& f : families()) {
    const std::vector<LspRay> rays = rays_of(f, scene, 4000, 17);
    std::vector<LspHit> hits(rays.size());
    for (const uint32_t flags : {0u, LSP_TRACE_APPROXIMATE}) {
      const lsp_trace_options options{flags, 0};
      lsp_trace_counts counts{};
      ASSERT_EQ(lsp_trace(&scene.scene(), &options, rays.data(), hits.data(), rays.size(), &counts, nullptr),
                LSP_OK);
      uint64_t expected = 0;
      ReferenceRay reference;
      for (const LspRay& ray : rays) expected += !reference_ray(ray, &reference);
      EXPECT_EQ(counts.invalid, expected) << f.name;
      EXPECT_EQ(counts.rays, rays.size());
    }
  }
}

// ---- CPU and Vulkan --------------------------------------------------------------------------------------

class Backends : public testing::Test {
 protected:
  void SetUp() override {
    std::string why;
    if (!VulkanTracer::available(&why)) GTEST_SKIP() << why;
  }
};

void expect_same_answers(VulkanTracer& tracer, const lsp_scene& scene, const std::vector<LspRay>& rays,
                         uint32_t flags, const char* what) {
  const lsp_trace_options options{flags, 0.5f};
  std::vector<LspHit> cpu(rays.size()), gpu(rays.size());
  ASSERT_EQ(lsp_trace(&scene, &options, rays.data(), cpu.data(), rays.size(), nullptr, nullptr), LSP_OK);
  tracer.trace(options, rays, gpu);
  size_t different = 0, first = rays.size();
  for (size_t i = 0; i < rays.size(); ++i) {
    if (std::memcmp(&cpu[i], &gpu[i], sizeof(LspHit)) == 0) continue;
    if (different++ == 0) first = i;
  }
  EXPECT_EQ(different, 0u) << what << " flags " << flags << " ray " << first << ": t "
                           << cpu[first % rays.size()].t << " and " << gpu[first % rays.size()].t;
}

TEST_F(Backends, GiveTheSameBitsForEveryFamily) {
  VulkanTracer tracer;
  for (const Base base : {Base::kBvh, Base::kNTree}) {
    for (const float scale : {1.0f, 1e-6f}) {
      const StressScene scene("room", placed(room(), scale, glm::vec3(0)), {base, 4, {1, 3}});
      tracer.load(scene.scene(), LSP_USE_EXACT | LSP_USE_APPROXIMATE);
      for (const Family& f : families()) {
        const std::vector<LspRay> rays = rays_of(f, scene, 4000, 41);
        for (const uint32_t flags : {0u, LSP_TRACE_ANY_HIT, LSP_TRACE_APPROXIMATE,
                                     LSP_TRACE_APPROXIMATE | LSP_TRACE_NEAR_APPROXIMATE,
                                     LSP_TRACE_APPROXIMATE | LSP_TRACE_NEAR_SKIP}) {
          expect_same_answers(tracer, scene.scene(), rays, flags, f.name);
        }
      }
    }
  }
}

// A file whose one Line Space answers every ray with the number of its shaft: one triangle record a shaft,
// and a tolerance that takes any plane. Rays through and beside the borders of patches, edges and corners.
TEST_F(Backends, ChooseTheSameShaft) {
  test::BuildOptions options;
  options.triangles = 30 * 16;
  options.resolution = 2;
  options.line_space_depth = 0;
  options.normals = options.materials = false;
  test::Parts parts = test::build_parts(options);
  ASSERT_GE(parts.line_spaces.size(), 1u);
  parts.header.plane_tolerance = 1e30f;
  for (LspTriangle& t : parts.triangles) {
    t.v0 = {0.3f, 0.1f, 0.2f}, t.v1 = {0.9f, 0.33f, -0.41f}, t.v2 = {-0.27f, 0.8f, 0.51f};
  }
  for (uint32_t i = 0; i < parts.triangles.size(); ++i) parts.triangles[i].primitive = i;
  LspLineSpace ls = parts.line_spaces[parts.header.root_line_space & LSP_LINE_SPACE_MASK];
  ls.format = 2u | (2u << LSP_FORMAT_ENTRY_SHIFT) | LSP_FORMAT_DENSE;
  ls.candidate_first = 0;
  ls.word_first = 0;
  ls.triangle_first = 0;
  ls.triangle_count = ls.filled = 480;
  parts.line_spaces = {ls};
  parts.bit_words.assign(1, {0, 0});
  parts.candidates.assign(240, 0);
  for (uint32_t i = 0; i < 480; ++i) parts.candidates[i / 2] |= i << (16 * (i % 2));
  for (LspNode& node : parts.nodes) node.line_space0 = node.line_space1 = LSP_NONE;
  parts.header.root_line_space = LSP_TERMINAL_BIT;
  parts.header.line_space_count = 1;
  parts.header.bit_word_count = 1;
  parts.header.candidate_word_count = 240;
  const test::Bytes bytes = test::write_raw(parts);
  lsp_scene scene;
  lsp_error error;
  ASSERT_EQ(lsp_open(bytes.data(), bytes.size(), &scene, &error), LSP_OK) << error.message;

  const float lo[3] = {ls.lo.x, ls.lo.y, ls.lo.z}, hi[3] = {ls.hi.x, ls.hi.y, ls.hi.z};
  Random random(77);
  std::vector<LspRay> rays;
  const auto special = [&](float out) {
    float p[3];
    for (int k = 0; k < 3; ++k) {
      const uint32_t kind = random.below(6);
      const float middle = lo[k] + (hi[k] - lo[k]) * 0.5f;
      p[k] = kind == 0   ? lo[k]
             : kind == 1 ? hi[k]
             : kind == 2 ? middle
             : kind == 3 ? std::nextafter(middle, random.below(2) == 0 ? 9.0f : -9.0f)
                         : lo[k] + static_cast<float>(random.uniform()) * (hi[k] - lo[k]);
      p[k] += out * static_cast<float>(2 * random.uniform() - 1) * (random.below(2) == 0 ? 1.0f : 0.0f);
    }
    return glm::vec3(p[0], p[1], p[2]);
  };
  for (int i = 0; i < 60000; ++i) {
    const glm::vec3 from = special(4), to = special(0), d = to - from;
    if (d == glm::vec3(0)) continue;
    rays.push_back({{from.x, from.y, from.z}, -1e30f, {d.x, d.y, d.z}, INFINITY});
  }
  const uint32_t flags = LSP_TRACE_APPROXIMATE | LSP_TRACE_NEAR_APPROXIMATE;
  const lsp_trace_options trace{flags, 0};
  std::vector<LspHit> hits(rays.size());
  ASSERT_EQ(lsp_trace(&scene, &trace, rays.data(), hits.data(), rays.size(), nullptr, &error), LSP_OK);
  std::vector<bool> seen(480);
  size_t answered = 0;
  for (size_t i = 0; i < rays.size(); ++i) {
    if (hits[i].primitive == LSP_NONE) continue;
    ++answered;
    seen[hits[i].primitive] = true;
    uint32_t shaft = 0;
    ASSERT_TRUE(sound::shaft(scene, rays[i], 0, &shaft));
    ASSERT_EQ(hits[i].primitive, shaft);
  }
  EXPECT_GT(answered, rays.size() / 2);
  EXPECT_GT(std::count(seen.begin(), seen.end(), true), 450);
  VulkanTracer tracer;
  tracer.load(scene, LSP_USE_APPROXIMATE);
  expect_same_answers(tracer, scene, rays, flags, "shafts");
}

}  // namespace
}  // namespace lsp::stress
