// The scenes of the corpus whose base structure is an NTree.
#pragma once

#include <vector>

#include "image.h"

namespace lsp::corpus {

struct NtreeOptions {
  uint32_t branching = 2;
  uint32_t levels = 2;  // of nodes
  uint32_t leaf_triangles = 2;
  uint32_t resolution = 0;  // 0: no Line Spaces
  std::vector<uint32_t> depths = {
      1};                    // cells of these levels carry one where it has a filled shaft; 0 is the root
  uint32_t entry_bytes = 1;  // 0 makes binary, symmetric Line Spaces
  bool normals = false;
  bool materials = false;
  bool exact = true;  // false: what is below terminal Line Spaces is left out
};

// A box on a floor, see scenes.h.
Image ntree_scene(const NtreeOptions& options);

// The scene that mutations of an NTree start from: N = 2, two levels, all features, Line Spaces of one patch
// a face on the root, on nodes and on leaves.
Image full_ntree_scene();

Image empty_ntree_scene();

}  // namespace lsp::corpus
