#include "ray_tracer.h"

#include "lsp/in_chunks.hpp"
#include "lsp/program.h"
#include "lsp/vulkan_device.hpp"

namespace lsp::sample {
namespace {

class CpuTracer : public RayTracer {
 public:
  CpuTracer(const RenderScene& scene, int threads)
      : scene_(scene), threads_(threads > 0 ? static_cast<unsigned>(threads) : machine_threads()) {}

  double trace(const lsp_trace_options& options, std::span<const LspRay> rays,
               std::span<LspHit> hits) override {
    return run_in_chunks(rays.size(), threads_, [&](size_t first, size_t count) {
      scene_.trace(options, rays.subspan(first, count), hits.subspan(first, count), nullptr);
    });
  }

  std::string device() const override { return "CPU, " + std::to_string(threads_) + " threads"; }
  std::string load_path() const override { return "mapped"; }

 private:
  const RenderScene& scene_;
  unsigned threads_;
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
