#include "conservative.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>

#include "lsp/empty_margin.h"
#include "vectors.h"

namespace lsp {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

constexpr int axis_of(uint32_t face) { return int(face / 2); }
constexpr int other_axis(int axis, int which) {
  return which == 0 ? (axis == 0 ? 1 : 0) : (axis == 2 ? 1 : 2);
}

// A convex polygon: a triangle and what half-spaces leave of it, each of which adds a corner at most.
struct Polygon {
  static constexpr int kMost = 24;
  double x[3][kMost];
  int count = 0;

  void push(double a, double b, double c) {
    x[0][count] = a;
    x[1][count] = b;
    x[2][count++] = c;
  }
  double least(int axis) const { return *std::min_element(x[axis], x[axis] + count); }
  double most(int axis) const { return *std::max_element(x[axis], x[axis] + count); }
};

// Keeps the part where f <= 0, f being linear; `f(polygon, i)` is its value at corner i.
template <typename F>
void clip(Polygon& polygon, F&& f) {
  double value[Polygon::kMost];
  bool any_in = false, any_out = false;
  for (int i = 0; i < polygon.count; ++i) {
    value[i] = f(polygon, i);
    (value[i] <= 0 ? any_in : any_out) = true;
  }
  if (!any_out) return;
  if (!any_in) {
    polygon.count = 0;
    return;
  }
  // A polygon that is thinner than rounding may seem to cross the line more than twice: it stays whole, which
  // errs to the safe side and keeps the corners few.
  int crossings = 0;
  for (int i = 0; i < polygon.count; ++i)
    crossings += (value[i] <= 0) != (value[i + 1 == polygon.count ? 0 : i + 1] <= 0);
  if (crossings != 2) return;
  const Polygon old = polygon;
  polygon.count = 0;
  for (int i = 0; i < old.count; ++i) {
    const int next = i + 1 == old.count ? 0 : i + 1;
    if (value[i] <= 0) polygon.push(old.x[0][i], old.x[1][i], old.x[2][i]);
    if ((value[i] <= 0) == (value[next] <= 0)) continue;
    const double s = value[i] / (value[i] - value[next]);
    const auto at = [&](int k) { return old.x[k][i] + s * (old.x[k][next] - old.x[k][i]); };
    polygon.push(at(0), at(1), at(2));
  }
}

void clip_below(Polygon& polygon, int axis, double most) {
  clip(polygon, [&](const Polygon& p, int i) { return p.x[axis][i] - most; });
}
void clip_above(Polygon& polygon, int axis, double least) {
  clip(polygon, [&](const Polygon& p, int i) { return least - p.x[axis][i]; });
}

// An axis-aligned rectangle of a coordinate plane.
struct Rect {
  double lo[2], hi[2];
  double corner(int k, int sign) const { return sign > 0 ? hi[k] : lo[k]; }
};

// Where on a line through both patches, of which the first is on the face of smaller number.
enum class Part { kBetween, kBeyondFirst, kBeyondSecond };

// A part of the lines through two patches, seen in a coordinate plane: within [lo, hi], and
// line[i][0] x + line[i][1] y <= line[i][2].
struct Region {
  double lo[2] = {-kInfinity, -kInfinity};
  double hi[2] = {kInfinity, kInfinity};
  double line[2][3];
  int lines = 0;

  // The tangent through `a` and `b`, corners of both rectangles in the directions that (sx, sy) says, if it
  // has a normal between these directions.
  void add_tangent(double ax, double ay, double bx, double by, int sx, int sy) {
    const double dx = bx - ax, dy = by - ay;
    if (!(dx * dy * (sx * sy) < 0) || lines == 2) return;
    double nx = dy, ny = -dx;
    const double scale = (nx * sx < 0 ? -1 : 1) / (std::fabs(nx) + std::fabs(ny));
    nx *= scale;
    ny *= scale;
    double* l = line[lines++];
    l[0] = nx;
    l[1] = ny;
    l[2] = std::max(nx * ax + ny * ay, nx * bx + ny * by);
  }
};

// The convex hull of both.
Region between(const Rect& a, const Rect& b) {
  Region r;
  for (int k = 0; k < 2; ++k) {
    r.lo[k] = std::min(a.lo[k], b.lo[k]);
    r.hi[k] = std::max(a.hi[k], b.hi[k]);
  }
  for (int sx : {-1, 1})
    for (int sy : {-1, 1})
      r.add_tangent(a.corner(0, sx), a.corner(1, sy), b.corner(0, sx), b.corner(1, sy), sx, sy);
  return r;
}

// `to` and all that lies behind it on lines that come from `from`: the half-planes about `to` whose border
// separates it from `from`. None does where they overlap.
Region beyond(const Rect& from, const Rect& to) {
  Region r;
  for (int k = 0; k < 2; ++k) {
    if (to.hi[k] <= from.lo[k]) r.hi[k] = to.hi[k];
    if (to.lo[k] >= from.hi[k]) r.lo[k] = to.lo[k];
  }
  for (int sx : {-1, 1})
    for (int sy : {-1, 1})
      r.add_tangent(from.corner(0, -sx), from.corner(1, -sy), to.corner(0, sx), to.corner(1, sy), sx, sy);
  return r;
}

Region region(Part part, const Rect& first, const Rect& second) {
  if (part == Part::kBetween) return between(first, second);
  return part == Part::kBeyondSecond ? beyond(first, second) : beyond(second, first);
}

// A region in the plane of two of the axes.
struct View {
  const Region* region;
  int axis[2];
};

// A polygon's extent beside it, for many quick tests.
struct Extent {
  double lo[3], hi[3];
  Extent() = default;
  explicit Extent(const Polygon& p) {
    for (int k = 0; k < 3; ++k) {
      lo[k] = p.least(k);
      hi[k] = p.most(k);
    }
  }
};

// Whether one of the region's borders has all of the polygon outside.
bool misses(const Region& r, int axis0, int axis1, const Polygon& p, const Extent& e) {
  if (e.lo[axis0] > r.hi[0] || e.hi[axis0] < r.lo[0] || e.lo[axis1] > r.hi[1] || e.hi[axis1] < r.lo[1])
    return true;
  for (int l = 0; l < r.lines; ++l) {
    const double nx = r.line[l][0], ny = r.line[l][1], limit = r.line[l][2];
    bool out = true;
    for (int i = 0; i < p.count && out; ++i) out = nx * p.x[axis0][i] + ny * p.x[axis1][i] > limit;
    if (out) return true;
  }
  return false;
}

// Whether the polygon and all the regions together have a point in common.
template <size_t kViews>
bool meets(const Polygon& polygon, const std::array<View, kViews>& views) {
  double lo[3] = {-kInfinity, -kInfinity, -kInfinity}, hi[3] = {kInfinity, kInfinity, kInfinity};
  for (const View& v : views)
    for (int k = 0; k < 2; ++k) {
      lo[v.axis[k]] = std::max(lo[v.axis[k]], v.region->lo[k]);
      hi[v.axis[k]] = std::min(hi[v.axis[k]], v.region->hi[k]);
    }
  Polygon p = polygon;
  for (int k = 0; k < 3; ++k) {
    clip_below(p, k, hi[k]);
    if (p.count) clip_above(p, k, lo[k]);
    if (!p.count) return false;
  }
  for (const View& v : views)
    for (int l = 0; l < v.region->lines; ++l) {
      const double* line = v.region->line[l];
      clip(p, [&](const Polygon& q, int i) {
        return line[0] * q.x[v.axis[0]][i] + line[1] * q.x[v.axis[1]][i] - line[2];
      });
      if (!p.count) return false;
    }
  return true;
}

// The regions of all shafts of a box. Two patches on opposite faces are independent in the other two axes; of
// two on adjacent faces, with the axes p, q of their faces and the axis c that both share,
//
//   corner  seen along c:           a (first, along q), d (second, along p)
//   side    seen along q, or along p: one is a segment there, the other a rectangle, so of the four indices
//                                   the two along c and the rectangle's other
struct Tables {
  std::vector<Region> opposite[3][2];  // axis, other axis; [first * N + second]
  std::vector<Region> corner[6][6];    // first face, second; [a * N + d]
  std::vector<Region> side[6][2];      // face of the segment, which of its axes is c;
                                       // [(rectangle's other * N + first's c) * N + second's c]
};

}  // namespace

double empty_margin(const LspHeader& header) {
  const glm::dvec3 lo = dvec(header.bounds_min), hi = dvec(header.bounds_max);
  const glm::dvec3 extent = hi - lo, reach = glm::max(glm::abs(lo), glm::abs(hi));
  return 2.02 * (double(LSP_EMPTY_EXTENT) * std::max({extent.x, extent.y, extent.z}) +
                 double(LSP_EMPTY_REACH) * std::max({reach.x, reach.y, reach.z}));
}

bool reaches_into(const LspTriangle& triangle, const glm::dvec3& lo, const glm::dvec3& hi) {
  Polygon p;
  for (const lsp_float3& v : {triangle.v0, triangle.v1, triangle.v2}) p.push(v.x, v.y, v.z);
  for (int k = 0; k < 3; ++k) {
    clip_below(p, k, hi[k]);
    if (p.count) clip_above(p, k, lo[k]);
    if (!p.count) return false;
  }
  return true;
}

// In coordinates of the box, from 0 to 1 along every axis.
class TouchedShafts::Impl {
 public:
  Impl(const glm::vec3& lo, const glm::vec3& hi, double margin, uint32_t resolution)
      : n_(resolution),
        words_((resolution * resolution + 63) / 64),
        lo_(lo),
        scale_(1.0 / (glm::dvec3(hi) - lo_)),
        margin_(margin * scale_) {}

  void add(const LspTriangle& triangle, uint32_t record, std::span<uint32_t> shafts) {
    record_ = record;
    shafts_ = shafts;
    Polygon whole;
    bool inside = true;
    for (const lsp_float3& v : {triangle.v0, triangle.v1, triangle.v2}) {
      const glm::dvec3 x = (dvec(v) - lo_) * scale_;
      whole.push(x.x, x.y, x.z);
      for (int k = 0; k < 3; ++k) inside = inside && x[k] >= margin_[k] && x[k] <= 1 - margin_[k];
    }
    Polygon part = whole;
    for (int k = 0; k < 3 && !inside && part.count; ++k) {
      clip_below(part, k, 1 + margin_[k]);
      if (part.count) clip_above(part, k, -margin_[k]);
    }
    if (part.count) {
      start(Part::kBetween, part);
      for (uint32_t first = 0; first < 6; ++first)
        for (uint32_t second = first + 1; second < 6; ++second) mark_pair(first, second);
    }
    if (inside) return;
    for (uint32_t face = 0; face < 6; ++face) {
      const int k = axis_of(face);
      part = whole;
      if (face % 2)
        clip_above(part, k, 1 - margin_[k]);
      else
        clip_below(part, k, margin_[k]);
      if (!part.count) continue;
      for (const Part where : {Part::kBeyondFirst, Part::kBeyondSecond}) {
        start(where, part);
        if (where == Part::kBeyondFirst)
          for (uint32_t second = face + 1; second < 6; ++second) mark_pair(face, second);
        else
          for (uint32_t first = 0; first < face; ++first) mark_pair(first, face);
      }
    }
  }

 private:
  struct Span {
    double lo, hi;
  };
  Span plane(uint32_t face) const {
    const double at = face % 2, m = margin_[axis_of(face)];
    return {at - m, at + m};
  }
  Span patch(int axis, uint32_t i) const {
    return {i / double(n_) - margin_[axis], (i + 1) / double(n_) + margin_[axis]};
  }
  static Rect rect(const Span& x, const Span& y) { return {{x.lo, y.lo}, {x.hi, y.hi}}; }

  void build(Part part, Tables& t) const {
    for (int axis = 0; axis < 3; ++axis)
      for (int which = 0; which < 2; ++which) {
        const int u = other_axis(axis, which);
        const Span low = plane(uint32_t(2 * axis)), high = plane(uint32_t(2 * axis + 1));
        for (uint32_t i = 0; i < n_; ++i)
          for (uint32_t k = 0; k < n_; ++k)
            t.opposite[axis][which].push_back(region(part, rect(patch(u, i), low), rect(patch(u, k), high)));
      }
    for (uint32_t f = 0; f < 6; ++f)
      for (uint32_t g = f + 1; g < 6; ++g) {
        const int p = axis_of(f), q = axis_of(g);
        if (p == q) continue;
        for (uint32_t a = 0; a < n_; ++a)
          for (uint32_t d = 0; d < n_; ++d)
            t.corner[f][g].push_back(region(part, rect(plane(f), patch(q, a)), rect(patch(p, d), plane(g))));
      }
    for (uint32_t f = 0; f < 6; ++f)
      for (int which = 0; which < 2; ++which) {
        const int p = axis_of(f), c = other_axis(p, which), q = 3 - p - c;
        const bool is_first = p < q;
        for (uint32_t d = 0; d < n_; ++d)
          for (uint32_t b = 0; b < n_; ++b)
            for (uint32_t e = 0; e < n_; ++e) {
              const Rect segment = rect(plane(f), patch(c, is_first ? b : e));
              const Rect other = rect(patch(p, d), patch(c, is_first ? e : b));
              t.side[f][which].push_back(is_first ? region(part, segment, other)
                                                  : region(part, other, segment));
            }
      }
  }

  void start(Part part, const Polygon& polygon) {
    tables_ = &all_tables_[int(part)];
    if (tables_->corner[0][2].empty()) build(part, *tables_);
    polygon_ = &polygon;
    extent_ = Extent(polygon);
    for (auto& face : side_known_) face = {false, false};
  }

  // Which (first's c, second's c) are left over, per index of the rectangle: words_ words each.
  const uint64_t* side(uint32_t face, int which) {
    std::vector<uint64_t>& left = side_left_[face][which];
    if (side_known_[face][which]) return left.data();
    side_known_[face][which] = true;
    left.assign(size_t(n_) * words_, 0);
    const int p = axis_of(face), c = other_axis(p, which);
    const Region* r = tables_->side[face][which].data();
    for (uint32_t d = 0; d < n_; ++d)
      for (uint32_t bit = 0; bit < n_ * n_; ++bit, ++r)
        if (!misses(*r, p, c, *polygon_, extent_)) left[d * words_ + bit / 64] |= uint64_t(1) << bit % 64;
    return left.data();
  }

  void mark_pair(uint32_t first, uint32_t second) {
    if (axis_of(first) == axis_of(second))
      mark_opposite(first, second);
    else
      mark_adjacent(first, second);
  }

  void mark_opposite(uint32_t first, uint32_t second) {
    const int w = axis_of(first), u = other_axis(w, 0), v = other_axis(w, 1);
    const Region *along_u = tables_->opposite[w][0].data(), *along_v = tables_->opposite[w][1].data();
    left_.clear();
    for (uint32_t i = 0; i < n_ * n_; ++i)
      if (!misses(along_v[i], v, w, *polygon_, extent_)) left_.push_back(i);
    if (left_.empty()) return;
    for (uint32_t i = 0; i < n_ * n_; ++i) {
      if (misses(along_u[i], u, w, *polygon_, extent_)) continue;
      for (const uint32_t k : left_) {
        const uint32_t patch_first = i / n_ + n_ * (k / n_), patch_second = i % n_ + n_ * (k % n_);
        uint32_t& shaft = shafts_[LSP_SHAFT_INDEX_SYMMETRIC(first, second, patch_first, patch_second, n_)];
        if (shaft != LSP_NONE) continue;
        if (meets<2>(*polygon_, {View{&along_u[i], {u, w}}, View{&along_v[k], {v, w}}})) shaft = record_;
      }
    }
  }

  void mark_adjacent(uint32_t first, uint32_t second) {
    const int p = axis_of(first), q = axis_of(second), c = 3 - p - q;
    const int c_first = other_axis(p, 0) == c ? 0 : 1, c_second = other_axis(q, 0) == c ? 0 : 1;
    const Region* corner = tables_->corner[first][second].data();
    const Region *side_first = tables_->side[first][c_first].data(),
                 *side_second = tables_->side[second][c_second].data();
    for (uint32_t a = 0; a < n_; ++a)
      for (uint32_t d = 0; d < n_; ++d) {
        const Region& r = corner[a * n_ + d];
        if (misses(r, p, q, *polygon_, extent_)) continue;
        const uint64_t* left_first = side(first, c_first) + d * words_;
        const uint64_t* left_second = side(second, c_second) + a * words_;
        for (uint32_t word = 0; word < words_; ++word)
          for (uint64_t bits = left_first[word] & left_second[word]; bits; bits &= bits - 1) {
            const uint32_t bit = word * 64 + uint32_t(std::countr_zero(bits));
            const uint32_t b = bit / n_, e = bit % n_;
            const uint32_t patch_first = q < c ? a + n_ * b : b + n_ * a;
            const uint32_t patch_second = p < c ? d + n_ * e : e + n_ * d;
            uint32_t& shaft =
                shafts_[LSP_SHAFT_INDEX_SYMMETRIC(first, second, patch_first, patch_second, n_)];
            if (shaft != LSP_NONE) continue;
            if (meets<3>(*polygon_, {View{&r, {p, q}}, View{&side_first[d * n_ * n_ + bit], {p, c}},
                                     View{&side_second[a * n_ * n_ + bit], {q, c}}}))
              shaft = record_;
          }
      }
  }

  const uint32_t n_, words_;
  const glm::dvec3 lo_, scale_, margin_;
  Tables all_tables_[3];  // by Part; built when they are first needed
  Tables* tables_ = nullptr;
  const Polygon* polygon_ = nullptr;
  Extent extent_;
  std::array<bool, 2> side_known_[6];
  std::vector<uint64_t> side_left_[6][2];
  std::vector<uint32_t> left_;
  uint32_t record_ = 0;
  std::span<uint32_t> shafts_;
};

TouchedShafts::TouchedShafts(const glm::vec3& lo, const glm::vec3& hi, double margin, uint32_t resolution)
    : impl_(std::make_unique<Impl>(lo, hi, margin, resolution)) {}
TouchedShafts::~TouchedShafts() = default;

void TouchedShafts::add(const LspTriangle& triangle, uint32_t record, std::span<uint32_t> shafts) {
  impl_->add(triangle, record, shafts);
}

}  // namespace lsp
