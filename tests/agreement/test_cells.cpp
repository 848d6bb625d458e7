// Cells: CPU and Vulkan give the same bits, tables alone answer most rays, the dial goes to near exact, and
// exact rays are those of a BVH.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <optional>

#include <tbb/global_control.h>

#include "bake.h"
#include "cells/cell_grid.h"
#include "hard_rays.h"
#include "lsp/lsp.h"
#include "lsp/lsp_vulkan.h"
#include "lsp/program.h"
#include "lsp/scene_file.hpp"
#include "lsp/vulkan_device.hpp"
#include "meshes.h"
#include "surface_rays.h"
#include "temporary_folder.h"
#include "traced.h"
#include "view_rays.h"
#include "writer.h"

namespace lsp::test {
namespace {

void add_walls(Mesh& mesh) {
  for (int axis = 0; axis < 3; ++axis)
    for (const float side : {-2.5f, 2.5f}) {
      const auto corner = [&](float u, float v) {
        glm::vec3 p;
        p[axis] = side;
        p[(axis + 1) % 3] = u;
        p[(axis + 2) % 3] = v;
        return p;
      };
      const glm::vec3 a = corner(-2.5f, -2.5f), b = corner(2.5f, -2.5f), c = corner(2.5f, 2.5f),
                      d = corner(-2.5f, 2.5f);
      if (side > 0) {
        add_triangle(mesh, a, c, b);
        add_triangle(mesh, a, d, c);
      } else {
        add_triangle(mesh, a, b, c);
        add_triangle(mesh, a, c, d);
      }
    }
}

// A ball in a room of single-sheet walls.
Mesh room() {
  Mesh mesh = sphere(24);
  add_walls(mesh);
  return mesh;
}

BakeOptions options_of_cells() {
  BakeOptions options;
  options.base = Base::kCells;
  options.cells = 8;
  return options;
}

// Of all tests; writing it completes its header.
lsp::Baked& baked_room() {
  static lsp::Baked baked = bake(room(), options_of_cells());
  return baked;
}

lsp_trace_options tables_but(float max_loss, uint32_t flags = 0) {
  return {LSP_TRACE_APPROXIMATE | LSP_TRACE_MAX_LOSS | flags, 0, 0, max_loss};
}

double wrong_share(const std::vector<LspHit>& answers, const std::vector<LspHit>& truth) {
  size_t wrong = 0;
  for (size_t i = 0; i < truth.size(); ++i)
    wrong += (answers[i].primitive == LSP_NONE) != (truth[i].primitive == LSP_NONE);
  return double(wrong) / double(truth.size());
}

TEST(Cells, DialGoesFromTablesAloneToNearExact) {
  const lsp_scene scene = view(baked_room());
  const std::vector<LspRay> rays = surface_rays(baked_room(), 8192, 4);
  const auto truth = trace(scene, {0, 0}, rays);
  double before = 1;
  uint64_t calls_before = 0;
  for (const float loss : {100.0f, 10.0f, 2.0f, 0.0f}) {
    lsp_trace_counts counts{};
    const double wrong = wrong_share(trace(scene, tables_but(loss), rays, &counts), truth);
    EXPECT_LE(wrong, before + 0.001) << loss;
    EXPECT_GE(counts.exact, calls_before) << loss;
    before = wrong;
    calls_before = counts.exact;
    if (loss == 100) {
      EXPECT_LT(wrong, 0.05);
      EXPECT_EQ(counts.exact, 0u);
      EXPECT_EQ(counts.triangles, 0u);
    }
    if (loss == 0) {
      EXPECT_LT(wrong, 0.002);
    }
    EXPECT_EQ(counts.rays, rays.size());
    EXPECT_GT(counts.shafts, 0u);
  }
}

TEST(Cells, QualitiesErrAsTheBakePromises) {
  const lsp_scene scene = view(baked_room());
  const std::vector<LspRay> rays = surface_rays(baked_room(), 20000, 1);
  const auto truth = trace(scene, {0, 0}, rays);
  const double fast = wrong_share(trace(scene, {LSP_TRACE_APPROXIMATE, 0, LSP_QUALITY_FAST}, rays), truth);
  const double balanced =
      wrong_share(trace(scene, {LSP_TRACE_APPROXIMATE, 0, LSP_QUALITY_BALANCED}, rays), truth);
  const double accurate =
      wrong_share(trace(scene, {LSP_TRACE_APPROXIMATE, 0, LSP_QUALITY_ACCURATE}, rays), truth);
  EXPECT_LE(balanced, 0.012);
  EXPECT_LE(accurate, 0.006);
  EXPECT_LE(balanced, fast);
}

size_t leaving(const std::vector<LspHit>& hits) {
  return size_t(
      std::count_if(hits.begin(), hits.end(), [](const LspHit& h) { return h.primitive == LSP_NONE; }));
}

// A scene whose cells say that every way leads to the sky.
class Open {
 public:
  explicit Open(const lsp::Baked& baked) : cells_(baked.cell_tables.cells), scene_(view(baked)) {
    for (LspFilledCell& cell : cells_) cell.closed = 0;
    scene_.filled_cells = cells_.data();
  }
  const lsp_scene& scene() const { return scene_; }

 private:
  std::vector<LspFilledCell> cells_;
  lsp_scene scene_;
};

// All rays begin within its walls, which are single triangles: the tables know what lies on both sides of
// them.
TEST(Cells, AClosedRoomKeepsItsRays) {
  const std::vector<LspRay> rays = surface_rays(baked_room(), 12500, 8);
  ASSERT_EQ(leaving(trace(view(baked_room()), {0, 0}, rays)), 0u);
  EXPECT_EQ(leaving(trace(view(baked_room()), tables_but(0), rays)), 0u);
  const Open open(baked_room());
  EXPECT_GT(leaving(trace(open.scene(), tables_but(20), rays)), rays.size() / 1000) << "nothing to prevent";
  EXPECT_LE(leaving(trace(view(baked_room()), tables_but(20), rays)), rays.size() / 10000);
  const lsp_trace_options balanced{LSP_TRACE_APPROXIMATE, 0, LSP_QUALITY_BALANCED, 0};
  EXPECT_LE(leaving(trace(view(baked_room()), balanced, rays)), rays.size() / 10000);
}

// A ray from the ball that ends before the walls has not left the room.
TEST(Cells, ShortRaysOfAClosedRoomAreNotTracedAgain) {
  std::vector<LspRay> rays = surface_rays(baked_room(), 40000, 1);
  std::erase_if(rays, [](const LspRay& r) {
    return std::max({std::fabs(r.origin.x), std::fabs(r.origin.y), std::fabs(r.origin.z)}) > 1.1f;
  });
  for (LspRay& r : rays) r.tmax = 0.2f;
  const Open open(baked_room());
  lsp_trace_counts with{}, without{};
  EXPECT_TRUE(same_bits(trace(view(baked_room()), tables_but(20), rays, &with),
                        trace(open.scene(), tables_but(20), rays, &without)));
  EXPECT_GT(rays.size(), 1000u);
  EXPECT_EQ(with.exact, without.exact);
}

// Rays from a ball that nothing surrounds leave the scene, and nobody doubts it.
TEST(Cells, WaysToTheSkyAreOpen) {
  const lsp::Baked ball = bake(sphere(24), options_of_cells());
  const Open open(ball);
  const std::vector<LspRay> rays = surface_rays(ball, 20000, 1);
  lsp_trace_counts with{}, without{};
  trace(view(ball), tables_but(20), rays, &with);
  trace(open.scene(), tables_but(20), rays, &without);
  EXPECT_GE(with.exact, without.exact);
  EXPECT_LE(with.exact - without.exact, rays.size() / 20);
}

TEST(Cells, ExactRaysAreThoseOfABvh) {
  BakeOptions options;
  options.line_spaces = false;
  const lsp::Baked bvh = bake(room(), options);
  const std::vector<LspRay> rays = hard_rays(bvh.triangles, 5000, 3);
  EXPECT_TRUE(same_bits(trace(view(baked_room()), {0, 0}, rays), trace(view(bvh), {0, 0}, rays)));
}

// The room with walls of different colours and a striped floor, whose stripes lie in one plane, and a ball
// with smooth normals: tables alone answer with surfaces that look right, too.
TEST(Cells, AnswersLookRight) {
  Mesh mesh = sphere(24);
  const size_t ball = mesh.triangles.size();
  for (size_t t = 0; t < ball; ++t)
    for (int k = 0; k < 3; ++k)
      mesh.normals[t][size_t(k)] = glm::normalize(mesh.positions[mesh.triangles[t][k]]);
  add_walls(mesh);
  mesh.materials.clear();
  for (const glm::vec3 color : {glm::vec3(0.5f), glm::vec3(0.9f, 0.1f, 0.1f), glm::vec3(0.1f, 0.2f, 0.9f)})
    mesh.materials.emplace_back().base_color = color;
  for (size_t t = ball; t < mesh.triangles.size(); ++t) mesh.material_ids[t] = uint32_t((t - ball) / 2 % 3);
  constexpr int kStripes = 16;
  const float floor = -2.4f, width = 5.0f / kStripes;
  for (int i = 0; i < kStripes; ++i) {
    const float x = -2.5f + width * float(i);
    const glm::vec3 a(x, -2.5f, floor), b(x + width, -2.5f, floor), c(x + width, 2.5f, floor),
        d(x, 2.5f, floor);
    add_triangle(mesh, a, b, c);
    add_triangle(mesh, a, c, d);
    mesh.material_ids.end()[-1] = mesh.material_ids.end()[-2] = uint32_t(1 + i % 2);
  }
  const lsp::Baked baked = bake(mesh, options_of_cells());
  const lsp_scene scene = view(baked);
  const std::vector<LspRay> rays = seen_rays(baked, 4096, 8);
  const std::vector<LspHit> truth = trace(scene, {0, 0, 0, 0}, rays);
  const std::vector<LspHit> answers = trace(scene, tables_but(100), rays);
  std::vector<uint32_t> material(baked.header.primitive_count);
  for (const LspTriangle& t : baked.triangles) material[t.primitive] = t.material;
  size_t both = 0, wrong_color = 0, wrong_normal = 0, balls = 0;
  for (size_t i = 0; i < rays.size(); ++i) {
    if (truth[i].primitive == LSP_NONE || answers[i].primitive == LSP_NONE) continue;
    ++both;
    wrong_color += material[truth[i].primitive] != material[answers[i].primitive];
    if (truth[i].primitive >= ball || answers[i].primitive >= ball) continue;
    ++balls;
    const lsp_float3 &n = truth[i].normal, &m = answers[i].normal;
    wrong_normal += n.x * m.x + n.y * m.y + n.z * m.z < 0.966f;  // 15 degrees
  }
  const double color_share = double(wrong_color) / double(both),
               normal_share = double(wrong_normal) / double(balls);
  EXPECT_GT(both, 20000u);
  EXPECT_GT(balls, 1000u);
  EXPECT_LT(color_share, 0.02);
  EXPECT_LT(normal_share, 0.05);
}

TEST(Cells, ViewsLookAtFrontsFromWithin) {
  constexpr uint32_t kViews = 12, kSide = 8, kPerPoint = 4;
  const ViewRays seen = view_rays(baked_room(), kViews, kSide, kPerPoint);
  ASSERT_EQ(seen.views.size(), kViews);
  size_t points = 0;
  for (const View& v : seen.views) {
    EXPECT_EQ(v.first, points);
    EXPECT_EQ(v.pixels, kSide * kSide);
    EXPECT_GE(2 * v.count, v.pixels) << "mostly surfaces";
    EXPECT_LE(v.count, v.pixels);
    points += v.count;
  }
  ASSERT_EQ(seen.rays.size(), points * kPerPoint);
  // The walls face the room's inside: from without, where a third of the eyes were tried, nobody sees it.
  for (const LspRay& r : seen.rays)
    for (const float x : {r.origin.x, r.origin.y, r.origin.z}) ASSERT_LE(std::fabs(x), 2.5f);
  const ViewRays again = view_rays(baked_room(), kViews, kSide, kPerPoint);
  ASSERT_EQ(again.rays.size(), seen.rays.size());
  EXPECT_EQ(std::memcmp(again.rays.data(), seen.rays.data(), seen.rays.size() * sizeof(LspRay)), 0);
}

// Who stands in a room sees all of its walls, however they are wound.
TEST(Cells, RoomsOfCarelessWindingAreSeenFromWithin) {
  Mesh mesh = room();
  for (size_t i = mesh.triangles.size() - 8; i < mesh.triangles.size(); ++i)  // the walls across y and z
    std::swap(mesh.triangles[i].x, mesh.triangles[i].y);
  const lsp::Baked turned = bake(mesh, options_of_cells());
  const auto on_turned_walls_within = [](const std::vector<LspRay>& rays) {
    return std::count_if(rays.begin(), rays.end(), [](const LspRay& r) {
      const float y = std::fabs(r.origin.y), z = std::fabs(r.origin.z);
      return std::fabs(r.origin.x) < 2.499f && std::max(y, z) > 2.49f && std::max(y, z) < 2.5f;
    });
  };
  const std::vector<LspRay> seen = seen_rays(turned, 1024, 4), views = view_rays(turned, 12, 8, 4).rays;
  EXPECT_GT(on_turned_walls_within(seen), ptrdiff_t(seen.size() / 4));
  EXPECT_GT(on_turned_walls_within(views), ptrdiff_t(views.size() / 8));
}

// From the inside of a ball nobody looks.
TEST(Cells, ClosedObjectsAreSeenFromWithout) {
  const lsp::Baked ball = bake(sphere(24), options_of_cells());
  for (const auto& rays : {seen_rays(ball, 1024, 4), view_rays(ball, 12, 8, 4).rays}) {
    EXPECT_GT(rays.size(), 1000u);
    EXPECT_EQ(leaving(trace(view(ball), {0, 0}, rays)), rays.size());
  }
}

TEST(Cells, AnswersLieInTheInterval) {
  const lsp_scene scene = view(baked_room());
  std::vector<LspRay> rays = surface_rays(baked_room(), 4000, 1);
  for (size_t i = 0; i < rays.size(); ++i) {
    rays[i].tmin = 0.1f * static_cast<float>(i % 7);
    rays[i].tmax = 0.3f + 0.5f * static_cast<float>(i % 5);
  }
  for (const float loss : {100.0f, 0.0f})
    for (const uint32_t any : {0u, LSP_TRACE_ANY_HIT}) {
      const auto hits = trace(scene, tables_but(loss, any), rays);
      for (size_t i = 0; i < rays.size(); ++i)
        EXPECT_TRUE(hits[i].primitive == LSP_NONE || (hits[i].t > rays[i].tmin && hits[i].t < rays[i].tmax))
            << i;
    }
}

// Whether any hit is found is what closest rays say, but a table that is sure spares the cells before it
// their exact traces.
TEST(Cells, AnyHitAsksTheTablesFirst) {
  const auto expect_as_closest = [](const lsp_scene& scene, const std::vector<LspRay>& rays, float max_loss,
                                    double share) {
    lsp_trace_counts closest{}, any{};
    const auto nearest = trace(scene, tables_but(max_loss), rays, &closest);
    const auto hits = trace(scene, tables_but(max_loss, LSP_TRACE_ANY_HIT), rays, &any);
    EXPECT_EQ(wrong_share(hits, nearest), 0.0) << max_loss;
    EXPECT_GT(closest.exact, rays.size() / 10) << "nothing to spare";
    EXPECT_LT(double(any.exact), share * double(closest.exact)) << max_loss;
  };
  std::vector<LspRay> rays = surface_rays(baked_room(), 20000, 1);
  for (const float loss : {20.0f, 5.0f, 1.0f}) expect_as_closest(view(baked_room()), rays, loss, 0.7);
  // They are too short for that.
  for (LspRay& r : rays) r.tmax = 0.3f;
  expect_as_closest(view(baked_room()), rays, 0, 1.01);
  BakeOptions options = options_of_cells();
  options.cells = 64;
  const lsp::Baked row = bake(row_of_soup(20), options);
  rays.clear();
  for (int i = 0; i < 4096; ++i) {
    const float y = float(i % 64) / 64, z = float(i / 64) / 64;
    rays.push_back({{-1, y, z}, 0, {1, 0.01f * (y - z), 0.02f * (z - 0.5f)}, INFINITY});
  }
  expect_as_closest(view(row), rays, 5, 1.0);
}

TEST(Cells, RaysFromOutsideAndFromEmptyCells) {
  const lsp_scene scene = view(baked_room());
  std::vector<LspRay> rays;
  for (const LspRay& r : surface_rays(baked_room(), 4000, 1)) {
    // Towards the same points from far outside, and from the middle between ball and wall.
    rays.push_back({{r.direction.x * 9, r.direction.y * 9, r.direction.z * 9},
                    0,
                    {-r.direction.x, -r.direction.y, -r.direction.z},
                    INFINITY});
    rays.push_back(
        {{1.7f * r.direction.x, 1.7f * r.direction.y, 1.7f * r.direction.z}, 0, r.direction, INFINITY});
  }
  const auto truth = trace(scene, {0, 0}, rays);
  EXPECT_LT(wrong_share(trace(scene, tables_but(0), rays), truth), 0.005);
  EXPECT_LT(wrong_share(trace(scene, tables_but(100), rays), truth), 0.05);
}

// Probes of light and cameras stand where no surface is, in cells that hold some.
TEST(Cells, RaysFromWhereNoSurfaceIs) {
  const lsp_scene scene = view(baked_room());
  std::vector<LspRay> rays = surface_rays(baked_room(), 8000, 1);
  uint32_t state = 1;
  const auto next = [&] {
    state = state * 1664525u + 1013904223u;
    return float(state >> 8) * 0x1p-24f;
  };
  for (LspRay& r : rays) {
    glm::vec3 p;
    do p = 4.8f * glm::vec3(next(), next(), next()) - 2.4f;
    while (glm::length(p) < 1.1f);
    r.origin = {p.x, p.y, p.z};
  }
  const auto truth = trace(scene, {0, 0}, rays);
  const auto wrong = [&](const lsp_trace_options& options) {
    return wrong_share(trace(scene, options, rays), truth);
  };
  EXPECT_LT(wrong({LSP_TRACE_APPROXIMATE, 0, LSP_QUALITY_BALANCED}), 0.025);
  EXPECT_LT(wrong({LSP_TRACE_APPROXIMATE, 0, LSP_QUALITY_ACCURATE}), 0.015);
  EXPECT_LT(wrong(tables_but(100)), 0.03);

  // The corner of all eight cells of an empty box.
  Mesh walls;
  add_walls(walls);
  BakeOptions options = options_of_cells();
  options.cells = 2;
  const lsp::Baked box = bake(walls, options);
  for (LspRay& r : rays) r.origin = {0, 0, 0};
  for (const lsp_trace_options& o : {lsp_trace_options{LSP_TRACE_APPROXIMATE, 0}, tables_but(100)})
    EXPECT_LT(wrong_share(trace(view(box), o, rays), trace(view(box), {0, 0}, rays)), 0.01);
}

TEST(Cells, TablesAloneNeedNoTriangles) {
  lsp::Baked alone = bake(room(), options_of_cells());
  keep_tables_only(alone);
  EXPECT_EQ(alone.nodes.size() + alone.cell_tables.nodes.size() + alone.cell_tables.references.size(), 0u);
  const std::vector<LspRay> rays = surface_rays(baked_room(), 4000, 1);
  EXPECT_TRUE(same_bits(trace(view(alone), {LSP_TRACE_APPROXIMATE, 0}, rays),
                        trace(view(baked_room()), tables_but(100), rays)));
  lsp_error error;
  LspHit hit;
  const lsp_scene scene = view(alone);
  const lsp_trace_options exact{0, 0};
  EXPECT_EQ(lsp_trace(&scene, &exact, rays.data(), &hit, 1, nullptr, &error), LSP_ERROR_UNSUPPORTED);
}

TEST(Cells, SameTablesWithAnyNumberOfThreads) {
  const lsp::Baked& many = baked_room();
  const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
  const lsp::Baked single = bake(room(), options_of_cells());
  EXPECT_EQ(single.cell_tables.entries, many.cell_tables.entries);
  EXPECT_EQ(single.cell_grid.words, many.cell_grid.words);
  EXPECT_EQ(single.cell_tables.plane_records, many.cell_tables.plane_records);
  EXPECT_EQ(std::memcmp(single.header.quality, many.header.quality, sizeof many.header.quality), 0);
}

// A tree of a cell names 8,191 triangles: with more the bake takes finer cells or says so.
// A damaged tree whose nodes name each other, and whose record allows any number of steps.
TEST(Cells, CallsEndInTreesWithoutEnd) {
  lsp::Baked baked = bake(sphere(12), options_of_cells());
  for (LspCellNode& n : baked.cell_tables.nodes) n = {0xFF000000u, 0x0000FFFFu, 0xFFFFFF00u, 0};
  for (LspFilledCell& c : baked.cell_tables.cells) {
    c.max_steps = UINT32_MAX;
    if (c.root < LSP_CELL_LEAF_BIT) c.root = 0;
  }
  const std::vector<LspRay> rays = surface_rays(baked, 20, 1);
  lsp_trace_counts counts{};
  trace(view(baked), tables_but(0), rays, &counts);  // one by one
  EXPECT_GT(counts.exact_nodes, uint64_t{LSP_CELL_LEAF_BIT});
  EXPECT_LE(counts.exact_nodes, uint64_t{LSP_CELL_LEAF_BIT} * counts.exact);
  trace(view(baked), tables_but(0), rays);  // in lanes
}

TEST(Cells, ACrowdedCellIsDividedOrRefused) {
  Mesh mesh = sphere(72);  // 20,448 triangles
  add_triangle(mesh, {200, 0, 0}, {200, 1, 0}, {200, 0, 1});
  BakeOptions options = options_of_cells();
  try {
    bake(mesh, options);
    FAIL() << "8 cells hold the sphere in one or two of them";
  } catch (const Failure& f) {
    EXPECT_EQ(f.exit(), Exit::kLimit);
    const std::string what = f.what(), remedy = ": give --cells ";
    ASSERT_NE(what.find(remedy), std::string::npos) << what;
    options.cells = uint32_t(std::stoul(what.substr(what.find(remedy) + remedy.size())));
  }
  for (const Cell& cell : bake(mesh, options).cell_grid.cells) EXPECT_LE(cell.count, kMostInCell);
  options.cells = 0;
  const lsp::Baked chosen = bake(mesh, options);
  for (const Cell& cell : chosen.cell_grid.cells) EXPECT_LE(cell.count, kMostInCell);
}

// No grid divides a heap of triangles in one place: that is said soon, not after grids of a thousand cells.
TEST(Cells, AHeapInOnePlaceIsRefused) {
  Mesh mesh;
  for (uint32_t i = 0; i < LSP_CELL_MAX_REFERENCES; ++i) add_triangle(mesh, {0, 0, 0}, {1, 0, 0}, {0, 1, 0});
  add_triangle(mesh, {500, 500, 500}, {500, 501, 500}, {500, 500, 501});
  BakeOptions options = options_of_cells();
  options.cells = 0;
  try {
    bake(mesh, options);
    FAIL() << "a cell holds them all";
  } catch (const Failure& f) {
    EXPECT_EQ(f.exit(), Exit::kLimit);
  }
}

// A bake as a file, for as long as this lives; writing it completes the bake's header.
class Written {
 public:
  explicit Written(lsp::Baked& baked) : file_(write(baked)) {}
  const lsp_scene& scene() const { return file_.scene(); }

 private:
  std::string write(lsp::Baked& baked) {
    const std::string path = (folder_.path() / "room.lsp").string();
    write_lsp(path, baked, "{}", {});
    return path;
  }
  TemporaryFolder folder_;
  SceneFile file_;
};

class CellsOnVulkan : public testing::TestWithParam<uint32_t> {};

TEST_P(CellsOnVulkan, SameBits) {
  std::string why;
  if (!VulkanTracer::available(&why)) GTEST_SKIP() << why;
  lsp::Baked& baked = baked_room();
  const Written file(baked);
  std::vector<LspRay> rays = surface_rays(baked, 12000, 1);
  const std::vector<LspRay> hard = hard_rays(baked.triangles, 2600, 3);
  rays.insert(rays.end(), hard.begin(), hard.end());
  std::vector<LspHit> gpu(rays.size());
  VulkanTracer tracer;
  tracer.load(file.scene(), LSP_USE_APPROXIMATE | LSP_USE_EXACT | GetParam());
  std::vector<lsp_trace_options> all = {{0, 0}, {LSP_TRACE_ANY_HIT, 0}};
  for (const uint32_t quality : {LSP_QUALITY_FAST, LSP_QUALITY_BALANCED, LSP_QUALITY_ACCURATE})
    all.push_back({LSP_TRACE_APPROXIMATE, 0, quality});
  for (const float loss : {0.0f, 5.0f, 100.0f})
    for (const uint32_t any : {0u, LSP_TRACE_ANY_HIT}) all.push_back(tables_but(loss, any));
  for (const lsp_trace_options& options : all) {
    lsp_trace_counts counts{};
    const auto cpu = trace(file.scene(), options, rays, &counts);
    const VulkanTrace traced = tracer.trace(options, rays, gpu, true);
    EXPECT_TRUE(same_bits(cpu, gpu)) << options.flags << " " << options.max_loss;
    EXPECT_FALSE(traced.passes);
    EXPECT_EQ(traced.counts.nodes, counts.nodes);
    EXPECT_EQ(traced.counts.shafts, counts.shafts);
    EXPECT_EQ(traced.counts.splits, counts.splits);
    EXPECT_EQ(traced.counts.exact, counts.exact);
    EXPECT_EQ(traced.counts.triangles, counts.triangles);
    const bool exactly = (options.flags & LSP_TRACE_APPROXIMATE) != 0 && counts.exact > 0;
    const VulkanTrace in_passes = tracer.trace(options, rays, gpu);
    EXPECT_TRUE(same_bits(cpu, gpu)) << options.flags << " " << options.max_loss;
    EXPECT_EQ(in_passes.passes, exactly);
    EXPECT_EQ(in_passes.retraced, 0u);
    if ((options.flags & LSP_TRACE_ANY_HIT) == 0) continue;
    lsp_trace_options occlusion = options;
    occlusion.flags = (options.flags & ~LSP_TRACE_ANY_HIT) | LSP_TRACE_OCCLUSION;
    EXPECT_EQ(tracer.trace(occlusion, rays, gpu, true).counts.hits, counts.hits);
    const auto asked = trace(file.scene(), occlusion, rays);
    for (size_t i = 0; i < rays.size(); ++i) {
      ASSERT_EQ(gpu[i].t, cpu[i].t) << i;
      ASSERT_EQ(asked[i].t, cpu[i].t) << i;
    }
  }
}

// Rays that wait in a list for the next pass: of any number, in batches on a discrete device, with nothing
// for the validation layer to say, more often than there are passes (every cell exactly).
TEST(CellsInPasses, AnyNumberOfRays) {
  std::string why;
  if (!VulkanTracer::available(&why)) GTEST_SKIP() << why;
  lsp::Baked& baked = baked_room();
  const Written file(baked);
  std::vector<LspRay> all = surface_rays(baked, 700, 1);
  const std::vector<LspRay> hard = hard_rays(baked.triangles, 300, 3);  // some of them invalid
  all.insert(all.end(), hard.begin(), hard.end());
  for (const bool discrete : {false, true}) {
    VulkanOptions options;
    options.discrete = discrete;
    options.passes_from = 1;
    options.validation = true;
    std::optional<VulkanTracer> made;
    try {
      made.emplace(options);
    } catch (const Failure&) {  // the layer is not here
      options.validation = false;
      made.emplace(options);
    }
    VulkanTracer& tracer = *made;
    tracer.load(file.scene(), LSP_USE_APPROXIMATE);
    for (const float loss : {0.0f, 5.0f}) {
      for (const size_t count : {size_t{1}, size_t{63}, size_t{64}, size_t{65}, all.size(), size_t{7}}) {
        const std::vector<LspRay> rays(all.end() - static_cast<std::ptrdiff_t>(count), all.end());
        const lsp_trace_options asked = tables_but(loss, 0);
        std::vector<LspHit> gpu(count);
        EXPECT_TRUE(tracer.trace(asked, rays, gpu).passes);
        EXPECT_TRUE(same_bits(trace(file.scene(), asked, rays), gpu)) << count << " rays, " << loss;
      }
    }
    for (const std::string& message : tracer.validation_messages()) ADD_FAILURE() << message;
  }
}

// Tables that say anything at all.
TEST(CellsInPasses, SameBitsOfDamagedFiles) {
  std::string why;
  if (!VulkanTracer::available(&why)) GTEST_SKIP() << why;
  lsp::Baked damaged = bake(room(), options_of_cells());
  const std::vector<LspRay> rays = surface_rays(damaged, 5000, 1);
  Random random(5);
  for (uint32_t& two : damaged.cell_tables.entries)
    if (random.below(8) == 0) two = random.next();
  for (LspSplit& split : damaged.cell_tables.splits)
    if (random.below(8) == 0) split = {random.next(), random.next()};
  const Written file(damaged);
  std::vector<LspHit> one(rays.size()), passes(rays.size());
  VulkanOptions options;
  options.passes_from = 1;
  VulkanTracer tracer(options);
  tracer.load(file.scene(), LSP_USE_APPROXIMATE);
  for (const float loss : {0.0f, 5.0f}) {
    tracer.trace(tables_but(loss), rays, one, true);
    EXPECT_TRUE(tracer.trace(tables_but(loss), rays, passes).passes);
    EXPECT_TRUE(same_bits(one, passes)) << loss;
  }
}

INSTANTIATE_TEST_SUITE_P(Loads, CellsOnVulkan, testing::Values(0u, LSP_USE_ADDRESSES_ALWAYS));

}  // namespace
}  // namespace lsp::test
