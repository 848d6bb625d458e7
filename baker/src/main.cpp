// lsp-bake: turns meshes into an .lsp file, or into several and a scene of them.
#include <tbb/global_control.h>

#include <map>
#include <memory>
#include <nlohmann/json.hpp>

#include "bake_file.h"
#include "bake_scene.h"
#include "color_materials.h"
#include "lsp/command_line.h"
#include "lsp/json_result.h"
#include "lsp/output_file.h"
#include "provenance.h"
#include "report.h"
#include "shard/write_shard.h"
#include "timer.h"

namespace {

using namespace lsp;

void bake_one(Arguments& a, ProgressBar& bar) {
  Timer timer;
  bar.show("import", 0);
  Mesh mesh = import_meshes(a.inputs, import_options(a));
  for (const auto& files : mesh.sources) check_outputs(a, files);
  if (a.strict) refuse_notes(mesh.notes, a);
  const auto source = hash_sources(mesh);
  const double import_seconds = timer();
  if (!a.shard.empty()) {
    const std::vector<std::string> names = names_of(mesh.materials);
    make_color_materials(mesh);
    write_shard(a, {mesh, names, source, import_seconds}, write_options(a),
                [&](std::string_view stage, double share) { bar.show(stage, share); });
    return;
  }

  const FileBake done = bake_file(mesh, a, source, nullptr,
                                  [&](std::string_view stage, double share) { bar.show(stage, share); });
  if (!a.depfile.empty()) write_depfile(a, mesh.sources);  // where it cannot be, the old output stays
  done.file->commit();
  bar.clear();

  const BakeReport report = {
      a, mesh, done.chosen.baked, done.chosen.error, done.written, import_seconds, done.write_seconds};
  if (a.common.json)
    json_result() = report_json(report, done.meta);
  else if (!a.common.quiet)
    print_report(report);
}

void run(Arguments a) {
  settle(a);
  check_outputs(a, a.inputs);
  std::unique_ptr<tbb::global_control> control;
  if (a.threads)
    control = std::make_unique<tbb::global_control>(tbb::global_control::max_allowed_parallelism, a.threads);
  ProgressBar bar(!a.common.quiet && !a.common.json);
  if (a.instances)
    bake_scene(a, bar);
  else
    bake_one(a, bar);
}

const std::map<std::string, Purpose> kPurposes = {{"visibility", Purpose::kVisibility},
                                                  {"ao", Purpose::kAo},
                                                  {"diffuse", Purpose::kDiffuse},
                                                  {"glossy", Purpose::kGlossy},
                                                  {"all", Purpose::kAll}};

// The options, by the groups of --help.
void add_main_options(CLI::App& app, Arguments& a) {
  app.add_option("INPUT", a.inputs, "Mesh files, read in this order")->required();
  app.add_option("-o,--output", a.output, "The .lsp file to write; with --instances the scene, .json")
      ->required();
  app.add_flag(
      "--instances", a.instances,
      "Bake every mesh of glTF scenes once, however often nodes place it, to NAME.MESH.lsp beside -o "
      "NAME.json, the scene with all places; every other file is one asset and one instance. All "
      "options hold for each asset");
  app.add_option("--preset", a.preset,
                 "Fast to bake, or accurate: tables that take longer to fill, and leave less to be traced "
                 "exactly. Of Line Spaces --resolution, --depth and --samples overrule it")
      ->check(CLI::IsMember({"fast", "balanced", "accurate"}));
  app.add_option(
         "--max-error", a.max_error,
         "Rays answered wrongly at most, in per cent: the cheapest setting that keeps to it, of cells the "
         "point of the dial that balanced is; 0: as --preset says")
      ->check(CLI::Range(0.0, 100.0));
  add_size_option(
      app, "--max-size", a.max_size,
      "The largest file, as 20MB: where it would be larger, a coarser grid of cells; 0: any. With "
      "--instances of each asset",
      true);
  app.add_option_function<std::string>(
         "--for", [&a](const std::string& word) { a.purpose = kPurposes.at(word); },
         "What the file is for: what nobody needs then is left out")
      ->check(CLI::IsMember(kPurposes))
      ->default_str("all");
  app.add_option("--compress", a.compress,
                 "Pack the sections: a smaller file, which is unpacked into memory and not mapped")
      ->check(CLI::IsMember({"none", "zstd"}));
}

void add_base_options(CLI::App& app, Arguments& a) {
  app.add_option(
         "--base", a.base,
         "Base structure: cells, answered from tables and traced exactly where these lose; a tree with "
         "Line Spaces, bvh or ntree; or wide, the tree for exact rays alone. Where it is left out: cells as "
         "fine as they are worth it, wide where none are, and bvh with an option of Line Spaces")
      ->check(CLI::IsMember({"cells", "bvh", "ntree", "wide"}));
  app.add_option("--cells", a.cells,
                 "Cells along the longest side of the grid of --base cells; 0: chosen from the scene")
      ->check(CLI::Range(0u, LSP_MAX_CELLS));
  app.add_option("--branching", a.branching, "NTree: cells along an edge of a node; 0: as --resolution")
      ->check(CLI::IsMember({0}) | CLI::Range(2u, LSP_MAX_BRANCHING));
  app.add_option("--levels", a.levels, "NTree: levels of nodes")->check(CLI::Range(1u, LSP_MAX_NTREE_DEPTH));
  app.add_flag("--no-splits", a.no_splits, "Build the tree without spatial splits");
}

void add_line_space_options(CLI::App& app, Arguments& a) {
  app.add_option("--resolution", a.resolution, "N: patches along an edge of a Line Space's box")
      ->check(CLI::Range(1u, LSP_MAX_RESOLUTION));
  app.add_option("--depth", a.depths,
                 "D: depth of the nodes with a Line Space; several, as 6,9,12, give levels of "
                 "detail; an NTree's is 1 "
                 "where nothing is said")
      ->delimiter(',')
      ->check(CLI::Range(0u, 40u));
  app.add_option("--triangles", a.triangles, "T: nodes above D with fewer triangles get a Line Space too");
  app.add_option("--samples", a.samples,
                 "Rays that choose a shaft's candidate; 1: the centroid ray alone, as the paper does")
      ->check(CLI::Range(1u, 64u));
  app.add_option(
         "--normal-angle", a.normal_angle,
         "Reject a plane hit whose extrapolated normal is further from the candidate's mean normal, in "
         "degrees; 180: never")
      ->check(CLI::Range(0.0f, 180.0f));
  app.add_option("--plane-tolerance", a.plane_tolerance,
                 "How far outside its box a plane hit may lie, in diagonals of the box")
      ->check(CLI::Range(0.0f, 1e6f));
  app.add_flag("--exact", a.exact, "Keep the exact tree below the Line Spaces (the default)");
  app.add_flag("--no-exact", a.no_exact, "Keep only what approximate rays need");
  app.add_flag("--no-line-spaces", a.no_line_spaces, "Bake the exact tree alone");
}

void add_reading_options(CLI::App& app, Arguments& a) {
  app.add_option("--crease-angle", a.crease_angle, "Smooth normals are made up to this angle, in degrees")
      ->check(CLI::Range(0.0f, 180.0f));
  auto* time = app.add_option("--time", a.time,
                              "Pose glTF scenes at this time of an animation, in seconds; else they are at "
                              "rest")
                   ->check(CLI::Range(-1e9, 1e9));
  app.add_option("--animation", a.animation,
                 "With --time: the animation, by its name or its number from 0; else each file's first")
      ->needs(time);
  app.add_flag("--strict", a.strict, "Refuse, with exit 3, an input that leads to any note");
  app.add_option("--depfile", a.depfile,
                 "Write a rule for Make and Ninja: OUT.lsp (or NAME.json): every file that was read");
}

void add_machine_options(CLI::App& app, Arguments& a) {
  app.add_option("--align", a.align, "Alignment of sections in bytes; 0: 4096, of the smallest files 256")
      ->check(CLI::IsMember({0, 256, 4096, 65536}));
  add_threads(app, a.threads, "Threads");
  add_size_option(
      app, "--memory-limit", a.memory_limit,
      "Memory the bake may use, as 2GiB; Line Spaces beyond it wait in temporary files beside the "
      "output; 0: no limit");
  app.add_option("--shard", a.shard,
                 "Bake share I of K of the cells, I from 1, and write it to -o as a part; lsp-merge joins "
                 "all K, from as "
                 "many machines, into the file of one bake");
}

void arrange_options(CLI::App& app) {
  arrange_help(
      app, "lsp-bake room.gltf -o room.lsp --preset fast",
      {{"What most people need",
        {"INPUT", "--output FILE", "--preset", "--max-error PERCENT", "--max-size", "--for", "--compress",
         "--instances"}},
       {"Base structure", {"--base", "--cells", "--branching", "--levels", "--no-splits"}},
       {"Line Spaces",
        {"--resolution", "--depth", "--triangles", "--samples", "--normal-angle DEGREES", "--plane-tolerance",
         "--no-line-spaces", "--exact", "--no-exact"}},
       {"What is read",
        {"--time SECONDS", "--animation NAME", "--crease-angle DEGREES", "--strict", "--depfile FILE"}},
       {"The machine and the file", {"--threads", "--memory-limit", "--align", "--shard I/K"}}});
}

}  // namespace

int main(int argc, char** argv) {
  Arguments a;
  CLI::App app("Bakes meshes (.gltf .glb .obj .ply .stl .off) into an .lsp file, or into a scene of several.",
               "lsp-bake");
  app.option_defaults()->always_capture_default();
  add_main_options(app, a);
  add_base_options(app, a);
  add_line_space_options(app, a);
  add_reading_options(app, a);
  add_machine_options(app, a);
  add_common_options(app, "lsp-bake", a.common);
  arrange_options(app);
  return run_program("lsp-bake", app, argc, argv, [&] {
    a.resolution_given = app.count("--resolution") > 0;
    a.depth_given = app.count("--depth") > 0;
    a.samples_given = app.count("--samples") > 0;
    run(a);
  });
}
