// Rays of a scene of cells, many at once across the lanes of a vector: trace_cells_wide.cpp.
#pragma once

#include "lsp/lsp.h"

namespace lsp {

// One vector instruction set, and the loop compiled for it. With LSP_TRACE_APPROXIMATE among the flags the
// bits are those of trace_cells. Without it they are those of trace_wide, of closest hits; the dial means
// nothing, and the scene needs the exact tree as well.
struct WideCells {
  const char* name;
  bool (*runs_here)();  // on this CPU
  void (*trace)(const lsp_scene& scene, uint32_t flags, uint32_t dial, const LspRay* rays, LspHit* hits,
                uint64_t count);
};

// So few rays are faster one after the other.
constexpr uint64_t kFewRays = 16;

// All that are compiled in, the best first, and a last one whose name is null.
extern const WideCells kWideCells[];

// The best that runs here. Null: none does, or the scene is too large for it.
const WideCells* wide_cells(const lsp_scene& scene);

// So few exact rays are faster through the tree.
constexpr uint64_t kFewExactRays = 128;

// The same for exact closest rays, where it is faster than the tree: with sixteen lanes (1.2x to 1.4x in
// halls, with eight 0.9x to 1.0x). Null: the tree is.
const WideCells* wide_cells_for_exact_rays(const lsp_scene& scene);

}  // namespace lsp
