#include "ray_tracer.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <chrono>

#include "lsp/program.h"
#include "lsp/vulkan_device.hpp"

namespace lsp::sample {
namespace {

class CpuTracer : public RayTracer {
 public:
  CpuTracer(const RenderScene& scene, int threads)
      : scene_(scene), arena_(threads > 0 ? threads : tbb::task_arena::automatic) {}

  double trace(const lsp_trace_options& options, std::span<const LspRay> rays,
               std::span<LspHit> hits) override {
    const auto start = std::chrono::steady_clock::now();
    arena_.execute([&] {
      tbb::parallel_for(tbb::blocked_range<size_t>(0, rays.size(), 2048), [&](const auto& range) {
        scene_.trace(options, rays.subspan(range.begin(), range.size()),
                     hits.subspan(range.begin(), range.size()), nullptr);
      });
    });
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  }

  std::string device() const override {
    return "CPU, " + std::to_string(arena_.max_concurrency()) + " threads";
  }
  std::string load_path() const override { return "mapped"; }

 private:
  const RenderScene& scene_;
  tbb::task_arena arena_;
};

class VulkanRayTracer : public RayTracer {
 public:
  VulkanRayTracer(const RenderScene& scene, uint32_t uses) : instances_(scene.instances()) {
    if (instances_ == nullptr)
      tracer_.load(*scene.single(), uses);
    else
      tracer_.load(std::span(instances_->assets, instances_->asset_count), uses);
  }

  double trace(const lsp_trace_options& options, std::span<const LspRay> rays,
               std::span<LspHit> hits) override {
    if (rays.empty()) return 0;
    const VulkanTrace traced = instances_ == nullptr
                                   ? tracer_.trace(options, rays, hits)
                                   : tracer_.trace_instances(*instances_, options, 0xFF, rays, hits);
    dispatches_ += traced.batches;
    return traced.seconds;
  }
  uint64_t dispatches() const override { return dispatches_; }
  std::string device() const override { return tracer_.device_name(); }
  std::string load_path() const override { return name_of(tracer_.load_path()); }

 private:
  const lsp_instances* instances_;  // null: there is one file
  VulkanTracer tracer_;
  uint64_t dispatches_ = 0;
};

}  // namespace

std::unique_ptr<RayTracer> make_cpu_tracer(const RenderScene& scene, int threads) {
  return std::make_unique<CpuTracer>(scene, threads);
}

std::unique_ptr<RayTracer> make_vulkan_tracer(const RenderScene& scene, uint32_t uses) {
  try {
    return std::make_unique<VulkanRayTracer>(scene, uses);
  } catch (const Failure& failure) {
    throw Failure(failure.exit(), scene.path(), failure.what());
  }
}

}  // namespace lsp::sample
