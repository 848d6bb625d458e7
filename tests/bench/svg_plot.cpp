#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

#include "html_text.h"
#include "report.h"

namespace lsp::bench {
namespace {

constexpr double kWidth = 640, kLeft = 78, kRight = 16, kTop = 36, kPlotHeight = 320, kLegendRow = 22;

// Colours that people with the common colour deficiencies can tell apart (Okabe and Ito 2008), on light and
// dark.
constexpr std::array<const char*, 8> kColours = {"#0072B2", "#D55E00", "#009E73", "#CC79A7",
                                                 "#E69F00", "#56B4E9", "#8C6D31", "#7F7F7F"};

std::string number(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.6g", value);
  return text;
}

std::string at(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.1f", value);
  return text;
}

// The range and ticks of an axis, and where a value lies on it in [0, 1].
struct Scale {
  explicit Scale(bool is_log) : log(is_log) {}
  bool log;
  double lo = INFINITY, hi = -INFINITY;
  std::vector<double> ticks;

  void add(double value) {
    if (!std::isfinite(value) || (log && value <= 0)) return;
    lo = std::min(lo, value);
    hi = std::max(hi, value);
  }

  void finish() {
    if (!(lo <= hi)) lo = log ? 0.1 : 0, hi = 1;
    if (log) {
      if (hi / lo < 4) lo /= 1.6, hi *= 1.6;
      const double decades = std::log10(hi / lo);
      for (int e = static_cast<int>(std::floor(std::log10(lo))); e <= std::log10(hi) + 1; ++e) {
        for (const double m : {1.0, 2.0, 5.0}) {
          if (decades > 3 && m != 1) continue;
          ticks.push_back(m * std::pow(10, e));
        }
      }
      lo = std::pow(10, std::log10(lo) - 0.04 * decades);
      hi = std::pow(10, std::log10(hi) + 0.04 * decades);
    } else {
      if (lo > 0 && lo < 0.5 * hi) lo = 0;
      if (lo == hi) lo -= 0.5, hi += 0.5;
      const double raw = (hi - lo) / 5, magnitude = std::pow(10, std::floor(std::log10(raw)));
      const double fraction = raw / magnitude;
      const double step = magnitude * (fraction < 1.5 ? 1 : fraction < 3.5 ? 2 : fraction < 7.5 ? 5 : 10);
      const double margin = 0.04 * (hi - lo);
      hi += margin;
      if (lo != 0) lo -= margin;
      for (double tick = std::ceil(lo / step) * step; tick <= hi; tick += step) {
        ticks.push_back(std::abs(tick) < step * 1e-9 ? 0 : tick);
      }
    }
    std::erase_if(ticks, [&](double tick) { return tick < lo || tick > hi; });
  }

  double place(double value) const {
    if (log) return value <= 0 ? 0 : std::clamp(std::log(value / lo) / std::log(hi / lo), 0.0, 1.0);
    return std::clamp((value - lo) / (hi - lo), 0.0, 1.0);
  }
};

std::string marker(size_t series, double x, double y) {
  switch (series % 4) {
    case 0:
      return "<circle cx='" + at(x) + "' cy='" + at(y) + "' r='5'>";
    case 1:
      return "<rect x='" + at(x - 4.5) + "' y='" + at(y - 4.5) + "' width='9' height='9'>";
    case 2:
      return "<path d='M" + at(x) + " " + at(y - 6) + "l6 11h-12z'>";
    default:
      return "<path d='M" + at(x) + " " + at(y - 6) + "l6 6l-6 6l-6-6z'>";
  }
}

std::string marker_end(size_t series) {
  return series % 4 == 0 ? "</circle>" : series % 4 == 1 ? "</rect>" : "</path>";
}

std::string text(double x, double y, const char* anchor, int size, const std::string& words,
                 const std::string& more = "") {
  return "<text x='" + at(x) + "' y='" + at(y) + "' text-anchor='" + anchor + "' font-size='" +
         std::to_string(size) + "'" + more + ">" + sample::escape_html(words) + "</text>\n";
}

}  // namespace

std::string to_svg(const Plot& plot) {
  Scale x(plot.x.log), y(plot.y.log);
  for (const Series& series : plot.series) {
    for (const Point& point : series.points) {
      x.add(point.x);
      y.add(point.y);
    }
  }
  x.finish();
  y.finish();
  const double width = kWidth - kLeft - kRight;
  const double bottom = kTop + kPlotHeight;
  const double height = bottom + 52 + kLegendRow * static_cast<double>((plot.series.size() + 1) / 2);
  const auto px = [&](double value) { return kLeft + x.place(value) * width; };
  const auto py = [&](double value) { return bottom - y.place(value) * kPlotHeight; };

  std::string svg = "<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 " + number(kWidth) + " " +
                    number(height) + "' role='img' font-family='system-ui,sans-serif' fill='currentColor'>\n";
  svg += "<title>" + sample::escape_html(plot.title) + "</title>\n";
  svg += text(kLeft, 22, "start", 16, plot.title, " font-weight='600'");
  svg += "<g stroke='currentColor' stroke-opacity='.18'>\n";
  for (double tick : x.ticks) {
    svg += "<path d='M" + at(px(tick)) + " " + at(kTop) + "V" + at(bottom) + "'/>\n";
  }
  for (double tick : y.ticks) {
    svg += "<path d='M" + at(kLeft) + " " + at(py(tick)) + "H" + at(kLeft + width) + "'/>\n";
  }
  svg += "</g>\n<path d='M" + at(kLeft) + " " + at(kTop) + "V" + at(bottom) + "H" + at(kLeft + width) +
         "' fill='none' stroke='currentColor'/>\n";
  for (double tick : x.ticks) svg += text(px(tick), bottom + 18, "middle", 13, number(tick));
  for (double tick : y.ticks) svg += text(kLeft - 8, py(tick) + 4.5, "end", 13, number(tick));
  svg += text(kLeft + width / 2, bottom + 40, "middle", 14, plot.x.label);
  svg += text(18, kTop + kPlotHeight / 2, "middle", 14, plot.y.label,
              " transform='rotate(-90 18 " + at(kTop + kPlotHeight / 2) + ")'");

  for (size_t s = 0; s < plot.series.size(); ++s) {
    const Series& series = plot.series[s];
    const bool kin = series.kin >= 0;
    const std::string colour = kColours[(kin ? static_cast<size_t>(series.kin) : s) % kColours.size()];
    if (series.line && series.points.size() > 1) {
      svg += "<path fill='none' stroke='" + colour + "' stroke-width='2.2'" +
             (kin ? " stroke-dasharray='5 4'" : "") + " d='";
      for (size_t i = 0; i < series.points.size(); ++i) {
        svg += (i ? "L" : "M") + at(px(series.points[i].x)) + " " + at(py(series.points[i].y));
      }
      svg += "'/>\n";
    }
    svg += "<g fill='" + colour + "' fill-opacity='.85'>\n";
    for (const Point& point : series.points) {
      if (!std::isfinite(point.x) || !std::isfinite(point.y)) continue;
      const std::string tip = series.name + (point.label.empty() ? "" : ": " + point.label) + " (" +
                              number(point.x) + ", " + number(point.y) + ")";
      svg += marker(s, px(point.x), py(point.y)) + "<title>" + sample::escape_html(tip) + "</title>" +
             marker_end(s) + "\n";
    }
    const double lx = kLeft + (s % 2 ? width / 2 : 0) + 6;
    const double ly = bottom + 62 + kLegendRow * static_cast<double>(s / 2);
    svg += marker(s, lx, ly - 4.5) + marker_end(s) + "</g>\n" + text(lx + 12, ly, "start", 13, series.name);
  }
  return svg + "</svg>\n";
}

}  // namespace lsp::bench
