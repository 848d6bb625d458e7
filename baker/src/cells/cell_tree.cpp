#include "cell_tree.h"

#include <algorithm>
#include <cmath>

namespace lsp {
namespace {

// A coordinate of a box in steps of the cell, outwards; a step of slack where rounding could move it.
uint32_t down(float x, float lo, double step) {
  return uint32_t(std::clamp(std::floor((double(x) - double(lo)) / step - 1e-3), 0.0, 255.0));
}
uint32_t up(float x, float lo, double step) {
  return uint32_t(std::clamp(std::ceil((double(x) - double(lo)) / step + 1e-3), 0.0, 255.0));
}

uint32_t child_of(uint32_t ref) {
  if (ref == LSP_NONE) return LSP_CELL_NO_CHILD;
  if (!(ref & LSP_LEAF_BIT)) return ref;
  const uint32_t count = ref >> LSP_LEAF_COUNT_SHIFT & LSP_LEAF_COUNT_MASK;  // less 1
  return LSP_CELL_LEAF_BIT | count << LSP_CELL_LEAF_COUNT_SHIFT | (ref & LSP_LEAF_FIRST_MASK);
}

}  // namespace

CellTree compact(const Bvh& bvh, const glm::vec3& lo, float size) {
  CellTree tree;
  tree.references = bvh.records;
  tree.root = child_of(bvh.root);
  const double step = double(size) / 255;
  for (const LspNode& n : bvh.nodes) {
    LspCellNode c{};
    const auto box = [&](const lsp_float3& l, const lsp_float3& h, uint32_t* bytes) {
      const float x[] = {l.x, l.y, l.z}, y[] = {h.x, h.y, h.z};
      for (int k = 0; k < 3; ++k) {
        bytes[k] = down(x[k], lo[k], step);
        bytes[3 + k] = up(y[k], lo[k], step);
      }
    };
    uint32_t b[12];
    box(n.lo0, n.hi0, b);
    box(n.lo1, n.hi1, b + 6);
    c.box_0 = b[0] | b[1] << 8 | b[2] << 16 | b[3] << 24;
    c.box_1 = b[4] | b[5] << 8 | b[6] << 16 | b[7] << 24;
    c.box_2 = b[8] | b[9] << 8 | b[10] << 16 | b[11] << 24;
    c.children = child_of(n.child0) | child_of(n.child1) << 16;
    tree.nodes.push_back(c);
  }
  return tree;
}

}  // namespace lsp
