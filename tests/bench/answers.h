// What a sceptic asks, answered in a sentence each from what the suites measured in this run.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "report.h"

namespace lsp::bench {

// One bake traced in one way, on shuffled diffuse rays of one scene.
struct Sample {
  std::string scene, bake, mode;
  double times = 0;         // as fast as the BVH's exact trace, CPU, all threads
  double times_vulkan = 0;  // the same on the Vulkan device; 0: not measured
  double wrong_percent = 0;
  double depth_percent = 0;
  double megabytes = 0;
};

// Exact tracers on the same rays and threads, times our exact trace; 0: not measured.
struct ScenePeers {
  double embree = 0;           // rtcIntersect1, robust
  double wide = 0;             // our tree, eight children a node
  double exact_megabytes = 0;  // the file without Line Spaces
  double wide_vulkan = 0;      // wide nodes of a file of cells, on the device
};

struct Answers {
  unsigned threads = 1;
  std::string device;  // of Vulkan
  std::vector<Sample> samples;
  // Points of the dial of cells: times the exact trace of the same file, on the CPU and on the device.
  std::vector<Sample> cells;
  std::map<std::string, ScenePeers> peers;  // by scene
  std::vector<std::string> others;          // sentences that suites have written themselves
};

// The limits on wrong answers that the sentences are for, % of rays.
inline constexpr double kLimits[] = {0.1, 0.5, 1.0, 2.0};

// Per scene the fastest sample by `times` (Sample::times or times_vulkan) of at most `limit` % wrong answers;
// where nothing approximate is faster than the exact trace that one, with the bake "-" and mode "exact".
std::map<std::string, Sample> best_within(const std::vector<Sample>& samples, double limit,
                                          double Sample::*times);

std::vector<std::string> sentences(const Answers& answers);

// The sentences once more, with the table that they summarise.
Section answers_section(const Answers& answers);

}  // namespace lsp::bench
