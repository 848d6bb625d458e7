#include "provenance.h"

#include <map>
#include <nlohmann/json.hpp>

#include "figures.h"
#include "import/source_file.h"
#include "lsp/program.h"
#include "writer.h"

namespace lsp {
namespace {

using Json = nlohmann::ordered_json;

// The path of a source relative to the folder of the input that led to it.
std::string name_beside(const std::filesystem::path& file, const std::filesystem::path& input) {
  const std::filesystem::path folder = input.parent_path();
  const std::filesystem::path relative = folder.empty() ? file : file.lexically_relative(folder);
  return printable((relative.empty() ? file : relative).generic_string());
}

}  // namespace

void write_depfile(const Arguments& a, const std::vector<std::vector<std::filesystem::path>>& sources) {
  // As Make, Ninja and CMake read a name. Rarer characters (; = | and quotes) have no escape that all three
  // know.
  const auto escaped = [](const std::filesystem::path& path) {
    std::string text;
    for (const char c : path.string()) {
      if (c == '\n')
        throw Failure(Exit::kUsage, printable(path.string()),
                      "has a line break in its name, which no rule can: rename it, or leave out --depfile");
      if (c == ' ' || c == '#' || c == ':') text += '\\';
      if (c == '$') text += '$';
      text += c;
    }
    return text;
  };
  std::string rule = escaped(a.output) + ":";
  for (const auto& files : sources) {
    for (const auto& file : files) {
      std::error_code error;  // a file that is not there would make Make give up
      if (std::filesystem::is_regular_file(file, error)) rule += " \\\n  " + escaped(file);
    }
  }
  write_file(a.depfile, rule + "\n");
}

Json provenance(const Arguments& a, const Baked& baked, const Mesh& mesh,
                const std::vector<std::string>& material_names, const std::array<uint64_t, 2>& source,
                const MeasuredError& error) {
  Json inputs = Json::array();
  for (const auto& p : a.inputs) inputs.push_back(printable(p.filename().string()));
  Json sources = Json::array();
  for (const auto& files : mesh.sources) {
    Json& list = sources.emplace_back(Json::array());
    for (const auto& file : files) list.push_back(name_beside(file, files[0]));
  }
  static const std::map<Purpose, const char*> kPurposes = {{Purpose::kVisibility, "visibility"},
                                                           {Purpose::kAo, "ao"},
                                                           {Purpose::kDiffuse, "diffuse"},
                                                           {Purpose::kGlossy, "glossy"},
                                                           {Purpose::kAll, "all"}};
  Json meta = {{"generator", std::string("lsp-bake ") + kProgramVersion},
               {"inputs", inputs},
               {"sources", sources},
               {"origin", {mesh.origin.x, mesh.origin.y, mesh.origin.z}},
               {"source_hash", hex128(source[0], source[1])},
               {"options",
                {{"base", a.base},
                 {"cells", longest_side(baked.header.cells)},
                 {"branching", a.branching},
                 {"levels", a.base == "ntree" ? a.levels : 0},
                 {"resolution", a.resolution},
                 {"depth", a.depths},
                 {"triangles", a.triangles},
                 {"samples", a.samples},
                 {"for", kPurposes.at(a.purpose)},
                 {"exact", !a.no_exact},
                 {"line_spaces", !a.no_line_spaces},
                 {"spatial_splits", !a.no_splits},
                 {"normal_angle", a.normal_angle},
                 {"plane_tolerance", a.plane_tolerance},
                 {"crease_angle", a.crease_angle}}},
               {"triangles",
                {{"read", mesh.primitive_count},
                 {"kept", mesh.triangles.size()},
                 {"degenerate", mesh.rejected.degenerate},
                 {"non_finite", mesh.rejected.non_finite},
                 {"out_of_range", mesh.rejected.out_of_range},
                 {"collapsed", mesh.rejected.collapsed},
                 {"invisible", mesh.rejected.invisible}}},
               {"error", to_json(error)},
               {"qualities", to_json(baked.qualities)},
               {"materials", material_names}};
  if (a.time) {
    meta["options"]["time"] = *a.time;
    meta["options"]["animation"] = printable(a.animation);
  }
  return meta;
}

}  // namespace lsp
