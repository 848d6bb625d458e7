// The CPU tracer: lsp/traverse.h compiled as C++, once counting and once not.
#include "lsp/lsp.h"
#include "trace_subset.h"

namespace lsp::plain {
using namespace lsp::subset;
#define LSP_COUNTS_PARAM
#define LSP_COUNTS_ARG
#include "lsp/traverse.h"
}  // namespace lsp::plain

#undef LSP_TRAVERSE_H
#undef LSP_COUNT_ADD
#undef LSP_COUNTS_PARAM
#undef LSP_COUNTS_ARG

namespace lsp::counting {
using namespace lsp::subset;
#define LSP_COUNT
#define LSP_COUNTS_PARAM , LspCounts& counts
#define LSP_COUNTS_ARG , counts
#include "lsp/traverse.h"
}  // namespace lsp::counting

namespace {

// One loop per set of flags, so that the compiler folds the flags' tests away.
template <uint32_t kFlags>
void trace_plain(const lsp_scene& scene, float lod, const LspRay* rays, LspHit* hits, uint64_t count) {
  for (uint64_t i = 0; i < count; ++i) {
    bool valid;
    hits[i] = lsp::plain::lsp_trace_ray(scene, rays[i], kFlags, lod, valid);
  }
}

void trace_counting(const lsp_scene& scene, uint32_t flags, float lod, const LspRay* rays, LspHit* hits,
                    uint64_t count, lsp_trace_counts& sums) {
  for (uint64_t i = 0; i < count; ++i) {
    lsp::counting::LspCounts counts{};
    bool valid;
    hits[i] = lsp::counting::lsp_trace_ray(scene, rays[i], flags, lod, valid, counts);
    sums.rays += 1;
    sums.invalid += valid ? 0 : 1;
    sums.hits += hits[i].primitive != LSP_NONE ? 1 : 0;
    sums.nodes += counts.nodes;
    sums.shafts += counts.shafts;
    sums.triangles += counts.triangles;
  }
}

using TraceLoop = void (*)(const lsp_scene&, float, const LspRay*, LspHit*, uint64_t);
constexpr uint32_t kExactFlags = LSP_TRACE_ANY_HIT;  // what an exact trace heeds
constexpr TraceLoop kLoops[16] = {trace_plain<0>, trace_plain<1>, trace_plain<2>, trace_plain<3>,
                                  nullptr,        trace_plain<5>, nullptr,        trace_plain<7>,
                                  nullptr,        trace_plain<9>, nullptr,        trace_plain<11>};

lsp_status refuse(lsp_error* error, const char* message) {
  if (error) {
    *error = {LSP_ERROR_UNSUPPORTED, 0, {}};
    for (size_t i = 0; i + 1 < sizeof error->message && message[i]; ++i) error->message[i] = message[i];
  }
  return LSP_ERROR_UNSUPPORTED;
}

}  // namespace

extern "C" lsp_status lsp_trace(const lsp_scene* scene, const lsp_trace_options* options, const LspRay* rays,
                                LspHit* hits, uint64_t count, lsp_trace_counts* counts, lsp_error* error) {
  const uint32_t features = scene->header->required_features;
  const bool approximate =
      (options->flags & LSP_TRACE_APPROXIMATE) != 0 && (features & LSP_FEATURE_LINE_SPACES) != 0;
  if (!approximate && !(features & LSP_FEATURE_EXACT))
    return refuse(error, "the file has no exact tree, trace it approximately or bake it without --no-exact");
  uint32_t flags = options->flags & (approximate ? LSP_TRACE_ALL_FLAGS : kExactFlags);
  if (flags & LSP_TRACE_NEAR_APPROXIMATE) flags &= ~LSP_TRACE_NEAR_SKIP;
  if (counts)
    trace_counting(*scene, flags, options->lod, rays, hits, count, *counts);
  else
    kLoops[flags](*scene, options->lod, rays, hits, count);
  return LSP_OK;
}
