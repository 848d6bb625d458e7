#include "tracer.h"

#include <cstdio>
#include <vector>

#include "lsp/failures.hpp"
#include "lsp/in_chunks.hpp"

namespace lsp::bench {
namespace {

class CpuTracer : public Tracer {
 public:
  CpuTracer(const OpenFile& file, unsigned threads) : file_(file), threads_(threads) {}
  std::string name() const override { return "lsp"; }
  double trace(const Mode& mode, std::span<const LspRay> rays, std::span<LspHit> hits) override {
    const lsp_trace_options options = mode.options();
    return run_in_chunks(rays.size(), threads_, [&](size_t first, size_t count) {
      lsp_error error{};
      check(lsp_trace(&file_.scene(), &options, rays.data() + first, hits.data() + first, count, nullptr,
                      &error),
            error, file_.path().string());
    });
  }

 private:
  const OpenFile& file_;
  unsigned threads_;
};

class EmbreeTracer : public Tracer {
 public:
  EmbreeTracer(const EmbreeScene& scene, EmbreeCall call, std::string name, unsigned threads)
      : scene_(scene), call_(call), name_(std::move(name)), threads_(threads) {}
  std::string name() const override { return name_; }
  double trace(const Mode& mode, std::span<const LspRay> rays, std::span<LspHit> hits) override {
    return run_in_chunks(rays.size(), threads_, [&](size_t first, size_t count) {
      if (mode.any) {
        scene_.any(rays.subspan(first, count), hits.subspan(first, count), call_);
      } else {
        scene_.closest(rays.subspan(first, count), hits.subspan(first, count), call_);
      }
    });
  }

 private:
  const EmbreeScene& scene_;
  EmbreeCall call_;
  std::string name_;
  unsigned threads_;
};

constexpr const char* kQualityNames[LSP_QUALITY_COUNT] = {"balanced", "fast",
                                                          "accurate"};  // by LSP_QUALITY_*

}  // namespace

lsp_trace_options Mode::options() const {
  lsp_trace_options options{};
  if (approximate) options.flags |= LSP_TRACE_APPROXIMATE;
  if (any) options.flags |= LSP_TRACE_OCCLUSION;  // a yes or no, as rtcOccluded gives it
  if (near_approximate) options.flags |= LSP_TRACE_NEAR_APPROXIMATE;
  if (near_skip) options.flags |= LSP_TRACE_NEAR_SKIP;
  options.lod = lod;
  options.quality = quality.value_or(LSP_QUALITY_BALANCED);
  if (max_loss) {
    options.flags |= LSP_TRACE_MAX_LOSS;
    options.max_loss = *max_loss;
  }
  return options;
}

std::string Mode::name() const {
  if (!approximate) return "exact";
  char number[32];
  if (max_loss) {
    std::snprintf(number, sizeof number, "max-loss %g", double{*max_loss});
    return number;
  }
  if (quality) return kQualityNames[*quality];
  std::string text = near_approximate ? "approximate, near too"
                     : near_skip      ? "approximate, near skipped"
                                      : "approximate";
  if (lod > 0) {
    std::snprintf(number, sizeof number, ", lod %g", double{lod});
    text += number;
  }
  return text;
}

std::unique_ptr<Tracer> cpu_tracer(const OpenFile& file, unsigned threads) {
  return std::make_unique<CpuTracer>(file, threads);
}

std::unique_ptr<Tracer> embree_tracer(const EmbreeScene& scene, EmbreeCall call, std::string name,
                                      unsigned threads) {
  return std::make_unique<EmbreeTracer>(scene, call, std::move(name), threads);
}

Work count_work(const OpenFile& file, const Mode& mode, std::span<const LspRay> rays) {
  const lsp_trace_options options = mode.options();
  std::vector<LspHit> hits(rays.size());
  lsp_trace_counts counts{};
  lsp_error error{};
  check(lsp_trace(&file.scene(), &options, rays.data(), hits.data(), rays.size(), &counts, &error), error,
        file.path().string());
  const auto n = static_cast<double>(rays.empty() ? 1 : rays.size());
  return {static_cast<double>(counts.nodes) / n, static_cast<double>(counts.shafts) / n,
          static_cast<double>(counts.triangles) / n, static_cast<double>(counts.splits) / n,
          static_cast<double>(counts.exact) / n};
}

}  // namespace lsp::bench
