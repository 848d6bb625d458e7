#include "scenes.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>

#include "cells_scenes.h"
#include "line_space_tables.h"
#include "ntree_scenes.h"
#include "wide_scenes.h"

namespace lsp::corpus {
namespace {

double along(const lsp_float3& v, int axis) { return axis == 0 ? v.x : axis == 1 ? v.y : v.z; }

class Builder {
 public:
  Builder(std::vector<LspTriangle> triangles, const SceneOptions& options)
      : options_(options),
        input_(std::move(triangles)),
        tables_({options.resolution, options.entry_bytes, options.dense, options.directed}) {}

  Image run() {
    Box bounds = Box::nothing();
    for (const LspTriangle& t : input_)
      for (const lsp_float3* p : {&t.v0, &t.v1, &t.v2}) bounds.add(*p);
    LspHeader& header = image_.header;
    header.magic_0 = LSP_MAGIC_0;
    header.magic_1 = LSP_MAGIC_1;
    header.version_major = LSP_VERSION_MAJOR;
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
    tables_.fill(image_, index, child, box, triangle_first,
                 static_cast<uint32_t>(image_.triangles.size()) - triangle_first);
  }

  // Halves the triangles along the longest axis, by the middle of their boxes.
  void split(LspNode& node, size_t first, size_t end, const Box& box, uint32_t depth) {
    const auto extent = [&](int a) { return along(box.hi, a) - along(box.lo, a); };
    const int axis = extent(0) >= extent(1) && extent(0) >= extent(2) ? 0 : extent(1) >= extent(2) ? 1 : 2;
    const auto middle = [&](const LspTriangle& t) {
      const double a = along(t.v0, axis), b = along(t.v1, axis), c = along(t.v2, axis);
      return std::min({a, b, c}) + std::max({a, b, c});
    };
    std::stable_sort(input_.begin() + static_cast<ptrdiff_t>(first),
                     input_.begin() + static_cast<ptrdiff_t>(end),
                     [&](const LspTriangle& a, const LspTriangle& b) { return middle(a) < middle(b); });
    const size_t half = (first + end) / 2;
    Box boxes[2] = {Box::nothing(), Box::nothing()};
    for (size_t i = first; i < end; ++i)
      for (const lsp_float3* p : {&input_[i].v0, &input_[i].v1, &input_[i].v2}) boxes[i >= half].add(*p);
    node.lo0 = boxes[0].lo;
    node.hi0 = boxes[0].hi;
    node.lo1 = boxes[1].lo;
    node.hi1 = boxes[1].hi;
    build(node.child0, node.line_space0, first, half, boxes[0], depth + 1);
    build(node.child1, node.line_space1, half, end, boxes[1], depth + 1);
  }

  // Fills in what does not depend on the tree's shape.
  void shade() {
    tables_.pack(image_);
    if (options_.normals) add_normals(image_);
    if (options_.materials)
      add_materials(image_);
    else
      for (LspTriangle& t : image_.triangles) t.material = 0;
  }

  const SceneOptions& options_;
  std::vector<LspTriangle> input_;
  Image image_;
  LineSpaceTables tables_;
  uint32_t ends_ = 0;  // leaves, and Line Spaces in place of them
};

void add_quad(std::vector<LspTriangle>& triangles, const lsp_float3& a, const lsp_float3& b,
              const lsp_float3& c, const lsp_float3& d, uint32_t material) {
  const uint32_t primitive = static_cast<uint32_t>(triangles.size());
  triangles.push_back({a, primitive, b, material, c, 0});
  triangles.push_back({a, primitive + 1, c, material, d, 0});
}

}  // namespace

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

namespace {

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

Bytes packed(const Image& image) {
  Sections sections = to_sections(image);
  pack(sections);
  return encode(sections);
}

// What a writer of a later minor version might add: an unknown optional feature and an unknown optional
// section.
Image retired_format() {
  Image image = box_on_floor({.resolution = 1, .depths = {2}, .entry_bytes = 0, .exact = false});
  for (LspLineSpace& space : image.line_spaces) space.format |= LSP_FORMAT_RETIRED;
  return image;
}

Bytes newer_minor() {
  Sections sections = to_sections(box_on_floor({}));
  sections.header.version_minor = 9;
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

Image partial(Image image) {
  image.header.required_features |= LSP_FEATURE_COVERAGE;
  image.header.version_minor = lsp_version_minor(image.header.required_features);
  for (LspTriangle& t : image.triangles)
    t.flags |= static_cast<uint32_t>((1 - image.materials[t.material].opacity) * 65536)
               << LSP_TRIANGLE_GAPS_SHIFT;
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
  add("binary-directed", "binary Line Spaces with a bit for each direction of a shaft",
      encode(box_on_floor({.resolution = 2, .entry_bytes = 0, .directed = true})));
  add("retired-format", "bit 14 of a Line Space's format, which 2.0 and 2.1 knew, is ignored",
      encode(retired_format()));
  add("root-line-space", "the root carries a Line Space",
      encode(box_on_floor({.resolution = 1, .depths = {0}})));
  add("approximate", "no exact tree: subtrees below terminal Line Spaces are left out",
      encode(box_on_floor({.resolution = 1, .depths = {2}, .exact = false})));
  add("approximate-root", "no node at all: the root's Line Space stands for everything",
      encode(box_on_floor({.resolution = 1, .depths = {0}, .exact = false})));
  add("spatial-split", "one primitive in two leaves, each box around a part of it",
      encode(spatially_split()));
  add("ntree", "an NTree as base structure, three levels of nodes", encode(ntree_scene({.levels = 3})));
  add("ntree-full", "an NTree with every section, Line Spaces on its root, its nodes and its leaves",
      encode(full_ntree_scene()));
  add("ntree-3", "27 cells a node: bits of GRID beyond the last cell; Line Spaces of nodes and small leaves",
      encode(ntree_scene({.branching = 3, .resolution = 2, .depths = {1}})));
  add("ntree-16", "4096 cells a node, 128 words of GRID",
      encode(ntree_scene({.branching = 16, .levels = 1})));
  add("ntree-approximate", "an NTree that is not exact: cells that hold a Line Space only",
      encode(ntree_scene({.resolution = 1, .depths = {1}, .exact = false})));
  add("ntree-approximate-root", "an NTree without a node: the root's Line Space stands for everything",
      encode(ntree_scene({.resolution = 1, .depths = {0}, .exact = false})));
  add("ntree-binary", "an NTree with binary Line Spaces",
      encode(ntree_scene({.resolution = 2, .depths = {1}, .entry_bytes = 0})));
  add("ntree-empty", "an NTree without geometry", encode(empty_ntree_scene()));
  add("ntree-packed", "an NTree, every section packed", packed(full_ntree_scene()));
  add("align-4096", "sections at multiples of 4096", encode(with_alignment(full_scene(), 4096)));
  add("align-65536", "sections at multiples of 65536", encode(with_alignment(box_on_floor(one_leaf), 65536)));
  add("packed", "every section packed with zstd", packed(full_scene()));
  add("packed-4096", "packed, the raw form aligned to 4096", packed(with_alignment(full_scene(), 4096)));
  add("newer-minor", "a later minor version with an unknown optional feature and section", newer_minor());
  add("coverage", "triangles that are there in part", encode(partial(full_scene())));
  add("cells", "cells beside a BVH", encode(full_cells_scene()));
  add("cells-tables", "cells alone: tables and the triangles of their planes",
      encode(full_cells_scene(false)));
  add("cells-closed", "cells that most rays do not leave the scene from", encode(closed_cells_scene()));
  add("wide", "cells beside wide nodes, three levels of them", encode(full_wide_scene()));
  add("wide-packed", "the same, packed", packed(full_wide_scene()));
  add("wide-alone", "wide nodes without cells", encode(wide_alone_scene()));
  add("wide-empty", "no geometry: no wide node, the feature bit is set all the same",
      encode(empty_wide_scene()));
  return files;
}

}  // namespace lsp::corpus
