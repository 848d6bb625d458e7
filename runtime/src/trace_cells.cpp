#include "trace_cells.h"

#include "trace_group.h"

namespace lsp {
namespace {

using namespace subset;

struct CellsTraversal {
#define LSP_CELLS
#include "lsp/traverse.h"
#undef LSP_CELLS
};

}  // namespace

LSP_CLONES void trace_cells(const lsp_scene& scene, bool any_hit, uint32_t dial, const LspRay* rays,
                            LspHit* hits, uint64_t count, lsp_trace_counts* counts) {
  CellsTraversal traversal;
  const uint32_t flags = LSP_TRACE_APPROXIMATE | (any_hit ? LSP_TRACE_ANY_HIT : 0u);
  for (uint64_t i = 0; i < count; ++i) {
    const auto traced = traversal.lsp_trace_ray(scene, rays[i], flags, 0, dial);
    hits[i] = traced.hit;
    add(counts, traced);
  }
}

}  // namespace lsp
