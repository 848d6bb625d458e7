// Outlines that touch themselves but for what is rounded.
#pragma once

#include <glm/glm.hpp>
#include <vector>

namespace lsp {

// Moves corners that lie on an edge of the outline, but beyond it by what single precision rounds (2e-7 of
// its size), to the side on which their neighbours lie: an outline that crosses itself by that alone no
// longer does. Returns whether any was moved. Looks at every corner and edge.
bool part_touching(std::vector<glm::dvec2>& outline);

}  // namespace lsp
