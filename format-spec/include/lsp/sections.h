// The table of sections (lsp/sections.def) as C++ reads it.
#pragma once

#include <cstdint>
#include <optional>

#include "lsp/layout.h"

namespace lsp::format {

// "PART", which what lsp-bake --shard writes has in place of LSP_MAGIC_1.
constexpr uint32_t kPartMagic = 0x54524150u;

// The sections that this version knows, in the order of the file.
enum class Kind {
#define LSP_ARRAY_SECTION(Name, ...) k##Name,
#define LSP_BYTE_SECTION(Name, ...) k##Name,
#include "lsp/sections.def"
};

enum class SectionFlag { kRequired, kEither, kOptional };  // what LspSection.flags may say
enum class Owed { kByCount, kByFeature, kNever };          // when the file has to have the section

struct KindInfo {
  uint32_t type;  // LSP_SECTION_*
  const char* name;
  const char* element;  // the type of its elements
  uint32_t element_bytes;
  SectionFlag flag;
  uint32_t base;     // the base structure that has it, 0: any
  uint32_t feature;  // the bit that stands for it, 0: none
  Owed owed;
};

inline constexpr KindInfo kKindInfos[] = {
#define LSP_ARRAY_SECTION(Name, TYPE, code, Element, flag, base, feature, owed, ...) \
  {LSP_SECTION_##TYPE, #TYPE, #Element, sizeof(Element), SectionFlag::flag, base, feature, Owed::owed},
#define LSP_BYTE_SECTION(Name, TYPE, code) \
  {LSP_SECTION_##TYPE, #TYPE, "char", 1, SectionFlag::kOptional, 0, 0, Owed::kNever},
#include "lsp/sections.def"
};
inline constexpr int kKinds = sizeof kKindInfos / sizeof kKindInfos[0];

constexpr const KindInfo& info(Kind kind) { return kKindInfos[static_cast<int>(kind)]; }

// The code is the name, which the table states twice.
static_assert([] {
  for (const KindInfo& i : kKindInfos)
    for (int c = 0; c < 4; ++c)
      if ((i.type >> (8 * c) & 0xFF) != static_cast<unsigned char>(i.name[c]) || i.name[4] != 0) return false;
  return true;
}());

// The kind of a section type; kKinds for one that this version does not define.
constexpr int kind_of(uint32_t type) {
  int kind = 0;
  while (kind < kKinds && kKindInfos[kind].type != type) ++kind;
  return kind;
}

constexpr bool is_ntree(const LspHeader& h) { return h.base_structure == LSP_BASE_NTREE; }
constexpr bool has_cells(const LspHeader& h) { return h.base_structure == LSP_BASE_CELLS; }
constexpr bool is_wide(const LspHeader& h) { return h.base_structure == LSP_BASE_WIDE; }

inline constexpr uint32_t kBaseFeatures = LSP_FEATURE_NTREE | LSP_FEATURE_CELLS | LSP_FEATURE_WIDE_BASE;

// The one of them that a base structure has, 0 for a BVH; nothing for a base that there is not.
constexpr std::optional<uint32_t> base_feature(uint32_t base) {
  switch (base) {
    case LSP_BASE_BVH:
      return 0;
    case LSP_BASE_NTREE:
      return LSP_FEATURE_NTREE;
    case LSP_BASE_CELLS:
      return LSP_FEATURE_CELLS;
    case LSP_BASE_WIDE:
      return LSP_FEATURE_WIDE_BASE;
    default:
      return std::nullopt;
  }
}

// Whether the header's base structure is the one that its features say.
constexpr bool base_fits(const LspHeader& h) {
  return base_feature(h.base_structure) == (h.required_features & kBaseFeatures);
}

// Whether a file with this header may have sections of `base`; one of unknown base is read as a BVH. One of
// cells has the tree for exact rays besides: wide nodes, before 2.3 a BVH.
constexpr bool holds_base(const LspHeader& h, uint32_t base) {
  if (base == LSP_BASE_CELLS) return has_cells(h);
  if (base == LSP_BASE_WIDE) return has_cells(h) || is_wide(h);
  return base == 0 || (!is_wide(h) && base == (is_ntree(h) ? LSP_BASE_NTREE : LSP_BASE_BVH));
}

// How many elements the header says that a section has, whether its feature asks for it or not; nothing for
// one that is not counted.
constexpr std::optional<uint64_t> header_count(const LspHeader& h, Kind kind) {
  switch (kind) {
#define LSP_ARRAY_SECTION(Name, TYPE, code, Element, flag, base, feature, owed, member, counter, per, ...) \
  case Kind::k##Name:                                                                                      \
    return holds_base(h, base) ? uint64_t{h.counter} * (per) : 0;
#include "lsp/sections.def"
    default:
      return std::nullopt;
  }
}

// Sets the header's counters to the sizes of `arrays`: containers, named as the members of lsp_scene are.
template <class Arrays>
void set_counters(LspHeader& h, const Arrays& arrays) {
#define LSP_ARRAY_SECTION(Name, TYPE, code, Element, flag, base, feature, owed, member, counter, per, ...) \
  if (Owed::owed == Owed::kByCount && holds_base(h, base))                                                 \
    h.counter = static_cast<uint32_t>(arrays.member.size() / (per));
#include "lsp/sections.def"
}

}  // namespace lsp::format
