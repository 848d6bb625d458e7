/* The layout of an .lsp file, stated once, for C, C++ and GLSL.
 *
 * A C or C++ compiler and glslc both accept this header. Every struct is free of implicit padding and has
 * the same offsets under the C ABI and under GLSL's std430; the static assertions below and
 * tests/layout hold both sides to the table of the specification (format-spec/SPEC.md).
 *
 *   file:  | header 256 | section table, 64 each | pad | section | pad | section | ... | pad |
 *                                                  ^ every section starts at a multiple of header.alignment
 *
 * All values are little-endian. Offsets are in bytes from the start of the file. Space is the world space of
 * the bake, in the input's units. Colours are linear, emission is radiance.
 */
#ifndef LSP_LAYOUT_H
#define LSP_LAYOUT_H

#ifdef GL_core_profile
#define LSP_UINT uint
#define LSP_FLOAT float
#define LSP_VEC3 vec3
#define LSP_U64 uvec2 /* x: low half, y: high half */
#define LSP_BEGIN(name) struct name {
#define LSP_END(name) };
#else
#include <stdint.h>
typedef struct lsp_float3 {
  float x, y, z;
} lsp_float3;
#define LSP_UINT uint32_t
#define LSP_FLOAT float
#define LSP_VEC3 lsp_float3
#define LSP_U64 uint64_t
#define LSP_BEGIN(name) typedef struct name {
#define LSP_END(name) \
  }                   \
  name;
#endif

/* Version of the format (not of the programs). A reader refuses another major version. */
#define LSP_VERSION_MAJOR 1u
#define LSP_VERSION_MINOR 0u

/* First eight bytes: 89 'L' 'S' 'P' 0D 0A 1A 0A, as two little-endian words. Catches text-mode transfers. */
#define LSP_MAGIC_0 0x50534C89u
#define LSP_MAGIC_1 0x0A1A0A0Du

#define LSP_NONE 0xFFFFFFFFu

/* Required features: a reader that does not know a set bit refuses the file. */
#define LSP_FEATURE_EXACT 0x1u       /* the tree goes down to triangles: exact traces are possible */
#define LSP_FEATURE_LINE_SPACES 0x2u /* Line Spaces are present: approximate traces are possible */
#define LSP_FEATURE_NORMALS 0x4u     /* corner normals are present (NRML) */
#define LSP_FEATURE_MATERIALS 0x8u   /* materials are present (MATL) */
#define LSP_FEATURE_NTREE 0x10u      /* the base structure is an NTree */
#define LSP_FEATURE_BINARY 0x20u     /* some Line Space has bits but no candidates */
#define LSP_FEATURES_KNOWN 0x3Fu

/* Base structures. */
#define LSP_BASE_BVH 1u
#define LSP_BASE_NTREE 2u

#ifndef GL_core_profile
/* Section types, LSP_SECTION_NODE and so on: four characters each, the first in the low byte. */
#define LSP_FOUR(a, b, c, d) ((a) | (b) << 8 | (c) << 16 | (d) << 24)
enum {
#define LSP_ARRAY_SECTION(Name, TYPE, code, ...) LSP_SECTION_##TYPE = code,
#define LSP_BYTE_SECTION(Name, TYPE, code) LSP_SECTION_##TYPE = code,
#include "lsp/sections.def"
};
#endif

/* LspSection.flags */
#define LSP_SECTION_REQUIRED 0x1u /* a reader that does not know the type refuses the file */

/* LspSection.codec */
#define LSP_CODEC_NONE 0u
#define LSP_CODEC_ZSTD 1u

/* Child references. Bit 31 clear: index of an LspNode. Set: a leaf,
 *
 *   31 30      27 26                                  0
 *   1 | count - 1 | first LspTriangle                 |      LSP_NONE: no child.
 */
#define LSP_LEAF_BIT 0x80000000u
#define LSP_LEAF_COUNT_SHIFT 27u
#define LSP_LEAF_COUNT_MASK 0xFu
#define LSP_LEAF_FIRST_MASK 0x07FFFFFFu
#define LSP_MAX_LEAF_TRIANGLES 16u

/* Line Space references of a child: LSP_NONE, or an index of LspLineSpace; bit 31 is set when no node below
 * carries a Line Space, so that an approximate ray has to stop here at the latest. */
#define LSP_TERMINAL_BIT 0x80000000u
#define LSP_LINE_SPACE_MASK 0x7FFFFFFFu

/* LspLineSpace.format: resolution N in bits 0-7, bytes per candidate entry (0, 1, 2 or 4) in bits 8-11. */
#define LSP_FORMAT_RESOLUTION_MASK 0xFFu
#define LSP_FORMAT_ENTRY_SHIFT 8u
#define LSP_FORMAT_ENTRY_MASK 0xFu
#define LSP_FORMAT_DENSE 0x1000u     /* one entry per shaft, all ones meaning empty; no bit words */
#define LSP_FORMAT_SYMMETRIC 0x2000u /* both directions of a shaft share one bit: 15 N^4 bits */
#define LSP_FORMAT_CONSERVATIVE 0x4000u /* a clear bit proves the shaft empty */

#define LSP_MAX_RESOLUTION 32u
#define LSP_MAX_STACK 96u

/* The header, at offset 0. Shaders bind it as a buffer; what a shader needs to trace is all here. */
LSP_BEGIN(LspHeader)
  LSP_UINT magic_0;
  LSP_UINT magic_1;
  LSP_UINT version_major;
  LSP_UINT version_minor;
  LSP_UINT header_bytes; /* 256 */
  LSP_UINT section_count;
  LSP_UINT required_features;
  LSP_UINT optional_features;
  LSP_U64 file_bytes;
  LSP_U64 section_table_offset; /* 256 */
  LSP_UINT alignment;           /* of sections and of the file's length: 256, 4096 or 65536 */
  LSP_UINT base_structure;      /* LSP_BASE_* */
  LSP_U64 primitive_count;      /* triangles of the inputs in import order, dropped ones included */
  LSP_U64 content_hash_lo;      /* XXH3-128 that is the same for packed and raw forms: see the spec */
  LSP_U64 content_hash_hi;
  LSP_U64 header_hash_lo; /* XXH3-128 of header (these 16 bytes zero) and section table */
  LSP_U64 header_hash_hi;
  LSP_VEC3 bounds_min;
  LSP_FLOAT normal_angle_cos; /* hits on a plane whose interpolated normal leaves this cone are rejected */
  LSP_VEC3 bounds_max;
  LSP_FLOAT plane_tolerance; /* in box diagonals: how far outside a box a plane hit may lie */
  LSP_UINT root;             /* child reference */
  LSP_UINT root_line_space;  /* Line Space reference */
  LSP_UINT node_count;
  LSP_UINT triangle_count; /* LspTriangle records; spatial splits may repeat a primitive */
  LSP_UINT line_space_count;
  LSP_UINT bit_word_count;
  LSP_UINT candidate_word_count; /* 32-bit words of CAND */
  LSP_UINT material_count;
  LSP_UINT max_depth;          /* edges from the root to the deepest leaf */
  LSP_UINT max_stack;          /* entries a traversal needs at most; <= LSP_MAX_STACK */
  LSP_UINT max_steps;          /* nodes and leaves a traversal visits at most; NTree: cells and references */
  LSP_UINT max_leaf_triangles; /* BVH: <= LSP_MAX_LEAF_TRIANGLES */
  LSP_UINT resolution;         /* N of the bake, for information; each Line Space states its own */
  LSP_UINT line_space_depth;   /* D of the bake, for information */
  LSP_UINT line_space_triangles; /* T of the bake, for information */
  LSP_UINT ntree_branching;      /* N of the NTree, 2 to LSP_MAX_BRANCHING, 0 for a BVH */
  LSP_UINT ntree_depth;          /* levels of the NTree, 1 to LSP_MAX_NTREE_DEPTH, 0 for a BVH */
  LSP_UINT reserved_0;           /* zero */
  LSP_U64 source_hash_lo;        /* XXH3-128 of the input files, in order */
  LSP_U64 source_hash_hi;
  LSP_UINT cell_count;      /* LspCell; this and what follows is zero for a BVH */
  LSP_UINT reference_count; /* of REFS */
  LSP_VEC3 ntree_lo;        /* lower corner of the root's cube */
  LSP_FLOAT ntree_size;     /* its edge */
  LSP_FLOAT ntree_margin;   /* a cell also holds what comes within this distance of it */
  LSP_UINT reserved[3];     /* zero */
LSP_END(LspHeader)

LSP_BEGIN(LspSection)
  LSP_UINT type;  /* LSP_SECTION_* */
  LSP_UINT flags; /* LSP_SECTION_REQUIRED */
  LSP_U64 offset;
  LSP_U64 stored_bytes;
  LSP_U64 bytes; /* after decompression; equal to stored_bytes without compression */
  LSP_UINT codec; /* LSP_CODEC_* */
  LSP_UINT element_bytes;
  LSP_U64 element_count; /* element_bytes * element_count = bytes */
  LSP_U64 hash_lo;       /* XXH3-128 of the decompressed bytes */
  LSP_U64 hash_hi;
LSP_END(LspSection)

/* An inner node: the boxes and references of its two children. */
LSP_BEGIN(LspNode)
  LSP_VEC3 lo0;
  LSP_UINT child0;
  LSP_VEC3 hi0;
  LSP_UINT line_space0;
  LSP_VEC3 lo1;
  LSP_UINT child1;
  LSP_VEC3 hi1;
  LSP_UINT line_space1;
LSP_END(LspNode)

/* A cell of an NTree node, the base structure in which a node is a cube cut into N^3 equal cubes (paper, section
 * 3.2). Nodes are numbered depth first, the root is 0; each has LSP_GRID_WORDS(N) words of GRID, in which bit
 * LSP_CELL_INDEX(x, y, z, N) is set when the cell holds something. The record of a filled cell is
 * offset + bitcount(bits below it) of its word: offsets count from the beginning of CELL. The cell with global
 * coordinate g on an axis, at level l (the root's cells: 1), begins at ntree_lo + g * (ntree_size / N^l). Cells
 * are in the order of their nodes and bits; so are the references of leaves, and the Line Spaces that cells carry
 * (the root's own comes first). */
LSP_BEGIN(LspCell)
  LSP_UINT child; /* a node; with LSP_LEAF_BIT the first of `count` references; LSP_NONE: nothing but Line Space */
  LSP_UINT count; /* references of a leaf, else 0 */
  LSP_UINT line_space; /* Line Space reference */
LSP_END(LspCell)

#define LSP_MAX_BRANCHING 16u
#define LSP_MAX_NTREE_DEPTH 4u
#define LSP_GRID_WORDS(n) (((n) * (n) * (n) + 31u) / 32u)
#define LSP_CELL_INDEX(x, y, z, n) ((x) + (n) * ((y) + (n) * (z)))

#ifndef GL_core_profile
/* What a traversal of an NTree visits at most: of every node the cells along a line and the way out of it, or all
 * filled cells, and every reference. */
static inline uint64_t lsp_ntree_steps(const LspHeader* h) {
  return UINT64_C(3) * h->ntree_branching * h->node_count + h->cell_count + h->reference_count;
}
#endif

LSP_BEGIN(LspTriangle)
  LSP_VEC3 v0;
  LSP_UINT primitive; /* number in import order */
  LSP_VEC3 v1;
  LSP_UINT material; /* index of LspMaterial, 0 without materials */
  LSP_VEC3 v2;
  LSP_UINT flags; /* LSP_TRIANGLE_* */
LSP_END(LspTriangle)

#define LSP_TRIANGLE_SMOOTH 0x1u /* the corner normals differ from one another */

/* Unit normals of the corners, octahedral, two 16-bit snorm each (x low, y high); Cigolle et al. 2014. */
LSP_BEGIN(LspCornerNormals)
  LSP_UINT n0;
  LSP_UINT n1;
  LSP_UINT n2;
LSP_END(LspCornerNormals)

LSP_BEGIN(LspMaterial)
  LSP_VEC3 base_color;
  LSP_FLOAT opacity;
  LSP_VEC3 emission;
  LSP_FLOAT roughness;
  LSP_FLOAT metallic;
  LSP_UINT reserved[3]; /* zero */
LSP_END(LspMaterial)

/* The Line Space of one box. Faces are numbered 2 * axis + side (side 0: lo, 1: hi). The patch of a point on
 * a face is iu + N * iv, where u and v are the other two axes in increasing order. A shaft is
 *
 *   ((in * 5 + (out > in ? out - 1 : out)) * N^2 + patch_in) * N^2 + patch_out        in, out: faces
 *
 * A binary Line Space (no bytes per entry) has bits only; a set bit says that something is inside. */
#define LSP_SHAFT_INDEX(in_face, out_face, patch_in, patch_out, n)                                        \
  ((((in_face)*5u + ((out_face) > (in_face) ? (out_face)-1u : (out_face))) * ((n) * (n)) + (patch_in)) * \
       ((n) * (n)) +                                                                                      \
   (patch_out))

/* Symmetric Line Spaces number the 15 unordered pairs of faces, the smaller face first. */
#define LSP_SHAFT_INDEX_SYMMETRIC(low_face, high_face, patch_low, patch_high, n)                          \
  ((((low_face) * (9u - (low_face)) / 2u + (high_face)-1u) * ((n) * (n)) + (patch_low)) * ((n) * (n)) + \
   (patch_high))

LSP_BEGIN(LspLineSpace)
  LSP_VEC3 lo; /* box of the shafts: the node's, with an outward margin */
  LSP_UINT word_first; /* first LspBitWord */
  LSP_VEC3 hi;
  LSP_UINT candidate_first; /* first 32-bit word of CAND */
  LSP_VEC3 scale;           /* N / (hi - lo) */
  LSP_UINT triangle_first;  /* candidate entries count from this LspTriangle */
  LSP_UINT format;          /* LSP_FORMAT_* */
  LSP_UINT filled;          /* filled shafts */
  LSP_UINT triangle_count;  /* every entry is smaller than this */
  LSP_UINT child;           /* the child reference of the node that carries this Line Space */
LSP_END(LspLineSpace)

/* 32 shafts of the sparse layout: shaft n is bit n % 32 of word n / 32. Entry of a filled shaft:
 * offset + bitcount(bits below it), counted from the Line Space's first entry (the paper's algorithm 2). */
LSP_BEGIN(LspBitWord)
  LSP_UINT bits;
  LSP_UINT offset;
LSP_END(LspBitWord)

#if defined(__cplusplus)
#define LSP_STATIC_ASSERT(condition) static_assert(condition)
#elif !defined(GL_core_profile)
#define LSP_STATIC_ASSERT(condition) _Static_assert(condition, #condition)
#endif
#ifdef LSP_STATIC_ASSERT
LSP_STATIC_ASSERT(sizeof(LspHeader) == 256);
LSP_STATIC_ASSERT(sizeof(LspSection) == 64);
LSP_STATIC_ASSERT(sizeof(LspNode) == 64);
LSP_STATIC_ASSERT(sizeof(LspCell) == 12);
LSP_STATIC_ASSERT(sizeof(LspTriangle) == 48);
LSP_STATIC_ASSERT(sizeof(LspCornerNormals) == 12);
LSP_STATIC_ASSERT(sizeof(LspMaterial) == 48);
LSP_STATIC_ASSERT(sizeof(LspLineSpace) == 64);
LSP_STATIC_ASSERT(sizeof(LspBitWord) == 8);
#undef LSP_STATIC_ASSERT
#endif

#endif /* LSP_LAYOUT_H */
