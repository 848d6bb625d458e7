#include "report.h"

#include <cmath>
#include <cstdio>
#include <fstream>
#include <map>

#include "html_text.h"
#include "lsp/output_file.h"
#include "lsp/program.h"

namespace lsp::bench {
namespace {

using sample::base64;
using sample::escape_html;

constexpr const char* kStyle = R"(
:root{color-scheme:light dark;--line:#8884;--soft:#8881}
body{font:16px/1.5 system-ui,sans-serif;max-width:60rem;margin:0 auto;padding:1rem}
h1{font-size:1.5rem;line-height:1.2}h2{margin-top:2.5rem;border-bottom:1px solid var(--line)}
h3{font-size:1rem;margin:1.5rem 0 .3rem}figure{margin:1rem 0}figcaption,.caption{font-size:.875rem;opacity:.8}
svg{width:100%;height:auto;max-width:46rem}img{width:100%;height:auto;image-rendering:pixelated}
.scroll{overflow-x:auto}table{border-collapse:collapse;font-size:.875rem;font-variant-numeric:tabular-nums}
th,td{padding:.25rem .6rem;text-align:right;border-bottom:1px solid var(--line);white-space:nowrap}
th:first-child,td:first-child{text-align:left;position:sticky;left:0;background:Canvas}
td.word,th.word{text-align:left}tr:nth-child(even) td{background:linear-gradient(var(--soft),var(--soft)),Canvas}
.answers{padding:.5rem 1rem .5rem 2rem;border-left:4px solid #009E73;background:var(--soft)}
.warnings{padding:.5rem 1rem .5rem 2rem;border-left:4px solid #D55E00;background:var(--soft)}
dl{display:grid;grid-template-columns:max-content 1fr;gap:.1rem 1rem;font-size:.875rem}dt{opacity:.7}dd{margin:0;overflow-wrap:anywhere}
.pictures{display:grid;gap:.4rem}.pictures figure{margin:0}.pictures figcaption{font-size:.75rem;line-height:1.3}
nav a{margin-right:1rem}
)";

// "1,234" for whole numbers, fixed digits for the rest, scientific where those would show nothing.
std::string format(const Json& value, int digits) {
  if (value.is_null()) return "";
  if (value.is_string()) return escape_html(value.get<std::string>());
  if (value.is_boolean()) return value.get<bool>() ? "yes" : "no";
  char text[64];
  if (value.is_number_integer()) {
    std::string plain = std::to_string(value.get<int64_t>());
    for (int i = static_cast<int>(plain.size()) - 3; i > (plain[0] == '-' ? 1 : 0); i -= 3) {
      plain.insert(static_cast<size_t>(i), ",");
    }
    return plain;
  }
  const double number = value.get<double>();
  const bool tiny = number != 0 && std::abs(number) < 0.5 * std::pow(10, -digits);
  if (tiny) {
    std::snprintf(text, sizeof text, "%.1e", number);
  } else {
    std::snprintf(text, sizeof text, "%.*f", digits, number);
  }
  return text;
}

std::string table_html(const Table& table) {
  std::string html = "<h3>" + escape_html(table.title) + "</h3>\n";
  if (!table.caption.empty()) html += "<p class=caption>" + escape_html(table.caption) + "</p>\n";
  html += "<div class=scroll><table><thead><tr>";
  std::vector<bool> words;
  for (const Column& column : table.columns) {
    bool word = false;
    for (const Json& row : table.rows)
      word = word || (row.contains(column.key) && row[column.key].is_string());
    words.push_back(word);
    html += std::string("<th") + (word ? " class=word" : "") + ">" + escape_html(column.title) + "</th>";
  }
  html += "</tr></thead><tbody>\n";
  for (const Json& row : table.rows) {
    html += "<tr>";
    for (size_t c = 0; c < table.columns.size(); ++c) {
      const Column& column = table.columns[c];
      html += std::string("<td") + (words[c] ? " class=word" : "") + ">" +
              (row.contains(column.key) ? format(row[column.key], column.digits) : "") + "</td>";
    }
    html += "</tr>\n";
  }
  return html + "</tbody></table></div>\n";
}

std::string grid_html(const PictureGrid& grid) {
  std::string html = "<h3>" + escape_html(grid.title) + "</h3>\n";
  if (!grid.caption.empty()) html += "<p class=caption>" + escape_html(grid.caption) + "</p>\n";
  html += "<div class=scroll><div class=pictures style='grid-template-columns:repeat(" +
          std::to_string(grid.columns) + ",minmax(10rem,1fr))'>\n";
  for (const Picture& picture : grid.pictures) {
    html += "<figure><img loading=lazy alt='" + escape_html(picture.caption) + "' src='data:image/" +
            (picture.jpeg ? "jpeg" : "png") + ";base64," + base64(picture.bytes) + "'><figcaption>" +
            escape_html(picture.caption) + "</figcaption></figure>\n";
  }
  return html + "</div></div>\n";
}

std::string list_html(const char* name, const std::vector<std::string>& items) {
  if (items.empty()) return "";
  std::string html = std::string("<ul class=") + name + ">\n";
  // The page shows the first few; report.json holds all.
  constexpr size_t kShown = 24;
  for (size_t i = 0; i < items.size() && i < kShown; ++i) html += "<li>" + escape_html(items[i]) + "</li>\n";
  if (items.size() > kShown) {
    html += "<li>and " + std::to_string(items.size() - kShown) + " more, in report.json</li>\n";
  }
  return html + "</ul>\n";
}

// What lies beside report.html and report.json, by name.
std::map<std::string, std::string> extra_files(const Report& report) {
  std::map<std::string, std::string> files;
  for (const Section& section : report.sections) {
    for (const Table& table : section.tables) files[table.id + ".csv"] = to_csv(table);
    for (const Plot& plot : section.plots) files[plot.id + ".svg"] = to_svg(plot);
    for (const PictureGrid& grid : section.pictures) {
      for (const Picture& picture : grid.pictures)
        files[picture.id + (picture.jpeg ? ".jpg" : ".png")] = picture.bytes;
    }
  }
  return files;
}

// A report in the same folder has listed its files: those that are not written anew would look as if they
// belonged to this one. Nothing else in the folder is touched, whatever that list says.
void remove_earlier(const std::filesystem::path& directory, const std::map<std::string, std::string>& files) {
  std::ifstream in(directory / "report.json");
  const Json earlier = Json::parse(in, nullptr, false);
  if (!earlier.is_object() || !earlier.contains("files") || !earlier["files"].is_array()) return;
  for (const Json& file : earlier["files"]) {
    if (!file.is_string()) continue;
    const std::filesystem::path name = file.get<std::string>();
    const std::string ending = name.extension().string();
    const bool ours = ending == ".csv" || ending == ".svg" || ending == ".png" || ending == ".jpg";
    if (!ours || name != name.filename() || files.contains(name.string())) continue;
    std::error_code error;
    std::filesystem::remove(directory / name, error);
    if (error)
      throw Failure(Exit::kFile, (directory / name).string(),
                    "is of an earlier report and cannot be removed: " + error.message() +
                        "; remove it or give another folder with -o");
  }
}

}  // namespace

std::string to_csv(const Table& table) {
  const auto quoted = [](const std::string& text) {
    if (text.find_first_of(",\"\n") == std::string::npos) return text;
    std::string out = "\"";
    for (char c : text) out += c == '"' ? std::string("\"\"") : std::string(1, c);
    return out + "\"";
  };
  std::string csv;
  for (size_t c = 0; c < table.columns.size(); ++c) csv += (c ? "," : "") + quoted(table.columns[c].key);
  csv += "\n";
  for (const Json& row : table.rows) {
    for (size_t c = 0; c < table.columns.size(); ++c) {
      if (c) csv += ",";
      const std::string& key = table.columns[c].key;
      if (!row.contains(key) || row[key].is_null()) continue;
      csv += row[key].is_string() ? quoted(row[key].get<std::string>()) : row[key].dump();
    }
    csv += "\n";
  }
  return csv;
}

Json to_json(const Report& report) {
  Json json;
  json["title"] = report.title;
  json["facts"] = report.facts;
  json["answers"] = report.answers;
  json["warnings"] = report.warnings;
  for (const Section& section : report.sections) {
    Json& out = json["sections"][section.id];
    out["title"] = section.title;
    out["paragraphs"] = section.paragraphs;
    for (const Table& table : section.tables) out["tables"][table.id] = table.rows;
  }
  for (const auto& [name, bytes] : extra_files(report)) json["files"].push_back(name);
  return json;
}

std::string to_html(const Report& report) {
  std::string html =
      "<!doctype html>\n<html lang=en><meta charset=utf-8>\n"
      "<meta name=viewport content='width=device-width,initial-scale=1'>\n<title>" +
      escape_html(report.title) + "</title>\n<style>" + kStyle + "</style>\n<h1>" +
      escape_html(report.title) + "</h1>\n";
  html += list_html("answers", report.answers);
  if (!report.warnings.empty()) {
    html += "<details><summary>" + std::to_string(report.warnings.size()) + " warnings</summary>\n" +
            list_html("warnings", report.warnings) + "</details>\n";
  }
  html += "<nav>";
  for (const Section& section : report.sections) {
    html += "<a href='#" + section.id + "'>" + escape_html(section.title) + "</a> ";
  }
  html += "</nav>\n";
  for (const Section& section : report.sections) {
    html += "<h2 id='" + section.id + "'>" + escape_html(section.title) + "</h2>\n";
    for (const std::string& paragraph : section.paragraphs) html += "<p>" + escape_html(paragraph) + "</p>\n";
    for (const Plot& plot : section.plots) {
      html += "<figure>" + to_svg(plot);
      if (!plot.caption.empty()) html += "<figcaption>" + escape_html(plot.caption) + "</figcaption>";
      html += "</figure>\n";
    }
    for (const PictureGrid& grid : section.pictures) html += grid_html(grid);
    for (const Table& table : section.tables) html += table_html(table);
  }
  html += "<h2 id=facts>Measured on</h2>\n<dl>\n";
  for (const auto& [key, value] : report.facts.items()) {
    html += "<dt>" + escape_html(key) + "</dt><dd>" +
            (value.is_string() ? escape_html(value.get<std::string>()) : escape_html(value.dump())) +
            "</dd>\n";
  }
  return html + "</dl>\n</html>\n";
}

void write_report(const Report& report, const std::filesystem::path& directory) {
  std::error_code error;
  std::filesystem::create_directories(directory, error);
  if (error) throw Failure(Exit::kFile, directory.string(), "cannot be made: " + error.message());
  const std::map<std::string, std::string> files = extra_files(report);
  for (const auto& [name, bytes] : files) write_file(directory / name, bytes);
  remove_earlier(directory, files);
  write_file(directory / "report.json",
             to_json(report).dump(1, ' ', false, Json::error_handler_t::replace) + "\n");
  write_file(directory / "report.html", to_html(report));
}

}  // namespace lsp::bench
