#include "trace_run.h"

#include <chrono>
#include <cstdio>
#include <fstream>
#include <functional>
#include <mutex>

#include "lsp/failures.hpp"
#include "lsp/in_chunks.hpp"
#include "resident.h"

namespace lsp {
namespace {

using Clock = std::chrono::steady_clock;
constexpr uint32_t kAllMasks = 0xFF;

double seconds_since(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

// One line on standard error, rewritten at most five times a second, once a second has passed.
class ProgressLine {
 public:
  explicit ProgressLine(bool shown) : shown_(shown) {}
  ~ProgressLine() {
    if (drawn_) fputs("\r\033[K", stderr);
  }
  void show(double done) {
    if (!shown_ || seconds_since(start_) < 1.0 || seconds_since(last_) < 0.2) return;
    last_ = Clock::now();
    drawn_ = true;
    fprintf(stderr, "\rtracing %3.0f %%", done * 100.0);
  }

 private:
  bool shown_;
  bool drawn_ = false;
  Clock::time_point start_ = Clock::now();
  Clock::time_point last_ = Clock::now();
};

std::string cpu_name() {
  std::ifstream info("/proc/cpuinfo");
  for (std::string line; std::getline(info, line);) {
    const size_t colon = line.find(": ");
    if (line.rfind("model name", 0) == 0 && colon != std::string::npos) return line.substr(colon + 2);
  }
  return "CPU";
}

lsp_status trace_part(const TraceTarget& target, const lsp_trace_options& options,
                      std::span<const LspRay> rays, LspHit* hits, lsp_trace_counts* counts,
                      lsp_error* error) {
  if (target.instances != nullptr)
    return lsp_trace_instances(target.instances, &options, kAllMasks, rays.data(), hits, rays.size(), counts,
                               error);
  return lsp_trace(target.scene, &options, rays.data(), hits, rays.size(), counts, error);
}

// All rays once, by request.threads threads; `progress` is told how many are done, by one thread at a time.
void trace_cpu(const TraceTarget& target, const TraceRequest& request, std::span<const LspRay> rays,
               std::span<LspHit> hits, lsp_trace_counts* counts,
               const std::function<void(size_t)>& progress) {
  std::mutex mutex;  // of what all threads add to
  size_t done = 0;
  run_in_chunks(rays.size(), request.threads, [&](size_t first, size_t count) {
    lsp_trace_counts sum{};
    lsp_error error{};
    check(trace_part(target, request.options, rays.subspan(first, count), &hits[first],
                     counts != nullptr ? &sum : nullptr, &error),
          error);
    const std::lock_guard lock(mutex);
    if (counts != nullptr) lsp_add_counts(counts, &sum);
    progress(done += count);
  });
}

TraceReport trace_on_cpu(const TraceTarget& target, const TraceRequest& request, std::span<const LspRay> rays,
                         std::span<LspHit> hits, ProgressLine& line) {
  TraceReport report;
  report.device = cpu_name();
  const double passes = request.repeats + 1.0;
  double pass = 0;
  const auto progress = [&](size_t rays_done) {
    line.show((pass + static_cast<double>(rays_done) / static_cast<double>(rays.size())) / passes);
  };
  trace_cpu(target, request, rays, hits, &report.counts, progress);
  for (uint32_t i = 0; i < request.repeats; ++i) {
    ++pass;
    const auto start = Clock::now();
    trace_cpu(target, request, rays, hits, nullptr, progress);
    report.seconds.push_back(seconds_since(start));
  }
  return report;
}

// Puts what is traced on the tracer's device.
void load_target(VulkanTracer& tracer, const TraceTarget& target, const TraceRequest& request) {
  const bool approximate = (request.options.flags & LSP_TRACE_APPROXIMATE) != 0;
  uint32_t uses = approximate ? LSP_USE_APPROXIMATE : LSP_USE_EXACT;
  if (target.scene != nullptr) {
    if (approximate && lsp_dial(target.scene, &request.options) == LSP_DIAL_TABLES) uses = LSP_USE_TABLES;
    if ((request.options.flags & LSP_TRACE_OCCLUSION) != 0) uses |= LSP_USE_OCCLUSION;
  }
  if (target.instances != nullptr)
    tracer.load(std::span(target.instances->assets, target.instances->asset_count), uses, request.load_path);
  else
    tracer.load(*target.scene, uses, request.load_path);
}

TraceReport trace_on_vulkan(const TraceTarget& target, const TraceRequest& request,
                            std::span<const LspRay> rays, std::span<LspHit> hits, ProgressLine& line) {
  VulkanOptions options;
  options.device = request.device;
  VulkanTracer tracer(options);
  load_target(tracer, target, request);
  const auto trace = [&](std::span<const LspRay> from, std::span<LspHit> to, bool count = false) {
    return target.instances != nullptr
               ? tracer.trace_instances(*target.instances, request.options, kAllMasks, from, to, count)
               : tracer.trace(request.options, from, to, count);
  };
  TraceReport report;
  report.device = tracer.device_name();
  report.load_path = name_of(tracer.load_path());
  report.load_note = tracer.load_note();
  report.load_seconds = tracer.load_seconds();
  report.bytes_imported = tracer.bytes_imported();
  report.bytes_uploaded = tracer.bytes_uploaded();
  const VulkanTrace counted = trace(rays, hits, true);
  report.counts = counted.counts;
  report.retraced = counted.retraced;
  if (!rays.empty()) trace(rays.first(1), hits.first(1));  // compiles the shader to be timed
  for (uint32_t i = 0; i < request.repeats; ++i) {
    line.show((i + 1.0) / (request.repeats + 1.0));
    const VulkanTrace timed = trace(rays, hits);
    report.seconds.push_back(timed.seconds);
    report.gpu_seconds.push_back(timed.gpu_seconds);
  }
  return report;
}

}  // namespace

TraceReport trace_rays(const TraceTarget& target, const TraceRequest& request, std::span<const LspRay> rays,
                       std::span<LspHit> hits) {
  ProgressLine line(request.progress);
  TraceReport report = request.vulkan ? trace_on_vulkan(target, request, rays, hits, line)
                                      : trace_on_cpu(target, request, rays, hits, line);
  if (report.load_path.empty())
    report.load_path = target.unpacked > 0 && target.mapped.empty() ? "unpacked" : "mapped";
  for (const lsp_scene* scene : target.mapped) report.bytes_paged_in += resident_bytes(scene->bytes);
  return report;
}

}  // namespace lsp
