#include "bake.h"

#include <algorithm>
#include <chrono>
#include <cmath>

#include "box.h"
#include "lsp/program.h"
#include "normals.h"

namespace lsp {
namespace {

lsp_float3 f3(const glm::vec3& v) { return {v.x, v.y, v.z}; }

double seconds_since(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

std::string with_commas(uint64_t n) {
  std::string reversed;
  do {
    if (reversed.size() % 4 == 3) reversed += ',';
    reversed += char('0' + n % 10);
    n /= 10;
  } while (n);
  return {reversed.rbegin(), reversed.rend()};
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

void fill_triangles(const Mesh& mesh, const Bvh& bvh, bool normals, bool materials, Baked& baked) {
  baked.triangles.resize(bvh.records.size());
  if (normals) baked.normals.resize(bvh.records.size());
  for (size_t i = 0; i < bvh.records.size(); ++i) {
    const uint32_t t = bvh.records[i];
    const glm::uvec3 corners = mesh.triangles[t];
    uint32_t flags = 0;
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

// The bake's largest arrays at their largest: the mesh, the tree with its references in flight, the sections.
uint64_t estimate_bytes(const Mesh& mesh, const BakeOptions& options) {
  const uint64_t triangles = mesh.triangles.size();
  const uint64_t input = mesh.positions.size() * 12 + triangles * (12 + 4 + 36 + 4);
  const uint64_t tree = triangles * (32 * 3 + 120) + triangles * (64 + 48 * 2 + 12);
  uint64_t line_spaces = 0;
  if (options.line_spaces) {
    uint64_t sites = 0;
    for (uint32_t d : options.line_space.depths)
      sites += std::min<uint64_t>(1ull << std::min(d, 40u), triangles / 4 + 1);
    const uint64_t n = options.line_space.resolution;
    line_spaces = sites * 30 * n * n * n * n * 5 / 2;
  }
  return input + tree + line_spaces;
}

// Keeps what an approximate trace reads: the nodes above the terminal Line Spaces and the triangles that some
// shaft refers to. Leaves above keep theirs.
class ApproximateOnly {
 public:
  explicit ApproximateOnly(Baked& baked) : baked_(baked) {
    referred_.assign(baked.triangles.size(), false);
    place_.assign(baked.triangles.size(), LSP_NONE);
    for (size_t i = 0; i < baked.line_spaces.records.size(); ++i) mark(i);
  }

  void run() {
    baked_.header.root = copy(baked_.header.root, baked_.header.root_line_space, 0);
    LspHeader& h = baked_.header;
    h.max_steps = uint32_t(nodes_.size()) + ends_ + 1;
    h.max_depth = depth_;
    h.max_stack = std::max(1u, depth_);
    h.max_leaf_triangles = max_leaf_;
    baked_.nodes = std::move(nodes_);
    baked_.triangles = std::move(triangles_);
    baked_.normals = std::move(normals_);
  }

 private:
  uint32_t entry_bytes(const LspLineSpace& r) const {
    return r.format >> LSP_FORMAT_ENTRY_SHIFT & LSP_FORMAT_ENTRY_MASK;
  }

  template <typename F>
  void for_each_entry(const LspLineSpace& r, F&& f) {
    const uint32_t bytes = entry_bytes(r);
    if (bytes == 0) return;
    const uint32_t n = r.format & LSP_FORMAT_RESOLUTION_MASK;
    const bool dense = r.format & LSP_FORMAT_DENSE;
    const uint32_t entries = dense ? 30 * n * n * n * n : r.filled;
    const uint32_t mask = bytes == 4 ? LSP_NONE : (1u << bytes * 8) - 1;
    for (uint32_t e = 0; e < entries; ++e) {
      uint32_t& word = baked_.line_spaces.candidates[r.candidate_first + e * bytes / 4];
      const uint32_t shift = e * bytes % 4 * 8;
      const uint32_t value = word >> shift & mask;
      if (dense && value == mask) continue;
      word = (word & ~(mask << shift)) | f(value) << shift;
    }
  }

  void mark(size_t i) {
    const LspLineSpace& r = baked_.line_spaces.records[i];
    if (entry_bytes(r) == 0) referred_[r.triangle_first] = true;
    for_each_entry(r, [&](uint32_t local) {
      referred_[r.triangle_first + local] = true;
      return local;
    });
  }

  uint32_t keep(uint32_t first, uint32_t count) {
    const uint32_t start = uint32_t(triangles_.size());
    for (uint32_t i = first; i < first + count; ++i) {
      place_[i] = uint32_t(triangles_.size());
      triangles_.push_back(baked_.triangles[i]);
      if (!baked_.normals.empty()) normals_.push_back(baked_.normals[i]);
    }
    return start;
  }

  // Keeps the referred triangles of a terminal site; the subtree itself goes.
  void keep_site(uint32_t index) {
    const LspLineSpace& r = baked_.line_spaces.records[index];
    const uint32_t start = uint32_t(triangles_.size());
    for (uint32_t i = r.triangle_first; i < r.triangle_first + r.triangle_count; ++i)
      if (referred_[i]) keep(i, 1);
    renumber(index, start, LSP_NONE);
  }

  // A Line Space whose node now is `child` and whose triangles lie from `start` to the last one kept.
  void renumber(uint32_t index, uint32_t start, uint32_t child) {
    LspLineSpace& r = baked_.line_spaces.records[index];
    for_each_entry(r, [&](uint32_t local) { return place_[r.triangle_first + local] - start; });
    r.triangle_first = start;
    r.triangle_count = uint32_t(triangles_.size()) - start;
    r.child = child;
  }

  uint32_t copy(uint32_t child, uint32_t line_space, uint32_t depth) {
    if (child == LSP_NONE) return child;
    depth_ = std::max(depth_, depth);
    if (line_space != LSP_NONE && (line_space & LSP_TERMINAL_BIT)) {
      keep_site(line_space & LSP_LINE_SPACE_MASK);
      ++ends_;
      return LSP_NONE;
    }
    if (child & LSP_LEAF_BIT) {
      const uint32_t count = (child >> LSP_LEAF_COUNT_SHIFT & LSP_LEAF_COUNT_MASK) + 1;
      ++ends_;
      max_leaf_ = std::max(max_leaf_, count);
      return (child & ~LSP_LEAF_FIRST_MASK) | keep(child & LSP_LEAF_FIRST_MASK, count);
    }
    const uint32_t index = uint32_t(nodes_.size()), start = uint32_t(triangles_.size());
    const LspNode old = baked_.nodes[child];
    nodes_.push_back(old);
    const uint32_t child0 = copy(old.child0, old.line_space0, depth + 1);
    nodes_[index].child0 = child0;
    const uint32_t child1 = copy(old.child1, old.line_space1, depth + 1);
    nodes_[index].child1 = child1;
    if (line_space != LSP_NONE) renumber(line_space, start, index);
    return index;
  }

  Baked& baked_;
  std::vector<bool> referred_;
  std::vector<uint32_t> place_;  // of a kept triangle among the kept ones
  uint32_t ends_ = 0;            // leaves and terminal Line Spaces
  uint32_t depth_ = 0;
  uint32_t max_leaf_ = 0;
  std::vector<LspNode> nodes_;
  std::vector<LspTriangle> triangles_;
  std::vector<LspCornerNormals> normals_;
};

void set_counts(Baked& baked) {
  LspHeader& h = baked.header;
  h.node_count = uint32_t(baked.nodes.size());
  h.triangle_count = uint32_t(baked.triangles.size());
  h.line_space_count = uint32_t(baked.line_spaces.records.size());
  h.bit_word_count = uint32_t(baked.line_spaces.words.size());
  h.candidate_word_count = uint32_t(baked.line_spaces.candidates.size());
  h.material_count = uint32_t(baked.materials.size());
}

}  // namespace

Baked bake(const Mesh& mesh, const BakeOptions& options, const Progress& progress) {
  if (options.memory_limit) {
    const uint64_t needed = estimate_bytes(mesh, options);
    if (needed > options.memory_limit)
      throw Failure(Exit::kLimit, "",
                    "the bake needs about " + with_commas(needed >> 20) + " MiB, over the limit of " +
                        with_commas(options.memory_limit >> 20) +
                        " MiB: raise --memory-limit, or lower --depth or --resolution");
  }
  const auto stage = [&](const char* name) {
    return [&progress, name](double done) {
      if (progress) progress(name, done);
    };
  };
  Baked baked;
  LspHeader& h = baked.header;

  auto start = std::chrono::steady_clock::now();
  Bvh bvh = build_bvh(mesh, options.bvh, stage("base structure"));
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
  h.base_structure = LSP_BASE_BVH;
  h.primitive_count = mesh.primitive_count;
  h.plane_tolerance = options.plane_tolerance;
  h.normal_angle_cos =
      options.normal_angle_degrees >= 180 ? -1.0f : std::cos(options.normal_angle_degrees * 0.017453293f);
  h.root = bvh.root;
  h.root_line_space = LSP_NONE;
  h.max_depth = bvh.max_depth;
  h.max_stack = std::max(1u, bvh.max_depth);
  h.max_steps = uint32_t(bvh.nodes.size()) + bvh.leaf_count + 1;
  h.max_leaf_triangles = bvh.max_leaf_triangles;

  if (options.line_spaces) {
    start = std::chrono::steady_clock::now();
    const std::vector<LineSpaceSite> sites = choose_sites(bvh, h, options.line_space);
    RootReference root;
    baked.line_spaces =
        fill_line_spaces(bvh, root, h, baked.triangles, sites, options.line_space, stage("Line Spaces"));
    baked.line_space_seconds = seconds_since(start);
    h.root_line_space = root.line_space;
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
  baked.nodes = std::move(bvh.nodes);

  h.required_features =
      LSP_FEATURE_EXACT | (baked.line_spaces.records.empty() ? 0 : LSP_FEATURE_LINE_SPACES) |
      (normals ? LSP_FEATURE_NORMALS : 0) | (shading ? LSP_FEATURE_MATERIALS : 0) |
      (!baked.line_spaces.records.empty() && options.line_space.kind == LineSpaceKind::kBinary
           ? LSP_FEATURE_BINARY
           : 0);
  set_counts(baked);
  return baked;
}

void keep_approximate_only(Baked& baked) {
  const size_t nodes = baked.nodes.size(), triangles = baked.triangles.size();
  ApproximateOnly(baked).run();
  baked.header.required_features &= ~LSP_FEATURE_EXACT;
  baked.skipped.push_back("nodes below Line Spaces: " + with_commas(nodes - baked.nodes.size()));
  baked.skipped.push_back("triangles no shaft refers to: " + with_commas(triangles - baked.triangles.size()));
  set_counts(baked);
}

}  // namespace lsp
