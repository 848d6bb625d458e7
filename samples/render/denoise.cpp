#include "denoise.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>

namespace lsp::sample {
namespace {

float luminance(glm::vec3 color) { return glm::dot(color, glm::vec3(0.2126f, 0.7152f, 0.0722f)); }

// Variance over a window of 3 x 3: a single pixel's few samples say too little.
float smoothed_variance(const std::vector<float>& variance, int width, int height, int x, int y) {
  float sum = 0;
  float weight = 0;
  for (int dy = -1; dy <= 1; ++dy) {
    for (int dx = -1; dx <= 1; ++dx) {
      const int nx = x + dx;
      const int ny = y + dy;
      if (nx < 0 || ny < 0 || nx >= width || ny >= height) continue;
      const float w = (dx == 0 ? 2.0f : 1.0f) * (dy == 0 ? 2.0f : 1.0f);
      sum += w * variance[static_cast<size_t>(ny) * static_cast<size_t>(width) + static_cast<size_t>(nx)];
      weight += w;
    }
  }
  return sum / weight;
}

}  // namespace

Picture denoise(const Picture& light, const std::vector<float>& variance, const Guides& guides, int passes) {
  const int width = light.width;
  const int height = light.height;
  constexpr float kKernel[3] = {3.0f / 8.0f, 1.0f / 4.0f, 1.0f / 16.0f};
  Picture current = light;
  std::vector<float> noise = variance;
  for (int pass = 0; pass < passes; ++pass) {
    const int step = 1 << pass;
    Picture next(width, height);
    std::vector<float> next_noise(noise.size());
    tbb::parallel_for(0, height, [&](int y) {
      for (int x = 0; x < width; ++x) {
        const size_t here = static_cast<size_t>(y) * static_cast<size_t>(width) + static_cast<size_t>(x);
        const float depth = guides.depth[here];
        if (depth <= 0) {
          next.pixels[here] = current.pixels[here];
          next_noise[here] = noise[here];
          continue;
        }
        const glm::vec3 normal = guides.normal.pixels[here];
        const glm::vec3 position = guides.position.pixels[here];
        const float bright = luminance(current.pixels[here]);
        const float spread = 3.0f * std::sqrt(smoothed_variance(noise, width, height, x, y)) + 1e-4f;
        const float off_plane = depth * guides.pixel_angle_rad * static_cast<float>(step) + 1e-6f;
        glm::vec3 sum(0.0f);
        float noise_sum = 0;
        float weight_sum = 0;
        for (int dy = -2; dy <= 2; ++dy) {
          for (int dx = -2; dx <= 2; ++dx) {
            const int nx = x + dx * step;
            const int ny = y + dy * step;
            if (nx < 0 || ny < 0 || nx >= width || ny >= height) continue;
            const size_t there =
                static_cast<size_t>(ny) * static_cast<size_t>(width) + static_cast<size_t>(nx);
            if (guides.depth[there] <= 0) continue;
            float w = kKernel[std::abs(dx)] * kKernel[std::abs(dy)];
            if (there != here) {
              const float facing = std::max(glm::dot(normal, guides.normal.pixels[there]), 0.0f);
              const float plane = std::abs(glm::dot(normal, guides.position.pixels[there] - position));
              const float change = std::abs(luminance(current.pixels[there]) - bright);
              w *= std::pow(facing, 48.0f) * std::exp(-plane / off_plane - change / spread);
            }
            sum += w * current.pixels[there];
            noise_sum += w * w * noise[there];
            weight_sum += w;
          }
        }
        next.pixels[here] = sum / weight_sum;
        next_noise[here] = noise_sum / (weight_sum * weight_sum);
      }
    });
    current = std::move(next);
    noise = std::move(next_noise);
  }
  return current;
}

}  // namespace lsp::sample
