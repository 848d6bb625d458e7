// The CPU tracer: checks what is asked for and hands the rays to the loop for it.
#include <cmath>

#include "error.h"
#include "lsp/lsp.h"
#include "trace_cells.h"
#include "trace_loops.h"
#include "trace_options.h"
#ifdef LSP_SIMD
#include "trace_cells_wide.h"
#include "trace_wide_lanes.h"
#endif

extern "C" uint32_t lsp_dial(const lsp_scene* scene, const lsp_trace_options* options) {
  // Without their triangles cells answer from tables alone.
  if (scene->cell_references == nullptr) return LSP_DIAL_TABLES;
  if ((options->flags & LSP_TRACE_MAX_LOSS) == 0) {
    const LspHeader& h = *scene->header;
    const uint32_t q = options->quality < LSP_QUALITY_COUNT ? options->quality : LSP_QUALITY_BALANCED;
    return LSP_DIAL(h.quality[q], h.quality_part[q]);
  }
  if (options->max_loss >= 100) return LSP_DIAL_TABLES;
  if (!(options->max_loss > 0)) return 0;
  // So many whole classes, and of the next one as large a part as max_loss is between their limits.
  uint32_t classes = 0;
  constexpr int kLimits[LSP_LOSS_UNKNOWN] = LSP_LOSS_LIMITS;
  while (classes < LSP_LOSS_UNKNOWN && options->max_loss >= static_cast<float>(kLimits[classes])) ++classes;
  const auto from = static_cast<float>(kLimits[classes - 1]), to = static_cast<float>(kLimits[classes]);
  const auto part = static_cast<uint32_t>((options->max_loss - from) / (to - from) * float{LSP_DIAL_PARTS});
  return LSP_DIAL(LSP_HEEDS(classes, classes), LSP_HEEDS(part, part));
}

extern "C" void lsp_add_counts(lsp_trace_counts* sum, const lsp_trace_counts* more) {
  sum->rays += more->rays;
  sum->invalid += more->invalid;
  sum->hits += more->hits;
  sum->nodes += more->nodes;
  sum->shafts += more->shafts;
  sum->triangles += more->triangles;
  sum->splits += more->splits;
  sum->exact += more->exact;
  sum->exact_nodes += more->exact_nodes;
}

extern "C" float lsp_hit_offset(const lsp_scene* scene, const LspHit* hit) {
  const LspHeader& header = *scene->header;
  const lsp_float3 lo = header.bounds_min, hi = header.bounds_max;
  const float diagonal = std::hypot(hi.x - lo.x, hi.y - lo.y, hi.z - lo.z);
  if ((hit->flags & LSP_HIT_LINE_SPACE) == 0) return LSP_OFFSET_EXACT * diagonal;
  return header.cells.size > 0 ? LSP_OFFSET_CELL * header.cells.size : LSP_OFFSET_LINE_SPACE * diagonal;
}

lsp_status lsp::check_options(const lsp_trace_options& options, lsp_error* error) {
  if (const uint32_t unknown =
          options.flags & ~(LSP_TRACE_ALL_FLAGS | LSP_TRACE_MAX_LOSS | LSP_TRACE_OCCLUSION);
      unknown != 0)
    return fail(error, LSP_ERROR_UNSUPPORTED, 0,
                "library version %s does not know trace flags 0x%x: leave them out or link a newer one",
                LSP_LIBRARY_VERSION_STRING, unknown);
  if (options.quality >= LSP_QUALITY_COUNT)
    return fail(error, LSP_ERROR_UNSUPPORTED, 0,
                "library version %s does not know quality %u: use LSP_QUALITY_*", LSP_LIBRARY_VERSION_STRING,
                options.quality);
  if (!(options.lod >= 0 && std::isfinite(options.lod)))
    return fail(error, LSP_ERROR_INVALID, 0, "lod is %g: give a finite number, 0 or more",
                double(options.lod));
  if ((options.flags & LSP_TRACE_MAX_LOSS) != 0 && !(options.max_loss >= 0 && options.max_loss <= 100))
    return fail(error, LSP_ERROR_INVALID, 0, "max_loss is %g: give per cent, 0 to 100",
                double(options.max_loss));
  return LSP_OK;
}

lsp_status lsp::check_scene(const lsp_scene& scene, const lsp_trace_options& options, lsp_error* error) {
  if (is_approximate(scene, options) || (scene.header->required_features & LSP_FEATURE_EXACT) != 0)
    return LSP_OK;
  return fail(error, LSP_ERROR_UNSUPPORTED, 0,
              "the file has no exact tree, trace it approximately or bake it without --no-exact");
}

extern "C" lsp_status lsp_trace(const lsp_scene* scene, const lsp_trace_options* options, const LspRay* rays,
                                LspHit* hits, uint64_t count, lsp_trace_counts* counts, lsp_error* error) {
  if (const lsp_status status = lsp::check_options(*options, error); status != LSP_OK) return status;
  if (const lsp_status status = lsp::check_scene(*scene, *options, error); status != LSP_OK) return status;
  lsp::succeed(error);  // nothing fails from here on
  const uint32_t features = scene->header->required_features;
  const bool approximate = lsp::is_approximate(*scene, *options);
  const bool partial = (features & LSP_FEATURE_COVERAGE) != 0;
  uint32_t flags = LSP_TRACE_IMPLIED(options->flags);
  const bool any_hit = (flags & LSP_TRACE_ANY_HIT) != 0;
  if (approximate && (features & LSP_FEATURE_CELLS) != 0) {
#ifdef LSP_SIMD
    const bool wide = counts == nullptr && count >= lsp::kFewRays;
    if (const lsp::WideCells* loop = wide ? lsp::wide_cells(*scene) : nullptr; loop != nullptr) {
      loop->trace(*scene, flags | LSP_TRACE_APPROXIMATE, lsp_dial(scene, options), rays, hits, count);
      return LSP_OK;
    }
#endif
    lsp::trace_cells(*scene, any_hit, lsp_dial(scene, options), rays, hits, count, counts);
    return LSP_OK;
  }
  if ((features & LSP_FEATURE_WIDE) != 0) {
#ifdef LSP_SIMD
    const bool in_cells =
        counts == nullptr && !any_hit && count >= lsp::kFewExactRays && (features & LSP_FEATURE_CELLS) != 0;
    if (const auto* loop = in_cells ? lsp::wide_cells_for_exact_rays(*scene) : nullptr; loop != nullptr) {
      loop->trace(*scene, flags, 0, rays, hits, count);
      return LSP_OK;
    }
    if (const lsp::WideExact* loop = counts == nullptr ? lsp::wide_exact() : nullptr; loop != nullptr) {
      loop->trace(*scene, flags, rays, hits, count);
      return LSP_OK;
    }
#endif
    lsp::trace_wide(*scene, flags, 0, rays, hits, count, counts);
    return LSP_OK;
  }
  flags &= approximate ? LSP_TRACE_ALL_FLAGS : LSP_TRACE_ANY_HIT;
  if (flags & LSP_TRACE_NEAR_APPROXIMATE) flags &= ~LSP_TRACE_NEAR_SKIP;
  const bool ntree = scene->header->base_structure == LSP_BASE_NTREE;
  const lsp::TraceLoops& loops = partial ? (ntree ? lsp::partial::kNTreeLoops : lsp::partial::kBvhLoops)
                                         : (ntree ? lsp::solid::kNTreeLoops : lsp::solid::kBvhLoops);
  (approximate ? loops.approximate : loops.exact)(*scene, flags, options->lod, rays, hits, count, counts);
  return LSP_OK;
}
