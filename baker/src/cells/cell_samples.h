// Where the rays go that a cell's entries are made from: the same on every machine, whatever the threads.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>

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

}  // namespace lsp
