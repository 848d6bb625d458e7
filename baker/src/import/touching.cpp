#include "import/touching.h"

#include <algorithm>
#include <cmath>

#include "import/corner_tree.h"

namespace lsp {

bool part_touching(std::vector<glm::dvec2>& outline) {
  constexpr double kTouching = 2e-7, kApart = 1e-10;  // of the outline's size
  const std::vector<glm::dvec2> at = outline;
  const size_t n = at.size();
  glm::dvec2 low = at[0], high = at[0];
  for (const glm::dvec2& p : at) low = glm::min(low, p), high = glm::max(high, p);
  const double size = std::max(high.x - low.x, high.y - low.y);
  bool moved = false;
  for (size_t e = 0; e < n; ++e) {
    const glm::dvec2 a = at[e], b = at[(e + 1) % n], edge = b - a;
    const double length = glm::length(edge);
    if (!(length > kTouching * size)) continue;
    const glm::dvec2 along = edge / length, left(-along.y, along.x);
    for (size_t i = 0; i < n; ++i) {
      const glm::dvec2 p = at[i];
      const double place = glm::dot(p - a, along);
      if (!(place > 0 && place < length) || p == a || p == b) continue;
      const double height = area2(a, b, p) / length;
      if (std::abs(height) > kTouching * size) continue;
      const double before = glm::dot(at[(i + n - 1) % n] - a, left),
                   after = glm::dot(at[(i + 1) % n] - a, left);
      const double side = std::abs(before) > std::abs(after) ? before : after;
      if (std::abs(side) <= kTouching * size || (height > 0) == (side > 0)) continue;
      outline[i] += left * (std::copysign(kApart * size, side) - height);
      moved = true;
    }
  }
  return moved;
}

}  // namespace lsp
