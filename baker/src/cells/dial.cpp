#include "dial.h"

#include <tbb/parallel_for.h>

#include <array>
#include <cmath>

#include "../surface_rays.h"

namespace lsp {
namespace {

constexpr uint32_t kPoints = 2048;         // of either kind
constexpr uint32_t kPerPoint = 16;         // rays
constexpr double kRadii[] = {0.067, 0.2};  // of ambient occlusion, in diagonals

// A ray costs this much besides its look-ups: steps through the grid are cheap, exact traces dear (H200,
// lavapipe).
constexpr double kLookUp = 2, kExact = 3, kExactNode = 0.5, kTriangle = 1;

// What a point of the dial errs.
struct DialError {
  double wrong = 0;    // share of the rays answered wrongly
  double depth = 0;    // mean error of the distance where both hit, in diagonals
  double picture = 0;  // of ambient occlusion, over its mean or 0.25: the worse of a short and a long radius
  double cost = 0;     // of a ray: steps, look-ups and exact traces
};

struct Rays {
  std::vector<LspRay> rays;  // kPerPoint of each point, one after the other
  std::vector<LspHit> truth;
};

std::vector<LspHit> trace(const lsp_scene& scene, const lsp_trace_options& options,
                          const std::vector<LspRay>& rays, lsp_trace_counts* counts) {
  std::vector<LspHit> hits(rays.size());
  constexpr size_t kPart = 1024;
  const size_t parts = (rays.size() + kPart - 1) / kPart;
  std::vector<lsp_trace_counts> sums(parts);
  tbb::parallel_for(size_t(0), parts, [&](size_t p) {
    const size_t first = p * kPart;
    lsp_trace(&scene, &options, &rays[first], &hits[first], std::min(kPart, rays.size() - first), &sums[p],
              nullptr);
  });
  for (const lsp_trace_counts& sum : sums) lsp_add_counts(counts, &sum);
  return hits;
}

// How open each point is to a radius: the share of its rays that meet nothing nearer.
double open_share(const LspHit* hits, double radius) {
  int open = 0;
  for (uint32_t k = 0; k < kPerPoint; ++k) open += hits[k].t < radius ? 0 : 1;
  return double(open) / kPerPoint;
}

DialError measure(const lsp_scene& scene, const Rays& set, double diagonal) {
  lsp_trace_counts counts{};
  const std::vector<LspHit> hits = trace(scene, {LSP_TRACE_APPROXIMATE, 0, 0, 0}, set.rays, &counts);
  DialError error;
  size_t wrong = 0, both = 0;
  double depth = 0;
  for (size_t i = 0; i < hits.size(); ++i) {
    const bool answer = hits[i].primitive != LSP_NONE, truth = set.truth[i].primitive != LSP_NONE;
    wrong += answer != truth;
    if (!answer || !truth) continue;
    ++both;
    depth += std::fabs(double(hits[i].t) - double(set.truth[i].t));
  }
  const double rays = double(std::max<size_t>(1, hits.size()));
  error.wrong = double(wrong) / rays;
  error.depth = both ? depth / double(both) / diagonal : 0;
  for (double radius : kRadii) {
    double sum = 0, off = 0;
    const size_t points = hits.size() / kPerPoint;
    for (size_t p = 0; p < points; ++p) {
      const double truth = open_share(&set.truth[p * kPerPoint], radius * diagonal);
      sum += truth;
      off += std::fabs(open_share(&hits[p * kPerPoint], radius * diagonal) - truth);
    }
    const double mean = sum / double(std::max<size_t>(1, points));
    error.picture = std::max(error.picture, off / double(std::max<size_t>(1, points)) / std::max(0.25, mean));
  }
  error.cost = (double(counts.nodes) + kLookUp * double(counts.shafts) + kExact * double(counts.exact) +
                kExactNode * double(counts.exact_nodes) + kTriangle * double(counts.triangles)) /
               rays;
  return error;
}

bool within(const DialError& e, double wrong) {
  return e.wrong <= wrong && e.depth <= wrong && e.picture <= 3 * wrong;
}

// The cheapest dial that keeps within errors, or the finest. The more of the origin tables is heeded, the
// less of the far tables can be: a walk along the border of what is within. Tries dials in the header's
// `balanced`.
uint32_t cheapest(const lsp_scene& scene, LspHeader& header, const std::array<Rays, 2>& sets, double diagonal,
                  double wrong) {
  // What nobody knows is never heeded: rays of other places than these may come there.
  constexpr uint32_t kClasses[] = {0, 1, 2, 3, 4, 5, 6, LSP_LOSS_UNKNOWN};
  uint32_t best = LSP_DIAL(0u, 0u);
  double least = INFINITY;
  for (size_t near = 0, far = std::size(kClasses); near < std::size(kClasses) && far > 0;) {
    const uint32_t dial = LSP_DIAL(kClasses[near], kClasses[far - 1]);
    header.quality[LSP_QUALITY_BALANCED] = dial;
    double cost = 0;
    bool kept = true;
    for (const Rays& set : sets) {
      const DialError error = measure(scene, set, diagonal);
      cost = std::max(cost, error.cost);
      kept = kept && within(error, wrong);
      if (!kept) break;
    }
    if (kept && cost < least) {
      least = cost;
      best = dial;
    }
    if (kept)
      ++near;
    else
      --far;
  }
  return best;
}

}  // namespace

void choose_dial(Baked& baked, double wrong) {
  LspHeader& h = baked.header;
  for (uint32_t& dial : h.quality) dial = LSP_DIAL_TABLES;
  if (baked.cell_tables.references.empty()) return;
  const double diagonal = glm::length(glm::dvec3(h.bounds_max.x, h.bounds_max.y, h.bounds_max.z) -
                                      glm::dvec3(h.bounds_min.x, h.bounds_min.y, h.bounds_min.z));
  const lsp_scene scene = view(baked);
  std::array<Rays, 2> sets;
  sets[0].rays = surface_rays(baked, kPoints, kPerPoint);
  sets[1].rays = seen_rays(baked, kPoints, kPerPoint);
  lsp_trace_counts ignored{};
  for (Rays& set : sets) set.truth = trace(scene, {0, 0, 0, 0}, set.rays, &ignored);

  const uint32_t accurate = cheapest(scene, h, sets, diagonal, 0.5 * wrong);
  h.quality[LSP_QUALITY_BALANCED] = cheapest(scene, h, sets, diagonal, wrong);
  h.quality[LSP_QUALITY_ACCURATE] = accurate;
}

}  // namespace lsp
