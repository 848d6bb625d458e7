// lsp-sample-scene: writes a procedural scene as a binary glTF file.
#include <chrono>
#include <nlohmann/json.hpp>

#include "lsp/command_line.h"
#include "lsp/file_ending.h"
#include "lsp/json_result.h"
#include "lsp/output_file.h"
#include "scene.h"

int main(int argc, char** argv) {
  using namespace lsp;
  using namespace lsp::sample;
  constexpr const char* kProgram = "lsp-sample-scene";
  CLI::App app("Writes a procedural scene, in metres and with y up, as a binary glTF file.", kProgram);
  CommonOptions common;
  std::string output;
  std::string name = "atrium";
  uint64_t triangles = 0;
  bool no_masks = false;
  add_common_options(app, kProgram, common);
  app.add_option("OUT.glb", output, "The file to write")->required();
  app.add_option("--scene", name, "atrium, grove, spheres, plane, objects (512 in a room) or stadium")
      ->check(CLI::IsMember({"atrium", "grove", "spheres", "plane", "objects", "stadium"}));
  app.add_option("--triangles", triangles,
                 "About how many triangles, 1,000 to 20 million (default: as fine as looks good)")
      ->check(CLI::Range(uint64_t{1000}, uint64_t{20'000'000}));
  app.add_flag("--no-masks", no_masks, "Leave out the masks of leaves: cards are then solid");
  arrange_help(app, "lsp-sample-scene grove.glb --scene grove",
               {{"Options", {"OUT.glb", "--scene", "--triangles", "--no-masks"}}});
  return run_program(kProgram, app, argc, argv, [&] {
    if (const std::string ending = file_ending(output); !ending.empty() && ending != ".glb")
      throw Failure(Exit::kUsage, output, "scenes are written as .glb; choose such a name");
    check_output(output);
    const auto start = std::chrono::steady_clock::now();
    Scene scene = make_scene(name, triangles == 0 ? Detail{} : detail_for(name, triangles));
    if (no_masks && !take_masks_off(scene) && !common.quiet)
      std::cerr << kProgram << ": " << output << ": --no-masks does nothing: " << name << " has no masks\n";
    const std::string bytes = to_glb(scene);
    write_file(output, bytes);
    const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - start;
    if (common.json) {
      json_result() = {{"file", output},
                       {"scene", name},
                       {"triangles", triangle_count(scene)},
                       {"meshes", scene.meshes.size()},
                       {"nodes", scene.nodes.size()},
                       {"materials", scene.materials.size()},
                       {"bytes", bytes.size()},
                       {"seconds", seconds.count()}};
    } else if (!common.quiet) {
      std::cout << output << ": " << name << ", " << triangle_count(scene) << " triangles in "
                << scene.meshes.size() << " meshes and " << scene.nodes.size() << " nodes, " << bytes.size()
                << " bytes, " << seconds.count() << " s\n";
    }
  });
}
