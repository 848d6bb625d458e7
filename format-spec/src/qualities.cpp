#include "qualities.h"

#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>

namespace lsp::format {
namespace {

using Json = nlohmann::ordered_json;

// "1.5", at most twelve characters.
std::string number(const Json& object, const char* name) {
  if (!object.is_object() || !object.contains(name) || !object[name].is_number()) return "?";
  const auto value = object[name].get<double>();
  char text[32];
  std::snprintf(text, sizeof text, std::fabs(value) < 1e9 ? "%.1f" : "%.3g", value);
  return text;
}

}  // namespace

std::string qualities_text(const Json& qualities) {
  std::string text;
  for (const char* name : {"fast", "balanced", "accurate"}) {
    if (!qualities.is_object() || !qualities.contains(name)) continue;
    const Json& q = qualities[name];
    const Json times = q.is_object() ? q.value("estimated_times_exact_rays", Json()) : Json();
    char line[256];
    std::snprintf(
        line, sizeof line,
        "%-11s %s %% wrong, depth off by %s %%, ambient occlusion by %s %%, light by %s %%; about "
        "%sx exact rays on Vulkan, %sx on the CPU\n",
        name, number(q, "wrong_percent").c_str(), number(q, "depth_error_percent_of_diagonal").c_str(),
        number(q, "ambient_occlusion_error_percent").c_str(), number(q, "light_error_percent").c_str(),
        number(times, "vulkan").c_str(), number(times, "cpu").c_str());
    text += line;
  }
  return text;
}

}  // namespace lsp::format
