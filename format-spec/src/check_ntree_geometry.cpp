// Where the triangles and Line Spaces of an NTree lie.
//
// A leaf's triangles come within ntree_margin of its cell. The other way round, in an exact file: going down
// from the root with one triangle, every leaf cell that it reaches into holds it, and it reaches into no
// empty one. So no ray can pass a triangle by in a cell that does not know of it.
#include <algorithm>
#include <cmath>
#include <cstddef>

#include "layers.h"
#include "vec.h"

namespace lsp::format {
namespace {

// A cube of cells: the root's or a cell's, by its global coordinates at its level.
struct Cube {
  Vec lo;
  double size;
};

struct Corners {
  Vec v[3];
  Vec lo, hi;
  explicit Corners(const LspTriangle& t) : v{to_vec(t.v0), to_vec(t.v1), to_vec(t.v2)} {
    const auto least = [&](int a) { return std::min({v[0][a], v[1][a], v[2][a]}); };
    const auto most = [&](int a) { return std::max({v[0][a], v[1][a], v[2][a]}); };
    lo = {least(0), least(1), least(2)};
    hi = {most(0), most(1), most(2)};
  }
};

// Whether the triangle reaches into the cube grown by `by` on every side. Separating axes (Akenine-Moeller,
// "Fast 3D Triangle-Box Overlap Testing", 2001).
bool reaches(const Corners& t, const Cube& cube, double by) {
  const double half = 0.5 * cube.size + by;
  if (half < 0) return false;
  const Vec centre = cube.lo + Vec{1, 1, 1} * (0.5 * cube.size);
  for (int a = 0; a < 3; ++a)
    if (t.lo[a] > centre[a] + half || t.hi[a] < centre[a] - half) return false;
  const Vec v[3] = {t.v[0] - centre, t.v[1] - centre, t.v[2] - centre};
  const auto separates = [&](const Vec& axis) {
    const double a = dot(axis, v[0]), b = dot(axis, v[1]), c = dot(axis, v[2]);
    const double r = half * (std::abs(axis.x) + std::abs(axis.y) + std::abs(axis.z));
    return std::min({a, b, c}) > r || std::max({a, b, c}) < -r;
  };
  const Vec e[3] = {v[1] - v[0], v[2] - v[1], v[0] - v[2]};
  if (separates(cross(e[0], e[1]))) return false;
  for (const Vec& edge : e)
    if (separates({0, -edge.z, edge.y}) || separates({edge.z, 0, -edge.x}) || separates({-edge.y, edge.x, 0}))
      return false;
  return true;
}

class NtreeGeometryCheck {
 public:
  NtreeGeometryCheck(const FileView& view, Report& report)
      : view_(view),
        report_(report),
        n_(view.header.ntree_branching),
        words_(LSP_GRID_WORDS(n_)),
        grid_(view.elements<LspBitWord>(Kind::kGrid)),
        cells_(view.elements<LspCell>(Kind::kCell)),
        references_(view.elements<uint32_t>(Kind::kRefs)),
        triangles_(view.elements<LspTriangle>(Kind::kTria)),
        spaces_(view.elements<LspLineSpace>(Kind::kLspc)) {
    const LspHeader& h = view.header;
    root_ = {to_vec(h.ntree_lo), h.ntree_size};
    // What rounding of the numbers of a cell's corner and of a triangle's test may add up to.
    const Vec lo = root_.lo, hi = lo + Vec{1, 1, 1} * root_.size;
    slack_ = std::ldexp(std::max({std::abs(lo.x), std::abs(lo.y), std::abs(lo.z), std::abs(hi.x),
                                  std::abs(hi.y), std::abs(hi.z)}),
                        -20);
  }

  void run() {
    if (grid_.empty()) return;
    place_nodes();
    for (uint64_t i = 0; i < nodes_.size(); ++i) check_cells(i);
    if ((view_.header.required_features & LSP_FEATURE_EXACT) == 0) return;
    held_.assign(triangles_.size(), 0);
    for (uint32_t reference : references_)
      if (reference < held_.size()) ++held_[reference];
    for (uint64_t t = 0; t < triangles_.size(); ++t) check_triangle(t);
  }

 private:
  // A cell of a node: the bit, its record, its cube.
  template <class Visit>
  void for_each_cell(uint64_t node, Visit&& visit) const {
    const double size = nodes_[node].size / n_;
    for (uint32_t w = 0; w < words_; ++w) {
      const LspBitWord word = grid_[node * words_ + w];
      uint64_t c = word.offset;
      for (uint32_t bits = word.bits; bits != 0; bits &= bits - 1, ++c) {
        const uint32_t index = w * 32 + static_cast<uint32_t>(__builtin_ctz(bits));
        visit(c, cube_of(node, index % n_, index / n_ % n_, index / (n_ * n_), size));
      }
    }
  }

  Cube cube_of(uint64_t node, uint32_t x, uint32_t y, uint32_t z, double size) const {
    return {nodes_[node].lo + Vec{double(x), double(y), double(z)} * size, size};
  }

  // The cube of every node: a node's comes before those of the nodes in its cells.
  void place_nodes() {
    nodes_.assign(grid_.size() / words_, root_);
    for (uint64_t i = 0; i < nodes_.size(); ++i)
      for_each_cell(i, [&](uint64_t c, const Cube& cube) {
        if (is_node(cells_[c])) nodes_[cells_[c].child] = cube;
      });
  }

  static bool is_node(const LspCell& cell) { return (cell.child & LSP_LEAF_BIT) == 0; }
  static bool is_leaf(const LspCell& cell) {
    return (cell.child & LSP_LEAF_BIT) != 0 && cell.child != LSP_NONE;
  }

  std::span<const uint32_t> references_of(const LspCell& cell) const {
    const uint64_t first = cell.child & ~LSP_LEAF_BIT;
    if (!in_range(first, cell.count, references_.size())) return {};
    return references_.subspan(first, cell.count);
  }

  // What the leaves and Line Spaces of a node's cells hold lies where the cells are.
  void check_cells(uint64_t node) {
    for_each_cell(node, [&](uint64_t c, const Cube& cube) {
      const LspCell& cell = cells_[c];
      if (cell.line_space != LSP_NONE) check_line_space(cell.line_space & LSP_LINE_SPACE_MASK, cube);
      if (!is_leaf(cell)) return;
      const std::span<const uint32_t> references = references_of(cell);
      for (uint64_t k = 0; k < references.size(); ++k) {
        if (references[k] >= triangles_.size()) continue;
        if (reaches(Corners(triangles_[references[k]]), cube, view_.header.ntree_margin + slack_)) continue;
        const uint64_t at = (cell.child & ~LSP_LEAF_BIT) + k;
        report_.add(RuleId::kTriangleOutsideCell, view_.offset_of(Kind::kRefs, at * 4),
                    view_.length_of(Kind::kRefs, 4), [&] {
                      return std::pair{element_path(Kind::kRefs, at),
                                       "triangle " + std::to_string(references[k]) + " is not near cell " +
                                           std::to_string(c)};
                    });
      }
    });
  }

  void check_line_space(uint64_t i, const Cube& cube) {
    if (i >= spaces_.size()) return;
    const Vec lo = to_vec(spaces_[i].lo), hi = to_vec(spaces_[i].hi);
    for (int a = 0; a < 3; ++a) {
      if (lo[a] <= cube.lo[a] + slack_ && hi[a] >= cube.lo[a] + cube.size - slack_) continue;
      report_.add(RuleId::kLineSpaceNotAround, view_.offset_of(Kind::kLspc, i * sizeof(LspLineSpace)),
                  view_.length_of(Kind::kLspc, 28), element_path(Kind::kLspc, i, "lo"),
                  "the box does not contain the box of its cell");
      return;
    }
  }

  // One triangle, down from the root.
  void check_triangle(uint64_t t) {
    const Corners corners(triangles_[t]);
    for (int a = 0; a < 3; ++a)
      if (!(corners.lo[a] >= root_.lo[a] - slack_ && corners.hi[a] <= root_.lo[a] + root_.size + slack_)) {
        lacking(t, [] { return std::string("a corner lies outside the cube"); });
        return;
      }
    visits_ = 0;
    descend(static_cast<uint32_t>(t), corners, 0);
  }

  // False after a finding: one a triangle will do.
  bool descend(uint32_t t, const Corners& corners, uint64_t node) {
    // Inside every node that it reaches into some leaf holds it, and nodes of one level share no leaf. Where
    // there are more visits than that allows, references are missing, though no cell shows it for sure: a
    // triangle between two cells. It also keeps a hostile file from costing more than its size.
    if (visits_++ > uint64_t{held_[t]} * (LSP_MAX_NTREE_DEPTH - 1)) {
      lacking(t, [] { return std::string("its references are fewer than the nodes that it reaches into"); });
      return false;
    }
    const Cube cube = nodes_[node];
    const double size = cube.size / n_;
    uint32_t first[3], last[3];
    for (int a = 0; a < 3; ++a) {
      const auto index = [&](double at) {
        return static_cast<uint32_t>(std::clamp(std::floor((at - cube.lo[a]) / size), 0.0, n_ - 1.0));
      };
      first[a] = index(corners.lo[a]);
      last[a] = index(corners.hi[a]);
    }
    for (uint32_t z = first[2]; z <= last[2]; ++z)
      for (uint32_t y = first[1]; y <= last[1]; ++y)
        for (uint32_t x = first[0]; x <= last[0]; ++x)
          if (!enter(t, corners, node, LSP_CELL_INDEX(x, y, z, n_), cube_of(node, x, y, z, size)))
            return false;
    return true;
  }

  bool enter(uint32_t t, const Corners& corners, uint64_t node, uint32_t index, const Cube& cube) {
    const LspBitWord word = grid_[node * words_ + index / 32];
    const uint32_t bit = 1u << index % 32;
    const bool filled = (word.bits & bit) != 0;
    const uint64_t c =
        filled ? uint64_t{word.offset} + static_cast<uint32_t>(__builtin_popcount(word.bits & (bit - 1))) : 0;
    if (filled && is_leaf(cells_[c])) {
      const std::span<const uint32_t> references = references_of(cells_[c]);
      if (std::binary_search(references.begin(), references.end(), t)) return true;
    }
    if (!reaches(corners, cube, -slack_)) return true;
    if (filled && is_node(cells_[c])) return descend(t, corners, cells_[c].child);
    lacking(t, [&] {
      return filled ? "cell " + std::to_string(c) + " does not hold it"
                    : "it reaches into cell " + std::to_string(index) + " of node " + std::to_string(node) +
                          ", which is empty";
    });
    return false;
  }

  template <class Describe>
  void lacking(uint64_t t, Describe&& message) {
    report_.add(RuleId::kCellLacksTriangle, view_.offset_of(Kind::kTria, t * sizeof(LspTriangle)),
                view_.length_of(Kind::kTria, sizeof(LspTriangle)), [&] {
                  return std::pair{element_path(Kind::kTria, t), message()};
                });
  }

  const FileView& view_;
  Report& report_;
  uint32_t n_, words_;
  std::span<const LspBitWord> grid_;
  std::span<const LspCell> cells_;
  std::span<const uint32_t> references_;
  std::span<const LspTriangle> triangles_;
  std::span<const LspLineSpace> spaces_;
  Cube root_{};
  double slack_ = 0;
  std::vector<Cube> nodes_;
  std::vector<uint32_t> held_;  // references to a triangle
  uint64_t visits_ = 0;         // of nodes, with the triangle that is looked at
};

}  // namespace

void check_ntree_geometry(const FileView& view, Report& report) { NtreeGeometryCheck(view, report).run(); }

}  // namespace lsp::format
