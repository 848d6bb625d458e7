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

template <class T>
std::span<const std::byte> as_bytes_of(const std::vector<T>& elements) {
  return std::as_bytes(std::span(elements));
}

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
  header.node_count = static_cast<uint32_t>(image.nodes.size());
  if (header.base_structure == LSP_BASE_NTREE)
    header.node_count = static_cast<uint32_t>(image.grid.size() / LSP_GRID_WORDS(header.ntree_branching));
  header.cell_count = static_cast<uint32_t>(image.cells.size());
  header.reference_count = static_cast<uint32_t>(image.references.size());
  header.triangle_count = static_cast<uint32_t>(image.triangles.size());
  header.material_count = static_cast<uint32_t>(image.materials.size());
  header.line_space_count = static_cast<uint32_t>(image.line_spaces.size());
  header.bit_word_count = static_cast<uint32_t>(image.words.size());
  header.candidate_word_count = static_cast<uint32_t>(image.candidates.size());
  const auto add = [&](uint32_t type, uint32_t flags, uint32_t element_bytes,
                       std::span<const std::byte> data) {
    if (!data.empty()) result.sections.push_back(make_section(type, flags, element_bytes, data));
  };
  constexpr uint32_t kRequired = LSP_SECTION_REQUIRED;
  add(LSP_SECTION_NODE, kRequired, sizeof(LspNode), as_bytes_of(image.nodes));
  add(LSP_SECTION_TRIA, kRequired, sizeof(LspTriangle), as_bytes_of(image.triangles));
  add(LSP_SECTION_NRML, kRequired, sizeof(LspCornerNormals), as_bytes_of(image.normals));
  add(LSP_SECTION_MATL, kRequired, sizeof(LspMaterial), as_bytes_of(image.materials));
  add(LSP_SECTION_LSPC, kRequired, sizeof(LspLineSpace), as_bytes_of(image.line_spaces));
  add(LSP_SECTION_BITS, kRequired, sizeof(LspBitWord), as_bytes_of(image.words));
  add(LSP_SECTION_CAND, kRequired, sizeof(uint32_t), as_bytes_of(image.candidates));
  add(LSP_SECTION_GRID, kRequired, sizeof(LspBitWord), as_bytes_of(image.grid));
  add(LSP_SECTION_CELL, kRequired, sizeof(LspCell), as_bytes_of(image.cells));
  add(LSP_SECTION_REFS, kRequired, sizeof(uint32_t), as_bytes_of(image.references));
  add(LSP_SECTION_META, 0, 1, std::as_bytes(std::span(image.meta)));
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
