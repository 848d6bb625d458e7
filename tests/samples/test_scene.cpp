// The sample scenes as wholes: their size, their bytes, their file form.
#include "scene.h"

#include <gtest/gtest.h>

#include <cstring>
#include <nlohmann/json.hpp>

#include "lsp/program.h"

namespace lsp::sample {
namespace {

TEST(SampleScene, AtriumStaysInItsBudget) {
  const uint64_t count = triangle_count(make_atrium({}));
  EXPECT_GE(count, 100'000u);
  EXPECT_LE(count, 300'000u);
}

TEST(SampleScene, SameBytesTwice) {
  for (const char* name : {"atrium", "grove", "spheres", "plane", "objects", "stadium"}) {
    EXPECT_EQ(to_glb(make_scene(name, {0.4f})), to_glb(make_scene(name, {0.4f}))) << name;
  }
}

// A room and 512 things of five kinds, some mirrored; a teapot far smaller than where it stands.
TEST(SampleScene, WhatInstancesAreFor) {
  const Scene objects = make_objects({0.3f}), stadium = make_stadium({});
  EXPECT_EQ(objects.meshes.size(), 6u);
  EXPECT_EQ(objects.nodes.size(), 513u);
  size_t mirrored = 0;
  for (const Node& node : objects.nodes) mirrored += node.scale.x < 0;
  EXPECT_GT(mirrored, 60u);
  EXPECT_LT(mirrored, 150u);
  const auto extent = [&](size_t mesh) {
    glm::vec3 hi(-1e30f);
    for (const glm::vec3& p : stadium.meshes[mesh].parts[0].surface.positions) hi = glm::max(hi, p);
    return hi;
  };
  ASSERT_EQ(stadium.meshes.size(), 2u);
  EXPECT_GT(extent(0).x, 50.0f);
  EXPECT_NEAR(extent(1).y, 0.3f, 1e-4f);
}

TEST(SampleScene, TessellationMeetsTheWish) {
  for (const uint64_t wish : {3'000u, 30'000u, 200'000u}) {
    for (const char* name : {"grove", "spheres", "plane", "stadium"}) {
      const double have = static_cast<double>(triangle_count(make_scene(name, detail_for(name, wish))));
      EXPECT_NEAR(have / static_cast<double>(wish), 1.0, 0.25) << name << " of " << wish;
    }
  }
  const double have = static_cast<double>(triangle_count(make_atrium(detail_for("atrium", 500'000))));
  EXPECT_NEAR(have / 500'000.0, 1.0, 0.05);
}

TEST(SampleScene, ImpossibleWishIsRefused) {
  EXPECT_THROW(detail_for("atrium", 1'000), Failure);
  EXPECT_THROW(make_scene("cathedral", {}), Failure);
}

TEST(SampleScene, GlbFrameAndAccessorsAreRight) {
  const Scene scene = make_atrium({0.3f});
  const std::string bytes = to_glb(scene);
  const auto word = [&](size_t at) {
    uint32_t value = 0;
    std::memcpy(&value, bytes.data() + at, sizeof value);
    return value;
  };
  ASSERT_EQ(word(0), 0x46546C67u);
  EXPECT_EQ(word(8), bytes.size());
  const uint32_t json_bytes = word(12);
  const nlohmann::json json = nlohmann::json::parse(bytes.substr(20, json_bytes));
  const uint32_t binary_bytes = word(20 + json_bytes);
  EXPECT_EQ(20 + json_bytes + 8 + binary_bytes, bytes.size());

  for (const auto& view : json["bufferViews"]) {
    EXPECT_EQ(view["byteOffset"].get<uint64_t>() % 4, 0u);
    EXPECT_LE(view["byteOffset"].get<uint64_t>() + view["byteLength"].get<uint64_t>(), binary_bytes);
  }
  uint64_t triangles = 0;
  for (const auto& node : json["nodes"]) {
    if (!node.contains("mesh")) continue;
    for (const auto& primitive : json["meshes"][node["mesh"].get<size_t>()]["primitives"]) {
      triangles += json["accessors"][primitive["indices"].get<size_t>()]["count"].get<uint64_t>() / 3;
      EXPECT_LT(primitive["material"].get<size_t>(), json["materials"].size());
    }
  }
  EXPECT_EQ(triangles, triangle_count(scene));
  EXPECT_EQ(json["extensionsUsed"][0], "KHR_materials_emissive_strength");
}

}  // namespace
}  // namespace lsp::sample
