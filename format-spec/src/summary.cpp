#include "summary.h"

#include <lsp/program.h>

#include <array>
#include <bit>
#include <cstdarg>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "fields.h"
#include "layers.h"
#include "line_space.h"
#include "qualities.h"
#include "wide.h"

namespace lsp::format {
namespace {

using Json = nlohmann::ordered_json;

Json feature_names(uint32_t features) {
  static constexpr struct {
    uint32_t bit;
    const char* name;
  } kNames[] = {{LSP_FEATURE_EXACT, "exact"},     {LSP_FEATURE_LINE_SPACES, "line spaces"},
                {LSP_FEATURE_NORMALS, "normals"}, {LSP_FEATURE_MATERIALS, "materials"},
                {LSP_FEATURE_NTREE, "ntree"},     {LSP_FEATURE_BINARY, "binary"},
                {LSP_FEATURE_CELLS, "cells"},     {LSP_FEATURE_COVERAGE, "coverage"},
                {LSP_FEATURE_WIDE, "wide"},       {LSP_FEATURE_WIDE_BASE, "wide base"}};
  Json names = Json::array();
  for (const auto& feature : kNames)
    if (features & feature.bit) names.push_back(feature.name);
  return names;
}

const char* base_name(uint32_t base) {
  return base == LSP_BASE_NTREE   ? "ntree"
         : base == LSP_BASE_CELLS ? "cells"
         : base == LSP_BASE_WIDE  ? "wide"
                                  : "bvh";
}

Json sections(const FileView& view) {
  Json list = Json::array();
  for (const LspSection& entry : view.table) {
    const int kind = kind_of(entry.type);
    list.push_back({{"name", type_name(entry.type)},
                    {"offset", entry.offset},
                    {"stored_bytes", entry.stored_bytes},
                    {"bytes", entry.bytes},
                    {"codec", entry.codec == LSP_CODEC_NONE   ? Json("none")
                              : entry.codec == LSP_CODEC_ZSTD ? Json("zstd")
                                                              : Json(entry.codec)},
                    {"element_bytes", entry.element_bytes},
                    {"element_count", entry.element_count},
                    {"required", (entry.flags & LSP_SECTION_REQUIRED) != 0},
                    {"readable", kind != kKinds && view.parts[kind].usable},
                    {"hash", to_hex({entry.hash_lo, entry.hash_hi})}});
  }
  return list;
}

// One row a depth: what begins there.
struct Row {
  uint64_t nodes = 0, leaves = 0, triangles = 0, line_spaces = 0, shafts = 0, filled = 0;
};

class DepthTable {
 public:
  explicit DepthTable(const FileView& view)
      : nodes_(view.elements<LspNode>(Kind::kNode)),
        grid_(ntree_readable(view.header) ? view.elements<LspBitWord>(Kind::kGrid)
                                          : std::span<const LspBitWord>()),
        cells_(view.elements<LspCell>(Kind::kCell)),
        spaces_(view.elements<LspLineSpace>(Kind::kLspc)),
        wide_(view.elements<LspWideNode>(Kind::kWnod)),
        header_(view.header) {}

  std::vector<Row> run() {
    const uint32_t words = is_ntree(header_) ? LSP_GRID_WORDS(header_.ntree_branching) : 0;
    if (walks_wide(header_)) {
      visit_wide();
      return std::move(rows_);
    }
    depth_.assign(grid_.empty() ? nodes_.size() : grid_.size() / words, kUnseen);
    child(header_.root, header_.root_line_space, 0, 0);
    if (is_ntree(header_)) {
      if (!grid_.empty()) visit_cells(words);
      return std::move(rows_);
    }
    for (uint64_t i = 0; i < nodes_.size(); ++i) {
      if (depth_[i] == kUnseen) continue;
      child(nodes_[i].child0, nodes_[i].line_space0, depth_[i] + 1, i);
      child(nodes_[i].child1, nodes_[i].line_space1, depth_[i] + 1, i);
    }
    return std::move(rows_);
  }

 private:
  static constexpr uint32_t kUnseen = LSP_NONE;
  static constexpr uint32_t kMaxRows = 256;  // a damaged file may claim a chain of any length

  // The children of the wide nodes that some node before them names.
  void visit_wide() {
    depth_.assign(wide_.size(), kUnseen);
    if (wide_.empty()) return;
    depth_[0] = 0;
    rows_.resize(1);
    rows_[0].nodes = 1;
    for (uint64_t i = 0; i < wide_.size(); ++i) {
      const uint64_t depth = uint64_t{depth_[i]} + 1;
      if (depth_[i] == kUnseen || depth >= kMaxRows) continue;
      for (uint32_t k = 0; k < LSP_WIDE_CHILDREN; ++k) {
        const uint32_t child = wide_child(wide_[i], k);
        if (child == LSP_WIDE_NO_CHILD) continue;
        if (rows_.size() <= depth) rows_.resize(depth + 1);
        if ((child & LSP_WIDE_NODE_BIT) == 0) {
          ++rows_[depth].leaves;
          rows_[depth].triangles += wide_leaf_count(child);
          continue;
        }
        const uint64_t node = uint64_t{wide_[i].node_first} + (child & ~LSP_WIDE_NODE_BIT);
        if (node <= i || node >= depth_.size() || depth_[node] != kUnseen) continue;
        ++rows_[depth].nodes;
        depth_[node] = static_cast<uint32_t>(depth);
      }
    }
  }

  // The cells of the nodes that some cell before them names, as many as a word has bits and CELL has left.
  void visit_cells(uint32_t words) {
    for (uint64_t i = 0; i < depth_.size(); ++i) {
      if (depth_[i] == kUnseen) continue;
      for (uint64_t w = i * words; w < (i + 1) * words; ++w) {
        const uint64_t first = grid_[w].offset;
        const uint64_t count = static_cast<uint64_t>(std::popcount(grid_[w].bits));
        for (uint64_t c = first; c < first + count && c < cells_.size(); ++c)
          child(cells_[c].child, cells_[c].line_space, depth_[i] + 1, i, cells_[c].count);
      }
    }
  }

  // `count`: references of an NTree's leaf.
  void child(uint32_t reference, uint32_t line_space, uint32_t depth, uint64_t parent, uint32_t count = 0) {
    if (depth >= kMaxRows) return;
    if (rows_.size() <= depth) rows_.resize(depth + 1);
    Row& row = rows_[depth];
    const uint32_t index = line_space & LSP_LINE_SPACE_MASK;
    if (line_space != LSP_NONE && index < spaces_.size()) {
      ++row.line_spaces;
      row.shafts += shape_of(spaces_[index].format).shafts;
      row.filled += spaces_[index].filled;
    }
    if (reference == LSP_NONE) return;
    if (reference & LSP_LEAF_BIT) {
      ++row.leaves;
      row.triangles +=
          is_ntree(header_) ? count : (reference >> LSP_LEAF_COUNT_SHIFT & LSP_LEAF_COUNT_MASK) + 1;
    } else if (reference < depth_.size() && (reference > parent || (reference == 0 && depth == 0)) &&
               depth_[reference] == kUnseen) {
      ++row.nodes;
      depth_[reference] = depth;
    }
  }

  std::span<const LspNode> nodes_;
  std::span<const LspBitWord> grid_;  // of an NTree, as the cells
  std::span<const LspCell> cells_;
  std::span<const LspLineSpace> spaces_;
  std::span<const LspWideNode> wide_;
  const LspHeader& header_;
  std::vector<uint32_t> depth_;
  std::vector<Row> rows_;
};

double ratio(uint64_t part, uint64_t whole) {
  return whole == 0 ? 0 : static_cast<double>(part) / static_cast<double>(whole);
}

Json line_spaces(const FileView& view) {
  uint64_t shafts = 0, filled = 0, dense = 0, binary = 0, words = 0, candidate_words = 0;
  for (const LspLineSpace& space : view.elements<LspLineSpace>(Kind::kLspc)) {
    const LineSpaceShape shape = shape_of(space.format);
    shafts += shape.shafts;
    filled += space.filled;
    dense += shape.dense;
    binary += shape.entry_bytes == 0;
    words += shape.words;
    candidate_words += shape.candidate_words(space.filled);
  }
  return {{"count", view.elements<LspLineSpace>(Kind::kLspc).size()},
          {"dense", dense},
          {"binary", binary},
          {"shafts", shafts},
          {"filled", filled},
          {"fill_rate", ratio(filled, shafts)},
          {"bit_bytes", words * sizeof(LspBitWord)},
          {"candidate_bytes", candidate_words * 4},
          {"bytes_per_filled_shaft", ratio(words * sizeof(LspBitWord) + candidate_words * 4, filled)}};
}

Json vec(const lsp_float3& v) { return Json::array({v.x, v.y, v.z}); }

constexpr int kLossLimits[] = LSP_LOSS_LIMITS;

// From which loss on, per cent, a dial has a cell traced exactly: null where it never does. 0: always.
// Between whole classes as lsp_dial has it.
Json heeded_loss(uint32_t classes, uint32_t part) {
  if (classes > LSP_LOSS_UNKNOWN) return nullptr;
  if (classes == 0) return 0;
  const int from = kLossLimits[classes - 1], to = classes < LSP_LOSS_UNKNOWN ? kLossLimits[classes] : from;
  return from + (to - from) * double(part) / LSP_DIAL_PARTS;
}

Json wide_nodes(const FileView& view, const std::vector<Row>& rows) {
  uint64_t nodes = 0, below = 0, leaves = 0, triangles = 0;
  for (const LspWideNode& node : view.elements<LspWideNode>(Kind::kWnod)) {
    ++nodes;
    for (uint32_t k = 0; k < LSP_WIDE_CHILDREN; ++k) {
      const uint32_t child = wide_child(node, k);
      if (child == LSP_WIDE_NO_CHILD) continue;
      const bool leaf = (child & LSP_WIDE_NODE_BIT) == 0;
      ++(leaf ? leaves : below);
      if (leaf) triangles += wide_leaf_count(child);
    }
  }
  return {{"nodes", nodes},
          {"children_per_node", ratio(below + leaves, nodes)},
          {"leaves", leaves},
          {"triangles_per_leaf", ratio(triangles, leaves)},
          {"depth", rows.empty() ? 0 : rows.size() - 1}};
}

Json cells(const FileView& view) {
  const LspHeader& h = view.header;
  const LspCellGrid& g = h.cells;
  Json json = {{"grid", {g.cells_x, g.cells_y, g.cells_z}},
               {"lo", vec(g.lo)},
               {"size", g.size},
               {"margin", g.margin},
               {"filled", h.filled_cell_count},
               {"far_patches", g.far_patches},
               {"origin_patches", g.origin_patches},
               {"sub_cells", g.sub_cells},
               {"planes", h.plane_count},
               {"splits", h.split_count}};
  constexpr const char* kNames[LSP_QUALITY_COUNT] = {"balanced", "fast", "accurate"};
  for (uint32_t q = 0; q < LSP_QUALITY_COUNT; ++q)
    json["exact_above_loss"][kNames[q]] = {
        {"origin", heeded_loss(h.quality[q] & 0xFF, h.quality_part[q] & 0xFF)},
        {"far", heeded_loss(h.quality[q] >> 8, h.quality_part[q] >> 8)}};
  // How many entries lose so much: by class, of the two tables.
  std::array<std::array<uint64_t, LSP_LOSS_UNKNOWN + 1>, 2> counts{};
  uint64_t entry = 0;
  for (const uint32_t word : view.elements<uint32_t>(Kind::kCent))
    for (const uint32_t e : {word & 0xFFFF, word >> 16}) {
      const bool origin = entry++ >= g.origin_entry_first;
      ++counts[origin ? 0 : 1][e >> LSP_LOSS_SHIFT];
    }
  for (size_t table = 0; table < 2; ++table)
    for (uint32_t c = 0; c <= LSP_LOSS_UNKNOWN; ++c)
      json["entries"][table == 0 ? "origin" : "far"]
          [c == LSP_LOSS_UNKNOWN ? "unknown" : std::to_string(kLossLimits[c])] = counts[table][c];
  return json;
}

std::string line(const char* format, ...) __attribute__((format(printf, 1, 2)));
std::string line(const char* format, ...) {
  char text[256];
  va_list arguments;
  va_start(arguments, format);
  std::vsnprintf(text, sizeof text, format, arguments);
  va_end(arguments);
  return text;
}

std::string section_line(const Json& s) {
  return line("  %-8s %12llu %12llu %12llu  %-5s %5u x %llu\n", s["name"].get<std::string>().c_str(),
              s["offset"].get<unsigned long long>(), s["stored_bytes"].get<unsigned long long>(),
              s["bytes"].get<unsigned long long>(),
              s["codec"].is_string() ? s["codec"].get<std::string>().c_str() : "?",
              s["element_bytes"].get<unsigned>(), s["element_count"].get<unsigned long long>());
}

std::string cells_text(const Json& c) {
  const Json& grid = c["grid"];
  std::string text =
      line("cells %u x %u x %u, %u of them filled, N %u, M %u, %u^3 sub-cells; %u planes, %u splits\n",
           grid[0].get<unsigned>(), grid[1].get<unsigned>(), grid[2].get<unsigned>(),
           c["filled"].get<unsigned>(), c["far_patches"].get<unsigned>(), c["origin_patches"].get<unsigned>(),
           c["sub_cells"].get<unsigned>(), c["planes"].get<unsigned>(), c["splits"].get<unsigned>());
  text += "\n  traced exactly    origin entries       far entries\n";
  const auto from = [](const Json& loss) {
    return loss.is_null() ? std::string("never") : "loss > " + std::to_string(loss.get<int>()) + " %";
  };
  for (const auto& [quality, above] : c["exact_above_loss"].items())
    text += line("  %-12s %19s %17s\n", quality.c_str(), from(above["origin"]).c_str(),
                 from(above["far"]).c_str());
  text += "\n  loss up to    origin entries       far entries\n";
  for (const auto& [loss, count] : c["entries"]["origin"].items())
    text += line("  %9s%s %16llu %17llu\n", loss.c_str(), loss == "unknown" ? "  " : " %",
                 count.get<unsigned long long>(), c["entries"]["far"][loss].get<unsigned long long>());
  return text;
}

}  // namespace

Json summarize(std::span<const std::byte> file, const std::string& name, uint64_t memory_limit) {
  FileView view = view_file(file);
  Report report;
  check_identification(view, report);
  if (report.verdict() == Verdict::kUnsupported) {
    const Example& found = report.findings().begin()->second.examples.front();
    const bool advised = found.message.find(": ") != std::string::npos;
    throw Failure(Exit::kUnsupported, name,
                  found.path + " " + found.message + (advised ? "" : ": use a newer program"));
  }
  if (report.fatal()) {
    const std::string& found = report.findings().begin()->second.examples.front().message;
    throw Failure(Exit::kInvalid, name,
                  report.has(RuleId::kBadMagic) ? found : "is not an .lsp file: " + found);
  }
  check_sections(view, report);
  check_hashes_and_codec(view, memory_limit, report);

  const LspHeader& header = view.header;
  Json json;
  json["file"] = name;
  json["bytes"] = file.size();
  json["format"] = std::to_string(header.version_major) + "." + std::to_string(header.version_minor);
  json["content_id"] = to_hex({header.content_hash_lo, header.content_hash_hi});
  json["source_id"] = to_hex({header.source_hash_lo, header.source_hash_hi});
  json["features"] = feature_names(header.required_features);
  json["base"] = base_name(header.base_structure);
  json["packed"] = view.any_packed();
  json["parameters"] = {
      {"resolution", header.resolution},           {"depth", header.line_space_depth},
      {"triangles", header.line_space_triangles},  {"normal_angle_cos", header.normal_angle_cos},
      {"plane_tolerance", header.plane_tolerance}, {"alignment", header.alignment},
      {"ntree_branching", header.ntree_branching}, {"ntree_depth", header.ntree_depth}};
  json["origin"] = {std::bit_cast<double>(header.origin_x), std::bit_cast<double>(header.origin_y),
                    std::bit_cast<double>(header.origin_z)};
  json["bounds"] = {{"min", vec(header.bounds_min)}, {"max", vec(header.bounds_max)}};
  json["counts"] = {{"primitives", header.primitive_count}, {"triangles", header.triangle_count},
                    {"nodes", header.node_count},           {"line_spaces", header.line_space_count},
                    {"bit_words", header.bit_word_count},   {"candidate_words", header.candidate_word_count},
                    {"materials", header.material_count},   {"cells", header.cell_count},
                    {"references", header.reference_count}, {"wide_nodes", header.wide_node_count}};
  if (is_ntree(header))
    json["ntree"] = {
        {"lo", vec(header.ntree_lo)}, {"size", header.ntree_size}, {"margin", header.ntree_margin}};
  if (header.base_structure == LSP_BASE_CELLS) json["cells"] = cells(view);
  const std::vector<Row> rows = DepthTable(view).run();
  if (walks_wide(header)) json["wide"] = wide_nodes(view, rows);
  json["limits"] = {{"max_depth", header.max_depth},
                    {"max_stack", header.max_stack},
                    {"max_steps", header.max_steps},
                    {"max_leaf_triangles", header.max_leaf_triangles}};
  json["sections"] = sections(view);
  uint64_t stored = 0;
  for (const LspSection& entry : view.table)
    if (in_range(entry.offset, entry.stored_bytes, file.size())) stored += entry.stored_bytes;
  const uint64_t head = sizeof(LspHeader) + view.table.size() * sizeof(LspSection);
  json["padding_bytes"] = file.size() > stored + head ? file.size() - stored - head : 0;
  json["line_spaces"] = line_spaces(view);
  json["depths"] = Json::array();
  uint64_t depth = 0;
  for (const Row& row : rows)
    json["depths"].push_back({{"depth", depth++},
                              {"nodes", row.nodes},
                              {"leaves", row.leaves},
                              {"triangles", row.triangles},
                              {"line_spaces", row.line_spaces},
                              {"fill_rate", ratio(row.filled, row.shafts)}});
  if (const Part& meta = view.part(Kind::kMeta); meta.usable && !report.has(RuleId::kSectionHash)) {
    const auto* text = reinterpret_cast<const char*>(meta.data.data());
    Json provenance = Json::parse(text, text + meta.data.size(), nullptr, false);
    if (!provenance.is_discarded()) json["provenance"] = std::move(provenance);
  }
  json["verdict"] = to_string(report.verdict());
  json["findings"] = report.count(Severity::kError) + report.count(Severity::kFatal);
  return json;
}

std::string summary_text(const Json& j, const std::string& section) {
  std::string text;
  const std::string head = "  section        offset       stored        bytes  codec   elements\n";
  if (!section.empty()) {
    for (const Json& s : j["sections"])
      if (s["name"] == section)
        return head + section_line(s) + "  hash " + s["hash"].get<std::string>() + "\n";
    return "";
  }
  text += line("%s: format %s, %llu bytes%s\n", j["file"].get<std::string>().c_str(),
               j["format"].get<std::string>().c_str(), j["bytes"].get<unsigned long long>(),
               j["packed"].get<bool>() ? ", packed" : "");
  text += "content " + j["content_id"].get<std::string>() + "\n";
  std::string features;
  for (const Json& feature : j["features"])
    features += (features.empty() ? "" : ", ") + feature.get<std::string>();
  text += "base " + j["base"].get<std::string>() + "; features: " + features + "\n";
  const Json& p = j["parameters"];
  text += line("parameters N %u, D %u, T %u; plane tolerance %g, normal angle cosine %g, alignment %u\n",
               p["resolution"].get<unsigned>(), p["depth"].get<unsigned>(), p["triangles"].get<unsigned>(),
               p["plane_tolerance"].is_number() ? p["plane_tolerance"].get<double>() : 0.0,
               p["normal_angle_cos"].is_number() ? p["normal_angle_cos"].get<double>() : 0.0,
               p["alignment"].get<unsigned>());
  const Json& c = j["counts"];
  text += line("%llu primitives, %llu triangles, %llu nodes, %llu Line Spaces, %llu materials\n",
               c["primitives"].get<unsigned long long>(), c["triangles"].get<unsigned long long>(),
               c["nodes"].get<unsigned long long>(), c["line_spaces"].get<unsigned long long>(),
               c["materials"].get<unsigned long long>());
  if (j.contains("ntree"))
    text += line("NTree of branching %u, %u levels: %llu filled cells, %llu references (%.2f a triangle)\n",
                 p["ntree_branching"].get<unsigned>(), p["ntree_depth"].get<unsigned>(),
                 c["cells"].get<unsigned long long>(), c["references"].get<unsigned long long>(),
                 ratio(c["references"].get<uint64_t>(), c["triangles"].get<uint64_t>()));
  if (j.contains("wide"))
    text += line("%llu wide nodes of %.2f children, %llu leaves of %.2f triangles, depth %llu\n",
                 j["wide"]["nodes"].get<unsigned long long>(), j["wide"]["children_per_node"].get<double>(),
                 j["wide"]["leaves"].get<unsigned long long>(), j["wide"]["triangles_per_leaf"].get<double>(),
                 j["wide"]["depth"].get<unsigned long long>());
  if (j.contains("cells")) {
    text += cells_text(j["cells"]);
    const Json meta = j.value("provenance", Json());
    const std::string qualities = meta.is_object() ? qualities_text(meta.value("qualities", Json())) : "";
    if (!qualities.empty()) text += "\n" + qualities;
  }
  text += "\n" + head;
  for (const Json& s : j["sections"]) text += section_line(s);
  text += line("  padding %25llu\n", j["padding_bytes"].get<unsigned long long>());
  const Json& l = j["line_spaces"];
  if (l["count"] != 0)
    text += line(
        "\n%llu of %llu shafts filled (%.2f %%), %.2f bytes a filled shaft; %llu dense, %llu binary Line "
        "Spaces\n",
        l["filled"].get<unsigned long long>(), l["shafts"].get<unsigned long long>(),
        100 * l["fill_rate"].get<double>(), l["bytes_per_filled_shaft"].get<double>(),
        l["dense"].get<unsigned long long>(), l["binary"].get<unsigned long long>());
  text += "\n  depth      nodes     leaves  triangles  Line Spaces  filled\n";
  for (const Json& d : j["depths"])
    text += line("  %5llu %10llu %10llu %10llu %12llu  %5.1f %%\n", d["depth"].get<unsigned long long>(),
                 d["nodes"].get<unsigned long long>(), d["leaves"].get<unsigned long long>(),
                 d["triangles"].get<unsigned long long>(), d["line_spaces"].get<unsigned long long>(),
                 100 * d["fill_rate"].get<double>());
  if (j["verdict"] == to_string(Verdict::kLimit))
    text += "\nSections were not unpacked: raise --memory-limit.\n";
  else if (j["findings"] != 0)
    text += "\nThis file is damaged: run lsp-validate.\n";
  return text;
}

}  // namespace lsp::format
