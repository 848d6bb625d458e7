// What every suite is given, and the suites.
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "lsp/vulkan_device.hpp"
#include "ray_errors.h"
#include "report.h"
#include "scene_under_test.h"
#include "timing.h"
#include "tracer.h"

namespace lsp::bench {

struct Context {
  bool quick = false;           // smaller everything: under two minutes in all
  std::filesystem::path cache;  // bakes and pictures go here
  std::vector<std::unique_ptr<SceneUnderTest>> scenes;
  unsigned threads = 1;                  // "all threads"
  std::unique_ptr<VulkanTracer> vulkan;  // null: no device; why is in the report's facts
  std::function<void(const std::string&)> progress;
  std::vector<std::string> warnings;
  std::vector<std::string> answers;

  size_t accuracy_rays() const { return quick ? 50000 : 200000; }
  size_t timing_rays() const { return quick ? 1u << 16 : 1u << 17; }
  Bake base_bake() const { return line_space_bake(quick ? 4 : 6, 9); }  // the only one of a quick run
  int repeats() const { return quick ? 3 : 5; }

  // The file on the Vulkan device, until the next call; null, with a warning where there is a device,
  // without.
  std::unique_ptr<Tracer> vulkan_tracer(const OpenFile& file, const std::string& what);

  // a is `times` faster than b; says so with a warning when the repeats lie too far apart for that.
  double speed_up(const std::string& what, const Timing& a, const Timing& b);
};

// Rows of a table that only some of the scenes have must not be hidden: every suite lists what it left out.
Section paper_suite(Context& context);
Section pareto_suite(Context& context);
Section scaling_suite(Context& context);
Section peers_suite(Context& context);
Section stress_suite(Context& context);
Section pictures_suite(Context& context);

double mega(size_t rays, const Timing& timing);  // million rays a second

// RayErrors into the columns that all suites share (error_columns).
void add_errors(Json& row, const RayErrors& errors);
std::vector<Column> error_columns();

}  // namespace lsp::bench
