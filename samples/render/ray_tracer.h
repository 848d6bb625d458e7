// Where batches of rays are traced: this processor's threads, or a Vulkan device.
#pragma once

#include <memory>
#include <span>
#include <string>

#include "lsp/lsp.h"
#include "render_scene.h"

namespace lsp::sample {

class RayTracer {
 public:
  virtual ~RayTracer() = default;
  // Traces rays into hits, of the same size; answers the seconds it took (copies to and from a device
  // included). The same rays give the same hits however many threads there are.
  virtual double trace(const lsp_trace_options& options, std::span<const LspRay> rays,
                       std::span<LspHit> hits) = 0;
  virtual std::string device() const = 0;
  // Pieces of work that a device was given so far, of at most 2^20 rays each; 0 for the CPU.
  virtual uint64_t dispatches() const { return 0; }
  // How the file came to the device: "mapped", "import" or "upload".
  virtual std::string load_path() const = 0;
};

// `threads` 0: all. The scene must outlive the tracer. Throws lsp::Failure.
std::unique_ptr<RayTracer> make_cpu_tracer(const RenderScene& scene, int threads);
// `uses`: LSP_USE_*. Throws lsp::Failure (kUnsupported) where there is no Vulkan device.
std::unique_ptr<RayTracer> make_vulkan_tracer(const RenderScene& scene, uint32_t uses);

}  // namespace lsp::sample
