// The tracers' loops over rays, one set a base structure.
#pragma once

#include "lsp/lsp.h"

namespace lsp {

// Adds to *counts unless it is null. `flags`: LSP_TRACE_*, those that mean something together.
using TraceLoop = void (*)(const lsp_scene&, uint32_t flags, float lod, const LspRay*, LspHit*,
                           uint64_t count, lsp_trace_counts* counts);

// Of a base structure: for exact rays and for approximate ones.
struct TraceLoops {
  TraceLoop exact, approximate;
};

// Of scenes whose triangles are solid, and of those where some are there in part.
namespace solid {
extern const TraceLoops kBvhLoops, kNTreeLoops;
}  // namespace solid
namespace partial {
extern const TraceLoops kBvhLoops, kNTreeLoops;
// A valid ray from so far away that an NTree treats it apart, of scenes of either kind.
void trace_far_in_ntree(const lsp_scene&, uint32_t flags, float lod, const LspRay&, LspHit&,
                        lsp_trace_counts* counts);
}  // namespace partial

// Exact rays through wide nodes, of scenes of either kind.
void trace_wide(const lsp_scene&, uint32_t flags, float lod, const LspRay*, LspHit*, uint64_t count,
                lsp_trace_counts* counts);

}  // namespace lsp
