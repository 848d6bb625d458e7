#include "instance_shaders.h"

#include <cstring>

#include "scene_buffers.h"
#include "trace_shader.h"

namespace lsp::test {
namespace {

#include "shaders.inc"

void or_throw(lsp_status status, const lsp_error& error) {
  if (status != LSP_OK) throw Failure(static_cast<Exit>(status), "", error.message);
}

Buffer host_buffer(Device& device, uint64_t bytes, const void* contents) {
  Buffer buffer(device, bytes, VK_BUFFER_USAGE_STORAGE_BUFFER_BIT, kHostMemory, 0);
  if (contents != nullptr) std::memcpy(buffer.mapped(), contents, bytes);
  return buffer;
}

// Assets on the device, and what a pipeline for rays of these options is made of.
struct Described {
  Buffer pool;
  Buffer assets;
  lsp_vulkan_kind kind{};
};

Described describe(Device& device, const std::vector<const lsp_scene*>& scenes,
                   const lsp_trace_options& options) {
  Described result;
  lsp_error error;
  PoolPlan plan;
  std::vector<lsp_vulkan_asset> assets;
  for (const lsp_scene* scene : scenes) {
    lsp_vulkan_plan& buffers = plan.buffers.emplace_back();
    VkDeviceAddress* const places = plan.places.emplace_back().data();
    or_throw(
        lsp_vulkan_plan_buffers(scene, LSP_USE_EXACT | LSP_USE_APPROXIMATE, &device.limits, &buffers, &error),
        error);
    or_throw(lsp_vulkan_place_buffers(&buffers, &device.limits, &plan.bytes, places, &error), error);
    or_throw(lsp_vulkan_describe_asset(scene, &buffers, places, &options, &assets.emplace_back(), &error),
             error);
  }
  SceneBuffers::upload_pool(device, scenes, plan, false, result.pool);
  or_throw(lsp_vulkan_plan_instances(scenes.data(), plan.buffers.data(), static_cast<uint32_t>(scenes.size()),
                                     &options, &result.kind, &error),
           error);
  result.assets = host_buffer(device, assets.size() * sizeof assets[0], assets.data());
  return result;
}

// `from` is bound where the trace shader reads rays, `to` where it writes hits.
void run(Device& device, const Described& described, VkBuffer instances, const uint32_t* words, size_t bytes,
         const Buffer& from, const Buffer& to, uint32_t count) {
  constexpr VkPipelineBindPoint kCompute = VK_PIPELINE_BIND_POINT_COMPUTE;
  TraceShader shader(device, 1);
  const VkDescriptorSet set = shader.allocate_set();
  lsp_vulkan_write_instance_descriptors(&device.functions, device.handle, set, described.assets.handle(),
                                        instances, described.pool.handle(), from.handle(), to.handle(),
                                        VK_NULL_HANDLE);
  const VkPipeline pipeline = shader.create_pipeline(words, bytes, described.kind);
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
  const Described described = describe(device, instances.assets(), {});
  const Buffer placed = host_buffer(device, lsp_instances_bytes(instances.size()), instances.view().records);
  const Buffer given = host_buffer(device, hits.size() * sizeof(LspHit), hits.data());
  std::vector<float> result(hits.size());
  const Buffer offsets = host_buffer(device, result.size() * sizeof(float), nullptr);
  run(device, described, placed.handle(), instance_offset, sizeof instance_offset, given, offsets,
      static_cast<uint32_t>(hits.size()));
  std::memcpy(result.data(), offsets.mapped(), result.size() * sizeof(float));
  return result;
}

std::vector<LspHit> hits_in_assets(const std::vector<const lsp_scene*>& assets,
                                   const lsp_trace_options& options, const std::vector<LspRay>& rays) {
  Device device(VulkanOptions{});
  const Described described = describe(device, assets, options);
  const Buffer given = host_buffer(device, rays.size() * sizeof(LspRay), rays.data());
  std::vector<LspHit> result(rays.size());
  const Buffer hits = host_buffer(device, result.size() * sizeof(LspHit), nullptr);
  // There are no instances: any buffer will do.
  run(device, described, given.handle(), asset_trace, sizeof asset_trace, given, hits,
      static_cast<uint32_t>(rays.size()));
  std::memcpy(result.data(), hits.mapped(), result.size() * sizeof(LspHit));
  return result;
}

}  // namespace lsp::test
