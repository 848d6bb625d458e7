#include "part.h"

#include <xxhash.h>

#include <cstring>
#include <memory>

#include "lsp/output_file.h"
#include "lsp/program.h"
#include "lsp/sections.h"

namespace lsp {
namespace {

using format::Kind;
using format::kKinds;
using Json = nlohmann::ordered_json;

constexpr uint64_t kAlignment = 16;
constexpr int kDeepest = 8;  // objects and arrays within one another in the settings

static_assert(sizeof(PartHeader) % kAlignment == 0 && sizeof(LspHeader) % kAlignment == 0);

constexpr uint64_t padded(uint64_t bytes) { return (bytes + kAlignment - 1) / kAlignment * kAlignment; }

// What of a bake each shard has for itself; the rest all have in common.
constexpr bool is_table(Kind kind) {
  return format::info(kind).feature == LSP_FEATURE_CELLS && kind != Kind::kCgrd;
}

class Hash {
 public:
  Hash() : state_(XXH3_createState(), XXH3_freeState) { XXH3_128bits_reset(state_.get()); }
  void add(std::span<const std::byte> bytes) {
    XXH3_128bits_update(state_.get(), bytes.data(), bytes.size());
  }
  // Bytes and the zeros that pad them.
  void add_padded(std::span<const std::byte> bytes) {
    constexpr std::byte kZeros[kAlignment] = {};
    add(bytes);
    add({kZeros, padded(bytes.size()) - bytes.size()});
  }
  std::array<uint64_t, 2> get() const {
    const XXH128_hash_t hash = XXH3_128bits_digest(state_.get());
    return {hash.low64, hash.high64};
  }

 private:
  std::unique_ptr<XXH3_state_t, XXH_errorcode (*)(XXH3_state_t*)> state_;
};

template <class T>
std::span<const std::byte> bytes_of(const T& value) {
  return std::as_bytes(std::span(&value, 1));
}

std::string text_of(const PartSettings& s) {
  return Json{{"meta", s.meta},
              {"wrong", s.accuracy.wrong},
              {"max_error", s.accuracy.max_error},
              {"weighed", s.accuracy.weighed},
              {"exact", s.exact},
              {"align", s.write.alignment},
              {"zstd", s.write.zstd}}
      .dump();
}

[[noreturn]] void refuse(const std::string& file, const std::string& what) {
  throw Failure(Exit::kInvalid, file, what + ": copy the part again, or bake it again");
}

// Throws where the text is not that of text_of().
PartSettings settings_of(const std::string& text, const std::string& file) {
  // A value too deep is dropped, so that nothing has to be followed that far.
  const auto shallow = [](int depth, Json::parse_event_t, Json&) { return depth <= kDeepest; };
  const Json json = Json::parse(text, shallow, false);
  PartSettings s;
  try {
    s.meta = json.at("meta");
    json.at("wrong").get_to(s.accuracy.wrong);
    json.at("max_error").get_to(s.accuracy.max_error);
    json.at("weighed").get_to(s.accuracy.weighed);
    json.at("exact").get_to(s.exact);
    json.at("align").get_to(s.write.alignment);
    json.at("zstd").get_to(s.write.zstd);
    const uint32_t align = s.write.alignment;
    const bool good = (align == 0 || align == 256 || align == 4096 || align == 65536) &&
                      s.accuracy.wrong >= 0 && s.accuracy.max_error >= 0 &&
                      s.meta.at("options").is_object() && s.meta.contains("error") &&
                      s.meta.contains("qualities");
    if (good && text_of(s) == text) return s;
  } catch (const Json::exception&) {
  }
  refuse(file, "its settings, at byte " + std::to_string(sizeof(PartHeader) + sizeof(LspHeader)) +
                   ", are not those of a bake");
}

PartHeader header_of(const Baked& baked, const Shard& shard, const std::string& settings,
                     const format::Contents& written) {
  PartHeader h{};
  std::memcpy(h.magic, kPartMagic, sizeof h.magic);
  h.version = kPartVersion;
  h.header_bytes = sizeof h;
  std::strncpy(h.program, kProgramVersion, sizeof h.program - 1);
  h.shard = shard.number;
  h.shards = shard.count;
  const auto common = bake_hash(settings, baked.header, contents_of(baked));
  h.bake_lo = common[0];
  h.bake_hi = common[1];
  h.settings_bytes = settings.size();
  h.file_bytes = sizeof h + sizeof(LspHeader) + padded(settings.size());
  for (int kind = 0; kind < kKinds; ++kind) {
    const uint64_t bytes = written[static_cast<size_t>(kind)].size();
    h.counts[kind] = bytes / format::info(static_cast<Kind>(kind)).element_bytes;
    h.file_bytes += padded(bytes);
  }
  return h;
}

// What a reader asks of a header before it believes the rest of it.
PartHeader read_header(std::span<const std::byte> bytes, const std::string& file) {
  PartHeader h;
  if (bytes.size() >= sizeof h.magic && std::memcmp(bytes.data(), kPartMagic, sizeof h.magic) != 0)
    throw Failure(Exit::kInvalid, file,
                  "is no part of a bake, which begins with 89 LSPPART: give what lsp-bake --shard wrote");
  if (bytes.size() < sizeof h)
    refuse(file, "ends after " + std::to_string(bytes.size()) + " of the " + std::to_string(sizeof h) +
                     " bytes of a part's header");
  std::memcpy(&h, bytes.data(), sizeof h);
  char program[sizeof h.program] = {};
  std::strncpy(program, kProgramVersion, sizeof program - 1);
  if (h.version != kPartVersion || h.header_bytes != sizeof h ||
      std::memcmp(h.program, program, sizeof program) != 0)
    throw Failure(Exit::kUnsupported, file,
                  std::string("was written by another version of lsp-bake, or its bytes 8 to 47 are damaged: "
                              "bake and merge with the same version, as ") +
                      kProgramVersion);
  if (h.file_bytes != bytes.size())
    refuse(file, "has " + std::to_string(bytes.size()) + " bytes, but at byte 56 states " +
                     std::to_string(h.file_bytes));
  if (part_hash(bytes) != std::array{h.hash_lo, h.hash_hi})
    refuse(file, "is damaged: its bytes do not have the hash that stands at byte " +
                     std::to_string(offsetof(PartHeader, hash_lo)));
  return h;
}

}  // namespace

format::Contents contents_of(const Baked& baked) {
  format::Contents contents;
  const SectionArrays arrays{baked};
#define LSP_ARRAY_SECTION(Name, TYPE, code, Element, flag, base, feature, owed, member, ...) \
  if (arrays.member.size() != 0)                                                             \
    contents[static_cast<size_t>(Kind::k##Name)] =                                           \
        std::as_bytes(std::span(arrays.member.data(), arrays.member.size()));
#include "lsp/sections.def"
  return contents;
}

std::array<uint64_t, 2> bake_hash(const std::string& settings, const LspHeader& header,
                                  const format::Contents& sections) {
  Hash hash;
  hash.add_padded(std::as_bytes(std::span(settings)));
  hash.add(bytes_of(header));
  for (int kind = 0; kind < kKinds; ++kind)
    if (!is_table(static_cast<Kind>(kind))) {
      const std::span<const std::byte> bytes = sections[static_cast<size_t>(kind)];
      hash.add(bytes_of(uint64_t{bytes.size()}));
      hash.add(bytes);
    }
  return hash.get();
}

std::array<uint64_t, 2> part_hash(std::span<const std::byte> bytes) {
  PartHeader h;
  std::memcpy(&h, bytes.data(), sizeof h);
  h.hash_lo = h.hash_hi = 0;
  Hash hash;
  hash.add(bytes_of(h));
  hash.add(bytes.subspan(sizeof h));
  return hash.get();
}

uint64_t write_part(const std::filesystem::path& path, Baked& baked, const Shard& shard,
                    const PartSettings& settings) {
  // What all parts state alike.
  LspHeader& header = baked.header;
  header.filled_cell_count = header.entry_word_count = header.plane_count = header.split_count =
      header.cell_node_count = header.cell_reference_count = header.cells.origin_entry_first = 0;
  const std::string text = text_of(settings);
  format::Contents written = contents_of(baked);
  if (shard.number != 1)
    for (int kind = 0; kind < kKinds; ++kind)
      if (!is_table(static_cast<Kind>(kind))) written[static_cast<size_t>(kind)] = {};
  PartHeader h = header_of(baked, shard, text, written);

  Hash hash;
  hash.add(bytes_of(h));
  hash.add(bytes_of(header));
  hash.add_padded(std::as_bytes(std::span(text)));
  for (const std::span<const std::byte> section : written) hash.add_padded(section);
  const auto digest = hash.get();
  h.hash_lo = digest[0];
  h.hash_hi = digest[1];

  OutputFile file(path);
  file.write(&h, sizeof h);
  file.write(&header, sizeof header);
  uint64_t position = sizeof h + sizeof header;
  const auto write = [&](std::span<const std::byte> bytes) {
    file.write(bytes.data(), bytes.size());
    file.pad_to(position += padded(bytes.size()));
  };
  write(std::as_bytes(std::span(text)));
  for (const std::span<const std::byte> section : written) write(section);
  file.commit();
  return h.file_bytes;
}

Part read_part(std::span<const std::byte> bytes, const std::string& file) {
  const PartHeader h = read_header(bytes, file);
  Part part{file, {h.shard, h.shards}, h.bake_lo, h.bake_hi, {}, {}, {}, {}};
  if (h.shard < 1 || h.shard > h.shards || h.shards > kMostParts)
    refuse(file, "states at byte 48 that it is part " + std::to_string(h.shard) + " of " +
                     std::to_string(h.shards));
  uint64_t position = sizeof h;
  const auto take = [&](uint64_t count, uint64_t element_bytes, const char* what) {
    const uint64_t left = bytes.size() - position;
    if (count > left / element_bytes || padded(count * element_bytes) > left)
      refuse(file, std::string(what) + ", at byte " + std::to_string(position) + ", ends beyond the file");
    const std::span<const std::byte> taken = bytes.subspan(position, count * element_bytes);
    position += padded(taken.size());
    return taken;
  };
  std::memcpy(&part.header, take(1, sizeof part.header, "the scene's header").data(), sizeof part.header);
  const std::span<const std::byte> settings = take(h.settings_bytes, 1, "the settings");
  part.settings_text.assign(reinterpret_cast<const char*>(settings.data()), settings.size());
  for (int kind = 0; kind < kKinds; ++kind) {
    const format::KindInfo& known = format::info(static_cast<Kind>(kind));
    part.sections[static_cast<size_t>(kind)] = take(h.counts[kind], known.element_bytes, known.name);
  }
  if (position != bytes.size())
    refuse(file, "goes on after its last section, at byte " + std::to_string(position));
  part.settings = settings_of(part.settings_text, file);
  return part;
}

}  // namespace lsp
