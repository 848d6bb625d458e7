// Wide nodes: their children and the children's boxes. Internal to the library.
#pragma once

#include <lsp/layout.h>

#include <cmath>
#include <cstdint>

namespace lsp::format {

// Child `k` as LSP_WIDE_* describe it.
inline uint32_t wide_child(const LspWideNode& node, uint32_t k) {
  return node.children[k / 2] >> k % 2 * 16 & 0xFFFF;
}
inline uint32_t wide_leaf_first(uint32_t child) { return child & LSP_WIDE_LEAF_FIRST_MASK; }
inline uint32_t wide_leaf_count(uint32_t child) { return (child >> LSP_WIDE_LEAF_COUNT_SHIFT & 0xF) + 1; }

// Plane 0 to 5, lo x, y, z, hi x, y, z, of child `k`.
inline uint32_t wide_plane(const LspWideNode& node, uint32_t plane, uint32_t k) {
  return node.planes[plane * 2 + k / 4] >> k % 4 * 8 & 0xFF;
}

struct WideBox {
  double lo[3], hi[3];
};

// Exact: a step times a byte, and their sum with a corner of the same magnitude, fit into a double.
inline WideBox wide_box(const LspWideNode& node, uint32_t k) {
  const double lo[3] = {node.lo.x, node.lo.y, node.lo.z}, step[3] = {node.step.x, node.step.y, node.step.z};
  WideBox box;
  for (uint32_t a = 0; a < 3; ++a) {
    box.lo[a] = lo[a] + wide_plane(node, a, k) * step[a];
    box.hi[a] = lo[a] + wide_plane(node, 3 + a, k) * step[a];
  }
  return box;
}

}  // namespace lsp::format
