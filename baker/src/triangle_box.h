// Whether a triangle reaches into a box.
#pragma once

#include <glm/glm.hpp>

#include "lsp/layout.h"

namespace lsp {

// The border is part of the box.
bool reaches_into(const LspTriangle& triangle, const glm::dvec3& lo, const glm::dvec3& hi);

}  // namespace lsp
