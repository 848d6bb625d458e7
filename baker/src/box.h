// Axis-aligned boxes.
#pragma once

#include <algorithm>
#include <glm/glm.hpp>
#include <limits>

namespace lsp {

struct Box {
  glm::vec3 lo{std::numeric_limits<float>::infinity()};
  glm::vec3 hi{-std::numeric_limits<float>::infinity()};

  void grow(const glm::vec3& p) {
    lo = glm::min(lo, p);
    hi = glm::max(hi, p);
  }
  void grow(const Box& b) {
    lo = glm::min(lo, b.lo);
    hi = glm::max(hi, b.hi);
  }
  bool empty() const { return !(lo.x <= hi.x && lo.y <= hi.y && lo.z <= hi.z); }
  glm::vec3 extent() const { return hi - lo; }
  glm::vec3 centre() const { return 0.5f * lo + 0.5f * hi; }
  // Half the surface; in double, so that huge and tiny scenes neither overflow nor vanish.
  double half_area() const {
    if (empty()) return 0;
    const double x = double(hi.x) - lo.x, y = double(hi.y) - lo.y, z = double(hi.z) - lo.z;
    return x * y + y * z + z * x;
  }
};

inline Box intersection(const Box& a, const Box& b) { return {glm::max(a.lo, b.lo), glm::min(a.hi, b.hi)}; }

}  // namespace lsp
