// lsp-validate: says whether an .lsp file may be trusted, and everything that is wrong with it.
#include <lsp/program.h>

#include <cstdio>
#include <nlohmann/json.hpp>
#include <sstream>

#include "check.h"
#include "file.h"
#include "lsp/command_line.h"
#include "lsp/json_result.h"
#include "source.h"

namespace {

using namespace lsp;
using namespace lsp::format;

struct Arguments {
  std::vector<std::string> files;
  std::string level = "structure";
  std::vector<std::filesystem::path> meshes;
  uint64_t memory_limit = uint64_t{8} << 30;
  uint32_t examples = 4;
  bool rules = false;
};

// What the last line says to do about each verdict.
const char* advice(Verdict verdict) {
  switch (verdict) {
    case Verdict::kValid:
      return "";
    case Verdict::kInvalid:
      return "is not valid, do not use it: copy or bake it again";
    case Verdict::kUnsupported:
      return "was not checked, it is of a version or has features that this program does not know";
    case Verdict::kLimit:
      return "was not checked in full: raise --memory-limit";
    case Verdict::kDiffer:
      return "is valid, but was not baked from these source files: bake it again";
  }
  return "";
}

// What is to be said of a file.
struct Outcome {
  Exit exit = Exit::kDone;
  std::string text;   // findings, a line each
  std::string error;  // empty where the file is valid
  nlohmann::ordered_json json;
};

Outcome check(const std::string& path, const Arguments& arguments) {
  const MappedFile file(path);
  CheckOptions options;
  options.level = arguments.level == "container"  ? Level::kContainer
                  : arguments.level == "geometry" ? Level::kGeometry
                                                  : Level::kStructure;
  options.memory_limit = arguments.memory_limit;
  options.examples_per_rule = arguments.examples;
  if (!arguments.meshes.empty()) options.source = hash_sources(arguments.meshes, file.bytes());
  const Report report = check_file(file.bytes(), options);
  const Verdict verdict = report.verdict();

  Outcome outcome;
  outcome.exit = exit_code(verdict);
  outcome.text = to_text(report);
  const uint64_t errors = report.count(Severity::kFatal) + report.count(Severity::kError);
  if (verdict != Verdict::kValid) {
    outcome.error =
        std::string(advice(verdict)) + " (" + std::to_string(errors) + (errors == 1 ? " error)" : " errors)");
  }
  outcome.json["program"] = "lsp-validate";
  outcome.json["version"] = kProgramVersion;
  outcome.json["file"] = path;
  outcome.json["bytes"] = file.bytes().size();
  outcome.json["level"] = arguments.level;
  outcome.json.update(to_json(report));
  if (!outcome.error.empty()) outcome.json["error"] = outcome.error;
  return outcome;
}

// One of several, which the others do not have to suffer for.
Outcome check_or_say_why(const std::string& path, const Arguments& arguments) {
  try {
    return check(path, arguments);
  } catch (const Failure& failure) {
    const int exit = static_cast<int>(failure.exit());
    return {failure.exit(), "", failure.what(), {{"file", path}, {"exit", exit}, {"error", failure.what()}}};
  }
}

Ending validate_one(const std::string& path, const Arguments& arguments, const CommonOptions& common) {
  const Outcome outcome = check(path, arguments);
  if (common.json)
    json_result() = outcome.json;
  else if (!common.quiet)
    std::fputs(outcome.text.c_str(), stdout);
  return {outcome.exit, path, outcome.error};
}

// The exit code is that of the first file that is not valid; every file is checked.
Ending validate_all(const Arguments& arguments, const CommonOptions& common) {
  if (!arguments.meshes.empty())
    throw Failure(Exit::kUsage, "", "--mesh is of one file; check the others by themselves");
  Ending ending;
  size_t bad = 0;
  nlohmann::ordered_json files = nlohmann::ordered_json::array();
  for (const std::string& path : arguments.files) {
    const Outcome outcome = check_or_say_why(path, arguments);
    std::istringstream lines(common.json || common.quiet ? "" : outcome.text);
    for (std::string line; std::getline(lines, line);) std::printf("%s: %s\n", path.c_str(), line.c_str());
    files.push_back(outcome.json);
    if (outcome.exit == Exit::kDone) continue;
    if (bad++ == 0) ending.exit = outcome.exit;
    std::fprintf(stderr, "lsp-validate: %s: %s\n", path.c_str(), outcome.error.c_str());
  }
  json_result() = {{"files", files}};
  if (bad > 0)
    ending.error =
        std::to_string(bad) + " of " + std::to_string(files.size()) + " files cannot be used as they are";
  return ending;
}

Ending validate(const Arguments& arguments, const CommonOptions& common) {
  if (arguments.rules) {
    if (common.json) throw Failure(Exit::kUsage, "", "--rules is Markdown; leave --json out");
    if (!arguments.files.empty())
      throw Failure(Exit::kUsage, arguments.files.front(), "--rules checks no file; leave out either");
    std::fputs(rules_markdown().c_str(), stdout);
    return {};
  }
  if (arguments.files.empty()) throw Failure(Exit::kUsage, "", "FILE.lsp is missing, see --help");
  return arguments.files.size() == 1 ? validate_one(arguments.files[0], arguments, common)
                                     : validate_all(arguments, common);
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app(
      "Checks .lsp files and reports everything that is wrong with them.\n"
      "Silent on success. Exit codes: 0 valid, 1 usage, 2 cannot be read, 3 invalid, 4 internal error, "
      "5 needs a newer program, 6 over the memory limit, 7 not baked from the files of --mesh; of several "
      "files the code of the first that is not valid.",
      "lsp-validate");
  Arguments arguments;
  CommonOptions common;
  app.add_option("FILE.lsp", arguments.files,
                 "The files to check; of several, each line begins with its file's name");
  app.add_option("--level", arguments.level,
                 "How deep: container (header, sections, hashes), structure (and all that a tracer's indices "
                 "follow), "
                 "geometry (and every triangle, normal and material)")
      ->check(CLI::IsMember({"container", "structure", "geometry"}))
      ->capture_default_str();
  app.add_option("--mesh", arguments.meshes,
                 "The source files, in the order of the bake: is the bake stale?");
  add_size_option(app, "--memory-limit", arguments.memory_limit,
                  "Memory that the sections of a packed file may take, as 512MB (default 8GiB)");
  app.add_option("--examples", arguments.examples, "How many findings of a rule are printed")
      ->capture_default_str();
  app.add_flag("--rules", arguments.rules, "Print the rule catalogue as Markdown and end");
  add_common_options(app, "lsp-validate", common);
  arrange_help(
      app, "lsp-validate room.lsp",
      {{"Options", {"FILE.lsp", "--level", "--mesh MESH...", "--examples", "--memory-limit", "--rules"}}});
  return run_program("lsp-validate", app, argc, argv, [&] { return validate(arguments, common); });
}
