#include "bake.h"

#include <tbb/global_control.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <bit>
#include <chrono>
#include <cmath>

#include "box.h"
#include "cells/dial.h"
#include "lsp/program.h"
#include "lsp/sections.h"
#include "normals.h"
#include "sites.h"
#include "vectors.h"

namespace lsp {
namespace {

double seconds_since(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

// Whether every corner normal is its triangle's geometric one: then the reader can do without.
bool normals_are_geometric(const Mesh& mesh) {
  for (size_t i = 0; i < mesh.triangles.size(); ++i) {
    const glm::uvec3 t = mesh.triangles[i];
    const glm::dvec3 a = mesh.positions[t.x], b = mesh.positions[t.y], c = mesh.positions[t.z];
    const glm::vec3 n(glm::normalize(glm::cross(b - a, c - a)));
    for (const glm::vec3& corner : mesh.normals[i])
      if (!(glm::dot(corner, n) > 0.999999f)) return false;
  }
  return true;
}

// The gaps of a triangle of which this share is solid. What lacks less than half a step of eight bits, in
// which textures have it, lacks nothing.
uint32_t gaps_of(float coverage) {
  const double missing = 1 - double(coverage);
  if (!(missing > 1.0 / 512)) return 0;
  return uint32_t(std::min(std::lround(missing * 65536), long{LSP_TRIANGLE_MAX_GAPS}));
}

void fill_triangles(const Mesh& mesh, const Bvh& bvh, bool normals, bool materials, Baked& baked) {
  baked.triangles.resize(bvh.records.size());
  if (normals) baked.normals.resize(bvh.records.size());
  for (size_t i = 0; i < bvh.records.size(); ++i) {
    const uint32_t t = bvh.records[i];
    const glm::uvec3 corners = mesh.triangles[t];
    uint32_t flags = gaps_of(mesh.materials[mesh.material_ids[t]].opacity) << LSP_TRIANGLE_GAPS_SHIFT;
    if (normals) {
      const auto& n = mesh.normals[t];
      const LspCornerNormals packed = {pack_normal(n[0]), pack_normal(n[1]), pack_normal(n[2])};
      if (packed.n0 != packed.n1 || packed.n0 != packed.n2) flags |= LSP_TRIANGLE_SMOOTH;
      baked.normals[i] = packed;
    }
    baked.triangles[i] = {f3(mesh.positions[corners.x]), mesh.primitives[t],
                          f3(mesh.positions[corners.y]), materials ? mesh.material_ids[t] : 0,
                          f3(mesh.positions[corners.z]), flags};
  }
}

void set_base(const Bvh& bvh, LspHeader& h) {
  h.base_structure = LSP_BASE_BVH;
  h.root = bvh.root;
  h.max_depth = bvh.max_depth;
  h.max_stack = std::max(1u, bvh.max_depth);
  h.max_steps = uint32_t(bvh.nodes.size()) + bvh.leaf_count + 1;
  h.max_leaf_triangles = bvh.max_leaf_triangles;
}

void set_base(const NTree& ntree, LspHeader& h) {
  h.base_structure = LSP_BASE_NTREE;
  h.root = ntree.node_count ? 0 : LSP_NONE;
  h.max_depth = h.max_stack = h.ntree_depth = std::max(1u, ntree.levels);
  h.max_leaf_triangles = ntree.max_leaf_triangles;
  h.ntree_branching = ntree.branching;
  h.ntree_lo = ntree.lo;
  h.ntree_size = ntree.size;
  h.ntree_margin = ntree.margin;
}

// The bake's largest arrays at their largest.
struct Estimate {
  uint64_t scene;        // the program, the mesh, the tree with its references in flight, the sections
  uint64_t line_spaces;  // all of them
  uint64_t in_flight;    // Line Spaces that are being filled, whatever their number
};

Estimate estimate_bytes(const Mesh& mesh, const BakeOptions& options, uint64_t batch_bytes) {
  constexpr uint64_t kProgram = 16u << 20;
  const uint64_t triangles = mesh.triangles.size();
  const uint64_t input = mesh.positions.size() * 12 + triangles * (12 + 4 + 36 + 4);
  const uint64_t tree = triangles * (32 * 3 + 120) + triangles * (64 + 48 * 2 + 12);
  if (!options.line_spaces) return {kProgram + input + tree, 0, 0};
  uint64_t sites = 0;
  const uint64_t b = options.ntree.branching;
  for (uint32_t d : options.line_space.depths) {
    const uint64_t nodes =
        options.base == Base::kNTree ? (d < 2 ? (d ? b * b * b : 1) : 1ull << 40) : 1ull << std::min(d, 40u);
    sites += std::min<uint64_t>(nodes, triangles / 4 + 1);
  }
  const uint64_t n = options.line_space.resolution, shafts = 30 * n * n * n * n;
  const uint64_t threads =
      std::min(uint64_t(tbb::this_task_arena::max_concurrency()),
               uint64_t(tbb::global_control::active_value(tbb::global_control::max_allowed_parallelism)));
  return {kProgram + input + tree, sites * shafts * 5 / 2,
          std::min(sites * shafts * 5, batch_bytes) + threads * shafts * 10};
}

// Decides where the Line Spaces are kept so that the memory limit holds.
void plan_memory(const Mesh& mesh, BakeOptions& options) {
  if (!options.memory_limit) return;
  const uint64_t limit = options.memory_limit;
  options.line_space.batch_bytes = std::min(options.line_space.batch_bytes, limit / 8);
  const Estimate e = estimate_bytes(mesh, options, options.line_space.batch_bytes);
  const bool spill = e.scene + e.line_spaces + e.in_flight > limit && !options.folder.empty();
  if (spill) options.line_space.folder = options.folder;
  const uint64_t needed = e.scene + e.in_flight + (spill ? 0 : e.line_spaces);
  if (needed > limit)
    throw Failure(Exit::kLimit, "",
                  "the bake needs about " + with_commas(needed >> 20) + " MiB, over the limit of " +
                      with_commas(limit >> 20) +
                      " MiB: raise --memory-limit, or lower --depth or --resolution");
}

void fill_cells(Baked& baked, const Bvh& bvh, const Box& bounds, const BakeOptions& options,
                const std::function<void(double)>& progress) {
  LspHeader& h = baked.header;
  h.base_structure = LSP_BASE_CELLS;
  baked.cell_grid = options.cells ? build_cell_grid(baked.triangles, bounds, options.cells)
                                  : choose_cell_grid(baked.triangles, bounds);
  baked.cell_tables =
      fill_cell_tables(baked.cell_grid, bvh, h, baked.triangles, options.cell_tables, progress);
  set_cells(baked.cell_grid, baked.cell_tables, options.cell_tables, h);
  const size_t cells = baked.cell_grid.words.size();
  baked.skipped.push_back("empty cells: " + with_commas(cells - baked.cell_tables.cells.size()) + " of " +
                          with_commas(cells));
}

}  // namespace

std::string with_commas(uint64_t n) {
  std::string reversed;
  do {
    if (reversed.size() % 4 == 3) reversed += ',';
    reversed += char('0' + n % 10);
    n /= 10;
  } while (n);
  return {reversed.rbegin(), reversed.rend()};
}

lsp_scene view(const Baked& baked) {
  const SectionArrays arrays{baked};
  lsp_scene scene{};
  scene.header = &baked.header;
#define LSP_ARRAY_SECTION(Name, TYPE, code, Element, flag, base, feature, owed, member, ...) \
  scene.member = arrays.member.size() == 0 ? nullptr : arrays.member.data();
#include "lsp/sections.def"
  return scene;
}

void set_counts(Baked& baked) {
  LspHeader& h = baked.header;
  format::set_counters(h, SectionArrays{baked});
  const bool partial = std::any_of(baked.triangles.begin(), baked.triangles.end(), has_gaps);
  h.required_features = (h.required_features & ~LSP_FEATURE_COVERAGE) | (partial ? LSP_FEATURE_COVERAGE : 0);
  if (!format::is_ntree(h)) return;
  const uint64_t steps = lsp_ntree_steps(&h);
  if (steps > LSP_NONE)
    throw Failure(Exit::kLimit, "",
                  "the NTree needs " + with_commas(steps) +
                      " steps of traversal, more than a file can state: lower --levels");
  h.max_steps = uint32_t(steps);
}

Baked bake(const Mesh& mesh, const BakeOptions& asked, const Progress& progress) {
  BakeOptions options = asked;
  plan_memory(mesh, options);
  const auto stage = [&](const char* name) {
    return [&progress, name](double done) {
      if (progress) progress(name, done);
    };
  };
  Baked baked;
  LspHeader& h = baked.header;

  // An NTree refers to triangles, so that none is repeated; the BVH then orders them and fills the Line
  // Spaces.
  const bool ntree = options.base == Base::kNTree;
  BvhOptions bvh_options = options.bvh;
  if (ntree) bvh_options.spatial_splits = false;
  auto start = std::chrono::steady_clock::now();
  Bvh bvh = build_bvh(mesh, bvh_options, stage("base structure"));
  baked.tree_seconds = seconds_since(start);

  const bool shading = options.purpose == Purpose::kDiffuse || options.purpose == Purpose::kGlossy ||
                       options.purpose == Purpose::kAll;
  bool normals = shading;
  if (!shading) {
    baked.skipped.push_back("normals: not asked for");
    baked.skipped.push_back("materials: not asked for");
  } else if (normals_are_geometric(mesh)) {
    normals = false;
    baked.skipped.push_back("normals: all are their triangle's own");
  }
  fill_triangles(mesh, bvh, normals, shading, baked);
  if (shading)
    for (const Material& m : mesh.materials)
      baked.materials.push_back({f3(m.base_color), m.opacity, f3(m.emission), m.roughness, m.metallic, {}});

  Box bounds;
  for (const LspTriangle& t : baked.triangles)
    for (const lsp_float3& v : {t.v0, t.v1, t.v2}) bounds.grow({v.x, v.y, v.z});
  h.bounds_min = f3(bounds.lo);
  h.bounds_max = f3(bounds.hi);
  h.primitive_count = mesh.primitive_count;
  h.origin_x = std::bit_cast<uint64_t>(mesh.origin.x);
  h.origin_y = std::bit_cast<uint64_t>(mesh.origin.y);
  h.origin_z = std::bit_cast<uint64_t>(mesh.origin.z);
  h.plane_tolerance = options.plane_tolerance;
  h.normal_angle_cos =
      options.normal_angle_degrees >= 180 ? -1.0f : std::cos(options.normal_angle_degrees * 0.017453293f);
  h.root_line_space = LSP_NONE;
  set_base(bvh, h);
  if (ntree) {
    start = std::chrono::steady_clock::now();
    NTreeOptions ntree_options = options.ntree;
    if (options.memory_limit) ntree_options.max_bytes = options.memory_limit / 4;
    baked.ntree = build_ntree(baked.triangles, ntree_options, stage("NTree"));
    set_base(baked.ntree, h);
    baked.tree_seconds += seconds_since(start);
  }

  const bool cells = options.base == Base::kCells;
  if (cells) {
    start = std::chrono::steady_clock::now();
    fill_cells(baked, bvh, bounds, options, stage("cells"));
    baked.line_space_seconds = seconds_since(start);
  } else if (options.line_spaces) {
    start = std::chrono::steady_clock::now();
    const std::vector<LineSpaceSite> sites = ntree ? choose_sites(baked.ntree, bvh, h, options.line_space)
                                                   : choose_sites(bvh, h, options.line_space);
    std::vector<uint32_t> references;
    baked.line_spaces = fill_line_spaces(bvh, h, baked.triangles, sites, options.line_space, references,
                                         stage("Line Spaces"));
    h.root_line_space = ntree ? attach(baked.ntree, sites, references) : attach(bvh, sites, references);
    baked.line_space_seconds = seconds_since(start);
    h.resolution = options.line_space.resolution;
    h.line_space_depth = options.line_space.depths.back();
    h.line_space_triangles = options.line_space.triangles;
    const LineSpaces& ls = baked.line_spaces;
    baked.skipped.push_back("empty shafts: " + with_commas(ls.shafts - ls.filled) + " of " +
                            with_commas(ls.shafts));
    if (ls.dropped) baked.skipped.push_back("Line Spaces without a filled shaft: " + with_commas(ls.dropped));
  } else {
    baked.skipped.push_back("Line Spaces: not asked for");
  }
  if (!ntree) baked.nodes = std::move(bvh.nodes);

  h.required_features = LSP_FEATURE_EXACT | (ntree ? LSP_FEATURE_NTREE : 0) |
                        (cells ? LSP_FEATURE_CELLS : 0) |
                        (baked.line_spaces.records.empty() ? 0 : LSP_FEATURE_LINE_SPACES) |
                        (normals ? LSP_FEATURE_NORMALS : 0) | (shading ? LSP_FEATURE_MATERIALS : 0) |
                        (std::any_of(baked.line_spaces.records.begin(), baked.line_spaces.records.end(),
                                     [](const LspLineSpace& r) { return entry_bytes(r) == 0; })
                             ? LSP_FEATURE_BINARY
                             : 0);
  set_counts(baked);
  if (cells) choose_dial(baked, options.cells_wrong);
  return baked;
}

}  // namespace lsp
