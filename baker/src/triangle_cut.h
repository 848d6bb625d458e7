// A triangle cut by planes across an axis, for spatial splits.
#pragma once

#include <array>
#include <glm/glm.hpp>
#include <utility>

#include "box4.h"

namespace lsp {

// Gives the bounds of what lies below and above a plane: of corners, and of where edges pass it. The corners
// outlive it.
class TriangleCut {
 public:
  TriangleCut(std::array<const glm::vec3*, 3> corners, int axis) : axis_(axis), corner_(corners) {
    for (const auto& [a, b] : {std::pair{0, 1}, std::pair{1, 2}, std::pair{0, 1}})
      if (along(b) < along(a)) std::swap(corner_[a], corner_[b]);
    const Float4 a = float4(*corner_[0]), b = float4(*corner_[1]), c = float4(*corner_[2]);
    lowest_[1].grow(a);
    lowest_[2] = {lesser(a, b), greater(a, b)};
    lowest_[3] = {lesser(lowest_[2].lo, c), greater(lowest_[2].hi, c)};
    highest_[0] = lowest_[3];
    highest_[1] = {lesser(b, c), greater(b, c)};
    highest_[2] = {c, c};
  }

  // Empty where there is nothing.
  void at(float plane, Box4& below, Box4& above) const {
    const float a = along(0), b = along(1), c = along(2);
    below = lowest_[(a <= plane) + (b <= plane) + (c <= plane)];
    above = highest_[(a < plane) + (b < plane) + (c < plane)];
    if (!(a < plane && plane < c)) return;
    grow(point(0, 2, plane), below, above);
    if (b != plane) grow(b < plane ? point(1, 2, plane) : point(0, 1, plane), below, above);
  }

 private:
  float along(int i) const { return (*corner_[size_t(i)])[axis_]; }

  // Where an edge passes the plane, in double and from its lower end, so that neighbours that share it are
  // cut in the same point.
  Float4 point(int lower, int upper, float plane) const {
    const glm::dvec3 p(*corner_[size_t(lower)]), q(*corner_[size_t(upper)]);
    const double share = (double(plane) - p[axis_]) / (q[axis_] - p[axis_]);
    const glm::vec3 x(p + (q - p) * share);
    const Float4 at = float4(x), planes = Float4{} + plane;
    return Int4{0, 1, 2, 3} == axis_ ? planes : at;
  }
  static void grow(Float4 x, Box4& below, Box4& above) {
    below.grow(x);
    above.grow(x);
  }

  int axis_;
  std::array<const glm::vec3*, 3> corner_;  // ascending along the axis
  Box4 lowest_[4], highest_[4];             // of the first i corners; of those from i on
};

}  // namespace lsp
