// Makes C++ read lsp/traverse.h: the GLSL names it uses, and access to a scene's arrays. The text is then
// included in a struct within a namespace that uses lsp::subset.
//
// Every array access is checked against the header's counts, which lsp_open has checked against the file: a
// bad index reads a zero element.
#pragma once

#include <bit>
#include <cmath>
#include <cstdint>
#include <glm/glm.hpp>

#include "lsp/lsp.h"

#if defined(LSP_INSTRUMENTED) || defined(__SANITIZE_ADDRESS__) || !defined(__OPTIMIZE__)
#define LSP_INLINE  // inlined and instrumented, or not optimised, the loops take long to compile
#else
#define LSP_INLINE __attribute__((always_inline))
#endif
#define LSP_FN static inline LSP_INLINE
// A function that most rays call once or twice: better not inlined into the loop.
#define LSP_FN_RARE static __attribute__((noinline))
#define LSP_STEP inline LSP_INLINE
#define LSP_STACK_SIZE LSP_MAX_STACK

namespace lsp::subset {

using glm::ivec3;
using glm::uvec2;
using glm::uvec4;
using glm::vec2;
using glm::vec3;
using glm::vec4;
using uint = uint32_t;
using LspScene = const lsp_scene&;

inline vec3 lsp_vec3(const lsp_float3& v) { return {v.x, v.y, v.z}; }
inline lsp_float3 lsp_float3_of(const vec3& v) { return {v.x, v.y, v.z}; }
inline uint floatBitsToUint(float x) { return std::bit_cast<uint>(x); }
inline float uintBitsToFloat(uint x) { return std::bit_cast<float>(x); }
inline int findLSB(uint x) { return x == 0 ? -1 : std::countr_zero(x); }
inline int bitCount(uint x) { return std::popcount(x); }
inline float abs(float x) { return std::fabs(x); }
inline vec3 abs(const vec3& v) { return {std::fabs(v.x), std::fabs(v.y), std::fabs(v.z)}; }
inline float floor(float x) { return std::floor(x); }
inline float sqrt(float x) { return std::sqrt(x); }

template <typename T>
LSP_INLINE inline const T& at(const T* array, uint index, uint count) {
  static const T zero{};
  return index < count ? array[index] : zero;
}

LSP_INLINE inline const LspHeader& lsp_load_header(LspScene scene) { return *scene.header; }
LSP_INLINE inline bool lsp_has_normals(LspScene scene) { return scene.normals != nullptr; }
LSP_INLINE inline const LspNode& lsp_load_node(LspScene scene, uint i) {
  return at(scene.nodes, i, scene.header->node_count);
}
LSP_INLINE inline const LspTriangle& lsp_load_triangle(LspScene scene, uint i) {
  return at(scene.triangles, i, scene.header->triangle_count);
}
LSP_INLINE inline const LspCornerNormals& lsp_load_normals(LspScene scene, uint i) {
  return at(scene.normals, i, scene.header->triangle_count);
}
LSP_INLINE inline const LspLineSpace& lsp_load_line_space(LspScene scene, uint i) {
  return at(scene.line_spaces, i, scene.header->line_space_count);
}
LSP_INLINE inline const LspBitWord& lsp_load_bit_word(LspScene scene, uint i) {
  return at(scene.bit_words, i, scene.header->bit_word_count);
}
LSP_INLINE inline uint lsp_load_candidate(LspScene scene, uint i) {
  return at(scene.candidates, i, scene.header->candidate_word_count);
}
LSP_INLINE inline const LspBitWord& lsp_load_grid(LspScene scene, uint i) {
  return at(scene.grid, i, scene.header->node_count * LSP_GRID_WORDS(scene.header->ntree_branching));
}
LSP_INLINE inline const LspCell& lsp_load_cell(LspScene scene, uint i) {
  return at(scene.cells, i, scene.header->cell_count);
}
LSP_INLINE inline uint lsp_load_reference(LspScene scene, uint i) {
  return at(scene.references, i, scene.header->reference_count);
}

LSP_FN uint lsp_load_cell_word(LspScene scene, uint i) {
  const LspCellGrid& grid = scene.header->cells;
  return at(scene.cell_words, i, grid.cells_x * grid.cells_y * grid.cells_z);
}
LSP_FN uint lsp_load_entry(LspScene scene, uint i) {
  return at(scene.entries, i >> 1u, scene.header->entry_word_count) >> ((i & 1u) * 16u) & 0xFFFFu;
}
// Of a filled cell, which a shader reads in parts: its origin tables, its answers, its tree.
LSP_FN const LspFilledCell& lsp_load_cell_origins(LspScene scene, uint i) {
  return at(scene.filled_cells, i, scene.header->filled_cell_count);
}
LSP_FN const LspFilledCell& lsp_load_cell_answers(LspScene scene, uint i) {
  return lsp_load_cell_origins(scene, i);
}
LSP_FN const LspFilledCell& lsp_load_cell_tree(LspScene scene, uint i) {
  return lsp_load_cell_origins(scene, i);
}
LSP_FN const LspSplit& lsp_load_split(LspScene scene, uint i) {
  return at(scene.splits, i, scene.header->split_count);
}
LSP_FN const LspPlane& lsp_load_plane(LspScene scene, uint i) {
  return at(scene.planes, i, scene.header->plane_count);
}
LSP_FN uint lsp_load_plane_record(LspScene scene, uint i) {
  return at(scene.plane_records, i, scene.header->plane_count);
}
LSP_FN const LspCellNode& lsp_load_cell_node(LspScene scene, uint i) {
  return at(scene.cell_nodes, i, scene.header->cell_node_count);
}
LSP_FN uint lsp_load_cell_reference(LspScene scene, uint i) {
  return at(scene.cell_references, i, scene.header->cell_reference_count);
}

LSP_FN const LspWideNode& lsp_load_wide_node(LspScene scene, uint i) {
  return at(scene.wide_nodes, i, scene.header->wide_node_count);
}
// Of a wide node what names one of its children.
struct LspWideChild {
  uint node_first;
  uint triangle_first;
  uint bits;
};
LSP_FN LspWideChild lsp_load_wide_child(LspScene scene, uint i, uint number) {
  const LspWideNode& node = lsp_load_wide_node(scene, i);
  return {node.node_first, node.triangle_first,
          node.children[number >> 1u] >> ((number & 1u) * 16u) & 0xFFFFu};
}

// Asks for an element that is read later. It need not be there.
template <typename T>
LSP_INLINE inline void fetch(const T* array, uint64_t index) {
  const uintptr_t first = reinterpret_cast<uintptr_t>(array) + index * sizeof(T);
  __builtin_prefetch(reinterpret_cast<const void*>(first));
  if (64 % sizeof(T) != 0) __builtin_prefetch(reinterpret_cast<const void*>(first + sizeof(T) - 1));
}

// Exact rays, which are traced one after the other, would not have the time to wait for it.
LSP_INLINE inline void lsp_fetch_node(LspScene scene, uint flags, uint i) {
  if ((flags & LSP_TRACE_APPROXIMATE) != 0u) fetch(scene.nodes, i);
}

}  // namespace lsp::subset
