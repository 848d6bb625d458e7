// An .lsp file, or instances of several, on the device: [lsp] marks what an engine adds for the library.
#pragma once

#include "gpu.h"
#include "interface.h"
#include "lsp/lsp_vulkan.h"
#include "render_scene.h"

namespace lsp::sample {

class DeviceScene {
 public:
  // Uploads the sections that exact and approximate rays need, and what shading needs beside them. Throws
  // lsp::Failure: kUnsupported (instances: of what no shader traces, or on a device without buffer
  // addresses), kLimit (a section is larger than the device's buffers may be).
  DeviceScene(Gpu& gpu, const RenderScene& scene);

  // [lsp] What a pipeline for such rays is made of; of instances that of all assets, kInstancesShader.
  lsp_vulkan_kind kind(const lsp_trace_options& options) const;
  // [lsp] Instances: approximate rays are at the dial of these options from now on. Of one file that is in
  // its kind.
  void set_dial(const lsp_trace_options& options);
  // [lsp] Points a set of the library's layout at the scene. The ready trace shader's rays and hits are not
  // used here: `unused` may be any storage buffer.
  void write_set(VkDescriptorSet set, VkBuffer unused) const;

  VkBuffer materials() const { return materials_.handle(); }
  VkBuffer triangles() const { return triangles_.handle(); }
  VkBuffer files() const { return files_.handle(); }
  VkBuffer emitters() const { return emitters_.handle(); }
  uint32_t emitter_count() const { return emitter_count_; }
  uint32_t instance_count() const { return instances_ != nullptr ? instances_->count : 0; }

 private:
  // A file's sections: buffers in the order of its plan.
  struct Sections {
    std::vector<GpuBuffer> buffers;
    std::vector<VkBuffer> handles;
  };
  void plan(const VkPhysicalDeviceLimits& limits);
  Sections upload_sections(const lsp_scene& scene, const lsp_vulkan_plan& plan);
  void upload_shading(const RenderScene& scene);
  void upload_instances();
  template <class T>
  GpuBuffer upload(const std::vector<T>& items, const char* what);
  GpuBuffer upload(const void* bytes, uint64_t size, const char* what);

  Gpu& gpu_;
  std::string path_;
  const lsp_instances* instances_;  // null: there is one file
  std::vector<const lsp_scene*> scenes_;
  std::vector<lsp_vulkan_plan> plans_;  // of each
  std::vector<Sections> sections_;      // of each
  lsp_vulkan_functions functions_{};
  GpuBuffer staging_;
  GpuBuffer assets_;  // an lsp_vulkan_asset each
  GpuBuffer placed_;  // the instances
  GpuBuffer materials_, triangles_, files_, emitters_;
  uint32_t emitter_count_ = 0;
};

}  // namespace lsp::sample
