// What the samples of a picture add up to, pixel by pixel, and what the denoiser has to know of them.
#pragma once

#include <array>
#include <cstdint>
#include <glm/glm.hpp>
#include <vector>

#include "denoise.h"
#include "picture.h"
#include "renderer.h"

namespace lsp::sample {

// What a picture is the sum of, kept apart for the denoiser.
enum Component : uint32_t {
  kSharp,     // little noise or fine detail: background, emission, sun
  kSmooth,    // light on diffuse surfaces from everywhere else
  kMirrored,  // glossy reflections
  kComponents,
};

// Pixels are numbered by rows from the top. Several threads may add to different ones at once.
class Film {
 public:
  Film(int width, int height);

  // What a sample of the pixel brings.
  void add(uint32_t pixel, Component component, glm::vec3 radiance);
  // That a sample met a surface there, and of that surface what guides the denoiser.
  void add_surface(uint32_t pixel) { met_[pixel] += 1.0f; }
  void add_guides(uint32_t pixel, const SurfacePoint& point, glm::vec3 albedo, float distance);

  // Of all samples: first the means, then, if asked for, without noise, then the picture.
  void average(uint32_t samples);
  void denoise(float pixel_angle_rad);
  Picture picture() const;
  // How bright the picture is, and its surfaces.
  void measure(const Picture& picture, RenderReport& report) const;

 private:
  float samples_ = 0;
  std::array<Picture, kComponents> sum_;
  std::array<std::vector<float>, kComponents> squares_;  // of luminance
  Picture albedo_;
  Guides guides_;
  std::vector<float> met_;  // samples that met a surface
};

}  // namespace lsp::sample
