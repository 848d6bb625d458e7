#include "image.h"

#include <zstd.h>

#include <cstring>
#include <memory>
#include <stdexcept>

#include "hash.h"
#include "view.h"

namespace lsp::corpus {
namespace {

using format::align_up;
using format::in_range;

}  // namespace

Section make_section(uint32_t type, uint32_t flags, uint32_t element_bytes, std::span<const std::byte> data) {
  Section section;
  section.entry.type = type;
  section.entry.flags = flags;
  section.entry.element_bytes = element_bytes;
  section.entry.element_count = data.size() / element_bytes;
  section.entry.bytes = data.size();
  section.data.assign(data.begin(), data.end());
  section.stored = section.data;
  return section;
}

Sections to_sections(const Image& image) {
  Sections result;
  result.header = image.header;
  LspHeader& header = result.header;
  header.alignment = image.alignment;
  format::set_counters(header, image);
  const auto add = [&](format::Kind kind, const auto& elements) {
    const format::KindInfo& known = format::info(kind);
    const uint32_t flags = known.flag == format::SectionFlag::kOptional ? 0 : LSP_SECTION_REQUIRED;
    if (elements.empty()) return;
    result.sections.push_back(
        make_section(known.type, flags, known.element_bytes, std::as_bytes(std::span(elements))));
  };
#define LSP_ARRAY_SECTION(Name, TYPE, code, Element, flag, base, feature, owed, member, ...) \
  add(format::Kind::k##Name, image.member);
#define LSP_BYTE_SECTION(Name, ...) add(format::Kind::k##Name, image.meta);
#include <lsp/sections.def>
  return result;
}

Bytes zstd_frame(std::span<const std::byte> data) {
  Bytes frame(ZSTD_compressBound(data.size()));
  const size_t size = ZSTD_compress(frame.data(), frame.size(), data.data(), data.size(), 19);
  if (ZSTD_isError(size)) throw std::runtime_error("zstd");
  frame.resize(size);
  return frame;
}

void pack(Sections& sections) {
  for (Section& section : sections.sections) {
    section.stored = zstd_frame(section.data);
    section.entry.codec = LSP_CODEC_ZSTD;
  }
}

Bytes encode(const Sections& input) {
  uint64_t alignment = input.header.alignment;
  for (const Section& section : input.sections)
    if (section.entry.codec != LSP_CODEC_NONE) alignment = 256;
  std::vector<LspSection> table;
  uint64_t end = sizeof(LspHeader) + input.sections.size() * sizeof(LspSection);
  for (const Section& section : input.sections) {
    LspSection entry = section.entry;
    entry.offset = align_up(end, alignment);
    entry.stored_bytes = section.stored.size();
    const format::Hash128 hash = format::hash_bytes(section.data);
    entry.hash_lo = hash.lo;
    entry.hash_hi = hash.hi;
    end = entry.offset + entry.stored_bytes;
    table.push_back(entry);
  }
  LspHeader header = input.header;
  header.section_count = static_cast<uint32_t>(table.size());
  header.section_table_offset = sizeof(LspHeader);
  header.file_bytes = align_up(end, alignment);
  const format::Hash128 content = format::content_hash(table);
  header.content_hash_lo = content.lo;
  header.content_hash_hi = content.hi;
  const format::Hash128 hash = format::header_hash(header, table);
  header.header_hash_lo = hash.lo;
  header.header_hash_hi = hash.hi;

  Bytes bytes(header.file_bytes);
  std::memcpy(bytes.data(), &header, sizeof header);
  if (!table.empty())
    std::memcpy(bytes.data() + sizeof header, table.data(), table.size() * sizeof(LspSection));
  for (size_t i = 0; i < table.size(); ++i)
    if (!input.sections[i].stored.empty())
      std::memcpy(bytes.data() + table[i].offset, input.sections[i].stored.data(),
                  input.sections[i].stored.size());
  return bytes;
}

LspHeader& header_of(Bytes& bytes) { return *reinterpret_cast<LspHeader*>(bytes.data()); }

std::span<LspSection> table_of(Bytes& bytes) {
  return {reinterpret_cast<LspSection*>(bytes.data() + sizeof(LspHeader)), header_of(bytes).section_count};
}

LspSection& section_of(Bytes& bytes, uint32_t type) {
  for (LspSection& section : table_of(bytes))
    if (section.type == type) return section;
  throw std::logic_error("the file has no such section");
}

void repair_hashes(Bytes& bytes) {
  if (bytes.size() < sizeof(LspHeader)) return;
  LspHeader header;
  std::memcpy(&header, bytes.data(), sizeof header);
  const uint64_t count = header.section_count;
  if (!in_range(header.section_table_offset, count * sizeof(LspSection), bytes.size())) return;
  std::byte* at = bytes.data() + header.section_table_offset;
  std::vector<LspSection> table(count);
  if (count != 0) std::memcpy(table.data(), at, count * sizeof(LspSection));
  for (LspSection& section : table) {
    if (!in_range(section.offset, section.stored_bytes, bytes.size())) continue;
    std::span<const std::byte> data = std::span(bytes).subspan(section.offset, section.stored_bytes);
    Bytes unpacked;
    if (section.codec == LSP_CODEC_ZSTD) {
      if (section.bytes > uint64_t{1} << 24) continue;
      unpacked.resize(section.bytes);
      const size_t size = ZSTD_decompress(unpacked.data(), unpacked.size(), data.data(), data.size());
      if (ZSTD_isError(size) || size != section.bytes) continue;
      data = unpacked;
    }
    const format::Hash128 hash = format::hash_bytes(data);
    section.hash_lo = hash.lo;
    section.hash_hi = hash.hi;
  }
  const format::Hash128 content = format::content_hash(table);
  header.content_hash_lo = content.lo;
  header.content_hash_hi = content.hi;
  const format::Hash128 hash = format::header_hash(header, table);
  header.header_hash_lo = hash.lo;
  header.header_hash_hi = hash.hi;
  // The table first: where it overlaps the header, the header's own fields stay.
  if (count != 0) std::memcpy(at, table.data(), count * sizeof(LspSection));
  std::memcpy(bytes.data(), &header, sizeof header);
}

}  // namespace lsp::corpus
