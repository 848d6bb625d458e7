// The base structure BVH: top-down, binned surface area heuristic, with spatial splits.
//
// Wald, "On fast Construction of SAH-based Bounding Volume Hierarchies", 2007 (binning); Stich, Friedrich,
// Dietrich, "Spatial Splits in Bounding Volume Hierarchies", HPG 2009.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "box.h"
#include "lsp/layout.h"
#include "mesh.h"

namespace lsp {

struct BvhOptions {
  uint32_t max_leaf_triangles = 4;  // 1 to LSP_MAX_LEAF_TRIANGLES
  double traversal_cost = 1.0;      // of a node's two boxes
  double triangle_cost = 1.0;       // of a triangle test
  // On by default: a closest ray of the benchmark visits, with against without them, 19.9 / 29.3 nodes on
  // Sponza (13 % more references), 17.6 / 22.5 in the conference room (10 %), 22.6 / 25.1 in Sibenik (15
  // %), 32.3 / 33.5 on the dragon (7 %), 22.9 / 23.0 on the bunny (1 %). The build takes two to three times
  // as long.
  bool spatial_splits = true;
  // References that spatial splits may add, as a share of the triangles.
  double split_budget = 0.3;
  // Spatial splits are tried where the children of the best object split overlap in a box with more than this
  // share of the root's area (Stich's alpha).
  double split_overlap = 1e-5;
  // What of the triangles lies outside is left out, as nobody traces it. Null: nothing is.
  const Box* within = nullptr;
  // Below this depth nodes are halved by count, so that no tree is much deeper.
  uint32_t heuristic_depth = LSP_MAX_STACK - 34;
};

// The tree in the file's form. `nodes` is in depth-first order, child 0 (of the larger area) before child 1;
// `records` lists the mesh triangle of each triangle record in leaf order, so that the records of a subtree
// are contiguous.
struct Bvh {
  std::vector<LspNode> nodes;  // no Line Spaces yet
  std::vector<uint32_t> records;
  uint32_t root = LSP_NONE;
  uint32_t max_depth = 0;
  uint32_t max_leaf_triangles = 0;
  uint32_t leaf_count = 0;
};

// Builds on all threads of the current oneTBB arena; the result does not depend on their number. `progress`
// is called with the share done, from any thread.
Bvh build_bvh(const Mesh& mesh, const BvhOptions& options, const std::function<void(double)>& progress = {});

}  // namespace lsp
