// Which buffers a scene needs on a device, and the pieces of their upload. Arithmetic only.
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

}  // namespace

extern "C" lsp_status lsp_vulkan_plan_buffers(const lsp_scene* scene, uint32_t uses,
                                              const lsp_vulkan_limits* limits, lsp_vulkan_plan* plan,
                                              lsp_error* error) {
  *plan = {};
  const uint32_t features = scene->header->required_features;
  if ((uses & LSP_USE_EXACT) != 0 && (features & LSP_FEATURE_EXACT) == 0) {
    return lsp::fail(error, LSP_ERROR_UNSUPPORTED, 0, "has no exact tree; trace it approximately");
  }
  if ((uses & LSP_USE_APPROXIMATE) != 0 &&
      (features & (LSP_FEATURE_EXACT | LSP_FEATURE_LINE_SPACES | LSP_FEATURE_CELLS)) == 0) {
    return lsp::fail(error, LSP_ERROR_UNSUPPORTED, 0, "has neither tables nor an exact tree");
  }
  if ((uses & LSP_USE_MATERIALS) != 0 && (features & LSP_FEATURE_MATERIALS) == 0) {
    return lsp::fail(error, LSP_ERROR_UNSUPPORTED, 0, "has no materials");
  }
  const bool cells = scene->header->base_structure == LSP_BASE_CELLS;
  plan->buffers[0] = {LSP_BINDING_HEADER, 0, 0, sizeof(LspHeader)};
  plan->buffer_count = 1;
  plan->bytes = sizeof(LspHeader);
  plan->base_structure = scene->header->base_structure;
  plan->exact_structure = (features & LSP_FEATURE_WIDE) != 0 ? LSP_BASE_WIDE
                          : cells                            ? LSP_BASE_BVH
                                                             : plan->base_structure;
  plan->addresses = (uses & LSP_USE_ADDRESSES_ALWAYS) != 0 ? 1 : 0;
  // Wide nodes alone answer approximate rays exactly.
  if (plan->base_structure == LSP_BASE_WIDE && (uses & LSP_USE_APPROXIMATE) != 0) uses |= LSP_USE_EXACT;
  for (const Wanted& wanted : kWanted) {
    if ((uses & wanted.uses) == 0) continue;
    // Approximate rays of cells never see the BVH.
    if (cells && wanted.base == LSP_BASE_BVH && (uses & LSP_USE_EXACT) == 0) continue;
    const LspSection* section = find_section(*scene, wanted.section);
    if (section == nullptr || section->bytes == 0) continue;
    const auto* name = reinterpret_cast<const char*>(&section->type);
    if (limits->max_buffer_size != 0 && section->bytes > limits->max_buffer_size) {
      return lsp::fail(
          error, LSP_ERROR_LIMIT, section->offset,
          "section %.4s has %llu bytes, buffers of this device have at most %llu (maxBufferSize); trace "
          "it on the CPU",
          name, print(section->bytes), print(limits->max_buffer_size));
    }
    const bool too_large = section->bytes > limits->max_storage_buffer_range;
    if (too_large && (uses & LSP_USE_ADDRESSES_IF_NEEDED) != 0) plan->addresses = 1;
    if (too_large && plan->addresses == 0) {
      return lsp::fail(error, LSP_ERROR_LIMIT, section->offset,
                       "section %.4s has %llu bytes, storage buffers of this device have at most %llu "
                       "(maxStorageBufferRange) and it has no buffer addresses; trace it on the CPU",
                       name, print(section->bytes), print(limits->max_storage_buffer_range));
    }
    plan->buffers[plan->buffer_count++] = {wanted.binding, wanted.section, section->offset, section->bytes};
    plan->bytes += section->bytes;
  }
  plan->usage = LSP_VULKAN_BUFFER_USAGE;
  if (plan->addresses != 0) plan->usage |= VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT;
  return lsp::succeed(error);
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
      copy->bytes = left < max_bytes ? left : max_bytes;
      *cursor += copy->bytes;
      return 1;
    }
    begin += buffer.bytes;
  }
  return 0;
}
