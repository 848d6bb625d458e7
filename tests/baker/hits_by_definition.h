// What a ray hits, by every triangle tested in double precision.
#pragma once

#include <cmath>
#include <cstdint>
#include <glm/glm.hpp>
#include <vector>

#include "lsp/layout.h"

namespace lsp::test {

constexpr double kEdge = 1e-4;  // rays this close to an edge, in its weights, are left to rounding

struct Answer {
  double t = 1;
  uint32_t record = LSP_NONE;
  bool doubtful = false;  // an edge or another hit is too near to tell
};

inline glm::dvec3 vec(const lsp_float3& v) { return {v.x, v.y, v.z}; }

inline Answer by_definition(const std::vector<LspTriangle>& triangles, const glm::dvec3& o,
                            const glm::dvec3& d) {
  Answer answer;
  double second = 1;
  for (uint32_t i = 0; i < triangles.size(); ++i) {
    const glm::dvec3 a = vec(triangles[i].v0), e1 = vec(triangles[i].v1) - a, e2 = vec(triangles[i].v2) - a;
    const glm::dvec3 n = glm::cross(e1, e2);
    const double facing = glm::dot(n, d);
    const double t = glm::dot(n, a - o) / facing;
    if (!(t > 2e-4 && t < 1)) continue;
    const glm::dvec3 p = o + t * d - a;
    const double u = glm::dot(glm::cross(p, e2), n) / glm::dot(n, n),
                 v = glm::dot(glm::cross(e1, p), n) / glm::dot(n, n);
    const double inside = std::min({u, v, 1 - u - v});
    if (inside < -kEdge) continue;
    if (inside < kEdge || std::fabs(facing) < 1e-3 * glm::length(n) * glm::length(d)) answer.doubtful = true;
    if (inside < 0) continue;
    if (t < answer.t) {
      second = answer.t;
      answer.t = t;
      answer.record = i;
    } else {
      second = std::min(second, t);
    }
  }
  if (answer.record != LSP_NONE && second - answer.t < 1e-5) answer.doubtful = true;
  return answer;
}

}  // namespace lsp::test
