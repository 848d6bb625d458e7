/* What the program and its shaders tell one another, stated once, for C, C++ and GLSL: rays and hits, what
 * is asked of a trace, and where the trace shader finds its buffers and numbers. */
#ifndef LSP_INTERFACE_H
#define LSP_INTERFACE_H

#include "lsp/layout.h"

/* A ray; t counts in lengths of the direction. A hit needs tmin < t < tmax. */
LSP_BEGIN(LspRay)
  LSP_VEC3 origin;    /* in scene space */
  LSP_FLOAT tmin;     /* at most tmax */
  LSP_VEC3 direction; /* of any length but zero */
  LSP_FLOAT tmax;     /* infinity: as far as there is */
LSP_END(LspRay)
/* What a ray has met; primitive is LSP_NONE where it is nothing. */
LSP_BEGIN(LspHit)
  LSP_FLOAT t;        /* infinity: no hit */
  LSP_UINT primitive; /* in import order; LSP_NONE: no hit */
  LSP_FLOAT u;        /* weight of corner 1; outside [0, 1] where a plane was extrapolated */
  LSP_FLOAT v;        /* weight of corner 2 */
  LSP_VEC3 normal;    /* unit shading normal; it may face away from the ray */
  LSP_UINT flags;     /* LSP_HIT_* in bits 0 to 7; from bit 8 on the instance's number, where there are instances */
LSP_END(LspHit)

#define LSP_HIT_INSTANCE_SHIFT 8u /* of LspHit.flags: the instance's number begins here */

/* The tree over instances: nodes from its root to an instance at most, and so what a ray's stack holds; and of a node's
 * child, that it is an instance's number. */
#define LSP_INSTANCE_DEPTH 32u
#define LSP_INSTANCE_BIT 0x80000000u

#define LSP_HIT_LINE_SPACE 0x1u    /* answered by a Line Space */
#define LSP_HIT_ORIGIN_INSIDE 0x2u /* the origin lies inside that Line Space's node */

/* The traversal ended with work left, the answer is not to be trusted. In the library this only happens to
 * files whose declared bounds are wrong; on a device also where it cuts long loops short (some give a
 * vector of invocations a budget of iterations). */
#define LSP_HIT_INCOMPLETE 0x80u

/* lsp_hit_offset: how far off a hit a ray that goes on from there begins. The plane of a table passes near the surface,
 * not in it: from behind the surface every ray would meet it, and a second bounce be too dark. Of the scene's diagonal,
 * and of a cell's edge. */
#define LSP_OFFSET_EXACT 3e-5f
#define LSP_OFFSET_LINE_SPACE 1e-3f
#define LSP_OFFSET_CELL 0.1f

/* ---- what is asked of a trace -------------------------------------------------------------------------- */

#define LSP_TRACE_APPROXIMATE 0x1u      /* stop at Line Spaces; without it: exact, down to triangles */
#define LSP_TRACE_ANY_HIT 0x2u          /* any hit in (tmin, tmax), not the closest */
#define LSP_TRACE_NEAR_APPROXIMATE 0x4u /* answer from a Line Space even where the origin lies inside it */

/* Where the origin lies inside a Line Space: first ask the shaft of the opposite direction for the last
 * surface on the ray's line, and trace exactly only when that lies ahead. Saves most of the exact work near
 * the origin for a small error; ignored with LSP_TRACE_NEAR_APPROXIMATE. */
#define LSP_TRACE_NEAR_SKIP 0x8u

#define LSP_TRACE_ALL_FLAGS 0xFu /* that change the way of a traversal */

/* lsp_trace_options.max_loss sets the dial, not its quality. */
#define LSP_TRACE_MAX_LOSS 0x10u

/* Any hit, and no more is asked than whether there is one: hit.t is finite then, the rest of the hit says nothing (it
 * may be filled or not). Saves a look-up of triangle and normals. */
#define LSP_TRACE_OCCLUSION 0x20u
/* `flags` and what they imply, for those who look at a flag alone. */
#define LSP_TRACE_IMPLIED(flags) \
  (((flags) & LSP_TRACE_OCCLUSION) != 0u ? (flags) | LSP_TRACE_ANY_HIT : (flags))

/* ---- the trace shader ---------------------------------------------------------------------------------- */

/* Bindings of its descriptor set, all storage buffers; 0 to 11 are those of lsp.glsl. */
#define LSP_BINDING_HEADER 0
#define LSP_BINDING_NODES 1 /* of an NTree: GRID; wide nodes; of scenes read through addresses: their table */
#define LSP_BINDING_TRIANGLES 2
#define LSP_BINDING_NORMALS 3
#define LSP_BINDING_LINE_SPACES 4
#define LSP_BINDING_BIT_WORDS 5
#define LSP_BINDING_CANDIDATES 6
#define LSP_BINDING_CELLS 7      /* of an NTree */
#define LSP_BINDING_REFERENCES 8 /* of an NTree */
/* A file of cells has no Line Spaces and no NTree. */
#define LSP_BINDING_SPLITS 4
#define LSP_BINDING_PLANES 5
#define LSP_BINDING_ENTRIES 6
#define LSP_BINDING_CELL_WORDS 7
#define LSP_BINDING_CELL_REFERENCES 8
#define LSP_BINDING_FILLED_CELLS 9
#define LSP_BINDING_PLANE_RECORDS 10
#define LSP_BINDING_CELL_NODES 11
/* Through instances there are these in their place. */
#define LSP_BINDING_ASSETS 0    /* lsp_vulkan_asset, read */
#define LSP_BINDING_INSTANCES 1 /* the memory of lsp_instances_build, read */
#define LSP_BINDING_POOL 2      /* and 3 and 4, one buffer: the assets' sections, read; not with addresses */
#define LSP_BINDING_RAYS 12     /* LspRay, read */
#define LSP_BINDING_HITS 13     /* LspHit, written */
#define LSP_BINDING_COUNTERS 14 /* lsp_trace_counts, added to; only the counting shader uses it */
#define LSP_BINDING_QUEUE 15    /* LSP_VULKAN_QUEUE_HEAD, read and written; only passes use it */
#define LSP_BINDING_COUNT 16
#define LSP_BINDING_NONE 16 /* of MATL's buffer, which the trace shader does not read */

/* Addresses in the table: those of the sections of bindings LSP_BINDING_NODES to LSP_BINDING_CELL_NODES. */
#define LSP_VULKAN_ADDRESS_COUNT 11

/* Rays of a work group, one an invocation. */
#define LSP_VULKAN_GROUP_SIZE 64

/* Specialization constants of the shader, each a uint32_t. Stack: its entries, at least header->max_stack
 * and 1, default 96. Flags: LSP_TRACE_*, default 0; a pipeline does one kind of trace. Parts: what the
 * scene needs of the shader, of several scenes all that any of them needs; default everything. */
#define LSP_VULKAN_STACK_CONSTANT 0
#define LSP_VULKAN_FLAGS_CONSTANT 1
#define LSP_VULKAN_PARTS_CONSTANT 2

/* And of rays through cells in passes, default LSP_VULKAN_FIRST_PASS: one that takes all rays from their beginning to
 * the first cell that is to be traced exactly, one that traces it and takes them to the next, one that takes them
 * to their end. */
#define LSP_VULKAN_PASS_CONSTANT 3
#define LSP_VULKAN_FIRST_PASS 0u
#define LSP_VULKAN_CALL_PASS 1u
#define LSP_VULKAN_LAST_PASS 2u
#define LSP_VULKAN_PASS_KINDS 3u

/* How many there are, the last of the last kind. In the queue there are four words for each, how many rays wait for it
 * and a VkDispatchIndirectCommand of the work groups that take them; behind these two lists of rays, of passes with
 * an even number and with an odd one. */
#define LSP_VULKAN_PASSES 5u
#define LSP_VULKAN_QUEUE_HEAD (4u * LSP_VULKAN_PASSES) /* words */

/* Push constants, compute stage, from offset 0: rays [first, first + count) of the buffers. */
LSP_BEGIN(lsp_vulkan_trace_constants)
  LSP_FLOAT lod; /* as in lsp_trace_options */
  LSP_UINT first; /* ray */
  LSP_UINT count; /* of rays, one an invocation */
  LSP_UINT dial; /* lsp_dial */
LSP_END(lsp_vulkan_trace_constants)

/* The same of a pass. */
LSP_BEGIN(lsp_vulkan_pass_constants)
  LSP_UINT pass;  /* from 0 on; below LSP_VULKAN_PASSES */
  LSP_UINT first; /* ray */
  LSP_UINT count; /* of rays, which is the length of the queue's lists */
  LSP_UINT dial;  /* lsp_dial */
LSP_END(lsp_vulkan_pass_constants)

/* The same through instances. */
LSP_BEGIN(lsp_vulkan_instance_constants)
  LSP_UINT instance_count; /* lsp_instances.count */
  LSP_UINT first; /* ray */
  LSP_UINT count; /* of rays, one an invocation */
  LSP_UINT mask; /* as of lsp_trace_instances */
LSP_END(lsp_vulkan_instance_constants)

/* Fields of lsp_trace_counts, which the counting shader adds to; the first, the rays, the host knows. */
#define LSP_COUNTER_INVALID 1u
#define LSP_COUNTER_HITS 2u
#define LSP_COUNTER_NODES 3u
#define LSP_COUNTER_SHAFTS 4u
#define LSP_COUNTER_TRIANGLES 5u
#define LSP_COUNTER_SPLITS 6u
#define LSP_COUNTER_EXACT 7u
#define LSP_COUNTER_EXACT_NODES 8u

#if defined(__cplusplus)
static_assert(sizeof(LspRay) == 32 && sizeof(LspHit) == 32 && sizeof(lsp_vulkan_trace_constants) == 16 &&
              sizeof(lsp_vulkan_pass_constants) == 16 && sizeof(lsp_vulkan_instance_constants) == 16);
#elif !defined(GL_core_profile)
_Static_assert(sizeof(LspRay) == 32 && sizeof(LspHit) == 32, "as in ray and hit files and in shaders");
_Static_assert(sizeof(lsp_vulkan_trace_constants) == 16, "as in shaders");
_Static_assert(sizeof(lsp_vulkan_instance_constants) == 16, "as in shaders");
#endif

#endif /* LSP_INTERFACE_H */
