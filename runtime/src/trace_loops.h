// The tracers' loops over rays, one set a base structure.
#pragma once

#include "lsp/lsp.h"

namespace lsp {

// Adds to *counts unless it is null.
using TraceLoop = void (*)(const lsp_scene&, float lod, const LspRay*, LspHit*, uint64_t count,
                           lsp_trace_counts* counts);

// The loops by LSP_TRACE_* flags; null: flags that exclude each other.
struct TraceLoops {
  TraceLoop of[LSP_TRACE_ALL_FLAGS + 1];
};

// Of exact rays through wide nodes: for the closest hit, for any.
struct WideLoops {
  TraceLoop of[2];
};

// Of scenes whose triangles are solid, and of those where some are there in part.
namespace solid {
extern const TraceLoops kBvhLoops, kNTreeLoops;
extern const WideLoops kWideLoops;
}  // namespace solid
namespace partial {
extern const TraceLoops kBvhLoops, kNTreeLoops;
extern const WideLoops kWideLoops;
}  // namespace partial

}  // namespace lsp
