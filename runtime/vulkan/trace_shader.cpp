#include "trace_shader.h"

#include <cstddef>

namespace lsp {

TraceShader::TraceShader(Device& device, uint32_t sets) : device_(device) {
  try {
    create(sets);
  } catch (...) {
    destroy();
    throw;
  }
}

TraceShader::~TraceShader() { destroy(); }

void TraceShader::create(uint32_t sets) {
  VkDescriptorSetLayoutBinding bindings[LSP_BINDING_COUNT];
  lsp_vulkan_layout_bindings(bindings);
  auto set = vk_make<VkDescriptorSetLayoutCreateInfo>(VK_STRUCTURE_TYPE_DESCRIPTOR_SET_LAYOUT_CREATE_INFO);
  set.bindingCount = LSP_BINDING_COUNT;
  set.pBindings = bindings;
  check(device_.vk.vkCreateDescriptorSetLayout(device_.handle, &set, nullptr, &set_layout_),
        "vkCreateDescriptorSetLayout");
  const VkPushConstantRange push{VK_SHADER_STAGE_COMPUTE_BIT, 0, sizeof(lsp_vulkan_trace_constants)};
  auto layout = vk_make<VkPipelineLayoutCreateInfo>(VK_STRUCTURE_TYPE_PIPELINE_LAYOUT_CREATE_INFO);
  layout.setLayoutCount = 1;
  layout.pSetLayouts = &set_layout_;
  layout.pushConstantRangeCount = 1;
  layout.pPushConstantRanges = &push;
  check(device_.vk.vkCreatePipelineLayout(device_.handle, &layout, nullptr, &layout_),
        "vkCreatePipelineLayout");
  const VkDescriptorPoolSize size{VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, sets * LSP_BINDING_COUNT};
  auto pool = vk_make<VkDescriptorPoolCreateInfo>(VK_STRUCTURE_TYPE_DESCRIPTOR_POOL_CREATE_INFO);
  pool.maxSets = sets;
  pool.poolSizeCount = 1;
  pool.pPoolSizes = &size;
  check(device_.vk.vkCreateDescriptorPool(device_.handle, &pool, nullptr, &pool_), "vkCreateDescriptorPool");
}

void TraceShader::destroy() noexcept {
  device_.vk.vkDestroyDescriptorPool(device_.handle, pool_, nullptr);
  device_.vk.vkDestroyPipelineLayout(device_.handle, layout_, nullptr);
  device_.vk.vkDestroyDescriptorSetLayout(device_.handle, set_layout_, nullptr);
}

VkDescriptorSet TraceShader::allocate_set() {
  auto info = vk_make<VkDescriptorSetAllocateInfo>(VK_STRUCTURE_TYPE_DESCRIPTOR_SET_ALLOCATE_INFO);
  info.descriptorPool = pool_;
  info.descriptorSetCount = 1;
  info.pSetLayouts = &set_layout_;
  VkDescriptorSet set = VK_NULL_HANDLE;
  check(device_.vk.vkAllocateDescriptorSets(device_.handle, &info, &set), "vkAllocateDescriptorSets");
  return set;
}

VkPipeline TraceShader::create_pipeline(const uint32_t* words, size_t bytes, const lsp_vulkan_kind& kind) {
  auto code = vk_make<VkShaderModuleCreateInfo>(VK_STRUCTURE_TYPE_SHADER_MODULE_CREATE_INFO);
  code.pCode = words;
  code.codeSize = bytes;
  VkShaderModule module = VK_NULL_HANDLE;
  check(device_.vk.vkCreateShaderModule(device_.handle, &code, nullptr, &module), "vkCreateShaderModule");
  const VkSpecializationMapEntry entries[] = {
      {LSP_VULKAN_STACK_CONSTANT, offsetof(lsp_vulkan_kind, stack), sizeof(uint32_t)},
      {LSP_VULKAN_FLAGS_CONSTANT, offsetof(lsp_vulkan_kind, flags), sizeof(uint32_t)},
      {LSP_VULKAN_PARTS_CONSTANT, offsetof(lsp_vulkan_kind, parts), sizeof(uint32_t)},
      {LSP_VULKAN_PASS_CONSTANT, offsetof(lsp_vulkan_kind, pass), sizeof(uint32_t)}};
  const VkSpecializationInfo specialization{4, entries, sizeof kind, &kind};
  auto info = vk_make<VkComputePipelineCreateInfo>(VK_STRUCTURE_TYPE_COMPUTE_PIPELINE_CREATE_INFO);
  info.stage = vk_make<VkPipelineShaderStageCreateInfo>(VK_STRUCTURE_TYPE_PIPELINE_SHADER_STAGE_CREATE_INFO);
  info.stage.stage = VK_SHADER_STAGE_COMPUTE_BIT;
  info.stage.module = module;
  info.stage.pName = "main";
  info.stage.pSpecializationInfo = &specialization;
  info.layout = layout_;
  VkPipeline pipeline = VK_NULL_HANDLE;
  const VkResult result =
      device_.vk.vkCreateComputePipelines(device_.handle, VK_NULL_HANDLE, 1, &info, nullptr, &pipeline);
  device_.vk.vkDestroyShaderModule(device_.handle, module, nullptr);
  check(result, "vkCreateComputePipelines");
  return pipeline;
}

}  // namespace lsp
