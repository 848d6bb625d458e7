// Reflections of rough surfaces.
#pragma once

#include <glm/glm.hpp>

#include "render_scene.h"

namespace lsp::sample {

struct GlossyDirection {
  glm::vec3 direction;  // unit
  glm::vec3 weight;     // what part of the light from there is reflected, over the chance to go there
};

// One direction of the GGX lobe by visible normals (Heitz, "Sampling the GGX Distribution of Visible
// Normals", 2018); its weight is F G2 / G1. `to_eye` is unit, `u` two random numbers in [0, 1).
GlossyDirection glossy_direction(const SurfacePoint& point, glm::vec3 to_eye, glm::vec2 u);

}  // namespace lsp::sample
