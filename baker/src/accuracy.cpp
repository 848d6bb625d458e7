#include "accuracy.h"

#include <cstdio>

#include "cells/dial.h"
#include "lsp/program.h"

namespace lsp {

bool weigh_tables(Baked& baked) {
  // Balanced has to gain on a device. On the CPU it may gain little in large scenes where fast gains much,
  // but small things stay small. What is counted there is what vector lanes gain with AVX-512; with AVX2 it
  // is 0.6 to 0.8 of that, and instances are traced ray by ray.
  constexpr double kVulkan = 1.05, kCpu = 2.0, kCpuFast = 2.5;
  constexpr uint64_t kSmall = 4000000;  // bytes of exact data
  if (double(table_bytes(baked) + kTablePadding) > kTableShare * double(exact_bytes(baked))) {
    leave_out_tables(baked,
                     "of so small a mesh, they would be more than three times its exact data (--base cells "
                     "asks for them)");
    return true;
  }
  const QualityFigures &balanced = baked.qualities[LSP_QUALITY_BALANCED],
                       &fast = baked.qualities[LSP_QUALITY_FAST];
  if (balanced.vulkan < kVulkan || fast.vulkan < kVulkan ||
      (balanced.cpu < kCpu && (exact_bytes(baked) < kSmall || fast.cpu < kCpuFast))) {
    leave_out_tables(baked,
                     "a ray through them would take as long as an exact one (--base cells asks for them)");
    return true;
  }
  return false;
}

MeasuredError settle_dial(Baked& baked, const Accuracy& asked) {
  MeasuredError error = measure_error(baked, kErrorRays);
  // The dial is measured on rays of its own: what they flattered is asked for again, more sternly, and in
  // the end everything is traced exactly.
  for (const double part : {0.7, 0.5, 0.3, 0.0}) {
    if (asked.max_error == 0 || 100 * error.wrong_share() <= asked.max_error) break;
    choose_dial(baked, part * asked.wrong);
    error = measure_error(baked, kErrorRays);
  }
  return error;
}

void check_error(const MeasuredError& error, double max_error, const std::string& file) {
  if (max_error == 0 || 100 * error.wrong_share() <= max_error) return;
  char text[160];
  std::snprintf(
      text, sizeof text,
      "the most accurate setting still answers %.3f %% of rays wrongly, over --max-error %g: allow more, "
      "or trace exactly",
      100 * error.wrong_share(), max_error);
  throw Failure(Exit::kLimit, file, text);
}

}  // namespace lsp
