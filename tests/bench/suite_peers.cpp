// Embree on the same rays, the same threads, in the same run; and our own exact and approximate traces.
#include <cmath>

#include "context.h"
#include "ray_errors.h"
#include "wide_peer.h"

namespace lsp::bench {
namespace {

struct Peer {
  std::string name;
  Tracer* tracer;
  Mode mode;
};

}  // namespace

Section peers_suite(Context& context) {
  Section section{"peers", "Against Embree", {}, {}, {}, {}};
  section.paragraphs.push_back(
      "Every contender answers the same rays in turn, interleaved. Embree: high build quality, rays written "
      "with "
      "16-byte stores, denormals flushed, no coherence flag; packets include gathering rays into lanes, as "
      "any user "
      "has to. Ours writes 32-byte hits with shading normals, the wide tree too, Embree distance, primitive "
      "and "
      "weights. The wide tree is the file's own binary tree made into the nodes of eight children that files "
      "of cells "
      "have for exact rays, and traced by the library: what the tables of a Line Space are up against on a "
      "CPU.");
  Table table{
      "peers", "Million rays a second", "The factor is against our exact trace of the same rays.", {}, {}};
  table.columns = {{"scene", "scene"},         {"rays", "rays"},
                   {"threads", "threads"},     {"tracer", "tracer"},
                   {"mrays", "Mrays/s"},       {"times", "x exact"},
                   {"spread", "spread, %", 1}, {"wrong_percent", "wrong %", 3}};
  Table builds{"peers_builds", "Build and memory", "", {}, {}};
  builds.columns = {{"scene", "scene"},
                    {"triangles", "triangles"},
                    {"embree_seconds", "Embree robust, build, s"},
                    {"embree_bytes", "Embree, bytes a triangle", 0},
                    {"wide_bytes", "wide tree, bytes a triangle", 0},
                    {"bake_seconds", context.quick ? "lsp-bake N = 4, D = 9, s" : "lsp-bake N = 6, D = 9, s"},
                    {"tree_bytes", "file without Line Spaces, bytes a triangle", 0},
                    {"small_bytes", "with them, N = 4, D = 9", 0},
                    {"file_bytes", context.quick ? "N = 4, D = 9" : "N = 6, D = 9", 0}};
  double log_sum[3] = {0, 0, 0};
  double log_bytes[4] = {0, 0, 0, 0};
  int count = 0, sized = 0;
  context.each_scene(section, [&](SceneUnderTest& scene_under_test) {
    SceneUnderTest* const scene = &scene_under_test;
    const Baked& baked = scene->base();
    const OpenFile file(baked.path);
    const EmbreeScene fast(scene->soup(), EmbreeMode::kFast);
    const EmbreeScene& robust = scene->reference();
    std::unique_ptr<WideTree> wide;
    if (file.scene().header->base_structure == LSP_BASE_BVH) wide = std::make_unique<WideTree>(file);
    Json build;
    build["scene"] = scene->name();
    build["triangles"] = scene->soup().size();
    build["embree_seconds"] = robust.build_seconds();
    build["embree_bytes"] = static_cast<double>(robust.bytes()) / static_cast<double>(scene->soup().size());
    build["bake_seconds"] = baked.seconds;
    build["file_bytes"] = static_cast<double>(baked.file_bytes) / static_cast<double>(scene->soup().size());
    if (wide)
      build["wide_bytes"] = static_cast<double>(wide->bytes()) / static_cast<double>(scene->soup().size());
    if (!context.quick && scene->bake({"tree", {"--no-line-spaces"}}).available &&
        scene->bake(line_space_bake(4, 9)).available) {
      const Baked& tree = scene->bake({"tree", {"--no-line-spaces"}});
      const Baked& small = scene->bake(line_space_bake(4, 9));
      build["tree_bytes"] = static_cast<double>(tree.file_bytes) / static_cast<double>(scene->soup().size());
      build["small_bytes"] =
          static_cast<double>(small.file_bytes) / static_cast<double>(scene->soup().size());
      const double sizes[] = {build["embree_bytes"], build["tree_bytes"], build["small_bytes"],
                              build["file_bytes"]};
      for (size_t k = 0; k < 4; ++k) log_bytes[k] += std::log(sizes[k]);
      ++sized;
    }
    builds.rows.push_back(build);

    std::vector<RaySet> sets;
    for (const bool shuffled : {false, true}) {
      sets.push_back(scene->diffuse(context.timing_rays(), shuffled));
      sets.push_back(scene->occlusion(context.timing_rays(), shuffled));
      if (!context.quick && shuffled) sets.push_back(scene->shadows(context.timing_rays(), shuffled));
    }
    std::vector<unsigned> thread_counts = {1};
    if (context.threads > 1) thread_counts.push_back(context.threads);
    for (const RaySet& set : sets) {
      for (const unsigned threads : thread_counts) {
        if (context.quick && threads == 1) continue;
        std::vector<std::unique_ptr<Tracer>> tracers;
        std::vector<Peer> peers;
        const auto add = [&](std::unique_ptr<Tracer> tracer, const std::string& name, Mode mode) {
          mode.any = set.any;
          peers.push_back({name, tracer.get(), mode});
          tracers.push_back(std::move(tracer));
        };
        add(cpu_tracer(file, threads), "lsp exact", {});
        if (file.has_line_spaces()) {
          add(cpu_tracer(file, threads), "lsp approximate", {.approximate = true});
          add(cpu_tracer(file, threads), "lsp approximate, near skipped",
              {.approximate = true, .near_skip = true});
          add(cpu_tracer(file, threads), "lsp approximate, near too",
              {.approximate = true, .near_approximate = true});
        }
        if (wide) add(wide_tracer(*wide, threads), "wide tree exact", {});
        const std::string verb = set.any ? "rtcOccluded" : "rtcIntersect";
        for (const EmbreeScene* embree : {&robust, &fast}) {
          const std::string mode = embree == &robust ? " robust" : " fast";
          add(embree_tracer(*embree, EmbreeCall::kSingle, "", threads), "Embree " + verb + "1" + mode, {});
          add(embree_tracer(*embree, EmbreeCall::kPacket8, "", threads), "Embree " + verb + "8" + mode, {});
          if (context.quick) continue;
          add(embree_tracer(*embree, EmbreeCall::kPacket16, "", threads), "Embree " + verb + "16" + mode, {});
          add(embree_tracer(*embree, EmbreeCall::kStream, "", threads), "Embree " + verb + "1M" + mode, {});
        }
        std::vector<std::vector<LspHit>> hits(peers.size(), std::vector<LspHit>(set.rays.size()));
        std::vector<Contender> contenders;
        for (size_t i = 0; i < peers.size(); ++i) {
          contenders.push_back(
              {peers[i].name, [&, i] { return peers[i].tracer->trace(peers[i].mode, set.rays, hits[i]); }});
        }
        const std::vector<Timing> timings = race(contenders, 1, context.repeats());
        for (size_t i = 0; i < peers.size(); ++i) {
          const RayErrors errors = set.any ? occlusion_errors(set.truth, hits[i])
                                           : ray_errors(scene->soup(), set.rays, set.truth, hits[i]);
          Json row;
          row["scene"] = scene->name();
          row["rays"] = set.name;
          row["threads"] = threads;
          row["tracer"] = peers[i].name;
          row["mrays"] = mega(set.rays.size(), timings[i]);
          row["times"] = i == 0 ? 1.0
                                : context.speed_up(scene->name() + ", " + set.name + ", " +
                                                       std::to_string(threads) + " threads, " + peers[i].name,
                                                   timings[i], timings[0]);
          row["spread"] = 100 * timings[i].spread;
          row["wrong_percent"] = 100 * errors.wrong_share();
          table.rows.push_back(row);
          if (set.name == "diffuse, shuffled" && threads == context.threads) {
            if (peers[i].name == "Embree rtcIntersect1 robust")
              log_sum[0] += std::log(timings[0].median / timings[i].median);
            if (peers[i].name == "lsp approximate")
              log_sum[1] += std::log(timings[0].median / timings[i].median);
            if (peers[i].name == "wide tree exact")
              log_sum[2] += std::log(timings[0].median / timings[i].median);
          }
        }
        if (set.name == "diffuse, shuffled" && threads == context.threads) ++count;
      }
    }
  });
  if (count > 0) {
    char text[400];
    std::snprintf(
        text, sizeof text,
        "Against Embree (rtcIntersect1, robust; shuffled diffuse rays, %u threads, geometric mean of %d "
        "scenes): Embree traces at %.2fx our exact speed; our approximate trace (N = %d, D = 9, near field "
        "exact) at %.2fx ours, so %.2fx Embree's; our wide exact tree at %.2fx ours.",
        context.threads, count, std::exp(log_sum[0] / count), context.quick ? 4 : 6,
        std::exp(log_sum[1] / count), std::exp((log_sum[1] - log_sum[0]) / count),
        std::exp(log_sum[2] / count));
    context.answers.others.push_back(text);
  }
  if (sized > 0) {
    char text[320];
    std::snprintf(text, sizeof text,
                  "Bytes a triangle (geometric mean of %d scenes): the exact file %.0f, with Line Spaces of "
                  "N = 4, D = 9 "
                  "%.0f, of N = 6, D = 9 %.0f; Embree's scene in memory %.0f.",
                  sized, std::exp(log_bytes[1] / sized), std::exp(log_bytes[2] / sized),
                  std::exp(log_bytes[3] / sized), std::exp(log_bytes[0] / sized));
    context.answers.others.push_back(text);
  }
  section.tables = {std::move(table), std::move(builds)};
  return section;
}

}  // namespace lsp::bench
