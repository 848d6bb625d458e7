// Triangles that are there in part: the share of rays that they say passes, the same rays on the CPU and on
// Vulkan, exact and approximate, for closest and any hit.
#include <gtest/gtest.h>
#include <unistd.h>

#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <optional>

#include "bake.h"
#include "color_materials.h"
#include "hard_rays.h"
#include "import/import.h"
#include "lsp/lsp.h"
#include "lsp/lsp_vulkan.h"
#include "lsp/scene_file.hpp"
#include "lsp/vulkan_device.hpp"
#include "meshes.h"
#include "surface_rays.h"
#include "traced.h"
#include "writer.h"

namespace lsp::test {
namespace {

namespace fs = std::filesystem;

// Five standard deviations of a share that `count` independent rays measure.
double bound(double share, double count) { return 5 * std::sqrt(share * (1 - share) / count) + 1e-4; }

// A file of a bake, opened, and forgotten with it.
class BakedFile {
 public:
  explicit BakedFile(lsp::Baked baked) : baked_(std::move(baked)) {
    const std::string path =
        (fs::temp_directory_path() / ("lsp_test_coverage_" + std::to_string(getpid()) + ".lsp")).string();
    write_lsp(path, baked_, "{}", {});
    file_.emplace(path);
    fs::remove(path);
  }
  const lsp_scene& scene() const { return file_->scene(); }
  const lsp::Baked& baked() const { return baked_; }

 private:
  lsp::Baked baked_;
  std::optional<SceneFile> file_;
};

BakeOptions options_of(Base base, Purpose purpose = Purpose::kAll) {
  BakeOptions options;
  options.base = base;
  options.purpose = purpose;
  options.cells = 6;
  options.cell_tables.far_samples = 24;
  options.cell_tables.origin_samples = 24;
  options.ntree.branching = 4;
  options.line_space.resolution = 4;
  options.line_space.depths = {base == Base::kNTree ? 1u : 3u};
  if (purpose == Purpose::kVisibility) options.line_space.kind = LineSpaceKind::kBinary;
  return options;
}

double hit_share(const std::vector<LspHit>& hits) {
  size_t count = 0;
  for (const LspHit& h : hits) count += h.primitive != LSP_NONE;
  return double(count) / double(hits.size());
}

// All ways to trace a file, exact ones where it has the tree for them.
std::vector<lsp_trace_options> modes_of(const lsp_scene& scene) {
  std::vector<lsp_trace_options> modes;
  const uint32_t features = scene.header->required_features;
  for (const uint32_t any : {0u, LSP_TRACE_ANY_HIT}) {
    if (features & LSP_FEATURE_EXACT) modes.push_back({any, 0});
    const uint32_t approximate = LSP_TRACE_APPROXIMATE | any;
    modes.push_back({approximate, 0});
    if (features & LSP_FEATURE_LINE_SPACES) {
      modes.push_back({approximate, 0.5f});
      modes.push_back({approximate | LSP_TRACE_NEAR_APPROXIMATE, 0});
      modes.push_back({approximate | LSP_TRACE_NEAR_SKIP, 0});
    }
    if (features & LSP_FEATURE_CELLS) {
      modes.push_back({approximate, 0, LSP_QUALITY_FAST});
      modes.push_back({approximate, 0, LSP_QUALITY_ACCURATE});
      modes.push_back({approximate | LSP_TRACE_MAX_LOSS, 0, 0, 0});
    }
  }
  return modes;
}

std::string text_of(const lsp_trace_options& o) {
  return "flags " + std::to_string(o.flags) + " lod " + std::to_string(o.lod) + " quality " +
         std::to_string(o.quality);
}

// ---- one sheet ----

// A wall and in front of it a sheet of two triangles, of which `coverage` is there.
Mesh sheet(float coverage) {
  Mesh mesh;
  add_triangle(mesh, {-2, -2, 0}, {2, -2, 0}, {2, 2, 0});
  add_triangle(mesh, {-2, -2, 0}, {2, 2, 0}, {-2, 2, 0});
  add_triangle(mesh, {-1, -1, 1}, {1, -1, 1}, {1, 1, 1});
  add_triangle(mesh, {-1, -1, 1}, {1, 1, 1}, {-1, 1, 1});
  mesh.materials.resize(2);
  mesh.materials[1].opacity = coverage;
  mesh.material_ids = {0, 0, 1, 1};
  return mesh;
}

// Rays down onto a sheet at height 1, all of different origin, or from one point; they end before the wall.
std::vector<LspRay> rays_at_sheet(uint32_t count, bool one_origin, float tmax) {
  std::vector<LspRay> rays;
  const auto root = uint32_t(std::sqrt(double(count)));
  for (uint32_t i = 0; i < root * root; ++i) {
    const float x = 1.8f * (float(i % root) + 0.5f) / float(root) - 0.9f;
    const float y = 1.8f * (float(i / root) + 0.5f) / float(root) - 0.9f;
    if (one_origin)
      rays.push_back({{0, 0, 3}, 0, {x / 2, y / 2, -1}, tmax + 1});
    else
      rays.push_back({{x, y, 2}, 0, {0, 0, -1}, tmax});
  }
  return rays;
}

TEST(Coverage, AShareOfRaysPassesASheet) {
  for (const float coverage : {0.02f, 0.25f, 0.5f, 0.9f}) {
    const lsp::Baked baked = bake(sheet(coverage), options_of(Base::kBvh));
    for (const bool one_origin : {false, true}) {
      const std::vector<LspRay> rays = rays_at_sheet(40000, one_origin, 1.5f);
      const auto closest = trace(view(baked), {0, 0}, rays);
      EXPECT_NEAR(hit_share(closest), coverage, bound(coverage, double(rays.size()))) << one_origin;
      // Any hit is the same question, and the wall behind is hit by the others.
      EXPECT_EQ(hit_share(trace(view(baked), {LSP_TRACE_ANY_HIT, 0}, rays)), hit_share(closest));
      std::vector<LspRay> longer = rays;
      for (LspRay& r : longer) r.tmax = INFINITY;
      const auto through = trace(view(baked), {0, 0}, longer);
      for (size_t i = 0; i < rays.size(); ++i)
        ASSERT_EQ(through[i].primitive < 2, closest[i].primitive == LSP_NONE) << i;
    }
  }
}

// Rays that differ by a step of one float are as independent as others: in neighbours both pass as often as
// the product of the shares says, and so do two triangles on one ray.
TEST(Coverage, DecisionsAreIndependent) {
  constexpr float kShare = 0.5f;
  Mesh mesh = sheet(kShare);
  add_triangle(mesh, {-1, -1, 0.5f}, {1, -1, 0.5f}, {1, 1, 0.5f});
  add_triangle(mesh, {-1, -1, 0.5f}, {1, 1, 0.5f}, {-1, 1, 0.5f});
  mesh.material_ids = {0, 0, 1, 1, 1, 1};
  const lsp::Baked baked = bake(mesh, options_of(Base::kBvh));
  for (int component = 0; component < 6; ++component) {
    std::vector<LspRay> rays;
    LspRay ray{{0.3f, 0.1f, 2}, 0, {0.01f, 0.02f, -1}, INFINITY};
    float* const value = component < 3 ? &ray.origin.x + component : &ray.direction.x + (component - 3);
    for (uint32_t i = 0; i < 20000; ++i) {
      rays.push_back(ray);
      *value = std::nextafter(*value, 9.0f);
    }
    const auto hits = trace(view(baked), {0, 0}, rays);
    size_t first = 0, second = 0, both = 0, same = 0;
    for (size_t i = 0; i < hits.size(); ++i) {
      const bool upper = hits[i].primitive == 2 || hits[i].primitive == 3, lower = hits[i].primitive > 3;
      first += upper;
      second += lower;
      both += hits[i].primitive < 2;
      if (i > 0) same += upper == (hits[i - 1].primitive == 2 || hits[i - 1].primitive == 3);
    }
    const double n = double(hits.size());
    EXPECT_NEAR(double(first) / n, 0.5, bound(0.5, n)) << component;
    EXPECT_NEAR(double(second) / n, 0.25, bound(0.25, n)) << component;
    EXPECT_NEAR(double(both) / n, 0.25, bound(0.25, n)) << component;
    EXPECT_NEAR(double(same) / n, 0.5, bound(0.5, n)) << component;
  }
}

// The example of the specification.
TEST(Coverage, TheHashIsTheSpecifications) {
  Mesh mesh;
  for (int i = 0; i < 7; ++i) add_triangle(mesh, {9, 9, 9}, {10, 9, 9}, {9, 10, 9});
  add_triangle(mesh, {-1, -1, 1}, {1, -1, 1}, {0, 1, 1});
  const LspRay ray{{0, 0, 0}, 0, {0, 0, 1}, INFINITY};
  for (const uint32_t gaps : {5398u, 5399u}) {
    lsp::Baked baked = bake(mesh, options_of(Base::kBvh));
    for (LspTriangle& t : baked.triangles)
      if (t.primitive == 7) t.flags |= gaps << LSP_TRIANGLE_GAPS_SHIFT;
    set_counts(baked);
    EXPECT_EQ(trace(view(baked), {0, 0}, {ray})[0].primitive, gaps == 5398 ? 7 : LSP_NONE);
  }
}

TEST(Coverage, ASolidSceneHasNothingOfIt) {
  Mesh mesh = sheet(0.9995f);  // less than half a step of eight bits is missing
  const BakedFile file(bake(mesh, options_of(Base::kBvh)));
  for (const LspTriangle& t : file.baked().triangles) EXPECT_EQ(t.flags, 0u);
  EXPECT_EQ(file.scene().header->version_minor, 0u);
  EXPECT_EQ(file.scene().header->required_features & LSP_FEATURE_COVERAGE, 0u);
  EXPECT_EQ(lsp_vulkan_parts(&file.scene()) & LSP_PART_COVERAGE, 0u);
  mesh.materials[1].opacity = 0.99f;
  const BakedFile partial(bake(mesh, options_of(Base::kBvh)));
  EXPECT_EQ(partial.scene().header->version_minor, 1u);
  EXPECT_NE(lsp_vulkan_parts(&partial.scene()) & LSP_PART_COVERAGE, 0u);
}

// ---- the cases, on every base and in every way ----

struct Kind {
  const char* name;
  Base base;
  Purpose purpose = Purpose::kAll;
  bool exact = true;
};
constexpr Kind kKinds[] = {
    {"bvh", Base::kBvh},
    {"ntree", Base::kNTree},
    {"cells", Base::kCells},
    {"bvh_ao", Base::kBvh, Purpose::kAo},
    {"cells_ao", Base::kCells, Purpose::kAo},
    {"bvh_visibility", Base::kBvh, Purpose::kVisibility},
    {"ntree_visibility", Base::kNTree, Purpose::kVisibility},
    {"bvh_approximate_only", Base::kBvh, Purpose::kAll, false},
    {"ntree_approximate_only", Base::kNTree, Purpose::kAll, false},
    {"cells_tables_only", Base::kCells, Purpose::kAll, false},
};

lsp::Baked bake_kind(const Mesh& mesh, const Kind& kind, std::vector<uint32_t> depths = {}) {
  BakeOptions options = options_of(kind.base, kind.purpose);
  options.line_space.exact = kind.exact;
  if (!depths.empty() && (kind.base == Base::kBvh || depths[0] == 0))
    options.line_space.depths = std::move(depths);
  lsp::Baked baked = bake(mesh, options);
  if (!kind.exact) kind.base == Base::kCells ? keep_tables_only(baked) : keep_approximate_only(baked);
  return baked;
}

class CoverageOf : public testing::TestWithParam<Kind> {
 protected:
  // Every way to trace `rays` on the CPU and, where there is a device, on Vulkan with the same bits.
  template <class Expect>
  void trace_all(const BakedFile& file, const std::vector<LspRay>& rays, Expect&& expect) {
    const bool vulkan = VulkanTracer::available(nullptr);
    std::optional<VulkanTracer> tracer;
    const bool exact = (file.scene().header->required_features & LSP_FEATURE_EXACT) != 0;
    if (vulkan) {
      tracer.emplace();
      tracer->load(file.scene(), LSP_USE_APPROXIMATE | (exact ? LSP_USE_EXACT : 0));
    }
    for (const lsp_trace_options& mode : modes_of(file.scene())) {
      SCOPED_TRACE(text_of(mode));
      const auto hits = trace(file.scene(), mode, rays);
      for (const LspHit& h : hits) ASSERT_EQ(h.flags & LSP_HIT_INCOMPLETE, 0u);
      expect(mode, hits);
      if (!vulkan) continue;
      std::vector<LspHit> gpu(rays.size());
      tracer->trace(mode, rays, gpu);
      EXPECT_TRUE(same_bits(hits, gpu));
    }
  }
};

TEST_P(CoverageOf, CasesPassTheirShare) {
  const struct {
    const char* file;
    double share;  // of rays that the card stops
  } cases[] = {{"alpha_mask_card.glb", 0.25}, {"alpha_blend_glass.glb", 0.1}};
  for (const auto& c : cases) {
    const fs::path path = fs::path(LSP_CASES_DIR) / c.file;
    if (!fs::exists(path)) GTEST_SKIP() << path << " is not there";
    Mesh mesh = import_meshes({&path, 1}, {});
    make_color_materials(mesh);
    const BakedFile file(bake_kind(mesh, GetParam(), {0}));
    // The same tables, made solid: what they miss of the card near its edges.
    lsp::Baked solid = bake_kind(mesh, GetParam(), {0});
    for (LspTriangle& t : solid.triangles) t.flags &= ~(LSP_TRIANGLE_MAX_GAPS << LSP_TRIANGLE_GAPS_SHIFT);
    set_counts(solid);
    EXPECT_NE(file.scene().header->required_features & LSP_FEATURE_COVERAGE, 0u);
    // Through all of the card, which is square and 4 wide, and not to the floor.
    std::vector<LspRay> rays;
    for (int i = 0; i < 200; ++i)
      for (int j = 0; j < 200; ++j)
        rays.push_back({{float(i) / 50 - 1.99f, 2, float(j) / 50 - 1.99f}, 0, {0, -1, 0}, 1.5f});
    trace_all(file, rays, [&](const lsp_trace_options& mode, const std::vector<LspHit>& hits) {
      const double all = hit_share(trace(view(solid), mode, rays));
      EXPECT_NEAR(hit_share(hits), c.share * all, bound(c.share, double(rays.size()))) << c.file;
      EXPECT_GT(all, GetParam().base == Base::kCells ? 0.9 : 0.9999);
    });
  }
}

// A ball on a floor under a canopy of leaves of many shares.
Mesh foliage() {
  Mesh mesh = sphere(16);
  add_triangle(mesh, {-3, -3, -1}, {3, -3, -1}, {3, 3, -1});
  add_triangle(mesh, {-3, -3, -1}, {3, 3, -1}, {-3, 3, -1});
  Random random(5);
  mesh.materials.resize(1);
  for (const float opacity : {0.1f, 0.3f, 0.5f, 0.8f, 1.0f}) {
    mesh.materials.emplace_back();
    mesh.materials.back().opacity = opacity;
  }
  for (uint32_t i = 0; i < 400; ++i) {
    const glm::vec3 at(random.between(-2.5f, 2.5f), random.between(-2.5f, 2.5f), random.between(1.2f, 3.0f));
    const auto side = [&] {
      return 0.4f * glm::vec3(random.between(-1, 1), random.between(-1, 1), random.between(-1, 1));
    };
    const glm::vec3 u = side(), v = side();
    if (glm::length(glm::cross(u, v)) < 0.01f) continue;
    add_triangle(mesh, at, at + u, at + u + v);
    add_triangle(mesh, at, at + u + v, at + v);
    mesh.material_ids.back() = mesh.material_ids[mesh.material_ids.size() - 2] = 1 + i % 5;
  }
  return mesh;
}

std::vector<LspRay> foliage_rays(const lsp::Baked& exact) {
  std::vector<LspRay> rays = surface_rays(exact, 12000, 1);
  const std::vector<LspRay> hard = hard_rays(exact.triangles, 2600, 3);
  rays.insert(rays.end(), hard.begin(), hard.end());
  return rays;
}

TEST_P(CoverageOf, FoliageAgrees) {
  const Mesh mesh = foliage();
  const lsp::Baked tree = bake(mesh, options_of(Base::kBvh));
  const std::vector<LspRay> rays = foliage_rays(tree);
  const auto truth = trace(view(tree), {0, 0}, rays);
  const BakedFile file(bake_kind(mesh, GetParam(), {4, 6}));
  trace_all(file, rays, [&](const lsp_trace_options& mode, const std::vector<LspHit>& hits) {
    size_t wrong = 0, other_t = 0;
    for (size_t i = 0; i < rays.size(); ++i) {
      wrong += (hits[i].primitive == LSP_NONE) != (truth[i].primitive == LSP_NONE);
      other_t += std::bit_cast<uint32_t>(hits[i].t) != std::bit_cast<uint32_t>(truth[i].t);
    }
    // Exact rays pass the same triangles whatever the base structure.
    if ((mode.flags & LSP_TRACE_APPROXIMATE) == 0) {
      EXPECT_EQ(wrong, 0u);
      if ((mode.flags & LSP_TRACE_ANY_HIT) == 0) {
        EXPECT_EQ(other_t, 0u);
      }
    }
  });
}

INSTANTIATE_TEST_SUITE_P(Of, CoverageOf, testing::ValuesIn(kKinds),
                         [](const auto& info) { return std::string(info.param.name); });

// Where a triangle with gaps answers, the ray is traced exactly: it errs by no more than in the same scene
// made solid, nor more to one side.
TEST(Coverage, ApproximateRaysErrNoMoreThanInASolidScene) {
  for (const Kind& kind : {kKinds[0], kKinds[1], kKinds[2]}) {
    double wrong[2], more[2];
    for (const bool solid : {true, false}) {
      Mesh mesh = foliage();
      if (solid)
        for (Material& m : mesh.materials) m.opacity = 1;
      const lsp::Baked baked = bake_kind(mesh, kind, {6});
      const std::vector<LspRay> rays = surface_rays(baked, 20000, 1);
      const auto truth = trace(view(baked), {0, 0}, rays);
      // At one dial: what balanced is, the bake finds for each scene by itself.
      const auto hits = trace(view(baked), {LSP_TRACE_APPROXIMATE | LSP_TRACE_MAX_LOSS, 0, 0, 5}, rays);
      size_t count = 0;
      for (size_t i = 0; i < rays.size(); ++i)
        count += (hits[i].primitive == LSP_NONE) != (truth[i].primitive == LSP_NONE);
      wrong[solid] = double(count) / double(rays.size());
      more[solid] = hit_share(hits) - hit_share(truth);
    }
    EXPECT_LE(wrong[0], wrong[1] + 0.005) << kind.name;
    EXPECT_LE(std::abs(more[0]), std::abs(more[1]) + 0.005) << kind.name;
    std::printf("%s: %.2f %% wrong, solid %.2f %%\n", kind.name, 100 * wrong[0], 100 * wrong[1]);
  }
}

}  // namespace
}  // namespace lsp::test
