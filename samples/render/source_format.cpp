#include "source_format.h"

#include <nlohmann/json.hpp>

#include "lsp/file_ending.h"

namespace lsp::sample {
namespace {

constexpr uint64_t kMaxMetaBytes = uint64_t{1} << 20;  // as the format allows

// META's JSON; null where the file has none.
nlohmann::json metadata(const lsp_scene& scene) {
  for (uint32_t i = 0; i < scene.header->section_count; ++i) {
    const LspSection& section = scene.sections[i];
    if (section.type != LSP_SECTION_META || section.stored_bytes > kMaxMetaBytes) continue;
    const auto* text = static_cast<const char*>(scene.bytes) + section.offset;
    return nlohmann::json::parse(text, text + section.stored_bytes, nullptr, false);
  }
  return {};
}

}  // namespace

std::set<std::string> source_endings(const lsp_scene& scene) {
  std::set<std::string> endings;
  const nlohmann::json meta = metadata(scene);
  const auto sources = meta.find("sources");
  if (!meta.is_object() || sources == meta.end() || !sources->is_array()) return endings;
  for (const nlohmann::json& files : *sources) {
    if (!files.is_array() || files.empty() || !files[0].is_string()) continue;
    endings.insert(file_ending(files[0].get<std::string>()));
  }
  return endings;
}

}  // namespace lsp::sample
