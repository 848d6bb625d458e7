// Writes the corpus into a folder: valid/ and invalid/ files, and index.json that says what each is for.
// The same program gives the same bytes on every machine; expected reports are lsp-validate's own.
#include <lsp/program.h>

#include <cstdio>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "check.h"
#include "mutations.h"
#include "scenes.h"
#include "source.h"

namespace {

using namespace lsp;
using namespace lsp::corpus;
using format::CheckOptions;
using format::Level;
using Json = nlohmann::ordered_json;

void write(const std::filesystem::path& path, const void* data, size_t size) {
  std::ofstream file(path, std::ios::binary | std::ios::trunc);
  file.write(static_cast<const char*>(data), static_cast<std::streamsize>(size));
  if (!file.flush()) throw Failure(Exit::kFile, path.string(), "cannot be written");
}

// What lsp-validate --json prints of the check alone.
Json expected(const Bytes& bytes, const std::vector<std::string>& arguments,
              const std::filesystem::path& folder) {
  CheckOptions options;
  for (size_t i = 0; i + 1 < arguments.size(); i += 2) {
    if (arguments[i] == "--level") options.level = Level::kGeometry;
    if (arguments[i] == "--memory-limit") options.memory_limit = std::stoull(arguments[i + 1]);
    if (arguments[i] == "--mesh") {
      const std::filesystem::path sources[] = {folder / arguments[i + 1]};
      options.source = format::hash_sources(sources, {});
    }
  }
  return to_json(check_file(bytes, options));
}

void make(const std::filesystem::path& folder) {
  std::filesystem::create_directories(folder / "valid");
  std::filesystem::create_directories(folder / "invalid");
  write(folder / "invalid" / kSourceName, kSourceText, std::char_traits<char>::length(kSourceText));
  Json index;
  index["valid"] = Json::array();
  for (const ValidFile& file : valid_files()) {
    write(folder / "valid" / (file.name + ".lsp"), file.bytes.data(), file.bytes.size());
    index["valid"].push_back({{"file", "valid/" + file.name + ".lsp"}, {"shows", file.shows}});
  }
  index["invalid"] = Json::array();
  for (const InvalidFile& file : invalid_files()) {
    write(folder / "invalid" / (file.name + ".lsp"), file.bytes.data(), file.bytes.size());
    const std::string report = expected(file.bytes, file.arguments, folder / "invalid").dump(1) + "\n";
    write(folder / "invalid" / (file.name + ".json"), report.data(), report.size());
    index["invalid"].push_back({{"file", "invalid/" + file.name + ".lsp"},
                                {"rule", format::rule_label(file.rule)},
                                {"mutation", file.mutation},
                                {"arguments", file.arguments}});
  }
  const std::string text = index.dump(1) + "\n";
  write(folder / "index.json", text.data(), text.size());
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) {
    std::fprintf(stderr, "usage: lsp_make_corpus FOLDER\n");
    return static_cast<int>(Exit::kUsage);
  }
  try {
    make(argv[1]);
    return 0;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "lsp_make_corpus: %s\n", error.what());
    return static_cast<int>(Exit::kInternal);
  }
}
