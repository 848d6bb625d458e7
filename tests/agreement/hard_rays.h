// Rays that are hard to answer alike: through corners and edges, along axes, in the planes of boxes, from
// inside, with signed zeros, with lengths at the ends of the range, and invalid ones.
#pragma once

#include <span>
#include <vector>

#include "lsp/interface.h"
#include "scene_builder.h"

namespace lsp::test {

// `count` rays about a scene of the given scale, every kind in turn.
std::vector<LspRay> hard_rays(std::span<const LspTriangle> triangles, uint32_t count, uint64_t seed,
                              float scale = 1);

}  // namespace lsp::test
