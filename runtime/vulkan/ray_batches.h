// Rays traced on a device in batches: their buffers, the commands, the clock, and the few that the device
// cuts short.
#pragma once

#include <functional>
#include <span>

#include "device.h"

namespace lsp {

class RayBatches {
 public:
  // Records the dispatch that traces so many rays; its pipeline and set are ready.
  using Record = std::function<void(VkCommandBuffer, uint32_t count)>;
  // Traces one ray on the CPU, which adds to the counts unless they are null.
  using Retrace = std::function<lsp_status(const LspRay&, LspHit&, lsp_trace_counts*, lsp_error*)>;

  explicit RayBatches(Device& device);
  ~RayBatches();
  RayBatches(const RayBatches&) = delete;
  RayBatches& operator=(const RayBatches&) = delete;

  // Makes room for `rays`: the buffers below may be others then.
  void reserve(size_t rays);
  // What the shader reads, writes and adds to.
  VkBuffer rays() const { return staged() ? device_rays_.handle() : rays_.handle(); }
  VkBuffer hits() const { return staged() ? device_hits_.handle() : hits_.handle(); }
  VkBuffer counters() const { return counters_.handle(); }
  // Where rays wait for a pass; after the first call of reserve_queue.
  VkBuffer queue() const { return queue_.handle(); }
  // Makes room for as many rays to wait as there is room for.
  void reserve_queue();

  // Traces rays into hits, of the same size, once there is room; seconds are left to the caller.
  VulkanTrace trace(const Record& record, const Retrace& retrace, std::span<const LspRay> rays,
                    std::span<LspHit> hits, bool counting);

 private:
  uint32_t most() const;  // rays of a batch
  // On a discrete device the shader works on memory of its own, filled and emptied by transfers; where device
  // and host share memory it works on what the host writes.
  bool staged() const { return device_rays_.handle() != VK_NULL_HANDLE; }
  // Returns the seconds in the shader.
  double trace_batch(const Record& record, const LspRay* rays, LspHit* hits, uint32_t count);
  void record_batch(const Record& record, uint32_t count);
  void write_timestamp(VkCommandBuffer commands, uint32_t number);
  double seconds_in_shader() const;

  Device& device_;
  VkQueryPool timer_ = VK_NULL_HANDLE;  // null where the device has no timestamps
  uint32_t capacity_ = 0;
  Buffer rays_, hits_;
  Buffer device_rays_, device_hits_;  // discrete devices only
  Buffer counters_;                   // lsp_trace_counts
  Buffer queue_;                      // lsp_vulkan_record_passes
  Commands commands_;                 // ends, and with it what it does, before the buffers
};

}  // namespace lsp
