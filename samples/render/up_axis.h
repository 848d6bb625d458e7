// Which way is up in a scene: files do not say, and two conventions are in use.
#pragma once

#include <glm/glm.hpp>
#include <string>

#include "render_scene.h"

namespace lsp::sample {

// The axis that --up names: y or z.
glm::vec3 named_up(const std::string& axis);

// Right, up and towards the viewer, of a scene whose `up` is y or z.
glm::mat3 axes(glm::vec3 up);

struct UpAxis {
  glm::vec3 direction;  // y or z, unit
  const char* reason;   // for z, what speaks for it; null for y
};

// y, as glTF has it by its standard. Of other meshes z where one lies flat in x and y and more of it faces up
// or down along z than along y, as terrain and plans do; where it comes from .stl files alone, as programs
// for construction and printing write them, unless it stands on something flat along y; and where it is
// tallest along z and stands on something flat there alone, as a bust does.
UpAxis likely_up(const RenderScene& scene);

}  // namespace lsp::sample
