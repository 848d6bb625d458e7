// Exact rays of a scene with wide nodes, one after the other: those that are counted, and all where there are
// no vectors. The others go through trace_wide_lanes.cpp.
#include "trace_group.h"

namespace lsp {
namespace {

using namespace subset;

struct WideTraversal {
#define LSP_WIDE
#include "lsp/traverse.h"
#undef LSP_WIDE
};

}  // namespace

LSP_CLONES void trace_wide(const lsp_scene& scene, uint32_t flags, float lod, const LspRay* rays,
                           LspHit* hits, uint64_t count, lsp_trace_counts* counts) {
  trace_singly<WideTraversal>(scene, flags, lod, rays, hits, count, counts);
}

}  // namespace lsp
