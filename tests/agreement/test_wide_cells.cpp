// Rays across vector lanes, of cells and exact ones through wide nodes, have the bits of rays one after the
// other, in every instruction set that runs here.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <random>
#include <set>

#include "bake.h"
#include "hard_rays.h"
#include "lsp/lsp.h"
#include "meshes.h"
#include "ray_order.h"
#include "surface_rays.h"
#include "trace_cells_wide.h"
#include "trace_wide_lanes.h"
#include "traced.h"

namespace lsp::test {
namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();

// Cells along the longest side; 0: wide nodes alone.
lsp::Baked bake_cells(const Mesh& mesh, uint32_t cells) {
  BakeOptions options;
  options.base = cells == 0 ? Base::kWide : Base::kCells;
  options.cells = cells;
  return bake(mesh, options);
}

void move(Mesh& mesh, float scale, const glm::vec3& by) {
  for (glm::vec3& p : mesh.positions) p = p * scale + by;
}

struct Scene {
  const char* name;
  lsp::Baked baked;
};

// With cells, or wide nodes alone.
std::vector<Scene> scenes(bool cells) {
  const auto of = [&](const Mesh& mesh, uint32_t number) { return bake_cells(mesh, cells ? number : 0); };
  std::vector<Scene> made;
  made.push_back({"ball", of(sphere(12), 6)});
  made.push_back({"soup", of(soup(400, 0.5f), 5)});
  Mesh far = sphere(8);
  move(far, 1e-3f, {7, -3, 5});
  made.push_back({"small, from afar", of(far, 4)});
  Mesh flat;
  add_triangle(flat, {0, 0, 0}, {1, 0, 0}, {0, 1, 0});
  made.push_back({"a triangle", of(flat, 3)});
  // Planes of a size apart: large empty spaces, which rays jump over.
  Mesh apart = sphere(6);
  add_triangle(apart, {40, -20, -20}, {40, 20, -20}, {40, 0, 30});
  made.push_back({"far apart", of(apart, 24)});
  // Nothing leaves it, but tables may think so.
  Mesh inside = sphere(12);
  for (auto& t : inside.triangles) std::swap(t[1], t[2]);
  made.push_back({"inside of a ball", of(inside, 5)});
  // Leaves that are there in part, on a ball.
  Mesh leaves = soup(300, 0.5f);
  leaves.materials.resize(3);
  leaves.materials[1].opacity = 0.3f;
  leaves.materials[2].opacity = 0.8f;
  for (uint32_t i = 0; i < leaves.triangles.size(); ++i) leaves.material_ids[i] = i % 3;
  made.push_back({"in part", of(leaves, 5)});
  EXPECT_NE(made.back().baked.header.required_features & LSP_FEATURE_COVERAGE, 0u);
  // Through it rays pass more filled cells than LspWalk.waiting tells apart.
  made.push_back({"a row", of(row_of_soup(20), 64)});
  return made;
}

// Numbers of every size and sign, the ends of the range among them.
class Numbers {
 public:
  explicit Numbers(uint64_t seed) : random_(seed) {}

  uint32_t below(uint32_t n) { return static_cast<uint32_t>(random_() % n); }
  float between(float lo, float hi) {
    return lo + (hi - lo) * static_cast<float>(random_() >> 40) * 0x1p-24f;
  }
  float any() {
    constexpr float kSpecial[] = {0.0f,      -0.0f,      1e-45f, -1e-40f,
                                  1e-38f,    3e38f,      -3e38f, 1e20f,
                                  -1e20f,    1.0f,       -1.0f,  1e-20f,
                                  kInfinity, -kInfinity, 1e-30f, 16777216,
                                  2e9f,      -5e9f,      1e30f,  std::numeric_limits<float>::quiet_NaN()};
    return kSpecial[below(std::size(kSpecial))];
  }

 private:
  std::mt19937_64 random_;
};

// Rays on the borders of cells and along them, short ones, of every length, from far away, and what is no ray
// at all.
std::vector<LspRay> grid_rays(const LspCellGrid& grid, size_t count) {
  Numbers numbers(7);
  std::vector<LspRay> rays(count);
  const float extent = grid.size * static_cast<float>(grid.cells_x + grid.cells_y + grid.cells_z);
  const uint32_t cells[3] = {grid.cells_x, grid.cells_y, grid.cells_z};
  const float lo[3] = {grid.lo.x, grid.lo.y, grid.lo.z};
  for (LspRay& ray : rays) {
    float o[3], d[3];
    const uint32_t kind = numbers.below(8);
    for (int k = 0; k < 3; ++k) {
      const auto border = static_cast<float>(numbers.below(4 * cells[k] + 5)) * 0.25f - 0.5f;
      o[k] = numbers.below(3) == 0
                 ? lo[k] + grid.size * numbers.between(-0.5f, static_cast<float>(cells[k]) + 0.5f)
                 : lo[k] + grid.size * border;
      d[k] = numbers.below(3) == 0 ? static_cast<float>(numbers.below(3)) - 1.0f : numbers.between(-1, 1);
      if (kind == 0 && numbers.below(2) == 0) d[k] = numbers.any();
      if (kind == 1 && numbers.below(3) == 0) o[k] = numbers.any();
      if (kind == 2) o[k] += numbers.between(-1, 1) * std::ldexp(extent, static_cast<int>(numbers.below(90)));
      if (kind == 3) d[k] = std::ldexp(d[k], static_cast<int>(numbers.below(200)) - 100);
    }
    ray = {{o[0], o[1], o[2]}, 0, {d[0], d[1], d[2]}, kInfinity};
    if (kind == 4) ray.tmax = grid.size * numbers.between(0, 3);
    if (kind == 5) ray.tmin = grid.size * numbers.between(-2, 4);
    if (kind == 6) ray.tmin = numbers.any(), ray.tmax = numbers.any();
    if (kind == 7) ray.tmin = ray.tmax = grid.size * static_cast<float>(numbers.below(3));
  }
  return rays;
}

std::vector<LspRay> rays_of(const lsp::Baked& baked) {
  std::vector<LspRay> rays = surface_rays(baked, 3000, 1);
  const std::vector<LspRay> hard = hard_rays(baked.triangles, 3000, 5);
  rays.insert(rays.end(), hard.begin(), hard.end());
  const std::vector<LspRay> grid = grid_rays(baked.header.cells, 9000);
  rays.insert(rays.end(), grid.begin(), grid.end());
  std::shuffle(rays.begin(), rays.end(), std::mt19937(3));
  return rays;
}

// A counted trace is that of single rays.
std::vector<LspHit> single_rays(const lsp_scene& scene, const lsp_trace_options& options,
                                const std::vector<LspRay>& rays) {
  lsp_trace_counts counts{};
  return trace(scene, options, rays, &counts);
}

void expect_same(const std::vector<LspHit>& single, const std::vector<LspHit>& wide,
                 const std::vector<LspRay>& rays, const std::string& where) {
  size_t different = 0;
  for (size_t i = 0; i < single.size(); ++i) {
    if (std::memcmp(&single[i], &wide[i], sizeof(LspHit)) == 0 || ++different > 3) continue;
    const LspRay& r = rays[i];
    ADD_FAILURE() << where << ", ray " << i << " of " << single.size() << ": t " << single[i].t << " and "
                  << wide[i].t << ", triangle " << single[i].primitive << " and " << wide[i].primitive
                  << ", flags " << single[i].flags << " and " << wide[i].flags << "; origin " << r.origin.x
                  << " " << r.origin.y << " " << r.origin.z << ", direction " << r.direction.x << " "
                  << r.direction.y << " " << r.direction.z << ", from " << r.tmin << " to " << r.tmax;
  }
  EXPECT_EQ(different, 0u) << where;
}

// By the number of an instruction set.
// The same t of any hit, and nothing besides.
void expect_same_occlusion(const std::vector<LspHit>& single, const std::vector<LspHit>& wide) {
  for (size_t i = 0; i < single.size(); ++i) {
    ASSERT_EQ(wide[i].t, single[i].t) << i;
    ASSERT_EQ(wide[i].primitive, LSP_NONE) << i;
  }
}

class WideCellsTest : public testing::TestWithParam<size_t> {
 protected:
  const WideCells& wide_ = kWideCells[GetParam()];
  void SetUp() override {
    if (!wide_.runs_here()) GTEST_SKIP() << "this CPU does not have " << wide_.name;
  }
};

TEST_P(WideCellsTest, SameBitsAsSingleRays) {
  for (const Scene& of : scenes(true)) {
    const lsp_scene scene = view(of.baked);
    const std::vector<LspRay> rays = rays_of(of.baked);
    std::vector<LspHit> wide(rays.size());
    for (const float max_loss : {100.0f, 20.0f, 5.0f, 1.0f, 0.0f})
      for (const uint32_t any : {0u, LSP_TRACE_ANY_HIT}) {
        const lsp_trace_options options{LSP_TRACE_APPROXIMATE | LSP_TRACE_MAX_LOSS | any, 0, 0, max_loss};
        const auto single = single_rays(scene, options, rays);
        wide_.trace(scene, options.flags, lsp_dial(&scene, &options), rays.data(), wide.data(), rays.size());
        expect_same(single, wide, rays, std::string(of.name) + ", loss " + std::to_string(max_loss));
        if (any == 0) continue;
        wide_.trace(scene, options.flags | LSP_TRACE_OCCLUSION, lsp_dial(&scene, &options), rays.data(),
                    wide.data(), rays.size());
        expect_same_occlusion(single, wide);
      }
  }
}

TEST_P(WideCellsTest, AnyNumberOfRays) {
  const lsp::Baked baked = bake_cells(sphere(12), 6);
  const lsp_scene scene = view(baked);
  const std::vector<LspRay> rays = rays_of(baked);
  const lsp_trace_options options{LSP_TRACE_APPROXIMATE, 0};
  const auto single = single_rays(scene, options, rays);
  for (const size_t count : {0, 1, 2, 3, 5, 8, 15, 17, 63, 64, 65, 129, 1000}) {
    const LspHit untouched{1, 2, 3, 4, {5, 6, 7}, 8};
    std::vector<LspHit> wide(count + 1, untouched);
    wide_.trace(scene, LSP_TRACE_APPROXIMATE, lsp_dial(&scene, &options), rays.data() + 100, wide.data(),
                count);
    EXPECT_EQ(std::memcmp(wide.data(), single.data() + 100, count * sizeof(LspHit)), 0) << count;
    EXPECT_EQ(std::memcmp(&wide[count], &untouched, sizeof(LspHit)), 0) << count;
  }
}

// Large triangles, of which each lies in many cells, and needles.
Mesh hall() {
  Mesh mesh = sphere(8);
  for (const float z : {-2.0f, 2.0f}) {
    add_triangle(mesh, {-7, -5, z}, {7, -5, z}, {7, 5, z});
    add_triangle(mesh, {-7, -5, z}, {7, 5, z}, {-7, 5, z});
  }
  add_triangle(mesh, {-7, -5, -2}, {7, 5.5f, 1.5f}, {7, 5.51f, 1.52f});
  for (int i = 0; i < 40; ++i) {
    const float x = -6 + 0.3f * static_cast<float>(i);
    add_triangle(mesh, {x, -4, -1}, {x + 1e-3f, -4, -1}, {x, 4, 1.5f});
  }
  return mesh;
}

// Along triangles: from somewhere in the plane of one, or hardly off it, to a point of it.
std::vector<LspRay> grazing_rays(std::span<const LspTriangle> triangles, size_t count) {
  Numbers numbers(23);
  std::vector<LspRay> rays(count);
  for (LspRay& ray : rays) {
    const LspTriangle& t = triangles[numbers.below(static_cast<uint32_t>(triangles.size()))];
    const auto vec = [](const lsp_float3& p) { return glm::vec3(p.x, p.y, p.z); };
    const glm::vec3 a = vec(t.v0), b = vec(t.v1), c = vec(t.v2);
    const glm::vec3 n = glm::cross(b - a, c - a) / std::max(1e-30f, glm::length(glm::cross(b - a, c - a)));
    const auto in_plane = [&](float reach) {
      return a + numbers.between(-reach, 1 + reach) * (b - a) + numbers.between(-reach, 1 + reach) * (c - a);
    };
    const glm::vec3 to = in_plane(0);
    const float off = std::ldexp(glm::length(b - a), -static_cast<int>(numbers.below(40)));
    const glm::vec3 from = in_plane(0.5f) + numbers.between(-1, 1) * off * n;
    ray = {{from.x, from.y, from.z}, 0, {to.x - from.x, to.y - from.y, to.z - from.z}, kInfinity};
  }
  return rays;
}

// Exact rays through cells meet what they meet through the tree.
TEST_P(WideCellsTest, ExactRaysAsThroughTheTree) {
  std::vector<Scene> all = scenes(true);
  all.push_back({"hall", bake_cells(hall(), 20)});
  for (const Scene& of : all) {
    const lsp_scene scene = view(of.baked);
    std::vector<LspRay> rays = rays_of(of.baked);
    const std::vector<LspRay> grazing = grazing_rays(of.baked.triangles, 20000);
    rays.insert(rays.end(), grazing.begin(), grazing.end());
    const auto single = single_rays(scene, {0, 0, 0, 0}, rays);
    std::vector<LspHit> wide(rays.size());
    wide_.trace(scene, 0, 0, rays.data(), wide.data(), rays.size());
    expect_same(single, wide, rays, of.name);
  }
}

// Tables that say anything at all, and counts that are too small: what is beyond the end is zero.
TEST_P(WideCellsTest, SameBitsOfDamagedFiles) {
  lsp::Baked baked = bake_cells(sphere(12), 6);
  const std::vector<LspRay> rays = rays_of(baked);
  std::mt19937 random(11);
  const auto damage = [&](auto& elements) {
    auto* bytes = reinterpret_cast<uint8_t*>(elements.data());
    const size_t size = elements.size() * sizeof elements[0];
    for (size_t k = 0; k < size / 64 + 1; ++k) bytes[random() % size] = static_cast<uint8_t>(random());
  };
  for (int round = 0; round < 12; ++round) {
    switch (round % 6) {
      case 0:
        damage(baked.cell_tables.entries);
        break;
      case 1:
        damage(baked.cell_tables.splits);
        break;
      case 2:
        damage(baked.cell_tables.planes);
        break;
      case 3:
        damage(baked.cell_tables.plane_records);
        break;
      case 4:
        damage(baked.cell_tables.cells);
        break;
      default:
        damage(baked.cell_grid.words);
        break;
    }
    const lsp_scene scene = view(baked);
    std::vector<LspHit> wide(rays.size());
    for (const float max_loss : {100.0f, 2.0f}) {
      const lsp_trace_options options{LSP_TRACE_APPROXIMATE | LSP_TRACE_MAX_LOSS, 0, 0, max_loss};
      const auto single = single_rays(scene, options, rays);
      wide_.trace(scene, LSP_TRACE_APPROXIMATE, lsp_dial(&scene, &options), rays.data(), wide.data(),
                  rays.size());
      expect_same(single, wide, rays, "damaged " + std::to_string(round));
    }
  }
}

// By the number of an instruction set.
class WideExactTest : public testing::TestWithParam<size_t> {
 protected:
  const WideExact& wide_ = kWideExact[GetParam()];
  void SetUp() override {
    if (!wide_.runs_here()) GTEST_SKIP() << "this CPU does not have " << wide_.name;
  }
};

TEST_P(WideExactTest, SameBitsAsSingleRays) {
  for (const Scene& of : scenes(false)) {
    const lsp_scene scene = view(of.baked);
    ASSERT_NE(scene.wide_nodes, nullptr) << of.name;
    const std::vector<LspRay> rays = rays_of(of.baked);
    std::vector<LspHit> wide(rays.size());
    for (const uint32_t any : {0u, LSP_TRACE_ANY_HIT}) {
      const auto single = single_rays(scene, {any, 0, 0, 0}, rays);
      EXPECT_GT(std::count_if(single.begin(), single.end(),
                              [](const LspHit& h) { return h.primitive != LSP_NONE; }),
                500)
          << of.name;
      wide_.trace(scene, any, rays.data(), wide.data(), rays.size());
      expect_same(single, wide, rays, std::string(of.name) + ", any " + std::to_string(any));
      if (any == 0) continue;
      wide_.trace(scene, any | LSP_TRACE_OCCLUSION, rays.data(), wide.data(), rays.size());
      expect_same_occlusion(single, wide);
    }
  }
}

// Alone, in groups, and in the order of their origins; the last ones fill neither a vector nor a group.
TEST_P(WideExactTest, SameBitsOfAnyNumberOfRays) {
  const lsp::Baked baked = bake_cells(sphere(24), 0);
  const lsp_scene scene = view(baked);
  const std::vector<LspRay> rays = surface_rays(baked, 2500, 4);
  const auto single = single_rays(scene, {LSP_TRACE_ANY_HIT, 0, 0, 0}, rays);
  for (const size_t count : {1u, 3u, 8u, 31u, 47u, 48u, 255u, 1023u, 1024u, 4096u, 4097u, 9999u}) {
    std::vector<LspHit> wide(count + 1);
    wide.back().primitive = 12345;
    wide_.trace(scene, LSP_TRACE_ANY_HIT, rays.data(), wide.data(), count);
    EXPECT_EQ(wide.back().primitive, 12345u) << "written behind the end";
    wide.pop_back();
    expect_same({single.begin(), single.begin() + static_cast<std::ptrdiff_t>(count)}, wide,
                {rays.begin(), rays.begin() + static_cast<std::ptrdiff_t>(count)},
                std::to_string(count) + " rays");
  }
}

TEST(RayOrder, NamesEveryRayOnceThoseNearEachOtherTogether) {
  Numbers numbers(3);
  std::vector<LspRay> rays(kMostOrdered);
  for (LspRay& ray : rays)
    ray = {{numbers.between(-8, 8), numbers.between(0, 1), numbers.between(3, 5)}, 0, {1, 0, 0}, 1};
  std::vector<uint16_t> order(rays.size());
  order_by_origin(rays.data(), kMostOrdered, order.data());
  std::vector<bool> named(rays.size());
  for (const uint16_t i : order) {
    ASSERT_LT(i, rays.size());
    EXPECT_FALSE(named[i]) << i << " is named twice";
    named[i] = true;
  }
  const auto way = [&](const auto& number_of) {
    double sum = 0;
    for (size_t i = 1; i < rays.size(); ++i) {
      const lsp_float3 a = rays[number_of(i - 1)].origin, b = rays[number_of(i)].origin;
      sum += std::hypot((a.x - b.x) / 16, a.y - b.y, (a.z - b.z) / 2);
    }
    return sum;
  };
  EXPECT_LT(way([&](size_t i) { return order[i]; }), 0.25 * way([](size_t i) { return i; }));
}

TEST(RayOrder, TakesOriginsThatAreNoPlaces) {
  std::vector<LspRay> rays(100, LspRay{{1, 2, 3}, 0, {1, 0, 0}, 1});
  rays[0].origin.x = rays[7].origin.y = std::numeric_limits<float>::quiet_NaN();
  rays[20].origin.z = kInfinity;
  rays[30].origin.x = -kInfinity;
  rays[31].origin.x = 3e38f;
  std::vector<uint16_t> order(rays.size());
  order_by_origin(rays.data(), 100, order.data());
  std::sort(order.begin(), order.end());
  for (size_t i = 0; i < order.size(); ++i) EXPECT_EQ(order[i], i);
}

// Where products of positions and reciprocals overflow the text of single rays answers.
TEST_P(WideExactTest, SameBitsInHugeScenes) {
  for (const float scale : {1e13f, 1e17f}) {
    Mesh mesh = sphere(8);
    move(mesh, scale, {0, 0, 0});
    const lsp::Baked baked = bake_cells(mesh, 0);
    const lsp_scene scene = view(baked);
    const std::vector<LspRay> rays = rays_of(baked);
    std::vector<LspHit> wide(rays.size());
    const auto single = single_rays(scene, {0, 0, 0, 0}, rays);
    wide_.trace(scene, 0, rays.data(), wide.data(), rays.size());
    expect_same(single, wide, rays, "scaled by " + std::to_string(scale));
  }
}

// Nodes that say anything at all: the trace ends, reads nothing outside, and says where it could not finish.
TEST_P(WideExactTest, EndsOnDamagedFiles) {
  std::mt19937 random(5);
  lsp::Baked baked = bake_cells(sphere(12), 0);
  const std::vector<LspRay> rays = surface_rays(baked, 2000, 1);
  const std::vector<LspWideNode> nodes = baked.wide.nodes;
  for (int round = 0; round < 12; ++round) {
    baked.wide.nodes = nodes;
    auto* bytes = reinterpret_cast<uint8_t*>(baked.wide.nodes.data());
    const size_t size = baked.wide.nodes.size() * sizeof(LspWideNode);
    for (size_t k = 0; k < size / 64 + 1; ++k) bytes[random() % size] = static_cast<uint8_t>(random());
    // One that names itself, over and over, and one whose children's numbers begin again at zero.
    baked.wide.nodes[0].node_first = 0;
    baked.wide.nodes[1].node_first = ~0u;
    const lsp_scene scene = view(baked);
    std::vector<LspHit> hits(rays.size());
    for (const uint32_t any : {0u, LSP_TRACE_ANY_HIT}) {
      wide_.trace(scene, any, rays.data(), hits.data(), rays.size());
      for (const LspHit& hit : hits)
        ASSERT_TRUE(hit.primitive == LSP_NONE || hit.primitive < baked.header.primitive_count);
    }
  }
}

size_t compiled_exact() {
  size_t count = 0;
  while (kWideExact[count].name != nullptr) ++count;
  return count;
}
INSTANTIATE_TEST_SUITE_P(Sets, WideExactTest, testing::Range(size_t{0}, compiled_exact()),
                         [](const auto& of) {
                           std::string name = kWideExact[of.param].name;
                           std::erase(name, '-');
                           return name;
                         });

size_t compiled() {
  size_t count = 0;
  while (kWideCells[count].name != nullptr) ++count;
  return count;
}
INSTANTIATE_TEST_SUITE_P(Sets, WideCellsTest, testing::Range(size_t{0}, compiled()), [](const auto& of) {
  std::string name = kWideCells[of.param].name;
  std::erase(name, '-');
  return name;
});

}  // namespace
}  // namespace lsp::test
