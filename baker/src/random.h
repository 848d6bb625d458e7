// Numbers that look random and are the same on every machine: a function of two numbers, not of those before.
#pragma once

#include <cmath>
#include <cstdint>
#include <glm/glm.hpp>

#include "pcg.h"

namespace lsp {

inline double random(uint64_t ray, uint32_t dimension) {
  const uint32_t seed =
      uint32_t(ray) * 747796405u + uint32_t(ray >> 32) * 277803737u + dimension * 2891336453u + 1u;
  return (pcg(seed) + 0.5) / 4294967296.0;
}

// Uniform on the unit sphere with square roots only, so that every machine makes the same (Marsaglia 1972).
inline glm::dvec3 random_on_sphere(uint64_t ray, uint32_t dimension) {
  double x = 0, y = 0, square = 2;
  for (uint32_t attempt = 0; square >= 1 || square == 0; ++attempt) {
    x = 2 * random(ray, dimension + 2 * attempt) - 1;
    y = 2 * random(ray, dimension + 1 + 2 * attempt) - 1;
    square = x * x + y * y;
  }
  const double f = 2 * std::sqrt(1 - square);
  return {x * f, y * f, 1 - 2 * square};
}

}  // namespace lsp
