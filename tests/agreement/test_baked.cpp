// CPU and Vulkan on files as the baker writes them: a room made here, and meshes from the scenes' folder.
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <filesystem>

#include "bake.h"
#include "hard_rays.h"
#include "import/import.h"
#include "lsp/lsp.h"
#include "lsp/lsp_vulkan.h"
#include "lsp/scene_file.hpp"
#include "lsp/vulkan_device.hpp"
#include "scene_builder.h"
#include "writer.h"

namespace lsp::test {
namespace {

namespace fs = std::filesystem;

// A box seen from inside with a bumpy ball in it.
Mesh make_room() {
  Mesh mesh;
  const auto add = [&](const glm::vec3& a, const glm::vec3& b, const glm::vec3& c,
                       const std::array<glm::vec3, 3>& n) {
    const auto first = static_cast<uint32_t>(mesh.positions.size());
    mesh.positions.insert(mesh.positions.end(), {a, b, c});
    mesh.triangles.emplace_back(first, first + 1, first + 2);
    mesh.primitives.push_back(static_cast<uint32_t>(mesh.primitive_count++));
    mesh.normals.push_back(n);
    mesh.material_ids.push_back(0);
  };
  const auto flat = [&](const glm::vec3& a, const glm::vec3& b, const glm::vec3& c, const glm::vec3& d) {
    const glm::vec3 n = glm::normalize(glm::cross(b - a, c - a));
    add(a, b, c, {n, n, n});
    add(a, c, d, {n, n, n});
  };
  for (int axis = 0; axis < 3; ++axis) {
    for (const float side : {-2.0f, 2.0f}) {
      const auto corner = [&](float u, float v) {
        glm::vec3 p;
        p[axis] = side;
        p[(axis + 1) % 3] = u;
        p[(axis + 2) % 3] = v;
        return p;
      };
      flat(corner(-2, -2), corner(2, -2), corner(2, 2), corner(-2, 2));
    }
  }
  constexpr int kRings = 60;
  const auto ball = [](int i, int j) {
    const float theta = 3.14159265f * static_cast<float>(i) / kRings;
    const float phi = 3.14159265f * static_cast<float>(j % (2 * kRings)) / kRings;
    const float r = 1.0f + 0.1f * std::sin(7 * theta) * std::cos(5 * phi);
    return glm::vec3(r * std::sin(theta) * std::cos(phi), r * std::sin(theta) * std::sin(phi),
                     r * std::cos(theta));
  };
  for (int i = 0; i < kRings; ++i) {
    for (int j = 0; j < 2 * kRings; ++j) {
      const glm::vec3 a = ball(i, j), b = ball(i + 1, j), c = ball(i + 1, j + 1), d = ball(i, j + 1);
      const auto n = [](const glm::vec3& p) { return glm::normalize(p); };
      if (i + 1 < kRings) add(a, b, c, {n(a), n(b), n(c)});
      if (i > 0) add(a, c, d, {n(a), n(c), n(d)});
    }
  }
  mesh.materials.emplace_back();
  return mesh;
}

// Rays as indirect light sends them: from points of the surfaces into all directions.
std::vector<LspRay> surface_rays(const lsp_scene& scene, uint32_t count) {
  Random random(21);
  const LspHeader& h = *scene.header;
  const float size = std::hypot(h.bounds_max.x - h.bounds_min.x, h.bounds_max.y - h.bounds_min.y);
  std::vector<LspRay> rays;
  for (uint32_t i = 0; i < count && h.triangle_count != 0; ++i) {
    const LspTriangle& t = scene.triangles[random.below(h.triangle_count)];
    const float u = random.uniform();
    const float v = random.uniform() * (1 - u);
    const auto at = [&](float a, float b, float c) { return a + (b - a) * u + (c - a) * v; };
    const lsp_float3 d{random.between(-1, 1), random.between(-1, 1), random.between(-1, 1)};
    const float up = 1e-4f * size;
    rays.push_back({{at(t.v0.x, t.v1.x, t.v2.x) + up * d.x, at(t.v0.y, t.v1.y, t.v2.y) + up * d.y,
                     at(t.v0.z, t.v1.z, t.v2.z) + up * d.z},
                    0,
                    d,
                    INFINITY});
  }
  return rays;
}

class Baked : public testing::TestWithParam<const char*> {
 protected:
  void SetUp() override {
    std::string why;
    if (!VulkanTracer::available(&why)) GTEST_SKIP() << why;
    path_ = (fs::temp_directory_path() / ("lsp_test_baked_" + std::to_string(getpid()) + ".lsp")).string();
  }
  void TearDown() override {
    if (!path_.empty()) fs::remove(path_);
  }

  void bake_and_compare(const Mesh& mesh, Base base, Purpose purpose, bool exact, uint32_t depth,
                        bool limits = false) {
    BakeOptions options;
    if (limits) {
      options.normal_angle_degrees = 10.0f;
      options.plane_tolerance = 0.1f;
    }
    options.base = base;
    options.ntree.branching = 5;
    options.purpose = purpose;
    if (purpose == Purpose::kVisibility) options.line_space.kind = LineSpaceKind::kBinary;
    options.line_space.resolution = 4;
    options.line_space.depths = {depth / 2, depth};
    lsp::Baked baked = bake(mesh, options);
    if (!exact) keep_approximate_only(baked);
    write_lsp(path_, baked, "{}", {});
    const SceneFile file(path_);
    // The shader is compiled with what the scene needs alone.
    EXPECT_EQ(lsp_vulkan_parts(&file.scene()),
              (purpose == Purpose::kVisibility ? LSP_PART_BINARY : 0u) |
                  (limits ? LSP_PART_NORMAL_ANGLE | LSP_PART_PLANE_TOLERANCE : 0u));
    std::vector<LspRay> rays = surface_rays(file.scene(), 20000);
    const std::vector<LspRay> hard =
        hard_rays({file.scene().triangles, file.scene().header->triangle_count}, 2600, 3);
    rays.insert(rays.end(), hard.begin(), hard.end());
    std::vector<LspHit> cpu(rays.size());
    std::vector<LspHit> gpu(rays.size());
    VulkanTracer tracer;
    tracer.load(file.scene(), LSP_USE_APPROXIMATE | (exact ? LSP_USE_EXACT : 0));
    constexpr uint32_t kApproximate = LSP_TRACE_APPROXIMATE;
    for (const uint32_t flags :
         {0u, LSP_TRACE_ANY_HIT, kApproximate, kApproximate | LSP_TRACE_ANY_HIT,
          kApproximate | LSP_TRACE_NEAR_APPROXIMATE, kApproximate | LSP_TRACE_NEAR_SKIP,
          kApproximate | LSP_TRACE_NEAR_SKIP | LSP_TRACE_ANY_HIT}) {
      if (!exact && (flags & kApproximate) == 0) continue;
      for (const float lod : {0.0f, 0.5f}) {
        SCOPED_TRACE("flags " + std::to_string(flags) + " lod " + std::to_string(lod));
        const lsp_trace_options trace{flags, lod};
        lsp_error error;
        ASSERT_EQ(lsp_trace(&file.scene(), &trace, rays.data(), cpu.data(), rays.size(), nullptr, &error),
                  LSP_OK)
            << error.message;
        tracer.trace(trace, rays, gpu);
        size_t different = 0;
        for (size_t i = 0; i < rays.size(); ++i)
          different += memcmp(&cpu[i], &gpu[i], sizeof(LspHit)) == 0 ? 0 : 1;
        EXPECT_EQ(different, 0u);
      }
    }
  }
  std::string path_;
};

TEST_P(Baked, Room) {
  const std::string what = GetParam();
  const bool ntree = what.starts_with("ntree_");
  const std::string purpose = ntree ? what.substr(6) : what;
  const Base base = ntree ? Base::kNTree : Base::kBvh;
  const uint32_t depth = ntree ? 2 : 6;
  const Mesh mesh = make_room();
  if (purpose == "all") bake_and_compare(mesh, base, Purpose::kAll, true, depth);
  if (purpose == "ao") bake_and_compare(mesh, base, Purpose::kAo, true, depth);
  if (purpose == "visibility") bake_and_compare(mesh, base, Purpose::kVisibility, true, depth);
  if (purpose == "limits") bake_and_compare(mesh, base, Purpose::kAll, true, depth, true);
  if (purpose == "approximate_only") bake_and_compare(mesh, base, Purpose::kAll, false, depth);
}
INSTANTIATE_TEST_SUITE_P(For, Baked,
                         testing::Values("all", "ao", "visibility", "approximate_only", "limits", "ntree_all",
                                         "ntree_visibility", "ntree_approximate_only", "ntree_limits"),
                         [](const auto& info) { return std::string(info.param); });

// Rays that are counted are traced one by one. Those of a group answer the same, however many there are, also
// where hits overwrite the rays.
TEST(Groups, AnswerAsOneRayAfterTheOther) {
  const Mesh mesh = make_room();
  for (const Base base : {Base::kBvh, Base::kNTree}) {
    BakeOptions options;
    options.base = base;
    options.ntree.branching = 5;
    options.line_space.resolution = 4;
    if (base == Base::kNTree) options.line_space.depths = {1, 2};
    const std::string path =
        (fs::temp_directory_path() / ("lsp_test_groups_" + std::to_string(getpid()) + ".lsp")).string();
    lsp::Baked baked = bake(mesh, options);
    write_lsp(path, baked, "{}", {});
    const SceneFile file(path);
    fs::remove(path);
    std::vector<LspRay> rays = surface_rays(file.scene(), 3000);
    const std::vector<LspRay> hard =
        hard_rays({file.scene().triangles, file.scene().header->triangle_count}, 2600, 3);
    rays.insert(rays.end(), hard.begin(), hard.end());
    for (uint32_t flags = 0; flags <= LSP_TRACE_ALL_FLAGS; ++flags) {
      SCOPED_TRACE(flags);
      const lsp_trace_options trace{flags, 0.3f};
      std::vector<LspHit> singly(rays.size());
      lsp_trace_counts counts{};
      ASSERT_EQ(lsp_trace(&file.scene(), &trace, rays.data(), singly.data(), rays.size(), &counts, nullptr),
                LSP_OK);
      EXPECT_GT(counts.hits, 1000u);
      for (size_t first = 0, size = 0; first < rays.size(); first += size, ++size) {
        size = std::min(size, rays.size() - first);
        std::vector<LspHit> grouped(size);
        ASSERT_EQ(lsp_trace(&file.scene(), &trace, &rays[first], grouped.data(), size, nullptr, nullptr),
                  LSP_OK);
        for (size_t i = 0; i < size; ++i)
          ASSERT_EQ(memcmp(&grouped[i], &singly[first + i], sizeof(LspHit)), 0) << "ray " << first + i;
      }
    }
  }
}

// Where nearly every node carries a Line Space, a ray that asks all those it begins in takes more steps than
// there are nodes and leaves.
TEST(Groups, NoRayRunsOutOfSteps) {
  for (const uint32_t triangles : {4u, 8u, 14u, 40u}) {
    BuildOptions build;
    build.triangles = triangles;
    build.leaf_triangles = 2;
    build.line_space_depth = 2;
    Parts parts = build_parts(build);
    const lsp_float3 lo = parts.header.bounds_min, hi = parts.header.bounds_max;
    for (LspNode& node : parts.nodes) {
      node.lo0 = node.lo1 = lo;
      node.hi0 = node.hi1 = hi;
    }
    for (LspLineSpace& ls : parts.line_spaces) {
      ls.lo = lo;
      ls.hi = hi;
      ls.scale = {4 / (hi.x - lo.x), 4 / (hi.y - lo.y), 4 / (hi.z - lo.z)};
    }
    const Bytes bytes = write_raw(parts);
    lsp_scene scene;
    lsp_error error;
    ASSERT_EQ(lsp_open(bytes.data(), bytes.size(), &scene, &error), LSP_OK) << error.message;
    const std::vector<LspRay> rays = surface_rays(scene, 20000);
    std::vector<LspHit> hits(rays.size());
    for (uint32_t flags = 0; flags <= LSP_TRACE_ALL_FLAGS; ++flags) {
      const lsp_trace_options trace{flags, 0};
      ASSERT_EQ(lsp_trace(&scene, &trace, rays.data(), hits.data(), rays.size(), nullptr, nullptr), LSP_OK);
      const auto incomplete = std::count_if(
          hits.begin(), hits.end(), [](const LspHit& h) { return (h.flags & LSP_HIT_INCOMPLETE) != 0; });
      EXPECT_EQ(incomplete, 0) << triangles << " triangles, flags " << flags;
    }
  }
}

using BakedScene = Baked;
TEST_P(BakedScene, Agrees) {
  const fs::path mesh = fs::path(LSP_SCENES_DIR) / GetParam();
  if (!fs::exists(mesh)) GTEST_SKIP() << mesh << " is not there";
  bake_and_compare(import_meshes(std::array{mesh}, {}), Base::kBvh, Purpose::kAll, true, 7);
}
INSTANTIATE_TEST_SUITE_P(Of, BakedScene, testing::Values("paper/bunny.ply", "paper/sibenik.obj"),
                         [](const auto& info) { return fs::path(info.param).stem().string(); });

}  // namespace
}  // namespace lsp::test
