#include "page.h"

#include <algorithm>
#include <cmath>
#include <cstdarg>
#include <cstdint>
#include <cstdio>

#include "html_text.h"

namespace lsp::sample {
namespace {

__attribute__((format(printf, 1, 2))) std::string format(const char* pattern, ...) {
  char text[512];
  va_list arguments;
  va_start(arguments, pattern);
  std::vsnprintf(text, sizeof text, pattern, arguments);
  va_end(arguments);
  return text;
}

double number(const nlohmann::json& json, const char* key) { return json.at(key).get<double>(); }

std::string megabytes(double bytes) { return format("%.1f MB", bytes * 1e-6); }

double total_seconds(const nlohmann::json& stages) {
  double sum = 0;
  for (const auto& stage : stages) sum += stage.get<double>();
  return sum;
}

std::string psnr(const nlohmann::json& compare) {
  return compare.at("psnr_db").is_null() ? "equal pictures" : format("%.1f dB", number(compare, "psnr_db"));
}

std::string mean_error(const nlohmann::json& compare) {
  return compare.at("relative_mean").is_null() ? "infinite"  // the exact picture is black
                                               : format("%.2f %%", 100 * number(compare, "relative_mean"));
}

double times(const nlohmann::json& exact, const nlohmann::json& approximate) {
  const double base = number(exact, "indirect_mrays_per_second");
  return base > 0 ? number(approximate, "indirect_mrays_per_second") / base : 0;
}

double speed_up(const Figures& f, const nlohmann::json& approximate) { return times(f.exact, approximate); }

// Of a setting: --max-loss, not --quality.
bool is_number(const std::string& name) { return name.find_first_not_of("0123456789.") == std::string::npos; }

bool has_cells(const Figures& f) { return f.bake.contains("cells") && !f.bake.at("cells").is_null(); }

bool has_tables(const Figures& f) { return has_cells(f) || number(f.bake, "line_spaces") > 0; }

// What the tables are called.
const char* tables_of(const Figures& f) { return has_cells(f) ? "tables of cells" : "Line Spaces"; }

// What the two pictures are.
std::string introduction(const Figures& f) {
  std::string html =
      "<p>The same picture twice, with the same random numbers. What the eye sees and direct light are "
      "traced exactly "
      "in both; indirect light (what arrives over another surface, or as a reflection, and the shadow rays "
      "there) is traced exactly in one and ";
  if (!has_tables(f))
    return html +
           "would be looked up in tables in the other, but none pays here, as the bake says below: the file "
           "holds the tree for exact rays alone, and both pictures are exact.</p>\n";
  return html + "looked up in " + tables_of(f) + " in the other: <strong>" +
         format("%.2f times the rays a second", speed_up(f, f.approximate)) + "</strong>, " +
         psnr(f.compare) + " apart.</p>\n";
}

// A row of the table: a name and the two pictures' values.
std::string row(const char* name, const std::string& exact, const std::string& approximate) {
  return std::string("<tr><th>") + name + "</th><td>" + exact + "</td><td>" + approximate + "</td></tr>\n";
}

std::string fact(const char* name, const std::string& value) {
  return std::string("<div><dt>") + name + "</dt><dd>" + value + "</dd></div>\n";
}

std::string list(const nlohmann::json& items) {
  std::string out;
  for (const auto& item : items) out += "<li>" + escape_html(item.get<std::string>()) + "</li>\n";
  return out.empty() ? "<li>nothing</li>\n" : out;
}

// A round step of a scale of at most ten of them.
double scale_step(double top) {
  const double power = std::pow(10.0, std::floor(std::log10(top)) - 1);
  for (const double step : {1.0, 2.0, 5.0, 10.0}) {
    if (top <= 10 * step * power) return step * power;
  }
  return 10 * power;
}

// Speed against error as a drawing; nothing without points.
std::string curve(const Figures& f) {
  if (f.curve.empty()) return "";
  struct Point {
    double error, speed;
    std::string name;
    bool quality;
  };
  std::vector<Point> points;
  double widest = 0;
  double fastest = 1;
  for (const Figures::Setting& q : f.curve) {
    if (q.compare.at("relative_mean").is_null()) continue;  // all is black but the error
    points.push_back({100 * number(q.compare, "relative_mean"), times(f.curve_exact, q.approximate), q.name,
                      !is_number(q.name)});
    widest = std::max(widest, points.back().error);
    fastest = std::max(fastest, points.back().speed);
  }
  std::ranges::sort(points, {}, &Point::error);
  const double step_x = scale_step(std::max(widest, 0.01));
  const double step_y = scale_step(fastest);
  constexpr double kLeft = 56, kRight = 640, kTop = 16, kBottom = 268;
  const double room = 1.12;  // for the last point's name
  const auto x = [&](double error) {
    return kLeft + (kRight - kLeft) * error / (room * std::max(widest, step_x));
  };
  const auto y = [&](double speed) { return kBottom - (kBottom - kTop) * speed / (room * fastest); };

  std::string svg =
      "<figure class=\"curve\"><svg viewBox=\"0 0 720 310\" role=\"img\" aria-label=\"speed against error; "
      "the figures are in the table below\">\n";
  for (int i = 0; i * step_y <= room * fastest; ++i) {
    svg += format(
        "<path class=\"grid\" d=\"M%g %.1fH%g\"/><text class=\"tick\" x=\"%g\" y=\"%.1f\" "
        "text-anchor=\"end\">%g</text>\n",
        kLeft, y(i * step_y), kRight, kLeft - 8, y(i * step_y) + 4, i * step_y);
  }
  for (int i = 0; i * step_x <= room * widest; ++i) {
    svg += format("<text class=\"tick\" x=\"%.1f\" y=\"%g\" text-anchor=\"middle\">%g %%</text>\n",
                  x(i * step_x), kBottom + 18, i * step_x);
  }
  svg += format(
      "<path class=\"exact\" d=\"M%g %.1fH%g\"/><text x=\"%g\" y=\"%.1f\">exact</text>\n<path "
      "class=\"line\" d=\"",
      kLeft, y(1), kRight, kRight + 6, y(1) + 4);
  for (const Point& p : points)
    svg += format("%s%.1f %.1f", &p == &points.front() ? "M" : "L", x(p.error), y(p.speed));
  svg += "\"/>\n";
  for (const Point& p : points) {
    svg += format("<circle cx=\"%.1f\" cy=\"%.1f\" r=\"%d\"/><text%s x=\"%.1f\" y=\"%.1f\">%s</text>\n",
                  x(p.error), y(p.speed), p.quality ? 5 : 3, p.quality ? " class=\"named\"" : "",
                  x(p.error) + 8, y(p.speed) - 7, escape_html(p.name).c_str());
  }
  svg += format(
      "<text class=\"tick\" x=\"%g\" y=\"304\" text-anchor=\"end\">mean error of the picture</text></svg>",
      kRight);
  svg += format(
      "<figcaption>Rays a second, times exact, against the error, of a picture of %d x %d pixels, %d "
      "samples, "
      "not denoised. Numbers: <code>--max-loss</code>, per cent.</figcaption></figure>\n",
      f.curve_exact.at("width").get<int>(), f.curve_exact.at("height").get<int>(),
      f.curve_exact.at("samples").get<int>());
  svg +=
      "<table><thead><tr><th>setting</th><th>rays a second, times exact</th><th>mean "
      "error</th></tr></thead>\n";
  for (const Point& p : points)
    svg += "<tr><th>" + escape_html(p.quality ? p.name : "--max-loss " + p.name) +
           format("</th><td>%.2f</td><td>%.2f %%</td></tr>\n", p.speed, p.error);
  return svg + "</table>\n";
}

// What the dial does to this scene; nothing where there is none.
std::string dial(const Figures& f) {
  if (f.curve.empty() || !has_tables(f)) return "";
  const bool lights = f.approximate.value("light_quality", "") == "fast";
  return "<h2>The dial</h2>\n<p>The same file at other settings; the pictures above are balanced. Where "
         "tables "
         "lose more than a setting allows, a cell is traced exactly; fast is tables alone" +
         std::string(lights ? ". Rays to lights from where others land are always answered by tables alone: "
                              "they are the most, and their errors show least (<code>--light-quality "
                              "fast</code>)"
                            : "") +
         ".</p>\n" + curve(f);
}

constexpr const char* kStyle = R"(
:root{color-scheme:dark;--ink:#ece7df;--dim:#a79f93;--ground:#17151a;--card:#211e25;--line:#37323d;--accent:#f0b45b}
*{box-sizing:border-box}body{margin:0;background:var(--ground);color:var(--ink);font:16px/1.5 system-ui,sans-serif}
main{max-width:1100px;margin:0 auto;padding:1.2rem}h1{font-size:1.5rem;margin:.4rem 0}h2{font-size:1.1rem;margin:2rem 0 .6rem}
p{color:var(--dim);margin:.3rem 0 1rem;max-width:46rem}strong{color:var(--accent)}
figure{margin:0;background:var(--card);border:1px solid var(--line);border-radius:8px;overflow:hidden}
figcaption{padding:.4rem .7rem;color:var(--dim);font-size:.9rem}img{display:block;width:100%}
.slide:focus-within{outline:2px solid var(--accent)}.slide .error{position:absolute;inset:0;visibility:hidden}
.slide[data-show=exact] .over{clip-path:inset(0 0 0 100%)}.slide[data-show=approximate] .over{clip-path:none}
.slide[data-show=error] .error{visibility:visible}.slide[data-show] .bar,.slide[data-show] b{visibility:hidden}
.controls{display:flex;flex-wrap:wrap;gap:.6rem;align-items:center;margin:.6rem 0;color:var(--dim);font-size:.9rem}
button{font:inherit;color:var(--ink);background:var(--card);border:1px solid var(--line);border-radius:6px;padding:.3rem .8rem;cursor:pointer;touch-action:none}
button[aria-pressed=true]{border-color:var(--accent);color:var(--accent)}button:focus-visible{outline:2px solid var(--accent)}
.curve svg{display:block;width:100%;max-width:720px;fill:var(--dim);font-size:12px}.curve .grid{stroke:var(--line)}
.curve .exact{stroke:var(--dim);stroke-dasharray:4 4}.curve .line{fill:none;stroke:var(--accent);stroke-width:1.5}
.curve circle{fill:var(--accent)}.curve .named{fill:var(--ink);font-weight:600}.curve+table{margin-top:.8rem}
.trio{display:grid;gap:.8rem;grid-template-columns:repeat(auto-fit,minmax(280px,1fr))}
.slide{position:relative;border-radius:8px;overflow:hidden;border:1px solid var(--line)}
.slide .over{position:absolute;inset:0;clip-path:inset(0 0 0 var(--at,50%))}
.slide input{position:absolute;inset:0;width:100%;height:100%;margin:0;opacity:0;cursor:ew-resize}
.slide .bar{position:absolute;top:0;bottom:0;left:var(--at,50%);width:2px;background:var(--accent);pointer-events:none}
.slide b{position:absolute;bottom:.5rem;padding:.1rem .5rem;border-radius:4px;background:#000a;font-weight:500;font-size:.85rem;pointer-events:none}
table{border-collapse:collapse;width:100%;background:var(--card);border-radius:8px;overflow:hidden}
th,td{text-align:left;padding:.45rem .7rem;border-bottom:1px solid var(--line);font-weight:400}td{font-variant-numeric:tabular-nums}
thead th{color:var(--dim)}dl{display:grid;gap:.6rem;grid-template-columns:repeat(auto-fit,minmax(150px,1fr));margin:0}
dl div{background:var(--card);border:1px solid var(--line);border-radius:8px;padding:.5rem .7rem}dt{color:var(--dim);font-size:.85rem}dd{margin:0;font-size:1.1rem}
ul{margin:.2rem 0;padding-left:1.2rem}
)";

constexpr const char* kScript = R"(
const slide=document.querySelector('.slide');
const blink=document.getElementById('blink'),map=document.getElementById('map'),now=document.getElementById('now');
const words={exact:'exact',approximate:'approximate',error:'error map'};
let held=false;
const show=what=>{
  if(what)slide.dataset.show=what;else delete slide.dataset.show;
  map.setAttribute('aria-pressed',what==='error');
  now.textContent=what?words[what]:'';
};
const hold=on=>{if(held!==on){held=on;show(on?'approximate':'exact');}};
const toggle=()=>show(slide.dataset.show==='error'?'':'error');
slide.querySelector('input').addEventListener('input',e=>{show('');slide.style.setProperty('--at',e.target.value+'%');});
blink.addEventListener('pointerdown',()=>hold(true));
for(const end of['pointerup','pointercancel','blur'])window.addEventListener(end,()=>hold(false));
map.addEventListener('click',toggle);
const holds=e=>e.key.toLowerCase()==='b'||(e.target===blink&&(e.key===' '||e.key==='Enter'));
document.addEventListener('keydown',e=>{
  if(e.ctrlKey||e.metaKey||e.altKey)return;
  if(holds(e)){e.preventDefault();hold(true);}
  else if(e.key.toLowerCase()==='e'&&!e.repeat)toggle();
});
document.addEventListener('keyup',e=>{if(holds(e)){e.preventDefault();hold(false);}});
)";

// Exact and approximate, one over the other and side by side.
std::string compared(const Figures& f, const Pictures& pictures) {
  const auto source = [](const std::string& png) { return "data:image/png;base64," + base64(png); };
  const std::string exact = source(pictures.exact);
  const std::string approximate = source(pictures.approximate);
  const std::string difference = source(pictures.difference);
  const double factor = number(f.compare, "factor");
  std::string html =
      "<div class=\"slide\"><img alt=\"exact\" src=\"" + exact +
      "\"><img class=\"over\" alt=\"approximate\" src=\"" + approximate +
      "\"><img class=\"error\" alt=\"error map\" src=\"" + difference +
      "\"><span class=\"bar\"></span><b style=\"left:.5rem\">exact</b><b "
      "style=\"right:.5rem\">approximate</b>"
      "<input type=\"range\" min=\"0\" max=\"100\" value=\"50\" aria-label=\"exact or approximate\"></div>\n"
      "<div class=\"controls\"><button id=\"blink\" type=\"button\">Hold to see approximate</button><button "
      "id=\"map\" type=\"button\" aria-pressed=\"false\">Error map</button><span id=\"now\" "
      "role=\"status\"></span>"
      "<span>Drag, or arrow keys: the border. B, held: approximate, else exact. E: error map.</span></div>\n";
  html += "<h2>Side by side</h2><div class=\"trio\">\n<figure><img alt=\"\" src=\"" + exact +
          "\"><figcaption>exact</figcaption></figure>\n<figure><img alt=\"\" src=\"" + approximate +
          "\"><figcaption>approximate</figcaption></figure>\n<figure><img alt=\"\" src=\"" + difference +
          "\"><figcaption>absolute difference of linear light, times " + format("%g", factor) +
          "</figcaption></figure>\n</div>\n";
  return html;
}

std::string time_and_error(const Figures& f) {
  std::string html =
      "<h2>Time and error</h2>\n<table><thead><tr><th></th><th>exact</th><th>approximate</th></tr></thead>\n";
  const auto both = [&](const char* name, const char* pattern, const char* key, double scale) {
    html += row(name, format("%.*f%s", 2, number(f.exact, key) * scale, pattern),
                format("%.*f%s", 2, number(f.approximate, key) * scale, pattern));
  };
  both("indirect rays a second", " million", "indirect_mrays_per_second", 1);
  both("indirect rays", " million", "indirect_rays", 1e-6);
  both("time in indirect rays", " s", "indirect_seconds", 1);
  both("time in primary rays", " s", "primary_seconds", 1);
  both("time in direct shadow rays", " s", "shadow_seconds", 1);
  both("time in all", " s", "seconds", 1);
  html += row("mean luminance", format("%.4f", number(f.exact, "mean_luminance")),
              format("%.4f", number(f.approximate, "mean_luminance")));
  html += row("RMSE, linear", "0", format("%.4f", number(f.compare, "rmse")));
  html += row("mean error", "0", mean_error(f.compare) + " of the mean");
  html += row("PSNR as shown", "", psnr(f.compare));
  html += row("pixels that differ visibly", "0",
              format("%.2f %%", 100 * number(f.compare, "pixels_over_5_percent")));
  html += "</table>\n<p>" + escape_html(f.exact.at("device").get<std::string>()) + " (" +
          escape_html(f.exact.at("backend").get<std::string>()) +
          "), file: " + escape_html(f.exact.at("load_path").get<std::string>()) +
          format(", %d x %d pixels, %d samples a pixel, ", f.exact.at("width").get<int>(),
                 f.exact.at("height").get<int>(), f.exact.at("samples").get<int>()) +
          (f.exact.at("denoised").get<bool>() ? "denoised; the error is that of the pictures shown"
                                              : "not denoised") +
          ". A pixel differs visibly where a displayed channel is off by more than 5 %.</p>\n";
  return html;
}

std::string the_bake(const Figures& f) {
  const nlohmann::json& triangles = f.bake.at("triangles");
  std::string html = "<h2>The bake</h2>\n<dl>\n";
  html += fact("triangles read", format("%.0f", number(triangles, "read")));
  html += fact("triangles kept", format("%.0f", number(triangles, "kept")));
  if (has_cells(f)) {
    const nlohmann::json& cells = f.bake.at("cells");
    const nlohmann::json& grid = cells.at("grid");
    html += fact("cells",
                 format("%d x %d x %d", grid.at(0).get<int>(), grid.at(1).get<int>(), grid.at(2).get<int>()));
    html += fact("of them filled", format("%.0f", number(cells, "filled")));
  } else if (!has_tables(f)) {
    html += fact("tables", "none");
  } else {
    html += fact("Line Spaces", format("%.0f", number(f.bake, "line_spaces")));
    html += fact("shafts filled", format("%.0f %%", 100 * number(f.bake, "filled_shafts") /
                                                        std::max(number(f.bake, "shafts"), 1.0)));
  }
  html += fact("file", megabytes(number(f.bake, "file_bytes")));
  html += fact("time to bake", format("%.2f s", total_seconds(f.bake.at("seconds"))));
  html += fact("peak memory", megabytes(number(f.bake, "peak_memory_bytes")));
  if (f.validate_seconds) html += fact("time to validate", format("%.2f s", *f.validate_seconds));
  return html + "</dl>\n";
}

std::string sections(const Figures& f) {
  std::string html =
      "<h2>Sections</h2>\n<table><thead><tr><th>section</th><th>size</th><th>share</th></tr></"
      "thead>\n";
  for (const auto& section : f.bake.at("sections")) {
    html +=
        row(escape_html(section.at("name").get<std::string>()).c_str(), megabytes(number(section, "bytes")),
            format("%.1f %%", 100 * number(section, "stored_bytes") / number(f.bake, "file_bytes")));
  }
  return html + "</table>\n";
}

}  // namespace

std::string make_page(const Figures& f, const Pictures& pictures) {
  const std::string title = escape_html(f.title);
  std::string html =
      "<!doctype html>\n<html lang=\"en\"><meta charset=\"utf-8\">\n"
      "<meta name=\"viewport\" content=\"width=device-width,initial-scale=1\">\n<title>lsp: " +
      title + "</title>\n<style>" + kStyle + "</style>\n<main>\n<h1>Indirect light from " +
      (has_tables(f) ? tables_of(f) : "exact rays") + ": " + title + "</h1>\n" + introduction(f);
  html += compared(f, pictures) + time_and_error(f) + dial(f) + the_bake(f) + sections(f);
  html +=
      "<h2>Skipped, because the scene does not need it</h2>\n<ul>\n" + list(f.bake.at("skipped")) + "</ul>\n";
  if (!f.bake.at("notes").empty())
    html += "<h2>Notes of the import</h2>\n<ul>\n" + list(f.bake.at("notes")) + "</ul>\n";
  html += std::string("</main>\n<script>") + kScript + "</script>\n</html>\n";
  return html;
}

std::string make_summary(const Figures& f) {
  std::string text;
  const std::string tables = has_cells(f) ? format("%.0f filled cells", number(f.bake.at("cells"), "filled"))
                             : has_tables(f) ? format("%.0f Line Spaces", number(f.bake, "line_spaces"))
                                             : "no tables";
  text += format("bake:        %.0f triangles, %s, %s, %.2f s\n", number(f.bake.at("triangles"), "kept"),
                 tables.c_str(), megabytes(number(f.bake, "file_bytes")).c_str(),
                 total_seconds(f.bake.at("seconds")));
  for (const auto& item : f.bake.at("skipped")) text += "skipped:     " + item.get<std::string>() + "\n";
  for (const auto& item : f.bake.at("notes")) text += "note:        " + item.get<std::string>() + "\n";
  if (f.validate_seconds) text += format("validate:    %.2f s\n", *f.validate_seconds);
  text += "device:      " + f.exact.at("device").get<std::string>() + " (" +
          f.exact.at("backend").get<std::string>() +
          "), file: " + f.exact.at("load_path").get<std::string>() + "\n";
  const auto line = [&](const char* name, const nlohmann::json& j) {
    text += format("%s %.2f million indirect rays in %.2f s: %.2f Mrays/s; picture %.2f s\n", name,
                   number(j, "indirect_rays") * 1e-6, number(j, "indirect_seconds"),
                   number(j, "indirect_mrays_per_second"), number(j, "seconds"));
  };
  line("exact:      ", f.exact);
  line("approximate:", f.approximate);
  text += format("difference:  %.2f times the rays a second; %s, mean error %s, %.2f %% of pixels visibly\n",
                 speed_up(f, f.approximate),
                 (f.compare.at("psnr_db").is_null() ? "equal pictures" : "PSNR " + psnr(f.compare)).c_str(),
                 mean_error(f.compare).c_str(), 100 * number(f.compare, "pixels_over_5_percent"));
  // Settings that are qualities.
  std::string qualities;
  for (const Figures::Setting& s : f.curve) {
    if (is_number(s.name)) continue;
    qualities += format("%s %s %.2f times, %s", qualities.empty() ? "" : ";", s.name.c_str(),
                        times(f.curve_exact, s.approximate), mean_error(s.compare).c_str());
  }
  if (!qualities.empty()) text += "dial:        in a small picture, not denoised:" + qualities + "\n";
  return text;
}

}  // namespace lsp::sample
