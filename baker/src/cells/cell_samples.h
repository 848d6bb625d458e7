// Where the rays go that a cell's entries are made from: the same on every machine, whatever the threads.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <glm/glm.hpp>

#include "../pcg.h"

namespace lsp {

// An additive low-discrepancy sequence in [0, 1)^d (Roberts, "The Unreasonable Effectiveness of Quasirandom
// Sequences", 2018), moved by a hash of `seed`.
template <size_t kDimensions>
class Sequence {
 public:
  explicit Sequence(uint32_t seed) {
    for (uint32_t k = 0; k < kDimensions; ++k)
      start_[k] = float(pcg(seed * 747796405u + k * 277803737u + 77u * 2891336453u + 1u) >> 8) * 0x1p-24f;
  }
  std::array<float, kDimensions> operator()(uint32_t i) const {
    static_assert(kDimensions == 4 || kDimensions == 5);
    constexpr double root =
        kDimensions == 4 ? 1.1673039782614187 : 1.1347241384015194;  // of x^(d + 1) = x + 1
    std::array<float, kDimensions> out;
    double a = 1;
    for (size_t k = 0; k < kDimensions; ++k) {
      a /= root;
      const double x = double(start_[k]) + i * a;
      out[k] = std::min(float(x - double(uint32_t(x))), 0.99999994f);
    }
    return out;
  }

 private:
  std::array<float, kDimensions> start_;
};

// The point of the unit circle at `turns` in [0, 1), by polynomials: a library's sine may differ between
// machines.
inline glm::vec2 circle(float turns) {
  const float quarter = std::floor(4 * turns), x = (4 * turns - quarter - 0.5f) * 1.57079633f, x2 = x * x;
  const float s = x * (1 - x2 * (1 / 6.0f - x2 * (1 / 120.0f - x2 / 5040)));
  const float c = 1 - x2 * (0.5f - x2 * (1 / 24.0f - x2 * (1 / 720.0f)));
  switch (int(quarter)) {
    case 0:
      return {c, s};
    case 1:
      return {-s, c};
    case 2:
      return {-c, -s};
    default:
      return {s, -c};
  }
}

// A cosine-distributed direction about a unit normal from a point of the unit square (Duff et al., "Building
// an Orthonormal Basis, Revisited", 2017).
inline glm::vec3 cosine_about(const glm::vec3& n, float a, float b) {
  const float sign = n.z >= 0 ? 1.0f : -1.0f;
  const float p = -1 / (sign + n.z), q = n.x * n.y * p;
  const glm::vec3 u(1 + sign * n.x * n.x * p, sign * q, -sign * n.x), v(q, sign + n.y * n.y * p, -n.y);
  const float radius = std::sqrt(a);
  const glm::vec2 turn = circle(b);
  return u * (radius * turn.x) + v * (radius * turn.y) + n * std::sqrt(std::max(0.0f, 1 - a));
}

}  // namespace lsp
