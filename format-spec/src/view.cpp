#include "view.h"

#include <cctype>
#include <cstdio>
#include <cstring>

namespace lsp::format {
namespace {

constexpr KindInfo kInfos[kKinds] = {
    {LSP_SECTION_NODE, "NODE", sizeof(LspNode), true, false},
    {LSP_SECTION_TRIA, "TRIA", sizeof(LspTriangle), true, false},
    {LSP_SECTION_NRML, "NRML", sizeof(LspCornerNormals), false, false},
    {LSP_SECTION_MATL, "MATL", sizeof(LspMaterial), false, false},
    {LSP_SECTION_LSPC, "LSPC", sizeof(LspLineSpace), true, false},
    {LSP_SECTION_BITS, "BITS", sizeof(LspBitWord), true, false},
    {LSP_SECTION_CAND, "CAND", sizeof(uint32_t), true, false},
    {LSP_SECTION_GRID, "GRID", sizeof(LspBitWord), true, false},
    {LSP_SECTION_CELL, "CELL", sizeof(LspCell), true, false},
    {LSP_SECTION_REFS, "REFS", sizeof(uint32_t), true, false},
    {LSP_SECTION_META, "META", 1, false, true},
};

}  // namespace

const KindInfo& info(Kind kind) { return kInfos[static_cast<int>(kind)]; }

int kind_of(uint32_t type) {
  for (int kind = 0; kind < kKinds; ++kind)
    if (kInfos[kind].type == type) return kind;
  return kKinds;
}

bool is_ntree(const LspHeader& header) { return header.base_structure == LSP_BASE_NTREE; }

bool ntree_readable(const LspHeader& header) {
  return is_ntree(header) && header.ntree_branching >= 2 && header.ntree_branching <= LSP_MAX_BRANCHING &&
         header.ntree_depth >= 1 && header.ntree_depth <= LSP_MAX_NTREE_DEPTH;
}

std::optional<uint64_t> declared_count(const LspHeader& header, Kind kind) {
  switch (kind) {
    case Kind::kNode:
      return is_ntree(header) ? 0 : header.node_count;
    case Kind::kTria:
    case Kind::kNrml:
      return header.triangle_count;
    case Kind::kMatl:
      return header.material_count;
    case Kind::kLspc:
      return header.line_space_count;
    case Kind::kBits:
      return header.bit_word_count;
    case Kind::kCand:
      return header.candidate_word_count;
    case Kind::kGrid:
      if (!is_ntree(header)) return 0;
      if (!ntree_readable(header)) break;
      return uint64_t{header.node_count} * LSP_GRID_WORDS(header.ntree_branching);
    case Kind::kCell:
      return header.cell_count;
    case Kind::kRefs:
      return header.reference_count;
    case Kind::kMeta:
      break;
  }
  return std::nullopt;
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
