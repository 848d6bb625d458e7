// Triangles cut to boxes, as polygons.
#pragma once

#include <glm/glm.hpp>

#include "lsp/layout.h"

namespace lsp {

struct Polygon {
  glm::vec3 corner[12];
  int count = 0;
};

// What of a triangle lies in a box.
Polygon clip(const LspTriangle& triangle, const glm::vec3& lo, const glm::vec3& hi);

}  // namespace lsp
