// One scene from a thousand to ten million triangles: what grows how fast.
#include <cmath>

#include "context.h"
#include "shapes.h"

namespace lsp::bench {
namespace {

// Slope of a least-squares line through the logarithms: y grows like x to this power.
double exponent(const std::vector<double>& x, const std::vector<double>& y) {
  double sx = 0, sy = 0, sxx = 0, sxy = 0, n = 0;
  for (size_t i = 0; i < x.size(); ++i) {
    if (!(x[i] > 0 && y[i] > 0)) continue;
    const double a = std::log(x[i]), b = std::log(y[i]);
    sx += a, sy += b, sxx += a * a, sxy += a * b, n += 1;
  }
  return n > 1 ? (n * sxy - sx * sy) / (n * sxx - sx * sx) : NAN;
}

}  // namespace

Section scaling_suite(Context& context) {
  Section section{"scaling", "From a thousand to millions of triangles", {}, {}, {}, {}};
  std::vector<uint64_t> sizes = {1000, 10000, 100000};
  if (!context.quick) sizes.insert(sizes.end(), {1000000, 10000000});
  Table table{"scaling", "A room with 27 spheres, more and more finely divided (N = 4, D = 9)", "", {}, {}};
  table.columns = {{"triangles", "triangles"},
                   {"bake_seconds", "bake, s"},
                   {"peak_mib", "bake's memory, MiB", 0},
                   {"file_mb", "file, MB"},
                   {"exact_mrays", "exact, Mrays/s"},
                   {"approximate_mrays", "approximate"},
                   {"times", "x"},
                   {"embree_mrays", "Embree rtcIntersect1 robust"},
                   {"wrong_percent", "wrong %", 3},
                   {"depth_mean_percent", "depth error, %", 3},
                   {"nodes", "nodes a ray, exact", 1}};
  std::vector<double> triangles;
  std::vector<std::vector<double>> grown(5);
  for (const uint64_t size : sizes) {
    context.progress("scaling: " + std::to_string(size));
    context.guarded(section, std::to_string(size) + " triangles", [&] {
      std::filesystem::create_directories(context.cache);
      const auto input = context.cache / ("room-" + std::to_string(size) + ".ply");
      write_ply(input, room_of_spheres(size));
      SceneUnderTest scene(input, context.cache, line_space_bake(4, 9));
      const Baked& baked = scene.base();
      const OpenFile file(baked.path);
      const RaySet set = scene.diffuse(context.timing_rays() / 2, true);
      const auto ours = cpu_tracer(file, context.threads);
      const auto embree = embree_tracer(scene.reference(), EmbreeCall::kSingle, "", context.threads);
      std::vector<LspHit> exact(set.rays.size()), approximate = exact, other = exact;
      const std::vector<Timing> timings =
          race({{"exact", [&] { return ours->trace({}, set.rays, exact); }},
                {"approximate", [&] { return ours->trace({.approximate = true}, set.rays, approximate); }},
                {"Embree", [&] { return embree->trace({}, set.rays, other); }}},
               1, std::max(3, context.repeats() - 2));
      const RayErrors errors = ray_errors(scene.soup(), set.rays, set.truth, approximate);
      const Work work =
          count_work(file, {}, std::span(set.rays).first(std::min<size_t>(set.rays.size(), 20000)));
      Json row;
      row["triangles"] = scene.soup().size();
      row["bake_seconds"] = baked.seconds;
      row["peak_mib"] = static_cast<double>(baked.peak_bytes) / (1 << 20);
      row["file_mb"] = static_cast<double>(baked.file_bytes) * 1e-6;
      row["exact_mrays"] = mega(set.rays.size(), timings[0]);
      row["approximate_mrays"] = mega(set.rays.size(), timings[1]);
      row["times"] = context.speed_up("scaling, " + std::to_string(size), timings[1], timings[0]);
      row["embree_mrays"] = mega(set.rays.size(), timings[2]);
      add_errors(row, errors);
      row["nodes"] = work.nodes;
      table.rows.push_back(row);
      triangles.push_back(static_cast<double>(scene.soup().size()));
      const double measured[] = {baked.seconds, static_cast<double>(baked.peak_bytes),
                                 static_cast<double>(baked.file_bytes), timings[0].median, timings[1].median};
      for (size_t k = 0; k < 5; ++k) grown[k].push_back(measured[k]);
      std::filesystem::remove(input);
      if (size > 1000000) std::filesystem::remove(baked.path);  // a gigabyte that nobody needs again
    });
  }
  static constexpr const char* kNames[] = {"bake time", "bake's memory", "file size", "time of an exact ray",
                                           "time of an approximate ray"};
  Table exponents{"scaling_exponents",
                  "Grows like the number of triangles to the power of",
                  "",
                  {{"what", "what"}, {"exponent", "exponent"}},
                  {}};
  Plot plot{"scaling",           "Growth with the number of triangles", "Relative to the smallest scene.",
            {"triangles", true}, {"times the smallest", true},          {}};
  for (size_t k = 0; k < 5; ++k) {
    exponents.rows.push_back({{"what", kNames[k]}, {"exponent", exponent(triangles, grown[k])}});
    Series series{kNames[k], {}, true};
    for (size_t i = 0; i < triangles.size(); ++i)
      series.points.push_back({triangles[i], grown[k][i] / grown[k][0], ""});
    plot.series.push_back(series);
  }
  section.plots = {plot};
  section.tables = {std::move(table), std::move(exponents)};
  return section;
}

}  // namespace lsp::bench
