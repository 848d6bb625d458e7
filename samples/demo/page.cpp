#include "page.h"

#include <cmath>
#include <cstdarg>
#include <cstdint>
#include <cstdio>

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

double speed_up(const Figures& f, const nlohmann::json& approximate) {
  const double exact = number(f.exact, "indirect_mrays_per_second");
  return exact > 0 ? number(approximate, "indirect_mrays_per_second") / exact : 0;
}

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

// The qualities side by side; nothing where there is but one.
std::string dial(const Figures& f) {
  if (f.others.empty() || !has_tables(f)) return "";
  std::string html =
      "<h2>The dial</h2>\n<p>The same file at other qualities: where tables lose more than the quality "
      "allows, a cell "
      "is traced exactly. fast is tables alone.</p>\n<table><thead><tr><th>quality</th><th>rays a second, "
      "times "
      "exact</th><th>mean error</th><th>pixels that differ visibly</th></tr></thead>\n";
  const auto add = [&](const std::string& name, const nlohmann::json& approximate,
                       const nlohmann::json& compare) {
    html += "<tr><th>" + escape_html(name) +
            format("</th><td>%.2f</td><td>%.2f %%</td><td>%.2f %%</td></tr>\n", speed_up(f, approximate),
                   100 * number(compare, "relative_mean"), 100 * number(compare, "pixels_over_5_percent"));
  };
  add("balanced (shown)", f.approximate, f.compare);
  for (const Figures::Quality& other : f.others) add(other.name, other.approximate, other.compare);
  return html + "</table>\n";
}

constexpr const char* kStyle = R"(
:root{color-scheme:dark;--ink:#ece7df;--dim:#a79f93;--ground:#17151a;--card:#211e25;--line:#37323d;--accent:#f0b45b}
*{box-sizing:border-box}body{margin:0;background:var(--ground);color:var(--ink);font:16px/1.5 system-ui,sans-serif}
main{max-width:1100px;margin:0 auto;padding:1.2rem}h1{font-size:1.5rem;margin:.4rem 0}h2{font-size:1.1rem;margin:2rem 0 .6rem}
p{color:var(--dim);margin:.3rem 0 1rem;max-width:46rem}strong{color:var(--accent)}
figure{margin:0;background:var(--card);border:1px solid var(--line);border-radius:8px;overflow:hidden}
figcaption{padding:.4rem .7rem;color:var(--dim);font-size:.9rem}img{display:block;width:100%}
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
slide.querySelector('input').addEventListener('input',e=>slide.style.setProperty('--at',e.target.value+'%'));
)";

}  // namespace

std::string base64(std::string_view bytes) {
  constexpr const char* kDigits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string out;
  for (size_t i = 0; i < bytes.size(); i += 3) {
    uint32_t word = 0;
    for (size_t k = 0; k < 3; ++k) {
      word = word << 8 | (i + k < bytes.size() ? static_cast<uint8_t>(bytes[i + k]) : 0u);
    }
    for (size_t k = 0; k < 4; ++k) {
      out.push_back(k <= bytes.size() - i ? kDigits[word >> (18 - 6 * k) & 63u] : '=');
    }
  }
  return out;
}

std::string escape_html(std::string_view text) {
  std::string out;
  for (const char c : text) {
    switch (c) {
      case '&':
        out += "&amp;";
        break;
      case '<':
        out += "&lt;";
        break;
      case '>':
        out += "&gt;";
        break;
      case '"':
        out += "&quot;";
        break;
      default:
        out.push_back(c);
    }
  }
  return out;
}

std::string make_page(const Figures& f, const Pictures& pictures) {
  const auto source = [](const std::string& png) { return "data:image/png;base64," + base64(png); };
  const std::string exact = source(pictures.exact);
  const std::string approximate = source(pictures.approximate);
  const double factor = number(f.compare, "factor");
  const nlohmann::json& triangles = f.bake.at("triangles");
  const nlohmann::json& seconds = f.bake.at("seconds");
  const std::string title = escape_html(f.title);

  std::string html =
      "<!doctype html>\n<html lang=\"en\"><meta charset=\"utf-8\">\n"
      "<meta name=\"viewport\" content=\"width=device-width,initial-scale=1\">\n<title>lsp: " +
      title + "</title>\n<style>" + kStyle + "</style>\n<main>\n<h1>Indirect light from " +
      (has_tables(f) ? tables_of(f) : "exact rays") + ": " + title + "</h1>\n" + introduction(f);
  html +=
      "<div class=\"slide\"><img alt=\"exact\" src=\"" + exact +
      "\"><img class=\"over\" alt=\"approximate\" src=\"" + approximate +
      "\"><span class=\"bar\"></span><b style=\"left:.5rem\">exact</b><b "
      "style=\"right:.5rem\">approximate</b>"
      "<input type=\"range\" min=\"0\" max=\"100\" value=\"50\" aria-label=\"exact or approximate\"></div>\n";
  html += "<h2>Side by side</h2><div class=\"trio\">\n<figure><img alt=\"\" src=\"" + exact +
          "\"><figcaption>exact</figcaption></figure>\n<figure><img alt=\"\" src=\"" + approximate +
          "\"><figcaption>approximate</figcaption></figure>\n<figure><img alt=\"\" src=\"" +
          source(pictures.difference) + "\"><figcaption>absolute difference of linear light, times " +
          format("%g", factor) + "</figcaption></figure>\n</div>\n";

  html +=
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
  html += row("mean error", "0", format("%.2f %% of the mean", 100 * number(f.compare, "relative_mean")));
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

  html += dial(f) + "<h2>The bake</h2>\n<dl>\n";
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
  html += fact("time to bake", format("%.2f s", total_seconds(seconds)));
  html += fact("peak memory", megabytes(number(f.bake, "peak_memory_bytes")));
  html += fact("time to validate", format("%.2f s", f.validate_seconds));
  html +=
      "</dl>\n<h2>Sections</h2>\n<table><thead><tr><th>section</th><th>size</th><th>share</th></tr></"
      "thead>\n";
  for (const auto& section : f.bake.at("sections")) {
    html +=
        row(escape_html(section.at("name").get<std::string>()).c_str(), megabytes(number(section, "bytes")),
            format("%.1f %%", 100 * number(section, "stored_bytes") / number(f.bake, "file_bytes")));
  }
  html += "</table>\n<h2>Skipped, because the scene does not need it</h2>\n<ul>\n" +
          list(f.bake.at("skipped")) + "</ul>\n";
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
  text += format("validate:    %.2f s\n", f.validate_seconds);
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
  text += format(
      "difference:  %.2f times the rays a second; PSNR %s, mean error %.2f %%, %.2f %% of pixels visibly\n",
      speed_up(f, f.approximate), psnr(f.compare).c_str(), 100 * number(f.compare, "relative_mean"),
      100 * number(f.compare, "pixels_over_5_percent"));
  for (const Figures::Quality& other : f.others)
    text += format("%-12s %.2f times the rays a second; mean error %.2f %%\n", (other.name + ":").c_str(),
                   speed_up(f, other.approximate), 100 * number(other.compare, "relative_mean"));
  return text;
}

}  // namespace lsp::sample
