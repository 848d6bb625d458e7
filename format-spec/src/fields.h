// The structs of the layout as data: what annotates, dumps and tests them reads this table instead of
// repeating it. Offsets and sizes are the compiler's own, from layout.h.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

#include "view.h"

namespace lsp::format {

enum class FieldType { kUint, kUint64, kFloat, kVec3 };

struct Field {
  const char* name;
  FieldType type;
  uint32_t offset;
  uint32_t bytes;          // of all elements where the field is an array
  uint32_t count() const;  // of elements: 1, or the length of an array
};

struct Struct {
  const char* name;  // "LspNode"
  uint32_t bytes;
  std::span<const Field> fields;
};

// All structs of layout.h.
std::span<const Struct> structs();
const Struct& struct_named(const char* name);

// The struct of a section's element; null where elements are words or characters.
const Struct* element_struct(Kind kind);
bool is_words(Kind kind);

// The field's value in a struct at `bytes`: "12", "0x80000003", "(0, 1, 2.5)". References, formats and types
// are given with their meaning, child references with that of the tree.
std::string value_text(const Field& field, const std::byte* bytes, bool ntree = false);

}  // namespace lsp::format
