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

float chosen_exposure(double surface_luminance, double bright_luminance) {
  if (!(surface_luminance > 0)) return 0.0f;
  constexpr double kDark = 0.15;
  constexpr double kBright = 0.7;
  constexpr double kHighlight = 1.0;  // still below white once it is tone-mapped
  constexpr double kMost = 16.0;      // lamps in watts leave a room that dark
  const double wanted = std::clamp(surface_luminance, kDark, kBright);
  double stops = std::log2(wanted / surface_luminance);
  if (stops > 0) stops = std::clamp(std::log2(kHighlight / std::max(bright_luminance, 1e-9)), 0.0, stops);
  return static_cast<float>(std::clamp(stops, -kMost, kMost));
}

}  // namespace lsp::sample
