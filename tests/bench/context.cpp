#include "context.h"

#include <cstdio>

#include "lsp/program.h"

namespace lsp::bench {
namespace {

class VulkanFile : public Tracer {
 public:
  VulkanFile(VulkanTracer& vulkan, const OpenFile& file) : vulkan_(vulkan) {
    vulkan.load(file.scene(), LSP_USE_EXACT | LSP_USE_APPROXIMATE);
  }
  std::string name() const override { return "Vulkan"; }
  // In the shader, where the device has timestamps: an engine's rays and hits stay on the device.
  double trace(const Mode& mode, std::span<const LspRay> rays, std::span<LspHit> hits) override {
    const VulkanTrace done = vulkan_.trace(mode.options(), rays, hits);
    return done.gpu_seconds > 0 ? done.gpu_seconds : done.seconds;
  }

 private:
  VulkanTracer& vulkan_;
};

const Baked& or_throw(const Baked& baked, const SceneUnderTest& scene) {
  if (!baked.available) throw Failure(baked.exit, scene.name(), baked.reason);
  return baked;
}

// Coarse and quick to bake, with tables whether they pay or not.
const Bake kQuickCells{"cells8-fast", {"--cells", "8", "--preset", "fast"}};
// What nothing is asked of.
const Bake kDefault{"default", {}};
const Bake kCells{"cells", {"--base", "cells"}};

}  // namespace

const Baked& Context::cells(SceneUnderTest& scene) const {
  if (scene.is_file()) return scene.base();
  if (quick) return or_throw(scene.bake(kQuickCells), scene);
  const Baked& baked = or_throw(scene.bake(kDefault), scene);
  return OpenFile(baked.path).has_cells() ? baked : or_throw(scene.bake(kCells), scene);
}

Bake Context::instance_bake() const { return quick ? kQuickCells : kDefault; }

void Context::say_what_cells_are(SceneUnderTest& scene, Section& section) const {
  if (quick || scene.is_file() || OpenFile(or_throw(scene.bake(kDefault), scene).path).has_cells()) return;
  section.paragraphs.push_back(scene.name() +
                               ": the default bake has no tables, since its model of costs says that a ray "
                               "through them gains nothing; "
                               "measured is what --base cells makes all the same.");
}

void Context::guarded(Section& section, const std::string& what, const std::function<void()>& work) {
  std::string message;
  try {
    work();
    return;
  } catch (const Failure& failure) {
    message = (failure.file().empty() ? "" : failure.file() + ": ") + failure.what();
    // A file that cannot do what is asked is no failure of the run.
    if (!first_failure && failure.exit() != Exit::kUnsupported) first_failure = failure;
  } catch (const std::bad_alloc&) {
    message = "out of memory";
    if (!first_failure) first_failure = Failure(Exit::kLimit, what, message);
  } catch (const std::exception& error) {
    message = error.what();
    if (!first_failure) first_failure = Failure(Exit::kInternal, what, message);
  }
  message = section.id + ", " + what + ", failed: " + message;
  section.paragraphs.push_back(message + ". What follows lacks it.");
  warnings.push_back(message);
}

void Context::each_scene(Section& section, const std::function<void(SceneUnderTest&)>& work) {
  for (const auto& scene : scenes) {
    progress(section.id + ": " + scene->name());
    guarded(section, scene->name(), [&] { work(*scene); });
  }
}

std::vector<Timing> Context::race_on_vulkan(Tracer& tracer, std::span<const Mode> modes,
                                            std::span<const LspRay> rays, int repeats,
                                            const std::string& what) {
  std::vector<LspHit> hits(rays.size());
  std::vector<Contender> contenders;
  for (const Mode& mode : modes) {
    contenders.push_back({mode.name(), [&, mode] { return tracer.trace(mode, rays, hits); }});
  }
  try {
    return race(contenders, 1, repeats);
  } catch (const Failure& failure) {
    warnings.push_back(what + ": the Vulkan device failed and is left alone from here on: " + failure.what());
    vulkan_failed_ = true;
    return {};
  }
}

std::unique_ptr<Tracer> Context::vulkan_tracer(const OpenFile& file, const std::string& what) {
  if (!vulkan || vulkan_failed_) return nullptr;
  try {
    return std::make_unique<VulkanFile>(*vulkan, file);
  } catch (const Failure& failure) {
    warnings.push_back(what + ": no Vulkan figures: " + failure.what());
    return nullptr;
  }
}

double mega(size_t rays, const Timing& timing) {
  return timing.median > 0 ? static_cast<double>(rays) / timing.median * 1e-6 : 0;
}

double Context::speed_up(const std::string& what, const Timing& a, const Timing& b) {
  const double ratio = a.median > 0 ? b.median / a.median : 0;
  if (ratio_is_meaningless(a, b)) {
    char text[96];
    std::snprintf(text, sizeof text, ": %.2fx cannot be told from 1x (spread %.0f %% and %.0f %%)", ratio,
                  100 * a.spread, 100 * b.spread);
    warnings.push_back(what + text);
  } else if (a.spread > 0.15 || b.spread > 0.15) {
    char text[96];
    std::snprintf(text, sizeof text, ": %.2fx is uncertain (spread %.0f %% and %.0f %%)", ratio,
                  100 * a.spread, 100 * b.spread);
    warnings.push_back(what + text);
  }
  return ratio;
}

void add_errors(Json& row, const RayErrors& errors) {
  const auto rays = static_cast<double>(errors.rays ? errors.rays : 1);
  const auto hits = static_cast<double>(errors.both_hit ? errors.both_hit : 1);
  row["wrong_percent"] = 100 * errors.wrong_share();
  row["wrong_hits_percent"] = 100 * static_cast<double>(errors.wrong_hits) / rays;
  row["wrong_misses_percent"] = 100 * static_cast<double>(errors.wrong_misses) / rays;
  row["depth_mean_percent"] = 100 * errors.depth_diagonal.mean;
  row["depth_p95_percent"] = 100 * errors.depth_diagonal.p95;
  row["depth_p99_percent"] = 100 * errors.depth_diagonal.p99;
  row["depth_distance_percent"] = 100 * errors.depth_distance.mean;
  row["depth_distance_p95_percent"] = 100 * errors.depth_distance.p95;
  row["depth_distance_p99_percent"] = 100 * errors.depth_distance.p99;
  row["normal_degrees"] = errors.normal_degrees.mean;
  row["wrong_primitive_percent"] = 100 * static_cast<double>(errors.wrong_primitive) / hits;
}

std::vector<Column> error_columns() {
  return {{"wrong_percent", "wrong %", 3},
          {"wrong_hits_percent", "wrong hits %", 3},
          {"wrong_misses_percent", "wrong misses %", 3},
          {"depth_mean_percent", "depth error, % of diagonal", 3},
          {"depth_p95_percent", "95th", 3},
          {"depth_p99_percent", "99th", 3},
          {"depth_distance_percent", "% of distance", 2},
          {"depth_distance_p95_percent", "95th", 2},
          {"depth_distance_p99_percent", "99th", 2},
          {"normal_degrees", "normal, degrees", 2},
          {"wrong_primitive_percent", "other primitive %", 1}};
}

}  // namespace lsp::bench
