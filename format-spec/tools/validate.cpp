// lsp-validate: says whether an .lsp file may be trusted, and everything that is wrong with it.
#include <lsp/program.h>

#include <cstdio>
#include <nlohmann/json.hpp>

#include "check.h"
#include "file.h"
#include "lsp/command_line.h"
#include "source.h"

namespace {

using namespace lsp;
using namespace lsp::format;

struct Arguments {
  std::string file;
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
      return "needs a newer program to be checked";
    case Verdict::kLimit:
      return "was not checked in full: raise --memory-limit";
    case Verdict::kDiffer:
      return "is valid, but was not baked from these source files: bake it again";
  }
  return "";
}

int validate(const Arguments& arguments, const CommonOptions& common) {
  if (arguments.rules) {
    std::fputs(rules_markdown().c_str(), stdout);
    return 0;
  }
  if (arguments.file.empty()) throw Failure(Exit::kUsage, "", "FILE.lsp is missing, see --help");
  const MappedFile file(arguments.file);
  CheckOptions options;
  options.level = arguments.level == "container"  ? Level::kContainer
                  : arguments.level == "geometry" ? Level::kGeometry
                                                  : Level::kStructure;
  options.memory_limit = arguments.memory_limit;
  options.examples_per_rule = arguments.examples;
  if (!arguments.meshes.empty()) options.source = hash_sources(arguments.meshes, file.bytes());
  const Report report = check_file(file.bytes(), options);
  const Verdict verdict = report.verdict();

  if (common.json) {
    nlohmann::ordered_json json;
    json["program"] = "lsp-validate";
    json["version"] = kProgramVersion;
    json["file"] = arguments.file;
    json["bytes"] = file.bytes().size();
    json["level"] = arguments.level;
    json.update(to_json(report));
    std::puts(json.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace).c_str());
  } else if (!common.quiet) {
    std::fputs(to_text(report).c_str(), stdout);
  }
  if (verdict != Verdict::kValid)
    std::fprintf(
        stderr, "lsp-validate: %s: %s (%llu errors)\n", arguments.file.c_str(), advice(verdict),
        static_cast<unsigned long long>(report.count(Severity::kFatal) + report.count(Severity::kError)));
  return exit_code(verdict);
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app(
      "Checks an .lsp file and reports everything that is wrong with it.\n"
      "Silent on success. Exit codes: 0 valid, 1 usage, 2 cannot be read, 3 invalid, 4 internal error,\n"
      "5 needs a newer program, 6 over the memory limit, 7 not baked from the files of --mesh.",
      "lsp-validate");
  Arguments arguments;
  CommonOptions common;
  app.add_option("FILE.lsp", arguments.file, "The file to check");
  app.add_option("--level", arguments.level,
                 "How deep: container (header, sections, hashes), structure (and all that a tracer's indices "
                 "follow), "
                 "geometry (and every triangle, normal and material)")
      ->check(CLI::IsMember({"container", "structure", "geometry"}))
      ->capture_default_str();
  app.add_option("--mesh", arguments.meshes,
                 "The source files, in the order of the bake: is the bake stale?");
  app.add_option("--memory-limit", arguments.memory_limit,
                 "For the sections of a packed file, as in 512MB or 8GB")
      ->transform(CLI::AsSizeValue(false));
  app.add_option("--examples", arguments.examples, "How many findings of a rule are printed")
      ->capture_default_str();
  app.add_flag("--rules", arguments.rules, "Print the rule catalogue as Markdown and end");
  add_common_options(app, "lsp-validate", common);
  arrange_help(
      app, "lsp-validate room.lsp",
      {{"Options", {"FILE.lsp", "--level", "--mesh MESH...", "--examples", "--memory-limit", "--rules"}}});
  return run_program("lsp-validate", app, argc, argv, [&] { return validate(arguments, common); });
}
