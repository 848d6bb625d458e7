// Makes C++ read lsp/traverse.h: the GLSL names it uses, and access to a scene's arrays.
//
// Included once per variant inside a namespace, with LSP_COUNT defined or not. Every array access is checked
// against the header's counts, which lsp_open has checked against the file: a bad index reads a zero element.
#include <bit>
#include <cmath>
#include <cstdint>
#include <glm/glm.hpp>

#include "lsp/lsp.h"

namespace lsp::subset {

using glm::ivec3;
using glm::uvec4;
using glm::vec2;
using glm::vec3;
using uint = uint32_t;

inline vec3 load3(const lsp_float3& v) { return {v.x, v.y, v.z}; }
inline lsp_float3 store3(const vec3& v) { return {v.x, v.y, v.z}; }
inline uint floatBitsToUint(float x) { return std::bit_cast<uint>(x); }
inline float uintBitsToFloat(uint x) { return std::bit_cast<float>(x); }
inline int findLSB(uint x) { return x == 0 ? -1 : std::countr_zero(x); }
inline int bitCount(uint x) { return std::popcount(x); }
inline float abs(float x) { return std::fabs(x); }
inline vec3 abs(const vec3& v) { return {std::fabs(v.x), std::fabs(v.y), std::fabs(v.z)}; }
inline float sqrt(float x) { return std::sqrt(x); }

template <typename T>
inline const T& at(const T* array, uint index, uint count) {
  static const T zero{};
  return index < count ? array[index] : zero;
}

}  // namespace lsp::subset

#ifdef __SANITIZE_ADDRESS__
#define LSP_INLINE  // inlined and instrumented, sixteen loops take minutes to compile
#define LSP_FN [[maybe_unused]] static
#else
#define LSP_INLINE __attribute__((always_inline))
#define LSP_FN static inline LSP_INLINE
#endif
#define LSP_FN_RARE [[maybe_unused]] static __attribute__((noinline))
#define LSP_SPLIT_FAR
#define LSP_IN(T) const T&
#define LSP_OUT(T) T&
#define LSP_INOUT(T) T&
#define LSP_PRECISE
#define LSP_SCENE_ const lsp_scene &scene,
#define LSP_SCENE_ARG_ scene,
#define LSP_LOAD3(v) load3(v)
#define LSP_STORE3(v) store3(v)
#define LSP_HEADER (*scene.header)
#define LSP_NODE(i) at(scene.nodes, i, scene.header->node_count)
#define LSP_TRIANGLE(i) at(scene.triangles, i, scene.header->triangle_count)
#define LSP_NORMALS(i) at(scene.normals, i, scene.header->triangle_count)
#define LSP_LINE_SPACE(i) at(scene.line_spaces, i, scene.header->line_space_count)
#define LSP_BIT_WORD(i) at(scene.bit_words, i, scene.header->bit_word_count)
#define LSP_CANDIDATE(i) at(scene.candidates, i, scene.header->candidate_word_count)
#define LSP_GRID(i) at(scene.grid, i, scene.header->node_count* LSP_GRID_WORDS(scene.header->ntree_branching))
#define LSP_CELL(i) at(scene.cells, i, scene.header->cell_count)
#define LSP_REFERENCE(i) at(scene.references, i, scene.header->reference_count)
#define LSP_HAS_NORMALS (scene.normals != nullptr)
#define LSP_STACK_SIZE LSP_MAX_STACK
