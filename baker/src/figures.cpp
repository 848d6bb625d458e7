#include "figures.h"

#include <cinttypes>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <nlohmann/json.hpp>

#include "qualities.h"

namespace lsp {

using Json = nlohmann::ordered_json;

std::string hex128(uint64_t lo, uint64_t hi) {
  char text[33];
  std::snprintf(text, sizeof text, "%016" PRIx64 "%016" PRIx64, hi, lo);
  return text;
}

std::string size_text(uint64_t bytes) {
  char text[32];
  if (bytes < 1000000)
    std::snprintf(text, sizeof text, "%.2f kB", double(bytes) / 1e3);
  else
    std::snprintf(text, sizeof text, "%.2f MB", double(bytes) / 1e6);
  return text;
}

// getrusage would count what the process that started this one held.
uint64_t peak_memory_bytes() {
  std::ifstream status("/proc/self/status");
  for (std::string line; std::getline(status, line);)
    if (line.starts_with("VmHWM:")) return std::stoull(line.substr(6)) * 1024;
  return 0;
}

Json to_json(const MeasuredError& e) {
  if (e.rays == 0) return nullptr;
  return {{"rays", e.rays},
          {"wrong_hits", e.wrong_hits},
          {"wrong_misses", e.wrong_misses},
          {"wrong_percent", 100 * e.wrong_share()},
          {"depth_error_percent_of_diagonal", 100 * e.depth_error}};
}

Json to_json(const Qualities& qualities) {
  if (!(qualities[LSP_QUALITY_FAST].cpu > 0)) return nullptr;
  constexpr std::pair<const char*, uint32_t> kNamed[] = {
      {"fast", LSP_QUALITY_FAST}, {"balanced", LSP_QUALITY_BALANCED}, {"accurate", LSP_QUALITY_ACCURATE}};
  Json list;
  for (const auto& [name, quality] : kNamed) {
    const QualityFigures& q = qualities[quality];
    list[name] = {{"wrong_percent", 100 * q.wrong},
                  {"depth_error_percent_of_diagonal", 100 * q.depth},
                  {"ambient_occlusion_error_percent", 100 * q.occlusion},
                  {"light_error_percent", 100 * q.light},
                  {"estimated_times_exact_rays", {{"vulkan", q.vulkan}, {"cpu", q.cpu}}}};
  }
  return list;
}

Json to_json(const std::vector<WrittenSection>& sections) {
  Json list = Json::array();
  for (const WrittenSection& s : sections)
    list.push_back({{"name", s.name}, {"bytes", s.bytes}, {"stored_bytes", s.stored_bytes}});
  return list;
}

void print_error(const MeasuredError& error) {
  if (error.rays == 0) return;
  const double wrong = error.wrong_share();
  std::printf(
      "error       %.2f %% wrong hits, %.2f %% wrong misses (both +-%.2f %%, 95 %% of the time), depth off "
      "by %.2f %% of the diagonal\n",
      100.0 * double(error.wrong_hits) / double(error.rays),
      100.0 * double(error.wrong_misses) / double(error.rays),
      196 * std::sqrt(wrong * (1 - wrong) / double(error.rays)), 100 * error.depth_error);
}

void print_qualities(const Qualities& qualities) {
  std::fputs(format::qualities_text(to_json(qualities)).c_str(), stdout);
}

void print_sections(const std::vector<WrittenSection>& sections) {
  for (const WrittenSection& s : sections) {
    std::printf("section     %s %12s", s.name.c_str(), size_text(s.bytes).c_str());
    if (s.stored_bytes != s.bytes) std::printf(", packed %s", size_text(s.stored_bytes).c_str());
    std::printf("\n");
  }
}

}  // namespace lsp
