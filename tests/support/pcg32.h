// Deterministic random numbers: the same on every compiler and standard library, which <random>'s
// distributions are not. PCG32: O'Neill, "PCG: A Family of Simple Fast Space-Efficient Statistically Good
// Algorithms for Random Number Generation", 2014.
#pragma once

#include <stddef.h>

#include <cstdint>
#include <utility>
#include <vector>

namespace lsp::bench {

class Random {
 public:
  explicit Random(uint64_t seed, uint64_t stream = 1) : increment_(2 * stream + 1) {
    next();
    state_ += seed;
    next();
  }

  uint32_t next() {
    const uint64_t old = state_;
    state_ = old * 6364136223846793005ull + increment_;
    const auto shifted = static_cast<uint32_t>(((old >> 18) ^ old) >> 27);
    const auto rotation = static_cast<uint32_t>(old >> 59);
    return (shifted >> rotation) | (shifted << ((32 - rotation) & 31));
  }

  // In [0, 1), 53 bits.
  double uniform() {
    const uint64_t high = next();
    const uint64_t low = next();
    return static_cast<double>(((high << 32) | low) >> 11) * 0x1p-53;
  }

  // In [0, bound); bound > 0. Without bias (Lemire 2019).
  uint32_t below(uint32_t bound) {
    uint64_t product = uint64_t{next()} * bound;
    if (static_cast<uint32_t>(product) < bound) {
      const uint32_t threshold = (0u - bound) % bound;
      while (static_cast<uint32_t>(product) < threshold) product = uint64_t{next()} * bound;
    }
    return static_cast<uint32_t>(product >> 32);
  }

 private:
  uint64_t state_ = 0;
  uint64_t increment_;
};

// Fisher-Yates.
template <typename T>
void shuffle(std::vector<T>& values, Random& random) {
  for (size_t i = values.size(); i > 1; --i) {
    std::swap(values[i - 1], values[random.below(static_cast<uint32_t>(i))]);
  }
}

}  // namespace lsp::bench
