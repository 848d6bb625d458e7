// Conservative Line Spaces: the bit of a shaft is set wherever a triangle touches the shaft, not only where
// its centroid ray hits, so that a clear bit proves the shaft empty for every ray (lsp/empty_margin.h).
#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <memory>
#include <span>
#include <vector>

#include "lsp/layout.h"

namespace lsp {

// How far from a triangle a line may pass, along any axis, and still count as touching it: a hundredth more
// than lsp/empty_margin.h asks for, against the rounding of what is computed here. In scene units.
double empty_margin(const LspHeader& header);

// Whether a triangle reaches into a box, its border included.
bool reaches_into(const LspTriangle& triangle, const glm::dvec3& lo, const glm::dvec3& hi);

// Finds the shafts of one box that triangles touch.
//
// A triangle touches a shaft where it meets a straight line through both patches, each grown by the margin to
// a box. Along the line it can do so between the patches, or beyond either: three convex regions. Projected
// onto a coordinate plane, a patch is an axis-aligned rectangle, and the region is bounded by the rectangles'
// outer tangents (between) or crossed ones (beyond). Patches lie in a product of such projections, so that a
// triangle is first tested against O(N^3) of them, and only shafts left over by all are clipped against.
//
//   faces x = lo and z = lo, seen along y:          between           beyond the patch on z = lo
//
//        +-----------------+                      z1 o--.
//        |                 |                         |   `--.                   crossed tangents
//        o z1              |                      z0 o       `--.                 o P0  o P1
//        |  patch          |                          `--.       `--.            / |   `--.
//        o z0              |                              `--.       `--.       /  |       `--.
//        +---o-----o-------+                              P0 o-----------o P1
//            P0    P1
class TouchedShafts {
 public:
  // The box is that of the Line Space, not flat; `margin` as empty_margin gives it.
  TouchedShafts(const glm::vec3& lo, const glm::vec3& hi, double margin, uint32_t resolution);
  ~TouchedShafts();

  // Writes `record` into the shafts that the triangle touches and that are LSP_NONE yet. `shafts` has
  // 15 resolution^4 elements, numbered as in symmetric Line Spaces.
  void add(const LspTriangle& triangle, uint32_t record, std::span<uint32_t> shafts);

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace lsp
