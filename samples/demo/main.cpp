// lsp-demo-report: one self-contained HTML page about a bake and two renderings of it, for samples/demo.sh.
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <optional>
#include <sstream>
#include <vector>

#include "lsp/command_line.h"
#include "lsp/json_result.h"
#include "lsp/output_file.h"
#include "page.h"

namespace lsp::sample {
namespace {

std::string read_file(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  std::ostringstream bytes;
  bytes << file.rdbuf();
  if (!file) throw Failure(Exit::kFile, path, "cannot be read; run samples/demo.sh, which writes it");
  return bytes.str();
}

nlohmann::json read_json(const std::string& path) {
  const nlohmann::json json = nlohmann::json::parse(read_file(path), nullptr, false);
  if (json.is_discarded()) throw Failure(Exit::kInvalid, path, "is not JSON; run samples/demo.sh again");
  return json;
}

std::string read_png(const std::string& path) {
  std::string bytes = read_file(path);
  if (!bytes.starts_with("\x89PNG\r\n"))
    throw Failure(Exit::kInvalid, path, "is no .png picture; run samples/demo.sh again");
  return bytes;
}

constexpr const char* kDial[] = {"fast", "balanced", "accurate", "30", "10", "3", "1"};

// All that the page may be made of.
std::vector<std::filesystem::path> inputs_in(const std::filesystem::path& folder) {
  std::vector<std::filesystem::path> inputs;
  for (const char* name : {"bake.json", "exact.json", "approx.json", "compare.json", "curve_exact.json",
                           "exact.png", "approx.png", "difference.png"})
    inputs.push_back(folder / name);
  for (const std::string name : kDial)
    for (const char* kind : {"curve_", "curve_compare_"}) inputs.push_back(folder / (kind + name + ".json"));
  return inputs;
}

}  // namespace
}  // namespace lsp::sample

int main(int argc, char** argv) {
  using namespace lsp;
  using namespace lsp::sample;
  constexpr const char* kProgram = "lsp-demo-report";
  CLI::App app("Writes the demo's page from the figures and pictures in a folder.", kProgram);
  CommonOptions common;
  std::string folder;
  std::string output;
  std::string title = "scene";
  std::optional<double> validate_seconds;
  add_common_options(app, kProgram, common);
  app.add_option(
         "FOLDER", folder,
         "With bake.json, exact.json, approx.json, compare.json and the pictures; for the dial's curve "
         "curve_exact.json, curve_NAME.json and curve_compare_NAME.json, NAME a quality or a largest loss of "
         "30, 10, 3 or 1")
      ->required();
  app.add_option("-o,--output", output, "The page")->required();
  app.add_option("--title", title, "What was baked");
  app.add_option("--validate-seconds", validate_seconds, "Time of lsp-validate (default: the page has none)")
      ->check(CLI::Range(0.0, 1e9));
  arrange_help(app, "lsp-demo-report out/demo -o out/demo/report.html --title 'the atrium'",
               {{"Options", {"FOLDER", "--output FILE", "--title", "--validate-seconds SECONDS"}}});
  return run_program(kProgram, app, argc, argv, [&] {
    check_output(output, inputs_in(folder));
    try {
      Figures figures{title,
                      validate_seconds,
                      read_json(folder + "/bake.json"),
                      read_json(folder + "/exact.json"),
                      read_json(folder + "/approx.json"),
                      read_json(folder + "/compare.json"),
                      {},
                      {}};
      if (std::filesystem::exists(folder + "/curve_exact.json")) {
        figures.curve_exact = read_json(folder + "/curve_exact.json");
        for (const std::string name : kDial) {
          const std::string point = folder + "/curve_" + name + ".json";
          if (!std::filesystem::exists(point)) continue;
          figures.curve.push_back(
              {name, read_json(point), read_json(folder + "/curve_compare_" + name + ".json")});
        }
      }
      const Pictures pictures{read_png(folder + "/exact.png"), read_png(folder + "/approx.png"),
                              read_png(folder + "/difference.png")};
      write_file(output, make_page(figures, pictures));
      if (common.json) {
        json_result() = {{"report", output}};
      } else if (!common.quiet) {
        std::cout << make_summary(figures) << "report: " << output << "\n";
      }
    } catch (const nlohmann::json::exception& e) {
      throw Failure(
          Exit::kInvalid, folder,
          std::string("a figure is missing or of another kind: ") + e.what() + "; run samples/demo.sh again");
    }
  });
}
