// An .lsp file on the device: [lsp] marks what an engine adds for the library.
#pragma once

#include "gpu.h"
#include "interface.h"
#include "lsp/lsp_vulkan.h"
#include "render_scene.h"

namespace lsp::sample {

class DeviceScene {
 public:
  // Uploads the sections that exact and approximate rays need, and what shading needs beside them. Throws
  // lsp::Failure: kUnsupported, kLimit (a section is larger than the device's buffers may be).
  DeviceScene(Gpu& gpu, const RenderScene& scene);

  const lsp_scene& scene() const { return scene_; }
  const lsp_vulkan_plan& plan() const { return plan_; }
  const lsp_vulkan_functions& functions() const { return functions_; }
  const VkBuffer* sections() const { return handles_; }  // in the plan's order
  VkBuffer materials() const { return materials_.handle(); }
  VkBuffer triangles() const { return triangles_.handle(); }
  VkBuffer emitters() const { return emitters_.handle(); }
  uint32_t emitter_count() const { return emitter_count_; }

 private:
  void upload_sections(Gpu& gpu);
  GpuBuffer upload(Gpu& gpu, const void* bytes, uint64_t size, uint64_t largest);

  const lsp_scene& scene_;
  lsp_vulkan_plan plan_{};
  lsp_vulkan_functions functions_{};
  std::vector<GpuBuffer> sections_;
  VkBuffer handles_[LSP_VULKAN_MAX_BUFFERS]{};
  GpuBuffer staging_;
  GpuBuffer materials_, triangles_, emitters_;
  uint32_t emitter_count_ = 0;
};

}  // namespace lsp::sample
