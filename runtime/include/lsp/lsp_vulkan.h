/* liblsp on Vulkan: what an engine needs to put an open scene on its device and to trace there.
 *
 * The engine owns everything of Vulkan: instance, device, queue, memory, buffers, command buffers. The
 * library (lsp_vulkan) says which buffers to make and what goes where, and records copies and dispatches into
 * the engine's command buffers through function pointers the engine gives it. It loads no Vulkan loader,
 * creates no object, allocates nothing, waits for nothing and keeps no state.
 *
 *   lsp_scene --plan--> buffers (one a section) --+-- import: the mapping itself, each buffer at its file
 * offset
 *                                                 +-- upload: copies straight from the mapping, in pieces
 *
 * Shaders: include lsp/lsp.glsl in your own and bind the scene's buffers where the plan says, to bindings 0
 * to 11 (LSP_ADDRESSES defined where a section is too large for a storage buffer); or use the ready trace
 * shader here, which reads rays from a buffer and writes hits to another.
 *
 * Files that lsp-validate has not passed: switch robustBufferAccess on. lsp_open has checked the file's
 * frame, not the indices inside its sections, and the shader does not check them again.
 */
#ifndef LSP_LSP_VULKAN_H
#define LSP_LSP_VULKAN_H

#include <vulkan/vulkan_core.h>

#include "lsp/lsp.h"
#include "lsp/parts.h"

#ifdef __cplusplus
extern "C" {
#endif

/* ---- which buffers --------------------------------------------------------------------------------------
 */

/* What the scene is wanted for; a section that nothing asks for gets no buffer and is never read. */
#define LSP_USE_EXACT 0x1u       /* exact traces: NODE (of cells WNOD; NTree: GRID, CELL, REFS), TRIA, NRML */
#define LSP_USE_APPROXIMATE 0x2u /* approximate traces: these and the tables */
#define LSP_USE_MATERIALS 0x4u   /* MATL, for the engine's own shaders */
/* Approximate traces of cells from tables alone, at the dial LSP_DIAL_TABLES: without CNOD and CREF, by which
 * cells are traced exactly. Of files without cells it is LSP_USE_APPROXIMATE. */
#define LSP_USE_TABLES 0x8u
/* Besides the others: all that these traces are asked is whether there is something (LSP_TRACE_OCCLUSION).
 * Without NRML; from tables alone without TRIA, too, unless triangles are there in part. */
#define LSP_USE_OCCLUSION 0x10u

/* And whether sections may be read through buffer device addresses instead of descriptors, where the device's
 * bufferDeviceAddress feature is on. */
#define LSP_USE_ADDRESSES_IF_NEEDED 0x100u /* where one is larger than max_storage_buffer_range */
#define LSP_USE_ADDRESSES_ALWAYS 0x200u    /* descriptors are faster; for some assets of instances, below */

/* The header's, and one a section that binds. */
enum {
  LSP_VULKAN_MAX_BUFFERS = 1
#define LSP_ARRAY_SECTION(...) +1
#include "lsp/sections.def"
};

/* What the library has to know of the device. */
typedef struct lsp_vulkan_limits {
  uint64_t max_storage_buffer_range; /* VkPhysicalDeviceLimits::maxStorageBufferRange */
  uint64_t import_alignment; /* minImportedHostPointerAlignment; 0 without VK_EXT_external_memory_host */
  uint32_t max_group_count;  /* VkPhysicalDeviceLimits::maxComputeWorkGroupCount[0] */
  uint64_t
      max_buffer_size; /* VkPhysicalDeviceMaintenance4Properties::maxBufferSize; 0: the device does not say */
} lsp_vulkan_limits;

/* One buffer of the scene: file bytes [file_offset, file_offset + bytes) as they are. */
typedef struct lsp_vulkan_buffer {
  uint32_t binding;     /* LSP_BINDING_* */
  uint32_t section;     /* LSP_SECTION_*, 0: the header */
  uint64_t file_offset; /* of its first byte, in bytes */
  uint64_t bytes;       /* size of the buffer */
} lsp_vulkan_buffer;

/* The buffers to make; buffers[0] is the header's. */
typedef struct lsp_vulkan_plan {
  uint32_t buffer_count;                             /* of buffers in use */
  lsp_vulkan_buffer buffers[LSP_VULKAN_MAX_BUFFERS]; /* what to make */
  uint64_t bytes;                                    /* of all buffers together */
  VkBufferUsageFlags usage; /* of every buffer; an imported one can do without the transfer bit */
  uint32_t addresses; /* nonzero: the sections are read through addresses, see lsp_vulkan_address_table */
  uint32_t base_structure; /* LSP_BASE_*: the shader has to be made for it */
  uint32_t
      exact_structure; /* the same of exact rays alone: of cells LSP_BASE_WIDE, before 2.3 LSP_BASE_BVH */
  uint32_t uses;       /* LSP_USE_*: what can be traced with these buffers */
} lsp_vulkan_plan;

/* Usage of every buffer of a plan without addresses. */
#define LSP_VULKAN_BUFFER_USAGE (VK_BUFFER_USAGE_STORAGE_BUFFER_BIT | VK_BUFFER_USAGE_TRANSFER_DST_BIT)

/* Plans the buffers of an open scene for `uses` (LSP_USE_*). LSP_ERROR_UNSUPPORTED when the file lacks what
 * is asked for, or the library does not know it; LSP_ERROR_LIMIT when a section is larger than a buffer of
 * the device may be, or than a storage buffer's range and addresses were not allowed. */
LSP_API lsp_status lsp_vulkan_plan_buffers(const lsp_scene* scene, uint32_t uses,
                                           const lsp_vulkan_limits* limits, lsp_vulkan_plan* plan,
                                           lsp_error* error);

/* From one plan to the next, in buffers and bytes. */
typedef struct lsp_vulkan_change {
  uint32_t kept; /* buffers [0, kept) of the new plan are there already, the others are to be made */
  uint32_t from[LSP_VULKAN_MAX_BUFFERS]; /* which of the old plan's buffers each of those is */
  uint64_t bytes_kept;                   /* of those; there the cursor of lsp_vulkan_next_copy begins */
  uint64_t bytes_added;                  /* of the others */
  uint64_t bytes_dropped;                /* of buffers of the old plan that the new one does without */
} lsp_vulkan_change;

/* Plans as lsp_vulkan_plan_buffers what of the scene is to be on the device for `uses`, more or less than
 * now: of the plan `old`, of the same scene, what both need is kept. To load tables first and what exact rays
 * need later, or to give back what is no longer asked for. The new buffers come last, so that
 *
 *   uint64_t cursor = change.bytes_kept;
 *   while (lsp_vulkan_next_copy(scene, plan, max_bytes, &cursor, &copy)) ...
 *
 * uploads these alone; traces of the old plan may go on meanwhile, on its descriptor set. Where the new plan
 * reads through addresses and the old one did not, nothing is kept; of an old plan of zeros there is nothing.
 * `plan` and `old` are two. */
LSP_API lsp_status lsp_vulkan_change_plan(const lsp_scene* scene, const lsp_vulkan_plan* old, uint32_t uses,
                                          const lsp_vulkan_limits* limits, lsp_vulkan_plan* plan,
                                          lsp_vulkan_change* change, lsp_error* error);

/* ---- import: no copy ------------------------------------------------------------------------------------
 */

/* LSP_OK when address and size of the scene's bytes meet the device's alignment for importing host memory
 * (VK_EXT_external_memory_host), else LSP_ERROR_UNSUPPORTED and the reason. The engine then allocates memory
 * of scene->size bytes with VkImportMemoryHostPointerInfoEXT on scene->bytes, handle type HOST_ALLOCATION,
 * and binds each buffer (created with VkExternalMemoryBufferCreateInfo) at its file_offset. It has to check
 * for itself that the handle type is importable (vkGetPhysicalDeviceExternalBufferProperties), that a memory
 * type fits both pointer and buffers, and that file_offset meets the buffer's alignment; and to upload
 * instead whenever any step fails, a lost device at the first submit included. On a discrete device every
 * read would cross the bus: upload there. Free the memory before the mapping ends; no shader may write to it.
 */
LSP_API lsp_status lsp_vulkan_check_import(const lsp_scene* scene, const lsp_vulkan_limits* limits,
                                           lsp_error* error);

/* ---- upload: one copy -----------------------------------------------------------------------------------
 */

/* A piece of the upload: `bytes` bytes at `source` go to offset `buffer_offset` of plan->buffers[buffer]. */
typedef struct lsp_vulkan_copy {
  uint32_t buffer;        /* index of plan->buffers */
  uint64_t buffer_offset; /* in bytes */
  const void* source;     /* in the scene's bytes */
  uint64_t bytes;         /* of the piece */
} lsp_vulkan_copy;

/* The piece after *cursor (0 at first, then left alone), at most max_bytes long, with max_bytes 0 to the end
 * of its buffer; 0 when there is none left. Pieces of 1 MiB keep a cold mapping fast. Copy it to mapped
 * device-local memory, or to a staging buffer and record the transfer with lsp_vulkan_record_copy. */
LSP_API int lsp_vulkan_next_copy(const lsp_scene* scene, const lsp_vulkan_plan* plan, uint64_t max_bytes,
                                 uint64_t* cursor, lsp_vulkan_copy* copy);

/* ---- recording ------------------------------------------------------------------------------------------
 */

/* The functions the library calls, of the engine's device. */
typedef struct lsp_vulkan_functions {
  PFN_vkCmdCopyBuffer cmd_copy_buffer;                  /* vkCmdCopyBuffer */
  PFN_vkCmdPipelineBarrier cmd_pipeline_barrier;        /* vkCmdPipelineBarrier */
  PFN_vkCmdBindPipeline cmd_bind_pipeline;              /* vkCmdBindPipeline */
  PFN_vkCmdBindDescriptorSets cmd_bind_descriptor_sets; /* vkCmdBindDescriptorSets */
  PFN_vkCmdPushConstants cmd_push_constants;            /* vkCmdPushConstants */
  PFN_vkCmdDispatch cmd_dispatch;                       /* vkCmdDispatch */
  PFN_vkCmdDispatchIndirect cmd_dispatch_indirect;      /* vkCmdDispatchIndirect */
  PFN_vkCmdUpdateBuffer cmd_update_buffer;              /* vkCmdUpdateBuffer */
  PFN_vkUpdateDescriptorSets update_descriptor_sets;    /* vkUpdateDescriptorSets */
} lsp_vulkan_functions;

/* Fills *functions through the engine's vkGetDeviceProcAddr. LSP_ERROR_UNSUPPORTED if one is missing. */
LSP_API lsp_status lsp_vulkan_load_functions(VkDevice device, PFN_vkGetDeviceProcAddr get_device_proc_addr,
                                             lsp_vulkan_functions* functions, lsp_error* error);

/* Records one piece of the upload from `staging` into `destination`, the buffer of copy->buffer. */
LSP_API void lsp_vulkan_record_copy(const lsp_vulkan_functions* functions, VkCommandBuffer commands,
                                    const lsp_vulkan_copy* copy, VkBuffer staging,
                                    VkDeviceSize staging_offset, VkBuffer destination);

/* Records the barrier between the copies and the shaders that read them. */
LSP_API void lsp_vulkan_record_upload_barrier(const lsp_vulkan_functions* functions,
                                              VkCommandBuffer commands);

/* ---- the trace shader -----------------------------------------------------------------------------------
 */

/* The parts of the shader that a scene needs: LSP_PART_* of lsp/parts.h. The rest costs time where it is not
 * compiled away; with a part missing that a scene needs its answers are wrong. Cells: a pipeline for the dial
 * LSP_DIAL_TABLES alone does without LSP_PART_CELL_EXACT. */
LSP_API uint32_t lsp_vulkan_parts(const lsp_scene* scene);

/* A kind of trace: what a pipeline for it is made of, and its dial. `stack`, `flags` and `parts` are the
 * values of the specialization constants LSP_VULKAN_*_CONSTANT. */
typedef struct lsp_vulkan_kind {
  uint32_t base_structure; /* LSP_BASE_*: of the shader, as in a plan */
  uint32_t stack;          /* entries; several scenes may share the largest */
  uint32_t flags;          /* LSP_TRACE_*, those that make a difference */
  uint32_t parts;          /* LSP_PART_*; several scenes may share all that any of them needs */
  uint32_t dial;           /* lsp_vulkan_trace_constants.dial */
  uint32_t addresses;      /* nonzero: the shader reads sections through addresses, as of a plan */
  uint32_t pass; /* LSP_VULKAN_*_PASS, of the shader of passes; lsp_vulkan_plan_trace sets the first */
} lsp_vulkan_kind;

/* What kind of trace `options` ask for of the scene with the plan's buffers. What these do not hold is not
 * compiled in: cells of which tables alone are loaded have the dial LSP_DIAL_TABLES, whatever the quality;
 * LSP_ERROR_UNSUPPORTED, and which LSP_USE_* is missing, where a trace cannot do without, and as lsp_trace
 * for what the file or the library does not have. */
LSP_API lsp_status lsp_vulkan_plan_trace(const lsp_scene* scene, const lsp_vulkan_plan* plan,
                                         const lsp_trace_options* options, lsp_vulkan_kind* kind,
                                         lsp_error* error);

/* SPIR-V (for Vulkan 1.1, with addresses 1.2) of the trace shader for scenes planned like `plan` (of cells:
 * for approximate rays; for exact ones set base_structure of a copy to its exact_structure), entry point
 * "main"; with `counting` nonzero the one that adds to the counters. Only base_structure and addresses of the
 * plan matter; with addresses the device's bufferDeviceAddress feature must be on, else no feature is needed.
 * Sets *bytes to the size. The words live as long as the program. */
LSP_API const uint32_t* lsp_vulkan_trace_spirv(const lsp_vulkan_plan* plan, int counting, size_t* bytes);

/* The bindings of its descriptor set layout. */
LSP_API void lsp_vulkan_layout_bindings(VkDescriptorSetLayoutBinding bindings[LSP_BINDING_COUNT]);

/* Points `set` at the scene's buffers (in the plan's order), and at rays, hits and counters. What the scene
 * has no buffer for is bound to the header's. `counters` may be VK_NULL_HANDLE for the shader that does not
 * count; rays and hits may not, even where the engine's own shaders do not read them: any storage buffer will
 * do then. */
LSP_API void lsp_vulkan_write_descriptors(const lsp_vulkan_functions* functions, VkDevice device,
                                          VkDescriptorSet set, const lsp_vulkan_plan* plan,
                                          const VkBuffer* buffers, VkBuffer rays, VkBuffer hits,
                                          VkBuffer counters);

/* Plans with addresses: fills the table that the shader reads them from. `buffer_addresses` are those of the
 * plan's buffers in its order, from vkGetBufferDeviceAddress. The engine puts the table into a storage
 * buffer, and after lsp_vulkan_write_descriptors points the set at it with lsp_vulkan_write_address_table. */
LSP_API void lsp_vulkan_address_table(const lsp_vulkan_plan* plan, const VkDeviceAddress* buffer_addresses,
                                      VkDeviceAddress table[LSP_VULKAN_ADDRESS_COUNT]);
LSP_API void lsp_vulkan_write_address_table(const lsp_vulkan_functions* functions, VkDevice device,
                                            VkDescriptorSet set, VkBuffer table); /* that holds it */

/* Rays that one dispatch can trace on the device. */
LSP_API uint32_t lsp_vulkan_max_rays(const lsp_vulkan_limits* limits);

/* Records the dispatch: binds pipeline and set, pushes the constants, one invocation a ray. Barriers before
 * (rays written by earlier commands) and after (hits read by later ones) are the engine's.
 *
 * A hit whose flags have LSP_HIT_INCOMPLETE set was cut short by the device (lavapipe ends all loops of a
 * SIMD vector after 65,535 iterations) or by the header's declared bounds: trace that ray with lsp_trace. */
LSP_API void lsp_vulkan_record_trace(const lsp_vulkan_functions* functions, VkCommandBuffer commands,
                                     VkPipeline pipeline, VkPipelineLayout layout, VkDescriptorSet set,
                                     const lsp_vulkan_trace_constants* constants);

/* ---- cells in passes --------------------------------------------------------------------------------------
 *
 * A device runs invocations side by side, and of the rays through cells that it runs so, some are answered by
 * tables while others are traced exactly in a cell, for which all wait. In passes a ray that comes to such a
 * cell is left to the next dispatch, which takes all such rays side by side; a few times, and then to its
 * end. Same hits, on lavapipe 1.05 to 1.2 times as fast; worth its dispatches from some ten
 * thousand rays on. */

/* Usage of the queue, the buffer in which rays wait. */
#define LSP_VULKAN_QUEUE_USAGE                                                \
  (VK_BUFFER_USAGE_STORAGE_BUFFER_BIT | VK_BUFFER_USAGE_INDIRECT_BUFFER_BIT | \
   VK_BUFFER_USAGE_TRANSFER_DST_BIT)

/* Bytes of a queue for so many rays at once. */
LSP_API VkDeviceSize lsp_vulkan_queue_bytes(uint32_t rays);

/* Whether rays of this kind may wait: through cells, at another dial than LSP_DIAL_TABLES. */
LSP_API int lsp_vulkan_has_passes(const lsp_vulkan_kind* kind);

/* SPIR-V of the shader of passes, as of lsp_vulkan_trace_spirv, with the same layout and one specialization
 * constant more, LSP_VULKAN_PASS_CONSTANT, for LSP_VULKAN_PASS_KINDS pipelines. Of the kind only `addresses`
 * matters. It does not count: the trace shader does, the same work. */
LSP_API const uint32_t* lsp_vulkan_passes_spirv(const lsp_vulkan_kind* kind, size_t* bytes);

/* Points `set`, after lsp_vulkan_write_descriptors, at the queue. */
LSP_API void lsp_vulkan_write_queue(const lsp_vulkan_functions* functions, VkDevice device,
                                    VkDescriptorSet set, VkBuffer queue);

/* Records the dispatches in place of lsp_vulkan_record_trace, with the pipelines in the order of
 * LSP_VULKAN_*_PASS, what the queue begins with, and the barriers between them. Barriers before and after are
 * the engine's, of rays and hits as there, of the queue against its use by earlier commands. The hits are
 * read and written on the way. lod is not looked at. */
LSP_API void lsp_vulkan_record_passes(const lsp_vulkan_functions* functions, VkCommandBuffer commands,
                                      const VkPipeline pipelines[LSP_VULKAN_PASS_KINDS],
                                      VkPipelineLayout layout, VkDescriptorSet set, VkBuffer queue,
                                      const lsp_vulkan_trace_constants* constants);

/* ---- instances ------------------------------------------------------------------------------------------
 *
 * One shader walks the tree over instances (lsp/lsp_instances.h) and traces their assets, any mixture of
 * cells and of wide nodes alone. It reads three buffers: the pool, which holds the sections of all assets; an
 * lsp_vulkan_asset for every asset; and the memory of lsp_instances_build, as it is, again whenever instances
 * have moved. An engine's own shader includes lsp.glsl with LSP_INSTANCES defined; the ready one is here.
 *
 * Assets that are together larger than a storage buffer may be, or whose files are imported, are read through
 * buffer device addresses instead: every asset is planned with LSP_USE_ADDRESSES_ALWAYS, the device's
 * bufferDeviceAddress feature is on, the shader has LSP_ADDRESSES defined, and there is no pool. That is
 * slower on lavapipe.
 */

/* Places an asset's buffers in the pool, behind those that are there: buffer i of the plan at byte places[i],
 * a multiple of 256. *pool_bytes is the pool's size so far, 0 at first, and then with this asset. The pool is
 * one buffer of the plan's usage; a piece of the upload goes to offset places[copy.buffer] +
 * copy.buffer_offset. LSP_ERROR_LIMIT, and *pool_bytes as it was: the pool would be larger than the device's
 * storage buffers may be. */
LSP_API lsp_status lsp_vulkan_place_buffers(const lsp_vulkan_plan* plan, const lsp_vulkan_limits* limits,
                                            uint64_t* pool_bytes,
                                            VkDeviceAddress places[LSP_VULKAN_MAX_BUFFERS], lsp_error* error);

/* What the shader reads of an asset: 480 bytes of a storage buffer. */
typedef struct lsp_vulkan_asset {
  VkDeviceAddress sections[LSP_VULKAN_ADDRESS_COUNT]; /* as of lsp_vulkan_address_table; in the pool a
                                                         sixteenth of the place */
  uint32_t dial;     /* of the asset: how approximate rays are answered there */
  uint32_t reserved; /* zero */
  LspHeader header;  /* the asset's */
} lsp_vulkan_asset;

/* What kind of trace `options` ask for of instances of these assets (asset_count of them, with a plan each),
 * as lsp_vulkan_plan_trace of each: the largest stack, all flags and parts that any of them needs.
 * base_structure and dial are 0: there is one shader, and each asset's dial is in its lsp_vulkan_asset.
 * LSP_ERROR_UNSUPPORTED, by the asset's number, as lsp_vulkan_plan_trace and where the shader cannot answer
 * such rays of a file, which has a BVH or an NTree, or cells and for exact rays a BVH (files before 2.3); or
 * where some plans are with addresses and others are not. */
LSP_API lsp_status lsp_vulkan_plan_instances(const lsp_scene* const* assets, const lsp_vulkan_plan* plans,
                                             uint32_t asset_count, const lsp_trace_options* options,
                                             lsp_vulkan_kind* kind, lsp_error* error);

/* Fills *asset for a scene; `places` are those of lsp_vulkan_place_buffers, of one planned with addresses the
 * addresses of the plan's buffers in its order. Of `options` the dial is taken. Errors are those of
 * lsp_vulkan_plan_instances. */
LSP_API lsp_status lsp_vulkan_describe_asset(const lsp_scene* scene, const lsp_vulkan_plan* plan,
                                             const VkDeviceAddress* places, const lsp_trace_options* options,
                                             lsp_vulkan_asset* asset, lsp_error* error);

/* SPIR-V (for Vulkan 1.1, with addresses 1.2) of the trace shader of instances, as of lsp_vulkan_trace_spirv:
 * entry point, layout, specialization constants and life are the same. Of the kind only `addresses` matters.
 */
LSP_API const uint32_t* lsp_vulkan_instances_spirv(const lsp_vulkan_kind* kind, int counting, size_t* bytes);

/* Points `set`, of the trace shader's layout, at the buffers of assets and of instances, at the pool (with
 * addresses VK_NULL_HANDLE), and at rays, hits and counters; the last may be VK_NULL_HANDLE for the shader
 * that does not count. */
LSP_API void lsp_vulkan_write_instance_descriptors(const lsp_vulkan_functions* functions, VkDevice device,
                                                   VkDescriptorSet set, VkBuffer assets, VkBuffer instances,
                                                   VkBuffer pool, VkBuffer rays, VkBuffer hits,
                                                   VkBuffer counters);

/* Records the dispatch, as lsp_vulkan_record_trace; LSP_HIT_INCOMPLETE means the same, and
 * lsp_trace_instances traces that ray. */
LSP_API void lsp_vulkan_record_instances(const lsp_vulkan_functions* functions, VkCommandBuffer commands,
                                         VkPipeline pipeline, VkPipelineLayout layout, VkDescriptorSet set,
                                         const lsp_vulkan_instance_constants* constants);

#ifdef __cplusplus
}
#endif

#endif /* LSP_LSP_VULKAN_H */
