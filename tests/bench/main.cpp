// lsp-bench: run time against error, for scenes given as meshes or .lsp files.
#include <unistd.h>

#include <algorithm>
#include <filesystem>

#include "context.h"
#include "lsp/command_line.h"
#include "machine.h"

namespace lsp::bench {
namespace {

struct Arguments {
  std::vector<std::string> scenes;
  std::vector<std::string> suites;
  std::string output;
  bool quick = false;
  bool no_vulkan = false;
  unsigned threads = 0;
};

struct Suite {
  const char* name;
  Section (*run)(Context&);
};
constexpr Suite kSuites[] = {{"pareto", pareto_suite},   {"peers", peers_suite},
                             {"paper", paper_suite},     {"pictures", pictures_suite},
                             {"scaling", scaling_suite}, {"stress", stress_suite}};

void run(const Arguments& arguments, const CommonOptions& common) {
  namespace fs = std::filesystem;
  Context context;
  context.quick = arguments.quick;
  context.cache = fs::path(arguments.output) / "bakes";
  context.threads = arguments.threads ? arguments.threads : machine_threads();
  const bool show = !common.quiet && isatty(2);
  context.progress = [show](const std::string& what) {
    if (show)
      std::cerr << "\r\033[K" << static_cast<int>(seconds_since_start()) << " s  " << what << std::flush;
  };
  seconds_since_start();
  Report report;
  report.title = "Line Spaces: run time against error";
  report.facts = machine_facts();
  report.facts["threads"] = context.threads;
  if (machine_load() > 0.5) {
    context.warnings.push_back("The machine was busy before the run began (load " +
                               std::to_string(machine_load()) +
                               "): believe ratios of one table, not absolute speeds.");
  }
  std::string why = "switched off";
  if (!arguments.no_vulkan && VulkanTracer::available(&why)) {
    context.vulkan = std::make_unique<VulkanTracer>();
    report.facts["Vulkan"] = context.vulkan->device_name();
  } else {
    report.facts["Vulkan"] = "not measured: " + why;
  }
  for (const std::string& scene : arguments.scenes) {
    if (!fs::exists(scene)) throw Failure(Exit::kFile, scene, "does not exist");
  }
  for (const std::string& scene : arguments.scenes) {
    context.progress("bake " + scene);
    context.scenes.push_back(std::make_unique<SceneUnderTest>(scene, context.cache, context.base_bake()));
  }
  for (const Suite& suite : kSuites) {
    if (!arguments.suites.empty() &&
        std::find(arguments.suites.begin(), arguments.suites.end(), suite.name) == arguments.suites.end()) {
      continue;
    }
    report.sections.push_back(suite.run(context));
  }
  report.answers = context.answers;
  report.warnings = context.warnings;
  report.facts["run time"] =
      std::to_string(static_cast<int>(seconds_since_start())) + " s" + (context.quick ? ", --quick" : "");
  write_report(report, arguments.output);
  if (show) std::cerr << "\r\033[K";
  if (common.json) {
    std::cout << to_json(report).dump(1) << "\n";
  } else if (!common.quiet) {
    for (const std::string& answer : report.answers) std::cout << answer << "\n";
    for (const std::string& warning : report.warnings) std::cout << "warning: " << warning << "\n";
    std::cout << "report: " << (fs::path(arguments.output) / "report.html").string() << "\n";
  }
}

}  // namespace
}  // namespace lsp::bench

int main(int argc, char** argv) {
  using namespace lsp;
  bench::Arguments arguments;
  CommonOptions common;
  CLI::App app("Measures run time against error and writes JSON, CSV, pictures and one HTML page.");
  add_common_options(app, "lsp-bench", common);
  app.add_option("SCENE", arguments.scenes,
                 "Mesh files, baked in several ways, or .lsp files, measured as they are")
      ->required();
  app.add_option("-o,--output", arguments.output, "Folder for the report; bakes go to its subfolder bakes")
      ->required();
  app.add_option("--suite", arguments.suites,
                 "paper, pareto, scaling, peers, stress or pictures; may be repeated (default: all)")
      ->check(CLI::IsMember({"paper", "pareto", "scaling", "peers", "stress", "pictures"}));
  app.add_flag("--quick", arguments.quick, "Fewer rays, bakes and sizes: minutes become seconds");
  app.add_flag("--no-vulkan", arguments.no_vulkan, "Measure the CPU only");
  app.add_option("--threads", arguments.threads, "What 'all threads' means (default: all)")
      ->check(CLI::Range(1, 1024));
  return run_program("lsp-bench", app, argc, argv, [&] { bench::run(arguments, common); });
}
