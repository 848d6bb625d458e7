#include "dial_curve.h"

#include <algorithm>

namespace lsp::bench {
namespace {

// Exact first; of any-hit rays or closest ones.
std::vector<Mode> points_of_the_dial(bool any) {
  std::vector<Mode> modes = {{}};
  for (const float loss : {100.0f, 50.0f, 20.0f, 10.0f, 5.0f, 2.0f, 1.0f, 0.0f})
    modes.push_back({.approximate = true, .max_loss = loss});
  for (const uint32_t quality : {LSP_QUALITY_FAST, LSP_QUALITY_BALANCED, LSP_QUALITY_ACCURATE})
    modes.push_back({.approximate = true, .quality = quality});
  for (Mode& mode : modes) mode.any = any;
  return modes;
}

constexpr EmbreeCall kEmbreeCalls[] = {EmbreeCall::kSingle, EmbreeCall::kPacket8, EmbreeCall::kPacket16,
                                       EmbreeCall::kStream};

// One set of rays through one file, in every mode.
struct Measured {
  std::vector<std::vector<LspHit>> hits;  // of the CPU
  std::vector<Timing> cpu, vulkan;        // a mode each; vulkan is empty where nothing was measured
  Timing embree;                          // of its fastest way
};

Measured trace_all(Context& context, const SceneUnderTest& scene, const OpenFile& file,
                   const EmbreeScene& embree, const std::vector<Mode>& modes, const RaySet& set) {
  Measured out;
  out.hits.assign(modes.size(), std::vector<LspHit>(set.rays.size()));
  const auto tracer = cpu_tracer(file, context.threads);
  std::vector<Contender> contenders;
  for (size_t m = 0; m < modes.size(); ++m) {
    contenders.push_back(
        {modes[m].name(), [&, m] { return tracer->trace(modes[m], set.rays, out.hits[m]); }});
  }
  std::vector<std::unique_ptr<Tracer>> peers;
  std::vector<LspHit> peer_hits(set.rays.size());
  for (const EmbreeCall call : kEmbreeCalls) {
    peers.push_back(embree_tracer(embree, call, "Embree", context.threads));
    contenders.push_back(
        {"Embree", [&, peer = peers.back().get()] { return peer->trace(modes[0], set.rays, peer_hits); }});
  }
  out.cpu = race(contenders, 1, context.repeats());
  const auto first_peer = out.cpu.begin() + static_cast<ptrdiff_t>(modes.size());
  out.embree = *std::min_element(first_peer, out.cpu.end(),
                                 [](const Timing& a, const Timing& b) { return a.median < b.median; });
  out.cpu.resize(modes.size());
  const std::string what = scene.name() + ", cells, " + set.name;
  if (const std::unique_ptr<Tracer> vulkan = context.vulkan_tracer(file, what)) {
    // A quarter of the rays: a software device takes its time, and the ratio is all that is wanted.
    out.vulkan =
        context.race_on_vulkan(*vulkan, modes, std::span(set.rays).first(set.rays.size() / 4), 3, what);
  }
  return out;
}

Json row_of(const RaySet& set, const Measured& measured, size_t mode) {
  Json row;
  row["times"] = measured.cpu[0].median / measured.cpu[mode].median;
  row["times_embree"] = measured.embree.median / measured.cpu[mode].median;
  if (!measured.vulkan.empty()) {
    row["times_vulkan"] = measured.vulkan[0].median / measured.vulkan[mode].median;
    row["mrays_vulkan"] = mega(set.rays.size() / 4, measured.vulkan[mode]);
  }
  row["mrays"] = mega(set.rays.size(), measured.cpu[mode]);
  row["spread"] = 100 * measured.cpu[mode].spread;
  return row;
}

void add_work(Json& row, const Work& work) {
  row["exact_calls"] = work.exact_calls;
  row["steps"] = work.nodes;
  row["lookups"] = work.shafts;
  row["splits"] = work.splits;
  row["triangle_tests"] = work.triangles;
}

// The table's rows for a set of rays, and the points of its curve, if it has one.
void add_rows(const SceneUnderTest& scene, const Baked& baked, const OpenFile& file,
              const std::vector<Mode>& modes, const RaySet& set, const Measured& measured,
              std::vector<Json>& rows, std::vector<Sample>* curve) {
  const auto few = std::span(set.rays).first(std::min<size_t>(set.rays.size(), 20000));
  for (size_t m = 0; m < modes.size(); ++m) {
    Json row{{"scene", scene.name()}, {"rays", set.name}, {"mode", modes[m].name()}};
    row.update(row_of(set, measured, m));
    row["file_mb"] = static_cast<double>(baked.file_bytes) * 1e-6;
    row["bake_seconds"] = baked.seconds;
    add_errors(row, set.any ? occlusion_errors(set.truth, measured.hits[m])
                            : ray_errors(scene.soup(), set.rays, set.truth, measured.hits[m]));
    add_work(row, count_work(file, modes[m], few));
    if (m > 0 && curve != nullptr) {
      curve->push_back({scene.name(), "cells", modes[m].name(), row["times"], row.value("times_vulkan", 0.0),
                        row["wrong_percent"], row["depth_mean_percent"], row["file_mb"]});
    }
    rows.push_back(std::move(row));
  }
}

}  // namespace

void measure_dial(Context& context, SceneUnderTest& scene, DialCurves& curves) {
  const Baked& baked = context.cells(scene);
  const OpenFile file(baked.path);
  if (!file.has_cells()) return;
  const EmbreeScene embree(scene.soup(), EmbreeMode::kFast);
  const auto measure = [&](const RaySet& set, std::vector<Sample>* curve) {
    const std::vector<Mode> modes = points_of_the_dial(set.any);
    context.progress("pareto: " + scene.name() + ", cells, " + set.name);
    const Measured measured = trace_all(context, scene, file, embree, modes, set);
    add_rows(scene, baked, file, modes, set, measured, curves.rows, curve);
    return measured.vulkan.empty() ? 0 : measured.vulkan[0].median;
  };
  const double seconds = measure(scene.diffuse(context.timing_rays(), true), &curves.camera);
  if (seconds > 0) curves.vulkan_exact[scene.name()] = seconds;
  measure(scene.surface(context.timing_rays()), &curves.surface);
  measure(scene.occlusion(context.timing_rays(), true), nullptr);
}

Table dial_table(const DialCurves& curves) {
  Table table{"pareto_dial",
              "Cells: the points of the dial",
              "Times the exact trace of the same file, which walks wide nodes, in the same run. Embree: the "
              "fastest of rtcIntersect1, 8, 16 and 1M, of ambient occlusion of rtcOccluded*, not robust. "
              "Steps go from one cell to the next.",
              {{"scene", "scene"},
               {"rays", "rays"},
               {"mode", "mode"},
               {"times", "x exact"},
               {"times_embree", "x Embree's fastest"},
               {"times_vulkan", "x exact, Vulkan"},
               {"mrays", "Mrays/s"},
               {"mrays_vulkan", "Mrays/s, Vulkan"},
               {"spread", "spread, %", 1},
               {"exact_calls", "exact calls a ray"},
               {"steps", "steps a ray", 1},
               {"lookups", "look-ups a ray", 2},
               {"splits", "splits a ray", 2},
               {"triangle_tests", "triangles a ray", 1}},
              curves.rows};
  for (const Column& column : error_columns()) table.columns.push_back(column);
  table.columns.push_back({"file_mb", "file, MB", 1});
  table.columns.push_back({"bake_seconds", "bake, s", 1});
  return table;
}

}  // namespace lsp::bench
