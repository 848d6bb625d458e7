// Run time against error against bytes: the dial of cells, and every bake of Line Spaces crossed with every
// way to trace it, and the frontier.
#include <algorithm>
#include <cmath>

#include "context.h"
#include "dial_curve.h"
#include "pareto_plots.h"
#include "ray_errors.h"
#include "wide_peer.h"

namespace lsp::bench {
namespace {

// What is swept: add a line to try a setting. --quick bakes Context::base_bake() alone.
struct Swept {
  const char* name;
  std::vector<std::string> options;
};
const std::vector<Swept>& swept() {
  static const std::vector<Swept> all = {
      {"N4-D9", {"--resolution", "4", "--depth", "9"}},
      {"N6-D9", {"--resolution", "6", "--depth", "9"}},
      {"N4-D9-T64", {"--resolution", "4", "--depth", "9", "--triangles", "64"}},
      {"N4-D6,9,12", {"--resolution", "4", "--depth", "6,9,12"}},
      {"N2-D12", {"--resolution", "2", "--depth", "12"}},
      {"N4-D12", {"--resolution", "4", "--depth", "12"}},
      {"N6-D12-S1", {"--resolution", "6", "--depth", "12", "--samples", "1"}},
      {"preset-fast", {"--preset", "fast"}},
      {"preset-accurate", {"--preset", "accurate"}},
      {"NT6-N6-D1", {"--base", "ntree", "--resolution", "6", "--depth", "1"}},
      {"NT6-N4-D2", {"--base", "ntree", "--branching", "6", "--resolution", "4", "--depth", "2"}},
      {"NT16-N4-D1",
       {"--base", "ntree", "--branching", "16", "--levels", "2", "--resolution", "4", "--depth", "1"}},
  };
  return all;
}

std::vector<Bake> bakes(const Context& context) {
  if (context.quick) return {context.base_bake()};
  std::vector<Bake> all;
  for (const Swept& one : swept()) all.push_back({one.name, one.options});
  return all;
}

bool is_ntree(const OpenFile& file) { return file.scene().header->base_structure == LSP_BASE_NTREE; }

// Does any Line Space have another one below it? Only then does a level of detail change anything.
bool has_levels(const OpenFile& file) {
  const lsp_scene& scene = file.scene();
  const auto has_others_below = [](uint32_t reference) {
    return reference != LSP_NONE && !(reference & LSP_TERMINAL_BIT);
  };
  if (has_others_below(scene.header->root_line_space)) return true;
  if (is_ntree(file))
    return std::any_of(scene.cells, scene.cells + scene.header->cell_count,
                       [&](const LspCell& cell) { return has_others_below(cell.line_space); });
  return std::any_of(scene.nodes, scene.nodes + scene.header->node_count, [&](const LspNode& node) {
    return has_others_below(node.line_space0) || has_others_below(node.line_space1);
  });
}

std::vector<Mode> modes_for(const OpenFile& file, bool quick) {
  std::vector<Mode> modes = {{.approximate = true},
                             {.approximate = true, .near_skip = true},
                             {.approximate = true, .near_approximate = true}};
  if (quick || !has_levels(file)) return modes;
  for (const float lod : {0.25f, 0.5f, 1.0f}) {
    modes.push_back({.approximate = true, .lod = lod});
    modes.push_back({.approximate = true, .near_skip = true, .lod = lod});
  }
  return modes;
}

// Marks what nothing else beats in both speed and `error`.
std::vector<bool> frontier(const std::vector<Sample>& samples, double Sample::*error) {
  std::vector<bool> best(samples.size(), true);
  for (size_t i = 0; i < samples.size(); ++i) {
    for (const Sample& other : samples) {
      if (other.scene != samples[i].scene) continue;
      const bool no_worse = other.times >= samples[i].times && other.*error <= samples[i].*error;
      const bool better = other.times > samples[i].times || other.*error < samples[i].*error;
      if (no_worse && better) best[i] = false;
    }
  }
  return best;
}

// How our exact trace compares with others on the very rays of the sweep.
ScenePeers measure_peers(Context& context, SceneUnderTest& scene, const RaySet& set) {
  ScenePeers peers;
  if (!context.quick) {
    const Baked& tree = scene.bake({"tree", {"--no-line-spaces"}});
    if (tree.available) peers.exact_megabytes = static_cast<double>(tree.file_bytes) * 1e-6;
  }
  const OpenFile file(scene.base().path);
  if (file.scene().header->base_structure != LSP_BASE_BVH) return peers;
  const WideTree wide(file);
  const std::unique_ptr<Tracer> tracers[] = {
      cpu_tracer(file, context.threads),
      embree_tracer(scene.reference(), EmbreeCall::kSingle, "Embree", context.threads),
      wide_tracer(wide, context.threads)};
  std::vector<LspHit> hits(set.rays.size());
  std::vector<Contender> contenders;
  for (const auto& tracer : tracers)
    contenders.push_back({tracer->name(), [&] { return tracer->trace({}, set.rays, hits); }});
  const std::vector<Timing> timings = race(contenders, 1, context.repeats());
  peers.embree = timings[0].median / timings[1].median;
  peers.wide = timings[0].median / timings[2].median;
  return peers;
}

struct Sweep {
  std::vector<Sample> samples;
  std::vector<Json> rows;  // of the samples
  std::vector<std::string> left_out;
  std::map<std::string, double> vulkan_exact;  // seconds of the device for the BVH's exact rays, by scene
  size_t uncertain = 0;                        // ratios that their spread makes meaningless
};

void sweep_scene(Context& context, SceneUnderTest& scene, Sweep& sweep) {
  const RaySet set = scene.diffuse(context.timing_rays(), true);
  context.answers.peers[scene.name()] = measure_peers(context, scene, set);
  double vulkan_exact = 0;  // seconds on a BVH: a device holds one scene at a time
  for (const Bake& how : bakes(context)) {
    const Baked& baked = scene.bake(how);
    if (!baked.available) {
      sweep.left_out.push_back(scene.name() + " " + how.name + " (" + baked.reason + ")");
      continue;
    }
    context.progress("pareto: " + scene.name() + " " + how.name);
    const OpenFile file(baked.path);
    if (!file.has_line_spaces() || !file.has_exact_tree()) continue;
    std::vector<Mode> modes = {{}};
    for (const Mode& mode : modes_for(file, context.quick)) modes.push_back(mode);
    const auto tracer = cpu_tracer(file, context.threads);
    std::unique_ptr<OpenFile> bvh_file;
    std::unique_ptr<Tracer> bvh;
    if (is_ntree(file)) {
      bvh_file = std::make_unique<OpenFile>(scene.base().path);
      bvh = cpu_tracer(*bvh_file, context.threads);
    }
    std::vector<std::vector<LspHit>> hits(modes.size(), std::vector<LspHit>(set.rays.size()));
    std::vector<Contender> contenders;
    for (size_t m = 0; m < modes.size(); ++m) {
      contenders.push_back({modes[m].name(), [&, m] {
                              return (m == 0 && bvh ? *bvh : *tracer).trace(modes[m], set.rays, hits[m]);
                            }});
    }
    const std::vector<Timing> timings = race(contenders, 1, context.repeats());
    std::vector<Timing> on_vulkan;
    const std::string what = scene.name() + ", " + how.name;
    if (const std::unique_ptr<Tracer> vulkan = context.vulkan_tracer(file, what)) {
      // A quarter of the rays: a software device takes its time, and the ratio is all that is wanted.
      on_vulkan =
          context.race_on_vulkan(*vulkan, modes, std::span(set.rays).first(set.rays.size() / 4), 3, what);
      if (!on_vulkan.empty() && !is_ntree(file))
        sweep.vulkan_exact[scene.name()] = vulkan_exact = on_vulkan[0].median;
    }
    for (size_t m = 1; m < modes.size(); ++m) {
      const RayErrors errors = ray_errors(scene.soup(), set.rays, set.truth, hits[m]);
      const Work work =
          count_work(file, modes[m], std::span(set.rays).first(std::min<size_t>(set.rays.size(), 20000)));
      const Sample sample{scene.name(),
                          how.name,
                          modes[m].name(),
                          timings[0].median / timings[m].median,
                          on_vulkan.empty() ? 0 : vulkan_exact / on_vulkan[m].median,
                          100 * errors.wrong_share(),
                          100 * errors.depth_diagonal.mean,
                          static_cast<double>(baked.file_bytes) * 1e-6};
      sweep.uncertain += ratio_is_meaningless(timings[m], timings[0]);
      Json row;
      row["scene"] = sample.scene;
      row["bake"] = sample.bake;
      row["mode"] = sample.mode;
      row["times"] = sample.times;
      if (sample.times_vulkan > 0) row["times_vulkan"] = sample.times_vulkan;
      row["mrays"] = mega(set.rays.size(), timings[m]);
      row["spread"] = 100 * timings[m].spread;
      row["file_mb"] = sample.megabytes;
      row["bake_seconds"] = baked.seconds;
      add_errors(row, errors);
      row["nodes"] = work.nodes;
      row["shafts"] = work.shafts;
      row["triangle_tests"] = work.triangles;
      sweep.samples.push_back(sample);
      sweep.rows.push_back(row);
    }
  }
}

}  // namespace

Section pareto_suite(Context& context) {
  Section section{"pareto", "Run time against error", {}, {}, {}, {}};
  section.paragraphs.push_back(
      "Cells at points of the dial from tables alone (max-loss 100) to nearly exact (0), against the exact "
      "trace "
      "of the same file, which walks wide nodes. Then every bake of Line Spaces, traced in every way; speed "
      "is "
      "times the exact trace of the BVH in the same run, for NTrees too. Shuffled diffuse rays from what a "
      "camera "
      "sees and, of cells, area-weighted ones from all surfaces and rays of ambient occlusion, a tenth of "
      "the "
      "diagonal long; all threads. Wrong answers are rays that "
      "hit "
      "where truth misses or the reverse. On the frontier nothing else is both faster and less often wrong; "
      "in "
      "its plot wide nodes are the yardstick of both.");
  Sweep sweep;
  DialCurves dial;
  context.each_scene(section, [&](SceneUnderTest& scene) {
    sweep_scene(context, scene, sweep);
    context.guarded(section, scene.name() + ", cells", [&] {
      context.say_what_cells_are(scene, section);
      measure_dial(context, scene, dial);
    });
  });
  for (const auto& [scene, seconds] : dial.vulkan_exact) {
    const auto bvh = sweep.vulkan_exact.find(scene);
    if (bvh != sweep.vulkan_exact.end()) context.answers.peers[scene].wide_vulkan = bvh->second / seconds;
  }
  const std::vector<bool> best_wrong = frontier(sweep.samples, &Sample::wrong_percent);
  const std::vector<bool> best_depth = frontier(sweep.samples, &Sample::depth_percent);
  for (size_t i = 0; i < sweep.rows.size(); ++i) {
    sweep.rows[i]["frontier"] = best_wrong[i] && best_depth[i] ? "both"
                                : best_wrong[i]                ? "wrong"
                                : best_depth[i]                ? "depth"
                                                               : "";
  }
  Table table{"pareto", "Line Spaces: all combinations", "", {}, sweep.rows};
  table.columns = {{"scene", "scene"},         {"bake", "bake"},
                   {"mode", "mode"},           {"frontier", "frontier"},
                   {"times", "x exact"},       {"times_vulkan", "x exact, Vulkan"},
                   {"mrays", "Mrays/s"},       {"spread", "spread, %", 1},
                   {"file_mb", "file, MB", 1}, {"bake_seconds", "bake, s", 1}};
  for (const Column& column : error_columns()) table.columns.push_back(column);
  for (const Column& column : {Column{"nodes", "nodes a ray", 1}, Column{"shafts", "look-ups a ray", 1},
                               Column{"triangle_tests", "triangles a ray", 1}}) {
    table.columns.push_back(column);
  }
  Table peers{"pareto_peers",
              "Exact tracers on the same rays, times our exact trace",
              "",
              {{"scene", "scene"},
               {"embree", "Embree rtcIntersect1, robust"},
               {"wide", "our tree, eight children a node"},
               {"exact_mb", "file without Line Spaces, MB", 1}},
              {}};
  for (const auto& [scene, peer] : context.answers.peers) {
    Json row{{"scene", scene}};
    if (peer.embree > 0) row["embree"] = peer.embree;
    if (peer.wide > 0) row["wide"] = peer.wide;
    if (peer.exact_megabytes > 0) row["exact_mb"] = peer.exact_megabytes;
    peers.rows.push_back(row);
  }
  if (sweep.uncertain > 0) {
    context.warnings.push_back("pareto: of " + std::to_string(sweep.samples.size()) + " ratios " +
                               std::to_string(sweep.uncertain) +
                               " cannot be told from 1x by the spread of their repeats.");
  }
  if (!sweep.left_out.empty()) {
    std::string text = "Left out: ";
    for (size_t i = 0; i < sweep.left_out.size(); ++i) text += (i ? "; " : "") + sweep.left_out[i];
    section.paragraphs.push_back(text + ".");
  }
  section.plots = pareto_plots(context, dial, sweep.samples, best_wrong);
  section.tables = {dial_table(dial), std::move(peers), std::move(table)};
  context.answers.samples = std::move(sweep.samples);
  context.answers.cells = std::move(dial.camera);
  return section;
}

}  // namespace lsp::bench
