// The shader of instances gives the bits of lsp_trace_instances: assets of cells and of wide nodes alone at
// once, mirrored, stretched and sheared, every kind of ray, and where the device ends loops early.
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cstring>
#include <filesystem>
#include <iostream>
#include <memory>

#include "bake.h"
#include "hard_rays.h"
#include "instance_shaders.h"
#include "lsp/instances.hpp"
#include "lsp/program.h"
#include "lsp/scene_file.hpp"
#include "lsp/vulkan_device.hpp"
#include "meshes.h"
#include "writer.h"

// Vulkan drivers and the loader leave memory behind.
extern "C" const char* __lsan_default_options() { return "detect_leaks=0"; }

namespace lsp::test {
namespace {

namespace fs = std::filesystem;

// A file of a bake, opened, and forgotten with it. cells: along its longest side; 0: wide nodes alone.
std::unique_ptr<SceneFile> bake_file(const Mesh& mesh, uint32_t cells) {
  BakeOptions options;
  options.base = cells == 0 ? Base::kWide : Base::kCells;
  options.cells = cells;
  options.cell_tables.far_samples = 16;
  options.cell_tables.origin_samples = 16;
  lsp::Baked baked = bake(mesh, options);
  const std::string path =
      (fs::temp_directory_path() / ("lsp_test_instance_shader_" + std::to_string(getpid()) + ".lsp"))
          .string();
  write_lsp(path, baked, "{}", {.alignment = 4096});  // or it cannot be imported
  auto file = std::make_unique<SceneFile>(path);
  fs::remove(path);
  return file;
}

// A ball behind a sheet of which three tenths are there.
Mesh ball_and_sheet() {
  Mesh mesh = sphere(10);
  mesh.materials.resize(2);
  mesh.materials[1].opacity = 0.3f;
  add_triangle(mesh, {-2, -2, 1.2f}, {2, -2, 1.2f}, {2, 2, 1.2f});
  mesh.material_ids.back() = 1;
  return mesh;
}

// The assets, made once.
struct Assets {
  std::unique_ptr<SceneFile> ball = bake_file(sphere(12), 6);
  std::unique_ptr<SceneFile> soup = bake_file(test::soup(150, 0.5f), 0);
  std::unique_ptr<SceneFile> sheet = bake_file(ball_and_sheet(), 4);
  SceneFile tables{LSP_CORPUS_DIR "/cells-tables.lsp"};
};
const Assets& assets() {
  static const Assets made;
  return made;
}

lsp_instance anywhere(Random& random, uint32_t asset, float place) {
  for (;;) {
    lsp_instance instance{asset, {}, 255, 0};
    float* t = instance.transform;
    for (int i = 0; i < 12; ++i) t[i] = i % 4 == 3 ? random.between(-place, place) : random.between(-1, 1);
    const float determinant = t[0] * (t[5] * t[10] - t[6] * t[9]) - t[1] * (t[4] * t[10] - t[6] * t[8]) +
                              t[2] * (t[4] * t[9] - t[5] * t[8]);
    if (std::abs(determinant) > 0.1f) return instance;
  }
}

// So many of each asset in turn, each with one bit of a mask.
std::vector<lsp_instance> places_of(uint32_t asset_count, uint32_t count, uint64_t seed) {
  Random random(seed);
  std::vector<lsp_instance> places;
  for (uint32_t i = 0; i < count; ++i) {
    places.push_back(anywhere(random, i % asset_count, 2));
    places.back().mask = 1u << i % 8;
  }
  return places;
}

class InstanceShader : public testing::Test {
 protected:
  void SetUp() override {
    std::string why;
    if (!VulkanTracer::available(&why)) GTEST_SKIP() << why;
    rays_ = hard_rays({triangles_of(assets().ball->scene())}, 2000, 5, 2);
  }

  static std::span<const LspTriangle> triangles_of(const lsp_scene& scene) {
    return {scene.triangles, scene.header->triangle_count};
  }

  // Hits are the CPU's to the last bit, of occlusion whether there is one, and where; and counts, if asked
  // for. lavapipe takes seconds to compile a shader: each further kind of ray and count is one.
  VulkanTrace expect_same_bits(VulkanTracer& tracer, const Instances& instances,
                               const lsp_trace_options& options, uint32_t mask = 0xFF, bool count = false) {
    SCOPED_TRACE("flags " + std::to_string(options.flags) + " mask " + std::to_string(mask) + " quality " +
                 std::to_string(options.quality) + " loss " + std::to_string(options.max_loss));
    std::vector<LspHit> expected(rays_.size()), hits(rays_.size());
    lsp_trace_counts counts{};
    instances.trace(options, mask, rays_, expected, &counts);
    EXPECT_GT(counts.hits, rays_.size() / 20);
    const VulkanTrace traced = tracer.trace_instances(instances.view(), options, mask, rays_, hits, count);
    if (count) {
      EXPECT_EQ(memcmp(&traced.counts, &counts, sizeof counts), 0);
    }
    for (size_t i = 0; i < rays_.size() && !HasFailure(); ++i) {
      if ((options.flags & LSP_TRACE_OCCLUSION) != 0) {
        EXPECT_EQ(hits[i].t, expected[i].t) << i;
      } else {
        EXPECT_EQ(memcmp(&hits[i], &expected[i], sizeof(LspHit)), 0) << i;
      }
    }
    return traced;
  }

  std::vector<LspRay> rays_;
};

constexpr uint32_t kApproximate = LSP_TRACE_APPROXIMATE;

TEST_F(InstanceShader, EveryKindOfRay) {
  const std::vector<const lsp_scene*> scenes = {&assets().ball->scene(), &assets().soup->scene(),
                                                &assets().sheet->scene()};
  std::vector<lsp_instance> places = places_of(3, 40, 37);
  places.push_back(places[3]);  // two of different assets in one place
  places.back().asset = 1;
  Instances instances(scenes, places);
  VulkanTracer tracer;
  tracer.load(scenes, LSP_USE_EXACT | LSP_USE_APPROXIMATE);
  std::vector<lsp_trace_options> all;
  for (const uint32_t flags : {0u, kApproximate})
    for (const uint32_t query : {0u, LSP_TRACE_ANY_HIT, LSP_TRACE_OCCLUSION})
      all.push_back({flags | query, 0, LSP_QUALITY_BALANCED, 0});
  all.push_back({kApproximate, 0, LSP_QUALITY_FAST, 0});
  all.push_back({kApproximate | LSP_TRACE_MAX_LOSS, 0, 0, 0});
  for (const lsp_trace_options& options : all) expect_same_bits(tracer, instances, options);
  for (const uint32_t flags : {0u, kApproximate}) expect_same_bits(tracer, instances, {flags, 0}, 0xFF, true);
  for (const uint32_t flags : {0u, kApproximate})
    for (const uint32_t mask : {0x3Bu, 0x104u}) expect_same_bits(tracer, instances, {flags, 0}, mask);

  // Elsewhere, and of others of them.
  places = places_of(2, 70, 41);
  instances.build(places);
  expect_same_bits(tracer, instances, {0, 0});
  expect_same_bits(tracer, instances, {kApproximate, 0});
}

// Each asset in buffers of its own, by their addresses: where that is asked for, and of imported files.
TEST_F(InstanceShader, ThroughAddresses) {
  const std::vector<const lsp_scene*> scenes = {&assets().ball->scene(), &assets().soup->scene()};
  const Instances instances(scenes, places_of(2, 40, 37));
  VulkanOptions options;
  options.addresses = true;
  VulkanTracer tracer(options);
  for (const LoadPath path : {LoadPath::kUpload, LoadPath::kImport}) {
    try {
      tracer.load(scenes, LSP_USE_EXACT | LSP_USE_APPROXIMATE, path);
    } catch (const Failure& failure) {
      ASSERT_EQ(path, LoadPath::kImport) << failure.what();
      std::cout << "not imported: " << failure.what() << "\n";
      continue;
    }
    EXPECT_EQ(tracer.load_path(), path);
    for (const uint32_t flags : {0u, kApproximate}) expect_same_bits(tracer, instances, {flags, 0});
  }
}

// Where no asset has tables approximate rays are exact, and what is loaded for them will do for both; where
// one has nothing but tables all rays are approximate.
TEST_F(InstanceShader, OneKindOfAsset) {
  for (const lsp_scene* scene : {&assets().soup->scene(), &assets().tables.scene()}) {
    const Instances instances({scene}, places_of(1, 30, 43));
    VulkanTracer tracer;
    tracer.load(std::vector{scene}, LSP_USE_APPROXIMATE);
    rays_ = hard_rays(triangles_of(*scene), 1000, 9, 2);
    expect_same_bits(tracer, instances, {kApproximate, 0});
    if (scene == &assets().soup->scene()) {
      expect_same_bits(tracer, instances, {0, 0});
      continue;
    }
    const lsp_trace_options exact{};
    std::vector<LspHit> hits(rays_.size());
    EXPECT_THROW(tracer.trace_instances(instances.view(), exact, 0xFF, rays_, hits), Failure);
  }
}

// Where tables alone are loaded their dial is that of tables alone, whatever is asked for: what cells need
// besides is not there.
TEST_F(InstanceShader, TablesAlone) {
  const std::vector<const lsp_scene*> scenes = {&assets().ball->scene(), &assets().sheet->scene()};
  const Instances instances(scenes, places_of(2, 30, 47));
  VulkanTracer tracer;
  tracer.load(scenes, LSP_USE_TABLES);
  std::vector<LspHit> expected(rays_.size()), hits(rays_.size());
  instances.trace({kApproximate, 0, LSP_QUALITY_FAST, 0}, 0xFF, rays_, expected);
  tracer.trace_instances(instances.view(), {kApproximate, 0, LSP_QUALITY_ACCURATE, 0}, 0xFF, rays_, hits);
  EXPECT_EQ(memcmp(hits.data(), expected.data(), hits.size() * sizeof(LspHit)), 0);
  try {
    tracer.trace_instances(instances.view(), {0, 0}, 0xFF, rays_, hits);
    ADD_FAILURE() << "there is no tree for exact rays";
  } catch (const Failure& failure) {
    EXPECT_EQ(failure.exit(), Exit::kUnsupported);
    EXPECT_STREQ(failure.what(), "asset 0: is not loaded for exact rays; load it for LSP_USE_EXACT");
  }
}

// Several scenes in one dispatch that nothing places: each ray has the bits of lsp_trace of its own scene.
TEST_F(InstanceShader, AssetsAlone) {
  const std::vector<const lsp_scene*> scenes = {&assets().ball->scene(), &assets().soup->scene(),
                                                &assets().sheet->scene()};
  for (const uint32_t flags : {0u, kApproximate}) {
    const lsp_trace_options options{flags, 0, LSP_QUALITY_FAST, 0};
    std::vector<LspHit> hits;
    try {
      hits = hits_in_assets(scenes, options, rays_);
    } catch (const Failure& failure) {
      if (failure.exit() != Exit::kUnsupported) throw;
      GTEST_SKIP() << failure.what();
    }
    size_t of_tables = 0, of_triangles = 0;
    for (size_t i = 0; i < rays_.size() && !HasFailure(); ++i) {
      LspHit expected;
      ASSERT_EQ(lsp_trace(scenes[i % scenes.size()], &options, &rays_[i], &expected, 1, nullptr, nullptr),
                LSP_OK);
      EXPECT_EQ(memcmp(&hits[i], &expected, sizeof(LspHit)), 0) << i;
      if (expected.primitive != LSP_NONE)
        ++((expected.flags & LSP_HIT_LINE_SPACE) != 0 ? of_tables : of_triangles);
    }
    EXPECT_GT(flags == kApproximate ? of_tables : of_triangles, 50u);
    EXPECT_EQ(of_tables > 0, flags == kApproximate);
  }
}

// How far off a hit a bounce begins: of every instance, of hits on triangles and on tables, and of misses.
TEST_F(InstanceShader, OffsetsOfHits) {
  const std::vector<const lsp_scene*> scenes = {&assets().ball->scene(), &assets().soup->scene()};
  std::vector<lsp_instance> places = places_of(2, 30, 53);
  for (size_t i = 0; i < places.size(); ++i)
    for (float& t : places[i].transform) t *= 1 + static_cast<float>(i);
  const Instances instances(scenes, places);
  std::vector<LspHit> hits;
  for (const uint32_t flags : {0u, kApproximate}) {
    std::vector<LspHit> found(rays_.size());
    instances.trace({flags, 0, LSP_QUALITY_FAST, 0}, 0xFF, rays_, found);
    hits.insert(hits.end(), found.begin(), found.end());
  }
  std::vector<float> offsets;
  try {
    offsets = offsets_on_device(instances, hits);
  } catch (const Failure& failure) {
    if (failure.exit() != Exit::kUnsupported) throw;
    GTEST_SKIP() << failure.what();
  }
  size_t misses = 0, of_tables = 0, of_triangles = 0;
  for (size_t i = 0; i < hits.size() && !HasFailure(); ++i) {
    const float expected = lsp_instance_hit_offset(&instances.view(), &hits[i]);
    EXPECT_NEAR(offsets[i], expected, 1e-6f * expected) << i;
    ++(expected == 0 ? misses : (hits[i].flags & LSP_HIT_LINE_SPACE) != 0 ? of_tables : of_triangles);
  }
  EXPECT_GT(std::min({misses, of_tables, of_triangles}), 50u);
}

// Thousands in one place: a vector of rays runs out of lavapipe's budget of loops, which must not go unseen.
TEST_F(InstanceShader, LoopsThatTheDeviceEndsAreTracedAgain) {
  const lsp_scene& scene = assets().soup->scene();
  Random random(3);
  std::vector<lsp_instance> places;
  for (uint32_t i = 0; i < 6000; ++i) places.push_back(anywhere(random, 0, 0));
  const Instances instances({&scene}, places);
  VulkanTracer tracer;
  tracer.load(std::vector{&scene}, LSP_USE_EXACT);
  rays_ = hard_rays(triangles_of(scene), 64, 5, 2);
  const uint64_t retraced = expect_same_bits(tracer, instances, {0, 0}).retraced;
  if (tracer.device_name().find("llvmpipe") != std::string::npos) {
    EXPECT_GT(retraced, 0u);
  }
}

// An asset is on the device once, however many instances it has; what cannot be loaded is named.
TEST_F(InstanceShader, AssetsAreLoadedOnce) {
  const lsp_scene &ball = assets().ball->scene(), &soup = assets().soup->scene();
  VulkanTracer tracer;
  const auto uploaded = [&](const std::vector<const lsp_scene*>& scenes) {
    tracer.load(scenes, LSP_USE_EXACT, LoadPath::kUpload);
    EXPECT_EQ(tracer.load_path(), LoadPath::kUpload);
    EXPECT_EQ(tracer.load_note(), "");
    return tracer.bytes_uploaded();
  };
  const uint64_t bytes = uploaded({&ball});
  EXPECT_GT(bytes, sizeof(LspHeader));
  EXPECT_EQ(uploaded({&ball, &soup}), bytes + uploaded({&soup}));

  const auto expect_refused = [&](const lsp_scene& scene, uint32_t uses, const char* words) {
    try {
      tracer.load(std::vector{&ball, &scene}, uses);
      ADD_FAILURE() << "asset 1 cannot be traced";
    } catch (const Failure& failure) {
      EXPECT_EQ(failure.exit(), Exit::kUnsupported);
      EXPECT_EQ(std::string(failure.what()).rfind("asset 1: ", 0), 0u) << failure.what();
      EXPECT_NE(std::string(failure.what()).find(words), std::string::npos) << failure.what();
    }
    EXPECT_EQ(tracer.scene_count(), 0u);
  };
  expect_refused(assets().tables.scene(), LSP_USE_EXACT, "no exact tree");
  const SceneFile bvh(LSP_CORPUS_DIR "/full.lsp"), ntree(LSP_CORPUS_DIR "/ntree.lsp"),
      old(LSP_CORPUS_DIR "/cells.lsp");
  expect_refused(bvh.scene(), LSP_USE_APPROXIMATE, "BVH; bake it with --base cells");
  expect_refused(ntree.scene(), LSP_USE_EXACT, "NTree");
  expect_refused(old.scene(), LSP_USE_EXACT | LSP_USE_APPROXIMATE, "BVH");

  // None at all, and others than those that were loaded.
  const LspRay ray = {{0, 0, -9}, 0, {0, 0, 1}, 100};
  LspHit hit{};
  tracer.load(std::vector<const lsp_scene*>{}, LSP_USE_EXACT);
  tracer.trace_instances(Instances().view(), {}, 0xFF, {&ray, 1}, {&hit, 1});
  EXPECT_EQ(hit.primitive, LSP_NONE);
  const Instances others({&ball}, places_of(1, 1, 3));
  EXPECT_THROW(tracer.trace_instances(others.view(), {}, 0xFF, {&ray, 1}, {&hit, 1}), Failure);
}

// Assets lie in the pool one behind the other, as far as a storage buffer goes; all are read in one way.
TEST(InstancePlan, PlacesAndTheirLimit) {
  const std::vector<const lsp_scene*> scenes = {&assets().ball->scene(), &assets().soup->scene()};
  lsp_vulkan_limits limits{1u << 27, 0, 65535, 0};
  lsp_error error;
  std::vector<lsp_vulkan_plan> plans(2);
  VkDeviceAddress places[2][LSP_VULKAN_MAX_BUFFERS];
  uint64_t bytes = 0, end = 0;
  for (size_t i = 0; i < 2; ++i) {
    ASSERT_EQ(lsp_vulkan_plan_buffers(scenes[i], LSP_USE_EXACT, &limits, &plans[i], &error), LSP_OK);
    ASSERT_EQ(lsp_vulkan_place_buffers(&plans[i], &limits, &bytes, places[i], &error), LSP_OK);
    for (uint32_t k = 0; k < plans[i].buffer_count; ++k) {
      EXPECT_EQ(places[i][k] % 256, 0u);
      EXPECT_GE(places[i][k], end);
      end = places[i][k] + plans[i].buffers[k].bytes;
    }
    EXPECT_EQ(bytes, end);
  }
  limits.max_storage_buffer_range = bytes - 1;
  uint64_t first = places[1][0];
  EXPECT_EQ(lsp_vulkan_place_buffers(&plans[1], &limits, &first, places[1], &error), LSP_ERROR_LIMIT);
  EXPECT_EQ(first, places[1][0]);
  EXPECT_NE(std::string(error.message).find("maxStorageBufferRange"), std::string::npos) << error.message;

  const uint32_t by_addresses = LSP_USE_EXACT | LSP_USE_ADDRESSES_ALWAYS;
  ASSERT_EQ(lsp_vulkan_plan_buffers(scenes[1], by_addresses, &limits, &plans[1], &error), LSP_OK);
  const lsp_trace_options exact{};
  lsp_vulkan_kind kind;
  EXPECT_EQ(lsp_vulkan_plan_instances(scenes.data(), plans.data(), 2, &exact, &kind, &error),
            LSP_ERROR_UNSUPPORTED);
  EXPECT_EQ(std::string(error.message).rfind("asset 1 is planned with addresses", 0), 0u) << error.message;
}

// All assets together, or a section of one: the tracer reads through addresses then.
TEST_F(InstanceShader, WhatNoStorageBufferHoldsIsReadThroughAddresses) {
  const std::vector<const lsp_scene*> scenes = {&assets().ball->scene(), &assets().soup->scene()};
  const Instances instances(scenes, places_of(2, 12, 11));
  lsp_vulkan_limits limits{1u << 27, 0, 65535, 0};
  uint64_t bytes = 0, largest = 0;
  for (const lsp_scene* scene : scenes) {
    lsp_vulkan_plan plan;
    VkDeviceAddress places[LSP_VULKAN_MAX_BUFFERS];
    ASSERT_EQ(lsp_vulkan_plan_buffers(scene, LSP_USE_EXACT, &limits, &plan, nullptr), LSP_OK);
    ASSERT_EQ(lsp_vulkan_place_buffers(&plan, &limits, &bytes, places, nullptr), LSP_OK);
    for (uint32_t i = 0; i < plan.buffer_count; ++i) largest = std::max(largest, plan.buffers[i].bytes);
  }
  ASSERT_GT(largest, lsp_instances_bytes(12));
  for (const uint64_t range : {bytes - 1, largest - 1}) {
    SCOPED_TRACE(range);
    VulkanOptions options;
    options.max_storage_buffer_range = static_cast<uint32_t>(range);
    VulkanTracer tracer(options);
    tracer.load(scenes, LSP_USE_EXACT, LoadPath::kUpload);
    expect_same_bits(tracer, instances, {});
  }
}

TEST_F(InstanceShader, ValidationHasNothingToSay) {
  VulkanOptions options;
  options.validation = true;
  std::unique_ptr<VulkanTracer> tracer;
  try {
    tracer = std::make_unique<VulkanTracer>(options);
  } catch (const Failure& failure) {
    std::cout << "not validated: " << failure.what() << "\n";  // skipped, it would hide the others' failures
    return;
  }
  const std::vector<const lsp_scene*> scenes = {&assets().ball->scene(), &assets().soup->scene()};
  const Instances instances(scenes, places_of(2, 12, 7));
  std::vector<LspHit> hits(rays_.size());
  for (const LoadPath path : {LoadPath::kAutomatic, LoadPath::kUpload}) {
    tracer->load(scenes, LSP_USE_EXACT, path);
    tracer->trace_instances(instances.view(), {0, 0}, 0xFF, rays_, hits);
  }
  for (const std::string& message : tracer->validation_messages()) ADD_FAILURE() << message;
}

}  // namespace
}  // namespace lsp::test
