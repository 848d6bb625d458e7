// Boxes in vectors of four, of which the last lane is of no account: what builds trees does little but grow
// boxes. The same values as with Box, whose order of comparisons it keeps.
#pragma once

#include <cstdint>
#include <cstring>
#include <limits>

#include "box.h"

namespace lsp {

using Float4 = float __attribute__((vector_size(16)));
using Int4 = int32_t __attribute__((vector_size(16)));

inline Float4 lesser(Float4 a, Float4 b) { return b < a ? b : a; }
inline Float4 greater(Float4 a, Float4 b) { return a < b ? b : a; }
inline Float4 float4(const glm::vec3& v) { return Float4{v.x, v.y, v.z, 0}; }

struct Box4 {
  Float4 lo = Float4{} + std::numeric_limits<float>::infinity(), hi = -lo;

  Box4() = default;
  Box4(Float4 lo_, Float4 hi_) : lo(lo_), hi(hi_) {}
  explicit Box4(const Box& box) {
    static_assert(sizeof(Box) == 6 * sizeof(float));
    std::memcpy(&lo, &box, sizeof lo);
    Float4 last;
    std::memcpy(&last, reinterpret_cast<const char*>(&box) + 2 * sizeof(float), sizeof last);
    hi = __builtin_shufflevector(last, last, 1, 2, 3, 0);
  }
  Box box() const { return {{lo[0], lo[1], lo[2]}, {hi[0], hi[1], hi[2]}}; }

  void grow(Float4 p) {
    lo = lesser(lo, p);
    hi = greater(hi, p);
  }
  void grow(const Box4& b) {
    lo = lesser(lo, b.lo);
    hi = greater(hi, b.hi);
  }
  bool empty() const { return !((lo[0] <= hi[0]) & (lo[1] <= hi[1]) & (lo[2] <= hi[2])); }
  bool holds(Float4 p) const {
    const Int4 in = (lo <= p) & (p <= hi);
    return (in[0] & in[1] & in[2]) != 0;
  }
  Float4 centre() const { return 0.5f * lo + 0.5f * hi; }
  double half_area() const {
    if (empty()) return 0;
    const double x = double(hi[0]) - double(lo[0]), y = double(hi[1]) - double(lo[1]),
                 z = double(hi[2]) - double(lo[2]);
    return x * y + y * z + z * x;
  }
  // But for rounding to single precision, and faster.
  float rough_half_area() const {
    const Float4 d = greater(Float4{}, hi - lo), sides = d * __builtin_shufflevector(d, d, 1, 2, 0, 3);
    return sides[0] + sides[1] + sides[2];
  }
};

inline Box4 intersection(const Box4& a, const Box4& b) { return {greater(a.lo, b.lo), lesser(a.hi, b.hi)}; }

}  // namespace lsp
