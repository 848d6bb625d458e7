// What building instances and tracing them have in common.
#pragma once

#include <algorithm>

#include "lsp/lsp_instances.h"

namespace lsp {

constexpr uint32_t kInstanceBit = 0x80000000u;  // of lsp_instance_node.child

// Nodes from the root to an instance at most, and so what a ray's stack must hold.
constexpr uint32_t kInstanceDepth = 32;

constexpr double kRounding = 0x1p-24;  // of a float: u in NUMERICS.md

// rows[3][3] * v, or transposed; in double.
inline void multiply(const double rows[9], const double v[3], double out[3]) {
  for (int i = 0; i < 3; ++i) out[i] = rows[3 * i] * v[0] + rows[3 * i + 1] * v[1] + rows[3 * i + 2] * v[2];
}
inline void multiply_transposed(const double rows[9], const double v[3], double out[3]) {
  for (int i = 0; i < 3; ++i) out[i] = rows[i] * v[0] + rows[3 + i] * v[1] + rows[6 + i] * v[2];
}

}  // namespace lsp
