// lsp-bake: turns meshes into an .lsp file.
#include <fcntl.h>
#include <tbb/global_control.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cinttypes>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <sstream>

#include "bake.h"
#include "cells/dial.h"
#include "color_materials.h"
#include "error.h"
#include "import/import.h"
#include "import/source_file.h"
#include "lsp/command_line.h"
#include "writer.h"

namespace {

using namespace lsp;
using Json = nlohmann::ordered_json;

constexpr uint32_t kNTreeLevels = 3;

struct Arguments {
  std::vector<std::filesystem::path> inputs;
  std::filesystem::path output;
  std::string base = "bvh";
  uint32_t cells = 0;
  uint32_t branching = 0;  // 0: the resolution
  uint32_t levels = kNTreeLevels;
  uint32_t resolution = 6;
  std::vector<uint32_t> depths = {9};
  uint32_t triangles = 0;
  Purpose purpose = Purpose::kAll;
  bool no_exact = false;
  bool exact = false;
  bool no_line_spaces = false;
  bool conservative = false;
  bool directed = false;
  std::string compress = "none";
  uint32_t align = 4096;
  uint32_t threads = 0;
  uint64_t memory_limit = 0;
  float normal_angle = 180;
  float plane_tolerance = 0.0f;
  uint32_t samples = 5;
  float crease_angle = 40;
  bool no_splits = false;
  std::string preset = "balanced";
  double max_error = 0;  // per cent of rays, 0: not asked for
  bool strict = false;
  std::filesystem::path depfile;
  bool resolution_given = false, depth_given = false, samples_given = false;
  CommonOptions common;
};

// What decides between speed and accuracy, in one step each.
struct Quality {
  uint32_t resolution, depth, samples;
};
struct Preset {
  Quality line_spaces;
  uint32_t far_samples, origin_samples;  // of cells
};
const std::map<std::string, Preset> kPresets = {
    {"fast", {{4, 8, 3}, 24, 8}}, {"balanced", {{6, 9, 5}, 64, 24}}, {"accurate", {{6, 11, 9}, 128, 72}}};
// From cheap to dear, for --max-error.
const std::vector<Quality> kLadder = {{4, 7, 5}, {4, 9, 5}, {6, 9, 5}, {6, 11, 9}, {8, 11, 9}, {8, 13, 9}};
constexpr uint64_t kErrorRays = 65536;

std::string hex128(uint64_t lo, uint64_t hi) {
  char text[33];
  std::snprintf(text, sizeof text, "%016" PRIx64 "%016" PRIx64, hi, lo);
  return text;
}

std::string megabytes(uint64_t bytes) {
  char text[32];
  std::snprintf(text, sizeof text, "%.2f MB", double(bytes) / 1e6);
  return text;
}

// The most memory this process has held; 0 where the system does not tell. getrusage would count what the
// process that started this one held.
uint64_t peak_memory_bytes() {
  std::ifstream status("/proc/self/status");
  for (std::string line; std::getline(status, line);)
    if (line.starts_with("VmHWM:")) return std::stoull(line.substr(6)) * 1024;
  return 0;
}

// Null where nothing could be measured.
Json to_json(const MeasuredError& e) {
  if (e.rays == 0) return nullptr;
  return {{"rays", e.rays},
          {"wrong_hits", e.wrong_hits},
          {"wrong_misses", e.wrong_misses},
          {"wrong_percent", 100 * e.wrong_share()},
          {"depth_error_percent_of_diagonal", 100 * e.depth_error}};
}

// The path of a source relative to the folder of the input that led to it.
std::string name_beside(const std::filesystem::path& file, const std::filesystem::path& input) {
  const std::filesystem::path folder = input.parent_path();
  const std::filesystem::path relative = folder.empty() ? file : file.lexically_relative(folder);
  return printable((relative.empty() ? file : relative).generic_string());
}

std::vector<std::string> names_of(const std::vector<Material>& materials) {
  std::vector<std::string> names;
  for (const Material& material : materials) names.push_back(material.name);
  return names;
}

// --strict: what is not read, or not as it stands, is an error.
[[noreturn]] void refuse_notes(const Mesh& mesh) {
  for (const std::string& note : mesh.notes) std::fprintf(stderr, "lsp-bake: note: %s\n", note.c_str());
  throw Failure(Exit::kInvalid, mesh.sources.front().front().string(),
                "led to " + std::to_string(mesh.notes.size()) +
                    " notes, which --strict refuses: mend the input or leave out --strict");
}

// A rule for Make and Ninja: the output depends on every file that was read.
void write_depfile(const Arguments& a, const Mesh& mesh) {
  const auto escaped = [](const std::filesystem::path& path) {
    std::string text;
    for (const char c : path.string()) {
      if (c == ' ' || c == '#') text += '\\';
      if (c == '$') text += '$';
      text += c;
    }
    return text;
  };
  std::string rule = escaped(a.output) + ":";
  for (const auto& files : mesh.sources) {
    for (const auto& file : files) rule += " \\\n  " + escaped(file);
  }
  write_text(a.depfile, rule + "\n");
}

// Provenance: nothing in it depends on the machine, the time, the threads or the folder.
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
  return {{"generator", std::string("lsp-bake ") + kProgramVersion},
          {"inputs", inputs},
          {"sources", sources},
          {"origin", {mesh.origin.x, mesh.origin.y, mesh.origin.z}},
          {"source_hash", hex128(source[0], source[1])},
          {"options",
           {{"base", a.base},
            {"cells", baked.header.cells.cells_x
                          ? std::max({baked.header.cells.cells_x, baked.header.cells.cells_y,
                                      baked.header.cells.cells_z})
                          : 0},
            {"branching", a.branching},
            {"levels", a.base == "ntree" ? a.levels : 0},
            {"resolution", a.resolution},
            {"depth", a.depths},
            {"triangles", a.triangles},
            {"samples", a.samples},
            {"for", kPurposes.at(a.purpose)},
            {"exact", !a.no_exact},
            {"line_spaces", !a.no_line_spaces},
            {"conservative", a.conservative},
            {"directed", a.directed},
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
          {"materials", material_names}};
}

Exit run(Arguments a) {
  if (a.exact && a.no_exact) throw Failure(Exit::kUsage, "", "--exact and --no-exact exclude each other");
  if (a.max_error > 0 && (a.resolution_given || a.depth_given || a.samples_given))
    throw Failure(Exit::kUsage, "",
                  "--max-error chooses --resolution, --depth and --samples itself, leave them out");
  if (a.max_error > 0 && (a.no_line_spaces || a.purpose == Purpose::kVisibility))
    throw Failure(Exit::kUsage, "", "--max-error needs Line Spaces with candidates");
  if ((a.conservative || a.directed) && (a.purpose != Purpose::kVisibility || a.no_line_spaces))
    throw Failure(Exit::kUsage, "", "--conservative and --directed need the Line Spaces of --for visibility");
  const Preset& preset = kPresets.at(a.preset);
  const bool ntree = a.base == "ntree";
  if (!ntree && (a.branching || a.levels != kNTreeLevels))
    throw Failure(Exit::kUsage, "", "--branching and --levels need --base ntree");
  const bool cells = a.base == "cells";
  if (a.cells && !cells) throw Failure(Exit::kUsage, "", "--cells needs --base cells");
  if (cells && (a.resolution_given || a.depth_given || a.samples_given || a.no_line_spaces))
    throw Failure(Exit::kUsage, "",
                  "--base cells has its own tables: leave out --resolution, --depth, --samples and "
                  "--no-line-spaces");
  if (cells && a.purpose == Purpose::kVisibility)
    throw Failure(Exit::kUsage, "", "--for visibility needs Line Spaces: leave out --base cells");
  if (ntree && a.max_error > 0)
    throw Failure(Exit::kUsage, "", "--max-error chooses among BVHs, leave out --base");
  if (!a.resolution_given) a.resolution = preset.line_spaces.resolution;
  if (ntree && !a.branching) a.branching = std::clamp(a.resolution, 2u, LSP_MAX_BRANCHING);
  // At depth 1 an NTree's error costs the fewest bytes: bunny, N = 6, 1.2 % wrong and 13 MB against 0.3 % and
  // 142 MB.
  if (!a.depth_given) a.depths = {ntree ? std::min(a.levels - 1, 1u) : preset.line_spaces.depth};
  if (!a.samples_given) a.samples = preset.line_spaces.samples;
  if (a.no_line_spaces && a.no_exact)
    throw Failure(Exit::kUsage, "", "--no-line-spaces with --no-exact leaves nothing to trace");
  std::unique_ptr<tbb::global_control> control;
  if (a.threads)
    control = std::make_unique<tbb::global_control>(tbb::global_control::max_allowed_parallelism, a.threads);
  ProgressBar bar(!a.common.quiet && !a.common.json);
  const auto clock = [start = std::chrono::steady_clock::now()]() mutable {
    const auto now = std::chrono::steady_clock::now();
    const double s = std::chrono::duration<double>(now - start).count();
    start = now;
    return s;
  };
  auto timer = clock;

  bar.show("import", 0);
  ImportOptions import_options;
  import_options.memory_limit = a.memory_limit;
  import_options.crease_angle_degrees = a.crease_angle;
  Mesh mesh = import_meshes(a.inputs, import_options);
  if (a.strict && !mesh.notes.empty()) refuse_notes(mesh);
  const auto source = hash_sources(mesh);
  const std::vector<std::string> material_names = names_of(mesh.materials);
  make_color_materials(mesh);
  const double import_seconds = timer();

  BakeOptions options;
  options.purpose = a.purpose;
  options.line_spaces = !a.no_line_spaces;
  options.base = ntree ? Base::kNTree : cells ? Base::kCells : Base::kBvh;
  options.cells = a.cells;
  options.cell_tables.far_samples = preset.far_samples;
  options.cell_tables.origin_samples = preset.origin_samples;
  options.ntree.branching = a.branching;
  options.ntree.levels = a.levels;
  options.bvh.spatial_splits = !a.no_splits;
  options.line_space.triangles = a.triangles;
  options.line_space.kind =
      a.purpose == Purpose::kVisibility ? LineSpaceKind::kBinary : LineSpaceKind::kCandidates;
  options.line_space.conservative = a.conservative;
  options.line_space.directed = a.directed;
  options.line_space.exact = !a.no_exact;
  options.normal_angle_degrees = a.normal_angle;
  options.plane_tolerance = a.plane_tolerance;
  options.memory_limit = a.memory_limit;
  options.folder = a.output.has_parent_path() ? a.output.parent_path() : ".";
  const auto bake_with = [&](const Arguments& with) {
    options.line_space.resolution = with.resolution;
    options.line_space.depths = with.depths;
    options.line_space.samples = with.samples;
    return bake(mesh, options, [&](std::string_view stage, double done) { bar.show(stage, done); });
  };
  const bool measure = !a.no_line_spaces && a.purpose != Purpose::kVisibility;
  Baked baked;
  MeasuredError error;
  if (cells) {
    if (a.max_error > 0) options.cells_wrong = a.max_error / 100;
    baked = bake_with(a);
    error = measure_error(baked, kErrorRays);
    // The dial is measured on rays of its own: what they flattered is asked for again, more sternly, and in
    // the end everything is traced exactly.
    for (const double part : {0.7, 0.5, 0.3, 0.0}) {
      if (a.max_error == 0 || 100 * error.wrong_share() <= a.max_error) break;
      choose_dial(baked, part * options.cells_wrong);
      error = measure_error(baked, kErrorRays);
    }
  } else if (a.max_error > 0) {
    for (const Quality& q : kLadder) {
      a.resolution = q.resolution;
      a.depths = {q.depth};
      a.samples = q.samples;
      baked = bake_with(a);
      error = measure_error(baked, kErrorRays);
      if (100 * error.wrong_share() <= a.max_error) break;
    }
  } else {
    baked = bake_with(a);
    if (measure) error = measure_error(baked, kErrorRays);
  }
  if (a.max_error > 0 && 100 * error.wrong_share() > a.max_error) {
    char text[160];
    std::snprintf(
        text, sizeof text,
        "the most accurate setting still answers %.3f %% of rays wrongly, over --max-error %g: allow more, "
        "or trace exactly",
        100 * error.wrong_share(), a.max_error);
    throw Failure(Exit::kLimit, a.inputs[0].string(), text);
  }
  if (a.no_exact && cells)
    keep_tables_only(baked);
  else if (a.no_exact && baked.line_spaces.records.empty())
    baked.skipped.push_back(
        "leaving out the exact tree: the scene is too small for Line Spaces at this depth");
  else if (a.no_exact)
    keep_approximate_only(baked);
  baked.header.source_hash_lo = source[0];
  baked.header.source_hash_hi = source[1];
  timer();

  bar.show("write", 0);
  const Json meta = provenance(a, baked, mesh, material_names, source, error);
  const Written written =
      write_lsp(a.output, baked, meta.dump(), {a.align, a.compress == "zstd", 12, a.memory_limit});
  if (!a.depfile.empty()) write_depfile(a, mesh);
  const double write_seconds = timer();
  bar.clear();

  const uint64_t peak = peak_memory_bytes();
  const auto partial = uint64_t(std::count_if(baked.triangles.begin(), baked.triangles.end(), has_gaps));
  const LineSpaces& ls = baked.line_spaces;
  if (a.common.json) {
    Json sections = Json::array();
    for (const WrittenSection& s : written.sections)
      sections.push_back({{"name", s.name}, {"bytes", s.bytes}, {"stored_bytes", s.stored_bytes}});
    Json report = {{"output", a.output.string()},
                   {"triangles", meta["triangles"]},
                   {"origin", meta["origin"]},
                   {"notes", mesh.notes},
                   {"skipped", baked.skipped},
                   {"error", meta["error"]},
                   {"nodes", baked.header.node_count},
                   {"triangle_records", baked.header.triangle_count},
                   {"partial_records", partial},
                   {"depth", baked.header.max_depth},
                   {"line_spaces", baked.header.line_space_count},
                   {"shafts", ls.shafts},
                   {"filled_shafts", ls.filled},
                   {"dense_line_spaces", ls.dense},
                   {"seconds",
                    {{"import", import_seconds},
                     {"base_structure", baked.tree_seconds},
                     {"line_spaces", baked.line_space_seconds},
                     {"write", write_seconds}}},
                   {"peak_memory_bytes", peak},
                   {"file_bytes", written.file_bytes},
                   {"content_hash", hex128(baked.header.content_hash_lo, baked.header.content_hash_hi)},
                   {"sections", sections}};
    std::cout << report.dump(2) << "\n";
  } else if (!a.common.quiet) {
    std::printf("read        %" PRIu64 " triangles, kept %zu\n", mesh.primitive_count, mesh.triangles.size());
    if (mesh.rejected.total())
      std::printf("dropped     %" PRIu64 " degenerate, %" PRIu64 " non-finite, %" PRIu64
                  " with an index out of range, %" PRIu64 " too small, %" PRIu64 " wholly transparent\n",
                  mesh.rejected.degenerate, mesh.rejected.non_finite, mesh.rejected.out_of_range,
                  mesh.rejected.collapsed, mesh.rejected.invisible);
    if (mesh.origin != glm::dvec3(0))
      std::printf("origin      %.17g %.17g %.17g: positions, rays and hits are relative to it\n",
                  mesh.origin.x, mesh.origin.y, mesh.origin.z);
    for (const std::string& note : mesh.notes) std::printf("note        %s\n", note.c_str());
    if (partial) std::printf("partial     %" PRIu64 " triangle records are there in part\n", partial);
    std::printf("tree        %u nodes, %u triangle records, depth %u\n", baked.header.node_count,
                baked.header.triangle_count, baked.header.max_depth);
    if (const LspCellGrid& g = baked.header.cells; cells)
      std::printf("cells       %u x %u x %u, %u filled; %u splits, %u planes\n", g.cells_x, g.cells_y,
                  g.cells_z, baked.header.filled_cell_count, baked.header.split_count,
                  baked.header.plane_count);
    if (baked.header.line_space_count)
      std::printf("Line Spaces %u, %.1f %% of the shafts filled\n", baked.header.line_space_count,
                  100.0 * double(ls.filled) / double(std::max<uint64_t>(1, ls.shafts)));
    if (error.rays)
      std::printf(
          "error       %.2f %% wrong hits, %.2f %% wrong misses, depth off by %.2f %% of the diagonal\n",
          100.0 * double(error.wrong_hits) / double(error.rays),
          100.0 * double(error.wrong_misses) / double(error.rays), 100 * error.depth_error);
    for (const std::string& s : baked.skipped) std::printf("skipped     %s\n", s.c_str());
    std::printf("time        import %.2f s, tree %.2f s, Line Spaces %.2f s, write %.2f s; peak memory %s\n",
                import_seconds, baked.tree_seconds, baked.line_space_seconds, write_seconds,
                megabytes(peak).c_str());
    for (const WrittenSection& s : written.sections) {
      std::printf("section     %s %12s", s.name.c_str(), megabytes(s.bytes).c_str());
      if (s.stored_bytes != s.bytes) std::printf(", packed %s", megabytes(s.stored_bytes).c_str());
      std::printf("\n");
    }
    std::printf("wrote       %s, %s\n", a.output.c_str(), megabytes(written.file_bytes).c_str());
    std::fflush(stdout);
  }
  return Exit::kDone;
}

}  // namespace

int main(int argc, char** argv) {
  Arguments a;
  CLI::App app("Bakes meshes (.gltf .glb .obj .ply .stl .off) into an .lsp file.", "lsp-bake");
  app.option_defaults()->always_capture_default();
  app.add_option("INPUT", a.inputs, "Mesh files, read in this order")->required();
  app.add_option("-o,--output", a.output, "The .lsp file to write")->required();
  app.add_option("--base", a.base, "Base structure")->check(CLI::IsMember({"bvh", "ntree", "cells"}));
  app.add_option("--cells", a.cells,
                 "Cells along the longest side of the grid of --base cells; 0: chosen from the scene")
      ->check(CLI::Range(0u, LSP_MAX_CELLS));
  app.add_option("--branching", a.branching, "NTree: cells along an edge of a node; 0: as --resolution")
      ->check(CLI::IsMember({0}) | CLI::Range(2u, LSP_MAX_BRANCHING));
  app.add_option("--levels", a.levels, "NTree: levels of nodes")->check(CLI::Range(1u, LSP_MAX_NTREE_DEPTH));
  app.add_option(
         "--preset", a.preset,
         "Fast to bake and to trace, or accurate; --resolution, --depth and --samples overrule it. Of cells: "
         "the time of the bake against the exact work that their qualities need")
      ->check(CLI::IsMember({"fast", "balanced", "accurate"}));
  app.add_option("--max-error", a.max_error,
                 "Choose the cheapest setting with at most this many per cent of rays answered wrongly, of "
                 "cells the point of the dial; 0: as --preset says")
      ->check(CLI::Range(0.0, 100.0));
  auto* resolution =
      app.add_option("--resolution", a.resolution, "N: patches along an edge of a Line Space's box")
          ->check(CLI::Range(1u, LSP_MAX_RESOLUTION));
  auto* depth = app.add_option("--depth", a.depths,
                               "D: depth of the nodes with a Line Space; several, as 6,9,12, give levels of "
                               "detail; an NTree's is 1 "
                               "where nothing is said")
                    ->delimiter(',')
                    ->check(CLI::Range(0u, 40u));
  app.add_option("--triangles", a.triangles, "T: nodes above D with fewer triangles get a Line Space too");
  auto* samples =
      app.add_option("--samples", a.samples,
                     "Rays that choose a shaft's candidate; 1: the centroid ray alone, as the paper does")
          ->check(CLI::Range(1u, 64u));
  app.add_option("--for", a.purpose, "What the file is for: what nobody needs then is left out")
      ->transform(CLI::CheckedTransformer(std::map<std::string, Purpose>{{"visibility", Purpose::kVisibility},
                                                                         {"ao", Purpose::kAo},
                                                                         {"diffuse", Purpose::kDiffuse},
                                                                         {"glossy", Purpose::kGlossy},
                                                                         {"all", Purpose::kAll}}))
      ->default_str("all");
  app.add_flag(
      "--conservative", a.conservative,
      "With --for visibility: a shaft counts as empty only where no triangle touches it, so that exact "
      "rays may skip it (lsp-trace --skip-empty)");
  app.add_flag(
      "--directed", a.directed,
      "With --for visibility: a bit for either direction of a shaft, 30 N^4 and not 15 N^4; both are "
      "alike, what is inside does not depend on the direction");
  app.add_flag("--exact", a.exact, "Keep the exact tree below the Line Spaces (the default)");
  app.add_flag("--no-exact", a.no_exact, "Keep only what approximate rays need");
  app.add_flag("--no-line-spaces", a.no_line_spaces, "Bake the exact tree alone");
  app.add_option("--compress", a.compress,
                 "Pack the sections: a smaller file, which is unpacked into memory and not mapped")
      ->check(CLI::IsMember({"none", "zstd"}));
  app.add_option("--align", a.align, "Alignment of sections in bytes")
      ->check(CLI::IsMember({256, 4096, 65536}));
  app.add_option("--threads", a.threads, "Threads, 0: all cores");
  app.add_option("--memory-limit", a.memory_limit,
                 "Memory the bake may use, as 2GiB; Line Spaces beyond it wait in temporary files beside the "
                 "output; 0: no limit")
      ->transform(CLI::AsSizeValue(false));
  app.add_option(
         "--normal-angle", a.normal_angle,
         "Reject a plane hit whose extrapolated normal is further from the candidate's mean normal, in "
         "degrees; 180: never")
      ->check(CLI::Range(0.0f, 180.0f));
  app.add_option("--plane-tolerance", a.plane_tolerance,
                 "How far outside its box a plane hit may lie, in diagonals of the box")
      ->check(CLI::Range(0.0f, 1e6f));
  app.add_option("--crease-angle", a.crease_angle, "Smooth normals are made up to this angle, in degrees")
      ->check(CLI::Range(0.0f, 180.0f));
  app.add_flag("--strict", a.strict, "Refuse, with exit 3, an input that leads to any note");
  app.add_option("--depfile", a.depfile,
                 "Write a rule for Make and Ninja: OUT.lsp: every file that was read");
  app.add_flag("--no-splits", a.no_splits, "Build the tree without spatial splits");
  add_common_options(app, "lsp-bake", a.common);
  arrange_help(app, "lsp-bake room.gltf -o room.lsp --preset fast",
               {{"What most people need",
                 {"INPUT", "--output FILE", "--preset", "--max-error PERCENT", "--for", "--compress"}},
                {"Base structure", {"--base", "--cells", "--branching", "--levels", "--no-splits"}},
                {"Line Spaces",
                 {"--resolution", "--depth", "--triangles", "--samples", "--normal-angle DEGREES",
                  "--plane-tolerance", "--no-line-spaces", "--exact", "--no-exact"}},
                {"Line Spaces of --for visibility", {"--conservative", "--directed"}},
                {"What is read", {"--crease-angle DEGREES", "--strict", "--depfile FILE"}},
                {"The machine and the file", {"--threads", "--memory-limit", "--align"}}});
  return run_program("lsp-bake", app, argc, argv, [&] {
    a.resolution_given = resolution->count() > 0;
    a.depth_given = depth->count() > 0;
    a.samples_given = samples->count() > 0;
    return run(a);
  });
}
