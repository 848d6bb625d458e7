// The tracers' loops over rays, one set a base structure.
#pragma once

#include "lsp/lsp.h"

namespace lsp {

struct TraceLoops {
  // By LSP_TRACE_* flags; null: flags that exclude each other.
  void (*plain[LSP_TRACE_ALL_FLAGS + 1])(const lsp_scene&, float lod, const LspRay*, LspHit*, uint64_t count);
  void (*counting)(const lsp_scene&, uint32_t flags, float lod, const LspRay*, LspHit*, uint64_t count,
                   lsp_trace_counts&);
};

extern const TraceLoops kBvhLoops;
extern const TraceLoops kNTreeLoops;

}  // namespace lsp
