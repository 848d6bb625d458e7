#include "scenes.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>

#include "line_space.h"
#include "octahedral.h"

namespace lsp::corpus {
namespace {

struct Vec {
  double x, y, z;
  double operator[](int axis) const { return axis == 0 ? x : axis == 1 ? y : z; }
};
Vec operator-(const Vec& a, const Vec& b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
Vec cross(const Vec& a, const Vec& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
double dot(const Vec& a, const Vec& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
Vec to_vec(const lsp_float3& v) { return {v.x, v.y, v.z}; }
lsp_float3 to_float3(const Vec& v) {
  return {static_cast<float>(v.x), static_cast<float>(v.y), static_cast<float>(v.z)};
}

struct Box {
  lsp_float3 lo{INFINITY, INFINITY, INFINITY}, hi{-INFINITY, -INFINITY, -INFINITY};
  void add(const lsp_float3& p) {
    lo = {std::min(lo.x, p.x), std::min(lo.y, p.y), std::min(lo.z, p.z)};
    hi = {std::max(hi.x, p.x), std::max(hi.y, p.y), std::max(hi.z, p.z)};
  }
};

// Where a ray meets a triangle, in lengths of its direction; infinity: nowhere (Moeller and Trumbore 1997).
double intersect(const Vec& origin, const Vec& direction, const LspTriangle& t) {
  const Vec v0 = to_vec(t.v0), e1 = to_vec(t.v1) - v0, e2 = to_vec(t.v2) - v0;
  const Vec p = cross(direction, e2);
  const double det = dot(e1, p);
  if (det == 0) return INFINITY;
  const Vec s = origin - v0;
  const double u = dot(s, p) / det;
  const Vec q = cross(s, e1);
  const double v = dot(direction, q) / det;
  const double distance = dot(e2, q) / det;
  return u >= 0 && v >= 0 && u + v <= 1 && distance >= 0 && distance <= 1 ? distance : INFINITY;
}

Vec patch_centroid(const LspLineSpace& space, uint32_t n, uint32_t face, uint32_t patch) {
  const Vec lo = to_vec(space.lo), hi = to_vec(space.hi);
  const int axis = static_cast<int>(face / 2);
  double point[3] = {};
  const int u = axis == 0 ? 1 : 0, v = axis == 2 ? 1 : 2;
  point[axis] = face % 2 == 0 ? lo[axis] : hi[axis];
  point[u] = lo[u] + (hi[u] - lo[u]) * (patch % n + 0.5) / n;
  point[v] = lo[v] + (hi[v] - lo[v]) * (patch / n + 0.5) / n;
  return {point[0], point[1], point[2]};
}

class Builder {
 public:
  Builder(std::vector<LspTriangle> triangles, const SceneOptions& options)
      : options_(options), input_(std::move(triangles)) {}

  Image run() {
    Box bounds;
    for (const LspTriangle& t : input_)
      for (const lsp_float3* p : {&t.v0, &t.v1, &t.v2}) bounds.add(*p);
    LspHeader& header = image_.header;
    header.magic_0 = LSP_MAGIC_0;
    header.magic_1 = LSP_MAGIC_1;
    header.version_major = LSP_VERSION_MAJOR;
    header.version_minor = LSP_VERSION_MINOR;
    header.header_bytes = sizeof(LspHeader);
    header.base_structure = LSP_BASE_BVH;
    header.primitive_count = input_.size();
    header.bounds_min = bounds.lo;
    header.bounds_max = bounds.hi;
    header.normal_angle_cos = 0.5f;
    header.plane_tolerance = 0.0078125f;
    header.max_leaf_triangles = options_.leaf_triangles;
    header.resolution = options_.resolution;
    if (options_.resolution != 0)
      header.line_space_depth = *std::max_element(options_.depths.begin(), options_.depths.end());
    build(header.root, header.root_line_space, 0, input_.size(), bounds, 0);
    header.max_stack = std::max(header.max_depth, 1u);
    header.max_steps = static_cast<uint32_t>(image_.nodes.size()) + ends_ + 1;
    shade();
    header.required_features =
        (options_.exact ? LSP_FEATURE_EXACT : 0) |
        (image_.line_spaces.empty() ? 0 : LSP_FEATURE_LINE_SPACES) |
        (options_.normals ? LSP_FEATURE_NORMALS : 0) | (options_.materials ? LSP_FEATURE_MATERIALS : 0) |
        (!image_.line_spaces.empty() && options_.entry_bytes == 0 ? LSP_FEATURE_BINARY : 0);
    return std::move(image_);
  }

 private:
  // Builds the subtree of input triangles [first, end) and writes its references into child and line_space.
  // They may lie inside image_.nodes, which is why its memory is reserved.
  void build(uint32_t& child, uint32_t& line_space, size_t first, size_t end, const Box& box,
             uint32_t depth) {
    image_.nodes.reserve(input_.size());
    child = LSP_NONE;
    line_space = LSP_NONE;
    if (first == end) return;
    const bool carries = options_.resolution != 0 && std::find(options_.depths.begin(), options_.depths.end(),
                                                               depth) != options_.depths.end();
    const uint32_t index = static_cast<uint32_t>(image_.line_spaces.size());
    if (carries) image_.line_spaces.push_back({});
    const uint32_t triangle_first = static_cast<uint32_t>(image_.triangles.size());
    const size_t spaces_before = image_.line_spaces.size();
    const bool below_goes = carries && !options_.exact;
    if (end - first <= options_.leaf_triangles || below_goes) {
      image_.triangles.insert(image_.triangles.end(), input_.begin() + static_cast<ptrdiff_t>(first),
                              input_.begin() + static_cast<ptrdiff_t>(end));
      if (!below_goes) {
        child =
            LSP_LEAF_BIT | static_cast<uint32_t>(end - first - 1) << LSP_LEAF_COUNT_SHIFT | triangle_first;
      }
      ++ends_;
      image_.header.max_depth = std::max(image_.header.max_depth, depth);
    } else {
      child = static_cast<uint32_t>(image_.nodes.size());
      image_.nodes.push_back({});
      split(image_.nodes.back(), first, end, box, depth);
    }
    if (!carries) return;
    line_space = index | (image_.line_spaces.size() == spaces_before ? LSP_TERMINAL_BIT : 0);
    fill(index, child, box, triangle_first, static_cast<uint32_t>(image_.triangles.size()) - triangle_first);
  }

  // Halves the triangles along the longest axis, by the middle of their boxes.
  void split(LspNode& node, size_t first, size_t end, const Box& box, uint32_t depth) {
    const Vec extent = to_vec(box.hi) - to_vec(box.lo);
    const int axis = extent.x >= extent.y && extent.x >= extent.z ? 0 : extent.y >= extent.z ? 1 : 2;
    const auto middle = [&](const LspTriangle& t) {
      const double a = to_vec(t.v0)[axis], b = to_vec(t.v1)[axis], c = to_vec(t.v2)[axis];
      return std::min({a, b, c}) + std::max({a, b, c});
    };
    std::stable_sort(input_.begin() + static_cast<ptrdiff_t>(first),
                     input_.begin() + static_cast<ptrdiff_t>(end),
                     [&](const LspTriangle& a, const LspTriangle& b) { return middle(a) < middle(b); });
    const size_t half = (first + end) / 2;
    Box boxes[2];
    for (size_t i = first; i < end; ++i)
      for (const lsp_float3* p : {&input_[i].v0, &input_[i].v1, &input_[i].v2}) boxes[i >= half].add(*p);
    node.lo0 = boxes[0].lo;
    node.hi0 = boxes[0].hi;
    node.lo1 = boxes[1].lo;
    node.hi1 = boxes[1].hi;
    build(node.child0, node.line_space0, first, half, boxes[0], depth + 1);
    build(node.child1, node.line_space1, half, end, boxes[1], depth + 1);
  }

  // Computes the Line Space of a node once its triangles are in place. Its words and candidates are kept
  // apart until all are known, because a Line Space precedes those below it.
  void fill(uint32_t index, uint32_t child, const Box& box, uint32_t triangle_first,
            uint32_t triangle_count) {
    LspLineSpace& space = image_.line_spaces[index];
    const uint32_t n = options_.resolution;
    const float margin = 0.015625f;
    space.lo = {box.lo.x - margin, box.lo.y - margin, box.lo.z - margin};
    space.hi = {box.hi.x + margin, box.hi.y + margin, box.hi.z + margin};
    space.scale = {static_cast<float>(n) / (space.hi.x - space.lo.x),
                   static_cast<float>(n) / (space.hi.y - space.lo.y),
                   static_cast<float>(n) / (space.hi.z - space.lo.z)};
    space.triangle_first = triangle_first;
    space.triangle_count = triangle_count;
    space.child = child;
    const bool binary = options_.entry_bytes == 0;
    space.format = n | options_.entry_bytes << LSP_FORMAT_ENTRY_SHIFT |
                   (options_.dense ? LSP_FORMAT_DENSE : 0) | (binary ? LSP_FORMAT_SYMMETRIC : 0);

    std::vector<uint32_t> shafts(format::shape_of(space.format).shafts, LSP_NONE);
    for (uint32_t in = 0; in < 6; ++in)
      for (uint32_t out = binary ? in + 1 : 0; out < 6; ++out) {
        if (in == out) continue;
        for (uint32_t p = 0; p < n * n; ++p)
          for (uint32_t q = 0; q < n * n; ++q) {
            const uint32_t shaft =
                binary ? LSP_SHAFT_INDEX_SYMMETRIC(in, out, p, q, n) : LSP_SHAFT_INDEX(in, out, p, q, n);
            shafts[shaft] = nearest(space, patch_centroid(space, n, in, p), patch_centroid(space, n, out, q));
          }
      }
    for (uint32_t entry : shafts) space.filled += entry != LSP_NONE;
    tables_.resize(image_.line_spaces.size());
    tables_[index] = std::move(shafts);
  }

  uint32_t nearest(const LspLineSpace& space, const Vec& from, const Vec& to) const {
    uint32_t best = LSP_NONE;
    double distance = INFINITY;
    for (uint32_t i = 0; i < space.triangle_count; ++i) {
      const double d = intersect(from, to - from, image_.triangles[space.triangle_first + i]);
      if (d < distance) {
        distance = d;
        best = i;
      }
    }
    return best;
  }

  void pack_tables() {
    for (size_t i = 0; i < image_.line_spaces.size(); ++i) {
      LspLineSpace& space = image_.line_spaces[i];
      const format::LineSpaceShape shape = format::shape_of(space.format);
      const std::vector<uint32_t>& shafts = tables_[i];
      space.word_first = shape.words == 0 ? 0 : static_cast<uint32_t>(image_.words.size());
      const uint64_t candidate_words = shape.candidate_words(space.filled);
      space.candidate_first = candidate_words == 0 ? 0 : static_cast<uint32_t>(image_.candidates.size());
      image_.candidates.resize(image_.candidates.size() + candidate_words);
      uint32_t filled = 0;
      for (uint64_t first = 0; first < shape.words * 32; first += 32) {
        LspBitWord word{0, filled};
        for (uint64_t bit = 0; bit < 32 && first + bit < shafts.size(); ++bit)
          if (shafts[first + bit] != LSP_NONE) word.bits |= 1u << bit;
        filled += static_cast<uint32_t>(std::popcount(word.bits));
        image_.words.push_back(word);
      }
      if (shape.entry_bytes == 0) continue;
      auto* entries = reinterpret_cast<unsigned char*>(image_.candidates.data() + space.candidate_first);
      for (uint32_t entry : shafts) {
        if (entry == LSP_NONE && !shape.dense) continue;
        for (uint32_t byte = 0; byte < shape.entry_bytes; ++byte)
          *entries++ = static_cast<unsigned char>(entry >> 8 * byte);
      }
    }
  }

  // Fills in what does not depend on the tree's shape.
  void shade() {
    pack_tables();
    if (options_.normals)
      for (LspTriangle& t : image_.triangles) {
        const Vec n = cross(to_vec(t.v1) - to_vec(t.v0), to_vec(t.v2) - to_vec(t.v0));
        const uint32_t flat = format::encode_normal(to_float3(n));
        const bool smooth = t.primitive % 2 == 1;
        const uint32_t bent = format::encode_normal(to_float3({n.x + 0.1, n.y, n.z}));
        image_.normals.push_back({flat, flat, smooth ? bent : flat});
        t.flags = smooth && bent != flat ? LSP_TRIANGLE_SMOOTH : 0;
      }
    if (options_.materials)
      image_.materials = {{{0.8f, 0.8f, 0.8f}, 1.0f, {0, 0, 0}, 1.0f, 0.0f, {}},
                          {{0.5f, 0.25f, 0.125f}, 0.5f, {2, 2, 1}, 0.25f, 1.0f, {}}};
    else
      for (LspTriangle& t : image_.triangles) t.material = 0;
  }

  const SceneOptions& options_;
  std::vector<LspTriangle> input_;
  Image image_;
  std::vector<std::vector<uint32_t>> tables_;  // per Line Space: the entry of every shaft
  uint32_t ends_ = 0;                          // leaves, and Line Spaces in place of them
};

void add_quad(std::vector<LspTriangle>& triangles, const lsp_float3& a, const lsp_float3& b,
              const lsp_float3& c, const lsp_float3& d, uint32_t material) {
  const uint32_t primitive = static_cast<uint32_t>(triangles.size());
  triangles.push_back({a, primitive, b, material, c, 0});
  triangles.push_back({a, primitive + 1, c, material, d, 0});
}

std::vector<LspTriangle> box_on_floor_triangles() {
  std::vector<LspTriangle> t;
  add_quad(t, {-2, 0, -2}, {-2, 0, 2}, {2, 0, 2}, {2, 0, -2}, 0);
  const auto corner = [](int i) {
    return lsp_float3{i & 1 ? 1.0f : -1.0f, i & 2 ? 1.5f : 0.25f, i & 4 ? 0.75f : -0.75f};
  };
  for (const std::array<int, 4>& f :
       {std::array{0, 4, 6, 2}, {1, 3, 7, 5}, {0, 1, 5, 4}, {2, 6, 7, 3}, {0, 2, 3, 1}, {4, 5, 7, 6}})
    add_quad(t, corner(f[0]), corner(f[1]), corner(f[2]), corner(f[3]), 1);
  return t;
}

Image empty_scene() {
  Image image = Builder({}, SceneOptions{}).run();
  image.header.bounds_min = image.header.bounds_max = {0, 0, 0};
  return image;
}

// A wide triangle whose halves lie in two leaves, as a spatial split leaves it.
Image spatially_split() {
  const LspTriangle wide = {{-4, 0, 0}, 0, {4, 0, 0}, 0, {0, 1, 0}, 0};
  Image image = Builder({wide, wide}, SceneOptions{.leaf_triangles = 1}).run();
  image.header.primitive_count = 1;
  LspNode& node = image.nodes[0];
  node.hi0 = {0, 1, 0};
  node.lo1 = {0, 0, 0};
  return image;
}

Image ntree() {
  Image image = box_on_floor({});
  image.header.base_structure = LSP_BASE_NTREE;
  image.header.required_features |= LSP_FEATURE_NTREE;
  image.header.ntree_branching = 2;
  image.header.ntree_depth = 3;
  return image;
}

Bytes packed(const Image& image) {
  Sections sections = to_sections(image);
  pack(sections);
  return encode(sections);
}

// What a writer of version 1.1 might add: an unknown optional feature and an unknown optional section.
Bytes newer_minor() {
  Sections sections = to_sections(box_on_floor({}));
  sections.header.version_minor = 1;
  sections.header.optional_features = 0x1;
  const std::array<std::byte, 16> data{};
  sections.sections.push_back(make_section(0x57454E78u, 0, 4, data));  // "xNEW"
  return encode(sections);
}

}  // namespace

Image box_on_floor(const SceneOptions& options) { return Builder(box_on_floor_triangles(), options).run(); }

Image full_scene() {
  Image image = box_on_floor({.resolution = 1, .depths = {1, 2}, .normals = true, .materials = true});
  image.meta = "{\"tool\":\"corpus\",\"inputs\":[\"box.obj\"]}";
  image.header.source_hash_lo = 0x0123456789ABCDEFu;
  image.header.source_hash_hi = 0xFEDCBA9876543210u;
  return image;
}

std::vector<ValidFile> valid_files() {
  std::vector<ValidFile> files;
  const auto add = [&](const char* name, const char* shows, Bytes bytes) {
    files.push_back({name, shows, std::move(bytes)});
  };
  const auto with_alignment = [](Image image, uint32_t alignment) {
    image.alignment = alignment;
    return image;
  };
  const SceneOptions one_leaf{.leaf_triangles = 16};
  add("empty", "no geometry: root is none, no section at all", encode(empty_scene()));
  add("root-leaf", "no node: the root is a leaf", encode(box_on_floor(one_leaf)));
  add("exact", "an exact tree without Line Spaces", encode(box_on_floor({})));
  add("full", "every section, Line Spaces on two levels", encode(full_scene()));
  add("resolution-2", "480 shafts a Line Space, 15 bit words with offsets",
      encode(box_on_floor({.resolution = 2})));
  add("entries-2", "candidate entries of two bytes",
      encode(box_on_floor({.resolution = 1, .entry_bytes = 2})));
  add("entries-4", "candidate entries of four bytes",
      encode(box_on_floor({.resolution = 1, .entry_bytes = 4})));
  add("dense", "a dense Line Space: an entry a shaft, no bit words",
      encode(box_on_floor({.resolution = 1, .dense = true})));
  add("binary", "binary, symmetric Line Spaces: bits and no candidates",
      encode(box_on_floor({.resolution = 2, .entry_bytes = 0})));
  add("root-line-space", "the root carries a Line Space",
      encode(box_on_floor({.resolution = 1, .depths = {0}})));
  add("approximate", "no exact tree: subtrees below terminal Line Spaces are left out",
      encode(box_on_floor({.resolution = 1, .depths = {2}, .exact = false})));
  add("approximate-root", "no node at all: the root's Line Space stands for everything",
      encode(box_on_floor({.resolution = 1, .depths = {0}, .exact = false})));
  add("spatial-split", "one primitive in two leaves, each box around a part of it",
      encode(spatially_split()));
  add("ntree", "an NTree as base structure", encode(ntree()));
  add("align-4096", "sections at multiples of 4096", encode(with_alignment(full_scene(), 4096)));
  add("align-65536", "sections at multiples of 65536", encode(with_alignment(box_on_floor(one_leaf), 65536)));
  add("packed", "every section packed with zstd", packed(full_scene()));
  add("packed-4096", "packed, the raw form aligned to 4096", packed(with_alignment(full_scene(), 4096)));
  add("newer-minor", "a later minor version with an unknown optional feature and section", newer_minor());
  return files;
}

}  // namespace lsp::corpus
