#include "denoise.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>

namespace lsp::sample {
namespace {

float luminance(glm::vec3 color) { return glm::dot(color, glm::vec3(0.2126f, 0.7152f, 0.0722f)); }

size_t index(int width, int x, int y) {
  return static_cast<size_t>(y) * static_cast<size_t>(width) + static_cast<size_t>(x);
}

// Variance over a window of 5 x 5: a single pixel's few samples say too little.
float smoothed_variance(const std::vector<float>& variance, int width, int height, int x, int y) {
  constexpr float kWindow[3] = {1.0f, 0.6f, 0.2f};
  float sum = 0;
  float weight = 0;
  for (int dy = -2; dy <= 2; ++dy) {
    for (int dx = -2; dx <= 2; ++dx) {
      const int nx = x + dx;
      const int ny = y + dy;
      if (nx < 0 || ny < 0 || nx >= width || ny >= height) continue;
      const float w = kWindow[std::abs(dx)] * kWindow[std::abs(dy)];
      sum += w * variance[index(width, nx, ny)];
      weight += w;
    }
  }
  return sum / weight;
}

// A pixel brighter than all its neighbours is a lone lucky sample: it is lowered to the brightest of them, or
// it would be smeared over the whole window.
Picture without_sparks(const Picture& light) {
  Picture out = light;
  tbb::parallel_for(0, light.height, [&](int y) {
    for (int x = 0; x < light.width; ++x) {
      float brightest = 0;
      for (int ny = std::max(y - 1, 0); ny <= std::min(y + 1, light.height - 1); ++ny) {
        for (int nx = std::max(x - 1, 0); nx <= std::min(x + 1, light.width - 1); ++nx) {
          if (nx == x && ny == y) continue;
          brightest = std::max(brightest, luminance(light.pixels[index(light.width, nx, ny)]));
        }
      }
      const float own = luminance(light.pixels[index(light.width, x, y)]);
      if (own > brightest) out.pixels[index(light.width, x, y)] *= brightest / own;
    }
  });
  return out;
}

}  // namespace

Picture denoise(const Picture& light, const std::vector<float>& variance, const Guides& guides, int passes) {
  const int width = light.width;
  const int height = light.height;
  constexpr float kKernel[3] = {3.0f / 8.0f, 1.0f / 4.0f, 1.0f / 16.0f};
  Picture current = without_sparks(light);
  std::vector<float> noise = variance;
  for (int pass = 0; pass < passes; ++pass) {
    const int step = 1 << pass;
    Picture next(width, height);
    std::vector<float> next_noise(noise.size());
    tbb::parallel_for(0, height, [&](int y) {
      for (int x = 0; x < width; ++x) {
        const size_t here = index(width, x, y);
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
            const size_t there = index(width, nx, ny);
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
