// How wrong answers to rays are, measured against truth.
#pragma once

#include <cstdint>
#include <span>

#include "soup.h"

namespace lsp::bench {

struct Spread {
  double mean = 0, p95 = 0, p99 = 0;
};

struct RayErrors {
  uint64_t rays = 0;
  uint64_t true_hits = 0;     // rays that hit in truth
  uint64_t wrong_hits = 0;    // answered with a hit, miss in truth
  uint64_t wrong_misses = 0;  // answered with a miss, hit in truth
  uint64_t both_hit = 0;      // what the figures below are taken over
  uint64_t wrong_primitive = 0;
  Spread depth_diagonal;  // |t - truth| * length of the direction / the scene's diagonal
  Spread depth_distance;  // |t - truth| / truth
  Spread normal_degrees;  // angle between the shading normals

  double wrong_share() const {
    return rays ? static_cast<double>(wrong_hits + wrong_misses) / static_cast<double>(rays) : 0;
  }
};

// Closest hits. answers[i] and truth[i] answer rays[i]; normals of `truth` are taken from `soup`.
RayErrors ray_errors(const Soup& soup, std::span<const LspRay> rays, std::span<const LspHit> truth,
                     std::span<const LspHit> answers);

// Any hit: only hit or miss counts.
RayErrors occlusion_errors(std::span<const LspHit> truth, std::span<const LspHit> answers);

// Mean, 95th and 99th percentile (nearest rank) of `values`, which it reorders.
Spread spread_of(std::span<float> values);

}  // namespace lsp::bench
