// Exact rays of a scene with wide nodes, a node's eight boxes in the lanes of a vector: trace_wide_lanes.cpp.
#pragma once

#include "lsp/lsp.h"

namespace lsp {

// One vector instruction set, and the loop compiled for it. The bits are those of trace_wide.
struct WideExact {
  const char* name;
  bool (*runs_here)();  // on this CPU
  void (*trace)(const lsp_scene& scene, uint32_t flags, const LspRay* rays, LspHit* hits, uint64_t count);
};

// All that are compiled in, the best first, and a last one whose name is null.
extern const WideExact kWideExact[];

// The best that runs here. Null: none does.
const WideExact* wide_exact();

}  // namespace lsp
