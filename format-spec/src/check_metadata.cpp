// Provenance (META) and the source that a file was baked from.
#include <nlohmann/json.hpp>

#include <cstddef>

#include "layers.h"

namespace lsp::format {
namespace {

constexpr uint64_t kMaxMetaBytes = uint64_t{1} << 20;
constexpr int kMaxMetaLevels = 64;

// Depth of nested objects and arrays, strings skipped: the parser is not to meet more.
int nesting(std::string_view text) {
  int level = 0, deepest = 0;
  bool in_string = false;
  for (size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    if (in_string) {
      if (c == '\\')
        ++i;
      else if (c == '"')
        in_string = false;
    } else if (c == '"') {
      in_string = true;
    } else if (c == '{' || c == '[') {
      deepest = std::max(deepest, ++level);
    } else if (c == '}' || c == ']') {
      --level;
    }
  }
  return deepest;
}

// Whether `text` is well-formed UTF-8 (no overlong forms, no surrogates, nothing above U+10FFFF).
bool is_utf8(std::string_view text) {
  for (size_t i = 0; i < text.size();) {
    const auto byte = [&](size_t k) {
      return i + k < text.size() ? static_cast<unsigned char>(text[i + k]) : 0u;
    };
    const unsigned first = byte(0);
    size_t length = first < 0x80 ? 1 : first >> 5 == 6 ? 2 : first >> 4 == 14 ? 3 : first >> 3 == 30 ? 4 : 0;
    if (length == 0) return false;
    uint32_t code = length == 1 ? first : first & (0x7Fu >> length);
    for (size_t k = 1; k < length; ++k) {
      if (byte(k) >> 6 != 2) return false;
      code = code << 6 | (byte(k) & 0x3F);
    }
    static constexpr uint32_t kSmallest[5] = {0, 0, 0x80, 0x800, 0x10000};
    if (code < kSmallest[length] || code > 0x10FFFF || (code >= 0xD800 && code <= 0xDFFF)) return false;
    i += length;
  }
  return true;
}

}  // namespace

void check_metadata(const FileView& view, Report& report) {
  const Part& part = view.part(Kind::kMeta);
  if (!part.usable || part.data.empty()) return;
  const std::string_view text(reinterpret_cast<const char*>(part.data.data()), part.data.size());
  const auto find = [&](RuleId id, const char* message) {
    report.add(id, part.offset, part.stored_bytes, "/sections/META", message);
  };
  if (text.size() > kMaxMetaBytes) return find(RuleId::kMetaJson, "is larger than one mebibyte");
  if (!is_utf8(text)) return find(RuleId::kMetaEncoding, "is not UTF-8");
  if (nesting(text) > kMaxMetaLevels) return find(RuleId::kMetaJson, "is nested too deeply");
  const nlohmann::json json = nlohmann::json::parse(text, nullptr, false);
  if (!json.is_object()) find(RuleId::kMetaJson, "is not a JSON object");
}

void check_source(const FileView& view, Hash128 source, Report& report) {
  const Hash128 stored{view.header.source_hash_lo, view.header.source_hash_hi};
  if (stored == Hash128{})
    report.add(RuleId::kSourceUnknown, offsetof(LspHeader, source_hash_lo), 16, "/header/source_hash",
               "the file does not say what it was baked from: bake it again");
  else if (stored != source)
    report.add(RuleId::kSourceStale, offsetof(LspHeader, source_hash_lo), 16, "/header/source_hash",
               "the source files have changed (" + to_hex(source) + ", baked from " + to_hex(stored) +
                   "): bake it again");
}

}  // namespace lsp::format
