// The triangles that rays are aimed at and judged against: every primitive once, in no particular structure.
#pragma once

#include <array>
#include <cstdint>
#include <glm/glm.hpp>
#include <vector>

#include "lsp/lsp.h"

namespace lsp {
struct Mesh;
}

namespace lsp::bench {

struct Soup {
  std::vector<std::array<glm::vec3, 3>> corners;  // per triangle
  std::vector<std::array<glm::vec3, 3>> normals;  // per triangle, unit; empty: take the geometric normal
  std::vector<uint32_t> primitives;               // per triangle: number in import order, ascending
  std::vector<uint32_t> gaps;                     // per triangle: LSP_TRIANGLE_GAPS; empty: all are solid
  std::vector<uint32_t> triangle_of;              // per primitive: triangle or LSP_NONE (rejected at import)
  glm::dvec3 lo{0}, hi{0};
  double diagonal = 0;

  size_t size() const { return corners.size(); }
};

// The triangles of an open file; a primitive that spatial splits have repeated is taken once. Of a file
// without an exact tree these are only the triangles that some shaft refers to.
Soup soup_of(const lsp_scene& scene);

Soup soup_of(const Mesh& mesh);

// Whether the ray passes a triangle that is there in part, as the specification states it.
bool passes(const Soup& soup, uint32_t triangle, const LspRay& ray);

// (v1 - v0) x (v2 - v0), in double: twice the area times the unit normal.
glm::dvec3 geometric_normal(const std::array<glm::vec3, 3>& corners);

// Interpolated unit normal at the barycentric weights u, v of corners 1 and 2; geometric without `normals`.
glm::dvec3 shading_normal(const Soup& soup, uint32_t triangle, double u, double v);

// Per corner (3 * triangle + k) the number of its distinct position; bitwise equal positions (-0 == 0) share
// one. Numbers are dense from 0.
std::vector<uint32_t> weld(const Soup& soup);

// Number of edges that do not have exactly two triangles after the weld: 0 for a closed two-manifold (and for
// one with pinched vertices, which leak nothing).
size_t open_edges(const Soup& soup);

}  // namespace lsp::bench
