/* lsp.glsl for scenes with a section larger than the device's maxStorageBufferRange: the sections are read
 * through buffer device addresses, which have no such limit (and were about half as fast on lavapipe).
 *
 *   #version 460
 *   #extension GL_GOOGLE_include_directive : require
 *   #extension GL_EXT_buffer_reference : require
 *   #extension GL_EXT_buffer_reference_uvec2 : require
 *   #include "lsp/lsp_addresses.glsl"
 *
 * Binding +0 is the header as in lsp.glsl; +1 is a storage buffer of eight 64-bit addresses, those of the sections
 * of bindings +1 to +8 there (lsp_vulkan_address_table writes it). Nothing else differs.
 *
 * No robustBufferAccess watches over addresses, so every index is checked against the header's counts here,
 * which lsp_open has checked against the file: a bad index reads zeros, as on the CPU.
 */
#ifndef LSP_ADDRESSES_GLSL
#define LSP_ADDRESSES_GLSL

#include "lsp/layout.h"

/* lsp.glsl is taken without the traversal, which follows below with accessors of its own. */
#ifndef LSP_COUNT
LspHit lsp_trace_ray(LspRay ray, uint flags, float lod, out bool valid);
#endif
#define LSP_TRAVERSE_H
#include "lsp/lsp.glsl"
#undef LSP_TRAVERSE_H

layout(buffer_reference, std430, buffer_reference_align = 16) readonly buffer LspWords4 { uvec4 at[]; };
layout(buffer_reference, std430, buffer_reference_align = 8) readonly buffer LspWords2 { uvec2 at[]; };
layout(buffer_reference, std430, buffer_reference_align = 4) readonly buffer LspWords { uint at[]; };

layout(std430, set = LSP_SET, binding = LSP_FIRST_BINDING + 1) readonly buffer LspAddressBuffer {
  uvec2 lsp_addresses[8]; /* NODE or GRID, TRIA, NRML, LSPC, BITS, CAND, CELL, REFS */
};

#ifdef LSP_NTREE
LspBitWord lsp_fetch_grid(uint i) {
  uint count = lsp_header.node_count * LSP_GRID_WORDS(lsp_header.ntree_branching);
  if (i >= count) return LspBitWord(0u, 0u);
  uvec2 w = LspWords2(lsp_addresses[0]).at[i];
  return LspBitWord(w.x, w.y);
}

LspCell lsp_fetch_cell(uint i) {
  if (i >= lsp_header.cell_count) return LspCell(0u, 0u, 0u);
  LspWords words = LspWords(lsp_addresses[6]);
  return LspCell(words.at[3u * i], words.at[3u * i + 1u], words.at[3u * i + 2u]);
}

uint lsp_fetch_reference(uint i) {
  return i < lsp_header.reference_count ? LspWords(lsp_addresses[7]).at[i] : 0u;
}

#undef LSP_GRID
#undef LSP_CELL
#undef LSP_REFERENCE
#define LSP_GRID(i) lsp_fetch_grid(i)
#define LSP_CELL(i) lsp_fetch_cell(i)
#define LSP_REFERENCE(i) lsp_fetch_reference(i)
#else
LspNode lsp_fetch_node(uint i) {
  if (i >= lsp_header.node_count) return LspNode(vec3(0.0), 0u, vec3(0.0), 0u, vec3(0.0), 0u, vec3(0.0), 0u);
  LspWords4 words = LspWords4(lsp_addresses[0]);
  uvec4 a = words.at[4u * i];
  uvec4 b = words.at[4u * i + 1u];
  uvec4 c = words.at[4u * i + 2u];
  uvec4 d = words.at[4u * i + 3u];
  return LspNode(uintBitsToFloat(a.xyz), a.w, uintBitsToFloat(b.xyz), b.w, uintBitsToFloat(c.xyz), c.w,
                 uintBitsToFloat(d.xyz), d.w);
}

#undef LSP_NODE
#define LSP_NODE(i) lsp_fetch_node(i)
#endif

LspTriangle lsp_fetch_triangle(uint i) {
  if (i >= lsp_header.triangle_count) return LspTriangle(vec3(0.0), 0u, vec3(0.0), 0u, vec3(0.0), 0u);
  LspWords4 words = LspWords4(lsp_addresses[1]);
  uvec4 a = words.at[3u * i];
  uvec4 b = words.at[3u * i + 1u];
  uvec4 c = words.at[3u * i + 2u];
  return LspTriangle(uintBitsToFloat(a.xyz), a.w, uintBitsToFloat(b.xyz), b.w, uintBitsToFloat(c.xyz), c.w);
}

LspCornerNormals lsp_fetch_normals(uint i) {
  if (i >= lsp_header.triangle_count) return LspCornerNormals(0u, 0u, 0u);
  LspWords words = LspWords(lsp_addresses[2]);
  return LspCornerNormals(words.at[3u * i], words.at[3u * i + 1u], words.at[3u * i + 2u]);
}

LspLineSpace lsp_fetch_line_space(uint i) {
  if (i >= lsp_header.line_space_count) {
    return LspLineSpace(vec3(0.0), 0u, vec3(0.0), 0u, vec3(0.0), 0u, 0u, 0u, 0u, 0u);
  }
  LspWords4 words = LspWords4(lsp_addresses[3]);
  uvec4 a = words.at[4u * i];
  uvec4 b = words.at[4u * i + 1u];
  uvec4 c = words.at[4u * i + 2u];
  uvec4 d = words.at[4u * i + 3u];
  return LspLineSpace(uintBitsToFloat(a.xyz), a.w, uintBitsToFloat(b.xyz), b.w, uintBitsToFloat(c.xyz), c.w, d.x,
                      d.y, d.z, d.w);
}

LspBitWord lsp_fetch_bit_word(uint i) {
  if (i >= lsp_header.bit_word_count) return LspBitWord(0u, 0u);
  uvec2 w = LspWords2(lsp_addresses[4]).at[i];
  return LspBitWord(w.x, w.y);
}

uint lsp_fetch_candidate(uint i) {
  return i < lsp_header.candidate_word_count ? LspWords(lsp_addresses[5]).at[i] : 0u;
}

#undef LSP_TRIANGLE
#undef LSP_NORMALS
#undef LSP_LINE_SPACE
#undef LSP_BIT_WORD
#undef LSP_CANDIDATE
#define LSP_TRIANGLE(i) lsp_fetch_triangle(i)
#define LSP_NORMALS(i) lsp_fetch_normals(i)
#define LSP_LINE_SPACE(i) lsp_fetch_line_space(i)
#define LSP_BIT_WORD(i) lsp_fetch_bit_word(i)
#define LSP_CANDIDATE(i) lsp_fetch_candidate(i)

#include "lsp/traverse.h"

#endif
