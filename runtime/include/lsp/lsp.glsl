/* Traces rays against an .lsp scene in a shader.
 *
 *   #version 460
 *   #extension GL_GOOGLE_include_directive : require
 *   #define LSP_SET 0                // descriptor set of the scene's buffers, default 0
 *   #define LSP_FIRST_BINDING 0      // binding of the header; the others follow it, default 0
 *   #define LSP_NTREE                // the scene's base structure is an NTree, not a BVH
 *   #define LSP_CELLS                // or it has cells, and the rays are approximate
 *   #define LSP_WIDE                 // or exact, and the scene has wide nodes (LSP_FEATURE_WIDE)
 *   #define LSP_ADDRESSES            // sections are read through addresses, see lsp_sections.glsl
 *   #define LSP_INSTANCES            // a scene of instances of many files, see lsp_instances.glsl
 *   #include "lsp/lsp.glsl"
 *
 *   LspHit hit = lsp_trace(lsp_bound_scene(), ray, LSP_TRACE_APPROXIMATE, 0.0);
 *   bool shadowed = lsp_occluded(lsp_bound_scene(), ray, LSP_TRACE_APPROXIMATE, 0.0, dial);
 *
 * Cells take the dial, what lsp_dial of lsp/lsp.h answers, as one argument more.
 *
 * Bindings (LSP_BINDING_* of lsp/interface.h), each a read-only storage buffer, all from the file as it lies on disk:
 *   +0 header   +1 NODE   +2 TRIA   +3 NRML   +4 LSPC   +5 BITS   +6 CAND
 * of an NTree also
 *   +1 GRID   +7 CELL   +8 REFS
 * with LSP_WIDE
 *   +1 WNOD
 * and of cells, which have no Line Spaces,
 *   +4 CSPL   +5 CPLN   +6 CENT   +7 CGRD   +8 CREF   +9 CELT   +10 CPRC   +11 CNOD
 * A section the file does not have is bound to any buffer (the header's, say): it is not read.
 *
 * The stack lives in LSP_STACK_SIZE entries of 8 bytes: define it as header.max_stack, or leave it to the
 * specialization constant LSP_STACK_CONSTANT_ID (default LSP_VULKAN_STACK_CONSTANT), whose default is LSP_MAX_STACK.
 *
 * What few scenes need (LSP_PART_* of lsp/parts.h) is left out where it is not asked for: define LSP_PARTS, or
 * LSP_PARTS_CONSTANT_ID as the number of a specialization constant, whose default is everything;
 * lsp_vulkan_parts of lsp/lsp_vulkan.h says what a scene needs. The device
 * should have robustBufferAccess on when files are not known to be valid.
 */
#ifndef LSP_GLSL
#define LSP_GLSL

#include "lsp/interface.h"

#ifndef LSP_SET
#define LSP_SET 0
#endif
#ifndef LSP_FIRST_BINDING
#define LSP_FIRST_BINDING 0
#endif
#ifndef LSP_STACK_SIZE
#ifndef LSP_STACK_CONSTANT_ID
#define LSP_STACK_CONSTANT_ID LSP_VULKAN_STACK_CONSTANT
#endif
layout(constant_id = LSP_STACK_CONSTANT_ID) const uint lsp_stack_size = LSP_MAX_STACK;
#define LSP_STACK_SIZE lsp_stack_size
#endif

#ifdef LSP_PARTS_CONSTANT_ID
layout(constant_id = LSP_PARTS_CONSTANT_ID) const uint lsp_parts = 0xFFFFFFFFu;
#define LSP_PARTS lsp_parts
#endif

#ifdef LSP_INSTANCES
#define LSP_CELLS
#define LSP_WIDE
#else
layout(std430, set = LSP_SET, binding = LSP_FIRST_BINDING + LSP_BINDING_HEADER) readonly buffer LspHeaderBuffer {
  LspHeader lsp_header;
};
#endif

/* Arrays are read 16 bytes at a time, which is faster than member by member. */
LspNode lsp_node_of(uvec4 a, uvec4 b, uvec4 c, uvec4 d) {
  return LspNode(uintBitsToFloat(a.xyz), a.w, uintBitsToFloat(b.xyz), b.w, uintBitsToFloat(c.xyz), c.w,
                 uintBitsToFloat(d.xyz), d.w);
}

LspTriangle lsp_triangle_of(uvec4 a, uvec4 b, uvec4 c) {
  return LspTriangle(uintBitsToFloat(a.xyz), a.w, uintBitsToFloat(b.xyz), b.w, uintBitsToFloat(c.xyz), c.w);
}

LspLineSpace lsp_line_space_of(uvec4 a, uvec4 b, uvec4 c, uvec4 d) {
  return LspLineSpace(uintBitsToFloat(a.xyz), a.w, uintBitsToFloat(b.xyz), b.w, uintBitsToFloat(c.xyz), c.w, d.x,
                      d.y, d.z, d.w);
}

uint lsp_entry_of(uint word, uint i) { return (word >> ((i & 1u) * 16u)) & 0xFFFFu; }
LspPlane lsp_plane_of(uvec4 w) { return LspPlane(uintBitsToFloat(w.xyz), uintBitsToFloat(w.w)); }
LspSplit lsp_split_of(uvec2 w) { return LspSplit(w.x, w.y); }
LspCellNode lsp_cell_node_of(uvec4 w) { return LspCellNode(w.x, w.y, w.z, w.w); }

LspWideNode lsp_wide_node_of(uvec4 a, uvec4 b, uvec4 c, uvec4 d, uvec4 e, uvec4 f) {
  return LspWideNode(uintBitsToFloat(a.xyz), a.w, uintBitsToFloat(b.xyz), b.w, uint[4](c.x, c.y, c.z, c.w),
                     uint[12](d.x, d.y, d.z, d.w, e.x, e.y, e.z, e.w, f.x, f.y, f.z, f.w));
}

/* Of a wide node what names one of its children. */
struct LspWideChild {
  uint node_first;
  uint triangle_first;
  uint bits; /* 16, of LspWideNode.children */
};
LspWideChild lsp_wide_child_of(uint node_first, uint triangle_first, uvec4 children, uint number) {
  uint pair = number < 4u ? (number < 2u ? children.x : children.y) : (number < 6u ? children.z : children.w);
  return LspWideChild(node_first, triangle_first, (pair >> ((number & 1u) * 16u)) & 0xFFFFu);
}

/* Of a filled cell what is read together; the rest is zero. */
LspFilledCell lsp_cell_origins_of(uvec4 w) { return LspFilledCell(w.x, w.y, w.z, w.w, 0u, 0u, 0u, 0u, 0u, 0u, 0u, 0u); }
LspFilledCell lsp_cell_answers_of(uvec4 w) { return LspFilledCell(0u, 0u, 0u, 0u, w.x, w.y, w.z, w.w, 0u, 0u, 0u, 0u); }
LspFilledCell lsp_cell_tree_of(uvec4 w) { return LspFilledCell(0u, 0u, 0u, 0u, 0u, 0u, 0u, 0u, w.x, w.y, w.z, w.w); }

#include "lsp/lsp_sections.glsl"

/* What lsp/traverse.h asks for besides. */
LspHeader lsp_load_header(LspScene scene) { return LSP_HEADER(scene); }
bool lsp_has_normals(LspScene scene) { return (LSP_HEADER(scene).required_features & LSP_FEATURE_NORMALS) != 0u; }
void lsp_fetch_node(LspScene scene, uint flags, uint i) {}
vec3 lsp_vec3(vec3 v) { return v; }
vec3 lsp_float3_of(vec3 v) { return v; }
#define LSP_FN
#define LSP_STEP
#define LSP_FN_RARE

#ifdef LSP_INSTANCES
#include "lsp/lsp_instances.glsl"
#else
#include "lsp/traverse.h"

/* flags: LSP_TRACE_*; lod: stop at a Line Space once its diagonal is under lod * distance, 0: deepest. */
LspHit lsp_trace(LspScene scene, LspRay ray, uint flags, float lod, uint dial) {
  return lsp_trace_ray(scene, ray, flags, lod, dial).hit;
}

/* Whether anything lies on the ray: without a look-up of what it is. flags: LSP_TRACE_APPROXIMATE and what goes with it. */
bool lsp_occluded(LspScene scene, LspRay ray, uint flags, float lod, uint dial) {
  return lsp_trace(scene, ray, flags | LSP_TRACE_OCCLUSION, lod, dial).t < LSP_INFINITY;
}

/* With cells: balanced. */
LspHit lsp_trace(LspScene scene, LspRay ray, uint flags, float lod) {
  LspHeader header = lsp_load_header(scene);
  return lsp_trace(scene, ray, flags, lod,
                   LSP_DIAL(header.quality[LSP_QUALITY_BALANCED], header.quality_part[LSP_QUALITY_BALANCED]));
}

#endif

#endif
