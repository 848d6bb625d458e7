#include "container.h"

#include <bit>
#include <cmath>
#include <cstddef>
#include <cstring>

#include "error.h"

// The structs of layout.h are read in place.
static_assert(std::endian::native == std::endian::little);

namespace lsp {
namespace {

using format::has_cells;
using format::is_ntree;
using format::is_wide;
using format::Kind;
using format::kKinds;
using format::kPartMagic;

constexpr uint64_t kPackedAlignment = 256;
constexpr uint32_t kMaxAlignment = 65536;
constexpr uint64_t kStepsSlack = 16;
// A traversal marks references to nodes in their two highest bits, to Line Spaces in three.
constexpr uint32_t kMaxNodes = 1u << 30;
constexpr uint32_t kMaxLineSpaces = 1u << 29;

bool finite(const lsp_float3& v) { return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z); }

// Identification: is this a file that this version can read at all?
lsp_status check_identity(const LspHeader& header, lsp_error* error) {
  if (header.magic_0 == LSP_MAGIC_0 && header.magic_1 == kPartMagic)
    return fail(error, LSP_ERROR_INVALID, 0,
                "is a part of a bake; lsp-merge makes an .lsp file of all parts");
  if (header.magic_0 != LSP_MAGIC_0 || header.magic_1 != LSP_MAGIC_1) {
    return fail(error, LSP_ERROR_INVALID, 0,
                "is not an .lsp file (its first eight bytes are others); lsp-bake makes one of a mesh");
  }
  if (header.version_major != LSP_VERSION_MAJOR) {
    return fail(error, LSP_ERROR_UNSUPPORTED, offsetof(LspHeader, version_major),
                "has format version %u.%u, this library reads %u.x; %sbake it again", header.version_major,
                header.version_minor, LSP_VERSION_MAJOR,
                header.version_major > LSP_VERSION_MAJOR ? "use a newer one, or " : "");
  }
  if (const uint32_t unknown = header.required_features & ~LSP_FEATURES_KNOWN; unknown != 0) {
    return fail(error, LSP_ERROR_UNSUPPORTED, offsetof(LspHeader, required_features),
                "needs features that this library does not know (bits 0x%X); update the library", unknown);
  }
  if (header.header_bytes != sizeof(LspHeader)) {
    return fail(error, LSP_ERROR_INVALID, offsetof(LspHeader, header_bytes),
                "states a header of %u bytes, not %zu", header.header_bytes, sizeof(LspHeader));
  }
  return LSP_OK;
}

lsp_status check_ntree(const LspHeader& header, lsp_error* error) {
  bool good = header.ntree_branching == 0 && header.ntree_depth == 0 && header.cell_count == 0 &&
              header.reference_count == 0;
  if (is_ntree(header)) {
    good = header.ntree_branching >= 2 && header.ntree_branching <= LSP_MAX_BRANCHING &&
           header.ntree_depth >= 1 && header.ntree_depth <= LSP_MAX_NTREE_DEPTH && finite(header.ntree_lo) &&
           header.ntree_size > 0 && std::isfinite(header.ntree_size) && header.ntree_margin >= 0 &&
           std::isfinite(header.ntree_margin) && header.reference_count < LSP_LEAF_BIT &&
           uint64_t{header.node_count} * LSP_GRID_WORDS(header.ntree_branching) <= LSP_NONE;
  }
  if (good) return LSP_OK;
  return fail(error, LSP_ERROR_INVALID, offsetof(LspHeader, ntree_branching),
              "states an NTree of branching %u and depth %u that does not fit base structure %u",
              header.ntree_branching, header.ntree_depth, header.base_structure);
}

// The grid of cells, whose numbers the traversal computes with.
lsp_status check_cells(const LspHeader& header, lsp_error* error) {
  const LspCellGrid& g = header.cells;
  constexpr LspCellGrid kNone{};
  bool good = memcmp(&g, &kNone, sizeof g) == 0;
  if (has_cells(header)) {
    const auto within = [](uint32_t n, uint32_t most) { return n >= 1 && n <= most; };
    const auto positive = [](float x) { return x > 0 && std::isfinite(x); };
    good = within(g.cells_x, LSP_MAX_CELLS) && within(g.cells_y, LSP_MAX_CELLS) &&
           within(g.cells_z, LSP_MAX_CELLS) && finite(g.lo) && positive(g.size) && positive(g.per_size) &&
           positive(g.margin) && positive(g.box_step) && within(g.far_patches, LSP_MAX_CELL_PATCHES) &&
           within(g.origin_patches, LSP_MAX_CELL_PATCHES) && within(g.sub_cells, LSP_MAX_SUB_CELLS) &&
           header.filled_cell_count < LSP_CELL_FILLED;
  }
  if (good) return LSP_OK;
  return fail(error, LSP_ERROR_INVALID, offsetof(LspHeader, cells),
              "states a grid of %u x %u x %u cells that does not fit base structure %u", g.cells_x, g.cells_y,
              g.cells_z, header.base_structure);
}

lsp_status check_limits(const LspHeader& header, lsp_error* error) {
  if (!std::has_single_bit(header.alignment) || header.alignment < kPackedAlignment ||
      header.alignment > kMaxAlignment) {
    return fail(error, LSP_ERROR_INVALID, offsetof(LspHeader, alignment),
                "states an alignment of %u, not 256, 4096 or 65536", header.alignment);
  }
  if (!format::base_fits(header)) {
    return fail(error, LSP_ERROR_INVALID, offsetof(LspHeader, base_structure),
                "states base structure %u, which its features contradict", header.base_structure);
  }
  const bool wide = (header.required_features & LSP_FEATURE_WIDE) != 0;
  if (is_wide(header) ? !wide : wide && !has_cells(header)) {
    return fail(error, LSP_ERROR_INVALID, offsetof(LspHeader, required_features),
                "%s wide nodes, which base structure %u %s", wide ? "has" : "lacks", header.base_structure,
                wide ? "does not have" : "is made of");
  }
  if (!finite(header.bounds_min) || !finite(header.bounds_max) || !std::isfinite(header.normal_angle_cos) ||
      !std::isfinite(header.plane_tolerance)) {
    return fail(error, LSP_ERROR_INVALID, offsetof(LspHeader, bounds_min),
                "has bounds or tolerances that are not finite");
  }
  if (header.max_stack > LSP_MAX_STACK) {
    return fail(error, LSP_ERROR_LIMIT, offsetof(LspHeader, max_stack),
                "needs a stack of %u entries, the limit is %u", header.max_stack, LSP_MAX_STACK);
  }
  if (const lsp_status status = check_ntree(header, error); status != LSP_OK) return status;
  if (const lsp_status status = check_cells(header, error); status != LSP_OK) return status;
  // Every node and leaf is visited once at most, so a loop bounded by this ends soon even where nodes form a
  // ring.
  const uint64_t steps =
      is_ntree(header) ? lsp_ntree_steps(&header) : 2 * uint64_t{header.node_count} + lsp_wide_steps(&header);
  if (header.max_steps > steps + kStepsSlack) {
    return fail(error, LSP_ERROR_INVALID, offsetof(LspHeader, max_steps),
                "states %u steps of traversal, more than its %u nodes allow", header.max_steps,
                header.node_count);
  }
  const uint32_t max_leaf = is_ntree(header) ? header.reference_count : LSP_MAX_LEAF_TRIANGLES;
  if (header.max_leaf_triangles > max_leaf) {
    return fail(error, LSP_ERROR_INVALID, offsetof(LspHeader, max_leaf_triangles),
                "states leaves of %u triangles, the limit is %u", header.max_leaf_triangles, max_leaf);
  }
  if (header.node_count > kMaxNodes || header.line_space_count > kMaxLineSpaces ||
      header.triangle_count > LSP_LEAF_FIRST_MASK + 1u) {
    return fail(error, LSP_ERROR_INVALID, offsetof(LspHeader, node_count),
                "states more nodes, triangles or Line Spaces than a reference can name");
  }
  return LSP_OK;
}

lsp_status check_root(const LspHeader& header, lsp_error* error) {
  const uint32_t root = header.root;
  bool good = root == LSP_NONE;
  if (root != LSP_NONE && (root & LSP_LEAF_BIT) == 0) good = root < header.node_count;
  if (is_ntree(header)) {
    good = root == LSP_NONE || (root == 0 && header.node_count > 0);
  } else if (root != LSP_NONE && (root & LSP_LEAF_BIT) != 0) {
    const uint32_t count = ((root >> LSP_LEAF_COUNT_SHIFT) & LSP_LEAF_COUNT_MASK) + 1;
    good = in_range(root & LSP_LEAF_FIRST_MASK, count, header.triangle_count);
  }
  if (!good) {
    return fail(error, LSP_ERROR_INVALID, offsetof(LspHeader, root),
                "its root 0x%08X names no node and no leaf", root);
  }
  const uint32_t line_space = header.root_line_space;
  if (line_space != LSP_NONE && (line_space & LSP_LINE_SPACE_MASK) >= header.line_space_count) {
    return fail(error, LSP_ERROR_INVALID, offsetof(LspHeader, root_line_space),
                "its root's Line Space 0x%08X is not in the file", line_space);
  }
  return LSP_OK;
}

// One entry of the table by itself: does it lie in the file, may it be ignored, do its sizes agree?
lsp_status check_section(const LspHeader& header, const LspSection& section, uint64_t table_end, uint64_t at,
                         lsp_error* error) {
  const SectionName name(section.type);
  const int kind = format::kind_of(section.type);
  if (kind == kKinds && (section.flags & LSP_SECTION_REQUIRED) != 0) {
    return fail(error, LSP_ERROR_UNSUPPORTED, at,
                "needs section \"%s\" (0x%08X), which this library does not know; update the library",
                name.text, section.type);
  }
  if (section.offset < table_end || !in_range(section.offset, section.stored_bytes, header.file_bytes)) {
    return fail(error, LSP_ERROR_INVALID, at, "section %s does not lie inside the file", name.text);
  }
  if (section.codec == LSP_CODEC_NONE && section.bytes != section.stored_bytes) {
    return fail(error, LSP_ERROR_INVALID, at, "section %s is not compressed, yet its two sizes differ",
                name.text);
  }
  uint64_t bytes = 0;
  if (__builtin_mul_overflow(section.element_count, uint64_t{section.element_bytes}, &bytes) ||
      bytes != section.bytes) {
    return fail(error, LSP_ERROR_INVALID, at, "section %s: its elements do not add up to its size",
                name.text);
  }
  if (kind == kKinds) return LSP_OK;
  const format::KindInfo& known = info(static_cast<Kind>(kind));
  if (section.element_bytes != known.element_bytes) {
    return fail(error, LSP_ERROR_INVALID, at, "section %s has elements of %u bytes, not %u", name.text,
                section.element_bytes, known.element_bytes);
  }
  if (section.codec != LSP_CODEC_NONE && section.codec != LSP_CODEC_ZSTD) {
    return fail(error, LSP_ERROR_UNSUPPORTED, at, "section %s is packed with codec %u, which is not known",
                name.text, section.codec);
  }
  return LSP_OK;
}

// The table as a whole: starts aligned, no type twice, no two sections over each other.
lsp_status check_table(const LspHeader& header, const LspSection* sections, bool packed, lsp_error* error) {
  const uint64_t alignment = packed ? kPackedAlignment : header.alignment;
  if (header.file_bytes % alignment != 0) {
    return fail(error, LSP_ERROR_INVALID, offsetof(LspHeader, file_bytes),
                "its length is not a multiple of %llu", static_cast<unsigned long long>(alignment));
  }
  for (uint32_t i = 0; i < header.section_count; ++i) {
    const LspSection& a = sections[i];
    const uint64_t at = header.section_table_offset + uint64_t{i} * sizeof(LspSection);
    const SectionName name(a.type);
    if (a.offset % alignment != 0) {
      return fail(error, LSP_ERROR_INVALID, at, "section %s does not start at a multiple of %llu", name.text,
                  static_cast<unsigned long long>(alignment));
    }
    for (uint32_t j = 0; j < i; ++j) {
      const LspSection& b = sections[j];
      if (a.type == b.type) {
        return fail(error, LSP_ERROR_INVALID, at, "section %s is there twice", name.text);
      }
      if (a.stored_bytes != 0 && b.stored_bytes != 0 && a.offset < b.offset + b.stored_bytes &&
          b.offset < a.offset + a.stored_bytes) {
        return fail(error, LSP_ERROR_INVALID, at, "section %s overlaps section %s", name.text,
                    SectionName(b.type).text);
      }
    }
  }
  return LSP_OK;
}

// Header against table: the counts agree, and what the features promise is there.
lsp_status check_contents(const Container& container, lsp_error* error) {
  const LspHeader& header = *container.header;
  const uint32_t features = header.required_features;
  for (int kind = 0; kind < kKinds; ++kind) {
    const format::KindInfo& known = info(static_cast<Kind>(kind));
    const bool has_feature = (features & known.feature) != 0;
    uint64_t count = header_count(header, static_cast<Kind>(kind)).value_or(0);
    if (known.owed == format::Owed::kNever) continue;
    if (known.owed == format::Owed::kByFeature && !has_feature) count = 0;
    const LspSection* section = container.known[kind];
    const uint64_t present = section == nullptr ? 0 : section->element_count;
    if (present != count) {
      return fail(error, LSP_ERROR_INVALID, offsetof(LspHeader, node_count),
                  "section %s has %llu elements, the header states %llu", known.name,
                  static_cast<unsigned long long>(present), static_cast<unsigned long long>(count));
    }
    if (known.feature != 0 && count != 0 && !has_feature) {
      return fail(error, LSP_ERROR_INVALID, offsetof(LspHeader, required_features),
                  "has section %s, but not the feature bit for it", known.name);
    }
  }
  return LSP_OK;
}

}  // namespace

SectionName::SectionName(uint32_t type) noexcept : text{} {
  for (int i = 0; i < 4; ++i) {
    const char c = static_cast<char>((type >> (8 * i)) & 0xFF);
    text[i] = c > ' ' && c <= '~' ? c : '?';
  }
}

lsp_status read_container(const void* bytes, uint64_t size, Container* container, lsp_error* error) noexcept {
  *container = {};
  if (bytes == nullptr || reinterpret_cast<uintptr_t>(bytes) % 16 != 0) {
    return fail(error, LSP_ERROR_INVALID, 0, "its bytes must be in memory at a multiple of 16");
  }
  if (size < sizeof(LspHeader)) {
    return fail(error, LSP_ERROR_INVALID, size,
                "is %llu bytes long, shorter than a header; copy or bake it again",
                static_cast<unsigned long long>(size));
  }
  const LspHeader& header = *static_cast<const LspHeader*>(bytes);
  if (const lsp_status status = check_identity(header, error); status != LSP_OK) return status;
  if (header.file_bytes != size) {
    return fail(error, LSP_ERROR_INVALID, offsetof(LspHeader, file_bytes),
                "is %llu bytes long, its header states %llu; it was %s: copy or bake it again",
                static_cast<unsigned long long>(size), static_cast<unsigned long long>(header.file_bytes),
                size < header.file_bytes ? "cut" : "extended");
  }
  if (header.section_count > LSP_MAX_SECTIONS) {
    return fail(error, LSP_ERROR_LIMIT, offsetof(LspHeader, section_count),
                "has %u sections, the limit is %u", header.section_count, LSP_MAX_SECTIONS);
  }
  const uint64_t table_bytes = uint64_t{header.section_count} * sizeof(LspSection);
  if (header.section_table_offset != sizeof(LspHeader) ||
      !in_range(header.section_table_offset, table_bytes, size)) {
    return fail(error, LSP_ERROR_INVALID, offsetof(LspHeader, section_table_offset),
                "its section table of %u entries is not inside the file behind the header",
                header.section_count);
  }
  if (const lsp_status status = check_limits(header, error); status != LSP_OK) return status;

  const auto* sections = reinterpret_cast<const LspSection*>(static_cast<const unsigned char*>(bytes) +
                                                             header.section_table_offset);
  bool packed = false;
  const LspSection* known[kKinds] = {};
  for (uint32_t i = 0; i < header.section_count; ++i) {
    const uint64_t at = header.section_table_offset + uint64_t{i} * sizeof(LspSection);
    const lsp_status status =
        check_section(header, sections[i], header.section_table_offset + table_bytes, at, error);
    if (status != LSP_OK) return status;
    packed = packed || sections[i].codec != LSP_CODEC_NONE;
    if (const int kind = format::kind_of(sections[i].type); kind != kKinds) known[kind] = &sections[i];
  }
  if (const lsp_status status = check_table(header, sections, packed, error); status != LSP_OK) return status;

  container->header = &header;
  container->sections = sections;
  for (int i = 0; i < kKinds; ++i) container->known[i] = known[i];
  container->packed = packed;
  if (const lsp_status status = check_contents(*container, error); status != LSP_OK) return status;
  return check_root(header, error);
}

}  // namespace lsp
