#include "view.h"

#include <cctype>
#include <cstdio>
#include <cstring>

namespace lsp::format {
bool ntree_readable(const LspHeader& header) {
  return is_ntree(header) && header.ntree_branching >= 2 && header.ntree_branching <= LSP_MAX_BRANCHING &&
         header.ntree_depth >= 1 && header.ntree_depth <= LSP_MAX_NTREE_DEPTH;
}

std::optional<uint64_t> declared_count(const LspHeader& header, Kind kind) {
  if (kind == Kind::kGrid && is_ntree(header) && !ntree_readable(header)) return std::nullopt;
  return header_count(header, kind);
}

bool cells_readable(const LspHeader& header) {
  const LspCellGrid& g = header.cells;
  const auto within = [](uint32_t n, uint32_t most) { return n >= 1 && n <= most; };
  return within(g.cells_x, LSP_MAX_CELLS) && within(g.cells_y, LSP_MAX_CELLS) &&
         within(g.cells_z, LSP_MAX_CELLS) && within(g.far_patches, LSP_MAX_CELL_PATCHES) &&
         within(g.origin_patches, LSP_MAX_CELL_PATCHES) && within(g.sub_cells, LSP_MAX_SUB_CELLS);
}

std::string type_name(uint32_t type) {
  std::string name;
  for (int shift = 0; shift < 32; shift += 8) {
    const int character = type >> shift & 0xFF;
    if (character < 0x21 || character > 0x7E || character == '/') {
      char hex[12];
      std::snprintf(hex, sizeof hex, "%08X", type);
      return hex;
    }
    name += static_cast<char>(character);
  }
  return name;
}

bool FileView::any_packed() const {
  for (const LspSection& section : table)
    if (section.codec != LSP_CODEC_NONE) return true;
  return false;
}

FileView view_file(std::span<const std::byte> bytes) {
  FileView view;
  view.bytes = bytes;
  if (bytes.size() < sizeof(LspHeader)) return view;
  std::memcpy(&view.header, bytes.data(), sizeof(LspHeader));
  const uint64_t count = view.header.section_count;
  if (!in_range(view.header.section_table_offset, count * sizeof(LspSection), bytes.size())) return view;
  view.table.resize(count);
  if (count != 0)
    std::memcpy(view.table.data(), bytes.data() + view.header.section_table_offset,
                count * sizeof(LspSection));
  return view;
}

}  // namespace lsp::format
