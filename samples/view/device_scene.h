// An .lsp file, or instances of several, on the device: [lsp] marks what an engine adds for the library.
#pragma once

#include <array>

#include "gpu.h"
#include "interface.h"
#include "lsp/lsp_vulkan.h"
#include "render_scene.h"

namespace lsp::sample {

class DeviceScene {
 public:
  // Uploads the sections that exact and approximate rays need, and what shading needs beside them. Throws
  // lsp::Failure: kUnsupported (instances: of what no shader traces), kLimit (a section, or all assets
  // together, are larger than the device's buffers may be).
  DeviceScene(Gpu& gpu, const RenderScene& scene);

  // [lsp] What a pipeline for such rays is made of; of instances that of all assets, whose base structure is
  // 0.
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
  using Places = std::array<VkDeviceAddress, LSP_VULKAN_MAX_BUFFERS>;
  void plan(const VkPhysicalDeviceLimits& limits);
  [[noreturn]] void refuse_size() const;
  template <class Destination>
  void upload_sections(size_t number, const Destination& destination);
  void upload_single();
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
  std::vector<Places> places_;          // of each in the buffer of all, of instances alone
  uint64_t pool_bytes_ = 0;             // that buffer's
  std::vector<GpuBuffer> sections_;     // in the order of the plan; of instances the buffer of all
  std::vector<VkBuffer> handles_;       // of these
  lsp_vulkan_functions functions_{};
  GpuBuffer staging_;
  GpuBuffer assets_;  // an lsp_vulkan_asset each
  GpuBuffer placed_;  // the instances
  GpuBuffer materials_, triangles_, files_, emitters_;
  uint32_t emitter_count_ = 0;
};

}  // namespace lsp::sample
