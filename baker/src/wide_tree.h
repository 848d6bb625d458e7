// The tree for exact rays: the BVH collapsed into nodes of eight children.
//
// Ylitie, Karras, Laine, "Efficient Incoherent Ray Traversal on GPUs Through Compressed Wide BVHs", 2017,
// section 3 (the cut of least cost, boxes of bytes); Ize, Hansen, "RTSAH Traversal Order for Occlusion Rays",
// 2011 (the order of the children).
#pragma once

#include <cstdint>
#include <vector>

#include "bvh.h"
#include "lsp/layout.h"
#include "mesh.h"

namespace lsp {

// In the file's form, the root first. `max_steps` are nodes and leaves, `max_depth` edges from the root to
// the deepest leaf.
struct WideTree {
  std::vector<LspWideNode> nodes;
  uint32_t max_depth = 0;
  uint32_t max_steps = 0;
  uint32_t max_leaf_triangles = 0;
};

// Orders the records of `bvh` as the file of wide nodes has them, and lets the leaves of `bvh` refer to them
// there; a subtree's records are together no more.
WideTree build_wide_tree(const Mesh& mesh, Bvh& bvh);

// Writes what the header states of the tree for exact rays.
void set_wide(const WideTree& tree, LspHeader& header);

}  // namespace lsp
