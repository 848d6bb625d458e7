// The compute shaders of shaders/: traces slices of a picture, one half exactly, the other approximately.
//
//   a slice (whole rows of one sample):
//     eye, exact -> light, exact (direct) -+-> left of the split:  gather, light exactly
//                                          +-> right of the split: gather, light approximately
#pragma once

#include <map>
#include <tuple>

#include "device_scene.h"
#include "shader_code.h"

namespace lsp::sample {

// Of one slice, by half (VIEW_EXACT, VIEW_APPROXIMATE); only of what gather and light do after the split.
struct SliceReport {
  double seconds[2] = {};  // by time stamps; 0 where the device has none
  ViewStatistics counts[2] = {};
  double all_seconds = 0;  // wall clock, direct light included
  bool compiled = false;   // some shader was used for the first time, when devices compile: times say nothing
};

class PathTracer {
 public:
  // The scene must outlive the tracer.
  PathTracer(Gpu& gpu, const DeviceScene& scene);
  ~PathTracer();
  PathTracer(const PathTracer&) = delete;
  PathTracer& operator=(const PathTracer&) = delete;

  // Pixels that a buffer of this device can hold the sums of.
  uint32_t largest_picture() const;
  // Makes room for a picture, and a window, of so many pixels; forgets the sums.
  void reserve(uint32_t picture, uint32_t window);

  // Rows [first, first + rows) of the frame's picture. Columns left of `split` are exact, the others as
  // `options` say.
  SliceReport trace(const ViewFrame& frame, uint32_t first, uint32_t rows, uint32_t split,
                    const lsp_trace_options& options);

  // The sums as pixels of the window, in shown().
  void show(const ViewFrame& frame);
  VkBuffer shown() const { return shown_.handle(); }

 private:
  void create_layout();
  void create_sets();
  void write_sets();
  void destroy() noexcept;
  VkPipeline pipeline(Kernel kernel, const lsp_vulkan_kind& kind);
  void bind(VkCommandBuffer commands, VkPipeline pipeline) const;
  void dispatch(VkCommandBuffer commands, VkPipeline pipeline, const ViewRegion& region) const;
  void record_slice(VkCommandBuffer commands, const ViewFrame& frame, ViewRegion slice, uint32_t split,
                    const lsp_trace_options& options);
  void record_light(VkCommandBuffer commands, const ViewFrame& frame, ViewRegion region, VkPipeline pipeline);
  void record_half(VkCommandBuffer commands, const ViewFrame& frame, const ViewRegion& region,
                   const lsp_trace_options& options);
  void stamp(VkCommandBuffer commands, uint32_t query) const;

  Gpu& gpu_;
  const DeviceScene& scene_;
  GpuBuffer frame_, sums_, vertices_, statistics_, shown_;
  VkDescriptorSetLayout set_layouts_[2] = {};
  VkPipelineLayout layout_ = VK_NULL_HANDLE;
  VkDescriptorPool pool_ = VK_NULL_HANDLE;
  VkDescriptorSet sets_[2] = {};
  VkQueryPool timer_ = VK_NULL_HANDLE;  // null where the device has no time stamps
  bool made_pipeline_ = false;          // since it was last set to false
  std::map<std::tuple<Kernel, uint32_t, uint32_t, uint32_t>, VkPipeline> pipelines_;
};

}  // namespace lsp::sample
