// lsp-info: what an .lsp file holds.
#include <lsp/program.h>

#include <cstdio>
#include <nlohmann/json.hpp>

#include "annotate.h"
#include "file.h"
#include "lsp/command_line.h"
#include "lsp/json_result.h"
#include "rules.h"
#include "summary.h"
#include "view.h"

namespace {

using namespace lsp;
using namespace lsp::format;
using Json = nlohmann::ordered_json;

struct Arguments {
  std::string file;
  std::string section;
  bool annotate = false;
  uint64_t memory_limit = uint64_t{8} << 30;
};

// Throws where a section is asked for that is not there.
void find_section(std::span<const std::byte> bytes, const Arguments& arguments) {
  if (arguments.section.empty()) return;
  std::string names;
  for (const LspSection& section : view_file(bytes).table) {
    const std::string name = type_name(section.type);
    if (name == arguments.section) return;
    names += (names.empty() ? "" : ", ") + name;
  }
  throw Failure(Exit::kUsage, arguments.file,
                "has no section " + arguments.section + "; it has " + (names.empty() ? "none" : names));
}

void print_annotation(const Arguments& arguments, const CommonOptions& common,
                      std::span<const std::byte> bytes) {
  if (!common.json) {
    annotate(bytes, {arguments.section}, [](const Range& range) {
      std::printf("%10llu %10llu  %-32s %s\n", static_cast<unsigned long long>(range.offset),
                  static_cast<unsigned long long>(range.bytes), range.path.c_str(), range.meaning.c_str());
    });
    return;
  }
  Json json;
  json["file"] = arguments.file;
  json["bytes"] = bytes.size();
  json["ranges"] = Json::array();
  annotate(bytes, {arguments.section}, [&](const Range& range) {
    json["ranges"].push_back(
        {{"offset", range.offset}, {"bytes", range.bytes}, {"path", range.path}, {"meaning", range.meaning}});
  });
  json_result() = json;
}

void show(const Arguments& arguments, const CommonOptions& common) {
  const MappedFile file(arguments.file);
  if (arguments.annotate) {
    find_section(file.bytes(), arguments);
    if (common.json || !common.quiet) print_annotation(arguments, common, file.bytes());
    return;
  }
  Json summary = summarize(file.bytes(), arguments.file, arguments.memory_limit);
  find_section(file.bytes(), arguments);
  if (common.json) {
    Json& sections = summary["sections"];
    for (size_t i = sections.size(); i-- > 0 && !arguments.section.empty();)
      if (sections[i]["name"] != arguments.section) sections.erase(i);
    json_result() = summary;
  } else if (!common.quiet)
    std::fputs(summary_text(summary, arguments.section).c_str(), stdout);
  if (summary["verdict"] == to_string(Verdict::kLimit))
    throw Failure(Exit::kLimit, arguments.file, "was not shown in full: raise --memory-limit");
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app(
      "Shows what an .lsp file holds: parameters, sections, sizes, fill rates, a row for every depth.\n"
      "It reads damaged files too, but does not judge them: that is lsp-validate's part.",
      "lsp-info");
  Arguments arguments;
  CommonOptions common;
  app.add_option("FILE.lsp", arguments.file, "The file to show")->required();
  app.add_flag("--annotate", arguments.annotate, "Print every byte range of the file with its meaning");
  app.add_option("--section", arguments.section,
                 "Only this section, as NODE; with --annotate: all its elements");
  add_size_option(app, "--memory-limit", arguments.memory_limit,
                  "Memory that the sections of a packed file may take, as 512MB (default 8GiB)");
  add_common_options(app, "lsp-info", common);
  arrange_help(app, "lsp-info room.lsp --annotate",
               {{"Options", {"FILE.lsp", "--annotate", "--section NAME", "--memory-limit"}}});
  return run_program("lsp-info", app, argc, argv, [&] { show(arguments, common); });
}
