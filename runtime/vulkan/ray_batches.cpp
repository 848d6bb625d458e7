#include "ray_batches.h"

#include <algorithm>
#include <cstddef>
#include <cstring>

namespace lsp {
namespace {

constexpr uint32_t kMostRays = 1u << 20;

// The counting shader adds to the counts as to 64-bit words.
constexpr bool is_counter(size_t offset, uint32_t number) { return offset == number * sizeof(uint64_t); }
static_assert(is_counter(offsetof(lsp_trace_counts, invalid), LSP_COUNTER_INVALID));
static_assert(is_counter(offsetof(lsp_trace_counts, hits), LSP_COUNTER_HITS));
static_assert(is_counter(offsetof(lsp_trace_counts, nodes), LSP_COUNTER_NODES));
static_assert(is_counter(offsetof(lsp_trace_counts, shafts), LSP_COUNTER_SHAFTS));
static_assert(is_counter(offsetof(lsp_trace_counts, triangles), LSP_COUNTER_TRIANGLES));
static_assert(is_counter(offsetof(lsp_trace_counts, splits), LSP_COUNTER_SPLITS));
static_assert(is_counter(offsetof(lsp_trace_counts, exact), LSP_COUNTER_EXACT));
static_assert(is_counter(offsetof(lsp_trace_counts, exact_nodes), LSP_COUNTER_EXACT_NODES));

constexpr VkPipelineStageFlagBits kCompute = VK_PIPELINE_STAGE_COMPUTE_SHADER_BIT;
constexpr VkPipelineStageFlags kTransfer = VK_PIPELINE_STAGE_TRANSFER_BIT;

void record_barrier(Device& device, VkCommandBuffer commands, VkPipelineStageFlags from,
                    VkAccessFlags written, VkPipelineStageFlags to, VkAccessFlags read) {
  auto barrier = vk_make<VkMemoryBarrier>(VK_STRUCTURE_TYPE_MEMORY_BARRIER);
  barrier.srcAccessMask = written;
  barrier.dstAccessMask = read;
  device.vk.vkCmdPipelineBarrier(commands, from, to, 0, 1, &barrier, 0, nullptr, 0, nullptr);
}

}  // namespace

RayBatches::RayBatches(Device& device)
    : device_(device),
      counters_(device, sizeof(lsp_trace_counts), VK_BUFFER_USAGE_STORAGE_BUFFER_BIT, kHostMemory, 0),
      commands_(device) {
  if (device.seconds_per_tick == 0) return;
  auto info = vk_make<VkQueryPoolCreateInfo>(VK_STRUCTURE_TYPE_QUERY_POOL_CREATE_INFO);
  info.queryType = VK_QUERY_TYPE_TIMESTAMP;
  info.queryCount = 2;
  check(device.vk.vkCreateQueryPool(device.handle, &info, nullptr, &timer_), "vkCreateQueryPool");
}

RayBatches::~RayBatches() { device_.vk.vkDestroyQueryPool(device_.handle, timer_, nullptr); }

uint32_t RayBatches::most() const { return std::min(lsp_vulkan_max_rays(&device_.limits), kMostRays); }

void RayBatches::reserve(size_t rays) {
  const auto count = static_cast<uint32_t>(std::min<size_t>(rays, most()));
  if (count <= capacity_) return;
  capacity_ = 0;
  for (Buffer* buffer : {&rays_, &hits_, &device_rays_, &device_hits_, &queue_})
    *buffer = {};  // before the new ones are made, not after
  const VkDeviceSize bytes = VkDeviceSize{count} * sizeof(LspRay);
  constexpr VkBufferUsageFlags kStorage = VK_BUFFER_USAGE_STORAGE_BUFFER_BIT;
  constexpr VkBufferUsageFlags kFrom = VK_BUFFER_USAGE_TRANSFER_SRC_BIT;
  constexpr VkBufferUsageFlags kTo = VK_BUFFER_USAGE_TRANSFER_DST_BIT;
  rays_ = Buffer(device_, bytes, kStorage | kFrom, kHostMemory, 0);
  hits_ = Buffer(device_, bytes, kStorage | kTo, kHostMemory, VK_MEMORY_PROPERTY_HOST_CACHED_BIT);
  if (!device_.shares_memory) {
    device_rays_ = Buffer(device_, bytes, kStorage | kTo, VK_MEMORY_PROPERTY_DEVICE_LOCAL_BIT, 0);
    device_hits_ = Buffer(device_, bytes, kStorage | kFrom, VK_MEMORY_PROPERTY_DEVICE_LOCAL_BIT, 0);
  }
  capacity_ = count;
}

void RayBatches::reserve_queue() {
  if (queue_.handle() != VK_NULL_HANDLE) return;
  queue_ = Buffer(device_, lsp_vulkan_queue_bytes(capacity_), LSP_VULKAN_QUEUE_USAGE,
                  VK_MEMORY_PROPERTY_DEVICE_LOCAL_BIT, 0);
}

void RayBatches::write_timestamp(VkCommandBuffer commands, uint32_t number) {
  if (timer_ == VK_NULL_HANDLE) return;
  if (number == 0) device_.vk.vkCmdResetQueryPool(commands, timer_, 0, 2);
  device_.vk.vkCmdWriteTimestamp(commands, kCompute, timer_, number);
}

double RayBatches::seconds_in_shader() const {
  if (timer_ == VK_NULL_HANDLE) return 0;
  uint64_t ticks[2] = {};
  check(device_.vk.vkGetQueryPoolResults(device_.handle, timer_, 0, 2, sizeof ticks, ticks, sizeof ticks[0],
                                         VK_QUERY_RESULT_64_BIT | VK_QUERY_RESULT_WAIT_BIT),
        "vkGetQueryPoolResults");
  return static_cast<double>(ticks[1] - ticks[0]) * device_.seconds_per_tick;
}

void RayBatches::record_batch(const Record& record, uint32_t count) {
  const VkCommandBuffer commands = commands_.record();
  const VkBufferCopy all{0, 0, VkDeviceSize{count} * sizeof(LspRay)};
  if (staged()) {
    device_.vk.vkCmdCopyBuffer(commands, rays_.handle(), device_rays_.handle(), 1, &all);
    record_barrier(device_, commands, kTransfer, VK_ACCESS_TRANSFER_WRITE_BIT, kCompute,
                   VK_ACCESS_SHADER_READ_BIT);
  }
  write_timestamp(commands, 0);
  record(commands, count);
  write_timestamp(commands, 1);
  if (staged()) {
    record_barrier(device_, commands, kCompute, VK_ACCESS_SHADER_WRITE_BIT, kTransfer,
                   VK_ACCESS_TRANSFER_READ_BIT);
    device_.vk.vkCmdCopyBuffer(commands, device_hits_.handle(), hits_.handle(), 1, &all);
  }
  record_barrier(device_, commands, kCompute | kTransfer,
                 VK_ACCESS_SHADER_WRITE_BIT | VK_ACCESS_TRANSFER_WRITE_BIT, VK_PIPELINE_STAGE_HOST_BIT,
                 VK_ACCESS_HOST_READ_BIT);
}

double RayBatches::trace_batch(const Record& record, const LspRay* rays, LspHit* hits, uint32_t count) {
  memcpy(rays_.mapped(), rays, size_t{count} * sizeof(LspRay));
  record_batch(record, count);
  commands_.submit();
  commands_.wait();
  memcpy(hits, hits_.mapped(), size_t{count} * sizeof(LspHit));
  return seconds_in_shader();
}

VulkanTrace RayBatches::trace(const Record& record, const Retrace& retrace, std::span<const LspRay> rays,
                              std::span<LspHit> hits, bool counting) {
  VulkanTrace result;
  for (size_t first = 0; first < rays.size(); first += most()) {
    const auto size = static_cast<uint32_t>(std::min<size_t>(rays.size() - first, most()));
    if (counting) memset(counters_.mapped(), 0, sizeof(lsp_trace_counts));
    result.gpu_seconds += trace_batch(record, &rays[first], &hits[first], size);
    if (counting) {
      lsp_trace_counts counts;
      memcpy(&counts, counters_.mapped(), sizeof counts);
      lsp_add_counts(&result.counts, &counts);
    }
    ++result.batches;
  }
  for (size_t i = 0; i < hits.size(); ++i) {
    if ((hits[i].flags & LSP_HIT_INCOMPLETE) == 0) continue;
    lsp_trace_counts counts{};
    lsp_error error;
    const lsp_status status = retrace(rays[i], hits[i], counting ? &counts : nullptr, &error);
    if (status != LSP_OK) throw Failure(static_cast<Exit>(status), "", error.message);
    ++result.retraced;
    lsp_add_counts(&result.counts, &counts);
  }
  result.counts.rays = rays.size();  // those retraced are not counted twice
  return result;
}

}  // namespace lsp
