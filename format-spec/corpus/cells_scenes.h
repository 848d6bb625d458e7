// The scene of the corpus that has cells.
#pragma once

#include "image.h"

namespace lsp::corpus {

// A box on a floor in a grid of two cells, the first of which is filled: N = 1, M = 1, one sub-cell, one
// plane, one split, a tree of three nodes. `exact`: with what exact rays need.
Image full_cells_scene(bool exact = true);

// The same, of which rays that miss are traced again.
Image closed_cells_scene();

}  // namespace lsp::corpus
