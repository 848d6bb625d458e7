// The tree over instances with eight children a node, for vectors.
#pragma once

#include "lsp/lsp_instances.h"

namespace lsp {

// Wide nodes at most. A node that is not full has instances alone and belongs to one that is full, or is the
// root: of f full and s others s <= 7 f + 1, and all have f + s - 1 + count children, at least 8 f + 2 s.
constexpr uint64_t most_wide_nodes(uint32_t count) { return uint64_t{4} * count / 7; }

// Collapses the binary tree (Wald, Benthin and Boulos, "Getting Rid of Packets", 2008), the root into
// wide[0]. A tree of one instance has no wide node.
void widen(const lsp_instance_node* nodes, lsp_instance_wide_node* wide);

}  // namespace lsp
