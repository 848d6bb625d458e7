// Rays aimed exactly where a tracer could leak through a closed mesh: at corners and at the middles of edges.
#pragma once

#include <vector>

#include "pcg32.h"
#include "rays.h"

namespace lsp::bench {

// Points well inside the closed mesh `soup` (winding number one, judged in double), at most `count`.
std::vector<glm::dvec3> interior_points(const Soup& soup, size_t count, Random& random);

// Up to `count` rays from `origins`, which lie inside the closed mesh, at corners and edge middles all over
// it. Every one has to hit something.
std::vector<LspRay> inside_leak_rays(const Soup& soup, const std::vector<glm::dvec3>& origins, size_t count);

// Up to `count` rays from far outside at corners and edge middles whose triangles all face the ray the same
// way with a margin, so that the target is no silhouette. Every one has to hit something.
std::vector<LspRay> outside_leak_rays(const Soup& soup, size_t count, Random& random);

}  // namespace lsp::bench
