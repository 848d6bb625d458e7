// Recording into the engine's command buffers.
#include <algorithm>

#include "../src/error.h"
#include "lsp/lsp_vulkan.h"

namespace {

template <class Function>
bool load(VkDevice device, PFN_vkGetDeviceProcAddr get, const char* name, Function* function) {
  *function = reinterpret_cast<Function>(get(device, name));
  return *function != nullptr;
}

void write_binding(const lsp_vulkan_functions& functions, VkDevice device, VkDescriptorSet set,
                   uint32_t binding, VkBuffer buffer) {
  const VkDescriptorBufferInfo info{buffer, 0, VK_WHOLE_SIZE};
  VkWriteDescriptorSet write{};
  write.sType = VK_STRUCTURE_TYPE_WRITE_DESCRIPTOR_SET;
  write.dstSet = set;
  write.dstBinding = binding;
  write.descriptorCount = 1;
  write.descriptorType = VK_DESCRIPTOR_TYPE_STORAGE_BUFFER;
  write.pBufferInfo = &info;
  functions.update_descriptor_sets(device, 1, &write, 0, nullptr);
}

// All of a trace shader's; counters may be VK_NULL_HANDLE.
void write_bindings(const lsp_vulkan_functions& functions, VkDevice device, VkDescriptorSet set,
                    VkBuffer (&bound)[LSP_BINDING_COUNT], VkBuffer rays, VkBuffer hits, VkBuffer counters) {
  bound[LSP_BINDING_RAYS] = rays;
  bound[LSP_BINDING_HITS] = hits;
  if (counters != VK_NULL_HANDLE) bound[LSP_BINDING_COUNTERS] = counters;
  for (uint32_t i = 0; i < LSP_BINDING_COUNT; ++i) write_binding(functions, device, set, i, bound[i]);
}

void bind(const lsp_vulkan_functions& functions, VkCommandBuffer commands, VkPipeline pipeline,
          VkPipelineLayout layout, VkDescriptorSet set, const void* constants, uint32_t bytes) {
  functions.cmd_bind_pipeline(commands, VK_PIPELINE_BIND_POINT_COMPUTE, pipeline);
  functions.cmd_bind_descriptor_sets(commands, VK_PIPELINE_BIND_POINT_COMPUTE, layout, 0, 1, &set, 0,
                                     nullptr);
  functions.cmd_push_constants(commands, layout, VK_SHADER_STAGE_COMPUTE_BIT, 0, bytes, constants);
}

// One invocation a ray.
void record_dispatch(const lsp_vulkan_functions& functions, VkCommandBuffer commands, VkPipeline pipeline,
                     VkPipelineLayout layout, VkDescriptorSet set, const void* constants, uint32_t bytes,
                     uint32_t count) {
  bind(functions, commands, pipeline, layout, set, constants, bytes);
  functions.cmd_dispatch(commands, (count + LSP_VULKAN_GROUP_SIZE - 1) / LSP_VULKAN_GROUP_SIZE, 1, 1);
}

// What a pass or a transfer has written is there for the next pass.
void record_pass_barrier(const lsp_vulkan_functions& functions, VkCommandBuffer commands) {
  VkMemoryBarrier barrier{};
  barrier.sType = VK_STRUCTURE_TYPE_MEMORY_BARRIER;
  barrier.srcAccessMask = VK_ACCESS_SHADER_WRITE_BIT | VK_ACCESS_TRANSFER_WRITE_BIT;
  barrier.dstAccessMask =
      VK_ACCESS_SHADER_READ_BIT | VK_ACCESS_SHADER_WRITE_BIT | VK_ACCESS_INDIRECT_COMMAND_READ_BIT;
  functions.cmd_pipeline_barrier(commands,
                                 VK_PIPELINE_STAGE_COMPUTE_SHADER_BIT | VK_PIPELINE_STAGE_TRANSFER_BIT,
                                 VK_PIPELINE_STAGE_COMPUTE_SHADER_BIT | VK_PIPELINE_STAGE_DRAW_INDIRECT_BIT,
                                 0, 1, &barrier, 0, nullptr, 0, nullptr);
}

// Nobody waits for a pass yet.
void record_queue_head(const lsp_vulkan_functions& functions, VkCommandBuffer commands, VkBuffer queue) {
  uint32_t head[LSP_VULKAN_QUEUE_HEAD]{};
  for (uint32_t pass = 0; pass < LSP_VULKAN_PASSES; ++pass) head[4 * pass + 2] = head[4 * pass + 3] = 1;
  functions.cmd_update_buffer(commands, queue, 0, sizeof head, head);
}

}  // namespace

extern "C" lsp_status lsp_vulkan_load_functions(VkDevice device, PFN_vkGetDeviceProcAddr get,
                                                lsp_vulkan_functions* functions, lsp_error* error) {
  *functions = {};
  const bool all = load(device, get, "vkCmdCopyBuffer", &functions->cmd_copy_buffer) &&
                   load(device, get, "vkCmdPipelineBarrier", &functions->cmd_pipeline_barrier) &&
                   load(device, get, "vkCmdBindPipeline", &functions->cmd_bind_pipeline) &&
                   load(device, get, "vkCmdBindDescriptorSets", &functions->cmd_bind_descriptor_sets) &&
                   load(device, get, "vkCmdPushConstants", &functions->cmd_push_constants) &&
                   load(device, get, "vkCmdDispatch", &functions->cmd_dispatch) &&
                   load(device, get, "vkCmdDispatchIndirect", &functions->cmd_dispatch_indirect) &&
                   load(device, get, "vkCmdUpdateBuffer", &functions->cmd_update_buffer) &&
                   load(device, get, "vkUpdateDescriptorSets", &functions->update_descriptor_sets);
  if (!all) return lsp::fail(error, LSP_ERROR_UNSUPPORTED, 0, "the device lacks a function of Vulkan 1.0");
  return lsp::succeed(error);
}

extern "C" void lsp_vulkan_record_copy(const lsp_vulkan_functions* functions, VkCommandBuffer commands,
                                       const lsp_vulkan_copy* copy, VkBuffer staging,
                                       VkDeviceSize staging_offset, VkBuffer destination) {
  const VkBufferCopy region{staging_offset, copy->buffer_offset, copy->bytes};
  functions->cmd_copy_buffer(commands, staging, destination, 1, &region);
}

extern "C" void lsp_vulkan_record_upload_barrier(const lsp_vulkan_functions* functions,
                                                 VkCommandBuffer commands) {
  VkMemoryBarrier barrier{};
  barrier.sType = VK_STRUCTURE_TYPE_MEMORY_BARRIER;
  barrier.srcAccessMask = VK_ACCESS_TRANSFER_WRITE_BIT;
  barrier.dstAccessMask = VK_ACCESS_SHADER_READ_BIT;
  functions->cmd_pipeline_barrier(commands, VK_PIPELINE_STAGE_TRANSFER_BIT,
                                  VK_PIPELINE_STAGE_ALL_COMMANDS_BIT, 0, 1, &barrier, 0, nullptr, 0, nullptr);
}

extern "C" void lsp_vulkan_address_table(const lsp_vulkan_plan* plan, const VkDeviceAddress* buffer_addresses,
                                         VkDeviceAddress table[LSP_VULKAN_ADDRESS_COUNT]) {
  for (uint32_t i = 0; i < LSP_VULKAN_ADDRESS_COUNT; ++i) table[i] = 0;
  for (uint32_t i = 0; i < plan->buffer_count; ++i) {
    const uint32_t binding = plan->buffers[i].binding;
    if (binding >= LSP_BINDING_NODES && binding <= LSP_BINDING_CELL_NODES) {
      table[binding - LSP_BINDING_NODES] = buffer_addresses[i];
    }
  }
}

extern "C" void lsp_vulkan_write_address_table(const lsp_vulkan_functions* functions, VkDevice device,
                                               VkDescriptorSet set, VkBuffer table) {
  write_binding(*functions, device, set, LSP_BINDING_NODES, table);
}

extern "C" void lsp_vulkan_layout_bindings(VkDescriptorSetLayoutBinding bindings[LSP_BINDING_COUNT]) {
  for (uint32_t i = 0; i < LSP_BINDING_COUNT; ++i) {
    bindings[i] = {i, VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, 1, VK_SHADER_STAGE_COMPUTE_BIT, nullptr};
  }
}

extern "C" void lsp_vulkan_write_descriptors(const lsp_vulkan_functions* functions, VkDevice device,
                                             VkDescriptorSet set, const lsp_vulkan_plan* plan,
                                             const VkBuffer* buffers, VkBuffer rays, VkBuffer hits,
                                             VkBuffer counters) {
  VkBuffer bound[LSP_BINDING_COUNT];
  std::fill_n(bound, LSP_BINDING_COUNT, buffers[0]);
  // With addresses the sections need no descriptors, and may be too large for them.
  for (uint32_t i = 0; i < plan->buffer_count && plan->addresses == 0; ++i) {
    if (plan->buffers[i].binding < LSP_BINDING_COUNT) bound[plan->buffers[i].binding] = buffers[i];
  }
  write_bindings(*functions, device, set, bound, rays, hits, counters);
}

extern "C" void lsp_vulkan_write_instance_descriptors(const lsp_vulkan_functions* functions, VkDevice device,
                                                      VkDescriptorSet set, VkBuffer assets,
                                                      VkBuffer instances, VkBuffer pool, VkBuffer rays,
                                                      VkBuffer hits, VkBuffer counters) {
  VkBuffer bound[LSP_BINDING_COUNT];
  std::fill_n(bound, LSP_BINDING_COUNT, assets);
  bound[LSP_BINDING_INSTANCES] = instances;
  if (pool != VK_NULL_HANDLE) std::fill_n(&bound[LSP_BINDING_POOL], 3, pool);
  write_bindings(*functions, device, set, bound, rays, hits, counters);
}

extern "C" uint32_t lsp_vulkan_max_rays(const lsp_vulkan_limits* limits) {
  // Rays and hits have 32 bytes; indices of their 16-byte words are 32-bit in the shader.
  uint64_t rays = uint64_t{limits->max_group_count} * LSP_VULKAN_GROUP_SIZE;
  const uint64_t in_range = limits->max_storage_buffer_range / sizeof(LspRay);
  if (rays > in_range) rays = in_range;
  return rays > 0x7FFFFFFFu ? 0x7FFFFFFFu : static_cast<uint32_t>(rays);
}

extern "C" void lsp_vulkan_record_trace(const lsp_vulkan_functions* functions, VkCommandBuffer commands,
                                        VkPipeline pipeline, VkPipelineLayout layout, VkDescriptorSet set,
                                        const lsp_vulkan_trace_constants* constants) {
  record_dispatch(*functions, commands, pipeline, layout, set, constants, sizeof *constants,
                  constants->count);
}

extern "C" VkDeviceSize lsp_vulkan_queue_bytes(uint32_t rays) {
  return (LSP_VULKAN_QUEUE_HEAD + 2 * VkDeviceSize{rays}) * sizeof(uint32_t);
}

extern "C" void lsp_vulkan_write_queue(const lsp_vulkan_functions* functions, VkDevice device,
                                       VkDescriptorSet set, VkBuffer queue) {
  write_binding(*functions, device, set, LSP_BINDING_QUEUE, queue);
}

extern "C" void lsp_vulkan_record_passes(const lsp_vulkan_functions* functions, VkCommandBuffer commands,
                                         const VkPipeline* pipelines, VkPipelineLayout layout,
                                         VkDescriptorSet set, VkBuffer queue,
                                         const lsp_vulkan_trace_constants* constants) {
  record_queue_head(*functions, commands, queue);
  record_pass_barrier(*functions, commands);
  lsp_vulkan_pass_constants pass{0, constants->first, constants->count, constants->dial};
  record_dispatch(*functions, commands, pipelines[LSP_VULKAN_FIRST_PASS], layout, set, &pass, sizeof pass,
                  pass.count);
  for (pass.pass = 1; pass.pass < LSP_VULKAN_PASSES; ++pass.pass) {
    record_pass_barrier(*functions, commands);
    const bool last = pass.pass == LSP_VULKAN_PASSES - 1;
    const uint32_t kind = last ? LSP_VULKAN_LAST_PASS : LSP_VULKAN_CALL_PASS;
    bind(*functions, commands, pipelines[kind], layout, set, &pass, sizeof pass);
    functions->cmd_dispatch_indirect(commands, queue, (4 * VkDeviceSize{pass.pass} + 1) * sizeof(uint32_t));
  }
}

extern "C" void lsp_vulkan_record_instances(const lsp_vulkan_functions* functions, VkCommandBuffer commands,
                                            VkPipeline pipeline, VkPipelineLayout layout, VkDescriptorSet set,
                                            const lsp_vulkan_instance_constants* constants) {
  record_dispatch(*functions, commands, pipeline, layout, set, constants, sizeof *constants,
                  constants->count);
}
