#include "offset_shader.h"

#include <cstring>

#include "trace_shader.h"

namespace lsp::test {
namespace {

#include "shaders.inc"

Buffer host_buffer(Device& device, uint64_t bytes, const void* contents) {
  Buffer buffer(device, bytes, VK_BUFFER_USAGE_STORAGE_BUFFER_BIT, kHostMemory, 0);
  if (contents != nullptr) std::memcpy(buffer.mapped(), contents, bytes);
  return buffer;
}

// The shader looks at headers alone: the sections need not be anywhere.
std::vector<lsp_vulkan_asset> describe(const Instances& instances, const lsp_vulkan_limits& limits) {
  std::vector<lsp_vulkan_asset> assets;
  for (const lsp_scene* scene : instances.assets()) {
    const VkDeviceAddress nowhere[LSP_VULKAN_MAX_BUFFERS] = {};
    const lsp_trace_options exact{};
    lsp_vulkan_plan plan;
    lsp_error error;
    lsp_status status = lsp_vulkan_plan_buffers(scene, LSP_USE_EXACT, &limits, &plan, &error);
    if (status == LSP_OK)
      status = lsp_vulkan_describe_asset(scene, &plan, nowhere, &exact, &assets.emplace_back(), &error);
    if (status != LSP_OK) throw Failure(static_cast<Exit>(status), "", error.message);
  }
  return assets;
}

void run(Device& device, const Buffer& assets, const Buffer& instances, const Buffer& hits,
         const Buffer& offsets, uint32_t count) {
  constexpr VkPipelineBindPoint kCompute = VK_PIPELINE_BIND_POINT_COMPUTE;
  constexpr lsp_vulkan_kind kKind{0, 1, 0, 0, 0, 0};  // no trace, but a stack has an entry at least
  TraceShader shader(device, 1);
  const VkDescriptorSet set = shader.allocate_set();
  lsp_vulkan_write_instance_descriptors(&device.functions, device.handle, set, assets.handle(),
                                        instances.handle(), VK_NULL_HANDLE, hits.handle(), offsets.handle(),
                                        VK_NULL_HANDLE);
  const VkPipeline pipeline = shader.create_pipeline(instance_offset, sizeof instance_offset, kKind);
  Commands commands(device);
  const VkCommandBuffer recorded = commands.record();
  device.vk.vkCmdBindPipeline(recorded, kCompute, pipeline);
  device.vk.vkCmdBindDescriptorSets(recorded, kCompute, shader.layout(), 0, 1, &set, 0, nullptr);
  device.vk.vkCmdDispatch(recorded, (count + LSP_VULKAN_GROUP_SIZE - 1) / LSP_VULKAN_GROUP_SIZE, 1, 1);
  commands.submit();
  commands.wait();
  device.vk.vkDestroyPipeline(device.handle, pipeline, nullptr);
}

}  // namespace

std::vector<float> offsets_on_device(const Instances& instances, const std::vector<LspHit>& hits) {
  Device device(VulkanOptions{});
  const std::vector<lsp_vulkan_asset> described = describe(instances, device.limits);
  const Buffer assets = host_buffer(device, described.size() * sizeof described[0], described.data());
  const Buffer placed = host_buffer(device, lsp_instances_bytes(instances.size()), instances.view().records);
  const Buffer given = host_buffer(device, hits.size() * sizeof(LspHit), hits.data());
  std::vector<float> result(hits.size());
  const Buffer offsets = host_buffer(device, result.size() * sizeof(float), nullptr);
  run(device, assets, placed, given, offsets, static_cast<uint32_t>(hits.size()));
  std::memcpy(result.data(), offsets.mapped(), result.size() * sizeof(float));
  return result;
}

}  // namespace lsp::test
