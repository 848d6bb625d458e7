// Triangles' own colours as materials, which is where a file has room for them.
#pragma once

#include "mesh.h"

namespace lsp {

// Gives every triangle a material of (nearly) its own colour: those of one material whose colours are the
// same in 8 bits of the sRGB curve (coarser where these would be more than 65,536) share one that has their
// mean. Does nothing to a mesh without colours.
void make_color_materials(Mesh& mesh);

}  // namespace lsp
