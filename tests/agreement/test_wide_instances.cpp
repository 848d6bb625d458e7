// The tree of eight over instances, in every instruction set that runs here: no instance is left out that a
// ray may hit, and rays answer as through the binary tree, by which they go when work is counted.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <vector>

#include "bake.h"
#include "lsp/instances.hpp"
#include "meshes.h"
#include "scene_builder.h"
#include "trace_instances.h"

namespace lsp::test {
namespace {

// A small soup of triangles.
class Asset {
 public:
  explicit Asset(uint32_t seed) {
    BuildOptions options;
    options.seed = seed;
    options.triangles = 150;
    bytes_ = write_raw(build_parts(options));
    EXPECT_EQ(lsp_open(bytes_.data(), bytes_.size(), &scene, nullptr), LSP_OK);
  }
  lsp_scene scene;

 private:
  Bytes bytes_;
};

// Turned, sheared and stretched by up to `stretch` along an axis; around `centre`.
std::vector<lsp_instance> scatter(uint32_t count, float room, float stretch, float centre) {
  Random random(count);
  std::vector<lsp_instance> places;
  while (places.size() < count) {
    lsp_instance instance{random.below(2), {}, 1u << places.size() % 8, 0};
    float* t = instance.transform;
    for (int i = 0; i < 12; ++i)
      t[i] = i % 4 == 3 ? centre + random.between(-room, room) : random.between(-1, 1);
    for (int i = 0; i < 3; ++i) t[4 * i] *= stretch;
    const float determinant = t[0] * (t[5] * t[10] - t[6] * t[9]) - t[1] * (t[4] * t[10] - t[6] * t[8]) +
                              t[2] * (t[4] * t[9] - t[5] * t[8]);
    if (std::abs(determinant) > 0.1f * stretch) places.push_back(instance);
  }
  return places;
}

// Towards points of boxes, by one in two chances for each axis at a side (`at_sides`: 1) or never (0); some
// along axes, some short, some from far away.
std::vector<LspRay> rays_at(const lsp_instances& instances, uint32_t count, uint32_t at_sides) {
  Random random(7);
  std::vector<LspRay> rays;
  for (uint32_t i = 0; i < count; ++i) {
    const lsp_instance_record& target = instances.records[random.below(instances.count)];
    float to[3], d[3];
    for (int k = 0; k < 3; ++k) {
      to[k] = random.below(2) < at_sides ? target.lo[k] : random.between(target.lo[k], target.hi[k]);
      d[k] = i % 4 != 0 || int(i / 4 % 3) == k ? random.between(-4, 4) : 0.0f;
    }
    const float away = i % 7 == 0 ? 1000.0f : 1.0f;
    rays.push_back({{to[0] - away * d[0], to[1] - away * d[1], to[2] - away * d[2]},
                    0,
                    {d[0], d[1], d[2]},
                    i % 5 == 0 ? 0.9f : INFINITY});
  }
  return rays;
}

// Whether the ray enters the instance's box between tmin and tmax, in double, its margin times `share`.
bool enters(const InstanceWalk& walk, const lsp_instance_record& record, float tmax, double share) {
  double in = walk.ray.tmin, out = std::min(tmax * double{walk.ray.to_scaled}, 3.4e38);
  const double margin = share * record.growth * walk.ray.reach;
  for (int i = 0; i < 3; ++i) {
    const double from = (record.lo[i] - margin - walk.ray.origin[i]) * walk.ray.inverse[i];
    const double to = (record.hi[i] + margin - walk.ray.origin[i]) * walk.ray.inverse[i];
    in = std::max(in, std::min(from, to));
    out = std::min(out, std::max(from, to));
  }
  return in <= out;
}

void begin(InstanceWalk& walk, const lsp_instances& instances, const LspRay& ray) {
  walk.ray = walk.lsp_begin_instances(instances, ray);
  walk.lsp_instance_ref[0] = 0;
  walk.is_wide = true;
}

uint32_t next_of(const WideInstances& loop, const lsp_instances& instances, uint32_t mask, const LspRay& ray,
                 InstanceWalk& walk) {
  const uint32_t number = 0;
  uint32_t next = 0;
  loop.trace({instances, mask, &walk, &number, &ray.tmax, &next, 1});
  return next;
}

// How often the ray visits each instance that shares a bit with `mask`.
std::vector<uint32_t> visits_of(const WideInstances& loop, const lsp_instances& instances, uint32_t mask,
                                const LspRay& ray, InstanceWalk& walk) {
  std::vector<uint32_t> visits(instances.count);
  begin(walk, instances, ray);
  for (;;) {
    const uint32_t next = next_of(loop, instances, mask, ray, walk);
    if (next == LSP_NONE) return visits;
    ++visits.at(next);
  }
}

TEST(WideInstances, LeaveOutNothing) {
  const Asset one(3), two(5);
  const std::vector<std::vector<lsp_instance>> scenes = {
      scatter(2, 3, 1, 0), scatter(300, 20, 1, 0), scatter(300, 20, 1, 1e5f), scatter(300, 20, 1e4f, 0)};
  for (const std::vector<lsp_instance>& places : scenes) {
    const Instances instances({&one.scene, &two.scene}, places);
    for (const WideInstances* loop = kWideInstances; loop->name != nullptr; ++loop) {
      if (!loop->runs_here()) continue;
      size_t visited = 0, expected = 0;
      for (const LspRay& ray : rays_at(instances.view(), 400, 1)) {
        for (const uint32_t mask : {0xFFu, 0x7Eu}) {
          InstanceWalk walk;
          const std::vector<uint32_t> visits = visits_of(*loop, instances.view(), mask, ray, walk);
          for (uint32_t k = 0; k < instances.size(); ++k) {
            const lsp_instance_record& record = instances.view().records[k];
            const bool may = (record.instance.mask & mask) != 0 && enters(walk, record, ray.tmax, 1.5);
            const bool must = (record.instance.mask & mask) != 0 && enters(walk, record, ray.tmax, 0.75);
            ASSERT_LE(visits[k], may ? 1u : 0u) << loop->name << ", instance " << k;
            ASSERT_GE(visits[k], must ? 1u : 0u) << loop->name << ", instance " << k;
            visited += visits[k];
            expected += must ? 1 : 0;
          }
        }
      }
      EXPECT_GT(expected, 400u);
      EXPECT_LT(visited, expected + expected / 10);
    }
  }
}

// Closest hits bit for bit, occlusion as a yes or no.
void expect_answers_of_the_binary_tree(const lsp_instances& instances, uint32_t kind = 0) {
  const std::vector<LspRay> rays = rays_at(instances, 2000, 0);
  std::vector<LspHit> binary(rays.size()), wide(rays.size()), occluded(rays.size());
  const auto trace = [&](uint32_t flags, uint32_t mask, std::vector<LspHit>& hits, lsp_trace_counts* counts) {
    const lsp_trace_options options{kind | flags, 0};
    ASSERT_EQ(lsp_trace_instances(&instances, &options, mask, rays.data(), hits.data(), rays.size(), counts,
                                  nullptr),
              LSP_OK);
  };
  for (const uint32_t mask : {0xFFu, 0x7Eu}) {
    lsp_trace_counts counts{};
    trace(0, mask, binary, &counts);
    EXPECT_GT(counts.hits, rays.size() / 20);
    trace(0, mask, wide, nullptr);
    trace(LSP_TRACE_OCCLUSION, mask, occluded, nullptr);
    for (size_t i = 0; i < rays.size(); ++i) {
      ASSERT_EQ(memcmp(&wide[i], &binary[i], sizeof(LspHit)), 0) << i;
      ASSERT_EQ(std::isinf(occluded[i].t), std::isinf(binary[i].t)) << i;
    }
  }
}

TEST(WideInstances, AnswerAsTheBinaryTree) {
  const Asset one(3), two(5);
  for (const uint32_t count : {15u, 16u, 17u, 64u, 1000u}) {
    SCOPED_TRACE(count);
    const Instances instances({&one.scene, &two.scene}, scatter(count, 4, 1, 0));
    expect_answers_of_the_binary_tree(instances.view());
  }
}

TEST(WideInstances, AnswerAsTheBinaryTreeByTables) {
  BakeOptions options;
  options.base = Base::kCells;
  options.cells = 6;
  const lsp::Baked ball = bake(sphere(12), options), leaves = bake(soup(150, 0.5f), options);
  const lsp_scene one = view(ball), two = view(leaves);
  const Instances instances({&one, &two}, scatter(200, 4, 1, 0));
  expect_answers_of_the_binary_tree(instances.view(), LSP_TRACE_APPROXIMATE);
}

// More wait than a ray has room for, after some instances: it starts again by the binary tree.
TEST(WideInstances, WithoutRoomTheBinaryTreeAnswers) {
  const Asset one(3), two(5);
  const Instances instances({&one.scene, &two.scene}, scatter(40, 4, 1, 0));
  // Every box has all rays begin within. Below the root, whose instances come first, a chain.
  std::vector<lsp_instance_wide_node> chain(6);
  for (uint32_t i = 0; i < chain.size(); ++i) {
    for (int axis = 0; axis < 3; ++axis) {
      std::fill_n(chain[i].lo[axis], 8, -1e6f);
      std::fill_n(chain[i].hi[axis], 8, 1e6f);
    }
    std::fill_n(chain[i].growth, 8, 0.0f);
    for (uint32_t k = 0; k < 8; ++k) chain[i].child[k] = (i * 5 + k) | LSP_INSTANCE_BIT;
    if (i + 1 < chain.size()) chain[i].child[i == 0 ? 1 : 0] = i + 1;
  }
  lsp_instances crowded = instances.view();
  crowded.wide = chain.data();
  InstanceWalk walk;
  const LspRay ray = {{0, 0, 0}, 0, {1, 2, 3}, INFINITY};
  for (const WideInstances* loop = kWideInstances; loop->name != nullptr; ++loop) {
    if (!loop->runs_here()) continue;
    begin(walk, crowded, ray);
    for (uint32_t k = 0; k < 7; ++k) EXPECT_LT(next_of(*loop, crowded, 0xFF, ray, walk), 8u);
    EXPECT_EQ(next_of(*loop, crowded, 0xFF, ray, walk), kNoRoom);
  }
  expect_answers_of_the_binary_tree(crowded);
}

// As many wide nodes as there is room for, in the memory that is asked for and not beyond.
TEST(WideInstances, FitTheirMemory) {
  const Asset one(3), two(5);
  const lsp_scene* const assets[] = {&one.scene, &two.scene};
  for (uint32_t count = 1; count < 200; ++count) {
    const std::vector<lsp_instance> places = scatter(count, 5, 1, 0);
    const uint64_t bytes = lsp_instances_bytes(count);
    EXPECT_LE(bytes, 375u * count);
    std::vector<std::array<uint64_t, 2>> memory(bytes / 16 + 2, {~uint64_t{0}, ~uint64_t{0}});
    lsp_instances ready;
    ASSERT_EQ(lsp_instances_build(assets, 2, places.data(), count, memory.data(), bytes, &ready, nullptr),
              LSP_OK);
    const auto* end = reinterpret_cast<const uint8_t*>(memory.data());
    ASSERT_EQ(end[bytes], 0xFF);
    if (count < 2) continue;
    // Every instance is in one leaf.
    std::vector<uint32_t> waiting = {0}, found(count);
    uint32_t nodes = 0;
    while (!waiting.empty()) {
      const lsp_instance_wide_node& node = ready.wide[waiting.back()];
      waiting.pop_back();
      ++nodes;
      for (const uint32_t child : node.child) {
        if (child == LSP_NONE) continue;
        if ((child & LSP_INSTANCE_BIT) == 0)
          waiting.push_back(child);
        else
          ++found.at(child & ~LSP_INSTANCE_BIT);
      }
    }
    EXPECT_LE(nodes, 4 * count / 7);
    for (const uint32_t times : found) ASSERT_EQ(times, 1u);
  }
}

}  // namespace
}  // namespace lsp::test
