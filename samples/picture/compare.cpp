#include "compare.h"

#include <cmath>
#include <limits>

#include "lsp/program.h"

namespace lsp::sample {
namespace {

float encoded(float linear) {
  return linear <= 0.0031308f ? 12.92f * linear : 1.055f * std::pow(linear, 1.0f / 2.4f) - 0.055f;
}

void require_same_size(const Picture& a, const Picture& b) {
  if (a.width != b.width || a.height != b.height) {
    throw Failure(Exit::kInvalid, "",
                  "the pictures differ in size (" + std::to_string(a.width) + " x " +
                      std::to_string(a.height) + " and " + std::to_string(b.width) + " x " +
                      std::to_string(b.height) + "); render both with the same --size");
  }
}

}  // namespace

Comparison compare(const Picture& reference, const Picture& test) {
  require_same_size(reference, test);
  Comparison result;
  double encoded_square = 0;
  for (size_t i = 0; i < reference.pixels.size(); ++i) {
    const glm::vec3 a = reference.pixels[i];
    const glm::vec3 b = test.pixels[i];
    const glm::vec3 shown_a = tone_map(a);
    const glm::vec3 shown_b = tone_map(b);
    bool far = false;
    for (int c = 0; c < 3; ++c) {
      const double d = static_cast<double>(a[c]) - static_cast<double>(b[c]);
      result.mean_absolute += std::abs(d);
      result.rmse += d * d;
      result.mean_reference += static_cast<double>(a[c]);
      result.mean_test += static_cast<double>(b[c]);
      const double e = static_cast<double>(encoded(shown_a[c])) - static_cast<double>(encoded(shown_b[c]));
      encoded_square += e * e;
      far = far || std::abs(e) > 0.05;
    }
    if (far) ++result.pixels_over_5_percent;
  }
  const double count = 3.0 * static_cast<double>(reference.pixels.size());
  result.mean_absolute /= count;
  result.rmse = std::sqrt(result.rmse / count);
  result.mean_reference /= count;
  result.mean_test /= count;
  if (result.mean_absolute > 0)
    result.relative_mean = result.mean_reference > 0 ? result.mean_absolute / result.mean_reference
                                                     : std::numeric_limits<double>::infinity();
  result.psnr_db = encoded_square > 0 ? -10.0 * std::log10(encoded_square / count)
                                      : std::numeric_limits<double>::infinity();
  return result;
}

Picture difference(const Picture& reference, const Picture& test, float factor) {
  require_same_size(reference, test);
  Picture out(reference.width, reference.height);
  for (size_t i = 0; i < out.pixels.size(); ++i) {
    out.pixels[i] = glm::abs(reference.pixels[i] - test.pixels[i]) * factor;
  }
  return out;
}

}  // namespace lsp::sample
