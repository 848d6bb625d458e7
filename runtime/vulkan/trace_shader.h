// What a device of our own needs to run the trace shader: layouts, descriptor sets, pipelines.
#pragma once

#include "device.h"

namespace lsp {

class TraceShader {
 public:
  // `sets`: how many descriptor sets there can be.
  TraceShader(Device& device, uint32_t sets);
  ~TraceShader();
  TraceShader(const TraceShader&) = delete;
  TraceShader& operator=(const TraceShader&) = delete;

  // Lasts as long as the shader.
  VkDescriptorSet allocate_set();
  // A pipeline of this SPIR-V for traces of this kind. The caller destroys it.
  VkPipeline create_pipeline(const uint32_t* words, size_t bytes, const lsp_vulkan_kind& kind);
  VkPipelineLayout layout() const { return layout_; }

 private:
  void create(uint32_t sets);
  void destroy() noexcept;

  Device& device_;
  VkDescriptorSetLayout set_layout_ = VK_NULL_HANDLE;
  VkPipelineLayout layout_ = VK_NULL_HANDLE;
  VkDescriptorPool pool_ = VK_NULL_HANDLE;
};

}  // namespace lsp
