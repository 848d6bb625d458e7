// Which nodes of the base structure carry a Line Space (paper, section 3.2: depth D or triangle count T).
#pragma once

#include <cstdint>
#include <vector>

#include "bvh.h"
#include "line_space.h"
#include "lsp/layout.h"
#include "ntree.h"

namespace lsp {

// The nodes of `bvh` that are to carry a Line Space, in depth-first order; `bounds` is the root's box.
std::vector<LineSpaceSite> choose_sites(const Bvh& bvh, const LspHeader& bounds,
                                        const LineSpaceOptions& options);

// Writes the references that fill_line_spaces returned for these sites into the nodes; returns the root's.
uint32_t attach(Bvh& bvh, const std::vector<LineSpaceSite>& sites, const std::vector<uint32_t>& references);

// The same for an NTree, in the order of its cells, the root first. `bvh` is a tree of the same triangles
// without spatial splits.
std::vector<LineSpaceSite> choose_sites(const NTree& ntree, const Bvh& bvh, const LspHeader& bounds,
                                        const LineSpaceOptions& options);
uint32_t attach(NTree& ntree, const std::vector<LineSpaceSite>& sites,
                const std::vector<uint32_t>& references);

}  // namespace lsp
