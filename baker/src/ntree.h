// The base structure NTree: a cube cut into N^3 equal cubes, and again where many triangles are, with the
// exact triangles in the leaves (paper, section 3.2; Jevans, Wyvill, "Adaptive voxel subdivision for ray
// tracing", 1989).
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "lsp/layout.h"

namespace lsp {

struct NTreeOptions {
  uint32_t branching = 6;       // N, 2 to LSP_MAX_BRANCHING
  uint32_t levels = 3;          // of nodes, 1 to LSP_MAX_NTREE_DEPTH
  uint32_t leaf_triangles = 8;  // a cell with more is cut again while there are levels left (paper: T)
  uint64_t max_bytes = 0;       // Failure with Exit::kLimit when the tree grows beyond; 0: no limit
};

// The tree in the file's form: nodes depth first, cells in the order of their nodes and bits, references in
// the order of the cells (lsp/layout.h).
struct NTree {
  std::vector<LspBitWord> grid;  // LSP_GRID_WORDS(branching) a node
  std::vector<LspCell> cells;    // no Line Spaces yet
  std::vector<uint32_t> references;
  lsp_float3 lo{};
  float size = 0;
  float margin = 0;
  uint32_t branching = 0;
  uint32_t node_count = 0;
  uint32_t levels = 0;  // that came to be used
  uint32_t max_leaf_triangles = 0;
};

// Builds on all threads of the current oneTBB arena; the result does not depend on their number. No
// triangles: no nodes. `progress` is called with the share done, from any thread.
NTree build_ntree(std::span<const LspTriangle> triangles, const NTreeOptions& options,
                  const std::function<void(double)>& progress = {});

}  // namespace lsp
