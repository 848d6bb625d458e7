// Which losses to heed: the dial's points that a file of cells states.
#pragma once

#include "../bake.h"

namespace lsp {

// What a point of the dial errs on rays that trained nothing: from the surfaces, and from what eyes in the
// scene see.
struct DialError {
  double wrong = 0;    // share of the rays answered wrongly
  double depth = 0;    // mean error of the distance where both hit, in diagonals
  double picture = 0;  // of ambient occlusion, over its mean or 0.25: the worse of a short and a long radius
  double cost = 0;     // of a ray: steps, look-ups and exact traces
};

// Measures the dial and writes header.quality: fast answers from tables alone, balanced errs at most 1 % of
// rays, 1 % in depth and 3 % in ambient occlusion, accurate half of that; each is the cheapest dial that
// does, or the finest.
void choose_dial(Baked& baked);

}  // namespace lsp
