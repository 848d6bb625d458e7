// The textures of OBJ materials.
#pragma once

#include <map>
#include <string>

#include "import/mesh_builder.h"
#include "import/mtl.h"
#include "import/surface_color.h"

namespace lsp {

class MtlTextures {
 public:
  // `file` names the mesh in errors and notes.
  MtlTextures(const std::string& file, MeshBuilder& builder) : file_(file), builder_(builder) {}

  // Adds the material to the builder and, where it has textures that can be read, what they make of it to
  // `surfaces`. Returns its number.
  uint32_t add(const MtlMaterial& source, std::map<uint32_t, Surface>& surfaces);

 private:
  Picture read(const MtlMaterial& source, const MtlMap& map);
  TextureUse use(const MtlMap& map, Picture picture, const AlphaRule& rule);

  const std::string& file_;
  MeshBuilder& builder_;
  std::map<std::string, TextureUse> known_;  // by all that decides one
};

}  // namespace lsp
