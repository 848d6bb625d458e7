// Which losses to heed: the dial's points that a file of cells states.
#pragma once

#include "../bake.h"

namespace lsp {

// Measures the dial, on rays that trained nothing, from the surfaces and from what eyes in the scene see, and
// writes header.quality: fast answers from tables alone, balanced errs at most `wrong` (a share) of the rays,
// as much in depth, three times as much in ambient occlusion and four times as much in the light that
// surfaces send back, accurate half of that; each traces as little exactly as that allows. Writes
// baked.qualities; without exact data there is nothing to measure.
void choose_dial(Baked& baked, double wrong);

}  // namespace lsp
