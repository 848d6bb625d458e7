// The scenes of the corpus that have wide nodes.
#pragma once

#include "image.h"

namespace lsp::corpus {

// full_cells_scene with wide nodes in place of its BVH: node 0 has the nodes 1 and 2, node 1 has node 3, and
// there are seven leaves of one to four triangles. Children that are none lie between others.
Image full_wide_scene();
// The same nodes alone, without cells: the base structure is theirs.
Image wide_alone_scene();
// No triangle, and a grid of one empty cell.
Image empty_wide_scene();

// Sets the planes of child `k`, lo x, y, z, hi x, y, z.
void set_planes(LspWideNode& node, uint32_t k, const uint32_t (&planes)[6]);
void set_child(LspWideNode& node, uint32_t k, uint32_t child);

}  // namespace lsp::corpus
