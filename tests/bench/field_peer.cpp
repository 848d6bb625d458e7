#include "field_peer.h"

#include <cstdio>

#include "distance_field.h"

namespace lsp::bench {
namespace {

constexpr float kThresholds[] = {0.25f, 0.5f, 0.75f, 1.0f};  // of the grid's step

// Someone who answers rays, and what he took to make.
struct Peer {
  std::string name;
  std::unique_ptr<Tracer> tracer;
  Mode mode;
  std::vector<LspHit> hits;
  Json facts;
};

// The field as often as there are thresholds; only one of them is reported.
std::vector<Peer> field_peers(const DistanceField& field, unsigned threads) {
  std::vector<Peer> peers;
  for (const float threshold : kThresholds) {
    char name[64];
    std::snprintf(name, sizeof name, "distance field, %u x %u x %u", field.size().x, field.size().y,
                  field.size().z);
    peers.push_back({name,
                     field_tracer(field, threshold, threads),
                     {},
                     {},
                     {{"megabytes", static_cast<double>(field.bytes()) * 1e-6},
                      {"bake_seconds", field.bake_seconds()},
                      {"threshold", threshold}}});
  }
  return peers;
}

double field_steps(const DistanceField& field, float threshold, std::span<const LspRay> rays) {
  uint64_t steps = 0;
  for (const LspRay& ray : rays) field.trace(ray, threshold, &steps);
  return static_cast<double>(steps) / static_cast<double>(std::max<size_t>(1, rays.size()));
}

// Cells in a file of `bytes` or, where none is as small, of four times that, or of sixteen. To find out takes
// several bakes: a quick run has the coarsest that are of use.
const Baked& cells_of_size(const Context& context, SceneUnderTest& scene, size_t bytes) {
  std::vector<std::string> options = {"--base", "cells", "--no-exact"};
  if (context.quick) {
    options.insert(options.end(), {"--cells", "4", "--preset", "fast"});
    return scene.bake({"cells4-fast-alone", options});
  }
  options.insert(options.end(), {"--max-size", ""});
  const Baked* baked = nullptr;
  for (const size_t most : {bytes, 4 * bytes, 16 * bytes}) {
    options.back() = std::to_string(most);
    baked = &scene.bake({"cells-alone-" + options.back(), options});
    if (baked->available || baked->exit != Exit::kLimit) break;
  }
  return *baked;
}

RayErrors errors_of(const SceneUnderTest& scene, const RaySet& set, const Peer& peer) {
  return ray_errors(scene.soup(), set.rays, set.truth, peer.hits);
}

// A leak that ends on a surface further back is no wrong answer, but it is an error.
double error_of(const SceneUnderTest& scene, const RaySet& set, const Peer& peer) {
  const RayErrors errors = errors_of(scene, set, peer);
  return errors.wrong_share() + errors.depth_diagonal.mean;
}

void trace_all(Context& context, const SceneUnderTest& scene, const DistanceField& field,
               const OpenFile* cells, std::vector<Peer>& peers, const RaySet& set, Table& table) {
  std::vector<Contender> contenders;
  for (Peer& peer : peers) {
    peer.hits.resize(set.rays.size());
    contenders.push_back({peer.name, [&] { return peer.tracer->trace(peer.mode, set.rays, peer.hits); }});
  }
  const std::vector<Timing> timings = race(contenders, 1, context.repeats());
  size_t best = 0;  // of the thresholds
  for (size_t k = 1; k < std::size(kThresholds); ++k) {
    if (error_of(scene, set, peers[k]) < error_of(scene, set, peers[best])) best = k;
  }
  const auto few = std::span(set.rays).first(std::min<size_t>(set.rays.size(), 20000));
  for (size_t k = 0; k < peers.size(); ++k) {
    const bool is_field = k < std::size(kThresholds);
    if (is_field && k != best) continue;
    Json row{{"scene", scene.name()}, {"rays", set.name}, {"peer", peers[k].name}};
    row.update(peers[k].facts);
    const RayErrors errors = errors_of(scene, set, peers[k]);
    row["wrong_percent"] = 100 * errors.wrong_share();
    row["depth_mean_percent"] = 100 * errors.depth_diagonal.mean;
    row["depth_p99_percent"] = 100 * errors.depth_diagonal.p99;
    row["mrays"] = mega(set.rays.size(), timings[k]);
    row["spread"] = 100 * timings[k].spread;
    if (is_field) {
      row["steps"] = field_steps(field, kThresholds[k], few);
    } else {
      const Work work = count_work(*cells, peers[k].mode, few);
      row["steps"] = work.nodes;
      row["lookups"] = work.shafts;
    }
    table.rows.push_back(row);
  }
}

}  // namespace

Table field_table() {
  return {
      "peers_field",
      "A distance field, and cells of its size",
      "Closest hits on all threads. Of the hit thresholds of 0.25, 0.5, 0.75 and 1 step of the grid the one "
      "with the least sum of wrong answers and mean depth error; a field's look-up is eight samples, and a "
      "step one look-up. Cells are tables alone (--no-exact), in a file of the field's bytes or, where none "
      "is "
      "as small, of four or sixteen times that; of a quick run 4 cells along the longest side, whatever "
      "their "
      "bytes.",
      {{"scene", "scene"},
       {"rays", "rays"},
       {"peer", "peer"},
       {"megabytes", "MB"},
       {"bake_seconds", "bake, s", 1},
       {"threshold", "threshold, steps"},
       {"wrong_percent", "wrong %", 3},
       {"depth_mean_percent", "depth error, % of diagonal", 3},
       {"depth_p99_percent", "99th", 2},
       {"mrays", "Mrays/s"},
       {"spread", "spread, %", 1},
       {"steps", "steps a ray", 1},
       {"lookups", "look-ups a ray", 2}},
      {}};
}

void measure_field(Context& context, SceneUnderTest& scene, Section& section, Table& table) {
  context.progress("peers: " + scene.name() + ", distance field");
  const DistanceField field(scene.soup(), scene.reference(), context.quick ? 64 : 256, context.threads);
  std::vector<Peer> peers = field_peers(field, context.threads);
  std::unique_ptr<OpenFile> cells;
  if (!scene.is_file()) {
    const Baked& baked = cells_of_size(context, scene, field.bytes());
    if (baked.available) {
      cells = std::make_unique<OpenFile>(baked.path);
      peers.push_back(
          {"cells, tables alone",
           cpu_tracer(*cells, context.threads),
           {.approximate = true, .quality = LSP_QUALITY_FAST},
           {},
           {{"megabytes", static_cast<double>(baked.file_bytes) * 1e-6}, {"bake_seconds", baked.seconds}}});
    } else {
      section.paragraphs.push_back(scene.name() + ": no cells beside the distance field: " + baked.reason);
    }
  }
  trace_all(context, scene, field, cells.get(), peers, scene.diffuse(context.timing_rays(), true), table);
  trace_all(context, scene, field, cells.get(), peers, scene.surface(context.timing_rays()), table);
}

}  // namespace lsp::bench
