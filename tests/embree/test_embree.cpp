// The exact trace against Embree, an independent implementation, and against geometry itself: hit or miss and
// primitive agree but for a handful of grazed edges in a million, and nothing leaks through a closed mesh.
//
// LSP_EMBREE_RAYS=1000000 sets the number of rays a scene (default 200,000).
#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>

#include "embree_scene.h"
#include "leaks.h"
#include "lsp/in_chunks.hpp"
#include "open_file.h"
#include "ray_errors.h"
#include "rays.h"
#include "shared_bake.h"
#include "tracer.h"
#include "verdict.h"

namespace lsp::bench {
namespace {

namespace fs = std::filesystem;

size_t rays_per_scene() {
  const char* text = std::getenv("LSP_EMBREE_RAYS");
  return text ? std::strtoull(text, nullptr, 10) : 200000;
}

// The exact tree alone: quick to make.
fs::path tree_of(const fs::path& input) { return shared_bake(input, {"--no-line-spaces"}, LSP_BAKES_DIR); }

// N = 6, D = 9.
fs::path baked(const fs::path& input) {
  return shared_bake(input, {"--resolution", "6", "--depth", "9"}, LSP_BAKES_DIR);
}

std::vector<LspHit> traced(const OpenFile& file, const Mode& mode, std::span<const LspRay> rays) {
  std::vector<LspHit> hits(rays.size());
  cpu_tracer(file, machine_threads())->trace(mode, rays, hits);
  return hits;
}

std::vector<LspHit> reference_hits(const EmbreeScene& embree, std::span<const LspRay> rays) {
  std::vector<LspHit> hits(rays.size());
  embree_tracer(embree, EmbreeCall::kSingle, "", machine_threads())->trace({}, rays, hits);
  return hits;
}

class PaperScene : public testing::TestWithParam<const char*> {
 protected:
  void SetUp() override {
    input_ = fs::path(LSP_SCENES_DIR) / GetParam();
    if (!fs::exists(input_)) GTEST_SKIP() << input_ << " is not here";
  }
  fs::path input_;
};

// Hits, closest and any, of rays from the surface of a file's scene.
void expect_agreement(const OpenFile& file) {
  const Soup soup = soup_of(file.scene());
  const EmbreeScene embree(soup);
  const std::vector<LspRay> rays = surface_rays(soup, rays_per_scene(), 1);
  const std::vector<LspHit> ours = traced(file, {}, rays);
  const Agreement agreement = compare_exact(soup, rays, ours, reference_hits(embree, rays));
  for (const std::string& fault : agreement.faults) std::cout << fault << "\n";
  for (const std::string& example : agreement.examples) std::cout << example << "\n";
  std::cout << agreement.rays << " rays: " << agreement.ties << " ties, " << agreement.unresolved
            << " unresolved, " << agreement.grazes << " grazes, " << agreement.ours_wrong << " ours wrong, "
            << agreement.reference_wrong << " Embree wrong, " << agreement.both_wrong << " both wrong; "
            << agreement.hit_or_miss << " differ in hit or miss\n"
            << "depth off by (mean, 99th percentile, in float steps of the scene): ours "
            << agreement.our_depth.mean << ", " << agreement.our_depth.p99 << "; Embree "
            << agreement.reference_depth.mean << ", " << agreement.reference_depth.p99 << "\n";
  const auto limit = static_cast<uint64_t>(std::ceil(10e-6 * static_cast<double>(rays.size())));
  // Fewer than ten in a million differ beyond ties, whoever is wrong; and we never are.
  EXPECT_LT(agreement.beyond_ties(), limit);
  EXPECT_EQ(agreement.ours_wrong, 0u);
  EXPECT_EQ(agreement.both_wrong, 0u);

  // Any hit is the same question without the distance.
  const std::vector<LspHit> any = traced(file, {.any = true}, rays);
  size_t differ = 0;
  for (size_t i = 0; i < rays.size(); ++i) {
    differ += std::isinf(any[i].t) != std::isinf(ours[i].t);
  }
  EXPECT_EQ(differ, 0u);
}

TEST_P(PaperScene, ExactAgreesWithEmbree) { expect_agreement(OpenFile(baked(input_))); }

// The nodes of eight children that files of cells have.
TEST_P(PaperScene, WideNodesAgreeWithEmbree) {
  const OpenFile file(shared_bake(input_, {"--base", "wide"}, LSP_BAKES_DIR));
  ASSERT_NE(file.scene().header->required_features & LSP_FEATURE_WIDE, 0u);
  expect_agreement(file);
}

// Both base structures find the same nearest point of every ray, to the bit; where two triangles meet there,
// either.
TEST_P(PaperScene, NTreeAnswersAsTheBvhDoes) {
  const OpenFile bvh(tree_of(input_));
  const OpenFile ntree(shared_bake(input_, {"--base", "ntree", "--no-line-spaces"}, LSP_BAKES_DIR));
  const std::vector<LspRay> rays = surface_rays(soup_of(bvh.scene()), rays_per_scene(), 2);
  const std::vector<LspHit> expected = traced(bvh, {}, rays);
  const std::vector<LspHit> hits = traced(ntree, {}, rays);
  size_t other_t = 0, other_primitive = 0, missed = 0;
  for (size_t i = 0; i < rays.size(); ++i) {
    other_t += std::bit_cast<uint32_t>(hits[i].t) != std::bit_cast<uint32_t>(expected[i].t);
    other_primitive += hits[i].primitive != expected[i].primitive;
    missed += expected[i].primitive == LSP_NONE;
  }
  std::cout << rays.size() << " rays, " << missed << " miss: " << other_primitive
            << " meet another triangle at the same t\n";
  EXPECT_EQ(other_t, 0u);
  EXPECT_LT(missed, rays.size());
}

TEST_P(PaperScene, ApproximateStaysWithinItsPromise) {
  const OpenFile file(baked(input_));
  const Soup soup = soup_of(file.scene());
  const EmbreeScene embree(soup);
  const std::vector<LspRay> rays = surface_rays(soup, rays_per_scene(), 1);
  const std::vector<LspHit> truth = reference_hits(embree, rays);
  for (const Mode& mode : {Mode{.approximate = true}, Mode{.approximate = true, .near_skip = true},
                           Mode{.approximate = true, .near_approximate = true}}) {
    const RayErrors errors = ray_errors(soup, rays, truth, traced(file, mode, rays));
    std::cout << mode.name() << ": wrong " << 100 * errors.wrong_share() << " % (hits " << errors.wrong_hits
              << ", misses " << errors.wrong_misses << "), depth " << 100 * errors.depth_diagonal.mean
              << " % of the diagonal, normals " << errors.normal_degrees.mean << " degrees\n";
    // The promise is the default's; the two that do less near the origin are reported beside it.
    if (mode.near_skip || mode.near_approximate) continue;
    EXPECT_LE(errors.wrong_share(), 0.01);
    EXPECT_LE(errors.depth_diagonal.mean, 0.007);
  }
}

std::string scene_name(const testing::TestParamInfo<const char*>& info) {
  return fs::path(info.param).stem().string();
}

INSTANTIATE_TEST_SUITE_P(Embree, PaperScene,
                         testing::Values("paper/bunny.ply", "paper/dragon.ply", "paper/sibenik.obj",
                                         "paper/sponza.gltf", "paper/conference.obj"),
                         scene_name);

// ---- leaks
// --------------------------------------------------------------------------------------------------

void expect_no_leaks(const fs::path& input) {
  const OpenFile file(tree_of(input));
  const Soup soup = soup_of(file.scene());
  ASSERT_EQ(open_edges(soup), 0u) << "the mesh is not closed, so the test says nothing";
  Random random(5);
  const std::vector<glm::dvec3> origins = interior_points(soup, 8, random);
  ASSERT_FALSE(origins.empty());
  const std::vector<LspRay> inside = inside_leak_rays(soup, origins, 200000);
  const std::vector<LspRay> outside = outside_leak_rays(soup, 200000, random);
  ASSERT_GT(outside.size(), 100u);
  for (const auto* rays : {&inside, &outside}) {
    for (const bool any : {false, true}) {
      size_t lost = 0;
      for (const LspHit& hit : traced(file, {.any = any}, *rays)) lost += hit.primitive == LSP_NONE;
      EXPECT_EQ(lost, 0u) << (rays == &inside ? "from inside" : "from outside") << (any ? ", any hit" : "")
                          << ", of " << rays->size();
    }
  }
}

class ClosedMesh : public testing::TestWithParam<const char*> {};

TEST_P(ClosedMesh, DoesNotLeak) {
  const fs::path input = fs::path(LSP_SCENES_DIR) / GetParam();
  if (!fs::exists(input)) GTEST_SKIP() << input << " is not here";
  expect_no_leaks(input);
}

INSTANTIATE_TEST_SUITE_P(Embree, ClosedMesh,
                         testing::Values("hard/tinybvh_bunny.ply", "paper/dragon.ply", "hard/kitten.obj",
                                         "hard/tinybvh_head.ply", "hard/common/fandisk.obj",
                                         "hard/common/nefertiti.obj"),
                         scene_name);

// Leaves that are there in part, some on a floor's edges: Embree passes those that a filter says.
TEST(Partial, ExactAgreesWithEmbree) {
  const fs::path path = fs::path(LSP_BAKES_DIR) / "leaves.obj";
  fs::create_directories(path.parent_path());
  std::ofstream materials(fs::path(path).replace_extension(".mtl"));
  std::ofstream out(path);
  out << "mtllib leaves.mtl\n";
  Random random(7);
  const auto between = [&](double lo, double hi) { return lo + (hi - lo) * random.uniform(); };
  size_t vertices = 0;
  for (const double share : {1.0, 0.05, 0.3, 0.6, 0.95}) {
    materials << "newmtl m" << share << "\nd " << share << "\n";
    out << "usemtl m" << share << "\n";
    for (int i = 0; i < 2000; ++i) {
      const double at[3] = {between(-1, 1), between(-1, 1), between(-1, 1)};
      for (int corner = 0; corner < 3; ++corner) {
        out << "v";
        for (const double x : at) out << " " << x + between(-0.1, 0.1);
        out << "\n";
      }
      out << "f " << vertices + 1 << " " << vertices + 2 << " " << vertices + 3 << "\n";
      vertices += 3;
    }
  }
  materials.close();
  out.close();
  for (const char* base : {"bvh", "ntree"}) {
    const OpenFile file(shared_bake(path, {"--no-line-spaces", "--base", base}, LSP_BAKES_DIR));
    const Soup soup = soup_of(file.scene());
    ASSERT_FALSE(soup.gaps.empty());
    const EmbreeScene embree(soup);
    const std::vector<LspRay> rays = surface_rays(soup, rays_per_scene(), 1);
    const std::vector<LspHit> ours = traced(file, {}, rays), reference = reference_hits(embree, rays);
    const Agreement agreement = compare_exact(soup, rays, ours, reference);
    EXPECT_LT(agreement.beyond_ties(), rays.size() / 50000);
    EXPECT_EQ(agreement.ours_wrong + agreement.both_wrong, 0u);
    // All in all they pass a few leaves each.
    size_t passed = 0, differ = 0;
    Soup solid = soup;
    solid.gaps.clear();
    const std::vector<LspHit> first = reference_hits(EmbreeScene(solid), rays);
    const std::vector<LspHit> any = traced(file, {.any = true}, rays);
    for (size_t i = 0; i < rays.size(); ++i) {
      passed += first[i].primitive != ours[i].primitive;
      differ += std::isinf(any[i].t) != std::isinf(ours[i].t);
    }
    EXPECT_GT(passed, rays.size() / 4);
    EXPECT_EQ(differ, 0u);
  }
}

// Closed meshes made here, so that the test runs anywhere: far from the origin, tiny, and with walls of zero
// thickness along the axes.
fs::path write_off(const std::string& name, const std::vector<glm::vec3>& vertices,
                   const std::vector<glm::uvec3>& triangles) {
  const fs::path path = fs::path(LSP_BAKES_DIR) / (name + ".off");
  fs::create_directories(path.parent_path());
  std::ofstream out(path);
  out.precision(9);
  out << "OFF\n" << vertices.size() << " " << triangles.size() << " 0\n";
  for (const glm::vec3& v : vertices) out << v.x << " " << v.y << " " << v.z << "\n";
  for (const glm::uvec3& t : triangles) out << "3 " << t.x << " " << t.y << " " << t.z << "\n";
  return path;
}

// A torus of n x n quads around `centre`; the tube is a quarter of the ring's radius.
fs::path torus(const std::string& name, unsigned n, glm::vec3 centre, float radius) {
  std::vector<glm::vec3> vertices;
  std::vector<glm::uvec3> triangles;
  for (unsigned i = 0; i < n; ++i) {
    for (unsigned j = 0; j < n; ++j) {
      const double a = 2 * M_PI * i / n, b = 2 * M_PI * j / n, r = radius * (1 + 0.25 * std::cos(b));
      vertices.push_back(centre + glm::vec3(r * std::cos(a), 0.25 * radius * std::sin(b), r * std::sin(a)));
      const unsigned i1 = (i + 1) % n, j1 = (j + 1) % n;
      triangles.push_back({i * n + j, i1 * n + j1, i1 * n + j});
      triangles.push_back({i * n + j, i * n + j1, i1 * n + j1});
    }
  }
  return write_off(name, vertices, triangles);
}

// A box whose sides are grids of m x m squares: every face of it, and of many a node, has no thickness.
fs::path box(const std::string& name, int m, glm::vec3 lo, glm::vec3 size) {
  std::vector<glm::vec3> vertices;
  std::vector<glm::uvec3> triangles;
  for (int axis = 0; axis < 3; ++axis) {
    for (int side = 0; side < 2; ++side) {
      const auto first = static_cast<unsigned>(vertices.size());
      for (int i = 0; i <= m; ++i) {
        for (int j = 0; j <= m; ++j) {
          glm::vec3 p;
          p[axis] = static_cast<float>(side);
          p[(axis + 1) % 3] = static_cast<float>(i) / static_cast<float>(m);
          p[(axis + 2) % 3] = static_cast<float>(j) / static_cast<float>(m);
          vertices.push_back(lo + p * size);
        }
      }
      const auto row = static_cast<unsigned>(m + 1);
      for (unsigned i = 0; i + 1 < row; ++i) {
        for (unsigned j = 0; j + 1 < row; ++j) {
          const unsigned a = first + i * row + j, b = a + row, c = b + 1, d = a + 1;
          if (side) {
            triangles.push_back({a, b, c});
            triangles.push_back({a, c, d});
          } else {
            triangles.push_back({a, c, b});
            triangles.push_back({a, d, c});
          }
        }
      }
    }
  }
  return write_off(name, vertices, triangles);
}

TEST(ProceduralClosedMesh, TorusDoesNotLeak) { expect_no_leaks(torus("torus", 100, glm::vec3(0), 1)); }
TEST(ProceduralClosedMesh, FarTorusDoesNotLeak) {
  expect_no_leaks(torus("torus_far", 60, glm::vec3(1000, -2000, 500), 3));
}
TEST(ProceduralClosedMesh, TinyTorusDoesNotLeak) {
  expect_no_leaks(torus("torus_tiny", 60, glm::vec3(1e-3f, 0, 0), 1e-4f));
}
TEST(ProceduralClosedMesh, BoxDoesNotLeak) {
  expect_no_leaks(box("box", 24, glm::vec3(-1), glm::vec3(2, 1, 3)));
}

}  // namespace
}  // namespace lsp::bench
