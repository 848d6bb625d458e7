// The curved, dense things of the sample scenes: cloth, sculptures, vessels, plants. In metres.
#pragma once

#include "scene.h"

namespace lsp::sample {

// A number in [0, 1) that depends on `seed` and `index` alone.
float random01(int seed, int index);

// A banner that hangs from y = 0 down to -length, `width` wide along x, billowing along z. `seed` varies it.
Surface banner(const Detail& detail, float width, float length, int seed);
// One half of a pair of curtains for an opening from x = 0 to `width`, hung at y = 0, gathered and tied back
// to x = 0 at 0.6 of its length.
Surface tied_curtain(const Detail& detail, float width, float length, int seed);
// A cloth slung along z between two ends at y = 0, z = +-span / 2, sagging in the middle.
Surface awning(const Detail& detail, float width, float span, float sag, int seed);

// Closed surfaces about the origin, within a unit sphere or slightly over.
Surface torus_knot(const Detail& detail, int p, int q);
Surface gyroid_sphere(const Detail& detail);  // a lattice cut from a ball
Surface coral(const Detail& detail);          // a sphere displaced by waves
Surface twisted_vase(const Detail& detail);   // superformula sections that turn and swell, standing on y = 0
Surface blob_figure(const Detail& detail);    // smoothly joined balls: a reclining, leaning form

// A lathe-turned stand with its foot at y = 0.
Surface pedestal(const Detail& detail, float radius, float height);
// Basin, stem and bowl of a fountain with its foot at y = 0; the water surfaces apart.
Surface fountain_stone(const Detail& detail);
Surface fountain_water(const Detail& detail);
// An earthen pot of radius 0.34, and the leaves growing out of it.
Surface pot(const Detail& detail);
Surface palm_leaves(const Detail& detail, int seed);

// A hanging lantern: chain and cage, and its glowing glass; hung from y = 0, `drop` long.
Surface lantern_frame(const Detail& detail, float drop);
Surface lantern_glass(float drop);

}  // namespace lsp::sample
