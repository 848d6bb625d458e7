// Small .lsp files made by hand, for tests of what reads them. Nothing of the baker or the library is used,
// so that a fault of theirs is not hidden by its twin here.
#pragma once

#include <cstdint>
#include <cstdlib>
#include <new>
#include <string>
#include <vector>

#include "lsp/sections.h"

namespace lsp::test {

// Bytes at a multiple of 65536, as a mapping has them.
template <class T>
struct PageAllocator {
  using value_type = T;
  static constexpr std::align_val_t kAlignment{65536};
  PageAllocator() = default;
  template <class U>
  PageAllocator(const PageAllocator<U>&) {}
  T* allocate(size_t count) { return static_cast<T*>(::operator new(count * sizeof(T), kAlignment)); }
  void deallocate(T* pointer, size_t) { ::operator delete(pointer, kAlignment); }
  bool operator==(const PageAllocator&) const { return true; }
};
using Bytes = std::vector<unsigned char, PageAllocator<unsigned char>>;

// The sections of a file and a header that fits them.
struct Parts {
  LspHeader header{};
#define LSP_ARRAY_SECTION(Name, TYPE, code, Element, flag, base, feature, owed, member, ...) \
  std::vector<Element> member;
#include "lsp/sections.def"
  std::string meta = "{}";
};

struct BuildOptions {
  uint32_t triangles = 300;
  uint32_t seed = 1;
  bool exact = true;
  bool line_spaces = true;
  bool normals = true;
  bool materials = true;
  uint32_t resolution = 4;
  uint32_t line_space_depth = 4;  // terminal Line Spaces are here; others at half this depth
  uint32_t leaf_triangles = 4;
  uint32_t alignment = 4096;
  float scale = 1;  // the soup lies in a cube of twice this size
};

// A soup of triangles, some of them exactly in planes of an axis, under a median-split tree. Its Line Spaces
// have arbitrary bits and candidates: nothing one would bake, but every entry in range.
Parts build_parts(const BuildOptions& options);

// `triangles` triangles one behind the other along x, a unit apart. A ray along the axis passes every box and
// misses every triangle but the last: the longest traversal there can be.
Parts build_stack_of_sheets(uint32_t triangles, uint32_t leaf_triangles);

// The file: sections in order at multiples of the header's alignment, hashes right.
Bytes write_raw(const Parts& parts);
// The same with every section but META compressed, at multiples of 256.
Bytes write_packed(const Parts& parts);

// Makes the header's hash right again after a change of header or section table.
void repair_header_hash(Bytes& bytes);

inline LspHeader& header_of(Bytes& bytes) { return *reinterpret_cast<LspHeader*>(bytes.data()); }
inline LspSection* sections_of(Bytes& bytes) {
  return reinterpret_cast<LspSection*>(bytes.data() + sizeof(LspHeader));
}
LspSection& section_of(Bytes& bytes, uint32_t type);

// A small generator, the same everywhere (PCG, O'Neill 2014).
class Random {
 public:
  explicit Random(uint64_t seed) : state_(seed * 0x9E3779B97F4A7C15ull + 1) {}
  uint32_t next();
  float uniform() { return static_cast<float>(next() >> 8) * 0x1p-24f; }  // [0, 1)
  float between(float lo, float hi) { return lo + (hi - lo) * uniform(); }
  uint32_t below(uint32_t count) { return static_cast<uint32_t>((uint64_t{next()} * count) >> 32); }

 private:
  uint64_t state_;
};

}  // namespace lsp::test
