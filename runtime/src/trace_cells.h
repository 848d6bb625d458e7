// Approximate rays of a scene of cells.
#pragma once

#include "lsp/lsp.h"

namespace lsp {

// Adds to *counts unless it is null.
using TraceCells = void(const lsp_scene& scene, bool any_hit, uint32_t dial, const LspRay* rays, LspHit* hits,
                        uint64_t count, lsp_trace_counts* counts);

namespace solid {
TraceCells trace_cells;
}
namespace partial {  // some triangles are
TraceCells trace_cells;
}

}  // namespace lsp
