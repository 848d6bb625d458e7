// Takes the noise of few samples out of a picture without washing out its edges: an edge-avoiding a-trous
// filter (Dammertz et al. 2010) steered by what the eye's rays met and by the noise measured in each pixel
// (Schied et al. 2017, the spatial half).
#pragma once

#include <vector>

#include "picture.h"

namespace lsp::sample {

// What the primary rays met, averaged over a pixel's samples. All of the picture's size.
struct Guides {
  Picture normal;            // zero where the sky is
  Picture position;          // world space
  std::vector<float> depth;  // from the eye, 0 where the sky is
  float pixel_angle_rad = 0.001f;
};

// Filters `light` (without the surfaces' colour) in `passes` passes over windows of 5, 9, 17, ... pixels.
// `variance` is that of each pixel's mean luminance. Runs on the threads of the current oneTBB arena; the
// result does not depend on their number.
Picture denoise(const Picture& light, const std::vector<float>& variance, const Guides& guides, int passes);

}  // namespace lsp::sample
