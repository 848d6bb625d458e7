// Instances beside one merged bake, ours and Embree's: what a scene of few things in many places costs and
// errs either way.
#include <algorithm>
#include <cmath>

#include "context.h"
#include "lsp/in_chunks.hpp"
#include "lsp/instanced_scene.hpp"
#include "process.h"
#include "ray_errors.h"
#include "timing.h"

namespace lsp::bench {
namespace {

// A scene as lsp-bake --instances writes it, and where each instance's triangles begin in the one bake.
struct Placed {
  InstancedScene scene;
  std::vector<lsp_instance> places;
  std::vector<uint32_t> first;
  double seconds = 0;       // of the bake
  uint64_t file_bytes = 0;  // of all assets

  const Instances& instances() const { return scene.instances(); }
};

Placed bake_placed(const Context& context, const SceneUnderTest& scene) {
  namespace fs = std::filesystem;
  const fs::path folder = context.cache / (scene.name() + "-instances");
  fs::remove_all(folder);  // assets are told apart by their names alone
  fs::create_directories(folder);
  const fs::path path = folder / "scene.json";
  std::vector<std::string> command = {program_path("lsp-bake").string(),
                                      scene.input().string(),
                                      "--instances",
                                      "-o",
                                      path.string(),
                                      "--quiet"};
  const Bake how = context.instance_bake();
  command.insert(command.end(), how.options.begin(), how.options.end());
  const ProcessResult result = run_process(command);
  if (result.exit_code != 0)
    throw Failure(static_cast<Exit>(result.exit_code), scene.name(),
                  "lsp-bake --instances: " + result.errors);
  Placed placed{InstancedScene(path.string()), {}, {}, result.seconds, 0};
  uint32_t first = 0;
  for (uint32_t i = 0; i < placed.instances().size(); ++i) {
    placed.places.push_back(placed.instances()[i]);
    placed.first.push_back(first);
    const SceneFile& asset = *placed.scene.assets()[placed.places.back().asset];
    first += static_cast<uint32_t>(asset.header().primitive_count);
  }
  for (const std::string& asset : placed.scene.asset_paths()) placed.file_bytes += fs::file_size(asset);
  return placed;
}

// As answers to the one mesh: primitives by its numbers.
void number_as_merged(const Placed& placed, std::span<LspHit> hits) {
  for (LspHit& hit : hits)
    if (hit.primitive != LSP_NONE) hit.primitive += placed.first[LSP_HIT_INSTANCE(hit)];
}

class PlacedOnCpu : public Tracer {
 public:
  PlacedOnCpu(const Placed& placed, unsigned threads) : placed_(placed), threads_(threads) {}
  std::string name() const override { return "lsp, instances"; }
  double trace(const Mode& mode, std::span<const LspRay> rays, std::span<LspHit> hits) override {
    const lsp_trace_options options = mode.options();
    return run_in_chunks(rays.size(), threads_, [&](size_t first, size_t count) {
      with_failures([&] {
        placed_.instances().trace(options, 0xFF, rays.subspan(first, count), hits.subspan(first, count));
      });
    });
  }

 private:
  const Placed& placed_;
  unsigned threads_;
};

// On a device of its own: what is merged stays on the other.
class PlacedOnVulkan : public Tracer {
 public:
  explicit PlacedOnVulkan(const Placed& placed) : placed_(placed) {
    vulkan_.load(std::span(placed.instances().view().assets, placed.instances().view().asset_count),
                 LSP_USE_EXACT | LSP_USE_APPROXIMATE);
  }
  std::string name() const override { return "lsp, instances"; }
  double trace(const Mode& mode, std::span<const LspRay> rays, std::span<LspHit> hits) override {
    const VulkanTrace done =
        vulkan_.trace_instances(placed_.instances().view(), mode.options(), 0xFF, rays, hits);
    return done.gpu_seconds > 0 ? done.gpu_seconds : done.seconds;
  }

 private:
  const Placed& placed_;
  VulkanTracer vulkan_;
};

Table rates_table() {
  Table table{
      "instances",
      "Speed and error",
      "The factor is against our exact trace of the one merged bake, on the same processor or device, "
      "of the same rays. Errors are against Embree's robust mode over the merged triangles.",
      {{"scene", "scene"},
       {"rays", "rays"},
       {"on", "on"},
       {"tracer", "tracer"},
       {"mrays", "Mrays/s"},
       {"times", "x merged exact"},
       {"spread", "spread, %", 1}},
      {}};
  for (const Column& column : error_columns()) table.columns.push_back(column);
  return table;
}

Table sizes_table() {
  return {
      "instances_sizes",
      "Bytes and bakes",
      "Files of all assets and the memory of lsp_instances_build, beside the file of one bake; Embree's are "
      "in memory.",
      {{"scene", "scene"},
       {"triangles", "triangles"},
       {"assets", "assets"},
       {"instances", "instances"},
       {"instanced_mb", "instanced, MB"},
       {"merged_mb", "merged, MB"},
       {"embree_instanced_mb", "Embree instanced, MB"},
       {"embree_merged_mb", "Embree merged, MB"},
       {"instanced_seconds", "bake instanced, s", 1},
       {"merged_seconds", "bake merged, s", 1}},
      {}};
}

// What traces, and whether its hits name instances.
struct Runner {
  std::string name;
  Tracer* tracer;
  Mode mode;
  bool placed;
};

// Races the runners, the first of which is what the others are measured by.
void race_runners(Context& context, const SceneUnderTest& scene, const Placed& placed, const RaySet& set,
                  const std::string& on, const std::vector<Runner>& runners, Table& table) {
  std::vector<std::vector<LspHit>> hits(runners.size(), std::vector<LspHit>(set.rays.size()));
  std::vector<Contender> contenders;
  for (size_t i = 0; i < runners.size(); ++i) {
    contenders.push_back(
        {runners[i].name, [&, i] { return runners[i].tracer->trace(runners[i].mode, set.rays, hits[i]); }});
  }
  const std::vector<Timing> timings = race(contenders, 1, context.repeats());
  for (size_t i = 0; i < runners.size(); ++i) {
    if (runners[i].placed) number_as_merged(placed, hits[i]);
    Json row;
    row["scene"] = scene.name();
    row["rays"] = set.name;
    row["on"] = on;
    row["tracer"] = runners[i].name;
    row["mrays"] = mega(set.rays.size(), timings[i]);
    row["times"] = i == 0
                       ? 1.0
                       : context.speed_up(scene.name() + ", " + set.name + ", " + on + ", " + runners[i].name,
                                          timings[i], timings[0]);
    row["spread"] = 100 * timings[i].spread;
    add_errors(row, set.any ? occlusion_errors(set.truth, hits[i])
                            : ray_errors(scene.soup(), set.rays, set.truth, hits[i]));
    table.rows.push_back(std::move(row));
  }
}

// Merged and instanced, exact and by tables at the default dial.
std::vector<Runner> ours(Tracer& merged, Tracer& instanced, bool any) {
  const Mode exact{.any = any};
  const Mode balanced{.approximate = true, .any = any};
  return {{"merged, exact", &merged, exact, false},
          {"instances, exact", &instanced, exact, true},
          {"merged, balanced", &merged, balanced, false},
          {"instances, balanced", &instanced, balanced, true}};
}

void measure_scene(Context& context, SceneUnderTest& scene, Section& section, Table& rates, Table& sizes) {
  if (scene.is_file()) {
    section.paragraphs.push_back(scene.name() + ": given as .lsp, which has no instances.");
    return;
  }
  const Placed placed = bake_placed(context, scene);
  if (placed.places.size() < 2) {
    section.paragraphs.push_back(scene.name() + ": one mesh in one place, there is nothing to compare.");
    return;
  }
  const Baked& merged_bake = scene.bake(context.instance_bake());
  if (!merged_bake.available) throw Failure(merged_bake.exit, scene.name(), merged_bake.reason);
  const OpenFile merged(merged_bake.path);
  std::vector<Soup> soups;
  for (const auto& asset : placed.scene.assets()) soups.push_back(soup_of(asset->scene()));
  const EmbreeScene embree(soups, placed.places, placed.first);
  const auto megabytes = [](uint64_t bytes) { return static_cast<double>(bytes) * 1e-6; };
  sizes.rows.push_back(
      {{"scene", scene.name()},
       {"triangles", scene.soup().size()},
       {"assets", placed.scene.assets().size()},
       {"instances", placed.places.size()},
       {"instanced_mb", megabytes(placed.file_bytes + lsp_instances_bytes(placed.instances().size()))},
       {"merged_mb", megabytes(merged_bake.file_bytes)},
       {"embree_instanced_mb", megabytes(embree.bytes())},
       {"embree_merged_mb", megabytes(scene.reference().bytes())},
       {"instanced_seconds", placed.seconds},
       {"merged_seconds", merged_bake.seconds}});

  const std::unique_ptr<Tracer> on_cpu = cpu_tracer(merged, context.threads);
  PlacedOnCpu placed_on_cpu(placed, context.threads);
  const auto embree_merged = embree_tracer(scene.reference(), EmbreeCall::kSingle, "", context.threads);
  const auto embree_placed = embree_tracer(embree, EmbreeCall::kSingle, "", context.threads);
  const std::unique_ptr<Tracer> on_vulkan = context.vulkan_tracer(merged, scene.name());
  std::unique_ptr<PlacedOnVulkan> placed_on_vulkan;
  if (on_vulkan != nullptr) placed_on_vulkan = std::make_unique<PlacedOnVulkan>(placed);
  std::vector<RaySet> sets;
  for (const bool shuffled : {false, true}) {
    sets.push_back(scene.diffuse(context.timing_rays(), shuffled));
    sets.push_back(scene.occlusion(context.timing_rays(), shuffled));
  }
  for (const RaySet& set : sets) {
    context.progress("instances: " + scene.name() + ", " + set.name);
    std::vector<Runner> runners = ours(*on_cpu, placed_on_cpu, set.any);
    runners.push_back({"Embree, merged", embree_merged.get(), {.any = set.any}, false});
    runners.push_back({"Embree, instances", embree_placed.get(), {.any = set.any}, false});
    race_runners(context, scene, placed, set, "CPU", runners, rates);
    if (on_vulkan != nullptr)
      race_runners(context, scene, placed, set, "Vulkan", ours(*on_vulkan, *placed_on_vulkan, set.any),
                   rates);
  }
}

}  // namespace

Section instances_suite(Context& context) {
  Section section{"instances", "Instances beside one merged bake", {}, {}, {}, {}};
  section.paragraphs.push_back(
      "A glTF scene baked twice: each mesh once, with an instance for every place (lsp-bake --instances), "
      "and "
      "all of it as one file. On Vulkan one shader walks the tree over instances and traces the assets. "
      "Embree "
      "is asked likewise, robust, one ray a call: over the merged triangles, and by its own instances of a "
      "scene for each mesh.");
  Table rates = rates_table(), sizes = sizes_table();
  context.each_scene(section,
                     [&](SceneUnderTest& scene) { measure_scene(context, scene, section, rates, sizes); });
  section.tables = {std::move(rates), std::move(sizes)};
  return section;
}

}  // namespace lsp::bench
