// The smallest writer of .lsp files: what a file is made of, and how it becomes bytes.
//
// Three stages, each of which a mutation may change: an Image (typed arrays), its sections (bytes with their
// table entries), and the encoded bytes. Hashes are made last, so that a change at any stage reaches the
// rules it is meant for.
#pragma once

#include <lsp/sections.h>

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace lsp::corpus {

using Bytes = std::vector<std::byte>;

struct Image {
  LspHeader header{};  // counts, sizes, offsets and hashes are filled in later
#define LSP_ARRAY_SECTION(Name, TYPE, code, Element, flag, base, feature, owed, member, ...) \
  std::vector<Element> member;
#include <lsp/sections.def>
  std::string meta;
  uint32_t alignment = 256;
};

struct Section {
  LspSection entry{};  // offset and stored_bytes are filled in by encode
  Bytes data;          // what the hash is of
  Bytes stored;        // what is written: data, or a frame
};

struct Sections {
  LspHeader header{};
  std::vector<Section> sections;
};

// The image's sections in the order of the file, without empty ones; the header's counts are those of the
// image.
Sections to_sections(const Image& image);

// A section of any type. `flags` as in LspSection.
Section make_section(uint32_t type, uint32_t flags, uint32_t element_bytes, std::span<const std::byte> data);

// Packs every section with zstd, each into one frame.
void pack(Sections& sections);
Bytes zstd_frame(std::span<const std::byte> data);

// Lays the sections out, one after the other at multiples of the alignment (256 when one is packed), and
// makes the hashes.
Bytes encode(const Sections& sections);
inline Bytes encode(const Image& image) { return encode(to_sections(image)); }

// The header and table of encoded bytes, to be changed in place.
LspHeader& header_of(Bytes& bytes);
std::span<LspSection> table_of(Bytes& bytes);
LspSection& section_of(Bytes& bytes, uint32_t type);

// Makes the hashes of encoded bytes right again: of raw sections that lie inside the bytes, of the content,
// of the header. Does nothing to what it cannot read.
void repair_hashes(Bytes& bytes);

}  // namespace lsp::corpus
