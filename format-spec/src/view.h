// A lenient view of a file that may be damaged: what of it can be read, and where each part lies.
#pragma once

#include <lsp/sections.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace lsp::format {

// Whether the header says that the tree is an NTree with parameters in range: GRID can be read.
bool ntree_readable(const LspHeader& header);
// Whether the grid of cells is in range: CGRD can be read.
bool cells_readable(const LspHeader& header);

// Whether exact rays walk wide nodes: WNOD stands in the place of NODE.
inline bool walks_wide(const LspHeader& header) {
  return (has_cells(header) || is_wide(header)) && (header.required_features & LSP_FEATURE_WIDE) != 0;
}

// How many elements the header says that a section has; nothing for META, and for GRID where the header's
// parameters are out of range.
std::optional<uint64_t> declared_count(const LspHeader& header, Kind kind);

// "NODE", or eight hexadecimal digits where a character is not printable.
std::string type_name(uint32_t type);

// One section that the checks may read. Empty data where the section is absent, damaged or not yet unpacked.
struct Part {
  bool present = false;  // the table has it
  bool packed = false;   // offsets inside it are those of the stored frame
  uint64_t offset = 0;   // in the file, of the stored bytes
  uint64_t stored_bytes = 0;
  std::span<const std::byte> data;  // decompressed, a whole number of elements, 16-byte aligned
  bool usable = false;              // data is what the table promises
};

struct FileView {
  std::span<const std::byte> bytes;
  LspHeader header{};             // valid when the file has 256 bytes
  std::vector<LspSection> table;  // empty when it does not lie inside the file
  std::array<Part, kKinds> parts;
  std::vector<std::unique_ptr<std::byte[]>> owned;  // unpacked or realigned sections

  const Part& part(Kind kind) const { return parts[static_cast<int>(kind)]; }

  // The elements of a section; empty when it is not usable.
  template <class T>
  std::span<const T> elements(Kind kind) const {
    const Part& section = part(kind);
    if (!section.usable) return {};  // damaged sections may even be misaligned
    return {reinterpret_cast<const T*>(section.data.data()), section.data.size() / sizeof(T)};
  }

  // Where bytes [first, first + length) of a section's data lie in the file: the frame's offset when packed.
  uint64_t offset_of(Kind kind, uint64_t first) const {
    const Part& section = part(kind);
    return section.packed ? section.offset : section.offset + first;
  }
  uint64_t length_of(Kind kind, uint64_t length) const {
    const Part& section = part(kind);
    return section.packed ? section.stored_bytes : length;
  }
  bool any_packed() const;
  // What sections are aligned to: header.alignment, or 256 in a file with any packed section.
  uint64_t section_alignment() const { return any_packed() ? 256 : header.alignment; }
};

// Whether [offset, offset + length) lies inside [0, size), without overflow.
constexpr bool in_range(uint64_t offset, uint64_t length, uint64_t size) {
  return offset <= size && length <= size - offset;
}

// Rounds up to a multiple of `alignment`, a power of two. The caller makes sure that it does not overflow.
constexpr uint64_t align_up(uint64_t value, uint64_t alignment) {
  return (value + alignment - 1) & ~(alignment - 1);
}

// Reads header and section table as far as they lie inside the file; checks nothing else. `bytes` must
// outlive the view.
FileView view_file(std::span<const std::byte> bytes);

}  // namespace lsp::format
