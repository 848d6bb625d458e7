// lsp-info: what an .lsp file holds.
#include <lsp/program.h>

#include <cstdio>
#include <nlohmann/json.hpp>

#include "annotate.h"
#include "file.h"
#include "lsp/command_line.h"
#include "summary.h"

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

std::string dump(const Json& json) { return json.dump(2, ' ', false, Json::error_handler_t::replace); }

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
  json["program"] = "lsp-info";
  json["version"] = kProgramVersion;
  json["file"] = arguments.file;
  json["bytes"] = bytes.size();
  json["ranges"] = Json::array();
  annotate(bytes, {arguments.section}, [&](const Range& range) {
    json["ranges"].push_back(
        {{"offset", range.offset}, {"bytes", range.bytes}, {"path", range.path}, {"meaning", range.meaning}});
  });
  std::puts(dump(json).c_str());
}

int show(const Arguments& arguments, const CommonOptions& common) {
  const MappedFile file(arguments.file);
  if (arguments.annotate) {
    print_annotation(arguments, common, file.bytes());
    return 0;
  }
  const Json summary = summarize(file.bytes(), arguments.file, arguments.memory_limit);
  const std::string text =
      summary_text(summary, arguments.section);  // refuses an unknown section in both forms
  if (common.json)
    std::puts(dump(summary).c_str());
  else if (!common.quiet)
    std::fputs(text.c_str(), stdout);
  return 0;
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
  app.add_option("--memory-limit", arguments.memory_limit,
                 "For the sections of a packed file, as in 512MB or 8GB")
      ->transform(CLI::AsSizeValue(false));
  add_common_options(app, "lsp-info", common);
  arrange_help(app, "lsp-info room.lsp --annotate",
               {{"Options", {"FILE.lsp", "--annotate", "--section NAME", "--memory-limit"}}});
  return run_program("lsp-info", app, argc, argv, [&] { return show(arguments, common); });
}
