#include "source.h"

#include <zstd.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <string>

#include "file.h"
#include "view.h"

namespace lsp::format {
namespace {

constexpr uint64_t kMaxMetaBytes = uint64_t{1} << 20;

// META's text; empty where the file has none that can be read.
std::string metadata(std::span<const std::byte> baked) {
  for (const LspSection& section : view_file(baked).table) {
    if (section.type != LSP_SECTION_META || section.bytes > kMaxMetaBytes ||
        !in_range(section.offset, section.stored_bytes, baked.size()))
      continue;
    const auto* stored = reinterpret_cast<const char*>(baked.data()) + section.offset;
    if (section.codec == LSP_CODEC_NONE) return {stored, section.stored_bytes};
    std::string text(section.bytes, '\0');
    const size_t size = ZSTD_decompress(text.data(), text.size(), stored, section.stored_bytes);
    return ZSTD_isError(size) ? std::string() : text;
  }
  return {};
}

// Per input the names of its sources, itself first; empty where META does not say.
std::vector<std::vector<std::string>> listed_sources(std::span<const std::byte> baked) {
  std::vector<std::vector<std::string>> lists;
  const nlohmann::json json = nlohmann::json::parse(metadata(baked), nullptr, false);
  if (!json.is_object() || !json.contains("sources") || !json["sources"].is_array()) return lists;
  for (const nlohmann::json& files : json["sources"]) {
    std::vector<std::string>& list = lists.emplace_back();
    if (!files.is_array()) continue;
    for (const nlohmann::json& file : files) {
      if (file.is_string()) list.push_back(file.get<std::string>());
    }
  }
  return lists;
}

// Whether META can have written the name of a file so: as '?' each byte that is not UTF-8, or not printable.
bool stands_for(const std::string& listed, const std::string& name) {
  return std::equal(listed.begin(), listed.end(), name.begin(), name.end(), [](char l, char n) {
    return l == n || (l == '?' && (uint8_t(n) < 0x20 || uint8_t(n) >= 0x7F));
  });
}

// The file of a name in META, beside an input; empty where there is none.
std::filesystem::path find_listed(std::filesystem::path folder, const std::filesystem::path& listed) {
  for (const std::filesystem::path& part : listed) {
    std::error_code error;
    std::filesystem::path next = folder / part;
    if (!std::filesystem::exists(next, error) && part.native().find('?') != std::string::npos) {
      const std::filesystem::directory_iterator end;
      std::filesystem::directory_iterator at(folder.empty() ? "." : folder, error);
      for (; !error && at != end; at.increment(error)) {
        if (stands_for(part.native(), at->path().filename().native())) next = at->path();
      }
    }
    folder = std::move(next);
  }
  std::error_code error;
  return std::filesystem::is_regular_file(folder, error) ? folder : std::filesystem::path();
}

}  // namespace

Hash128 hash_sources(std::span<const std::filesystem::path> inputs, std::span<const std::byte> baked) {
  const std::vector<std::vector<std::string>> lists = listed_sources(baked);
  Hasher hasher;
  const auto add = [&](const std::filesystem::path& path) {
    const MappedFile file(path);
    hasher.add(file.bytes().data(), file.bytes().size());
  };
  for (size_t i = 0; i < inputs.size(); ++i) {
    add(inputs[i]);
    for (size_t k = 1; i < lists.size() && k < lists[i].size(); ++k) {
      const std::filesystem::path path = find_listed(inputs[i].parent_path(), lists[i][k]);
      if (!path.empty()) add(path);
    }
  }
  return hasher.digest();
}

}  // namespace lsp::format
