// Where pictures are taken from that a table would rather not be seen from.
#pragma once

#include "rays.h"

namespace lsp::bench {

// How much a small picture from there shows of near detail: how often depth and normal change from one pixel
// to the next, where that is less than a quarter of the diagonal away. 0: plain, far or nothing; at most 1.
double detail_of(const Soup& soup, const TraceFunction& trace, const Camera& camera);

// A camera close to the scene's surfaces, in front of them and with nothing in the way, from where most
// detail is seen of all places tried. Deterministic. `otherwise` where no place is any good.
Camera choose_close_camera(const Soup& soup, const TraceFunction& trace, const Camera& otherwise);

}  // namespace lsp::bench
