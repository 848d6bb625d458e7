#include "offset_shader.h"

#include <cstring>

#include "device.h"
#include "lsp/lsp_vulkan.h"

namespace lsp::test {
namespace {

constexpr uint32_t kCode[] =
#include "instance_offset.spv.inc"
    ;
constexpr VkMemoryPropertyFlags kHost =
    VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT | VK_MEMORY_PROPERTY_HOST_COHERENT_BIT;

Buffer host_buffer(Device& device, uint64_t bytes, const void* contents) {
  Buffer buffer(device, bytes, VK_BUFFER_USAGE_STORAGE_BUFFER_BIT, kHost, 0);
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
    lsp_status status =
        lsp_vulkan_plan_buffers(scene, LSP_USE_EXACT | LSP_USE_ADDRESSES_ALWAYS, &limits, &plan, &error);
    if (status == LSP_OK)
      status = lsp_vulkan_describe_asset(scene, &plan, nowhere, &exact, &assets.emplace_back(), &error);
    if (status != LSP_OK) throw Failure(static_cast<Exit>(status), "", error.message);
  }
  return assets;
}

// The pipeline, its layout and its set, for as long as it lives.
class OffsetShader {
 public:
  explicit OffsetShader(Device& device) : device_(device), vk_(device.vk) {
    VkDescriptorSetLayoutBinding bindings[LSP_BINDING_COUNT];
    lsp_vulkan_layout_bindings(bindings);
    VkDescriptorSetLayoutCreateInfo set_info{VK_STRUCTURE_TYPE_DESCRIPTOR_SET_LAYOUT_CREATE_INFO, nullptr, 0,
                                             LSP_BINDING_COUNT, bindings};
    check(vk_.vkCreateDescriptorSetLayout(device_.handle, &set_info, nullptr, &set_layout_), "set layout");
    VkPipelineLayoutCreateInfo layout_info{};
    layout_info.sType = VK_STRUCTURE_TYPE_PIPELINE_LAYOUT_CREATE_INFO;
    layout_info.setLayoutCount = 1;
    layout_info.pSetLayouts = &set_layout_;
    check(vk_.vkCreatePipelineLayout(device_.handle, &layout_info, nullptr, &layout_), "pipeline layout");
    const VkDescriptorPoolSize size{VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, LSP_BINDING_COUNT};
    const VkDescriptorPoolCreateInfo pool{
        VK_STRUCTURE_TYPE_DESCRIPTOR_POOL_CREATE_INFO, nullptr, 0, 1, 1, &size};
    check(vk_.vkCreateDescriptorPool(device_.handle, &pool, nullptr, &pool_), "descriptor pool");
    const VkDescriptorSetAllocateInfo sets{VK_STRUCTURE_TYPE_DESCRIPTOR_SET_ALLOCATE_INFO, nullptr, pool_, 1,
                                           &set_layout_};
    check(vk_.vkAllocateDescriptorSets(device_.handle, &sets, &set_), "descriptor set");
    create_pipeline();
  }
  ~OffsetShader() {
    vk_.vkDestroyPipeline(device_.handle, pipeline_, nullptr);
    vk_.vkDestroyDescriptorPool(device_.handle, pool_, nullptr);
    vk_.vkDestroyPipelineLayout(device_.handle, layout_, nullptr);
    vk_.vkDestroyDescriptorSetLayout(device_.handle, set_layout_, nullptr);
  }
  OffsetShader(const OffsetShader&) = delete;
  OffsetShader& operator=(const OffsetShader&) = delete;

  void run(const Buffer& assets, const Buffer& instances, const Buffer& hits, const Buffer& offsets,
           uint32_t count) {
    lsp_vulkan_write_instance_descriptors(&device_.functions, device_.handle, set_, assets.handle(),
                                          instances.handle(), hits.handle(), offsets.handle(),
                                          VK_NULL_HANDLE);
    VkCommandBufferAllocateInfo allocation{VK_STRUCTURE_TYPE_COMMAND_BUFFER_ALLOCATE_INFO, nullptr,
                                           device_.pool, VK_COMMAND_BUFFER_LEVEL_PRIMARY, 1};
    VkCommandBuffer commands = VK_NULL_HANDLE;
    check(vk_.vkAllocateCommandBuffers(device_.handle, &allocation, &commands), "command buffer");
    VkCommandBufferBeginInfo begin{};
    begin.sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO;
    check(vk_.vkBeginCommandBuffer(commands, &begin), "vkBeginCommandBuffer");
    vk_.vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_COMPUTE, pipeline_);
    vk_.vkCmdBindDescriptorSets(commands, VK_PIPELINE_BIND_POINT_COMPUTE, layout_, 0, 1, &set_, 0, nullptr);
    vk_.vkCmdDispatch(commands, (count + LSP_VULKAN_GROUP_SIZE - 1) / LSP_VULKAN_GROUP_SIZE, 1, 1);
    VkFenceCreateInfo fence_info{};
    fence_info.sType = VK_STRUCTURE_TYPE_FENCE_CREATE_INFO;
    VkFence fence = VK_NULL_HANDLE;
    check(vk_.vkCreateFence(device_.handle, &fence_info, nullptr, &fence), "fence");
    device_.submit_and_wait(commands, fence);
    vk_.vkDestroyFence(device_.handle, fence, nullptr);
  }

 private:
  void create_pipeline() {
    const VkShaderModuleCreateInfo code{VK_STRUCTURE_TYPE_SHADER_MODULE_CREATE_INFO, nullptr, 0, sizeof kCode,
                                        kCode};
    VkShaderModule module = VK_NULL_HANDLE;
    check(vk_.vkCreateShaderModule(device_.handle, &code, nullptr, &module), "vkCreateShaderModule");
    VkComputePipelineCreateInfo info{};
    info.sType = VK_STRUCTURE_TYPE_COMPUTE_PIPELINE_CREATE_INFO;
    info.stage.sType = VK_STRUCTURE_TYPE_PIPELINE_SHADER_STAGE_CREATE_INFO;
    info.stage.stage = VK_SHADER_STAGE_COMPUTE_BIT;
    info.stage.module = module;
    info.stage.pName = "main";
    info.layout = layout_;
    const VkResult result =
        vk_.vkCreateComputePipelines(device_.handle, VK_NULL_HANDLE, 1, &info, nullptr, &pipeline_);
    vk_.vkDestroyShaderModule(device_.handle, module, nullptr);
    check(result, "vkCreateComputePipelines");
  }

  Device& device_;
  const VolkDeviceTable& vk_;
  VkDescriptorSetLayout set_layout_ = VK_NULL_HANDLE;
  VkPipelineLayout layout_ = VK_NULL_HANDLE;
  VkDescriptorPool pool_ = VK_NULL_HANDLE;
  VkDescriptorSet set_ = VK_NULL_HANDLE;
  VkPipeline pipeline_ = VK_NULL_HANDLE;
};

}  // namespace

std::vector<float> offsets_on_device(const Instances& instances, const std::vector<LspHit>& hits) {
  VulkanOptions options;
  options.addresses = true;  // without them this throws
  Device device(options);
  const std::vector<lsp_vulkan_asset> described = describe(instances, device.limits);
  const Buffer assets = host_buffer(device, described.size() * sizeof described[0], described.data());
  const Buffer placed = host_buffer(device, lsp_instances_bytes(instances.size()), instances.view().records);
  const Buffer given = host_buffer(device, hits.size() * sizeof(LspHit), hits.data());
  std::vector<float> result(hits.size());
  const Buffer offsets = host_buffer(device, result.size() * sizeof(float), nullptr);
  OffsetShader(device).run(assets, placed, given, offsets, static_cast<uint32_t>(hits.size()));
  std::memcpy(result.data(), offsets.mapped(), result.size() * sizeof(float));
  return result;
}

}  // namespace lsp::test
