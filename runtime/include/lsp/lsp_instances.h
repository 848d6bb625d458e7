/* Instances: one baked asset at many places, without a new bake. A small tree over the instances' boxes is
 * built in memory of the caller's; rays find the instances in it and go on in the asset, moved to its space.
 *
 * As in lsp.h nothing is allocated, no thread started, nothing thrown; what is built is read-only, and any
 * number of threads may trace it. Moving instances are built again every frame: that takes microseconds for
 * hundreds of them.
 */
#ifndef LSP_INSTANCES_H
#define LSP_INSTANCES_H

#include "lsp/lsp.h"

#ifdef __cplusplus
extern "C" {
#endif

/* An asset at a place. */
typedef struct lsp_instance {
  uint32_t asset;      /* index of the assets given to lsp_instances_build */
  float transform[12]; /* object to scene space, three rows of four: scene = (t0 x + t1 y + t2 z + t3, ...).
                          Any affine one whose inverse exists: rotated, mirrored, scaled differently by axis,
                          sheared */
  uint32_t mask;       /* of its lowest 8 bits a ray's mask must share one */
  uint32_t user;       /* the caller's own; not looked at */
} lsp_instance;

/* Instances at most: hits have 24 bits for the number. */
#define LSP_MAX_INSTANCES 0xFFFFFFu

/* Of a hit: the number of the instance, in the order in which they were given. */
#define LSP_HIT_INSTANCE(hit) ((hit).flags >> LSP_HIT_INSTANCE_SHIFT)

/* What a trace needs of an instance. Shaders read it as ten times 16 bytes. */
typedef struct lsp_instance_record {
  lsp_instance instance; /* as given */
  float growth;          /* of boxes, by the distance that a ray comes from: see NUMERICS.md, Instances */
  float inverse[9];      /* scene to object space, rows, without the translation */
  float translation[3];  /* where in the scene the point lies that the asset's positions are relative to */
  float translation_rest[3]; /* what single precision leaves of it */
  uint32_t reserved_0;       /* zero */
  float lo[3];               /* box in scene space that holds the asset */
  float hi[3];               /* its other corner */
  uint32_t reserved_1[2];    /* zero */
} lsp_instance_record;

/* A node of the tree over instances; its children lie side by side. */
typedef struct lsp_instance_node {
  float lo[3];    /* box of what is below, in scene space */
  uint32_t child; /* the first of two nodes; with bit 31 set the number of an instance */
  float hi[3];    /* its other corner */
  float growth;   /* the largest of the instances below */
} lsp_instance_node;

/* The same tree with up to eight children a node, whose boxes lie side by side for vectors of the CPU: the
 * binary one with nodes left out. Lanes without a child come last: inside out, and LSP_NONE. */
typedef struct lsp_instance_wide_node {
  float lo[3][8];    /* by axis, of each child's box in scene space */
  float hi[3][8];    /* its other corner */
  float growth[8];   /* the largest of the instances below */
  uint32_t child[8]; /* index of a wide node; with bit 31 set the number of an instance */
} lsp_instance_wide_node;

/* Instances ready for rays: a view of the caller's memory and assets, nothing owned. */
typedef struct lsp_instances {
  const lsp_scene* const* assets;     /* as given */
  const lsp_instance_record* records; /* `count` of them, in the order given */
  const lsp_instance_node* nodes;     /* the root first; 2 count - 1 */
  const lsp_instance_wide_node* wide; /* the root first; of two instances at least */
  uint32_t asset_count;               /* of assets */
  uint32_t count;                     /* of instances */
} lsp_instances;

/* Bytes that lsp_instances_build needs for `count` instances: 375 each at most, of which shaders read the
 * first 224 count. */
LSP_API uint64_t lsp_instances_bytes(uint32_t count);

/* Makes `count` instances of the assets ready for rays, in memory[0, bytes), 16-byte aligned and at least
 * lsp_instances_bytes(count) long: what shaders read as well, see lsp/lsp_vulkan.h. `assets` (asset_count
 * pointers to open scenes, of any base structure, any of them for exact or approximate rays), the scenes and
 * the memory must outlive `out` and stay as they are; `instances` is copied. Object space is the input's of
 * the bake: where a file has an origin of its own (lsp_scene_origin), that is added.
 *
 * LSP_ERROR_INVALID, by the instance's number: a transform that is not finite, that has no inverse (its
 * determinant is under 2^-40 of the product of its columns' lengths) or that puts the asset beyond what a
 * float holds; an asset that is not there. LSP_ERROR_LIMIT: memory too small or not aligned, more than
 * LSP_MAX_INSTANCES. After an error `out` is empty and answers every ray with a miss. No instances at all is
 * not an error: `out` has the assets alone then, for lsp_vulkan_plan_instances, say. */
LSP_API lsp_status lsp_instances_build(const lsp_scene* const* assets, uint32_t asset_count,
                                       const lsp_instance* instances, uint32_t count, void* memory,
                                       uint64_t bytes, lsp_instances* out, lsp_error* error);

/* Traces rays[0, count), in scene space, into hits[0, count), in this thread, with some 160 KiB of its stack.
 * Only instances whose mask shares a bit with `mask` are seen. Hits as lsp_trace gives them, and
 *   - flags from bit 8 on are the instance's number: LSP_HIT_INSTANCE(hit);
 *   - primitive, u and v are those of the asset;
 *   - t counts in lengths of the ray's direction as always;
 *   - the normal is a unit vector of scene space, normal to the surface as it was moved: its side is kept,
 * what was outside is outside, in a mirrored instance, too. Of several instances hit at one t the lowest
 * number is named: the answer depends on neither the tree nor the order of rays. Hand it many rays at once:
 * those that are near the same instance are traced together.
 *
 * Adds to *counts unless it is NULL; nodes are then those of both kinds of trees. Errors are those of
 * lsp_trace, where any asset lacks what the options need, too, before anything is traced. */
LSP_API lsp_status lsp_trace_instances(const lsp_instances* instances, const lsp_trace_options* options,
                                       uint32_t mask, const LspRay* rays, LspHit* hits, uint64_t count,
                                       lsp_trace_counts* counts, lsp_error* error);

/* As lsp_hit_offset, of a hit of lsp_trace_instances: that of the asset, made longer as the instance's
 * transform makes lengths along the normal. 0 for a miss. */
LSP_API float lsp_instance_hit_offset(const lsp_instances* instances, const LspHit* hit);

#ifdef __cplusplus
}
#endif

#endif /* LSP_INSTANCES_H */
