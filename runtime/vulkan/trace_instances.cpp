// Rays through instances: this processor finds the instances, the device traces their assets.
#include <chrono>

#include "instance_memory.h"
#include "lsp/program.h"
#include "lsp/vulkan_device.hpp"

namespace lsp {
namespace {

// Rays that walk together: dispatches are few and large, and what they work on (some 280 bytes a ray) is not.
constexpr size_t kBatchRays = 1u << 18;
static_assert(kBatchRays <= kLargestInstanceBatch);

}  // namespace

VulkanTrace VulkanTracer::trace_instances(const lsp_instances& instances, const lsp_trace_options& options,
                                          uint32_t mask, std::span<const LspRay> rays, std::span<LspHit> hits,
                                          bool count) {
  if (instances.asset_count != scene_count())
    throw Failure(Exit::kInternal, "", "the instances' assets are not those that were loaded");
  if (hits.size() != rays.size()) throw Failure(Exit::kInternal, "", "as many hits as rays are needed");
  const auto start = std::chrono::steady_clock::now();
  if (instance_memory_ == nullptr) instance_memory_ = std::make_unique<InstanceMemory>();
  instance_memory_->grow(std::min(rays.size(), kBatchRays));
  VulkanTrace result;
  const auto trace_asset = [&](uint32_t asset, const lsp_trace_options& how, const LspRay* moved,
                               LspHit* found, uint32_t size, lsp_trace_counts* counts) {
    const VulkanTrace part = trace(how, {moved, size}, {found, size}, counts != nullptr, asset);
    if (counts != nullptr) *counts = part.counts;
    result.gpu_seconds += part.gpu_seconds;
    result.retraced += part.retraced;
    result.batches += part.batches;
    return true;
  };
  InstanceBatch batch(instances, options, mask, count, *instance_memory_, trace_asset);
  for (size_t first = 0; first < rays.size(); first += kBatchRays) {
    const size_t size = std::min(kBatchRays, rays.size() - first);
    batch.trace(&rays[first], &hits[first], static_cast<uint32_t>(size));
  }
  result.rounds = batch.rounds();
  if (count) result.counts = batch.counts();
  result.counts.rays = rays.size();
  result.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return result;
}

}  // namespace lsp
