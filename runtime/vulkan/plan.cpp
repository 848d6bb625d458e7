// Which buffers a scene needs on a device, the pieces of their upload, and what a trace needs of a pipeline.
// Arithmetic only.
#include <algorithm>
#include <cstddef>

#include "../src/error.h"
#include "lsp/lsp_vulkan.h"

namespace {

// The sections behind the bindings, in the order of the plan.
struct Wanted {
  uint32_t binding;
  uint32_t section;
  uint32_t uses;  // any of these asks for it
  uint32_t base;  // of its base structure, 0: any
};
constexpr Wanted kWanted[] = {
#define LSP_ARRAY_SECTION(Name, TYPE, code, Element, flag, base, feature, owed, member, counter, per, uses, \
                          binding)                                                                          \
  {binding, LSP_SECTION_##TYPE, uses, base},
#include "lsp/sections.def"
};

const LspSection* find_section(const lsp_scene& scene, uint32_t type) {
  for (uint32_t i = 0; i < scene.header->section_count; ++i) {
    if (scene.sections[i].type == type) return &scene.sections[i];
  }
  return nullptr;
}

unsigned long long print(uint64_t value) { return value; }

bool has_tables(const LspHeader& header) {
  return (header.required_features & (LSP_FEATURE_LINE_SPACES | LSP_FEATURE_CELLS)) != 0;
}

// `uses` in terms of what the file has.
uint32_t plain_uses(const LspHeader& header, uint32_t uses) {
  const uint32_t by_tables = LSP_USE_APPROXIMATE | LSP_USE_TABLES;
  if ((uses & by_tables) == 0) return uses;
  if (!has_tables(header)) uses |= LSP_USE_EXACT;  // which answers approximate rays, too
  return uses | (header.base_structure == LSP_BASE_CELLS ? LSP_USE_TABLES : by_tables);
}

// Whether a section of the file is read by traces for these uses, which are plain.
bool is_read(const Wanted& wanted, uint32_t uses, const LspHeader& header) {
  const bool exact = (uses & LSP_USE_EXACT) != 0;
  const bool tables = (uses & LSP_USE_TABLES) != 0;
  const bool cells = header.base_structure == LSP_BASE_CELLS;
  if ((wanted.uses & (uses | (tables ? LSP_USE_APPROXIMATE : 0u))) == 0) return false;
  // Approximate rays of cells never see the BVH.
  if (cells && wanted.base == LSP_BASE_BVH && !exact) return false;
  const bool tables_alone = cells && !exact && (uses & LSP_USE_APPROXIMATE) == 0;
  if (wanted.section == LSP_SECTION_CNOD || wanted.section == LSP_SECTION_CREF)
    return (uses & LSP_USE_APPROXIMATE) != 0;
  if ((uses & LSP_USE_OCCLUSION) == 0) return true;
  // Candidates are compared with the normals at them where their angle has a limit.
  if (wanted.section == LSP_SECTION_NRML)
    return tables && has_tables(header) && !cells && header.normal_angle_cos > -1.0f;
  if (wanted.section == LSP_SECTION_TRIA)
    return !tables_alone || (header.required_features & LSP_FEATURE_COVERAGE) != 0;
  return true;
}

lsp_status check_uses(const LspHeader& header, uint32_t uses, lsp_error* error) {
  constexpr uint32_t kKnown = LSP_USE_EXACT | LSP_USE_APPROXIMATE | LSP_USE_MATERIALS | LSP_USE_TABLES |
                              LSP_USE_OCCLUSION | LSP_USE_ADDRESSES_IF_NEEDED | LSP_USE_ADDRESSES_ALWAYS;
  if (const uint32_t unknown = uses & ~kKnown; unknown != 0) {
    return lsp::fail(error, LSP_ERROR_UNSUPPORTED, 0,
                     "library version %s does not know uses 0x%x: leave them out or link a newer one",
                     LSP_LIBRARY_VERSION_STRING, unknown);
  }
  const uint32_t features = header.required_features;
  if ((uses & LSP_USE_EXACT) != 0 && (features & LSP_FEATURE_EXACT) == 0) {
    return lsp::fail(error, LSP_ERROR_UNSUPPORTED, 0, "has no exact tree; trace it approximately");
  }
  if ((uses & (LSP_USE_APPROXIMATE | LSP_USE_TABLES)) != 0 &&
      (features & (LSP_FEATURE_EXACT | LSP_FEATURE_LINE_SPACES | LSP_FEATURE_CELLS)) == 0) {
    return lsp::fail(error, LSP_ERROR_UNSUPPORTED, 0, "has neither tables nor an exact tree");
  }
  if ((uses & LSP_USE_MATERIALS) != 0 && (features & LSP_FEATURE_MATERIALS) == 0) {
    return lsp::fail(error, LSP_ERROR_UNSUPPORTED, 0, "has no materials");
  }
  return LSP_OK;
}

// Refuses what no buffer of the device can hold, and switches the plan to addresses where these help.
lsp_status check_size(const LspSection& section, uint32_t uses, const lsp_vulkan_limits& limits,
                      lsp_vulkan_plan* plan, lsp_error* error) {
  const auto* name = reinterpret_cast<const char*>(&section.type);
  if (limits.max_buffer_size != 0 && section.bytes > limits.max_buffer_size) {
    return lsp::fail(
        error, LSP_ERROR_LIMIT, section.offset,
        "section %.4s has %llu bytes, buffers of this device have at most %llu (maxBufferSize); trace "
        "it on the CPU",
        name, print(section.bytes), print(limits.max_buffer_size));
  }
  const bool too_large = section.bytes > limits.max_storage_buffer_range;
  if (too_large && (uses & LSP_USE_ADDRESSES_IF_NEEDED) != 0) plan->addresses = 1;
  if (too_large && plan->addresses == 0) {
    return lsp::fail(error, LSP_ERROR_LIMIT, section.offset,
                     "section %.4s has %llu bytes, storage buffers of this device have at most %llu "
                     "(maxStorageBufferRange) and it has no buffer addresses; trace it on the CPU",
                     name, print(section.bytes), print(limits.max_storage_buffer_range));
  }
  return LSP_OK;
}

// The number of the plan's buffer of that section; buffer_count: it has none.
uint32_t find_buffer(const lsp_vulkan_plan& plan, const lsp_vulkan_buffer& wanted) {
  uint32_t i = 0;
  while (i < plan.buffer_count && plan.buffers[i].section != wanted.section) ++i;
  return i;
}

}  // namespace

extern "C" lsp_status lsp_vulkan_plan_buffers(const lsp_scene* scene, uint32_t uses,
                                              const lsp_vulkan_limits* limits, lsp_vulkan_plan* plan,
                                              lsp_error* error) {
  *plan = {};
  const LspHeader& header = *scene->header;
  if (const lsp_status status = check_uses(header, uses, error); status != LSP_OK) return status;
  uses = plain_uses(header, uses);
  plan->uses = uses;
  plan->buffers[0] = {LSP_BINDING_HEADER, 0, 0, sizeof(LspHeader)};
  plan->buffer_count = 1;
  plan->bytes = sizeof(LspHeader);
  plan->base_structure = header.base_structure;
  plan->exact_structure = (header.required_features & LSP_FEATURE_WIDE) != 0 ? LSP_BASE_WIDE
                          : header.base_structure == LSP_BASE_CELLS          ? LSP_BASE_BVH
                                                                             : header.base_structure;
  plan->addresses = (uses & LSP_USE_ADDRESSES_ALWAYS) != 0 ? 1 : 0;
  for (const Wanted& wanted : kWanted) {
    if (!is_read(wanted, uses, header)) continue;
    const LspSection* section = find_section(*scene, wanted.section);
    if (section == nullptr || section->bytes == 0) continue;
    if (const lsp_status status = check_size(*section, uses, *limits, plan, error); status != LSP_OK)
      return status;
    plan->buffers[plan->buffer_count++] = {wanted.binding, wanted.section, section->offset, section->bytes};
    plan->bytes += section->bytes;
  }
  plan->usage = LSP_VULKAN_BUFFER_USAGE;
  if (plan->addresses != 0) plan->usage |= VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT;
  return lsp::succeed(error);
}

extern "C" lsp_status lsp_vulkan_change_plan(const lsp_scene* scene, const lsp_vulkan_plan* old,
                                             uint32_t uses, const lsp_vulkan_limits* limits,
                                             lsp_vulkan_plan* plan, lsp_vulkan_change* change,
                                             lsp_error* error) {
  *change = {};
  lsp_vulkan_plan whole;
  const lsp_status status = lsp_vulkan_plan_buffers(scene, uses, limits, &whole, error);
  *plan = whole;
  if (status != LSP_OK) return status;
  // Buffers that can be read as the new plan reads them.
  const bool usable = (whole.usage & ~old->usage) == 0;
  plan->buffer_count = 0;
  for (uint32_t pass = 0; pass < 2; ++pass) {  // what is there first
    const bool kept = pass == 0;
    for (uint32_t i = 0; i < whole.buffer_count; ++i) {
      const uint32_t from = find_buffer(*old, whole.buffers[i]);
      if ((usable && from < old->buffer_count) != kept) continue;
      change->from[plan->buffer_count] = kept ? from : LSP_NONE;
      (kept ? change->bytes_kept : change->bytes_added) += whole.buffers[i].bytes;
      plan->buffers[plan->buffer_count++] = whole.buffers[i];
    }
    if (kept) change->kept = plan->buffer_count;
  }
  change->bytes_dropped = old->bytes - change->bytes_kept;
  return LSP_OK;
}

extern "C" lsp_status lsp_vulkan_check_import(const lsp_scene* scene, const lsp_vulkan_limits* limits,
                                              lsp_error* error) {
  const uint64_t alignment = limits->import_alignment;
  if (alignment == 0) {
    return lsp::fail(error, LSP_ERROR_UNSUPPORTED, 0,
                     "the device cannot import host memory (VK_EXT_external_memory_host)");
  }
  if (reinterpret_cast<uintptr_t>(scene->bytes) % alignment != 0 || scene->size % alignment != 0) {
    return lsp::fail(
        error, LSP_ERROR_UNSUPPORTED, 0,
        "address or size (%llu bytes) is not a multiple of %llu, the device's import alignment; bake "
        "with --align %u",
        print(scene->size), print(alignment), alignment > 4096 ? 65536u : 4096u);
  }
  return lsp::succeed(error);
}

extern "C" uint32_t lsp_vulkan_parts(const lsp_scene* scene) {
  const LspHeader& header = *scene->header;
  uint32_t parts = 0;
  if ((header.required_features & LSP_FEATURE_BINARY) != 0) parts |= LSP_PART_BINARY;
  if (header.normal_angle_cos > -1.0f) parts |= LSP_PART_NORMAL_ANGLE;
  if (header.plane_tolerance > 0.0f) parts |= LSP_PART_PLANE_TOLERANCE;
  if (scene->cell_references != nullptr) parts |= LSP_PART_CELL_EXACT;
  if ((header.required_features & LSP_FEATURE_COVERAGE) != 0) parts |= LSP_PART_COVERAGE;
  return parts;
}

extern "C" lsp_status lsp_vulkan_plan_trace(const lsp_scene* scene, const lsp_vulkan_plan* plan,
                                            const lsp_trace_options* options, lsp_vulkan_kind* kind,
                                            lsp_error* error) {
  *kind = {};
  // What the file or the library does not have, the tracer itself says.
  const lsp_status status = lsp_trace(scene, options, nullptr, nullptr, 0, nullptr, error);
  if (status != LSP_OK) return status;
  const LspHeader& header = *scene->header;
  const bool approximate = (options->flags & LSP_TRACE_APPROXIMATE) != 0 && has_tables(header);
  if ((plan->uses & (approximate ? LSP_USE_TABLES : LSP_USE_EXACT)) == 0)
    return lsp::fail(error, LSP_ERROR_UNSUPPORTED, 0, "is not loaded for %s rays; load it for LSP_USE_%s",
                     approximate ? "approximate" : "exact", approximate ? "APPROXIMATE" : "EXACT");
  if ((plan->uses & LSP_USE_OCCLUSION) != 0 && (options->flags & LSP_TRACE_OCCLUSION) == 0)
    return lsp::fail(error, LSP_ERROR_UNSUPPORTED, 0,
                     "is loaded for occlusion alone; trace it with LSP_TRACE_OCCLUSION or load it without "
                     "LSP_USE_OCCLUSION");
  const bool cells = approximate && header.base_structure == LSP_BASE_CELLS;
  // Flags that have no meaning together make no pipeline of their own.
  uint32_t flags = LSP_TRACE_IMPLIED(options->flags) & (LSP_TRACE_ANY_HIT | LSP_TRACE_OCCLUSION);
  if (approximate) flags |= LSP_TRACE_APPROXIMATE;
  if (approximate && !cells) {
    const bool near = (options->flags & LSP_TRACE_NEAR_APPROXIMATE) != 0;
    flags |= options->flags & (near ? LSP_TRACE_NEAR_APPROXIMATE : LSP_TRACE_NEAR_SKIP);
  }
  const bool exact_cells = (plan->uses & LSP_USE_APPROXIMATE) != 0;
  kind->base_structure = approximate ? plan->base_structure : plan->exact_structure;
  kind->stack = header.max_stack > 1 ? header.max_stack : 1;
  kind->flags = flags;
  kind->addresses = plan->addresses;
  kind->dial = !cells ? 0 : exact_cells ? lsp_dial(scene, options) : LSP_DIAL_TABLES;
  kind->parts = lsp_vulkan_parts(scene);
  if (cells && kind->dial == LSP_DIAL_TABLES) kind->parts &= ~LSP_PART_CELL_EXACT;
  return lsp::succeed(error);
}

extern "C" int lsp_vulkan_has_passes(const lsp_vulkan_kind* kind) {
  return kind->base_structure == LSP_BASE_CELLS && (kind->parts & LSP_PART_CELL_EXACT) != 0 ? 1 : 0;
}

// What kind of trace options ask for of an asset, by the shader of instances.
static lsp_status plan_asset(const lsp_scene* asset, const lsp_vulkan_plan* plan,
                             const lsp_trace_options* options, lsp_vulkan_kind* kind, lsp_error* error) {
  const lsp_status status = lsp_vulkan_plan_trace(asset, plan, options, kind, error);
  if (status != LSP_OK) return status;
  const uint32_t structure = kind->base_structure;
  if (structure == LSP_BASE_CELLS || structure == LSP_BASE_WIDE) return LSP_OK;
  return lsp::fail(error, LSP_ERROR_UNSUPPORTED, 0,
                   "no shader of instances walks its %s; bake it with --base cells or wide, or trace it on "
                   "the CPU",
                   structure == LSP_BASE_NTREE ? "NTree" : "BVH");
}

extern "C" lsp_status lsp_vulkan_plan_instances(const lsp_scene* const* assets, const lsp_vulkan_plan* plans,
                                                uint32_t asset_count, const lsp_trace_options* options,
                                                lsp_vulkan_kind* kind, lsp_error* error) {
  *kind = {};
  kind->stack = 1;
  for (uint32_t i = 0; i < asset_count; ++i) {
    lsp_vulkan_kind of_asset;
    lsp_error why;
    const lsp_status status = plan_asset(assets[i], &plans[i], options, &of_asset, &why);
    if (status != LSP_OK) {
      *kind = {};
      return lsp::fail(error, status, why.offset, "asset %u: %s", i, why.message);
    }
    if (plans[i].addresses != plans[0].addresses) {
      *kind = {};
      return lsp::fail(error, LSP_ERROR_UNSUPPORTED, 0,
                       "asset %u is planned %s addresses, unlike asset 0; plan all with "
                       "LSP_USE_ADDRESSES_ALWAYS or none with LSP_USE_ADDRESSES_*",
                       i, plans[i].addresses != 0 ? "with" : "without");
    }
    kind->addresses = of_asset.addresses;
    kind->stack = std::max(kind->stack, of_asset.stack);
    kind->flags |= of_asset.flags;
    kind->parts |= of_asset.parts;
  }
  return lsp::succeed(error);
}

// As lsp_instances.glsl has it.
static_assert(sizeof(lsp_vulkan_asset) == 480 && offsetof(lsp_vulkan_asset, header) == 96);

// Of ranges of a buffer that are bound by themselves, the most that a device may ask for.
constexpr uint64_t kPlaceAlignment = 256;

extern "C" lsp_status lsp_vulkan_place_buffers(const lsp_vulkan_plan* plan, const lsp_vulkan_limits* limits,
                                               uint64_t* pool_bytes, VkDeviceAddress* places,
                                               lsp_error* error) {
  uint64_t end = *pool_bytes;
  for (uint32_t i = 0; i < plan->buffer_count; ++i) {
    places[i] = (end + kPlaceAlignment - 1) / kPlaceAlignment * kPlaceAlignment;
    end = places[i] + plan->buffers[i].bytes;
  }
  if (end > limits->max_storage_buffer_range)
    return lsp::fail(
        error, LSP_ERROR_LIMIT, 0,
        "the assets up to it have %llu bytes, storage buffers of this device at most %llu "
        "(maxStorageBufferRange); plan all with LSP_USE_ADDRESSES_ALWAYS or trace them on the CPU",
        print(end), print(limits->max_storage_buffer_range));
  *pool_bytes = end;
  return lsp::succeed(error);
}

extern "C" lsp_status lsp_vulkan_describe_asset(const lsp_scene* scene, const lsp_vulkan_plan* plan,
                                                const VkDeviceAddress* places,
                                                const lsp_trace_options* options, lsp_vulkan_asset* asset,
                                                lsp_error* error) {
  *asset = {};
  lsp_vulkan_kind kind;
  const lsp_status status = plan_asset(scene, plan, options, &kind, error);
  if (status != LSP_OK) return status;
  lsp_vulkan_address_table(plan, places, asset->sections);
  // A place in the pool is counted in what the shader reads at once, so that 32 bits of it are enough.
  if (plan->addresses == 0)
    for (VkDeviceAddress& place : asset->sections) place /= 16;
  asset->header = *scene->header;
  asset->dial = kind.dial;
  return LSP_OK;
}

extern "C" int lsp_vulkan_next_copy(const lsp_scene* scene, const lsp_vulkan_plan* plan, uint64_t max_bytes,
                                    uint64_t* cursor, lsp_vulkan_copy* copy) {
  // The cursor counts the bytes of all buffers laid one behind the other.
  uint64_t begin = 0;
  for (uint32_t i = 0; i < plan->buffer_count; ++i) {
    const lsp_vulkan_buffer& buffer = plan->buffers[i];
    if (*cursor < begin + buffer.bytes) {
      const uint64_t offset = *cursor - begin;
      const uint64_t left = buffer.bytes - offset;
      copy->buffer = i;
      copy->buffer_offset = offset;
      copy->source = static_cast<const unsigned char*>(scene->bytes) + buffer.file_offset + offset;
      copy->bytes = max_bytes == 0 || left < max_bytes ? left : max_bytes;
      *cursor += copy->bytes;
      return 1;
    }
    begin += buffer.bytes;
  }
  return 0;
}
