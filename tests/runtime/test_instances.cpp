// Instances: against every moved triangle tested in double, against lsp_trace where nothing is moved, and
// what is refused.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <string>

#include "lsp/instances.hpp"
#include "lsp/scene_file.hpp"
#include "scene_builder.h"

namespace lsp::test {
namespace {

using Vector = std::array<double, 3>;

Vector of(const lsp_float3& v) { return {v.x, v.y, v.z}; }
Vector operator-(const Vector& a, const Vector& b) { return {a[0] - b[0], a[1] - b[1], a[2] - b[2]}; }
double dot(const Vector& a, const Vector& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
Vector cross(const Vector& a, const Vector& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

Vector move_point(const lsp_instance& instance, const lsp_float3& p) {
  const float* t = instance.transform;
  Vector moved;
  for (size_t i = 0; i < 3; ++i)
    moved[i] =
        double{t[4 * i]} * p.x + double{t[4 * i + 1]} * p.y + double{t[4 * i + 2]} * p.z + t[4 * i + 3];
  return moved;
}

// A soup of triangles and the scene over it.
struct Asset {
  explicit Asset(const BuildOptions& options = {}) : parts(build_parts(options)), bytes(write_raw(parts)) {
    EXPECT_EQ(lsp_open(bytes.data(), bytes.size(), &scene, nullptr), LSP_OK);
  }
  const LspTriangle& triangle(uint32_t primitive) const {
    for (const LspTriangle& t : parts.triangles)
      if (t.primitive == primitive) return t;
    return parts.triangles.at(parts.triangles.size());
  }
  Parts parts;
  Bytes bytes;
  lsp_scene scene;
};

lsp_instance at(uint32_t asset, std::array<float, 12> transform, uint32_t mask = 255) {
  lsp_instance instance{asset, {}, mask, 0};
  std::copy(transform.begin(), transform.end(), instance.transform);
  return instance;
}
lsp_instance identity(uint32_t asset = 0) { return at(asset, {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0}); }

// Any matrix whose inverse is not too large: rotated, mirrored, scaled by axis, sheared.
lsp_instance anywhere(Random& random, uint32_t asset, float place) {
  for (;;) {
    std::array<float, 12> t;
    for (size_t i = 0; i < 12; ++i) t[i] = i % 4 == 3 ? random.between(-place, place) : random.between(-1, 1);
    const Vector x{t[0], t[4], t[8]}, y{t[1], t[5], t[9]}, z{t[2], t[6], t[10]};
    if (std::abs(dot(x, cross(y, z))) > 0.1) return at(asset, t);
  }
}

std::vector<LspRay> rays_about(const lsp_instances& instances, uint32_t count, uint64_t seed) {
  Random random(seed);
  std::vector<LspRay> rays;
  for (uint32_t i = 0; i < count; ++i) {
    const lsp_instance_record& target = instances.records[random.below(instances.count)];
    const auto within = [&](int axis) { return random.between(target.lo[axis], target.hi[axis]); };
    const lsp_float3 to = {within(0), within(1), within(2)};
    lsp_float3 d = {random.between(-4, 4), random.between(-4, 4), random.between(-4, 4)};
    const lsp_float3 from = {to.x - d.x, to.y - d.y, to.z - d.z};
    const float length = std::ldexp(1.0f, int(random.below(9)) - 4);
    d = {d.x * length, d.y * length, d.z * length};
    rays.push_back({from, 0, d, i % 5 == 0 ? 1.5f / length : INFINITY});
  }
  return rays;
}

// Where a ray meets a moved triangle, and by how much it passes its inside, in shares of it; both in double.
struct Meeting {
  double t, inside;
};
Meeting meet(const LspRay& ray, const lsp_instance& instance, const LspTriangle& triangle) {
  const Vector a = move_point(instance, triangle.v0), e1 = move_point(instance, triangle.v1) - a,
               e2 = move_point(instance, triangle.v2) - a, d = of(ray.direction), s = of(ray.origin) - a;
  const Vector p = cross(d, e2), q = cross(s, e1);
  const double det = dot(e1, p), u = dot(s, p) / det, v = dot(d, q) / det;
  return {dot(e2, q) / det, std::min({u, v, 1 - u - v})};
}

// Every answer is a triangle's that the ray meets there, and none is nearer that it surely meets.
void expect_closest(const std::vector<const Asset*>& assets, const Instances& instances,
                    const std::vector<LspRay>& rays, const std::vector<LspHit>& hits) {
  constexpr double kSure = 1e-3;
  size_t found = 0;
  for (size_t i = 0; i < rays.size(); ++i) {
    SCOPED_TRACE(i);
    double nearest = INFINITY;
    for (uint32_t k = 0; k < instances.size(); ++k)
      for (const LspTriangle& triangle : assets[instances[k].asset]->parts.triangles) {
        const Meeting m = meet(rays[i], instances[k], triangle);
        if (m.inside > kSure && m.t > rays[i].tmin && m.t < rays[i].tmax) nearest = std::min(nearest, m.t);
      }
    const double length = std::sqrt(dot(of(rays[i].direction), of(rays[i].direction)));
    if (std::isinf(hits[i].t)) {
      ASSERT_EQ(hits[i].primitive, LSP_NONE);
      ASSERT_EQ(hits[i].flags, 0u);
      if (std::isfinite(nearest)) {
        ASSERT_NEAR(nearest, double{rays[i].tmax}, 1e-4 / length);
      }
      continue;
    }
    ++found;
    const uint32_t number = LSP_HIT_INSTANCE(hits[i]);
    ASSERT_LT(number, instances.size());
    const LspTriangle& triangle = assets[instances[number].asset]->triangle(hits[i].primitive);
    const Meeting m = meet(rays[i], instances[number], triangle);
    ASSERT_GT(m.inside, -kSure);
    ASSERT_LE(hits[i].t * length, nearest * length + 1e-4);
    if (m.inside > kSure) {
      ASSERT_NEAR(hits[i].t * length, m.t * length, 1e-3);
    }
  }
  EXPECT_GT(found, rays.size() / 20);
}

TEST(Instances, AgreeWithEveryMovedTriangle) {
  BuildOptions other;
  other.seed = 5;
  other.triangles = 40;
  other.normals = false;
  const Asset one, two(other);
  Random random(3);
  std::vector<lsp_instance> places;
  for (uint32_t i = 0; i < 13; ++i) places.push_back(anywhere(random, i % 2, 5));
  const Instances instances({&one.scene, &two.scene}, places);
  const std::vector<LspRay> rays = rays_about(instances.view(), 2000, 7);
  std::vector<LspHit> hits(rays.size());
  lsp_trace_counts counts{};
  instances.trace({}, 255, rays, hits, &counts);
  expect_closest({&one, &two}, instances, rays, hits);
  EXPECT_EQ(counts.rays, rays.size());
  EXPECT_EQ(counts.invalid, 0u);
  EXPECT_EQ(counts.hits,
            size_t(std::count_if(hits.begin(), hits.end(), [](const LspHit& h) { return h.t < 1e30f; })));
  EXPECT_GT(counts.nodes, rays.size());

  // One ray after the other, and with nothing counted: the same bits.
  std::vector<LspHit> again(rays.size());
  for (size_t i = 0; i < rays.size(); ++i) instances.trace({}, 255, {&rays[i], 1}, {&again[i], 1});
  EXPECT_EQ(memcmp(hits.data(), again.data(), hits.size() * sizeof(LspHit)), 0);
  instances.trace({}, 255, rays, again);
  EXPECT_EQ(memcmp(hits.data(), again.data(), hits.size() * sizeof(LspHit)), 0);

  // Any hit: where and only where there is a closest one.
  EXPECT_THROW(instances.trace({}, 255, rays, View<LspHit>(again.data(), again.size() - 1)), Error);
  instances.trace({LSP_TRACE_ANY_HIT, 0}, 255, rays, again);
  for (size_t i = 0; i < rays.size(); ++i) {
    ASSERT_EQ(std::isinf(hits[i].t), std::isinf(again[i].t)) << i;
    ASSERT_GE(again[i].t, hits[i].t);
  }
}

// Flattened, stretched and sheared a thousandfold, tiny and huge, mirrored: no hit is lost.
TEST(Instances, AnyAffineTransform) {
  const Asset asset;
  const lsp_instance places[] = {
      at(0, {-1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0}), at(0, {1, 0, 0, 0, 0, 1e-3f, 0, 0, 0, 0, 1, 0}),
      at(0, {1e3f, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0}), at(0, {1, 30, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0}),
      at(0, {1e-4f, 0, 0, 0, 0, 1e-4f, 0, 0, 0, 0, 1e-4f, 0})};
  for (const lsp_instance& place : places) {
    const Instances instances({&asset.scene}, {&place, 1});
    // Rays of the asset's own space, moved: t and the triangle are those of the asset.
    const Instances still({&asset.scene}, std::array{identity()});
    const std::vector<LspRay> rays = rays_about(still.view(), 3000, 11);
    std::vector<LspRay> moved = rays;
    for (LspRay& ray : moved) {
      const Vector o = move_point(place, ray.origin), d = move_point(place, ray.direction);
      ray.origin = {float(o[0]), float(o[1]), float(o[2])};
      ray.direction = {float(d[0]), float(d[1]), float(d[2])};
    }
    std::vector<LspHit> expected(rays.size()), hits(rays.size());
    still.trace({}, 255, rays, expected);
    instances.trace({}, 255, moved, hits);
    size_t different = 0;
    for (size_t i = 0; i < rays.size(); ++i) {
      if (hits[i].primitive != expected[i].primitive) {
        ++different;  // at an edge
      } else if (std::isfinite(hits[i].t)) {
        ASSERT_NEAR(hits[i].t, expected[i].t, 1e-3 * (1 + expected[i].t)) << i;
      }
    }
    EXPECT_LE(different, 12u);
  }
}

// A normal is that of the surface as it was moved, and what was outside is outside.
TEST(Instances, NormalsFollowTheSurface) {
  BuildOptions options;
  options.normals = false;
  const Asset asset(options);
  Random random(8);
  for (int round = 0; round < 20; ++round) {
    const lsp_instance place = anywhere(random, 0, 3);
    const Instances instances({&asset.scene}, {&place, 1});
    const std::vector<LspRay> rays = rays_about(instances.view(), 100, 12);
    std::vector<LspHit> hits(rays.size());
    instances.trace({}, 255, rays, hits);
    for (const LspHit& hit : hits) {
      if (std::isinf(hit.t)) continue;
      const LspTriangle& t = asset.triangle(hit.primitive);
      const Vector a = move_point(place, t.v0), e1 = move_point(place, t.v1) - a,
                   e2 = move_point(place, t.v2) - a;
      Vector n = cross(e1, e2);
      const Vector x{place.transform[0], place.transform[4], place.transform[8]},
          y{place.transform[1], place.transform[5], place.transform[9]},
          z{place.transform[2], place.transform[6], place.transform[10]};
      const double side = dot(x, cross(y, z)) < 0 ? -1 : 1, length = std::sqrt(dot(n, n));
      ASSERT_NEAR(dot(n, of(hit.normal)) * side / length, 1, 1e-4);
      ASSERT_NEAR(dot(of(hit.normal), of(hit.normal)), 1, 1e-6);
    }
  }
}

// Far from everything the moved ray is as precise as the rays' own coordinates are.
TEST(Instances, FarAway) {
  const Asset asset;
  constexpr float kFar = 1048576;
  const lsp_instance place = at(0, {1, 0, 0, kFar, 0, 1, 0, -kFar, 0, 0, 1, kFar});
  const Instances instances({&asset.scene}, {&place, 1});
  const Instances still({&asset.scene}, std::array{identity()});
  std::vector<LspRay> rays = rays_about(still.view(), 1000, 13);
  for (LspRay& ray : rays)  // to where a step of a coordinate there is
    for (float* x : {&ray.origin.x, &ray.origin.y, &ray.origin.z}) *x = std::round(*x * 8) / 8;
  std::vector<LspHit> expected(rays.size()), hits(rays.size());
  still.trace({}, 255, rays, expected);
  for (LspRay& ray : rays) {
    ray.origin.x += kFar;
    ray.origin.y -= kFar;
    ray.origin.z += kFar;
  }
  instances.trace({}, 255, rays, hits);
  EXPECT_EQ(memcmp(hits.data(), expected.data(), hits.size() * sizeof(LspHit)), 0);
}

// Not moved, an asset answers as it does alone: every base structure, exactly and approximately.
TEST(Instances, IdentityIsTheAssetItself) {
  size_t scenes = 0;
  for (const auto& entry : std::filesystem::directory_iterator(LSP_CORPUS_DIR)) {
    SCOPED_TRACE(entry.path().string());
    const SceneFile file(entry.path().string());
    if (file.header().triangle_count == 0) continue;
    const Instances instances({&file.scene()}, std::array{identity()});
    const std::vector<LspRay> rays = rays_about(instances.view(), 500, 17);
    for (const uint32_t flags :
         {0u, LSP_TRACE_ANY_HIT, LSP_TRACE_APPROXIMATE, LSP_TRACE_APPROXIMATE | LSP_TRACE_ANY_HIT,
          LSP_TRACE_APPROXIMATE | LSP_TRACE_NEAR_SKIP}) {
      std::vector<LspHit> expected(rays.size()), hits(rays.size());
      const lsp_trace_options options{flags, 0};
      if (lsp_trace(&file.scene(), &options, rays.data(), expected.data(), rays.size(), nullptr, nullptr) !=
          LSP_OK) {
        EXPECT_THROW(instances.trace(options, 255, rays, hits), Error);
        continue;
      }
      instances.trace(options, 255, rays, hits);
      ++scenes;
      double origin[3];
      lsp_scene_origin(&file.scene(), origin);
      if (origin[0] != 0 || origin[1] != 0 || origin[2] != 0) continue;  // instances are then elsewhere
      for (size_t i = 0; i < rays.size(); ++i) {
        ASSERT_EQ(memcmp(&hits[i], &expected[i], offsetof(LspHit, normal)), 0) << i << ", flags " << flags;
        ASSERT_EQ(hits[i].flags, expected[i].flags) << i;
        ASSERT_NEAR(hits[i].normal.x, expected[i].normal.x, 2e-7);
        ASSERT_NEAR(hits[i].normal.y, expected[i].normal.y, 2e-7);
        ASSERT_NEAR(hits[i].normal.z, expected[i].normal.z, 2e-7);
      }
    }
  }
  EXPECT_GT(scenes, 30u);
}

// Of instances in one place the first that the ray may see answers.
TEST(Instances, TiesAndMasks) {
  const Asset asset;
  std::vector<lsp_instance> places;
  for (uint32_t i = 0; i < 9; ++i) {
    places.push_back(identity());
    places.back().mask = i == 8 ? 0u : 1u << i;
    places.back().user = 70 + i;
  }
  const Instances instances({&asset.scene}, places);
  const std::vector<LspRay> rays = rays_about(instances.view(), 300, 19);
  std::vector<LspHit> all(rays.size()), hits(rays.size());
  instances.trace({}, 0xFF, rays, all);
  const auto expect_instance = [&](uint32_t mask, uint32_t number) {
    instances.trace({}, mask, rays, hits);
    for (size_t i = 0; i < rays.size(); ++i) {
      ASSERT_EQ(hits[i].t, all[i].t);
      ASSERT_EQ(hits[i].primitive, all[i].primitive);
      if (std::isinf(hits[i].t)) continue;
      ASSERT_EQ(LSP_HIT_INSTANCE(hits[i]), number);
      ASSERT_EQ(instances[number].user, 70 + number);
    }
  };
  expect_instance(0xFF, 0);
  expect_instance(0xF0, 4);
  expect_instance(0x80, 7);
  for (const uint32_t mask : {0u, 0x100u}) {
    instances.trace({}, mask, rays, hits);
    for (const LspHit& hit : hits) ASSERT_TRUE(std::isinf(hit.t));
  }
}

TEST(Instances, InvalidRaysMissAndAreCounted) {
  const Asset asset;
  const Instances instances({&asset.scene}, std::array{identity(), identity()});
  std::vector<LspRay> rays = rays_about(instances.view(), 10, 23);
  rays[0].direction = {0, 0, 0};
  rays[1].origin.y = NAN;
  rays[2].direction.z = INFINITY;
  rays[3].tmin = 5;
  rays[3].tmax = 4;
  rays[4].tmax = NAN;
  rays[5].direction = {1e-40f, 0, 0};
  std::vector<LspHit> hits(rays.size());
  lsp_trace_counts counts{};
  instances.trace({}, 255, rays, hits, &counts);
  EXPECT_EQ(counts.rays, 10u);
  EXPECT_EQ(counts.invalid, 6u);
  for (size_t i = 0; i < 6; ++i) EXPECT_EQ(hits[i].primitive, LSP_NONE);
}

TEST(Instances, ThousandsAreFoundAgain) {
  BuildOptions small;
  small.triangles = 12;
  const Asset asset(small);
  Random random(29);
  std::vector<lsp_instance> places;
  for (uint32_t i = 0; i < 3000; ++i) places.push_back(anywhere(random, 0, i < 2000 ? 30.0f : 0.0f));
  const Instances instances({&asset.scene}, places);
  const std::vector<LspRay> rays = rays_about(instances.view(), 300, 31);
  std::vector<LspHit> hits(rays.size());
  instances.trace({}, 255, rays, hits);
  expect_closest({&asset}, instances, rays, hits);
}

// The same asset by many numbers: which one an instance has makes no difference.
TEST(Instances, OfHundredsOfAssets) {
  const Asset asset;
  Random random(37);
  std::vector<lsp_instance> places;
  for (uint32_t i = 0; i < 700; ++i) places.push_back(anywhere(random, 0, 6));
  const Instances one({&asset.scene}, places);
  for (uint32_t i = 0; i < places.size(); ++i) places[i].asset = i * 7 % 600;
  const Instances many(std::vector<const lsp_scene*>(600, &asset.scene), places);
  const std::vector<LspRay> rays = rays_about(one.view(), 1000, 41);
  for (const uint32_t flags : {0u, LSP_TRACE_ANY_HIT}) {
    std::vector<LspHit> expected(rays.size()), hits(rays.size());
    one.trace({flags, 0}, 255, rays, expected);
    many.trace({flags, 0}, 255, rays, hits);
    for (size_t i = 0; i < rays.size(); ++i)
      ASSERT_EQ(memcmp(&hits[i], &expected[i], sizeof(LspHit)), 0) << i << ", flags " << flags;
  }
}

TEST(Instances, NoneAtAll) {
  const Instances none;
  const LspRay ray = {{0, 0, -9}, 0, {0, 0, 1}, 100};
  LspHit hit{};
  none.trace({}, 255, {&ray, 1}, {&hit, 1});
  EXPECT_TRUE(std::isinf(hit.t));
  EXPECT_EQ(hit.flags, 0u);
  EXPECT_EQ(lsp_instances_bytes(0), 0u);
  EXPECT_EQ(lsp_instance_hit_offset(&none.view(), &hit), 0);
  lsp_instances empty;
  EXPECT_EQ(lsp_instances_build(nullptr, 0, nullptr, 0, nullptr, 0, &empty, nullptr), LSP_OK);
  EXPECT_THROW(none.trace({0x40, 0}, 255, {&ray, 1}, {&hit, 1}), Error);
}

// A level without its objects yet: shaders are planned for its assets before the first is placed.
TEST(Instances, NoneOfSomeAssets) {
  const Asset asset;
  const Instances none({&asset.scene, &asset.scene}, {nullptr, 0});
  EXPECT_EQ(none.view().count, 0u);
  ASSERT_EQ(none.view().asset_count, 2u);
  EXPECT_EQ(none.view().assets[1], &asset.scene);
  const LspRay ray = {{0, 0, -9}, 0, {0, 0, 1}, 100};
  for (const uint32_t flags : {0u, LSP_TRACE_APPROXIMATE, LSP_TRACE_OCCLUSION}) {
    LspHit hit{};
    lsp_trace_counts counts{};
    none.trace({flags, 0}, 255, {&ray, 1}, {&hit, 1}, &counts);
    EXPECT_TRUE(std::isinf(hit.t));
    EXPECT_EQ(counts.rays, 1u);
  }
}

TEST(Instances, OffsetGrowsWithTheInstance) {
  const Asset asset;
  const lsp_instance place = at(0, {0, -3, 0, 0, 3, 0, 0, 0, 0, 0, 5, 0});
  const Instances instances({&asset.scene}, {&place, 1});
  LspHit hit{};
  const float alone = lsp_hit_offset(&asset.scene, &hit);
  hit.normal = {0, 1, 0};
  EXPECT_FLOAT_EQ(lsp_instance_hit_offset(&instances.view(), &hit), 3 * alone);
  hit.normal = {0, 0, -1};
  EXPECT_FLOAT_EQ(lsp_instance_hit_offset(&instances.view(), &hit), 5 * alone);
  hit.flags = LSP_HIT_LINE_SPACE;
  EXPECT_GT(lsp_instance_hit_offset(&instances.view(), &hit), 5 * alone);
}

class Refused : public testing::Test {
 protected:
  lsp_status build(const std::vector<lsp_instance>& places, uint64_t less = 0, size_t shift = 0) {
    memory_.resize(lsp_instances_bytes(uint32_t(places.size())) + shift);
    const lsp_scene* assets[] = {&asset_.scene};
    return lsp_instances_build(assets, 1, places.data(), uint32_t(places.size()), memory_.data() + shift,
                               memory_.size() - shift - less, &instances_, &error_);
  }
  void expect_refused(lsp_status status, const char* text) {
    EXPECT_EQ(error_.status, status);
    EXPECT_NE(std::string(error_.message).find(text), std::string::npos) << error_.message;
    EXPECT_EQ(instances_.count, 0u);
  }
  Asset asset_;
  Bytes memory_;
  lsp_instances instances_{};
  lsp_error error_{};
};

TEST_F(Refused, TransformsWithoutAnInverse) {
  const lsp_instance good = identity();
  EXPECT_EQ(build({good, at(0, {1, 2, 3, 0, 4, 5, 6, 0, 7, 8, 9, 0})}), LSP_ERROR_INVALID);
  expect_refused(LSP_ERROR_INVALID, "instance 1");
  EXPECT_EQ(build({at(0, {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0}), good}), LSP_ERROR_INVALID);
  expect_refused(LSP_ERROR_INVALID, "instance 0");
  EXPECT_EQ(build({good, good, at(0, {1, 0, 0, NAN, 0, 1, 0, 0, 0, 0, 1, 0})}), LSP_ERROR_INVALID);
  expect_refused(LSP_ERROR_INVALID, "instance 2");
  EXPECT_EQ(build({at(0, {INFINITY, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0})}), LSP_ERROR_INVALID);
  EXPECT_EQ(build({at(0, {3e38f, 0, 0, 3e38f, 0, 1, 0, 0, 0, 0, 1, 0})}), LSP_ERROR_INVALID);
  expect_refused(LSP_ERROR_INVALID, "single precision");
  EXPECT_EQ(build({at(1, {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0})}), LSP_ERROR_INVALID);
  expect_refused(LSP_ERROR_INVALID, "asset 1 of 1");
  EXPECT_EQ(build({good}), LSP_OK);
  EXPECT_EQ(instances_.count, 1u);
}

TEST_F(Refused, MemoryTooSmallOrCrooked) {
  EXPECT_EQ(build({identity(), identity()}, 1), LSP_ERROR_LIMIT);
  expect_refused(LSP_ERROR_LIMIT, "2 instances need 712 bytes");
  EXPECT_EQ(build({identity()}, 0, 8), LSP_ERROR_LIMIT);
  EXPECT_EQ(lsp_instances_build(nullptr, 0, nullptr, LSP_MAX_INSTANCES + 1, nullptr, UINT64_MAX, &instances_,
                                &error_),
            LSP_ERROR_LIMIT);
  expect_refused(LSP_ERROR_LIMIT, "16777216");
}

TEST(Instances, AnAssetThatLacksWhatIsAskedFor) {
  BuildOptions options;
  options.exact = false;
  const Asset approximate(options), exact;
  const Instances instances({&exact.scene, &approximate.scene}, std::array{identity(), identity(1)});
  const LspRay ray = {{0, 0, -9}, 0, {0, 0, 1}, 100};
  LspHit hit{};
  hit.primitive = 77;
  lsp_error error;
  const lsp_trace_options none{};
  EXPECT_EQ(lsp_trace_instances(&instances.view(), &none, 255, &ray, &hit, 1, nullptr, &error),
            LSP_ERROR_UNSUPPORTED);
  EXPECT_EQ(std::string(error.message).rfind("asset 1: ", 0), 0u) << error.message;
  EXPECT_EQ(hit.primitive, 77u) << "nothing is traced";
  const lsp_trace_options by_tables{LSP_TRACE_APPROXIMATE, 0};
  EXPECT_EQ(lsp_trace_instances(&instances.view(), &by_tables, 255, &ray, &hit, 1, nullptr, &error), LSP_OK);
}

}  // namespace
}  // namespace lsp::test
