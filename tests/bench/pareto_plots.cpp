#include "pareto_plots.h"

#include <algorithm>
#include <functional>

namespace lsp::bench {
namespace {

// A cloud of all bakes of Line Spaces, by what is asked of each sample.
Plot cloud(const Context& context, const std::vector<Sample>& samples, Plot plot,
           const std::function<Point(const Sample&)>& point) {
  for (const auto& scene : context.scenes) {
    Series series{scene->name(), {}, false};
    for (const Sample& sample : samples) {
      if (sample.scene != scene->name()) continue;
      series.points.push_back(point(sample));
      series.points.back().label = sample.bake + ", " + sample.mode;
    }
    plot.series.push_back(series);
  }
  return plot;
}

// For each scene the dial of cells and, dashed, the frontier of Line Spaces, which `wide` brings to the same
// yardstick: how many times as fast as the BVH's the wide nodes' exact trace is.
Plot curves(const Context& context, const std::vector<Sample>& line_spaces, const std::vector<bool>& best,
            const std::vector<Sample>& dial, double Sample::*times, double ScenePeers::*wide, Plot plot) {
  const auto add = [&](Series series) {
    std::sort(series.points.begin(), series.points.end(),
              [](const Point& a, const Point& b) { return a.x < b.x; });
    plot.series.push_back(std::move(series));
  };
  for (const auto& scene : context.scenes) {
    Series series{scene->name() + ": cells", {}, true};
    for (const Sample& sample : dial) {
      if (sample.scene == scene->name() && sample.*times > 0)
        series.points.push_back({std::max(sample.wrong_percent, 1e-3), sample.*times, sample.mode});
    }
    add(std::move(series));
  }
  for (size_t k = 0; k < context.scenes.size(); ++k) {
    const std::string& name = context.scenes[k]->name();
    Series series{name + ": Line Spaces", {}, true, static_cast<int>(k)};
    const auto peers = context.answers.peers.find(name);
    const double scale = peers == context.answers.peers.end() ? 0 : peers->second.*wide;
    for (size_t i = 0; i < line_spaces.size() && scale > 0; ++i) {
      const Sample& sample = line_spaces[i];
      if (sample.scene == name && best[i] && sample.*times > 0)
        series.points.push_back(
            {std::max(sample.wrong_percent, 1e-3), sample.*times / scale, sample.bake + ", " + sample.mode});
    }
    if (!series.points.empty()) add(std::move(series));
  }
  return plot;
}

Plot plot_of(const char* id, const char* title, const char* caption, const Axis& x, const Axis& y) {
  Plot plot;
  plot.id = id;
  plot.title = title;
  plot.caption = caption;
  plot.x = x;
  plot.y = y;
  return plot;
}

}  // namespace

std::vector<Plot> pareto_plots(const Context& context, const DialCurves& dial,
                               const std::vector<Sample>& line_spaces, const std::vector<bool>& best) {
  const Axis wrong{"wrong answers, % of rays", true}, times{"times the exact trace of the BVH", false};
  const Axis depth{"mean depth error, % of the diagonal", true}, bytes{"file, MB", true};
  const Axis wide{"times the exact trace of wide nodes", false};
  const char* const up_and_left = "Up and left is better.";
  std::vector<Plot> plots;
  plots.push_back(curves(
      context, line_spaces, best, dial.camera, &Sample::times, &ScenePeers::wide,
      plot_of("pareto_frontier", "The dial of cells, and the frontier of Line Spaces",
              "Up and left is better. Shuffled diffuse rays from a camera, on the CPU.", wrong, wide)));
  if (std::any_of(dial.camera.begin(), dial.camera.end(),
                  [](const Sample& s) { return s.times_vulkan > 0; })) {
    plots.push_back(
        curves(context, line_spaces, best, dial.camera, &Sample::times_vulkan, &ScenePeers::wide_vulkan,
               plot_of("pareto_frontier_vulkan", "The same on Vulkan", up_and_left, wrong, wide)));
  }
  plots.push_back(curves(context, {}, {}, dial.surface, &Sample::times, &ScenePeers::wide,
                         plot_of("pareto_dial_surface", "The dial of cells on rays from all surfaces",
                                 "Area-weighted, shuffled, on the CPU.", wrong, wide)));
  plots.push_back(
      cloud(context, line_spaces,
            plot_of("pareto_wrong", "Line Spaces: speed against wrong answers", up_and_left, wrong, times),
            [](const Sample& s) {
              return Point{std::max(s.wrong_percent, 1e-3), s.times, ""};
            }));
  plots.push_back(
      cloud(context, line_spaces,
            plot_of("pareto_depth", "Line Spaces: speed against depth error", up_and_left, depth, times),
            [](const Sample& s) {
              return Point{std::max(s.depth_percent, 1e-4), s.times, ""};
            }));
  plots.push_back(cloud(context, line_spaces,
                        plot_of("pareto_bytes", "Line Spaces: wrong answers against bytes",
                                "Down and left is better.", bytes, wrong),
                        [](const Sample& s) {
                          return Point{s.megabytes, std::max(s.wrong_percent, 1e-3), ""};
                        }));
  return plots;
}

}  // namespace lsp::bench
