// Approximate rays of a scene of cells, many at once across the lanes of a vector: trace_cells_wide.cpp.
#pragma once

#include "lsp/lsp.h"

namespace lsp {

// One vector instruction set, and the loop compiled for it. The bits are those of trace_cells.
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

}  // namespace lsp
