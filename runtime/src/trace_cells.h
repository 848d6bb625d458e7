// Approximate rays of a scene of cells, one after the other.
#pragma once

#include "lsp/lsp.h"

namespace lsp {

// Adds to *counts unless it is null.
void trace_cells(const lsp_scene& scene, bool any_hit, uint32_t dial, const LspRay* rays, LspHit* hits,
                 uint64_t count, lsp_trace_counts* counts);

}  // namespace lsp
