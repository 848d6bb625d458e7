#include "fields.h"

#include <cstdio>
#include <cstring>
#include <stdexcept>
#include <string_view>
#include <type_traits>

#include "line_space.h"
#include "wide.h"

namespace lsp::format {
namespace {

template <class T>
constexpr FieldType field_type() {
  using Element = std::remove_all_extents_t<T>;
  if constexpr (std::is_same_v<Element, uint32_t>) return FieldType::kUint;
  if constexpr (std::is_same_v<Element, uint64_t>) return FieldType::kUint64;
  if constexpr (std::is_same_v<Element, float>) return FieldType::kFloat;
  if constexpr (std::is_same_v<Element, lsp_float3>) return FieldType::kVec3;
}

// clang-format off
#define LSP_FIELD(name) \
  Field{#name, field_type<decltype(Owner::name)>(), offsetof(Owner, name), sizeof(Owner::name)}
// clang-format on

template <class T>
struct Fields;

template <>
struct Fields<LspHeader> {
  using Owner = LspHeader;
  static constexpr Field list[] = {LSP_FIELD(magic_0),
                                   LSP_FIELD(magic_1),
                                   LSP_FIELD(version_major),
                                   LSP_FIELD(version_minor),
                                   LSP_FIELD(header_bytes),
                                   LSP_FIELD(section_count),
                                   LSP_FIELD(required_features),
                                   LSP_FIELD(optional_features),
                                   LSP_FIELD(file_bytes),
                                   LSP_FIELD(section_table_offset),
                                   LSP_FIELD(alignment),
                                   LSP_FIELD(base_structure),
                                   LSP_FIELD(primitive_count),
                                   LSP_FIELD(content_hash_lo),
                                   LSP_FIELD(content_hash_hi),
                                   LSP_FIELD(header_hash_lo),
                                   LSP_FIELD(header_hash_hi),
                                   LSP_FIELD(bounds_min),
                                   LSP_FIELD(normal_angle_cos),
                                   LSP_FIELD(bounds_max),
                                   LSP_FIELD(plane_tolerance),
                                   LSP_FIELD(root),
                                   LSP_FIELD(root_line_space),
                                   LSP_FIELD(node_count),
                                   LSP_FIELD(triangle_count),
                                   LSP_FIELD(line_space_count),
                                   LSP_FIELD(bit_word_count),
                                   LSP_FIELD(candidate_word_count),
                                   LSP_FIELD(material_count),
                                   LSP_FIELD(max_depth),
                                   LSP_FIELD(max_stack),
                                   LSP_FIELD(max_steps),
                                   LSP_FIELD(max_leaf_triangles),
                                   LSP_FIELD(resolution),
                                   LSP_FIELD(line_space_depth),
                                   LSP_FIELD(line_space_triangles),
                                   LSP_FIELD(ntree_branching),
                                   LSP_FIELD(ntree_depth),
                                   LSP_FIELD(reserved_0),
                                   LSP_FIELD(source_hash_lo),
                                   LSP_FIELD(source_hash_hi),
                                   LSP_FIELD(cell_count),
                                   LSP_FIELD(reference_count),
                                   LSP_FIELD(ntree_lo),
                                   LSP_FIELD(ntree_size),
                                   LSP_FIELD(ntree_margin),
                                   LSP_FIELD(quality_part),
                                   LSP_FIELD(cells.lo),
                                   LSP_FIELD(cells.size),
                                   LSP_FIELD(cells.cells_x),
                                   LSP_FIELD(cells.cells_y),
                                   LSP_FIELD(cells.cells_z),
                                   LSP_FIELD(cells.per_size),
                                   LSP_FIELD(cells.margin),
                                   LSP_FIELD(cells.box_step),
                                   LSP_FIELD(cells.far_patches),
                                   LSP_FIELD(cells.origin_patches),
                                   LSP_FIELD(cells.sub_cells),
                                   LSP_FIELD(cells.origin_entry_first),
                                   LSP_FIELD(cells.reserved),
                                   LSP_FIELD(origin_x),
                                   LSP_FIELD(origin_y),
                                   LSP_FIELD(origin_z),
                                   LSP_FIELD(filled_cell_count),
                                   LSP_FIELD(entry_word_count),
                                   LSP_FIELD(plane_count),
                                   LSP_FIELD(split_count),
                                   LSP_FIELD(cell_node_count),
                                   LSP_FIELD(cell_reference_count),
                                   LSP_FIELD(quality),
                                   LSP_FIELD(wide_node_count)};
};

template <>
struct Fields<LspSection> {
  using Owner = LspSection;
  static constexpr Field list[] = {LSP_FIELD(type),          LSP_FIELD(flags),         LSP_FIELD(offset),
                                   LSP_FIELD(stored_bytes),  LSP_FIELD(bytes),         LSP_FIELD(codec),
                                   LSP_FIELD(element_bytes), LSP_FIELD(element_count), LSP_FIELD(hash_lo),
                                   LSP_FIELD(hash_hi)};
};

template <>
struct Fields<LspNode> {
  using Owner = LspNode;
  static constexpr Field list[] = {LSP_FIELD(lo0), LSP_FIELD(child0), LSP_FIELD(hi0), LSP_FIELD(line_space0),
                                   LSP_FIELD(lo1), LSP_FIELD(child1), LSP_FIELD(hi1), LSP_FIELD(line_space1)};
};

template <>
struct Fields<LspWideNode> {
  using Owner = LspWideNode;
  static constexpr Field list[] = {LSP_FIELD(lo),       LSP_FIELD(node_first),
                                   LSP_FIELD(step),     LSP_FIELD(triangle_first),
                                   LSP_FIELD(children), LSP_FIELD(planes)};
};

template <>
struct Fields<LspCell> {
  using Owner = LspCell;
  static constexpr Field list[] = {LSP_FIELD(child), LSP_FIELD(count), LSP_FIELD(line_space)};
};

template <>
struct Fields<LspTriangle> {
  using Owner = LspTriangle;
  static constexpr Field list[] = {LSP_FIELD(v0),       LSP_FIELD(primitive), LSP_FIELD(v1),
                                   LSP_FIELD(material), LSP_FIELD(v2),        LSP_FIELD(flags)};
};

template <>
struct Fields<LspCornerNormals> {
  using Owner = LspCornerNormals;
  static constexpr Field list[] = {LSP_FIELD(n0), LSP_FIELD(n1), LSP_FIELD(n2)};
};

template <>
struct Fields<LspMaterial> {
  using Owner = LspMaterial;
  static constexpr Field list[] = {LSP_FIELD(base_color), LSP_FIELD(opacity),  LSP_FIELD(emission),
                                   LSP_FIELD(roughness),  LSP_FIELD(metallic), LSP_FIELD(reserved)};
};

template <>
struct Fields<LspLineSpace> {
  using Owner = LspLineSpace;
  static constexpr Field list[] = {LSP_FIELD(lo),
                                   LSP_FIELD(word_first),
                                   LSP_FIELD(hi),
                                   LSP_FIELD(candidate_first),
                                   LSP_FIELD(scale),
                                   LSP_FIELD(triangle_first),
                                   LSP_FIELD(format),
                                   LSP_FIELD(filled),
                                   LSP_FIELD(triangle_count),
                                   LSP_FIELD(child)};
};

template <>
struct Fields<LspBitWord> {
  using Owner = LspBitWord;
  static constexpr Field list[] = {LSP_FIELD(bits), LSP_FIELD(offset)};
};

template <>
struct Fields<LspFilledCell> {
  using Owner = LspFilledCell;
  static constexpr Field list[] = {LSP_FIELD(sub_mask_lo), LSP_FIELD(sub_mask_hi),     LSP_FIELD(sub_first),
                                   LSP_FIELD(closed),      LSP_FIELD(plane_first),     LSP_FIELD(plane_count),
                                   LSP_FIELD(split_first), LSP_FIELD(split_count),     LSP_FIELD(root),
                                   LSP_FIELD(node_first),  LSP_FIELD(reference_first), LSP_FIELD(max_steps)};
};

template <>
struct Fields<LspPlane> {
  using Owner = LspPlane;
  static constexpr Field list[] = {LSP_FIELD(normal), LSP_FIELD(distance)};
};

template <>
struct Fields<LspSplit> {
  using Owner = LspSplit;
  static constexpr Field list[] = {LSP_FIELD(answers), LSP_FIELD(weights)};
};

template <>
struct Fields<LspCellNode> {
  using Owner = LspCellNode;
  static constexpr Field list[] = {LSP_FIELD(box_0), LSP_FIELD(box_1), LSP_FIELD(box_2), LSP_FIELD(children)};
};

// Every byte of a struct belongs to one field: the table forgets none.
template <class T>
constexpr Struct describe(const char* name) {
  return {name, sizeof(T), Fields<T>::list};
}
template <class T>
constexpr bool complete() {
  uint32_t at = 0;
  for (const Field& field : Fields<T>::list) {
    if (field.offset != at) return false;
    at += field.bytes;
  }
  return at == sizeof(T);
}
constexpr Struct kStructs[] = {
    describe<LspHeader>("LspHeader"),     describe<LspSection>("LspSection"),
    describe<LspNode>("LspNode"),         describe<LspCell>("LspCell"),
    describe<LspTriangle>("LspTriangle"), describe<LspCornerNormals>("LspCornerNormals"),
    describe<LspMaterial>("LspMaterial"), describe<LspLineSpace>("LspLineSpace"),
    describe<LspBitWord>("LspBitWord"),   describe<LspFilledCell>("LspFilledCell"),
    describe<LspPlane>("LspPlane"),       describe<LspSplit>("LspSplit"),
    describe<LspCellNode>("LspCellNode"), describe<LspWideNode>("LspWideNode"),
};

constexpr const Struct* find_struct(std::string_view name) {
  for (const Struct& candidate : kStructs)
    if (candidate.name == name) return &candidate;
  return nullptr;
}

template <class T>
constexpr bool described(const char* name) {
  if constexpr (std::is_same_v<T, uint32_t>)
    return true;  // a word has no fields
  else
    return find_struct(name) != nullptr && complete<T>();
}
static_assert(described<LspHeader>("LspHeader") && described<LspSection>("LspSection"));
#define LSP_ARRAY_SECTION(Name, TYPE, code, Element, ...) static_assert(described<Element>(#Element));
#include "lsp/sections.def"

template <class T>
T load(const std::byte* bytes) {
  T value;
  std::memcpy(&value, bytes, sizeof value);
  return value;
}

std::string number(float value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.9g", static_cast<double>(value));
  return text;
}

std::string hex(uint64_t value, int digits) {
  char text[24];
  std::snprintf(text, sizeof text, "0x%0*llX", digits, static_cast<unsigned long long>(value));
  return text;
}

std::string child_text(uint32_t value, bool ntree) {
  if (value == LSP_NONE) return "none";
  if (!(value & LSP_LEAF_BIT)) return "node " + std::to_string(value);
  if (ntree) return "leaf from " + std::to_string(value & ~LSP_LEAF_BIT);
  const uint32_t count = (value >> LSP_LEAF_COUNT_SHIFT & LSP_LEAF_COUNT_MASK) + 1;
  return "leaf of " + std::to_string(count) + " from " + std::to_string(value & LSP_LEAF_FIRST_MASK);
}

std::string line_space_text(uint32_t value) {
  if (value == LSP_NONE) return "none";
  return std::to_string(value & LSP_LINE_SPACE_MASK) + (value & LSP_TERMINAL_BIT ? " terminal" : "");
}

std::string format_text(uint32_t value) {
  const LineSpaceShape shape = shape_of(value);
  return "N " + std::to_string(shape.resolution) + ", " + std::to_string(shape.entry_bytes) +
         " bytes an entry" + (shape.dense ? ", dense" : "") + (shape.symmetric ? ", symmetric" : "");
}

// The children of a wide node.
std::string wide_children_text(const std::byte* bytes) {
  std::string text;
  for (uint32_t k = 0; k < LSP_WIDE_CHILDREN; ++k) {
    const uint32_t child = load<uint16_t>(bytes + 2 * k);
    text += k == 0 ? "" : "; ";
    if (child == LSP_WIDE_NO_CHILD)
      text += "none";
    else if (child & LSP_WIDE_NODE_BIT)
      text += "node +" + std::to_string(child & ~LSP_WIDE_NODE_BIT);
    else
      text += "leaf of " + std::to_string(wide_leaf_count(child)) + " from +" +
              std::to_string(wide_leaf_first(child));
  }
  return text;
}

std::string uint_text(std::string_view name, uint32_t value, bool ntree) {
  if (name == "child" || name == "child0" || name == "child1" || name == "root")
    return child_text(value, ntree);
  if (name == "line_space" || name == "line_space0" || name == "line_space1" || name == "root_line_space")
    return line_space_text(value);
  if (name == "format") return format_text(value);
  if (name == "type") return type_name(value);
  if (name.starts_with("magic") || name.ends_with("features") || name == "bits" || name == "children" ||
      name == "planes" || name == "n0" || name == "n1" || name == "n2")
    return hex(value, 8);
  if (name == "codec")
    return value == LSP_CODEC_NONE ? "none" : value == LSP_CODEC_ZSTD ? "zstd" : std::to_string(value);
  return std::to_string(value);
}

}  // namespace

uint32_t Field::count() const {
  switch (type) {
    case FieldType::kUint64:
      return bytes / 8;
    case FieldType::kVec3:
      return bytes / 12;
    default:
      return bytes / 4;
  }
}

std::span<const Struct> structs() { return kStructs; }

const Struct& struct_named(const char* name) {
  if (const Struct* found = find_struct(name)) return *found;
  throw std::logic_error("no such struct");
}

const Struct* element_struct(Kind kind) { return find_struct(info(kind).element); }
bool is_words(Kind kind) { return std::string_view(info(kind).element) == "uint32_t"; }

std::string value_text(const Field& field, const std::byte* bytes, bool ntree) {
  if (field.count() == LSP_WIDE_CHILDREN / 2 && std::string_view(field.name) == "children")
    return wide_children_text(bytes + field.offset);
  std::string text;
  const uint32_t size = field.bytes / field.count();
  for (uint32_t i = 0; i < field.count(); ++i) {
    const std::byte* at = bytes + field.offset + i * size;
    if (i != 0) text += " ";
    switch (field.type) {
      case FieldType::kUint:
        text += uint_text(field.name, load<uint32_t>(at), ntree);
        break;
      case FieldType::kUint64: {
        const bool hash = std::string_view(field.name).find("hash") != std::string_view::npos;
        const uint64_t value = load<uint64_t>(at);
        text += hash ? hex(value, 16) : std::to_string(value);
        break;
      }
      case FieldType::kFloat:
        text += number(load<float>(at));
        break;
      case FieldType::kVec3:
        text += '(';
        text += number(load<float>(at)).append(", ");
        text += number(load<float>(at + 4)).append(", ");
        text += number(load<float>(at + 8)).append(")");
        break;
    }
  }
  return text;
}

}  // namespace lsp::format
