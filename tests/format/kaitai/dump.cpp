// Prints every value of an .lsp file as JSON, for comparison with a second, independent reader. Floats are
// printed as their bits, 64-bit numbers as strings, hashes as their 16 bytes in hexadecimal.
#include <algorithm>
#include <cstdio>
#include <cstring>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string_view>

#include "fields.h"
#include "file.h"
#include "layers.h"
#include "view.h"

namespace {

using namespace lsp::format;
using Json = nlohmann::ordered_json;

std::string hex(const std::byte* bytes, size_t count) {
  std::string text;
  for (size_t i = 0; i < count; ++i) {
    char digits[4];
    std::snprintf(digits, sizeof digits, "%02x", static_cast<unsigned>(bytes[i]));
    text += digits;
  }
  return text;
}

Json word(const std::byte* bytes) {
  uint32_t value;
  std::memcpy(&value, bytes, sizeof value);
  return value;
}

Json value_of(const Field& field, const std::byte* bytes) {
  const std::byte* at = bytes + field.offset;
  if (field.type == FieldType::kUint64) {
    uint64_t value;
    std::memcpy(&value, at, sizeof value);
    return std::to_string(value);
  }
  if (field.bytes == 4) return word(at);
  Json list = Json::array();
  for (uint32_t i = 0; i < field.bytes; i += 4) list.push_back(word(at + i));
  return list;
}

Json struct_of(const Struct& owner, const std::byte* bytes) {
  Json json = Json::object();
  for (size_t i = 0; i < owner.fields.size(); ++i) {
    const Field& field = owner.fields[i];
    std::string name = field.name;
    std::replace(name.begin(), name.end(), '.', '_');  // of a struct within
    if (name == "magic_0") {
      json["magic"] = hex(bytes + field.offset, 8);
      ++i;
    } else if (name.ends_with("hash_lo")) {
      json[name.substr(0, name.size() - 3)] = hex(bytes + field.offset, 16);
      ++i;
    } else {
      json[name] = value_of(field, bytes);
    }
  }
  return json;
}

Json section_of(const LspSection& entry, const FileView& view) {
  Json json = struct_of(struct_named("LspSection"), reinterpret_cast<const std::byte*>(&entry));
  const int kind = kind_of(entry.type);
  if (entry.codec != LSP_CODEC_NONE || kind == kKinds)
    json["stored"] = hex(view.bytes.data() + entry.offset, entry.stored_bytes);
  if (kind == kKinds) return json;
  const std::span<const std::byte> data = view.part(static_cast<Kind>(kind)).data;
  const Struct* owner = element_struct(static_cast<Kind>(kind));
  if (owner != nullptr) {
    json["elements"] = Json::array();
    for (size_t i = 0; i < data.size(); i += owner->bytes)
      json["elements"].push_back(struct_of(*owner, data.data() + i));
  } else if (is_words(static_cast<Kind>(kind))) {
    json["words"] = Json::array();
    for (size_t i = 0; i < data.size(); i += 4) json["words"].push_back(word(data.data() + i));
  } else {
    json["json"] = std::string(reinterpret_cast<const char*>(data.data()), data.size());
  }
  return json;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) return 1;
  try {
    const MappedFile file(argv[1]);
    FileView view = view_file(file.bytes());
    Report report;
    check_sections(view, report);
    check_hashes_and_codec(view, uint64_t{1} << 28, report);
    if (report.verdict() != Verdict::kValid) throw std::runtime_error("is damaged");
    Json json;
    json["header"] = struct_of(struct_named("LspHeader"), file.bytes().data());
    json["sections"] = Json::array();
    for (const LspSection& entry : view.table) json["sections"].push_back(section_of(entry, view));
    std::puts(json.dump().c_str());
    return 0;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "lsp_format_dump: %s: %s\n", argv[1], error.what());
    return 2;
  }
}
