// Conservative Line Spaces: whether their clear bits are true.
//
// Every point of a line between two patches lies in the convex hull of the two. So a clear bit is false where
// a triangle of the node meets that hull, grown by a margin. Patches are axis-aligned: every face of the
// hull, grown or not, contains an edge along an axis, so that the hull is what its three projections along
// the axes have in common, each a rectangle with corners cut off:
//
//        o-------.              two patches, seen along an axis (one of them may be a line): the hull's
//        | first  `--.          borders are those of the box around both, and tangents of both that touch
//        o--.         `--o      corners on the same side
//            `--.        | second
//                `-------o
//
// That is exact: a triangle clipped by those half-planes is empty or not. The margin is half of what the
// format promises (SPEC.md, section 7), so that no rounding, of a writer or of this check, raises a false
// alarm. Only the part of a line between its patches is looked at. Beyond them, outside the box, triangles of
// the node may lie too where a spatial split or a cell cut them; a tracer meets these in the nodes around as
// well.
//
// The triangles of a node follow one another, in TRIA or in REFS. Boxes around 8, 64, 512 ... of them are
// made once for the whole file, and every row of clear bits descends to what may touch it.
#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <numeric>

#include "layers.h"
#include "line_space.h"

namespace lsp::format {
namespace {

// What the check may cost in steps of some 6 ns: for every shaft of the file, at least, and at most. A step
// is a test of a box against a hull; making a hull and clipping a triangle count as several. Sound bakes of
// the test scenes take 1 to 40 a shaft, so that all their bits are looked at; of a file that asks for more, a
// part is.
constexpr uint64_t kStepsPerShaft = 128;
constexpr uint64_t kStepsAtLeast = uint64_t{1} << 20;
constexpr uint64_t kMostSteps = uint64_t{1} << 30;
constexpr uint64_t kHullSteps = 4;
constexpr uint64_t kClipSteps = 8;

using Point = std::array<double, 3>;

Point to_point(const lsp_float3& v) { return {v.x, v.y, v.z}; }

// Axis-aligned; lower and upper coordinates by axis.
struct Box {
  Point lo, hi;
};

// Boxes of triangles as their corners are, in 24 bytes. The empty one overlaps none.
struct Bounds {
  static constexpr float kInfinity = std::numeric_limits<float>::infinity();
  float at[6] = {kInfinity, kInfinity, kInfinity, -kInfinity, -kInfinity, -kInfinity};  // lo, hi

  void add(const lsp_float3& v) {
    const float p[3] = {v.x, v.y, v.z};
    for (int k = 0; k < 3; ++k) {
      at[k] = std::min(at[k], p[k]);
      at[3 + k] = std::max(at[3 + k], p[k]);
    }
  }
  void add(const Bounds& other) {
    for (int k = 0; k < 3; ++k) {
      at[k] = std::min(at[k], other.at[k]);
      at[3 + k] = std::max(at[3 + k], other.at[3 + k]);
    }
  }
};

// Nothing where a corner is not finite.
Bounds bounds_of(const LspTriangle& t) {
  Bounds bounds;
  if (!finite(t.v0) || !finite(t.v1) || !finite(t.v2)) return bounds;
  for (const lsp_float3* v : {&t.v0, &t.v1, &t.v2}) bounds.add(*v);
  return bounds;
}

// Whether a box overlaps the box around two others.
bool overlap_around(const Box& a, const Box& b, const Bounds& box) {
  for (int k = 0; k < 3; ++k)
    if (box.at[k] > std::max(a.hi[k], b.hi[k]) || box.at[3 + k] < std::min(a.lo[k], b.lo[k])) return false;
  return true;
}

// The convex hull of two boxes, which outlive it.
class Hull {
 public:
  Hull(const Box& a, const Box& b) : boxes_{&a, &b} {
    for (int k = 0; k < 3; ++k) {
      lo_[k] = std::min(a.lo[k], b.lo[k]);
      hi_[k] = std::max(a.hi[k], b.hi[k]);
    }
    for (const auto& [x, y] : {std::pair{0, 1}, {0, 2}, {1, 2}})
      for (int right : {0, 1})
        for (int up : {0, 1}) {
          // The tangent through the corners of both towards this quadrant, where its normal points there too.
          const double ax = (right ? a.hi : a.lo)[x], ay = (up ? a.hi : a.lo)[y];
          const double dx = (right ? b.hi : b.lo)[x] - ax, dy = (up ? b.hi : b.lo)[y] - ay;
          if (!(right == up ? dx * dy < 0 : dx * dy > 0)) continue;
          const double nx = right ? std::abs(dy) : -std::abs(dy), ny = up ? std::abs(dx) : -std::abs(dx);
          tangents_[count_++] = {nx, ny, nx * ax + ny * ay, x, y, right ? x : 3 + x, up ? y : 3 + y};
        }
  }

  // Whether a border of the hull has all of the box outside. False does not say that they meet.
  bool misses(const Bounds& box) const {
    const float* at = box.at;
    if (at[0] > hi_[0] || at[1] > hi_[1] || at[2] > hi_[2] || at[3] < lo_[0] || at[4] < lo_[1] ||
        at[5] < lo_[2])
      return true;
    for (int i = 0; i < count_; ++i) {
      const Tangent& t = tangents_[i];
      if (t.nx * at[t.near_x] + t.ny * at[t.near_y] > t.limit) return true;
    }
    return false;
  }

  // Whether a point of the triangle lies in the hull. Its corners are finite.
  bool meets(const LspTriangle& triangle) const {
    const std::array<Point, 3> v = {to_point(triangle.v0), to_point(triangle.v1), to_point(triangle.v2)};
    if (beside_plane(v)) return false;
    for (int i = 0; i < count_; ++i) {
      const Tangent& t = tangents_[i];
      if (t.outside(v[0]) > 0 && t.outside(v[1]) > 0 && t.outside(v[2]) > 0) return false;
    }
    Polygon p, other;
    std::copy(v.begin(), v.end(), p.corners);
    p.count = 3;
    for (int k = 0; k < 3; ++k) {
      if (!clip(p, other, [&](const Point& at) { return at[k] - hi_[k]; })) return false;
      if (!clip(p, other, [&](const Point& at) { return lo_[k] - at[k]; })) return false;
    }
    for (int i = 0; i < count_; ++i)
      if (!clip(p, other, [&](const Point& at) { return tangents_[i].outside(at); })) return false;
    return true;
  }

 private:
  // nx x + ny y <= limit; of a box, the corner that is furthest inside has the coordinates near_x and near_y.
  struct Tangent {
    double nx, ny, limit;
    int x, y, near_x, near_y;
    double outside(const Point& p) const { return nx * p[x] + ny * p[y] - limit; }
  };
  // A triangle cut by half-spaces, each of which adds a corner at most.
  struct Polygon {
    static constexpr int kMost = 24;
    Point corners[kMost];
    int count;
  };

  // Keeps the part where the linear function is not positive (Sutherland, Hodgman 1974); false where none is
  // left. Every corner kept is a point of the triangle, so that no rounding finds what is not there.
  // `other` is room to work in.
  template <class F>
  static bool clip(Polygon& p, Polygon& other, F&& f) {
    double value[Polygon::kMost];
    bool any_out = false;
    for (int i = 0; i < p.count; ++i) any_out |= (value[i] = f(p.corners[i])) > 0;
    if (!any_out) return true;
    other.count = 0;
    for (int i = 0; i < p.count; ++i) {
      const int next = i + 1 == p.count ? 0 : i + 1;
      if (other.count + 2 > Polygon::kMost) return false;  // only a polygon that rounding has made concave
      const Point &a = p.corners[i], &b = p.corners[next];
      if (value[i] <= 0) other.corners[other.count++] = a;
      if ((value[i] <= 0) == (value[next] <= 0)) continue;
      const double s = value[i] / (value[i] - value[next]);
      other.corners[other.count++] = {a[0] + s * (b[0] - a[0]), a[1] + s * (b[1] - a[1]),
                                      a[2] + s * (b[2] - a[2])};
    }
    p.count = other.count;
    std::copy_n(other.corners, other.count, p.corners);
    return p.count != 0;
  }

  // Whether all of the hull lies on one side of the triangle's plane.
  bool beside_plane(const std::array<Point, 3>& v) const {
    const Point e = minus(v[1], v[0]), f = minus(v[2], v[0]);
    const Point n = {e[1] * f[2] - e[2] * f[1], e[2] * f[0] - e[0] * f[2], e[0] * f[1] - e[1] * f[0]};
    double least[2] = {0, 0}, most[2] = {0, 0};
    for (int k = 0; k < 3; ++k)
      for (int i = 0; i < 2; ++i) {
        const double low = n[k] * (boxes_[i]->lo[k] - v[0][k]), high = n[k] * (boxes_[i]->hi[k] - v[0][k]);
        least[i] += std::min(low, high);
        most[i] += std::max(low, high);
      }
    return std::min(least[0], least[1]) > 0 || std::max(most[0], most[1]) < 0;
  }
  static Point minus(const Point& a, const Point& b) { return {a[0] - b[0], a[1] - b[1], a[2] - b[2]}; }

  const Box* boxes_[2];
  Point lo_, hi_;
  std::array<Tangent, 12> tangents_;
  int count_ = 0;
};

// The triangles of a node: part of TRIA, or of REFS.
struct Run {
  uint64_t first = std::numeric_limits<uint64_t>::max();
  uint64_t end = 0;
  void add(const Run& other) {
    first = std::min(first, other.first);
    end = std::max(end, other.end);
  }
  bool empty() const { return first >= end; }
};

class ConservativeCheck {
 public:
  ConservativeCheck(const FileView& view, Report& report)
      : view_(view),
        report_(report),
        triangles_(view.elements<LspTriangle>(Kind::kTria)),
        references_(view.elements<uint32_t>(Kind::kRefs)),
        spaces_(view.elements<LspLineSpace>(Kind::kLspc)),
        words_(view.elements<LspBitWord>(Kind::kBits)),
        items_(is_ntree(view.header) ? references_.size() : triangles_.size()) {
    const Point lo = to_point(view.header.bounds_min), hi = to_point(view.header.bounds_max);
    double extent = 0, reach = 0;
    for (int k = 0; k < 3; ++k) {
      extent = std::max(extent, hi[k] - lo[k]);
      reach = std::max({reach, std::abs(lo[k]), std::abs(hi[k])});
    }
    grow_ = std::ldexp(extent, -18) + std::ldexp(reach, -21);
  }

  void run() {
    uint64_t spaces = 0, shafts = 0;
    for (const LspLineSpace& space : spaces_)
      if (conservative(space)) {
        ++spaces;
        shafts += shape_of(space.format).shafts;
      }
    if (spaces == 0 || items_ == 0) return;
    find_runs();
    build_boxes();
    // Shared out from the end of the file: the Line Spaces of the largest nodes come first in it, and what
    // the others leave is theirs. None takes more than sixteen times its part.
    uint64_t left = std::min(kMostSteps, kStepsAtLeast + kStepsPerShaft * shafts);
    for (uint64_t i = spaces_.size(); i-- > 0;) {
      if (!conservative(spaces_[i])) continue;
      steps_ = std::min(left, left / spaces-- * 16);
      const uint64_t share = steps_;
      if (!runs_[i].empty() && runs_[i].end <= items_) check_space(i);
      left -= share - steps_;
    }
  }

 private:
  static bool conservative(const LspLineSpace& space) {
    const LineSpaceShape shape = shape_of(space.format);
    return (space.format & LSP_FORMAT_CONSERVATIVE) != 0 && shape.entry_bytes == 0 && shape.words != 0;
  }

  // ---- which triangles belong to a Line Space: a node's are in one piece, since leaves are in order ----

  void find_runs() {
    runs_.resize(spaces_.size());
    if (is_ntree(view_.header))
      find_cell_runs();
    else
      find_node_runs();
  }

  void assign(uint32_t line_space, const Run& run) {
    const uint64_t index = line_space & LSP_LINE_SPACE_MASK;
    if (line_space != LSP_NONE && index < runs_.size()) runs_[index] = run;
  }

  // Of a child of a BVH, given those of the nodes by their numbers; the nodes below a node come after it.
  Run run_of(uint32_t child, const std::vector<Run>& nodes) const {
    if (child == LSP_NONE) return {};
    if (!(child & LSP_LEAF_BIT)) return nodes[child];
    const uint64_t first = child & LSP_LEAF_FIRST_MASK;
    return {first, first + (child >> LSP_LEAF_COUNT_SHIFT & LSP_LEAF_COUNT_MASK) + 1};
  }

  void find_node_runs() {
    const std::span<const LspNode> nodes = view_.elements<LspNode>(Kind::kNode);
    std::vector<Run> below(nodes.size());
    for (uint64_t i = nodes.size(); i-- > 0;) {
      const LspNode& node = nodes[i];
      for (const auto& [child, space] :
           {std::pair{node.child0, node.line_space0}, {node.child1, node.line_space1}}) {
        const Run run = run_of(child, below);
        below[i].add(run);
        assign(space, run);
      }
    }
    assign(view_.header.root_line_space, run_of(view_.header.root, below));
  }

  void find_cell_runs() {
    const std::span<const LspBitWord> grid = view_.elements<LspBitWord>(Kind::kGrid);
    const std::span<const LspCell> cells = view_.elements<LspCell>(Kind::kCell);
    const uint64_t words = LSP_GRID_WORDS(view_.header.ntree_branching);
    std::vector<Run> below(grid.size() / words);
    uint64_t end = cells.size();
    for (uint64_t i = below.size(); i-- > 0;) {
      const uint64_t first = grid[i * words].offset;
      for (uint64_t c = first; c < end; ++c) {
        const LspCell& cell = cells[c];
        Run run;
        if (!(cell.child & LSP_LEAF_BIT))
          run = below[cell.child];
        else if (cell.child != LSP_NONE)
          run = {cell.child & ~LSP_LEAF_BIT, uint64_t{cell.child & ~LSP_LEAF_BIT} + cell.count};
        if (!run.empty()) below[i].add(run);
        assign(cell.line_space, run);
      }
      end = first;
    }
    if (!below.empty()) assign(view_.header.root_line_space, below[0]);
  }

  // ---- boxes around triangles ----

  // A triangle of the run's elements; nothing where a reference is out of range.
  const LspTriangle* triangle(uint64_t item) const {
    const uint64_t index = is_ntree(view_.header) ? references_[item] : item;
    return index < triangles_.size() ? &triangles_[index] : nullptr;
  }

  void build_boxes() {
    levels_.emplace_back((items_ + 7) / 8);
    for (uint64_t i = 0; i < items_; ++i)
      if (const LspTriangle* t = triangle(i)) levels_[0][i / 8].add(bounds_of(*t));
    while (levels_.back().size() > 8) {
      const std::vector<Bounds>& below = levels_.back();
      std::vector<Bounds> level((below.size() + 7) / 8);
      for (uint64_t i = 0; i < below.size(); ++i) level[i / 8].add(below[i]);
      levels_.push_back(std::move(level));
    }
  }

  // Appends the elements of [first, end) whose boxes the hull does not miss to found_. Of the level's boxes,
  // each of which stands for 8^(level + 1) elements, it looks at those from block on, to last_block.
  void descend(const Hull& hull, const Run& run, int level, uint64_t block, uint64_t last_block) {
    const int shift = 3 * (level + 1);
    block = std::max(block, run.first >> shift);
    last_block = std::min(last_block, (run.end - 1) >> shift);
    for (; block <= last_block && steps_ != 0; ++block) {
      spend();
      if (hull.misses(levels_[level][block])) continue;
      if (level > 0) {
        descend(hull, run, level - 1, block * 8, block * 8 + 7);
        continue;
      }
      const uint64_t end = std::min(run.end, block * 8 + 8);
      for (uint64_t i = std::max(run.first, block * 8); i < end; ++i) {
        spend();
        const LspTriangle* t = triangle(i);
        if (t == nullptr) continue;
        const Bounds bounds = bounds_of(*t);
        if (!hull.misses(bounds)) found_.push_back({bounds, t});
      }
    }
  }

  void spend(uint64_t steps = 1) { steps_ -= std::min(steps_, steps); }

  // ---- one Line Space ----

  void check_space(uint64_t i) {
    space_ = &spaces_[i];
    shape_ = shape_of(space_->format);
    bits_ = words_.subspan(space_->word_first, shape_.words);
    place_patches();
    // Rows of patches as seen from a patch: 15 pairs of faces, N^2 patches, N rows. In an order that is
    // scattered evenly, so that what a check that ends early has looked at is everywhere.
    const uint64_t n = shape_.resolution, rows = 15 * n * n * n;
    uint64_t stride = rows * 618 / 1000 | 1;
    while (std::gcd(stride, rows) != 1) stride += 2;
    uint64_t at = 0;
    for (uint64_t k = 0; k < rows && steps_ != 0; ++k) {
      check_row(i, at);
      at = (at + stride) % rows;
    }
  }

  // Shafts from one patch to the patches of a row.
  void check_row(uint64_t space, uint64_t row) {
    const uint32_t n = shape_.resolution;
    uint32_t a = 0, b = 1 + static_cast<uint32_t>(row / (uint64_t{n} * n * n));
    for (; b > 5; ++a) b -= 4 - a;  // 01 02 03 04 05 12 13 ... 45
    const uint32_t patch_a = static_cast<uint32_t>(row / n % (n * n));
    const uint32_t first = static_cast<uint32_t>(row % n) * n;
    uint32_t clear = 0;  // bit u: the patch of number first + u
    for (uint32_t u = 0; u < n; ++u) {
      const auto [there, back] = shafts(a, b, patch_a, first + u);
      if (!is_set(there) || !is_set(back)) clear |= 1u << u;
    }
    if (clear == 0) return;
    spend(kHullSteps);
    const Box& from = box_of(a, patch_a);
    const uint32_t low = static_cast<uint32_t>(std::countr_zero(clear)),
                   high = 31 - static_cast<uint32_t>(std::countl_zero(clear));
    Box to = box_of(b, first + low);
    to.hi = box_of(b, first + high).hi;
    const Run& run = runs_[space];
    int level = 0;
    while (level + 1 < static_cast<int>(levels_.size()) &&
           ((run.end - 1) >> 3 * (level + 1)) - (run.first >> 3 * (level + 1)) >= 8)
      ++level;
    found_.clear();
    descend(Hull(from, to), run, level, 0, ~uint64_t{0});
    if (found_.empty()) return;
    for (uint32_t u = low; u <= high; ++u)
      if (clear >> u & 1) check_shaft(space, a, b, patch_a, first + u, from);
  }

  void check_shaft(uint64_t space, uint32_t a, uint32_t b, uint32_t patch_a, uint32_t patch_b,
                   const Box& from) {
    const Box& to = box_of(b, patch_b);
    const bool apart = std::none_of(found_.begin(), found_.end(),
                                    [&](const Near& near) { return overlap_around(from, to, near.bounds); });
    spend(kHullSteps + found_.size() / 4);
    if (apart) return;
    const Hull hull(from, to);
    for (const auto& [bounds, triangle] : found_) {
      spend();
      if (steps_ == 0) return;
      if (hull.misses(bounds)) continue;
      spend(kClipSteps);
      if (!hull.meets(*triangle)) continue;
      const auto [there, back] = shafts(a, b, patch_a, patch_b);
      if (!is_set(there)) find(space, there, *triangle);
      if (back != there && !is_set(back)) find(space, back, *triangle);
      return;
    }
  }

  // The numbers of a shaft and of the one in the other direction, of faces a < b.
  std::pair<uint64_t, uint64_t> shafts(uint32_t a, uint32_t b, uint32_t patch_a, uint32_t patch_b) const {
    const uint32_t n = shape_.resolution;
    if (shape_.symmetric) {
      const uint64_t shaft = LSP_SHAFT_INDEX_SYMMETRIC(a, b, patch_a, patch_b, n);
      return {shaft, shaft};
    }
    return {LSP_SHAFT_INDEX(a, b, patch_a, patch_b, n), LSP_SHAFT_INDEX(b, a, patch_b, patch_a, n)};
  }
  bool is_set(uint64_t shaft) const { return (bits_[shaft / 32].bits >> shaft % 32 & 1) != 0; }

  // All patches of the Line Space, face by face, grown by the margin.
  void place_patches() {
    const uint32_t n = shape_.resolution;
    const Point lo = to_point(space_->lo), hi = to_point(space_->hi);
    patches_.clear();
    for (int face = 0; face < 6; ++face) {
      const int axis = face / 2, u = axis == 0 ? 1 : 0, v = axis == 2 ? 1 : 2;
      Box box;
      box.lo[axis] = (face % 2 == 0 ? lo : hi)[axis] - grow_;
      box.hi[axis] = (face % 2 == 0 ? lo : hi)[axis] + grow_;
      const auto place = [&](int k, uint32_t i) {
        box.lo[k] = lo[k] + (hi[k] - lo[k]) * i / n - grow_;
        box.hi[k] = lo[k] + (hi[k] - lo[k]) * (i + 1) / n + grow_;
      };
      for (uint32_t patch = 0; patch < n * n; ++patch) {
        place(u, patch % n);
        place(v, patch / n);
        patches_.push_back(box);
      }
    }
  }
  const Box& box_of(uint32_t face, uint32_t patch) const {
    return patches_[uint64_t{face} * shape_.resolution * shape_.resolution + patch];
  }

  void find(uint64_t space, uint64_t shaft, const LspTriangle& triangle) {
    const uint64_t word = space_->word_first + shaft / 32;
    report_.add(RuleId::kShaftNotEmpty, view_.offset_of(Kind::kBits, word * sizeof(LspBitWord)),
                view_.length_of(Kind::kBits, 4), [&] {
                  return std::pair{element_path(Kind::kBits, word, "bits"),
                                   "shaft " + std::to_string(shaft) + " of Line Space " +
                                       std::to_string(space) + " is said to be empty, but triangle " +
                                       std::to_string(&triangle - triangles_.data()) + " reaches into it"};
                });
  }

  struct Near {
    Bounds bounds;
    const LspTriangle* triangle;
  };

  const FileView& view_;
  Report& report_;
  std::span<const LspTriangle> triangles_;
  std::span<const uint32_t> references_;
  std::span<const LspLineSpace> spaces_;
  std::span<const LspBitWord> words_;
  uint64_t items_;                           // triangles, or references of an NTree
  double grow_ = 0;                          // half the margin, in scene units
  std::vector<Run> runs_;                    // of every Line Space
  std::vector<std::vector<Bounds>> levels_;  // around 8, 64, 512 ... items
  uint64_t steps_ = 0;                       // that the Line Space may still spend
  const LspLineSpace* space_ = nullptr;
  LineSpaceShape shape_;
  std::span<const LspBitWord> bits_;
  std::vector<Box> patches_;
  std::vector<Near> found_;  // triangles near the row that is looked at
};

}  // namespace

void check_conservative(const FileView& view, Report& report) { ConservativeCheck(view, report).run(); }

}  // namespace lsp::format
