#include "picture_errors.h"

#include <algorithm>

#include "ray_errors.h"
#include "same_size.h"

namespace lsp::bench {
namespace {

constexpr uint32_t kBlurRadius = 2;

double mean_of(const Image& image) {
  glm::dvec3 sum(0);
  for (const glm::vec3& pixel : image.pixels) sum += glm::dvec3(pixel);
  return (sum.x + sum.y + sum.z) / (3 * static_cast<double>(image.pixels.size()));
}

Spread spread_of_magnitudes(const Image& difference) {
  std::vector<float> values;
  values.reserve(difference.pixels.size());
  for (const glm::vec3& pixel : difference.pixels) {
    const glm::vec3 off = glm::abs(pixel);
    values.push_back((off.r + off.g + off.b) / 3);
  }
  return spread_of(values);
}

// One pass of the separable mean, along rows or along columns.
Image blurred_along(const Image& in, bool rows) {
  Image out(in.width, in.height);
  const uint32_t length = rows ? in.width : in.height;
  for (uint32_t y = 0; y < in.height; ++y) {
    for (uint32_t x = 0; x < in.width; ++x) {
      const uint32_t at = rows ? x : y;
      const uint32_t first = at - std::min(at, kBlurRadius), last = std::min(at + kBlurRadius, length - 1);
      glm::vec3 sum(0);
      for (uint32_t k = first; k <= last; ++k) sum += rows ? in.at(k, y) : in.at(x, k);
      out.at(x, y) = sum / static_cast<float>(last - first + 1);
    }
  }
  return out;
}

}  // namespace

Image blurred(const Image& image) { return blurred_along(blurred_along(image, true), false); }

PictureErrors picture_errors(const Image& reference, const Image& image) {
  require_same_size(reference, image);
  // A blur is linear: that of the difference is the difference of the blurred pictures.
  Image difference = image;
  for (size_t i = 0; i < difference.pixels.size(); ++i) difference.pixels[i] -= reference.pixels[i];
  const double scale = 1 / std::max(mean_of(reference), kLeastMean);
  const Spread sharp = spread_of_magnitudes(difference), soft = spread_of_magnitudes(blurred(difference));
  return {scale * sharp.mean, scale * sharp.p99, scale * soft.mean, scale * soft.p99,
          scale * mean_of(difference)};
}

}  // namespace lsp::bench
