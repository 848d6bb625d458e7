// Embree on the same rays, the same threads, in the same run; our own exact and approximate traces; and a
// distance field.
#include <algorithm>
#include <cmath>

#include "context.h"
#include "field_peer.h"
#include "ray_errors.h"
#include "wide_peer.h"

namespace lsp::bench {
namespace {

struct Peer {
  std::string name;
  std::unique_ptr<Tracer> tracer;
  Mode mode;
};

// What the sentences are made of: logarithms of ratios, summed over scenes.
struct Means {
  double embree = 0, approximate = 0, wide = 0;  // times our exact trace, of shuffled diffuse rays
  int traced = 0;
  double embree_bytes = 0, tree_bytes = 0, small_bytes = 0, file_bytes = 0;  // a triangle
  int sized = 0;
};

Table rates_table() {
  return {"peers",
          "Million rays a second",
          "The factor is against our exact trace of the same rays.",
          {{"scene", "scene"},
           {"rays", "rays"},
           {"threads", "threads"},
           {"tracer", "tracer"},
           {"mrays", "Mrays/s"},
           {"times", "x exact"},
           {"spread", "spread, %", 1},
           {"wrong_percent", "wrong %", 3}},
          {}};
}

Table builds_table(bool quick) {
  return {"peers_builds",
          "Build and memory",
          "",
          {{"scene", "scene"},
           {"triangles", "triangles"},
           {"embree_seconds", "Embree robust, build, s"},
           {"embree_bytes", "Embree, bytes a triangle", 0},
           {"wide_bytes", "wide tree, bytes a triangle", 0},
           {"bake_seconds", quick ? "lsp-bake N = 4, D = 9, s" : "lsp-bake N = 6, D = 9, s"},
           {"tree_bytes", "file without Line Spaces, bytes a triangle", 0},
           {"small_bytes", "with them, N = 4, D = 9", 0},
           {"file_bytes", quick ? "N = 4, D = 9" : "N = 6, D = 9", 0}},
          {}};
}

Json build_row(const Context& context, SceneUnderTest& scene, const WideTree* wide, Means& means) {
  const EmbreeScene& robust = scene.reference();
  const auto triangles = static_cast<double>(scene.soup().size());
  const auto a_triangle = [&](uint64_t bytes) { return static_cast<double>(bytes) / triangles; };
  Json row;
  row["scene"] = scene.name();
  row["triangles"] = scene.soup().size();
  row["embree_seconds"] = robust.build_seconds();
  row["embree_bytes"] = a_triangle(robust.bytes());
  row["bake_seconds"] = scene.base().seconds;
  row["file_bytes"] = a_triangle(scene.base().file_bytes);
  if (wide) row["wide_bytes"] = a_triangle(wide->bytes());
  if (context.quick) return row;
  const Baked& tree = scene.bake({"tree", {"--no-line-spaces"}});
  const Baked& small = scene.bake(line_space_bake(4, 9));
  if (!tree.available || !small.available) return row;
  row["tree_bytes"] = a_triangle(tree.file_bytes);
  row["small_bytes"] = a_triangle(small.file_bytes);
  means.embree_bytes += std::log(a_triangle(robust.bytes()));
  means.tree_bytes += std::log(a_triangle(tree.file_bytes));
  means.small_bytes += std::log(a_triangle(small.file_bytes));
  means.file_bytes += std::log(a_triangle(scene.base().file_bytes));
  ++means.sized;
  return row;
}

// Ours exact first.
std::vector<Peer> peers_of(const Context& context, const SceneUnderTest& scene, const OpenFile& file,
                           const WideTree* wide, const EmbreeScene& fast, const RaySet& set,
                           unsigned threads) {
  std::vector<Peer> peers;
  const auto add = [&](std::unique_ptr<Tracer> tracer, const std::string& name, Mode mode) {
    mode.any = set.any;
    peers.push_back({name, std::move(tracer), mode});
  };
  add(cpu_tracer(file, threads), "lsp exact", {});
  if (file.has_line_spaces()) {
    add(cpu_tracer(file, threads), "lsp approximate", {.approximate = true});
    add(cpu_tracer(file, threads), "lsp approximate, near skipped", {.approximate = true, .near_skip = true});
    add(cpu_tracer(file, threads), "lsp approximate, near too",
        {.approximate = true, .near_approximate = true});
  }
  if (wide) add(wide_tracer(*wide, threads), "wide tree exact", {});
  const std::string verb = set.any ? "rtcOccluded" : "rtcIntersect";
  for (const EmbreeScene* embree : {&scene.reference(), &fast}) {
    const std::string mode = embree == &fast ? " fast" : " robust";
    add(embree_tracer(*embree, EmbreeCall::kSingle, "", threads), "Embree " + verb + "1" + mode, {});
    add(embree_tracer(*embree, EmbreeCall::kPacket8, "", threads), "Embree " + verb + "8" + mode, {});
    if (context.quick) continue;
    add(embree_tracer(*embree, EmbreeCall::kPacket16, "", threads), "Embree " + verb + "16" + mode, {});
    add(embree_tracer(*embree, EmbreeCall::kStream, "", threads), "Embree " + verb + "1M" + mode, {});
  }
  return peers;
}

void race_peers(Context& context, const SceneUnderTest& scene, const std::vector<Peer>& peers,
                const RaySet& set, unsigned threads, Table& table, Means& means) {
  std::vector<std::vector<LspHit>> hits(peers.size(), std::vector<LspHit>(set.rays.size()));
  std::vector<Contender> contenders;
  for (size_t i = 0; i < peers.size(); ++i) {
    contenders.push_back(
        {peers[i].name, [&, i] { return peers[i].tracer->trace(peers[i].mode, set.rays, hits[i]); }});
  }
  const std::vector<Timing> timings = race(contenders, 1, context.repeats());
  const bool line_spaces = std::any_of(peers.begin(), peers.end(),
                                       [](const Peer& peer) { return peer.name == "lsp approximate"; });
  const bool counts = line_spaces && set.name == "diffuse, shuffled" && threads == context.threads;
  means.traced += counts;
  for (size_t i = 0; i < peers.size(); ++i) {
    const std::string& name = peers[i].name;
    const RayErrors errors = set.any ? occlusion_errors(set.truth, hits[i])
                                     : ray_errors(scene.soup(), set.rays, set.truth, hits[i]);
    const std::string what =
        scene.name() + ", " + set.name + ", " + std::to_string(threads) + " threads, " + name;
    Json row;
    row["scene"] = scene.name();
    row["rays"] = set.name;
    row["threads"] = threads;
    row["tracer"] = name;
    row["mrays"] = mega(set.rays.size(), timings[i]);
    row["times"] = i == 0 ? 1.0 : context.speed_up(what, timings[i], timings[0]);
    row["spread"] = 100 * timings[i].spread;
    row["wrong_percent"] = 100 * errors.wrong_share();
    table.rows.push_back(row);
    if (!counts) continue;
    const double gain = std::log(timings[0].median / timings[i].median);
    if (name == "Embree rtcIntersect1 robust") means.embree += gain;
    if (name == "lsp approximate") means.approximate += gain;
    if (name == "wide tree exact") means.wide += gain;
  }
}

void measure_scene(Context& context, SceneUnderTest& scene, Table& rates, Table& builds, Means& means) {
  const OpenFile file(scene.base().path);
  const EmbreeScene fast(scene.soup(), EmbreeMode::kFast);
  std::unique_ptr<WideTree> wide;
  if (file.scene().header->base_structure == LSP_BASE_BVH) wide = std::make_unique<WideTree>(file);
  builds.rows.push_back(build_row(context, scene, wide.get(), means));
  std::vector<RaySet> sets;
  for (const bool shuffled : {false, true}) {
    sets.push_back(scene.diffuse(context.timing_rays(), shuffled));
    sets.push_back(scene.occlusion(context.timing_rays(), shuffled));
    if (!context.quick && shuffled) sets.push_back(scene.shadows(context.timing_rays(), shuffled));
  }
  std::vector<unsigned> thread_counts = {context.threads};
  if (context.threads > 1 && !context.quick) thread_counts.insert(thread_counts.begin(), 1);
  for (const RaySet& set : sets) {
    for (const unsigned threads : thread_counts) {
      const std::vector<Peer> peers = peers_of(context, scene, file, wide.get(), fast, set, threads);
      race_peers(context, scene, peers, set, threads, rates, means);
    }
  }
}

void add_sentences(const Means& means, bool quick, Answers& answers) {
  char text[400];
  if (means.traced > 0) {
    const auto mean = [&](double sum) { return std::exp(sum / means.traced); };
    std::snprintf(
        text, sizeof text,
        "Against Embree (rtcIntersect1, robust; shuffled diffuse rays, %u threads, geometric mean of %d "
        "scenes): Embree traces at %.2fx our exact speed; our approximate trace (N = %d, D = 9, near field "
        "exact) at %.2fx ours, so %.2fx Embree's; our wide exact tree at %.2fx ours.",
        answers.threads, means.traced, mean(means.embree), quick ? 4 : 6, mean(means.approximate),
        mean(means.approximate - means.embree), mean(means.wide));
    answers.others.push_back(text);
  }
  if (means.sized > 0) {
    const auto mean = [&](double sum) { return std::exp(sum / means.sized); };
    std::snprintf(text, sizeof text,
                  "Bytes a triangle (geometric mean of %d scenes): the exact file %.0f, with Line Spaces of "
                  "N = 4, D = 9 %.0f, of N = 6, D = 9 %.0f; Embree's scene in memory %.0f.",
                  means.sized, mean(means.tree_bytes), mean(means.small_bytes), mean(means.file_bytes),
                  mean(means.embree_bytes));
    answers.others.push_back(text);
  }
}

}  // namespace

Section peers_suite(Context& context) {
  Section section{"peers", "Against Embree and a distance field", {}, {}, {}, {}};
  section.paragraphs.push_back(
      "Every contender answers the same rays in turn, interleaved. Embree: high build quality, rays written "
      "with 16-byte stores, denormals flushed, no coherence flag; packets include gathering rays into lanes, "
      "as any user has to. Ours writes 32-byte hits with shading normals, the wide tree too, Embree "
      "distance, "
      "primitive and weights. The wide tree is the file's own binary tree made into the nodes of eight "
      "children that files of cells have for exact rays, and traced by the library: what the tables of a "
      "Line "
      "Space are up against on a CPU.");
  Table rates = rates_table(), builds = builds_table(context.quick), fields = field_table();
  Means means;
  context.each_scene(section, [&](SceneUnderTest& scene) {
    measure_scene(context, scene, rates, builds, means);
    context.guarded(section, scene.name() + ", distance field",
                    [&] { measure_field(context, scene, section, fields); });
  });
  add_sentences(means, context.quick, context.answers);
  section.tables = {std::move(rates), std::move(fields), std::move(builds)};
  return section;
}

}  // namespace lsp::bench
