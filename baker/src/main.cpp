// lsp-bake: turns meshes into an .lsp file.
#include <tbb/global_control.h>

#include <cstdio>
#include <iostream>
#include <map>
#include <nlohmann/json.hpp>

#include "color_materials.h"
#include "import/import.h"
#include "import/source_file.h"
#include "lsp/command_line.h"
#include "policy.h"
#include "provenance.h"
#include "report.h"
#include "shard/write_shard.h"
#include "temporary_file.h"
#include "timer.h"
#include "writer.h"

namespace {

using namespace lsp;
using Json = nlohmann::ordered_json;

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

Exit run(Arguments a) {
  settle(a);
  check_folder(a.output);
  std::unique_ptr<tbb::global_control> control;
  if (a.threads)
    control = std::make_unique<tbb::global_control>(tbb::global_control::max_allowed_parallelism, a.threads);
  ProgressBar bar(!a.common.quiet && !a.common.json);
  Timer timer;

  bar.show("import", 0);
  ImportOptions import_options;
  import_options.memory_limit = a.memory_limit;
  import_options.crease_angle_degrees = a.crease_angle;
  import_options.time = a.time;
  import_options.animation = a.animation;
  Mesh mesh = import_meshes(a.inputs, import_options);
  if (a.strict && !mesh.notes.empty()) refuse_notes(mesh);
  const auto source = hash_sources(mesh);
  const std::vector<std::string> material_names = names_of(mesh.materials);
  make_color_materials(mesh);
  const double import_seconds = timer();

  const WriteOptions write_options = {a.align, a.compress == "zstd", 12, a.memory_limit};
  if (!a.shard.empty()) {
    write_shard(a, {mesh, material_names, source, import_seconds}, write_options,
                [&](std::string_view stage, double done) { bar.show(stage, done); });
    if (!a.depfile.empty()) write_depfile(a, mesh);
    return Exit::kDone;
  }
  const auto meta_of = [&](const Chosen& c) {
    return provenance(a, c.baked, mesh, material_names, source, c.error);
  };
  Chosen chosen = bake_as_asked(
      mesh, a, [&](std::string_view stage, double done) { bar.show(stage, done); },
      [&](Chosen& c) { return lsp_bytes(c.baked, meta_of(c).dump(), write_options); });
  auto& [baked, error] = chosen;
  baked.header.source_hash_lo = source[0];
  baked.header.source_hash_hi = source[1];
  timer();

  bar.show("write", 0);
  const Json meta = meta_of(chosen);
  const Written written = write_lsp(a.output, baked, meta.dump(), write_options);
  if (!a.depfile.empty()) write_depfile(a, mesh);
  const double write_seconds = timer();
  bar.clear();

  const BakeReport report = {a, mesh, baked, error, written, import_seconds, write_seconds};
  if (a.common.json)
    std::cout << report_json(report, meta).dump(2) << "\n";
  else if (!a.common.quiet)
    print_report(report);
  return Exit::kDone;
}

}  // namespace

int main(int argc, char** argv) {
  Arguments a;
  CLI::App app("Bakes meshes (.gltf .glb .obj .ply .stl .off) into an .lsp file.", "lsp-bake");
  app.option_defaults()->always_capture_default();
  app.add_option("INPUT", a.inputs, "Mesh files, read in this order")->required();
  app.add_option("-o,--output", a.output, "The .lsp file to write")->required();
  app.add_option(
         "--base", a.base,
         "Base structure: cells, answered from tables and traced exactly where these lose; or a tree with "
         "Line Spaces, bvh or ntree. Where it is left out: cells, but bvh with an option of Line Spaces")
      ->check(CLI::IsMember({"cells", "bvh", "ntree"}));
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
  app.add_option("--max-size", a.max_size,
                 "The longest file, as 20MB: where it would be longer, a coarser grid of cells; 0: any")
      ->transform(CLI::AsSizeValue(true));
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
  auto* time = app.add_option("--time", a.time,
                              "Pose glTF scenes at this time of an animation, in seconds; else they are at "
                              "rest")
                   ->check(CLI::Range(-1e9, 1e9));
  app.add_option("--animation", a.animation,
                 "With --time: the animation, by its name or its number from 0; else each file's first")
      ->needs(time);
  app.add_flag("--strict", a.strict, "Refuse, with exit 3, an input that leads to any note");
  app.add_option("--depfile", a.depfile,
                 "Write a rule for Make and Ninja: OUT.lsp: every file that was read");
  app.add_option(
      "--shard", a.shard,
      "Bake share I of K of the cells, and write it as a part that lsp-merge joins with the others");
  app.add_flag("--no-splits", a.no_splits, "Build the tree without spatial splits");
  add_common_options(app, "lsp-bake", a.common);
  arrange_help(
      app, "lsp-bake room.gltf -o room.lsp --preset fast",
      {{"What most people need",
        {"INPUT", "--output FILE", "--preset", "--max-error PERCENT", "--max-size", "--for", "--compress"}},
       {"Base structure", {"--base", "--cells", "--branching", "--levels", "--no-splits"}},
       {"Line Spaces",
        {"--resolution", "--depth", "--triangles", "--samples", "--normal-angle DEGREES", "--plane-tolerance",
         "--no-line-spaces", "--exact", "--no-exact"}},
       {"What is read",
        {"--time SECONDS", "--animation NAME", "--crease-angle DEGREES", "--strict", "--depfile FILE"}},
       {"The machine and the file", {"--threads", "--memory-limit", "--align", "--shard I/K"}}});
  return run_program("lsp-bake", app, argc, argv, [&] {
    a.resolution_given = resolution->count() > 0;
    a.depth_given = depth->count() > 0;
    a.samples_given = samples->count() > 0;
    return run(a);
  });
}
