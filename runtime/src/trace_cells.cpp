#include "trace_cells.h"

#include "trace_group.h"
#include "trace_variant.h"

namespace lsp::LSP_VARIANT {
namespace {

using namespace subset;

struct CellsTraversal {
#define LSP_CELLS
#include "lsp/traverse.h"
#undef LSP_CELLS
};

template <uint32_t kFlags>
LSP_CLONES void trace(const lsp_scene& scene, uint32_t dial, const LspRay* rays, LspHit* hits, uint64_t count,
                      lsp_trace_counts* counts) {
  CellsTraversal traversal;
  for (uint64_t i = 0; i < count; ++i) {
    const auto traced = traversal.lsp_trace_ray(scene, rays[i], kFlags, 0, dial);
    hits[i] = traced.hit;
    add(counts, traced);
  }
}

}  // namespace

void trace_cells(const lsp_scene& scene, bool any_hit, uint32_t dial, const LspRay* rays, LspHit* hits,
                 uint64_t count, lsp_trace_counts* counts) {
  (any_hit ? trace<LSP_TRACE_APPROXIMATE | LSP_TRACE_ANY_HIT>
           : trace<LSP_TRACE_APPROXIMATE>)(scene, dial, rays, hits, count, counts);
}

}  // namespace lsp::LSP_VARIANT
