#include "ntree_scenes.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>

#include "line_space_tables.h"
#include "scenes.h"

namespace lsp::corpus {
namespace {

constexpr float kMargin = 0.0078125f;
constexpr float kSize = 4.0625f;
constexpr lsp_float3 kLo = {-2.03125f, -1.28125f, -2.03125f};

using Point = std::array<double, 3>;

// The part of a polygon where coordinate `axis` times `sign` is at most `limit` (Sutherland, Hodgman 1974).
std::vector<Point> clip(const std::vector<Point>& polygon, int axis, double sign, double limit) {
  std::vector<Point> inside;
  for (size_t i = 0; i < polygon.size(); ++i) {
    const Point &a = polygon[i], &b = polygon[(i + 1) % polygon.size()];
    const double da = sign * a[axis] - limit, db = sign * b[axis] - limit;
    if (da <= 0) inside.push_back(a);
    if ((da < 0 && db > 0) || (da > 0 && db < 0)) {
      Point p;
      for (int k = 0; k < 3; ++k) p[k] = a[k] + (b[k] - a[k]) * (da / (da - db));
      inside.push_back(p);
    }
  }
  return inside;
}

struct Cell;
struct Node {
  std::vector<Cell> cells;  // the filled ones, in the order of their bits
};
struct Cell {
  uint32_t index = 0;  // of the bit
  uint32_t level = 0;  // of the root's cells: 1
  Box box{};
  std::vector<uint32_t> triangles{};  // that reach into it
  std::vector<Node> node{};           // one, or none in a leaf
  bool carries = false;               // a Line Space
  bool carries_below = false;
  bool left_out = false;
};

class Builder {
 public:
  explicit Builder(const NtreeOptions& options) : options_(options), tables_(table_options()) {}

  Image run() {
    image_.triangles = box_on_floor_triangles();
    header();
    Cell root;
    root.box = {kLo, {kLo.x + kSize, kLo.y + kSize, kLo.z + kSize}};
    for (uint32_t t = 0; t < image_.triangles.size(); ++t) root.triangles.push_back(t);
    divide(root, {0, 0, 0});
    choose(root);
    if (root.carries) image_.header.root_line_space = add_line_space(root);
    image_.header.root = root.left_out ? LSP_NONE : 0;
    if (!root.left_out) number(root.node[0]);
    if (root.carries) image_.line_spaces[0].child = image_.header.root;
    finish();
    return std::move(image_);
  }

 private:
  LineSpaceOptions table_options() const {
    return {.resolution = options_.resolution, .entry_bytes = options_.entry_bytes};
  }

  void header() {
    LspHeader& h = image_.header;
    h.magic_0 = LSP_MAGIC_0;
    h.magic_1 = LSP_MAGIC_1;
    h.version_major = LSP_VERSION_MAJOR;
    h.header_bytes = sizeof(LspHeader);
    h.base_structure = LSP_BASE_NTREE;
    h.primitive_count = image_.triangles.size();
    Box bounds = Box::nothing();
    for (const LspTriangle& t : image_.triangles)
      for (const lsp_float3* p : {&t.v0, &t.v1, &t.v2}) bounds.add(*p);
    h.bounds_min = bounds.lo;
    h.bounds_max = bounds.hi;
    h.normal_angle_cos = 0.5f;
    h.plane_tolerance = 0.0078125f;
    h.root_line_space = LSP_NONE;
    h.resolution = options_.resolution;
    if (options_.resolution != 0)
      h.line_space_depth = *std::max_element(options_.depths.begin(), options_.depths.end());
    h.ntree_branching = options_.branching;
    h.ntree_depth = options_.levels;
    h.ntree_lo = kLo;
    h.ntree_size = kSize;
    h.ntree_margin = kMargin;
  }

  // The box of the cell with these global coordinates, as layout.h says.
  Box box_of(const std::array<uint32_t, 3>& g, uint32_t level) const {
    const float size = kSize / std::pow(static_cast<float>(options_.branching), static_cast<float>(level));
    const auto at = [&](int plus) {
      return lsp_float3{kLo.x + static_cast<float>(g[0] + plus) * size,
                        kLo.y + static_cast<float>(g[1] + plus) * size,
                        kLo.z + static_cast<float>(g[2] + plus) * size};
    };
    return {at(0), at(1)};
  }

  bool holds(const Box& box, const LspTriangle& t) const {
    std::vector<Point> part;
    for (const lsp_float3* v : {&t.v0, &t.v1, &t.v2}) part.push_back({v->x, v->y, v->z});
    const Point lo = {box.lo.x, box.lo.y, box.lo.z}, hi = {box.hi.x, box.hi.y, box.hi.z};
    for (int axis = 0; axis < 3; ++axis) {
      part = clip(part, axis, 1, hi[axis] + kMargin);
      part = clip(part, axis, -1, -(lo[axis] - kMargin));
    }
    return !part.empty();
  }

  // Cuts a cell, whose own cells begin at `origin` in their level's coordinates.
  void divide(Cell& cell, const std::array<uint32_t, 3>& origin) {
    const uint32_t n = options_.branching;
    cell.node.emplace_back();
    for (uint32_t index = 0; index < n * n * n; ++index) {
      const std::array<uint32_t, 3> at = {origin[0] + index % n, origin[1] + index / n % n,
                                          origin[2] + index / (n * n)};
      Cell below{.index = index, .level = cell.level + 1, .box = box_of(at, cell.level + 1)};
      for (uint32_t t : cell.triangles)
        if (holds(below.box, image_.triangles[t])) below.triangles.push_back(t);
      if (below.triangles.empty()) continue;
      if (below.triangles.size() > options_.leaf_triangles && below.level < options_.levels)
        divide(below, {at[0] * n, at[1] * n, at[2] * n});
      cell.node[0].cells.push_back(std::move(below));
    }
  }

  // Which cells carry a Line Space: those of the levels asked for, unless no shaft would be filled.
  bool choose(Cell& cell) {
    for (Node& node : cell.node)
      for (Cell& below : node.cells) cell.carries_below |= choose(below);
    const bool asked = options_.resolution != 0 && std::find(options_.depths.begin(), options_.depths.end(),
                                                             cell.level) != options_.depths.end();
    if (asked) {
      Image trial;
      trial.triangles = image_.triangles;
      LineSpaceTables tables(table_options());
      trial.line_spaces.push_back({});
      fill(trial, tables, cell);
      cell.carries = trial.line_spaces[0].filled != 0;
    }
    cell.left_out = !options_.exact && cell.carries && !cell.carries_below;
    return cell.carries || cell.carries_below;
  }

  // Its candidates count from the first triangle of the cell to the last.
  void fill(Image& image, LineSpaceTables& tables, const Cell& cell) const {
    const uint32_t first = cell.triangles.front();
    tables.fill(image, static_cast<uint32_t>(image.line_spaces.size() - 1), 0, cell.box, first,
                cell.triangles.back() - first + 1);
  }

  uint32_t add_line_space(const Cell& cell) {
    const uint32_t index = static_cast<uint32_t>(image_.line_spaces.size());
    image_.line_spaces.push_back({});
    fill(image_, tables_, cell);
    return index | (cell.carries_below ? 0 : LSP_TERMINAL_BIT);
  }

  // Gives the node the next number; its cells and what they hold come before those of the nodes in them.
  uint32_t number(const Node& node) {
    const uint32_t n = options_.branching, words = LSP_GRID_WORDS(n);
    const uint32_t number = static_cast<uint32_t>(image_.grid.size()) / words;
    const size_t first = image_.cells.size();
    image_.grid.resize(image_.grid.size() + words);
    for (const Cell& cell : node.cells)
      image_.grid[number * words + cell.index / 32].bits |= 1u << cell.index % 32;
    uint32_t offset = static_cast<uint32_t>(first);
    for (uint32_t w = number * words; w < (number + 1) * words; ++w) {
      image_.grid[w].offset = offset;
      offset += static_cast<uint32_t>(std::popcount(image_.grid[w].bits));
    }
    for (const Cell& cell : node.cells) {
      LspCell record = {LSP_NONE, 0, LSP_NONE};
      if (cell.node.empty() && !cell.left_out) {
        record.child = LSP_LEAF_BIT | static_cast<uint32_t>(image_.references.size());
        record.count = static_cast<uint32_t>(cell.triangles.size());
        image_.references.insert(image_.references.end(), cell.triangles.begin(), cell.triangles.end());
        image_.header.max_leaf_triangles = std::max(image_.header.max_leaf_triangles, record.count);
      }
      if (cell.carries) record.line_space = add_line_space(cell);
      image_.cells.push_back(record);
    }
    for (size_t i = 0; i < node.cells.size(); ++i) {
      if (!node.cells[i].node.empty() && !node.cells[i].left_out) {
        const uint32_t child = this->number(node.cells[i].node[0]);
        image_.cells[first + i].child = child;
      }
      const LspCell& record = image_.cells[first + i];
      if (record.line_space != LSP_NONE)
        image_.line_spaces[record.line_space & LSP_LINE_SPACE_MASK].child = record.child;
    }
    return number;
  }

  void finish() {
    tables_.pack(image_);
    if (options_.normals) add_normals(image_);
    if (options_.materials)
      add_materials(image_);
    else
      for (LspTriangle& t : image_.triangles) t.material = 0;
    LspHeader& h = image_.header;
    h.max_depth = h.max_stack = options_.levels;
    lsp::format::set_counters(h, image_);
    h.max_steps = static_cast<uint32_t>(lsp_ntree_steps(&h));
    h.required_features = LSP_FEATURE_NTREE | (options_.exact ? LSP_FEATURE_EXACT : 0) |
                          (image_.line_spaces.empty() ? 0 : LSP_FEATURE_LINE_SPACES) |
                          (options_.normals ? LSP_FEATURE_NORMALS : 0) |
                          (options_.materials ? LSP_FEATURE_MATERIALS : 0) |
                          (!image_.line_spaces.empty() && options_.entry_bytes == 0 ? LSP_FEATURE_BINARY : 0);
  }

  const NtreeOptions& options_;
  Image image_;
  LineSpaceTables tables_;
};

}  // namespace

Image ntree_scene(const NtreeOptions& options) { return Builder(options).run(); }

Image full_ntree_scene() {
  Image image = ntree_scene({.resolution = 1, .depths = {0, 1, 2}, .normals = true, .materials = true});
  image.meta = "{\"tool\":\"corpus\",\"inputs\":[\"box.obj\"]}";
  return image;
}

Image empty_ntree_scene() {
  Image image = ntree_scene({.levels = 1});
  LspHeader& h = image.header;
  h.bounds_min = h.bounds_max = {0, 0, 0};
  h.primitive_count = 0;
  h.root = LSP_NONE;
  h.max_leaf_triangles = h.max_steps = 0;
  image.triangles.clear();
  image.grid.clear();
  image.cells.clear();
  image.references.clear();
  return image;
}

}  // namespace lsp::corpus
