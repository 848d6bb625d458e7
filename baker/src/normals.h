// Octahedral packing of unit normals; the reader is lsp_unpack_normal in lsp/traverse.h.
// Cigolle et al., "A Survey of Efficient Representations for Independent Unit Vectors", JCGT 2014.
#pragma once

#include <cmath>
#include <cstdint>
#include <glm/glm.hpp>

namespace lsp {

// Two 16-bit snorm, x in the low half. `n` is of unit length; a zero or non-finite vector packs as +z.
inline uint32_t pack_normal(const glm::vec3& n) {
  const float sum = std::fabs(n.x) + std::fabs(n.y) + std::fabs(n.z);
  if (!(sum > 0) || !std::isfinite(sum)) return 0;
  float x = n.x / sum, y = n.y / sum;
  if (n.z < 0) {
    const float fx = (1 - std::fabs(y)) * (x >= 0 ? 1.0f : -1.0f);
    const float fy = (1 - std::fabs(x)) * (y >= 0 ? 1.0f : -1.0f);
    x = fx;
    y = fy;
  }
  const auto snorm = [](float v) { return uint32_t(uint16_t(int16_t(std::lround(v * 32767.0f)))); };
  return snorm(x) | snorm(y) << 16;
}

}  // namespace lsp
