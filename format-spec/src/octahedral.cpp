#include "octahedral.h"

#include <algorithm>
#include <cmath>

namespace lsp::format {
namespace {

float sign_not_zero(float v) { return v >= 0.0f ? 1.0f : -1.0f; }

uint32_t to_snorm(float v) {
  return static_cast<uint32_t>(static_cast<int32_t>(std::lround(std::clamp(v, -1.0f, 1.0f) * 32767.0f))) &
         0xFFFFu;
}

}  // namespace

uint32_t encode_normal(const lsp_float3& n) {
  const float sum = std::abs(n.x) + std::abs(n.y) + std::abs(n.z);
  float x = n.x / sum, y = n.y / sum;
  if (n.z < 0.0f) {
    const float folded = (1.0f - std::abs(y)) * sign_not_zero(x);
    y = (1.0f - std::abs(x)) * sign_not_zero(y);
    x = folded;
  }
  return to_snorm(x) | to_snorm(y) << 16;
}

}  // namespace lsp::format
