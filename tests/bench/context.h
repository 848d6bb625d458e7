// What every suite is given, and the suites.
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "answers.h"
#include "lsp/program.h"
#include "lsp/vulkan_device.hpp"
#include "ray_errors.h"
#include "report.h"
#include "scene_under_test.h"
#include "timing.h"
#include "tracer.h"

namespace lsp::bench {

struct Context {
  bool large = false;           // also what takes gigabytes a scene
  bool quick = false;           // smaller everything: a few minutes in all
  std::filesystem::path cache;  // bakes and pictures go here
  std::vector<std::unique_ptr<SceneUnderTest>> scenes;
  unsigned threads = 1;                  // "all threads"
  std::unique_ptr<VulkanTracer> vulkan;  // null: no device; why is in the report's facts
  std::function<void(const std::string&)> progress;
  std::vector<std::string> warnings;
  Answers answers;
  std::optional<Failure> first_failure;  // of a scene or suite; the report is written all the same

  size_t accuracy_rays() const { return quick ? 30000 : 200000; }
  size_t timing_rays() const { return quick ? 1u << 15 : 1u << 17; }
  Bake base_bake() const { return line_space_bake(quick ? 4 : 6, 9); }  // the only BVH of a quick run
  // The scene's tables as users get them: what lsp-bake makes without being asked for a base structure, or
  // the file that was given, whatever it has. Where the default leaves tables out, with --base cells; of a
  // quick run 8 cells along the longest side. Throws Failure where there is none.
  const Baked& cells(SceneUnderTest& scene) const;
  // What scenes are baked with, merged and as instances: the default, of a quick run coarse cells.
  Bake instance_bake() const;
  // Says in `section` where the default has left tables out.
  void say_what_cells_are(SceneUnderTest& scene, Section& section) const;
  // Fewer once half of the half hour is over: a slow machine's report shall end in time too.
  int repeats() const { return quick || seconds_since_start() > 900 ? 3 : 5; }

  // Runs `work` for every scene in turn. What one scene throws becomes a line of the section and a warning;
  // the others go on.
  void each_scene(Section& section, const std::function<void(SceneUnderTest&)>& work);

  // Runs `work` and makes what it throws a line of the section and a warning.
  void guarded(Section& section, const std::string& what, const std::function<void()>& work);

  // The file on the Vulkan device, until the next call; null, with a warning where there is a device,
  // without.
  std::unique_ptr<Tracer> vulkan_tracer(const OpenFile& file, const std::string& what);

  // Every mode on the Vulkan device, raced; empty, with a warning, where the device fails, which is then left
  // alone for the rest of the run.
  std::vector<Timing> race_on_vulkan(Tracer& tracer, std::span<const Mode> modes,
                                     std::span<const LspRay> rays, int repeats, const std::string& what);

  // a is `times` faster than b; says so with a warning when the repeats lie too far apart for that.
  double speed_up(const std::string& what, const Timing& a, const Timing& b);

 private:
  bool vulkan_failed_ = false;
};

// Rows of a table that only some of the scenes have must not be hidden: every suite lists what it left out.
Section paper_suite(Context& context);
Section pareto_suite(Context& context);
Section scaling_suite(Context& context);
Section peers_suite(Context& context);
Section stress_suite(Context& context);
Section pictures_suite(Context& context);
Section instances_suite(Context& context);

double mega(size_t rays, const Timing& timing);  // million rays a second

// RayErrors into the columns that all suites share (error_columns).
void add_errors(Json& row, const RayErrors& errors);
std::vector<Column> error_columns();

}  // namespace lsp::bench
