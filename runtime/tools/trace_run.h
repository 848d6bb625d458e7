// What lsp-trace does between reading its rays and writing its hits: trace them, several times, and measure.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "lsp/lsp_instances.h"
#include "lsp/vulkan_device.hpp"

namespace lsp {

struct TraceRequest {
  bool vulkan = false;
  lsp_trace_options options{};
  uint32_t repeats = 1;
  uint32_t threads = 1;                       // CPU
  std::string device;                         // Vulkan: part of the device's name
  LoadPath load_path = LoadPath::kAutomatic;  // Vulkan
  bool progress = false;                      // show it on standard error
};

struct TraceReport {
  std::string device;
  std::string load_path;  // "mapped", "unpacked", "import" or "upload"
  std::string load_note;  // why not imported
  double load_seconds = 0;
  std::vector<double> seconds;      // of each repeat
  std::vector<double> gpu_seconds;  // of each repeat, Vulkan only
  uint64_t bytes_paged_in = 0;      // of the mapping, after tracing
  uint64_t bytes_imported = 0;
  uint64_t bytes_uploaded = 0;
  uint64_t retraced = 0;  // rays that the device cut short
  lsp_trace_counts counts{};
};

// What is traced: a scene, or instances; one of the two is null.
struct TraceTarget {
  const lsp_scene* scene = nullptr;
  const lsp_instances* instances = nullptr;
  std::vector<const lsp_scene*> mapped;  // of the files traced, those that are mapped
  size_t unpacked = 0;                   // how many were packed
};

// Traces `rays` into `hits`, first once with counting and without a clock, then request.repeats times timed.
// Throws Failure.
TraceReport trace_rays(const TraceTarget& target, const TraceRequest& request, std::span<const LspRay> rays,
                       std::span<LspHit> hits);

}  // namespace lsp
