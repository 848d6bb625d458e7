#include "plane_cuts.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "clones.h"

namespace lsp {
namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();
constexpr int kLanes = 16;

// From its lower end along the axis; u and v are the other two coordinates.
struct Edge {
  float a, u, v;
  float per_a, du, dv;

  Edge(const std::array<float, 3>& p, const std::array<float, 3>& q)
      : a(p[0]), u(p[1]), v(p[2]), per_a(1 / (q[0] - p[0])), du(q[1] - p[1]), dv(q[2] - p[2]) {}
};

struct Triangle {
  Edge whole, lower, upper;  // from the lowest corner to the highest; the others meet at `middle`
  float middle;
  float from, to;                    // along the axis, what is cut lies between
  std::array<float, 2> lo, hi;       // points beyond count not
  std::array<float, 2> uncertainty;  // of a point, in u and v
};

[[gnu::always_inline]] inline void add_point(float t, float u, float v, bool cut, const Triangle& s,
                                             float& lo_u, float& hi_u, float& lo_v, float& hi_v) {
  const bool counts =
      cut & (t >= 0.0f) & (t <= 1.0f) & (u >= s.lo[0]) & (u <= s.hi[0]) & (v >= s.lo[1]) & (v <= s.hi[1]);
  const float more_u = u + s.uncertainty[0], less_u = u - s.uncertainty[0];
  const float more_v = v + s.uncertainty[1], less_v = v - s.uncertainty[1];
  lo_u = (counts & (more_u < lo_u)) ? more_u : lo_u;
  hi_u = (counts & (less_u > hi_u)) ? less_u : hi_u;
  lo_v = (counts & (more_v < lo_v)) ? more_v : lo_v;
  hi_v = (counts & (less_v > hi_v)) ? less_v : hi_v;
}

LSP_CLONES void add_cuts(const Triangle& triangle, const float* planes, float* to_lo_u, float* to_hi_u,
                         float* to_lo_v, float* to_hi_v) {
  const Triangle s = triangle;
  std::array<float, kLanes> lo_u, hi_u, lo_v, hi_v;
  for (int i = 0; i < kLanes; ++i) {
    lo_u[i] = to_lo_u[i];
    hi_u[i] = to_hi_u[i];
    lo_v[i] = to_lo_v[i];
    hi_v[i] = to_hi_v[i];
  }
  for (int i = 0; i < kLanes; ++i) {
    const float plane = planes[i];
    const bool cut = (plane > s.from) & (plane < s.to);
    const float t = (plane - s.whole.a) * s.whole.per_a;
    add_point(t, s.whole.u + s.whole.du * t, s.whole.v + s.whole.dv * t, cut, s, lo_u[i], hi_u[i], lo_v[i],
              hi_v[i]);
    const bool above = plane > s.middle;
    const float a = above ? s.upper.a : s.lower.a, per_a = above ? s.upper.per_a : s.lower.per_a;
    const float u = above ? s.upper.u : s.lower.u, du = above ? s.upper.du : s.lower.du;
    const float v = above ? s.upper.v : s.lower.v, dv = above ? s.upper.dv : s.lower.dv;
    const float along = (plane - a) * per_a;
    add_point(along, u + du * along, v + dv * along, cut, s, lo_u[i], hi_u[i], lo_v[i], hi_v[i]);
  }
  for (int i = 0; i < kLanes; ++i) {
    to_lo_u[i] = lo_u[i];
    to_hi_u[i] = hi_u[i];
    to_lo_v[i] = lo_v[i];
    to_hi_v[i] = hi_v[i];
  }
}

}  // namespace

PlaneCuts::PlaneCuts() {
  for (Bounds& b : bounds_) {
    b.lo.fill(kInfinity);
    b.hi.fill(-kInfinity);
  }
}

void PlaneCuts::add(const std::array<glm::vec3, 3>& corners, const Box& box, int axis, const Planes& planes,
                    int first, int last) {
  const int axes[3] = {axis, axis == 0 ? 1 : 0, axis == 2 ? 1 : 2};
  std::array<std::array<float, 3>, 3> c;  // ascending along the axis
  for (size_t i = 0; i < 3; ++i)
    for (size_t k = 0; k < 3; ++k) c[i][k] = corners[i][axes[k]];
  for (const auto& [a, b] : {std::pair<size_t, size_t>{0, 1}, {1, 2}, {0, 1}})
    if (c[b][0] < c[a][0]) std::swap(c[a], c[b]);
  Triangle s = {{c[0], c[2]},
                {c[0], c[1]},
                {c[1], c[2]},
                c[1][0],
                std::max(c[0][0], box.lo[axis]),
                std::min(c[2][0], box.hi[axis]),
                {},
                {},
                {}};
  std::array<float, 2> least, most;
  for (size_t k = 0; k < 2; ++k) {
    least[k] = std::min({c[0][k + 1], c[1][k + 1], c[2][k + 1]});
    most[k] = std::max({c[0][k + 1], c[1][k + 1], c[2][k + 1]});
    // A share of the edge is off by less than 5 u, a point by 7 u of the edge and u of what it comes to; the
    // exact one is rounded, too.
    s.uncertainty[k] =
        0x1p-24f * (8 * (most[k] - least[k]) + 3 * std::max(std::fabs(least[k]), std::fabs(most[k])));
  }
  // A box that is the triangle's own holds all of its points, up to rounding.
  const auto holds = [&](size_t k) {
    return box.lo[axes[k + 1]] <= least[k] && box.hi[axes[k + 1]] >= most[k];
  };
  const bool whole = holds(0) && holds(1);
  for (size_t k = 0; k < 2; ++k) {
    s.lo[k] = whole ? -kInfinity : box.lo[axes[k + 1]] + s.uncertainty[k];
    s.hi[k] = whole ? kInfinity : box.hi[axes[k + 1]] - s.uncertainty[k];
  }
  for (int i = first / kLanes * kLanes; i < last; i += kLanes) {
    const auto at = size_t(i);
    add_cuts(s, &planes[at], &bounds_[0].lo[at], &bounds_[0].hi[at], &bounds_[1].lo[at], &bounds_[1].hi[at]);
  }
}

Box4 PlaneCuts::at(int plane, int axis, float position) const {
  const auto i = size_t(plane);
  Box box;
  if (!(bounds_[0].lo[i] < kInfinity)) return Box4(box);
  const int u = axis == 0 ? 1 : 0, v = axis == 2 ? 1 : 2;
  box.lo[axis] = box.hi[axis] = position;
  box.lo[u] = bounds_[0].lo[i];
  box.hi[u] = bounds_[0].hi[i];
  box.lo[v] = bounds_[1].lo[i];
  box.hi[v] = bounds_[1].hi[i];
  return Box4(box);
}

}  // namespace lsp
