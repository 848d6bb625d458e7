#include "bake.h"

#include <tbb/global_control.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <bit>
#include <chrono>
#include <cmath>

#include "base_structure.h"
#include "lsp/program.h"
#include "normals.h"
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
  tbb::parallel_for(size_t(0), bvh.records.size(), [&](size_t i) {
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
  });
}

// What the header states of the BVH.
void set_bvh(const Bvh& bvh, LspHeader& h) {
  h.root = bvh.root;
  h.max_depth = bvh.max_depth;
  h.max_stack = std::max(1u, bvh.max_depth);
  h.max_steps = uint32_t(bvh.nodes.size()) + bvh.leaf_count + 1;
  h.max_leaf_triangles = bvh.max_leaf_triangles;
}

// What the header states of the scene and of how it is to be traced.
void set_scene(const Mesh& mesh, const BakeOptions& options, const Box& bounds, LspHeader& h) {
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
}

uint32_t features_of(const Baked& baked) {
  const std::vector<LspLineSpace>& spaces = baked.line_spaces.records;
  const bool binary =
      std::any_of(spaces.begin(), spaces.end(), [](const LspLineSpace& r) { return entry_bytes(r) == 0; });
  return LSP_FEATURE_EXACT | (spaces.empty() ? 0 : LSP_FEATURE_LINE_SPACES) |
         (baked.normals.empty() ? 0 : LSP_FEATURE_NORMALS) |
         (baked.materials.empty() ? 0 : LSP_FEATURE_MATERIALS) | (binary ? LSP_FEATURE_BINARY : 0) |
         (baked.wide.nodes.empty() ? 0 : LSP_FEATURE_WIDE);
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
  for (const uint32_t depth : options.line_space.depths)
    sites += std::min<uint64_t>(base_structure(options.base).nodes_at(options, depth), triangles / 4 + 1);
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
  const bool has_line_spaces =
      options.line_spaces && (options.base == Base::kBvh || options.base == Base::kNTree);
  if (needed > limit)
    throw Failure(Exit::kLimit, "",
                  "the bake needs about " + with_commas(needed >> 20) + " MiB, over the limit of " +
                      with_commas(limit >> 20) + " MiB: raise --memory-limit, or " +
                      (has_line_spaces ? "lower --depth or --resolution" : "split the mesh"));
}

}  // namespace

Baked bake(const Mesh& mesh, const BakeOptions& asked, const Progress& progress) {
  BakeOptions options = asked;
  plan_memory(mesh, options);
  const BaseStructure& base = base_structure(options.base);
  Baked baked;
  BakeJob job{options, progress, {}, {}, baked};
  auto start = std::chrono::steady_clock::now();
  const auto lap = [&start] { return seconds_since(std::exchange(start, std::chrono::steady_clock::now())); };

  BvhOptions bvh_options = options.bvh;
  bvh_options.spatial_splits = bvh_options.spatial_splits && base.repeats_triangles;
  job.bvh = build_bvh(mesh, bvh_options, job.stage("base structure"));
  if (base.has_wide_nodes) baked.wide = build_wide_tree(mesh, job.bvh);
  baked.tree_seconds = lap();

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
  fill_triangles(mesh, job.bvh, normals, shading, baked);
  if (shading)
    for (const Material& m : mesh.materials)
      baked.materials.push_back({f3(m.base_color), m.opacity, f3(m.emission), m.roughness, m.metallic, {}});
  for (const LspTriangle& t : baked.triangles)
    for (const lsp_float3& v : {t.v0, t.v1, t.v2}) job.bounds.grow({v.x, v.y, v.z});
  set_scene(mesh, options, job.bounds, baked.header);
  if (base.has_wide_nodes)
    set_wide(baked.wide, baked.header);
  else
    set_bvh(job.bvh, baked.header);
  if (base.has_wide_nodes) job.bvh = {};  // they stand for it

  lap();
  base.build(job);
  baked.tree_seconds += lap();
  base.fill(job);
  baked.line_space_seconds = lap();

  baked.header.required_features = features_of(baked) | base.feature;
  set_counts(baked);
  if (base.finish && options.finish) base.finish(job);
  return baked;
}

}  // namespace lsp
