// The binary form of OFF files.
#pragma once

#include <string>
#include <string_view>

#include "import/mesh_builder.h"

namespace lsp {

// What the keyword of an OFF file says: [ST][C][N][4]OFF.
struct OffKeyword {
  bool has_texcoords = false;
  bool has_colors = false;
  bool has_normals = false;
  bool homogeneous = false;
};

// Reads what follows the line of the keyword and "BINARY". Geomview writes words of 32 bits, highest byte
// first: numbers of vertices, faces and edges; each vertex's coordinates, normal, colour (four) and texture
// coordinates; of each face the number of its corners, these, the number of its colour's values and these.
// OpenMesh writes the lowest byte first and no number of colour values; which of both it is, the file's
// length says. Hostile input is fine. Throws Failure kInvalid.
void read_binary_off(const std::string& file, const OffKeyword& keyword, std::string_view body,
                     MeshBuilder& builder);

}  // namespace lsp
