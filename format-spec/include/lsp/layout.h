/* The layout of an .lsp file, stated once, for C, C++ and GLSL.
 *
 * A C or C++ compiler and glslc both accept this header. Every struct is free of implicit padding and has
 * the same offsets under the C ABI and under GLSL's std430; the static assertions below and
 * tests/layout hold both sides to the table of the specification (format-spec/SPEC.md).
 *
 *   file:  | header 384 | section table, 64 each | pad | section | pad | section | ... | pad |
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
#define LSP_VERSION_MAJOR 2u
#define LSP_VERSION_MINOR 6u

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
#define LSP_FEATURE_CELLS 0x40u      /* approximate rays are answered by cells */
#define LSP_FEATURE_COVERAGE 0x80u   /* some triangle is there in part: LSP_TRIANGLE_GAPS_SHIFT */
#define LSP_FEATURE_WIDE 0x100u      /* exact rays walk wide nodes (WNOD); there is no NODE then */
#define LSP_FEATURE_WIDE_BASE 0x200u /* the base structure is the wide nodes alone: there are no tables */
#define LSP_FEATURES_KNOWN 0x3FFu

/* Base structures. */
#define LSP_BASE_BVH 1u
#define LSP_BASE_NTREE 2u
#define LSP_BASE_CELLS 3u /* cells, and for exact rays wide nodes, or (before 2.3) a BVH */
#define LSP_BASE_WIDE 4u  /* wide nodes alone: every ray is answered exactly */

#ifndef GL_core_profile
/* The minor version to write: the lowest that knows these required features. */
static inline uint32_t lsp_version_minor(uint32_t required_features) {
  if ((required_features & LSP_FEATURE_WIDE_BASE) != 0) return 4u;
  if ((required_features & LSP_FEATURE_WIDE) != 0) return 3u;
  return (required_features & LSP_FEATURE_COVERAGE) != 0 ? 1u : 0u;
}

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
#define LSP_FORMAT_RETIRED 0x4000u   /* CONSERVATIVE of 2.0 and 2.1: ignored, written as zero */

#define LSP_MAX_RESOLUTION 32u
#define LSP_MAX_STACK 96u

/* The grid of cells, part of the header; all zero without cells. */
LSP_BEGIN(LspCellGrid)
  LSP_VEC3 lo;    /* lower corner of cell (0, 0, 0) */
  LSP_FLOAT size; /* edge of a cell */
  LSP_UINT cells_x;
  LSP_UINT cells_y;
  LSP_UINT cells_z;
  LSP_FLOAT per_size;      /* 1 / size */
  LSP_FLOAT margin;        /* a cell's tree also holds what comes within this distance of it */
  LSP_FLOAT box_step;      /* (size + 2 margin) / 255: unit of the boxes in LspCellNode */
  LSP_UINT far_patches;    /* N: patches along an edge of a cell, of far tables */
  LSP_UINT origin_patches; /* M: likewise, of origin tables */
  LSP_UINT sub_cells;      /* along an edge of a cell */
  LSP_UINT origin_entry_first; /* entries of all far tables */
  LSP_UINT reserved[2];    /* zero */
LSP_END(LspCellGrid)

/* The header, at offset 0. Shaders bind it as a buffer; what a shader needs to trace is all here. */
LSP_BEGIN(LspHeader)
  LSP_UINT magic_0;
  LSP_UINT magic_1;
  LSP_UINT version_major;
  LSP_UINT version_minor;
  LSP_UINT header_bytes; /* 384 */
  LSP_UINT section_count;
  LSP_UINT required_features;
  LSP_UINT optional_features;
  LSP_U64 file_bytes;
  LSP_U64 section_table_offset; /* 384 */
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
  LSP_UINT max_depth;          /* edges from the root to the deepest leaf, of the nodes that the file has */
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
  LSP_UINT quality_part[3]; /* what LSP_DIAL adds to quality; of other files, and before 2.6, zero */
  LspCellGrid cells;
  LSP_U64 origin_x; /* float64: what positions of the file, of rays and of hits are relative to */
  LSP_U64 origin_y;
  LSP_U64 origin_z;
  LSP_UINT filled_cell_count; /* LspFilledCell; this and what follows is zero without cells */
  LSP_UINT entry_word_count;  /* 32-bit words of CENT */
  LSP_UINT plane_count;
  LSP_UINT split_count;
  LSP_UINT cell_node_count;      /* LspCellNode */
  LSP_UINT cell_reference_count; /* of CREF */
  LSP_UINT quality[3]; /* LSP_QUALITY_*: LSP_HEEDS of whole classes */
  LSP_UINT wide_node_count; /* LspWideNode */
LSP_END(LspHeader)

/* Points of the dial between speed and accuracy that the bake measured for the scene: indices of header.quality. */
#define LSP_QUALITY_BALANCED 0u
#define LSP_QUALITY_FAST 1u
#define LSP_QUALITY_ACCURATE 2u
#define LSP_QUALITY_COUNT 3u
/* In the cell that a ray begins in, and in others, answers are heeded that lose less than so many classes; where another
 * would answer, the cell is traced exactly. */
#define LSP_HEEDS(origin_classes, far_classes) ((origin_classes) | (far_classes) << 8u)
#define LSP_HEEDS_TABLES LSP_HEEDS(LSP_LOSS_UNKNOWN + 1u, LSP_LOSS_UNKNOWN + 1u) /* nothing is traced exactly */
/* The same in sixteenths of a class, as tracers take it, of header.quality and header.quality_part. */
#define LSP_DIAL_PARTS 16u
#define LSP_DIAL(quality, part) ((quality) << 4u | (part))
#define LSP_DIAL_TABLES LSP_DIAL(LSP_HEEDS_TABLES, 0u)

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

/* A node of the tree for exact rays: up to eight children, whose boxes are bytes in the node's own frame, rounded
 * outwards: plane q lies at lo + q * step. (Ylitie, Karras, Laine, "Efficient Incoherent Ray Traversal on GPUs Through
 * Compressed Wide BVHs", 2017; here the steps are floats, not powers of two.) The first node is the root; a scene
 * without triangles has none, and root in the header is LSP_NONE. Nodes that are children of one node follow one another, and blocks of them depth
 * first; so do the triangles of a node's leaves, before those of the nodes below it. Any-hit rays take the children in
 * their order. */
LSP_BEGIN(LspWideNode)
  LSP_VEC3 lo;
  LSP_UINT node_first; /* children that are nodes count from here */
  LSP_VEC3 step;
  LSP_UINT triangle_first; /* the leaves' triangles count from here */
  LSP_UINT children[4];    /* 16 bits each, the lower half first: LSP_WIDE_* */
  LSP_UINT planes[12];     /* lo x, y, z, hi x, y, z: of each a byte a child, child 0 lowest, in two words */
LSP_END(LspWideNode)
#define LSP_WIDE_CHILDREN 8u
/* A child: node node_first + its low bits; or a leaf, count - 1 in bits 11-14, its first triangle in bits 0-10. */
#define LSP_WIDE_NODE_BIT 0x8000u
#define LSP_WIDE_LEAF_COUNT_SHIFT 11u
#define LSP_WIDE_LEAF_FIRST_MASK 0x7FFu
#define LSP_WIDE_NO_CHILD 0xFFFFu /* its box is inside out: lo 255, hi 0 */

#ifndef GL_core_profile
/* What a traversal of wide nodes visits at most: nodes, and their leaves. */
static inline uint64_t lsp_wide_steps(const LspHeader* h) {
  return UINT64_C(1) * h->wide_node_count * (1 + LSP_WIDE_CHILDREN);
}
#endif

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

/* ---- cells: equal cubes over the scene, answered from tables ----
 *
 * CGRD has a word of every cell of the grid, x fastest: LSP_CELL_FILLED and the number of its record, or its jump:
 * the cells up to `jump` cells away, along every axis, are empty too. */
#define LSP_CELL_FILLED 0x80000000u
#define LSP_CELL_MAX_JUMP 255u
#define LSP_MAX_CELLS 1024u /* along an edge of the grid */
#define LSP_MAX_SUB_CELLS 4u
#define LSP_MAX_CELL_PATCHES 8u

/* A filled cell, in the order of the grid: its origin tables, its answers, and its tree. */
LSP_BEGIN(LspFilledCell)
  LSP_UINT sub_mask_lo; /* which sub-cells hold surface, and have an origin table: bit x + n * (y + n * z) */
  LSP_UINT sub_mask_hi;
  LSP_UINT sub_first; /* number of the first of its origin tables, which follow one another by their bits */
  LSP_UINT closed;    /* ways out of the cell that do not lead out of the scene, bits LSP_WAY; since 2.5 */
  LSP_UINT plane_first;
  LSP_UINT plane_count; /* answers from this on are splits */
  LSP_UINT split_first;
  LSP_UINT split_count;
  LSP_UINT root;            /* of its tree: as in LspCellNode.children */
  LSP_UINT node_first;      /* its nodes count from here */
  LSP_UINT reference_first; /* and its leaves' references from here */
  LSP_UINT max_steps;       /* nodes that an exact trace of the cell visits at most */
LSP_END(LspFilledCell)

/* A way out of a cell: a face, 2 * axis + side, and a quarter of it. The bit of LspFilledCell.closed is set where hardly a
 * ray that begins in the cell and leaves it that way leaves the scene: one that misses everything is a mistake of the
 * tables then. */
#define LSP_WAY(face, quarter) (4u * (face) + (quarter))
#define LSP_WAYS 24u
/* The quarter of the patch (u, v) of m * m. */
#define LSP_QUARTER(u, v, m) ((2u * (u) >= (m) ? 1u : 0u) + (2u * (v) >= (m) ? 2u : 0u))

/* CENT has the entries, 16 bits, two in a word, the lower half first: of every filled cell the 30 N^4 shafts of its
 * far table (LSP_SHAFT_INDEX), then of every origin table, by face 2 * axis + side and patch u + M * v of the cell
 * through which a ray leaves, 6 M^2. Bits 0-12: the answer, a plane or split of the cell or one of these; 13-15: its
 * loss, the share of rays that it answers wrongly. */
#define LSP_ANSWER_MASK 0x1FFFu
#define LSP_ANSWER_LIMIT 0x1FF0u /* planes and splits of a cell, at most */
#define LSP_ANSWER_EMPTY 0x1FFFu /* nothing in the cell */
#define LSP_ANSWER_SKY 0x1FFEu   /* nothing on the whole ray; of origin tables */
#define LSP_LOSS_SHIFT 13u
/* Classes of loss and what they lose at most, per cent; 0: none was seen. */
#define LSP_LOSS_LIMITS {0, 1, 2, 5, 10, 20, 100}
#define LSP_LOSS_UNKNOWN 7u /* too few rays came that way to know */

/* How far outside its passage of the cell a ray may meet the plane that answers it, as a share of the passage. */
#define LSP_CELL_SLACK 0.05f

/* The plane of triangles of a cell. */
LSP_BEGIN(LspPlane)
  LSP_VEC3 normal;    /* unit length */
  LSP_FLOAT distance; /* from the cell's centre along the normal, in edges of a cell */
LSP_END(LspPlane)

/* Two answers and the linear form over a ray's place in its shaft that chooses. Weights are 6 bits, two's complement.
 * Places, from -1 to 1: of a far table u and v in the patch of entry, u and v in the patch of exit; of an origin
 * table x, y, z in the sub-cell, u and v in the patch of exit. */
LSP_BEGIN(LspSplit)
  LSP_UINT answers; /* bits 0-11: where the form is positive, 12-23: where not, each a plane of the cell or
                       LSP_SPLIT_EMPTY; 24-29: the constant */
  LSP_UINT weights; /* of the places, from bit 0 on */
LSP_END(LspSplit)
#define LSP_SPLIT_MASK 0xFFFu
#define LSP_SPLIT_EMPTY 0xFFFu

/* A node of a cell's tree. Boxes in steps of grid.box_step from the cell's corner less the margin, rounded outwards:
 * lo x y z, hi x y z of child 0, then of child 1, a byte each. Children, 16 bits each: a node, or with
 * LSP_CELL_LEAF_BIT a leaf, count - 1 in bits 13-14 and its first reference in bits 0-12; LSP_CELL_NO_CHILD: none. */
LSP_BEGIN(LspCellNode)
  LSP_UINT box_0;
  LSP_UINT box_1;
  LSP_UINT box_2;
  LSP_UINT children;
LSP_END(LspCellNode)
#define LSP_CELL_LEAF_BIT 0x8000u
#define LSP_CELL_LEAF_COUNT_SHIFT 13u
#define LSP_CELL_MAX_REFERENCES 0x2000u
#define LSP_CELL_NO_CHILD 0xFFFFu
#define LSP_MAX_CELL_DEPTH 30u /* edges from the root of a cell's tree to its deepest leaf */

LSP_BEGIN(LspTriangle)
  LSP_VEC3 v0;
  LSP_UINT primitive; /* number in import order */
  LSP_VEC3 v1;
  LSP_UINT material; /* index of LspMaterial, 0 without materials */
  LSP_VEC3 v2;
  LSP_UINT flags; /* LSP_TRIANGLE_* */
LSP_END(LspTriangle)

#define LSP_TRIANGLE_SMOOTH 0x1u /* the corner normals differ from one another */
/* Bits 16-31, with LSP_FEATURE_COVERAGE: so many of 65536 rays pass the triangle, which is there in part; 0:
 * it is solid. Which rays pass, a hash of ray and primitive says (lsp_passes in lsp/traverse.h). */
#define LSP_TRIANGLE_GAPS_SHIFT 16u
#define LSP_TRIANGLE_MAX_GAPS 0xFFFFu

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
LSP_STATIC_ASSERT(sizeof(LspCellGrid) == 64);
LSP_STATIC_ASSERT(sizeof(LspHeader) == 384);
LSP_STATIC_ASSERT(sizeof(LspSection) == 64);
LSP_STATIC_ASSERT(sizeof(LspNode) == 64);
LSP_STATIC_ASSERT(sizeof(LspWideNode) == 96);
LSP_STATIC_ASSERT(sizeof(LspCell) == 12);
LSP_STATIC_ASSERT(sizeof(LspFilledCell) == 48);
LSP_STATIC_ASSERT(sizeof(LspPlane) == 16);
LSP_STATIC_ASSERT(sizeof(LspSplit) == 8);
LSP_STATIC_ASSERT(sizeof(LspCellNode) == 16);
LSP_STATIC_ASSERT(sizeof(LspTriangle) == 48);
LSP_STATIC_ASSERT(sizeof(LspCornerNormals) == 12);
LSP_STATIC_ASSERT(sizeof(LspMaterial) == 48);
LSP_STATIC_ASSERT(sizeof(LspLineSpace) == 64);
LSP_STATIC_ASSERT(sizeof(LspBitWord) == 8);
#undef LSP_STATIC_ASSERT
#endif

#endif /* LSP_LAYOUT_H */
