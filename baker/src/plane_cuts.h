// Where triangles are cut by equidistant planes across an axis, about: for a bound that tells which spatial
// splits are worth an exact look.
#pragma once

#include <array>
#include <glm/glm.hpp>

#include "box4.h"

namespace lsp {

class PlaneCuts {
 public:
  static constexpr int kPlanes = 32;
  using Planes = std::array<float, kPlanes>;

  PlaneCuts();

  // Adds the points in which planes `first` to `last` - 1 cut a triangle's edges within `box`, its bounds or
  // what an earlier split left of them.
  void add(const std::array<glm::vec3, 3>& corners, const Box& box, int axis, const Planes& planes, int first,
           int last);

  // Holds nothing that the bounds of the exact points (TriangleCut) do not hold: rounding is left out.
  Box4 at(int plane, int axis, float position) const;

 private:
  // Across the other two axes.
  struct alignas(64) Bounds {
    Planes lo, hi;
  };
  std::array<Bounds, 2> bounds_;
};

}  // namespace lsp
