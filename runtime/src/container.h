// The container of an .lsp file: header and section table, checked once for everyone who follows them.
#pragma once

#include "lsp/lsp.h"
#include "lsp/sections.h"

namespace lsp {

// A checked view of header and section table; pointers into the file's bytes.
struct Container {
  const LspHeader* header;
  const LspSection* sections;               // header->section_count of them, every one inside the file
  const LspSection* known[format::kKinds];  // by format::Kind; null: the file has none
  bool packed;                              // some section is compressed
};

// True if bytes [offset, offset + bytes) lie in [0, size). Every range of a file goes through this.
inline bool in_range(uint64_t offset, uint64_t bytes, uint64_t size) noexcept {
  return offset <= size && bytes <= size - offset;
}

// Reads the container of the file in bytes[0, size), which may be hostile. Touches header and section table
// only. After LSP_OK every section lies inside the file with its stored size, the sizes of known sections are
// those that the header's counts ask for, the sections that the features need are there, and the header's
// limits are within the library's.
lsp_status read_container(const void* bytes, uint64_t size, Container* container, lsp_error* error) noexcept;

// The four characters of a section's type, for messages; what cannot be printed becomes '?'.
struct SectionName {
  char text[5];
  explicit SectionName(uint32_t type) noexcept;
};

}  // namespace lsp
