// Run time against error against bytes: every bake crossed with every way to trace it, and the frontier.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>

#include "context.h"
#include "ray_errors.h"

namespace lsp::bench {
namespace {

std::vector<Bake> bakes(const Context& context) {
  if (context.quick) return {context.base_bake()};
  std::vector<Bake> all = {line_space_bake(4, 9), line_space_bake(6, 9)};
  all.push_back({"N4-D6,9,12", {"--resolution", "4", "--depth", "6,9,12"}});
  all.push_back(line_space_bake(2, 12));
  all.push_back(line_space_bake(4, 12));
  all.push_back(line_space_bake(6, 12));
  all.push_back({"N3-D9,12,15", {"--resolution", "3", "--depth", "9,12,15"}});
  for (const char* preset : {"fast", "accurate"}) {
    all.push_back({std::string("preset-") + preset, {"--preset", preset}});
  }
  all.push_back({"NT6-N6-D1", {"--base", "ntree", "--resolution", "6", "--depth", "1"}});
  all.push_back(
      {"NT16-N4-D1",
       {"--base", "ntree", "--branching", "16", "--levels", "2", "--resolution", "4", "--depth", "1"}});
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
  if (!has_levels(file)) return modes;
  if (quick) {
    modes.push_back({.approximate = true, .lod = 0.5f});
    return modes;
  }
  for (const float lod : {0.25f, 0.5f, 1.0f}) {
    modes.push_back({.approximate = true, .lod = lod});
    modes.push_back({.approximate = true, .near_skip = true, .lod = lod});
  }
  return modes;
}

struct Sample {
  std::string scene, bake, mode;
  double times, times_vulkan, wrong_percent, depth_percent, megabytes;
};

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

// The best speed at no more than `limit` % wrong answers, per scene; 1 (exact) where nothing approximate
// helps.
std::map<std::string, Sample> best_within(const std::vector<Sample>& samples, double limit,
                                          double Sample::*times) {
  std::map<std::string, Sample> best;
  for (const Sample& sample : samples) {
    const auto [it, fresh] =
        best.try_emplace(sample.scene, Sample{sample.scene, "-", "exact", 1, 1, 0, 0, 0});
    if (sample.wrong_percent <= limit && sample.*times > it->second.*times) it->second = sample;
  }
  return best;
}

// "1.23x (geometric mean; 1.00x to 1.50x)"
std::string range_of(const std::map<std::string, Sample>& best, double Sample::*times) {
  double log_sum = 0, least = INFINITY, greatest = 0;
  for (const auto& [name, sample] : best) {
    log_sum += std::log(sample.*times);
    least = std::min(least, sample.*times);
    greatest = std::max(greatest, sample.*times);
  }
  char text[96];
  std::snprintf(text, sizeof text, "%.2fx (%.2fx to %.2fx)",
                std::exp(log_sum / static_cast<double>(best.size())), least, greatest);
  return text;
}

// What one backend's frontier says, in a sentence each.
void answer(Context& context, const std::vector<Sample>& samples, double Sample::*times,
            const std::string& where) {
  std::string sentence =
      where +
      ", shuffled diffuse rays, the fastest approximate trace is, times the exact one (geometric "
      "mean of " +
      std::to_string(context.scenes.size()) + " scenes, least to greatest): ";
  const char* separator = "";
  for (const double limit : {0.1, 0.5, 1.0, 2.0}) {
    char share[64];
    std::snprintf(share, sizeof share, "%sat %g %% wrong answers ", separator, limit);
    sentence += share + range_of(best_within(samples, limit, times), times);
    separator = "; ";
  }
  context.answers.push_back(sentence + ".");
  std::string useless;
  for (const auto& [name, sample] : best_within(samples, 1, times)) {
    if (sample.*times < 1.1) useless += (useless.empty() ? "" : ", ") + name;
  }
  if (!useless.empty()) {
    context.answers.push_back(
        where + ", it is not worth using (under 1.1x at 1 % wrong answers) on: " + useless + ".");
  }
}

}  // namespace

Section pareto_suite(Context& context) {
  Section section{"pareto", "Run time against error", {}, {}, {}, {}};
  section.paragraphs.push_back(
      "Every bake, traced in every way, on shuffled diffuse rays from what a camera sees, all threads. Speed "
      "is "
      "times the exact trace of the BVH in the same run, for NTrees too; wrong answers are rays that hit "
      "where truth "
      "misses "
      "or the reverse. On the frontier nothing else is both faster and less often wrong.");
  std::vector<Sample> samples;
  std::vector<Json> rows;
  std::vector<std::string> left_out;
  const size_t rays = context.timing_rays();
  for (const auto& scene : context.scenes) {
    const RaySet set = scene->diffuse(rays, true);
    double vulkan_exact = 0;  // seconds on a BVH: a device holds one scene at a time
    for (const Bake& how : bakes(context)) {
      const Baked& baked = scene->bake(how);
      if (!baked.available) {
        left_out.push_back(scene->name() + " " + how.name + " (" + baked.reason + ")");
        continue;
      }
      context.progress("pareto: " + scene->name() + " " + how.name);
      const OpenFile file(baked.path);
      if (!file.has_line_spaces() || !file.has_exact_tree()) continue;
      std::vector<Mode> modes = {{}};
      for (const Mode& mode : modes_for(file, context.quick)) modes.push_back(mode);
      const auto tracer = cpu_tracer(file, context.threads);
      std::unique_ptr<OpenFile> bvh_file;
      std::unique_ptr<Tracer> bvh;
      if (is_ntree(file)) {
        bvh_file = std::make_unique<OpenFile>(scene->base().path);
        bvh = cpu_tracer(*bvh_file, context.threads);
      }
      std::vector<std::vector<LspHit>> hits(modes.size(), std::vector<LspHit>(set.rays.size()));
      std::vector<Contender> contenders;
      for (size_t m = 0; m < modes.size(); ++m) {
        contenders.push_back({modes[m].name(), [&, m] {
                                return (m == 0 && bvh ? *bvh : *tracer).trace(modes[m], set.rays, hits[m]);
                              }});
      }
      const std::vector<Timing> timings = race(contenders, 1, 3);
      std::vector<Timing> on_vulkan;
      const std::unique_ptr<Tracer> vulkan = context.vulkan_tracer(file, scene->name() + ", " + how.name);
      if (vulkan) {
        // A quarter of the rays: a software device takes its time, and the ratio is all that is wanted.
        const std::span<const LspRay> some = std::span(set.rays).first(set.rays.size() / 4);
        std::vector<LspHit> out(some.size());
        std::vector<Contender> others;
        for (const Mode& mode : modes)
          others.push_back({mode.name(), [&, mode] { return vulkan->trace(mode, some, out); }});
        on_vulkan = race(others, 1, 3);
        if (!is_ntree(file)) vulkan_exact = on_vulkan[0].median;
      }
      for (size_t m = 1; m < modes.size(); ++m) {
        const RayErrors errors = ray_errors(scene->soup(), set.rays, set.truth, hits[m]);
        const Work work =
            count_work(file, modes[m], std::span(set.rays).first(std::min<size_t>(set.rays.size(), 20000)));
        Sample sample{scene->name(),
                      how.name,
                      modes[m].name(),
                      timings[0].median / timings[m].median,
                      on_vulkan.empty() ? 0 : vulkan_exact / on_vulkan[m].median,
                      100 * errors.wrong_share(),
                      100 * errors.depth_diagonal.mean,
                      static_cast<double>(baked.file_bytes) * 1e-6};
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
        samples.push_back(sample);
        rows.push_back(row);
      }
    }
  }
  const std::vector<bool> best_wrong = frontier(samples, &Sample::wrong_percent);
  const std::vector<bool> best_depth = frontier(samples, &Sample::depth_percent);
  for (size_t i = 0; i < rows.size(); ++i) {
    rows[i]["frontier"] = best_wrong[i] && best_depth[i] ? "both"
                          : best_wrong[i]                ? "wrong"
                          : best_depth[i]                ? "depth"
                                                         : "";
  }
  Table table{"pareto", "All combinations", "", {}, rows};
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

  Plot speed{"pareto_wrong",
             "Speed against wrong answers",
             "Up and left is better.",
             {"wrong answers, % of rays", true},
             {"times the exact trace", false},
             {}};
  Plot depth{"pareto_depth",
             "Speed against depth error",
             "Up and left is better.",
             {"mean depth error, % of the diagonal", true},
             {"times the exact trace", false},
             {}};
  Plot bytes{"pareto_bytes",     "Wrong answers against bytes",      "Down and left is better.",
             {"file, MB", true}, {"wrong answers, % of rays", true}, {}};
  Plot curve{"pareto_frontier",
             "The frontier of each scene",
             "",
             {"wrong answers, % of rays", true},
             {"times the exact trace", false},
             {}};
  for (const auto& scene : context.scenes) {
    Series s{scene->name(), {}, false}, d = s, b = s, f{scene->name(), {}, true};
    for (size_t i = 0; i < samples.size(); ++i) {
      const Sample& sample = samples[i];
      if (sample.scene != scene->name()) continue;
      const std::string label = sample.bake + ", " + sample.mode;
      s.points.push_back({std::max(sample.wrong_percent, 1e-3), sample.times, label});
      d.points.push_back({std::max(sample.depth_percent, 1e-4), sample.times, label});
      b.points.push_back({sample.megabytes, std::max(sample.wrong_percent, 1e-3), label});
      if (best_wrong[i]) f.points.push_back(s.points.back());
    }
    std::sort(f.points.begin(), f.points.end(), [](const Point& a, const Point& c) { return a.x < c.x; });
    speed.series.push_back(s);
    depth.series.push_back(d);
    bytes.series.push_back(b);
    curve.series.push_back(f);
  }

  Table limits{"pareto_limits",
               "The fastest within a limit of wrong answers",
               "\"exact\" where nothing approximate is faster within the limit.",
               {{"limit", "wrong answers at most, %", 1},
                {"scene", "scene"},
                {"times", "x exact"},
                {"bake", "bake"},
                {"mode", "mode"},
                {"wrong_percent", "wrong %", 3},
                {"file_mb", "file, MB", 1}},
               {}};
  for (const double limit : {0.1, 0.5, 1.0, 2.0}) {
    const std::map<std::string, Sample> best = best_within(samples, limit, &Sample::times);
    for (const auto& [name, sample] : best) {
      Json row;
      row["limit"] = limit;
      row["scene"] = name;
      row["times"] = sample.times;
      row["bake"] = sample.bake;
      row["mode"] = sample.mode;
      row["wrong_percent"] = sample.wrong_percent;
      if (sample.megabytes > 0) row["file_mb"] = sample.megabytes;
      limits.rows.push_back(row);
    }
  }
  if (!samples.empty()) {
    answer(context, samples, &Sample::times, "On the CPU (" + std::to_string(context.threads) + " threads)");
    const bool everywhere = std::all_of(samples.begin(), samples.end(),
                                        [](const Sample& sample) { return sample.times_vulkan > 0; });
    if (everywhere)
      answer(context, samples, &Sample::times_vulkan, "On Vulkan (" + context.vulkan->device_name() + ")");
  }
  if (!left_out.empty()) {
    std::string text = "Left out: ";
    for (size_t i = 0; i < left_out.size(); ++i) text += (i ? "; " : "") + left_out[i];
    section.paragraphs.push_back(text + ".");
  }
  section.plots = {curve, speed, depth, bytes};
  section.tables = {std::move(limits), std::move(table)};
  return section;
}

}  // namespace lsp::bench
