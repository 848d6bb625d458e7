#include "exposure.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "lsp/program.h"

namespace lsp::sample {

std::optional<float> parse_exposure(const std::string& text, bool camera_given) {
  if (text == "auto" || (text.empty() && !camera_given)) return std::nullopt;
  if (text.empty()) return 0.0f;
  float stops = 0;
  int used = 0;
  if (std::sscanf(text.c_str(), "%f%n", &stops, &used) != 1 || static_cast<size_t>(used) != text.size() ||
      !(std::abs(stops) <= 20.0f)) {
    throw Failure(Exit::kUsage, "", "--exposure '" + text + "' is neither auto nor stops from -20 to 20");
  }
  return stops;
}

float chosen_exposure(double surface_luminance) {
  if (!(surface_luminance > 0)) return 0.0f;
  constexpr double kDark = 0.15;
  constexpr double kBright = 0.7;
  const double wanted = std::clamp(surface_luminance, kDark, kBright);
  return static_cast<float>(std::clamp(std::log2(wanted / surface_luminance), -8.0, 8.0));
}

}  // namespace lsp::sample
