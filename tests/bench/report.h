// What a benchmark found: sections of words, tables, plots and pictures; written as JSON, CSV, SVG and one
// self-contained HTML page that a phone can read without a network.
#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace lsp::bench {

using Json = nlohmann::ordered_json;

struct Column {
  std::string key;    // in JSON and CSV
  std::string title;  // in the page's table, with the unit
  int digits = 2;     // after the point, for numbers that are not whole
};

struct Table {
  std::string id;
  std::string title;
  std::string caption;
  std::vector<Column> columns;
  std::vector<Json> rows;  // objects by column key; a missing or null value is an empty cell
};

struct Axis {
  std::string label;
  bool log = false;
};

struct Point {
  double x, y;
  std::string label;  // shown on touch or hover
};

struct Series {
  std::string name;
  std::vector<Point> points;
  bool line = false;  // join the points in order
  int kin = -1;       // the series whose colour this one has, by number; its line is dashed then. -1: its own
};

struct Plot {
  std::string id;
  std::string title;
  std::string caption;
  Axis x, y;
  std::vector<Series> series;
};

struct Picture {
  std::string id;
  std::string caption;
  std::string bytes;  // of the file
  bool jpeg = false;  // else PNG
};

// Pictures side by side, row by row.
struct PictureGrid {
  std::string title;
  std::string caption;
  size_t columns = 1;
  std::vector<Picture> pictures;
};

struct Section {
  std::string id;
  std::string title;
  std::vector<std::string> paragraphs;
  std::vector<Plot> plots;
  std::vector<PictureGrid> pictures;
  std::vector<Table> tables;
};

struct Report {
  std::string title;
  Json facts;                         // machine, versions, options: shown as a list
  std::vector<std::string> answers;   // the sentences that matter, first on the page
  std::vector<std::string> warnings;  // what should not be believed, and why
  std::vector<Section> sections;
};

// A stand-alone SVG picture. Points that a logarithmic axis cannot show are put at its lower end.
std::string to_svg(const Plot& plot);

std::string to_csv(const Table& table);
Json to_json(const Report& report);
std::string to_html(const Report& report);

// Writes report.html, report.json, one .csv per table, one .svg per plot and one .png or .jpg per picture
// into `directory`, which it makes. Each file is written aside and renamed; report.json lists those beside
// the page, and of a report that was there before the listed ones that this one lacks are removed. Throws
// Failure(kFile).
void write_report(const Report& report, const std::filesystem::path& directory);

}  // namespace lsp::bench
