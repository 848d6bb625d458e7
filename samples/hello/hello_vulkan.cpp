// The smallest use of liblsp with Vulkan: the engine's side of loading a file and tracing one ray on the
// device.
//
//   hello_vulkan FILE.lsp
//
// Everything here that is called vk* is what an engine has already; what it adds for liblsp is marked [lsp].
// An engine would keep the buffers in device-local memory; here they are host-visible, so that no staging is
// needed.
#include <vulkan/vulkan.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <vector>

#include "lsp/lsp_vulkan.h"

namespace {

// A Vulkan struct with its type set and all else zero.
template <typename Struct>
Struct make(VkStructureType type) {
  Struct out{};
  out.sType = type;
  return out;
}

void check(VkResult result, const char* what) {
  if (result == VK_SUCCESS) return;
  std::fprintf(stderr, "hello_vulkan: %s failed (%d)\n", what, result);
  std::exit(5);
}

void check(lsp_status status, const lsp_error& error, const char* file) {
  if (status == LSP_OK) return;
  std::fprintf(stderr, "hello_vulkan: %s: %s\n", file, error.message);
  std::exit(3);
}

struct Buffer {
  VkBuffer buffer = VK_NULL_HANDLE;
  VkDeviceMemory memory = VK_NULL_HANDLE;
  void* mapped = nullptr;
};

struct Device {
  VkInstance instance = VK_NULL_HANDLE;
  VkPhysicalDevice physical = VK_NULL_HANDLE;
  VkDevice device = VK_NULL_HANDLE;
  VkQueue queue = VK_NULL_HANDLE;
  uint32_t family = 0;

  // The first device with a compute queue, robust buffer access on.
  Device() {
    auto application = make<VkApplicationInfo>(VK_STRUCTURE_TYPE_APPLICATION_INFO);
    application.apiVersion = VK_API_VERSION_1_1;
    auto instance_info = make<VkInstanceCreateInfo>(VK_STRUCTURE_TYPE_INSTANCE_CREATE_INFO);
    instance_info.pApplicationInfo = &application;
    check(vkCreateInstance(&instance_info, nullptr, &instance), "vkCreateInstance");
    uint32_t count = 1;
    vkEnumeratePhysicalDevices(instance, &count, &physical);
    check(count == 1 ? VK_SUCCESS : VK_ERROR_INITIALIZATION_FAILED, "finding a Vulkan device");
    uint32_t families = 0;
    vkGetPhysicalDeviceQueueFamilyProperties(physical, &families, nullptr);
    std::vector<VkQueueFamilyProperties> properties(families);
    vkGetPhysicalDeviceQueueFamilyProperties(physical, &families, properties.data());
    while (family < families && (properties[family].queueFlags & VK_QUEUE_COMPUTE_BIT) == 0) ++family;
    const float priority = 1.0f;
    auto queue_info = make<VkDeviceQueueCreateInfo>(VK_STRUCTURE_TYPE_DEVICE_QUEUE_CREATE_INFO);
    queue_info.queueFamilyIndex = family;
    queue_info.queueCount = 1;
    queue_info.pQueuePriorities = &priority;
    VkPhysicalDeviceFeatures features{};
    features.robustBufferAccess = VK_TRUE;
    auto device_info = make<VkDeviceCreateInfo>(VK_STRUCTURE_TYPE_DEVICE_CREATE_INFO);
    device_info.queueCreateInfoCount = 1;
    device_info.pQueueCreateInfos = &queue_info;
    device_info.pEnabledFeatures = &features;
    check(vkCreateDevice(physical, &device_info, nullptr, &device), "vkCreateDevice");
    vkGetDeviceQueue(device, family, 0, &queue);
  }

  Buffer make_buffer(VkDeviceSize bytes, VkBufferUsageFlags usage) const {
    Buffer out;
    auto info = make<VkBufferCreateInfo>(VK_STRUCTURE_TYPE_BUFFER_CREATE_INFO);
    info.size = bytes;
    info.usage = usage;
    check(vkCreateBuffer(device, &info, nullptr, &out.buffer), "vkCreateBuffer");
    VkMemoryRequirements needs;
    vkGetBufferMemoryRequirements(device, out.buffer, &needs);
    VkPhysicalDeviceMemoryProperties memory;
    vkGetPhysicalDeviceMemoryProperties(physical, &memory);
    const VkMemoryPropertyFlags wanted =
        VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT | VK_MEMORY_PROPERTY_HOST_COHERENT_BIT;
    auto allocate = make<VkMemoryAllocateInfo>(VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_INFO);
    allocate.allocationSize = needs.size;
    for (uint32_t i = memory.memoryTypeCount; i-- > 0;) {
      const bool fits = (needs.memoryTypeBits >> i & 1u) != 0;
      if (fits && (memory.memoryTypes[i].propertyFlags & wanted) == wanted) allocate.memoryTypeIndex = i;
    }
    check(vkAllocateMemory(device, &allocate, nullptr, &out.memory), "vkAllocateMemory");
    check(vkBindBufferMemory(device, out.buffer, out.memory, 0), "vkBindBufferMemory");
    check(vkMapMemory(device, out.memory, 0, VK_WHOLE_SIZE, 0, &out.mapped), "vkMapMemory");
    return out;
  }
};

// The ready trace shader with the one set that it reads.
struct Pipeline {
  VkDescriptorSetLayout set_layout = VK_NULL_HANDLE;
  VkPipelineLayout layout = VK_NULL_HANDLE;
  VkShaderModule module = VK_NULL_HANDLE;
  VkPipeline pipeline = VK_NULL_HANDLE;
  VkDescriptorPool pool = VK_NULL_HANDLE;
  VkDescriptorSet set = VK_NULL_HANDLE;
};

// [lsp] A pipeline of the ready trace shader. An engine can include lsp/lsp.glsl in its own shaders instead.
Pipeline make_pipeline(const Device& gpu, const lsp_vulkan_plan& plan) {
  Pipeline out;
  VkDescriptorSetLayoutBinding bindings[LSP_BINDING_COUNT];
  lsp_vulkan_layout_bindings(bindings);
  auto set_layout_info =
      make<VkDescriptorSetLayoutCreateInfo>(VK_STRUCTURE_TYPE_DESCRIPTOR_SET_LAYOUT_CREATE_INFO);
  set_layout_info.bindingCount = LSP_BINDING_COUNT;
  set_layout_info.pBindings = bindings;
  check(vkCreateDescriptorSetLayout(gpu.device, &set_layout_info, nullptr, &out.set_layout),
        "vkCreateDescriptorSetLayout");
  const VkPushConstantRange push{VK_SHADER_STAGE_COMPUTE_BIT, 0, sizeof(lsp_vulkan_trace_constants)};
  auto layout_info = make<VkPipelineLayoutCreateInfo>(VK_STRUCTURE_TYPE_PIPELINE_LAYOUT_CREATE_INFO);
  layout_info.setLayoutCount = 1;
  layout_info.pSetLayouts = &out.set_layout;
  layout_info.pushConstantRangeCount = 1;
  layout_info.pPushConstantRanges = &push;
  check(vkCreatePipelineLayout(gpu.device, &layout_info, nullptr, &out.layout), "vkCreatePipelineLayout");
  auto module_info = make<VkShaderModuleCreateInfo>(VK_STRUCTURE_TYPE_SHADER_MODULE_CREATE_INFO);
  module_info.pCode = lsp_vulkan_trace_spirv(&plan, 0, &module_info.codeSize);
  check(vkCreateShaderModule(gpu.device, &module_info, nullptr, &out.module), "vkCreateShaderModule");
  auto pipeline_info = make<VkComputePipelineCreateInfo>(VK_STRUCTURE_TYPE_COMPUTE_PIPELINE_CREATE_INFO);
  pipeline_info.stage = {VK_STRUCTURE_TYPE_PIPELINE_SHADER_STAGE_CREATE_INFO,
                         nullptr,
                         0,
                         VK_SHADER_STAGE_COMPUTE_BIT,
                         out.module,
                         "main",
                         nullptr};
  pipeline_info.layout = out.layout;
  // The kind of trace is compiled in.
  const uint32_t flags = LSP_TRACE_APPROXIMATE;
  const VkSpecializationMapEntry flags_entry{LSP_VULKAN_FLAGS_CONSTANT, 0, sizeof flags};
  const VkSpecializationInfo specialization{1, &flags_entry, sizeof flags, &flags};
  pipeline_info.stage.pSpecializationInfo = &specialization;
  check(vkCreateComputePipelines(gpu.device, VK_NULL_HANDLE, 1, &pipeline_info, nullptr, &out.pipeline),
        "vkCreateComputePipelines");
  return out;
}

void add_set(const Device& gpu, Pipeline& out) {
  const VkDescriptorPoolSize pool_size{VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, LSP_BINDING_COUNT};
  auto pool_info = make<VkDescriptorPoolCreateInfo>(VK_STRUCTURE_TYPE_DESCRIPTOR_POOL_CREATE_INFO);
  pool_info.maxSets = 1;
  pool_info.poolSizeCount = 1;
  pool_info.pPoolSizes = &pool_size;
  check(vkCreateDescriptorPool(gpu.device, &pool_info, nullptr, &out.pool), "vkCreateDescriptorPool");
  auto set_info = make<VkDescriptorSetAllocateInfo>(VK_STRUCTURE_TYPE_DESCRIPTOR_SET_ALLOCATE_INFO);
  set_info.descriptorPool = out.pool;
  set_info.descriptorSetCount = 1;
  set_info.pSetLayouts = &out.set_layout;
  check(vkAllocateDescriptorSets(gpu.device, &set_info, &out.set), "vkAllocateDescriptorSets");
}

// [lsp] Records the dispatch of one ray, submits it and waits.
void trace(const Device& gpu, const lsp_vulkan_functions& functions, const Pipeline& with, uint32_t dial) {
  auto command_pool_info = make<VkCommandPoolCreateInfo>(VK_STRUCTURE_TYPE_COMMAND_POOL_CREATE_INFO);
  command_pool_info.queueFamilyIndex = gpu.family;
  VkCommandPool command_pool;
  check(vkCreateCommandPool(gpu.device, &command_pool_info, nullptr, &command_pool), "vkCreateCommandPool");
  auto commands_info = make<VkCommandBufferAllocateInfo>(VK_STRUCTURE_TYPE_COMMAND_BUFFER_ALLOCATE_INFO);
  commands_info.commandPool = command_pool;
  commands_info.commandBufferCount = 1;
  VkCommandBuffer commands;
  check(vkAllocateCommandBuffers(gpu.device, &commands_info, &commands), "vkAllocateCommandBuffers");
  const auto begin = make<VkCommandBufferBeginInfo>(VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO);
  check(vkBeginCommandBuffer(commands, &begin), "vkBeginCommandBuffer");
  const lsp_vulkan_trace_constants constants{.lod = 0.0f, .first = 0, .count = 1, .dial = dial};
  lsp_vulkan_record_trace(&functions, commands, with.pipeline, with.layout, with.set, &constants);
  VkMemoryBarrier done{.sType = VK_STRUCTURE_TYPE_MEMORY_BARRIER,
                       .pNext = nullptr,
                       .srcAccessMask = VK_ACCESS_SHADER_WRITE_BIT,
                       .dstAccessMask = VK_ACCESS_HOST_READ_BIT};
  vkCmdPipelineBarrier(commands, VK_PIPELINE_STAGE_COMPUTE_SHADER_BIT, VK_PIPELINE_STAGE_HOST_BIT, 0, 1,
                       &done, 0, nullptr, 0, nullptr);
  check(vkEndCommandBuffer(commands), "vkEndCommandBuffer");
  auto submit = make<VkSubmitInfo>(VK_STRUCTURE_TYPE_SUBMIT_INFO);
  submit.commandBufferCount = 1;
  submit.pCommandBuffers = &commands;
  check(vkQueueSubmit(gpu.queue, 1, &submit, VK_NULL_HANDLE), "vkQueueSubmit");
  check(vkQueueWaitIdle(gpu.queue), "vkQueueWaitIdle");
  vkDestroyCommandPool(gpu.device, command_pool, nullptr);
}

void destroy(const Device& gpu, const Pipeline& pipeline, const std::vector<Buffer>& buffers) {
  vkDestroyDescriptorPool(gpu.device, pipeline.pool, nullptr);
  vkDestroyPipeline(gpu.device, pipeline.pipeline, nullptr);
  vkDestroyShaderModule(gpu.device, pipeline.module, nullptr);
  vkDestroyPipelineLayout(gpu.device, pipeline.layout, nullptr);
  vkDestroyDescriptorSetLayout(gpu.device, pipeline.set_layout, nullptr);
  for (const Buffer& buffer : buffers) {
    vkDestroyBuffer(gpu.device, buffer.buffer, nullptr);
    vkFreeMemory(gpu.device, buffer.memory, nullptr);
  }
  vkDestroyDevice(gpu.device, nullptr);
  vkDestroyInstance(gpu.instance, nullptr);
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) {
    std::fprintf(stderr, "usage: hello_vulkan FILE.lsp\n");
    return 1;
  }
  const char* file = argv[1];
  const Device gpu;

  // [lsp] Open the file and ask which buffers it needs.
  lsp_error error{};
  lsp_mapping mapping{};
  lsp_scene scene{};
  lsp_vulkan_plan plan{};
  VkPhysicalDeviceProperties device_properties;
  vkGetPhysicalDeviceProperties(gpu.physical, &device_properties);
  const lsp_vulkan_limits limits{device_properties.limits.maxStorageBufferRange, 0,
                                 device_properties.limits.maxComputeWorkGroupCount[0], 0};
  check(lsp_map_file(file, &mapping, &error), error, file);
  check(lsp_open(mapping.bytes, mapping.size, &scene, &error), error, file);
  check(lsp_vulkan_plan_buffers(&scene, LSP_USE_APPROXIMATE, &limits, &plan, &error), error, file);

  // [lsp] Make them and copy the sections as they are.
  std::vector<Buffer> buffers;
  std::vector<VkBuffer> handles;
  for (uint32_t i = 0; i < plan.buffer_count; ++i) {
    buffers.push_back(gpu.make_buffer(plan.buffers[i].bytes, LSP_VULKAN_BUFFER_USAGE));
    handles.push_back(buffers.back().buffer);
  }
  lsp_vulkan_copy copy{};
  for (uint64_t cursor = 0; lsp_vulkan_next_copy(&scene, &plan, 1 << 20, &cursor, &copy) != 0;) {
    std::memcpy(static_cast<char*>(buffers[copy.buffer].mapped) + copy.buffer_offset, copy.source,
                copy.bytes);
  }

  // One ray from above onto the scene's centre, and room for its hit.
  const Buffer rays = gpu.make_buffer(sizeof(LspRay), VK_BUFFER_USAGE_STORAGE_BUFFER_BIT);
  const Buffer hits = gpu.make_buffer(sizeof(LspHit), VK_BUFFER_USAGE_STORAGE_BUFFER_BIT);
  const lsp_float3 lo = scene.header->bounds_min;
  const lsp_float3 hi = scene.header->bounds_max;
  const LspRay ray{
      {0.5f * (lo.x + hi.x), hi.y + 0.1f * (hi.y - lo.y), 0.5f * (lo.z + hi.z)}, 0.0f, {0, -1, 0}, INFINITY};
  std::memcpy(rays.mapped, &ray, sizeof ray);

  Pipeline pipeline = make_pipeline(gpu, plan);
  add_set(gpu, pipeline);
  lsp_vulkan_functions functions{};
  check(lsp_vulkan_load_functions(gpu.device, vkGetDeviceProcAddr, &functions, &error), error, file);
  lsp_vulkan_write_descriptors(&functions, gpu.device, pipeline.set, &plan, handles.data(), rays.buffer,
                               hits.buffer, VK_NULL_HANDLE);
  trace(gpu, functions, pipeline, scene.header->quality[LSP_QUALITY_BALANCED]);

  LspHit hit;
  std::memcpy(&hit, hits.mapped, sizeof hit);
  if (hit.primitive == LSP_NONE) {
    std::printf("no hit\n");
  } else {
    std::printf("%s: hit triangle %u at distance %g\n", device_properties.deviceName, hit.primitive,
                static_cast<double>(hit.t));
  }

  buffers.insert(buffers.end(), {rays, hits});
  destroy(gpu, pipeline, buffers);
  lsp_unmap_file(&mapping);
  return 0;
}
