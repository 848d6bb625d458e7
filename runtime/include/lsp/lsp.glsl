/* Traces rays against an .lsp scene in a shader.
 *
 *   #version 460
 *   #extension GL_GOOGLE_include_directive : require
 *   #define LSP_SET 0                // descriptor set of the scene's buffers, default 0
 *   #define LSP_FIRST_BINDING 0      // binding of the header; the others follow it, default 0
 *   #define LSP_NTREE                // the scene's base structure is an NTree, not a BVH
 *   #include "lsp/lsp.glsl"
 *
 *   LspHit hit = lsp_trace(ray, LSP_TRACE_APPROXIMATE_BIT, 0.0);
 *
 * Bindings, each a read-only storage buffer, all from the file as it lies on disk:
 *   +0 header   +1 NODE   +2 TRIA   +3 NRML   +4 LSPC   +5 BITS   +6 CAND
 * and of an NTree
 *   +1 GRID   +7 CELL   +8 REFS
 * A section the file does not have is bound to any buffer (the header's, say): it is not read.
 *
 * The stack lives in LSP_STACK_SIZE entries of 8 bytes: define it as header.max_stack, or leave it to the
 * specialization constant LSP_STACK_CONSTANT_ID (default 0), whose default is LSP_MAX_STACK.
 *
 * What few scenes need (LSP_PART_* of lsp/parts.h) is left out where it is not asked for: define LSP_PARTS, or
 * LSP_PARTS_CONSTANT_ID as the number of a specialization constant, whose default is everything;
 * lsp_vulkan_parts of lsp/lsp_vulkan.h says what a scene needs. The device
 * should have robustBufferAccess on when files are not known to be valid.
 */
#ifndef LSP_GLSL
#define LSP_GLSL

#include "lsp/layout.h"

#ifndef LSP_SET
#define LSP_SET 0
#endif
#ifndef LSP_FIRST_BINDING
#define LSP_FIRST_BINDING 0
#endif
#ifndef LSP_STACK_SIZE
#ifndef LSP_STACK_CONSTANT_ID
#define LSP_STACK_CONSTANT_ID 0
#endif
layout(constant_id = LSP_STACK_CONSTANT_ID) const uint lsp_stack_size = LSP_MAX_STACK;
#define LSP_STACK_SIZE lsp_stack_size
#endif

#ifdef LSP_PARTS_CONSTANT_ID
layout(constant_id = LSP_PARTS_CONSTANT_ID) const uint lsp_parts = 0xFFFFFFFFu;
#define LSP_PARTS lsp_parts
#endif

/* Arrays are read 16 bytes at a time, which is faster than member by member; the functions below put the
 * words into the structs of layout.h. */
layout(std430, set = LSP_SET, binding = LSP_FIRST_BINDING + 0) readonly buffer LspHeaderBuffer { LspHeader lsp_header; };
#ifdef LSP_NTREE
layout(std430, set = LSP_SET, binding = LSP_FIRST_BINDING + 1) readonly buffer LspGridBuffer { uvec2 lsp_grid_words[]; };
layout(std430, set = LSP_SET, binding = LSP_FIRST_BINDING + 7) readonly buffer LspCellBuffer { LspCell lsp_cells[]; };
layout(std430, set = LSP_SET, binding = LSP_FIRST_BINDING + 8) readonly buffer LspReferenceBuffer { uint lsp_references[]; };
#else
layout(std430, set = LSP_SET, binding = LSP_FIRST_BINDING + 1) readonly buffer LspNodeBuffer { uvec4 lsp_node_words[]; };
#endif
layout(std430, set = LSP_SET, binding = LSP_FIRST_BINDING + 2) readonly buffer LspTriangleBuffer { uvec4 lsp_triangle_words[]; };
layout(std430, set = LSP_SET, binding = LSP_FIRST_BINDING + 3) readonly buffer LspNormalBuffer { LspCornerNormals lsp_corner_normals[]; };
layout(std430, set = LSP_SET, binding = LSP_FIRST_BINDING + 4) readonly buffer LspLineSpaceBuffer { uvec4 lsp_line_space_words[]; };
layout(std430, set = LSP_SET, binding = LSP_FIRST_BINDING + 5) readonly buffer LspBitWordBuffer { uvec2 lsp_bit_words[]; };
layout(std430, set = LSP_SET, binding = LSP_FIRST_BINDING + 6) readonly buffer LspCandidateBuffer { uint lsp_candidate_words[]; };

#define LSP_FN
#define LSP_IN(T) T
#define LSP_OUT(T) out T
#define LSP_INOUT(T) inout T
#define LSP_PRECISE precise
#define LSP_SCENE_
#define LSP_SCENE_ARG_
#define LSP_LOAD3(v) (v)
#define LSP_STORE3(v) (v)
#define LSP_HEADER lsp_header
#define LSP_HAS_NORMALS ((lsp_header.required_features & LSP_FEATURE_NORMALS) != 0u)
#define LSP_TRIANGLE(i) lsp_load_triangle(i)
#define LSP_NORMALS(i) lsp_corner_normals[i]
#define LSP_LINE_SPACE(i) lsp_load_line_space(i)
#define LSP_BIT_WORD(i) lsp_load_bit_word(i)
#define LSP_CANDIDATE(i) lsp_candidate_words[i]

#ifdef LSP_NTREE
#define LSP_GRID(i) lsp_load_grid(i)
#define LSP_CELL(i) lsp_cells[i]
#define LSP_REFERENCE(i) lsp_references[i]

LspBitWord lsp_load_grid(uint i) {
  uvec2 w = lsp_grid_words[i];
  return LspBitWord(w.x, w.y);
}
#else
#define LSP_NODE(i) lsp_load_node(i)

LspNode lsp_load_node(uint i) {
  uvec4 a = lsp_node_words[4u * i];
  uvec4 b = lsp_node_words[4u * i + 1u];
  uvec4 c = lsp_node_words[4u * i + 2u];
  uvec4 d = lsp_node_words[4u * i + 3u];
  return LspNode(uintBitsToFloat(a.xyz), a.w, uintBitsToFloat(b.xyz), b.w, uintBitsToFloat(c.xyz), c.w,
                 uintBitsToFloat(d.xyz), d.w);
}
#endif

LspTriangle lsp_load_triangle(uint i) {
  uvec4 a = lsp_triangle_words[3u * i];
  uvec4 b = lsp_triangle_words[3u * i + 1u];
  uvec4 c = lsp_triangle_words[3u * i + 2u];
  return LspTriangle(uintBitsToFloat(a.xyz), a.w, uintBitsToFloat(b.xyz), b.w, uintBitsToFloat(c.xyz), c.w);
}

LspLineSpace lsp_load_line_space(uint i) {
  uvec4 a = lsp_line_space_words[4u * i];
  uvec4 b = lsp_line_space_words[4u * i + 1u];
  uvec4 c = lsp_line_space_words[4u * i + 2u];
  uvec4 d = lsp_line_space_words[4u * i + 3u];
  return LspLineSpace(uintBitsToFloat(a.xyz), a.w, uintBitsToFloat(b.xyz), b.w, uintBitsToFloat(c.xyz), c.w, d.x,
                      d.y, d.z, d.w);
}

LspBitWord lsp_load_bit_word(uint i) {
  uvec2 w = lsp_bit_words[i];
  return LspBitWord(w.x, w.y);
}

/* With LSP_COUNT defined, lsp_trace_ray takes an inout LspCounts after `valid`. */
#ifdef LSP_COUNT
#define LSP_COUNTS_PARAM , inout LspCounts counts
#define LSP_COUNTS_ARG , counts
#else
#define LSP_COUNTS_PARAM
#define LSP_COUNTS_ARG
#endif

#include "lsp/traverse.h"

#ifndef LSP_COUNT
/* flags: LSP_TRACE_*_BIT; lod: stop at a Line Space once its diagonal is under lod * distance, 0: deepest. */
LspHit lsp_trace(LspRay ray, uint flags, float lod) {
  bool valid;
  return lsp_trace_ray(ray, flags, lod, valid);
}
#endif

#endif
