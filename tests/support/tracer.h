// The things that trace, behind one face: ours on the CPU, ours on Vulkan, Embree.
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <string>

#include "embree_scene.h"
#include "lsp/lsp.h"
#include "open_file.h"

namespace lsp::bench {

// How ours traces. Embree ignores all but `any`.
struct Mode {
  bool approximate = false;
  bool any = false;
  bool near_approximate = false;
  bool near_skip = false;
  float lod = 0;
  std::optional<uint32_t> quality =
      std::nullopt;                              // of cells: LSP_QUALITY_*; none: the library's own, balanced
  std::optional<float> max_loss = std::nullopt;  // of cells, in per cent, in place of a quality

  lsp_trace_options options() const;
  std::string name() const;  // "exact", "approximate, lod 0.05", "accurate", "max-loss 5"
};

class Tracer {
 public:
  virtual ~Tracer() = default;
  virtual std::string name() const = 0;
  // Traces all rays and returns the seconds that took, wall clock. Throws Failure.
  virtual double trace(const Mode& mode, std::span<const LspRay> rays, std::span<LspHit> hits) = 0;
};

std::unique_ptr<Tracer> cpu_tracer(const OpenFile& file, unsigned threads);
std::unique_ptr<Tracer> embree_tracer(const EmbreeScene& scene, EmbreeCall call, std::string name,
                                      unsigned threads);

// Per-ray means of the work done, on the CPU; noise-free.
struct Work {
  double nodes = 0, shafts = 0, triangles = 0;  // nodes: of cells the steps from one to the next
  double splits = 0, exact_calls = 0;           // of cells alone
};
Work count_work(const OpenFile& file, const Mode& mode, std::span<const LspRay> rays);

}  // namespace lsp::bench
