// Identification and header: what the first 256 bytes may say.
#include <algorithm>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstring>

#include "layers.h"

namespace lsp::format {
namespace {

constexpr uint32_t kMaxSections = 256;
constexpr uint32_t kStepsSlack = 16;
// A traversal marks references to nodes in their two highest bits, to Line Spaces in three.
constexpr uint32_t kMaxNodes = 1u << 30;
constexpr uint32_t kMaxLineSpaces = 1u << 29;

// One finding about a field of the header.
#define LSP_HEADER_FINDING(id, field, message) \
  report.add(RuleId::id, offsetof(LspHeader, field), sizeof(LspHeader::field), "/header/" #field, message)

std::string hex(uint32_t value) {
  char text[16];
  std::snprintf(text, sizeof text, "0x%X", value);
  return text;
}

bool starts_with(std::span<const std::byte> bytes, std::string_view prefix) {
  return bytes.size() >= prefix.size() && std::memcmp(bytes.data(), prefix.data(), prefix.size()) == 0;
}

// The signature as text-mode transfers leave it: CR LF made LF, LF made CR LF, the high bit cut off.
bool text_damaged(std::span<const std::byte> bytes) {
  return starts_with(bytes, "\x89LSP\n\x1A\n") || starts_with(bytes, "\x89LSP\r\r\n\x1A\r\n") ||
         starts_with(bytes, "\x89LSP\r\n\x1A\r\n") || starts_with(bytes, "\tLSP\r\n\x1A\n");
}

void check_features(const LspHeader& header, const FileView& view, Report& report) {
  const uint32_t features = header.required_features;
  const auto has = [&](uint32_t type) {
    for (const LspSection& section : view.table)
      if (section.type == type) return true;
    return false;
  };
  // A section of no elements need not be there, so a bit may be set for one that the scene has no use for.
  const auto expect = [&](uint32_t bit, bool present, uint64_t count, const char* what) {
    if (((features & bit) != 0) == present || (!present && count == 0)) return;
    LSP_HEADER_FINDING(
        kFeatureSection, required_features,
        std::string(what) +
            (present ? " is present but its feature bit " : " is missing but its feature bit ") + hex(bit) +
            (present ? " is clear" : " is set"));
  };
  for (int kind = 0; kind < kKinds; ++kind) {
    const KindInfo& known = info(static_cast<Kind>(kind));
    if (known.feature != 0)
      expect(known.feature, has(known.type), *header_count(header, static_cast<Kind>(kind)), known.name);
  }
  if ((features & (LSP_FEATURE_EXACT | LSP_FEATURE_LINE_SPACES | LSP_FEATURE_CELLS)) == 0)
    LSP_HEADER_FINDING(kNothingToTrace, required_features,
                       "neither EXACT nor LINE_SPACES nor CELLS is set: no ray can be traced");
}

void check_root(const LspHeader& header, Report& report) {
  if (walks_wide(header)) {
    if (header.root != LSP_NONE)
      LSP_HEADER_FINDING(kRootReference, root,
                         "is " + hex(header.root) + ", but a file with WIDE has root none");
    else if (header.triangle_count != 0 && header.wide_node_count == 0)
      LSP_HEADER_FINDING(kRootReference, root, "is none without wide nodes, but the file has triangles");
  } else if (header.node_count != 0) {
    if (header.root != 0)
      LSP_HEADER_FINDING(kRootReference, root,
                         "is " + hex(header.root) + ", but a file with nodes has root 0");
  } else if (header.root == LSP_NONE) {
    const bool tables_alone = has_cells(header) && (header.required_features & LSP_FEATURE_EXACT) == 0;
    if (header.triangle_count != 0 && header.root_line_space == LSP_NONE && !tables_alone)
      LSP_HEADER_FINDING(kRootReference, root, "is none, but the file has triangles");
  } else if ((header.root & LSP_LEAF_BIT) == 0 || is_ntree(header)) {
    LSP_HEADER_FINDING(kRootReference, root, "is " + hex(header.root) + ", but there are no nodes");
  } else {
    const uint64_t first = header.root & LSP_LEAF_FIRST_MASK;
    const uint64_t count = (header.root >> LSP_LEAF_COUNT_SHIFT & LSP_LEAF_COUNT_MASK) + 1;
    if (!in_range(first, count, header.triangle_count))
      LSP_HEADER_FINDING(kRootReference, root,
                         "is a leaf of triangles " + std::to_string(first) + " to " +
                             std::to_string(first + count - 1) + " of " +
                             std::to_string(header.triangle_count));
  }
  if (header.root_line_space != LSP_NONE &&
      (header.root_line_space & LSP_LINE_SPACE_MASK) >= header.line_space_count)
    LSP_HEADER_FINDING(kRootLineSpace, root_line_space,
                       "names Line Space " + std::to_string(header.root_line_space & LSP_LINE_SPACE_MASK) +
                           " of " + std::to_string(header.line_space_count));
}

// Wide nodes, of cells or alone, and nothing beside them that exact rays walk.
void check_wide_nodes(const LspHeader& header, Report& report) {
  const uint32_t features = header.required_features;
  if ((features & LSP_FEATURE_WIDE) == 0) {
    if (header.wide_node_count != 0 || is_wide(header))
      LSP_HEADER_FINDING(kWideNodes, wide_node_count,
                         "is " + std::to_string(header.wide_node_count) + ", but WIDE is clear");
  } else if (!(has_cells(header) || is_wide(header)) || (features & LSP_FEATURE_EXACT) == 0) {
    LSP_HEADER_FINDING(kWideNodes, required_features,
                       "WIDE is set without EXACT, or in a file neither of cells nor of wide nodes alone");
  } else if (header.node_count != 0 || header.line_space_count != 0) {
    LSP_HEADER_FINDING(kWideNodes, node_count,
                       std::to_string(header.node_count) + " nodes of a BVH and " +
                           std::to_string(header.line_space_count) + " Line Spaces beside wide nodes");
  }
}

void check_cube(const LspHeader& header, Report& report) {
  const lsp_float3& lo = header.ntree_lo;
  const double size = header.ntree_size;
  if (!finite(lo) || !(size > 0 && std::isfinite(size)) ||
      !(header.ntree_margin >= 0 && std::isfinite(header.ntree_margin))) {
    LSP_HEADER_FINDING(kNtreeCube, ntree_lo, "the cube or its margin is not finite, or not positive");
    return;
  }
  const lsp_float3 &min = header.bounds_min, &max = header.bounds_max;
  const bool inside = min.x >= lo.x && min.y >= lo.y && min.z >= lo.z && max.x <= lo.x + size &&
                      max.y <= lo.y + size && max.z <= lo.z + size;
  if (!inside && header.node_count != 0)
    LSP_HEADER_FINDING(kNtreeCube, ntree_lo, "the bounds reach outside the cube");
}

// How many classes of what answers lose a quality heeds, and which part of another.
void check_quality(const LspHeader& header, uint32_t number, Report& report) {
  const uint32_t whole = header.quality[number], part = header.quality_part[number];
  const bool tables_alone = has_cells(header) && (header.required_features & LSP_FEATURE_EXACT) == 0;
  bool good = has_cells(header) ? !tables_alone || whole == LSP_HEEDS_TABLES : (whole | part) == 0;
  good = good && whole >> 16 == 0 && part >> 16 == 0;
  for (const uint32_t shift : {0u, 8u}) {
    const uint32_t classes = whole >> shift & 0xFF, more = part >> shift & 0xFF;
    good = good && classes <= LSP_LOSS_UNKNOWN + 1 && more < LSP_DIAL_PARTS;
    good = good && (classes <= LSP_LOSS_UNKNOWN || more == 0);
  }
  if (!good)
    LSP_HEADER_FINDING(kQualityRange, quality,
                       "quality " + std::to_string(number) + " is " + hex(whole) + ", its part " + hex(part));
}

void check_grid(const LspHeader& header, Report& report) {
  const LspCellGrid& g = header.cells;
  constexpr LspCellGrid kNone{};
  const auto positive = [](float x) { return x > 0 && std::isfinite(x); };
  const auto near = [](double x, double y) { return std::fabs(x - y) <= 1e-6 * std::fabs(y); };
  bool good = std::memcmp(&g, &kNone, sizeof g) == 0;
  if (has_cells(header))
    good = cells_readable(header) && finite(g.lo) && positive(g.size) && positive(g.per_size) &&
           positive(g.margin) && positive(g.box_step) && near(double(g.per_size) * g.size, 1) &&
           near(255.0 * g.box_step, g.size + 2.0 * g.margin);
  if (!good)
    LSP_HEADER_FINDING(kCellsGrid, cells, "the grid of cells is out of range, or there where there is none");
  const uint32_t counts = header.filled_cell_count | header.entry_word_count | header.plane_count |
                          header.split_count | header.cell_node_count | header.cell_reference_count;
  if (counts != 0 && !has_cells(header))
    LSP_HEADER_FINDING(kCellsGrid, filled_cell_count,
                       "or another count of cells is not zero, but there are none");
  const double origin[] = {std::bit_cast<double>(header.origin_x), std::bit_cast<double>(header.origin_y),
                           std::bit_cast<double>(header.origin_z)};
  for (double x : origin)
    if (!std::isfinite(x)) {
      LSP_HEADER_FINDING(kOriginNotFinite, origin_x, "the origin is not finite");
      break;
    }
  for (uint32_t q = 0; q < LSP_QUALITY_COUNT; ++q) check_quality(header, q, report);
}

void check_base(const LspHeader& header, Report& report) {
  const bool ntree = is_ntree(header);
  if (!base_fits(header))
    LSP_HEADER_FINDING(kBaseStructure, base_structure,
                       "is " + std::to_string(header.base_structure) + " with " +
                           hex(header.required_features & kBaseFeatures) +
                           " of the feature bits NTREE, CELLS and WIDE_BASE");
  const lsp_float3& lo = header.ntree_lo;
  const bool zero = header.ntree_branching == 0 && header.ntree_depth == 0 && header.cell_count == 0 &&
                    header.reference_count == 0 && lo.x == 0 && lo.y == 0 && lo.z == 0 &&
                    header.ntree_size == 0 && header.ntree_margin == 0;
  if (ntree ? !ntree_readable(header) : !zero)
    LSP_HEADER_FINDING(kNtreeParameters, ntree_branching,
                       "branching " + std::to_string(header.ntree_branching) + " and depth " +
                           std::to_string(header.ntree_depth) + ", or what is stated of cells, do not fit " +
                           "base structure " + std::to_string(header.base_structure));
  if (ntree) check_cube(header, report);
  check_grid(header, report);
}

void check_limits(const LspHeader& header, Report& report) {
  if (header.max_stack > LSP_MAX_STACK)
    LSP_HEADER_FINDING(kMaxStack, max_stack, "is " + std::to_string(header.max_stack) + ", the limit is 96");
  if (header.max_depth > LSP_MAX_STACK)
    LSP_HEADER_FINDING(kDepthBound, max_depth,
                       "is " + std::to_string(header.max_depth) + ", the limit is 96");
  const uint64_t steps = is_ntree(header)     ? lsp_ntree_steps(&header)
                         : walks_wide(header) ? lsp_wide_steps(&header)
                                              : 2 * uint64_t{header.node_count};
  if (header.max_steps > steps + kStepsSlack)
    LSP_HEADER_FINDING(kStepsBound, max_steps,
                       "is " + std::to_string(header.max_steps) + " for " +
                           std::to_string(walks_wide(header) ? header.wide_node_count : header.node_count) +
                           " nodes");
  // What a leaf's loop may run to, before anybody has looked at the leaf.
  const uint32_t most = is_ntree(header) ? header.reference_count : LSP_MAX_LEAF_TRIANGLES;
  if (header.max_leaf_triangles > most)
    LSP_HEADER_FINDING(
        kMaxLeaf, max_leaf_triangles,
        "is " + std::to_string(header.max_leaf_triangles) + ", the limit is " + std::to_string(most));
  if (header.section_count > kMaxSections)
    LSP_HEADER_FINDING(
        kSectionCount, section_count,
        "is " + std::to_string(header.section_count) + ", the limit is " + std::to_string(kMaxSections));
  if (header.node_count > kMaxNodes || header.wide_node_count > kMaxNodes ||
      header.triangle_count > LSP_LEAF_FIRST_MASK + 1 || header.line_space_count > kMaxLineSpaces ||
      header.reference_count >= LSP_LEAF_BIT)
    LSP_HEADER_FINDING(kAddressable, node_count,
                       std::to_string(std::max(header.node_count, header.wide_node_count)) + " nodes, " +
                           std::to_string(header.triangle_count) + " triangles, " +
                           std::to_string(header.reference_count) + " references and " +
                           std::to_string(header.line_space_count) +
                           " Line Spaces are more than references can name");
  if (header.resolution > LSP_MAX_RESOLUTION || (header.resolution == 0 && header.line_space_count != 0))
    LSP_HEADER_FINDING(kBakeParameters, resolution, "is " + std::to_string(header.resolution));
}

void check_numbers(const LspHeader& header, Report& report) {
  const lsp_float3 &lo = header.bounds_min, &hi = header.bounds_max;
  if (!finite(lo) || !finite(hi) || lo.x > hi.x || lo.y > hi.y || lo.z > hi.z)
    LSP_HEADER_FINDING(kBoundsNotFinite, bounds_min, "the bounds are not finite or inside out");
  if (!(header.normal_angle_cos >= -1.0f && header.normal_angle_cos <= 1.0f))
    LSP_HEADER_FINDING(kTolerances, normal_angle_cos, "is " + std::to_string(header.normal_angle_cos));
  if (!(header.plane_tolerance >= 0.0f && std::isfinite(header.plane_tolerance)))
    LSP_HEADER_FINDING(kTolerances, plane_tolerance, "is " + std::to_string(header.plane_tolerance));
  bool zero = header.reserved_0 == 0;
  for (uint32_t word : header.cells.reserved) zero = zero && word == 0;
  if (!zero) LSP_HEADER_FINDING(kReservedNotZero, reserved_0, "a reserved field is not zero");
}

void check_length(const FileView& view, Report& report) {
  const LspHeader& header = view.header;
  const uint64_t size = view.bytes.size();
  if (header.file_bytes > size)
    LSP_HEADER_FINDING(kTruncated, file_bytes,
                       "is " + std::to_string(header.file_bytes) + ", but the file ends after " +
                           std::to_string(size) + " bytes: copy it again");
  if (header.file_bytes < size)
    report.add(RuleId::kExtraBytes, header.file_bytes, size - header.file_bytes, "/file",
               std::to_string(size - header.file_bytes) + " bytes follow the " +
                   std::to_string(header.file_bytes) + " of the file");
  const uint64_t alignment = header.alignment;
  if (alignment != 256 && alignment != 4096 && alignment != 65536) {
    LSP_HEADER_FINDING(kAlignment, alignment, "is " + std::to_string(alignment));
  } else if (header.file_bytes % view.section_alignment() != 0) {
    LSP_HEADER_FINDING(kFileNotPadded, file_bytes,
                       "is " + std::to_string(header.file_bytes) + ", not a multiple of " +
                           std::to_string(view.section_alignment()));
  }
}

}  // namespace

void check_identification(const FileView& view, Report& report) {
  const LspHeader& header = view.header;
  if (text_damaged(view.bytes)) {
    report.add(RuleId::kTextDamage, 0, 8, "/header/magic_0",
               "the signature's line ends or high bit were changed by a transfer in text mode: copy it in "
               "binary mode");
    return;
  }
  if (view.bytes.size() < sizeof(LspHeader)) {
    report.add(RuleId::kTooShort, 0, view.bytes.size(), "/file",
               "has " + std::to_string(view.bytes.size()) + " bytes");
    return;
  }
  if (header.magic_0 != LSP_MAGIC_0 || header.magic_1 != LSP_MAGIC_1) {
    const bool part = header.magic_0 == LSP_MAGIC_0 && header.magic_1 == kPartMagic;
    report.add(RuleId::kBadMagic, 0, 8, "/header/magic_0",
               part ? "this is a part of a bake; lsp-merge makes an .lsp file of all parts"
                    : "this is not an .lsp file");
    return;
  }
  if (header.version_major != LSP_VERSION_MAJOR) {
    const bool older = header.version_major < LSP_VERSION_MAJOR;
    LSP_HEADER_FINDING(kOtherMajor, version_major,
                       "is " + std::to_string(header.version_major) + ": " +
                           (older ? "bake it again, it is older than what this program reads"
                                  : "use a program that knows this version"));
    return;
  }
  if (header.version_minor > LSP_VERSION_MINOR)
    LSP_HEADER_FINDING(kNewerMinor, version_minor, "is " + std::to_string(header.version_minor));
  if (const uint32_t unknown = header.required_features & ~LSP_FEATURES_KNOWN; unknown != 0)
    LSP_HEADER_FINDING(kUnknownRequired, required_features, "bits " + hex(unknown) + " are not known");
  if (header.optional_features != 0)
    LSP_HEADER_FINDING(kUnknownOptional, optional_features,
                       "bits " + hex(header.optional_features) + " are not known");
}

void check_header(const FileView& view, Report& report) {
  const LspHeader& header = view.header;
  if (header.header_bytes != sizeof(LspHeader))
    LSP_HEADER_FINDING(kHeaderBytes, header_bytes, "is " + std::to_string(header.header_bytes));
  if (header.section_table_offset != sizeof(LspHeader))
    LSP_HEADER_FINDING(kTableOffset, section_table_offset,
                       "is " + std::to_string(header.section_table_offset));
  else if (!in_range(header.section_table_offset, uint64_t{header.section_count} * sizeof(LspSection),
                     view.bytes.size()))
    LSP_HEADER_FINDING(kTableOutside, section_count,
                       std::to_string(header.section_count) + " table entries do not fit into " +
                           std::to_string(view.bytes.size()) + " bytes");
  check_length(view, report);
  check_statements(view, report);
}

void check_statements(const FileView& view, Report& report) {
  const LspHeader& header = view.header;
  check_base(header, report);
  check_limits(header, report);
  check_numbers(header, report);
  check_root(header, report);
  check_wide_nodes(header, report);
  if (!report.fatal()) check_features(header, view, report);
}

}  // namespace lsp::format
