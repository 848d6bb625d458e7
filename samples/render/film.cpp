#include "film.h"

#include <algorithm>
#include <cmath>

namespace lsp::sample {
namespace {

float luminance(glm::vec3 color) { return glm::dot(color, glm::vec3(0.2126f, 0.7152f, 0.0722f)); }

}  // namespace

Film::Film(int width, int height) {
  const Picture black(width, height);
  sum_.fill(black);
  albedo_ = guides_.normal = guides_.position = black;
  for (auto& squares : squares_) squares.resize(black.pixels.size());
  guides_.depth.resize(black.pixels.size());
  met_.resize(black.pixels.size());
}

void Film::add(uint32_t pixel, Component component, glm::vec3 radiance) {
  sum_[component].pixels[pixel] += radiance;
  const float bright = luminance(radiance);
  squares_[component][pixel] += bright * bright;
}

void Film::add_guides(uint32_t pixel, const SurfacePoint& point, glm::vec3 albedo, float distance) {
  albedo_.pixels[pixel] += albedo;
  guides_.normal.pixels[pixel] += point.shading_normal;
  guides_.position.pixels[pixel] += point.position;
  guides_.depth[pixel] += distance;
}

void Film::average(uint32_t samples) {
  samples_ = static_cast<float>(samples);
  for (auto& component : sum_) {
    for (glm::vec3& p : component.pixels) p /= samples_;
  }
}

void Film::denoise(float pixel_angle_rad) {
  for (size_t i = 0; i < albedo_.pixels.size(); ++i) {
    albedo_.pixels[i] = glm::max(albedo_.pixels[i] / samples_, glm::vec3(1e-3f));
    const float hits = met_[i];
    if (hits <= 0) continue;
    guides_.position.pixels[i] /= hits;
    guides_.depth[i] /= hits;
    const float length = glm::length(guides_.normal.pixels[i]);
    if (length > 0) guides_.normal.pixels[i] /= length;
  }
  guides_.pixel_angle_rad = pixel_angle_rad;
  for (const Component c : {kSmooth, kMirrored}) {
    std::vector<float> variance(met_.size());
    for (size_t i = 0; i < variance.size(); ++i) {
      const float mean = luminance(sum_[c].pixels[i]);
      // The surface's colour is taken out of the light that it has coloured, and put back below.
      const float colored = c == kSmooth ? luminance(albedo_.pixels[i]) : 1.0f;
      variance[i] = std::max(squares_[c][i] / samples_ - mean * mean, 0.0f) / (samples_ * colored * colored);
      if (c == kSmooth) sum_[c].pixels[i] /= albedo_.pixels[i];
    }
    sum_[c] = sample::denoise(sum_[c], variance, guides_, c == kSmooth ? 5 : 3);
    if (c != kSmooth) continue;
    for (size_t i = 0; i < albedo_.pixels.size(); ++i) sum_[c].pixels[i] *= albedo_.pixels[i];
  }
}

Picture Film::picture() const {
  Picture picture = sum_[kSharp];
  for (size_t i = 0; i < picture.pixels.size(); ++i)
    picture.pixels[i] = sum_[kSharp].pixels[i] + sum_[kSmooth].pixels[i] + sum_[kMirrored].pixels[i];
  return picture;
}

void Film::measure(const Picture& picture, RenderReport& report) const {
  double total = 0;
  double surface_log = 0;
  std::vector<float> surfaces;
  for (size_t i = 0; i < picture.pixels.size(); ++i) {
    const float bright = luminance(picture.pixels[i]);
    total += static_cast<double>(bright);
    if (met_[i] == 0) continue;
    surface_log += std::log(std::max(static_cast<double>(bright), 1e-7));
    surfaces.push_back(bright);
  }
  report.mean_luminance = total / static_cast<double>(picture.pixels.size());
  if (surfaces.empty()) return;
  report.surface_luminance = std::exp(surface_log / static_cast<double>(surfaces.size()));
  const auto bright = surfaces.begin() + static_cast<std::ptrdiff_t>(surfaces.size() * 9 / 10);
  std::ranges::nth_element(surfaces, bright);
  report.bright_luminance = static_cast<double>(*bright);
}

}  // namespace lsp::sample
