// The colour of a triangle: the mean of what textures, vertex colours and factors say over its area.
#pragma once

#include <functional>
#include <memory>

#include "import/texture.h"
#include "mesh.h"

namespace lsp {

// A texture as a material uses it.
struct TextureUse {
  std::shared_ptr<Texture> texture;  // null: none
  Wrap wrap_x = Wrap::kRepeat, wrap_y = Wrap::kRepeat;
  bool nearest = false;  // no blending between texels
  int set = 0;           // of texture coordinates
  glm::dmat2 linear{1};  // applied to coordinates, then the offset
  glm::dvec2 offset{0};

  glm::dvec2 place(const glm::dvec2& uv) const { return linear * uv + offset; }
};

// What a material says of colour. Texture coordinates have their origin at the picture's upper left.
struct Surface {
  glm::vec3 base_color{1};
  glm::vec3 emission{0};
  AlphaRule alpha;  // as in base.texture
  TextureUse base, glow;

  bool has_textures() const { return base.texture || glow.texture; }
};

struct SurfaceCorner {
  glm::dvec2 base_uv{0}, glow_uv{0};  // the material's placement applied
  glm::vec4 color{1};                 // of the vertex, linear
};

// The means over `count` triangles, whose corners `corners_of` gives (called from several threads). Exact but
// for pictures too fine for a triangle, of which a coarser level is taken: one triangle looks at 4,096 texels
// at most, all together at a million or 64 each. A triangle smaller than a texel takes the mean between
// texels. Colour and emission are those of the solid part where a triangle is partly there.
std::vector<TriangleColor> mean_colors(const Surface& surface, size_t count,
                                       const std::function<void(size_t, SurfaceCorner (&)[3])>& corners_of);

}  // namespace lsp
