// Textures in linear light, with means of their texels at every scale.
#pragma once

#include <cmath>
#include <cstdint>
#include <glm/glm.hpp>
#include <vector>

#include "import/picture.h"

namespace lsp {

// How a texel's alpha becomes the share of it that is solid.
enum class AlphaMode : uint8_t { kOpaque, kMask, kBlend };
struct AlphaRule {
  AlphaMode mode = AlphaMode::kOpaque;
  float factor = 1;
  float cutoff = 0.5f;
  float glass = 0;  // the share of what is there that light passes, whatever alpha says

  float coverage(float alpha) const {
    const float product = std::min(std::max(alpha * factor, 0.0f), 1.0f);
    const float there = mode == AlphaMode::kOpaque  ? 1.0f
                        : mode == AlphaMode::kBlend ? product
                        : product >= cutoff         ? 1.0f
                                                    : 0.0f;
    return there * (1 - glass);
  }
  // The least alpha of a vertex with which a mask's texel is there; infinite where none is enough.
  float least(float texel_alpha) const {
    if (cutoff <= 0) return 0;
    const float most = texel_alpha * factor;
    return most > 0 && cutoff <= 1 ? cutoff / most : INFINITY;
  }
  auto operator<=>(const AlphaRule&) const = default;
};

enum class Wrap : uint8_t { kRepeat, kClamp, kMirror };

// A value of the sRGB curve, 0 to 1, in linear light.
double linear_of_srgb(double value);

// A picture's texels as (colour * coverage, coverage), and levels that each halve the one before by the mean
// over areas, so that every level has the same mean.
class Texture {
 public:
  Texture(Picture picture, const AlphaRule& rule);

  struct Size {
    uint32_t width, height;
  };
  size_t levels() const { return sizes_.size(); }
  Size size(size_t level) const { return sizes_[level]; }
  const AlphaRule& rule() const { return rule_; }
  uint64_t bytes() const;

  // Makes the levels up to this one; texels of a level may be asked for only after it was made.
  void make_levels(size_t level);

  // Any integer position, brought inside by the wrap modes.
  glm::vec4 texel(size_t level, int64_t x, int64_t y, Wrap wrap_x, Wrap wrap_y) const;
  // The same with a vertex's alpha multiplied into the finest level's before the rule.
  glm::vec4 texel_times(float alpha, int64_t x, int64_t y, Wrap wrap_x, Wrap wrap_y) const;
  // AlphaRule::least of a texel of the finest level.
  float least_alpha(int64_t x, int64_t y, Wrap wrap_x, Wrap wrap_y) const;
  // Between the four nearest texels of the finest level; the position is in texels.
  glm::vec4 bilinear(const glm::dvec2& at, Wrap wrap_x, Wrap wrap_y) const;

 private:
  glm::vec4 finest(uint32_t x, uint32_t y, float alpha) const;

  Picture picture_;
  AlphaRule rule_;
  std::vector<Size> sizes_;
  std::vector<std::vector<glm::vec4>> coarse_;  // levels from 1 on
};

}  // namespace lsp
