// Where approximate rays lose and where their work goes: a number a pixel.
#pragma once

#include <functional>

#include "camera.h"
#include "picture.h"

namespace lsp::sample {

enum class Heat {
  kLoss,  // share of the rays that are wrong: hit for miss, or by how much of the longer way the depth is off
  kSteps,  // nodes or cells, look-ups and triangles of a ray
  kExact,  // of cells: exact traces of a ray; of Line Spaces: triangles that it tests
};

struct HeatMap {
  Picture values;   // the same number in every channel; 0 where there is no surface
  double mean = 0;  // of what a surface fills
  float top = 0;    // a hundredth of the pixels are hotter
};

struct HeatOptions {
  Heat heat = Heat::kLoss;
  lsp_trace_options trace{};  // of the rays that are looked at
  int width = 1280;
  int height = 720;
  uint32_t samples = 16;
  int threads = 0;  // 0: all
};

// For every sample of a pixel one cosine-distributed ray from the surface that the eye sees, on the CPU:
// Vulkan gives the same answers and counts. `progress` is called with a number in [0, 1], from one thread at
// a time, and may be empty.
HeatMap heat_map(const RenderScene& scene, const Camera& camera, const HeatOptions& options,
                 const std::function<void(double)>& progress);

// From black over red and yellow to white at `top`, as display light.
Picture in_colors(const HeatMap& map);

}  // namespace lsp::sample
