// lsp-bench: run time against error, for scenes given as meshes or .lsp files.
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>

#include "answers.h"
#include "context.h"
#include "lsp/command_line.h"
#include "lsp/in_chunks.hpp"
#include "lsp/json_result.h"
#include "lsp/output_file.h"
#include "machine.h"
#include "timing.h"

namespace lsp::bench {
namespace {

struct Arguments {
  std::vector<std::string> scenes;
  std::vector<std::string> suites;
  std::string output;
  bool quick = false;
  bool large = false;
  bool no_vulkan = false;
  unsigned threads = 0;
};

struct Suite {
  const char* name;
  Section (*run)(Context&);
};
constexpr Suite kSuites[] = {{"pareto", pareto_suite},      {"peers", peers_suite},
                             {"paper", paper_suite},        {"pictures", pictures_suite},
                             {"scaling", scaling_suite},    {"stress", stress_suite},
                             {"instances", instances_suite}};

bool wants(const Arguments& arguments, const std::string& suite) {
  return arguments.suites.empty() ||
         std::find(arguments.suites.begin(), arguments.suites.end(), suite) != arguments.suites.end();
}

// What the run has used so far: this process and the programs that it ran.
struct Cost {
  double wall = 0, cpu = 0;
  static Cost so_far() {
    Cost cost{seconds_since_start(), 0};
    for (const int who : {RUSAGE_SELF, RUSAGE_CHILDREN}) {
      rusage usage{};
      getrusage(who, &usage);
      for (const timeval& time : {usage.ru_utime, usage.ru_stime})
        cost.cpu += static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_usec);
    }
    return cost;
  }
};

// Two inputs may have one stem; what is measured may not have one name.
std::string unique_name(const Context& context, const std::string& scene) {
  const std::string stem = std::filesystem::path(scene).stem().string();
  const auto taken = [&](const std::string& name) {
    return std::any_of(context.scenes.begin(), context.scenes.end(),
                       [&](const auto& other) { return other->name() == name; });
  };
  std::string name = stem;
  for (int k = 2; taken(name); ++k) name = stem + "-" + std::to_string(k);
  return name;
}

// The run's report as far as it has come.
class RunningReport {
 public:
  RunningReport(Context& context, std::filesystem::path directory)
      : context_(context), directory_(std::move(directory)) {
    report_.title = "Line Spaces: run time against error";
    costs_ = {
        "costs",
        "Seconds that this report took",
        "Processor time is that of all threads and of the programs that were run, bakes for the most part.",
        {{"suite", "suite"}, {"wall", "wall clock", 1}, {"cpu", "processor", 1}},
        {}};
  }

  Json& facts() { return report_.facts; }
  const Report& report() const { return report_; }

  void add_cost(const std::string& what, const Cost& since) {
    const Cost now = Cost::so_far();
    costs_.rows.push_back({{"suite", what}, {"wall", now.wall - since.wall}, {"cpu", now.cpu - since.cpu}});
  }

  // Whatever comes later, what is there by now stands in the folder.
  void write(const std::vector<Section>& sections, bool finished) {
    report_.answers = sentences(context_.answers);
    report_.warnings = context_.warnings;
    size_t bakes = 0, earlier = 0;
    for (const auto& scene : context_.scenes) {
      for (const auto& [name, baked] : scene->bakes()) {
        bakes += baked.available && !scene->is_file();
        earlier += baked.from_earlier_run;
      }
    }
    report_.facts["bakes"] = std::to_string(bakes);
    if (earlier > 0) {
      report_.warnings.insert(
          report_.warnings.begin(),
          "Of " + std::to_string(bakes) + " bakes " + std::to_string(earlier) +
              " are from an earlier run with the same program, input and options; so are their "
              "times and memory. Remove the subfolder bakes to measure them anew.");
    }
    report_.facts["run time"] = std::to_string(static_cast<int>(seconds_since_start())) + " s" +
                                (context_.quick ? ", --quick" : "") + (context_.large ? ", --large" : "") +
                                (finished ? "" : "; the run has not ended yet");
    report_.sections = sections;
    Section cost{"cost", "What this report took", {}, {}, {}, {costs_}};
    report_.sections.push_back(cost);
    report_.sections.push_back(answers_section(context_.answers));
    write_report(report_, directory_);
  }

 private:
  Context& context_;
  std::filesystem::path directory_;
  Report report_;
  Table costs_;
};

void add_scenes(Context& context, const Arguments& arguments) {
  for (const std::string& scene : arguments.scenes) {
    if (!std::filesystem::exists(scene)) throw Failure(Exit::kFile, scene, "does not exist; check the path");
  }
  std::error_code error;
  std::filesystem::create_directories(context.cache, error);
  if (error)
    throw Failure(Exit::kFile, context.cache.string(),
                  "cannot be made: " + error.message() + "; give another folder with -o");
  for (const char* name : {"report.html", "report.json"}) check_output(context.cache.parent_path() / name);
  for (const std::string& scene : arguments.scenes) {
    context.progress("bake " + scene);
    try {
      context.scenes.push_back(std::make_unique<SceneUnderTest>(scene, context.cache, context.base_bake(),
                                                                unique_name(context, scene)));
    } catch (const Failure& failure) {
      context.warnings.push_back(scene + ": left out: " + failure.what());
      if (!context.first_failure) context.first_failure = failure;
    }
  }
  if (context.scenes.empty()) throw *context.first_failure;
}

void run(const Arguments& arguments, const CommonOptions& common) {
  namespace fs = std::filesystem;
  if (arguments.large && !common.quiet && !wants(arguments, "paper"))
    std::cerr << "lsp-bench: --large does nothing: of the suites only paper has more for it\n";
  Context context;
  context.quick = arguments.quick;
  context.large = arguments.large;
  context.cache = fs::path(arguments.output) / "bakes";
  context.threads = arguments.threads ? arguments.threads : machine_threads();
  context.answers.threads = context.threads;
  const bool show = !common.quiet && isatty(2);
  context.progress = [show](const std::string& what) {
    if (show)
      std::cerr << "\r\033[K" << static_cast<int>(seconds_since_start()) << " s  " << what << std::flush;
  };
  seconds_since_start();
  RunningReport running(context, arguments.output);
  running.facts() = machine_facts();
  running.facts()["threads"] = context.threads;
  running.facts()["repeats"] = context.quick ? "3" : "5, after the first 15 minutes 3; a warm-up before them";
  if (machine_load() > 0.5) {
    context.warnings.push_back("The machine was busy before the run began (load " +
                               std::to_string(machine_load()) +
                               "): believe ratios of one table, not absolute speeds.");
  }
  std::string why = "switched off";
  if (!arguments.no_vulkan && VulkanTracer::available(&why)) {
    context.vulkan = std::make_unique<VulkanTracer>();
    context.answers.device = context.vulkan->device_name();
    running.facts()["Vulkan"] = context.answers.device;
  } else {
    running.facts()["Vulkan"] = "not measured: " + why;
  }
  Cost cost = Cost::so_far();
  add_scenes(context, arguments);
  running.add_cost("first bakes, truth", cost);
  std::vector<Section> sections;
  for (const Suite& suite : kSuites) {
    if (!wants(arguments, suite.name)) continue;
    cost = Cost::so_far();
    Section section{suite.name, suite.name, {}, {}, {}, {}};
    context.guarded(section, "the whole suite", [&] { section = suite.run(context); });
    sections.push_back(std::move(section));
    running.add_cost(suite.name, cost);
    running.write(sections, false);
  }
  running.write(sections, true);
  const Report& report = running.report();
  if (show) std::cerr << "\r\033[K";
  if (common.json) {
    json_result() = to_json(report);
  } else if (!common.quiet) {
    for (const std::string& answer : report.answers) std::cout << answer << "\n";
    for (const std::string& warning : report.warnings) std::cout << "warning: " << warning << "\n";
    std::cout << "report: " << (fs::path(arguments.output) / "report.html").string() << "\n";
  }
  if (context.first_failure) {
    throw Failure(context.first_failure->exit(), context.first_failure->file(),
                  std::string(context.first_failure->what()) + "; the report has everything else");
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
  app.add_option(
         "-o,--output", arguments.output,
         "Folder for the report, in place of one that is there: its tables, plots and pictures go. Bakes "
         "are in the subfolder bakes, where a later run finds them")
      ->required();
  app.add_option("--suite", arguments.suites,
                 "paper, pareto, scaling, peers, stress, pictures or instances; may be repeated (default: "
                 "all; of six "
                 "scenes on two cores that is more than half an hour)")
      ->allow_extra_args(false)  // a word behind it may be a scene
      ->check(CLI::IsMember({"paper", "pareto", "scaling", "peers", "stress", "pictures", "instances"}));
  app.add_flag("--quick", arguments.quick,
               "Fewer rays, bakes, sizes and pictures: a few minutes for six scenes");
  app.add_flag("--large", arguments.large, "In the paper's table also what takes gigabytes a scene");
  app.add_flag("--no-vulkan", arguments.no_vulkan, "Measure the CPU only");
  add_threads(app, arguments.threads, "What 'all threads' means");
  arrange_help(app, "lsp-bench room.gltf -o report --quick",
               {{"What most people need",
                 {"SCENE", "--output FOLDER", "--suite", "--quick", "--no-vulkan", "--threads"}},
                {"What takes long", {"--large"}}});
  return run_program("lsp-bench", app, argc, argv, [&] { bench::run(arguments, common); });
}
