#include "error.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "lsp/lsp.h"
#include "surface_rays.h"
#include "vectors.h"

namespace lsp {
namespace {}  // namespace

MeasuredError measure_error(const Baked& baked, uint64_t rays) {
  constexpr uint32_t kTables = LSP_FEATURE_LINE_SPACES | LSP_FEATURE_CELLS;
  const uint32_t features = baked.header.required_features;
  if (!(features & LSP_FEATURE_EXACT) || !(features & kTables) || baked.triangles.empty()) return {};
  const lsp_scene scene = view(baked);
  const glm::dvec3 extent = dvec(baked.header.bounds_max) - dvec(baked.header.bounds_min);
  const double diagonal = glm::length(extent);

  const SurfaceRays make(baked);
  struct Part {
    uint64_t wrong_hits = 0, wrong_misses = 0, both = 0;
    double depth = 0;
  };
  constexpr uint64_t kPart = 1024;
  std::vector<Part> parts((rays + kPart - 1) / kPart);
  tbb::parallel_for(size_t(0), parts.size(), [&](size_t p) {
    const uint64_t begin = p * kPart, end = std::min(rays, begin + kPart);
    std::vector<LspRay> batch;
    for (uint64_t r = begin; r < end; ++r) batch.push_back(make.make(r, r));
    std::vector<LspHit> exact(batch.size()), approximate(batch.size());
    const lsp_trace_options exact_options = {0, 0, 0, 0},
                            approximate_options = {LSP_TRACE_APPROXIMATE, 0, 0, 0};
    lsp_trace(&scene, &exact_options, batch.data(), exact.data(), batch.size(), nullptr, nullptr);
    lsp_trace(&scene, &approximate_options, batch.data(), approximate.data(), batch.size(), nullptr, nullptr);
    baked.line_spaces.words.release();
    baked.line_spaces.candidates.release();
    for (size_t i = 0; i < batch.size(); ++i) {
      const bool truth = exact[i].primitive != LSP_NONE, answer = approximate[i].primitive != LSP_NONE;
      parts[p].wrong_hits += answer && !truth;
      parts[p].wrong_misses += truth && !answer;
      if (!truth || !answer) continue;
      ++parts[p].both;
      parts[p].depth += std::fabs(double(approximate[i].t) - double(exact[i].t));
    }
  });
  MeasuredError error;
  error.rays = rays;
  uint64_t both = 0;
  double depth = 0;
  for (const Part& p : parts) {
    error.wrong_hits += p.wrong_hits;
    error.wrong_misses += p.wrong_misses;
    both += p.both;
    depth += p.depth;
  }
  error.depth_error = both && diagonal > 0 ? depth / double(both) / diagonal : 0;
  return error;
}

}  // namespace lsp
