// The small tree of one cell, for exact traces bounded to it: boxes in 8 bits of the cell, two children in 16
// bytes.
#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <vector>

#include "bvh.h"
#include "lsp/layout.h"

namespace lsp {

struct CellTree {
  std::vector<LspCellNode> nodes;
  std::vector<uint32_t> references;  // of leaves: indices as in Bvh::records
  uint32_t root = LSP_CELL_NO_CHILD;
};

// Of a BVH over a cell's triangles; `lo` is the corner of the cell's box with its margin, `size` its edge.
// Boxes are rounded outwards. It has fewer than LSP_CELL_MAX_REFERENCES records and at most
// LSP_MAX_CELL_DEPTH levels.
CellTree compact(const Bvh& bvh, const glm::vec3& lo, float size);

}  // namespace lsp
