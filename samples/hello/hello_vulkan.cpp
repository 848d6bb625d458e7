// The smallest use of liblsp on Vulkan: FILE.lsp goes to the device, and the ready shader, specialized for
// it, traces one ray, from above onto the scene's centre. An engine has what is not marked [lsp], here
// Vulkan-Hpp's.
#include <cmath>
#include <cstdio>
#include <cstring>
#include <vulkan/vulkan_raii.hpp>

#include "lsp/lsp.hpp"
#include "lsp/lsp_vulkan.h"

namespace raii = vk::raii;
using lsp::throw_unless_ok;

// A storage buffer that the host writes and reads; an engine's are the device's own, filled by staging.
struct Buffer {
  raii::Buffer buffer;
  raii::DeviceMemory memory = nullptr;
  std::byte* mapped;
  Buffer(const raii::PhysicalDevice& physical, const raii::Device& device, uint64_t bytes)
      : buffer(device, vk::BufferCreateInfo({}, bytes, vk::BufferUsageFlags(LSP_VULKAN_BUFFER_USAGE))) {
    constexpr auto kWanted =
        vk::MemoryPropertyFlagBits::eHostVisible | vk::MemoryPropertyFlagBits::eHostCoherent;
    const vk::MemoryRequirements needs = buffer.getMemoryRequirements();
    const auto types = physical.getMemoryProperties().memoryTypes;
    uint32_t type = 0;  // Vulkan promises that there is one
    while (!(needs.memoryTypeBits >> type & 1) || (types[type].propertyFlags & kWanted) != kWanted) ++type;
    memory = device.allocateMemory({needs.size, type});
    buffer.bindMemory(*memory, 0);
    mapped = static_cast<std::byte*>(memory.mapMemory(0, VK_WHOLE_SIZE));
  }
};

static LspHit trace(const lsp_scene& scene, const LspRay& ray) {
  // The first device, and a queue of its first family, which computes with every driver of a desktop.
  const raii::Context context;
  const vk::ApplicationInfo application("hello_vulkan", 0, nullptr, 0, VK_API_VERSION_1_1);
  const raii::Instance instance(context, vk::InstanceCreateInfo({}, &application));
  const raii::PhysicalDevice physical = raii::PhysicalDevices(instance).front();
  const float priority = 1;
  const vk::DeviceQueueCreateInfo queues({}, 0, 1, &priority);
  vk::PhysicalDeviceFeatures features;
  features.robustBufferAccess = true;  // nobody has validated the file
  const raii::Device device(physical, vk::DeviceCreateInfo({}, queues, {}, {}, &features));

  // [lsp] The buffers that approximate rays need, filled with the file's sections as they are.
  lsp_error error;
  lsp_vulkan_functions functions;
  const PFN_vkGetDeviceProcAddr get = instance.getDispatcher()->vkGetDeviceProcAddr;
  throw_unless_ok(lsp_vulkan_load_functions(*device, get, &functions, &error), error);
  const vk::PhysicalDeviceLimits has = physical.getProperties().limits;
  const lsp_vulkan_limits limits{has.maxStorageBufferRange, 0, has.maxComputeWorkGroupCount[0], 0};
  lsp_vulkan_plan plan;
  throw_unless_ok(lsp_vulkan_plan_buffers(&scene, LSP_USE_APPROXIMATE, &limits, &plan, &error), error);
  std::vector<Buffer> buffers;
  std::vector<VkBuffer> handles;
  for (uint32_t i = 0; i < plan.buffer_count; ++i)
    handles.push_back(*buffers.emplace_back(physical, device, plan.buffers[i].bytes).buffer);
  lsp_vulkan_copy piece;
  for (uint64_t cursor = 0; lsp_vulkan_next_copy(&scene, &plan, 1 << 20, &cursor, &piece) != 0;)
    std::memcpy(buffers[piece.buffer].mapped + piece.buffer_offset, piece.source, piece.bytes);
  const Buffer rays(physical, device, sizeof(LspRay)), hits(physical, device, sizeof(LspHit));
  std::memcpy(rays.mapped, &ray, sizeof ray);

  // [lsp] The ready shader's pipeline: what neither this file nor this kind of trace needs is compiled away.
  lsp_vulkan_kind kind;
  const lsp_trace_options options{LSP_TRACE_APPROXIMATE, 0};
  throw_unless_ok(lsp_vulkan_plan_trace(&scene, &plan, &options, &kind, &error), error);
  const vk::SpecializationMapEntry entries[] = {
      {LSP_VULKAN_STACK_CONSTANT, offsetof(lsp_vulkan_kind, stack), 4},
      {LSP_VULKAN_FLAGS_CONSTANT, offsetof(lsp_vulkan_kind, flags), 4},
      {LSP_VULKAN_PARTS_CONSTANT, offsetof(lsp_vulkan_kind, parts), 4}};
  const vk::SpecializationInfo constants(3, entries, sizeof kind, &kind);
  vk::ShaderModuleCreateInfo code;
  code.pCode = lsp_vulkan_trace_spirv(&plan, 0, &code.codeSize);
  const raii::ShaderModule module(device, code);
  std::vector<vk::DescriptorSetLayoutBinding> bound(LSP_BINDING_COUNT);
  lsp_vulkan_layout_bindings(reinterpret_cast<VkDescriptorSetLayoutBinding*>(bound.data()));
  const raii::DescriptorSetLayout set_layout(device, vk::DescriptorSetLayoutCreateInfo({}, bound));
  constexpr auto kCompute = vk::ShaderStageFlagBits::eCompute;
  const vk::PushConstantRange push(kCompute, 0, sizeof(lsp_vulkan_trace_constants));
  const raii::PipelineLayout layout(device, vk::PipelineLayoutCreateInfo({}, *set_layout, push));
  const vk::PipelineShaderStageCreateInfo stage({}, kCompute, *module, "main", &constants);
  const raii::Pipeline pipeline(device, nullptr, vk::ComputePipelineCreateInfo({}, stage, *layout));

  // [lsp] One set for the scene, the rays and the hits, one dispatch for all rays.
  const vk::DescriptorPoolSize size(vk::DescriptorType::eStorageBuffer, LSP_BINDING_COUNT);
  const raii::DescriptorPool pool(device, vk::DescriptorPoolCreateInfo({}, 1, size));
  const auto sets = (*device).allocateDescriptorSets({*pool, *set_layout}, *device.getDispatcher());
  lsp_vulkan_write_descriptors(&functions, *device, sets[0], &plan, handles.data(), *rays.buffer,
                               *hits.buffer, nullptr);
  const raii::CommandPool command_pool(device, vk::CommandPoolCreateInfo({}, 0));
  const raii::CommandBuffers buffer(device, {*command_pool, vk::CommandBufferLevel::ePrimary, 1});
  const raii::CommandBuffer& commands = buffer[0];
  commands.begin({});
  const lsp_vulkan_trace_constants all_rays{.lod = 0, .first = 0, .count = 1, .dial = kind.dial};
  lsp_vulkan_record_trace(&functions, *commands, *pipeline, *layout, sets[0], &all_rays);
  const vk::MemoryBarrier written(vk::AccessFlagBits::eShaderWrite, vk::AccessFlagBits::eHostRead);
  commands.pipelineBarrier(vk::PipelineStageFlagBits::eComputeShader, vk::PipelineStageFlagBits::eHost, {},
                           written, {}, {});
  commands.end();
  device.getQueue(0, 0).submit(vk::SubmitInfo({}, {}, *commands));
  device.waitIdle();
  return *reinterpret_cast<const LspHit*>(hits.mapped);
}

int main(int argc, char** argv) try {
  if (argc != 2) return std::fputs("usage: hello_vulkan FILE.lsp\n", stderr), 1;
  const lsp::SceneFile file(argv[1]);
  const lsp_float3 lo = file.header().bounds_min, hi = file.header().bounds_max;
  const LspRay ray{{(lo.x + hi.x) / 2, 2 * hi.y - lo.y, (lo.z + hi.z) / 2}, 0, {0, -1, 0}, INFINITY};
  const LspHit hit = trace(file.scene(), ray);
  if (hit.primitive == LSP_NONE) return std::puts("no hit"), 0;
  std::printf("hit triangle %u at distance %g\n", hit.primitive, static_cast<double>(hit.t));
} catch (const lsp::Error& error) {
  return std::fprintf(stderr, "hello_vulkan: %s: %s\n", argv[1], error.what()), error.status();
} catch (const vk::Error& error) {
  return std::fprintf(stderr, "hello_vulkan: no Vulkan device can be used: %s\n", error.what()), 5;
}
