// Rays from the surface in a part of a cell as a renderer sends them, for origin tables.
#pragma once

#include <array>
#include <cstdint>
#include <glm/glm.hpp>
#include <vector>

#include "answer_fit.h"
#include "cell_samples.h"

namespace lsp {

// The surface in a sub-cell as triangles, with their areas summed up.
struct Surface {
  std::vector<std::array<glm::vec3, 3>> pieces;
  std::vector<glm::vec3> normals;
  std::vector<float> area;
};

// Where a sub-cell lies. World space.
struct SubCell {
  glm::vec3 cell_lo;
  float cell_size;
  glm::vec3 lo;
  float edge;
  uint32_t patches;  // along an edge of the cell, of origin tables
  float offset;      // of the rays' origins from the surface
};

// Rays side by side, for loops over all of them.
struct NearRays {
  static constexpr size_t kMost = 64;
  using Floats = std::array<float, kMost>;
  using Numbers = std::array<uint32_t, kMost>;
  static constexpr uint32_t kNone = UINT32_MAX;

  std::array<Floats, kPlaces> place;  // in the shaft, -1 to 1: origin in the sub-cell, end in the patch
  std::array<Floats, 3> origin, way;  // world space; way: to where the ray leaves the cell
  Numbers entry;                      // of the table: 6 sides of patches^2; kNone: it does not leave the cell

  // Rays number `first` to `first + kMost - 1` of a sequence: cosine-distributed, from the front of the
  // surface where their number is even and else from its back. The surface is not empty.
  void make(const Surface& surface, const Sequence<5>& sequence, uint32_t first, const SubCell& cell);
};

}  // namespace lsp
