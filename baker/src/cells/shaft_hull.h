// The convex hull of two rectangles, of different sides of a box: what lines from the one to the other pass.
#pragma once

#include <glm/glm.hpp>
#include <vector>

#include "box.h"

namespace lsp {

struct HalfSpace {
  glm::vec3 normal;  // outwards, unit length
  float distance;
};

// Half-spaces that hold both, all that are borders of their hull but for those of the box. Rectangles are
// boxes that are flat along one axis.
std::vector<HalfSpace> shaft_hull(const Box& from, const Box& to);

}  // namespace lsp
