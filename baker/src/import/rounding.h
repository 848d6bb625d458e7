// From double to single precision, about an origin where that is needed.
#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <vector>

#include "mesh.h"

namespace lsp {

// The nearest position in single precision. Not a conversion in place: GCC 12 leaves out that of a vector
// from double to float and back where it sees both.
glm::vec3 rounded(const glm::dvec3& p);

// What hashes of positions are keyed with: whoever writes a mesh cannot know which of them collide.
uint64_t hash_key();

// Where a scene's origin should be, of all positions that it is told of: zero, unless rounding to float32
// would move one by more than 1e-6 of the scene's longest side; then the middle of the scene, rounded to a
// step that positions near it have in double precision too.
class OriginChooser {
 public:
  void add(const glm::dvec3& position);
  glm::dvec3 origin() const;

 private:
  bool any_ = false;
  glm::dvec3 low_{0}, high_{0};
  double moved_ = 0;
};

// Fills mesh.positions with `exact` less mesh.origin, welds what became equal, and takes out triangles that
// have no area any more (counted as collapsed). Returns how many of the others are bent: a corner is moved by
// more than a tenth of their longest edge.
uint64_t round_positions(const std::vector<glm::dvec3>& exact, Mesh& mesh);

// Two equal corners, or an area below 1e-14 of the longest edge squared.
bool is_degenerate(const glm::dvec3& a, const glm::dvec3& b, const glm::dvec3& c);

}  // namespace lsp
