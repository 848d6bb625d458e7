// What lsp-validate --json prints is what report.schema.json describes, for every file of the corpus: the
// program itself is run, so that its exit codes and streams are tested too.
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <sys/wait.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <regex>

#include "mutations.h"
#include "scenes.h"
#include "temporary_folder.h"

namespace {

using namespace lsp;
using namespace lsp::corpus;
using Json = nlohmann::json;

const std::filesystem::path kCorpus = std::filesystem::path(LSP_CORPUS_DIR) / "2.0";

struct Output {
  int exit = -1;
  std::string out;
};

// Runs a program with standard error discarded.
Output run(const std::string& command) {
  Output output;
  FILE* pipe = popen((command + " 2>/dev/null").c_str(), "r");
  if (pipe == nullptr) return output;
  char buffer[4096];
  for (size_t n; (n = fread(buffer, 1, sizeof buffer, pipe)) > 0;) output.out.append(buffer, n);
  const int status = pclose(pipe);
  if (WIFEXITED(status)) output.exit = WEXITSTATUS(status);
  return output;
}

// The part of JSON Schema that report.schema.json uses. Returns what does not fit, or nothing.
std::string misfit(const Json& schema, const Json& value, const std::string& path) {
  static const std::string kKnown[] = {
      "$schema",    "title", "description", "type",    "required", "additionalProperties",
      "properties", "enum",  "minimum",     "pattern", "items"};
  for (const auto& [key, unused] : schema.items())
    if (std::find(std::begin(kKnown), std::end(kKnown), key) == std::end(kKnown))
      return path + ": unknown keyword " + key;
  const std::string type = schema.value("type", "");
  const bool fits = (type == "object" && value.is_object()) || (type == "array" && value.is_array()) ||
                    (type == "string" && value.is_string()) ||
                    (type == "integer" && value.is_number_integer());
  if (!fits) return path + " is not of type " + type;
  if (schema.contains("enum") &&
      std::find(schema["enum"].begin(), schema["enum"].end(), value) == schema["enum"].end())
    return path + " is " + value.dump();
  if (schema.contains("minimum") && value.get<int64_t>() < schema["minimum"].get<int64_t>())
    return path + " is too small";
  if (schema.contains("pattern") &&
      !std::regex_search(value.get<std::string>(), std::regex(schema["pattern"].get<std::string>())))
    return path + " is " + value.dump();
  for (const Json& name : schema.value("required", Json::array()))
    if (!value.contains(name.get<std::string>())) return path + " lacks " + name.get<std::string>();
  if (value.is_object())
    for (const auto& [name, member] : value.items()) {
      if (!schema["properties"].contains(name)) return path + " has " + name;
      if (std::string text = misfit(schema["properties"][name], member, path + "/" + name); !text.empty())
        return text;
    }
  if (value.is_array())
    for (const Json& item : value)
      if (std::string text = misfit(schema["items"], item, path + "/*"); !text.empty()) return text;
  return "";
}

TEST(Program, ReportsFitTheSchemaAndExitCodesTheReport) {
  std::ifstream file(std::filesystem::path(LSP_FORMAT_DIR) / "report.schema.json");
  const Json schema = Json::parse(file);
  const auto expect = [&](const std::filesystem::path& path, const std::vector<std::string>& arguments,
                          int exit) {
    std::string command =
        "cd " + path.parent_path().string() + " && " + LSP_VALIDATE + " --json " + path.filename().string();
    for (const std::string& argument : arguments) command += " " + argument;
    const Output output = run(command);
    const Json json = Json::parse(output.out, nullptr, false);
    ASSERT_FALSE(json.is_discarded()) << command << "\n" << output.out;
    EXPECT_EQ(misfit(schema, json, ""), "") << command;
    EXPECT_EQ(json["exit"], output.exit) << command;
    EXPECT_TRUE(exit < 0 || output.exit == exit) << command;
  };
  for (const ValidFile& valid : valid_files()) expect(kCorpus / "valid" / (valid.name + ".lsp"), {}, 0);
  for (const InvalidFile& invalid : invalid_files())
    expect(kCorpus / "invalid" / (invalid.name + ".lsp"), invalid.arguments, -1);
}

TEST(Program, SilentOnSuccessAndQuietOnDemand) {
  const std::string valid = (kCorpus / "valid/full.lsp").string();
  const std::string invalid = (kCorpus / "invalid/LSP-0503-two-parents.lsp").string();
  EXPECT_EQ(run(std::string(LSP_VALIDATE) + " " + valid).out, "");
  EXPECT_NE(run(std::string(LSP_VALIDATE) + " " + invalid).out.find("LSP-0503"), std::string::npos);
  EXPECT_EQ(run(std::string(LSP_VALIDATE) + " --quiet " + invalid).out, "");
  EXPECT_EQ(run(std::string(LSP_VALIDATE) + " --quiet " + invalid).exit, 3);
}

// Each is checked, whatever the others are; findings name their file.
TEST(Program, SeveralFilesInOneRun) {
  const std::string validate = LSP_VALIDATE, valid = (kCorpus / "valid/full.lsp").string();
  const std::string invalid = (kCorpus / "invalid/LSP-0503-two-parents.lsp").string();
  const std::string newer = (kCorpus / "invalid/LSP-0104-other-major.lsp").string();
  EXPECT_EQ(run(validate + " " + valid + " " + valid).exit, 0);
  EXPECT_EQ(run(validate + " " + valid + " " + valid).out, "");
  const Output bad = run(validate + " " + valid + " " + newer + " /no/such/file.lsp " + invalid);
  EXPECT_EQ(bad.exit, 5) << "the first that is not valid";
  EXPECT_NE(bad.out.find(newer + ": fatal LSP-0104"), std::string::npos) << bad.out;
  EXPECT_NE(bad.out.find(invalid + ": error LSP-0503"), std::string::npos) << bad.out;
  EXPECT_EQ(bad.out.find(valid + ":"), std::string::npos) << bad.out;
  EXPECT_EQ(run(validate + " /no/such/file.lsp " + valid).exit, 2);
  const Output reported = run(validate + " --json " + valid + " /no/such/file.lsp " + invalid);
  const Json json = Json::parse(reported.out, nullptr, false);
  ASSERT_FALSE(json.is_discarded()) << reported.out;
  EXPECT_EQ(json["exit"], 2);
  EXPECT_EQ(reported.exit, 2);
  ASSERT_EQ(json["files"].size(), 3u);
  std::ifstream file(std::filesystem::path(LSP_FORMAT_DIR) / "report.schema.json");
  const Json schema = Json::parse(file);
  EXPECT_EQ(misfit(schema, json["files"][0], ""), "");
  EXPECT_EQ(json["files"][1]["exit"], 2);
  EXPECT_NE(json["files"][1]["error"].get<std::string>().find("cannot be opened"), std::string::npos);
  EXPECT_EQ(misfit(schema, json["files"][2], ""), "");
  EXPECT_EQ(run(validate + " " + valid + " " + valid + " --mesh /dev/null").exit, 1);
}

TEST(Program, ExitCodes) {
  const std::string valid = (kCorpus / "valid/full.lsp").string();
  const std::string validate = LSP_VALIDATE, info = LSP_INFO;
  EXPECT_EQ(run(validate).exit, 1);
  EXPECT_EQ(run(validate + " --no-such-option " + valid).exit, 1);
  EXPECT_EQ(run(validate + " --level shallow " + valid).exit, 1);
  EXPECT_EQ(run(validate + " /no/such/file.lsp").exit, 2);
  EXPECT_EQ(run(validate + " " + LSP_CORPUS_DIR).exit, 2);
  EXPECT_EQ(run(validate + " " + valid + " --mesh /no/such/mesh.obj").exit, 2);
  EXPECT_EQ(run(validate + " /dev/null").exit, 2);
  EXPECT_EQ(run(validate + " --version").exit, 0);
  EXPECT_EQ(run(validate + " --help").exit, 0);
  EXPECT_EQ(run(info + " " + valid).exit, 0);
  EXPECT_EQ(run(info + " --json " + valid).exit, 0);
  EXPECT_EQ(run(info + " --annotate " + valid).exit, 0);
  EXPECT_EQ(run(info + " --section NODE " + valid).exit, 0);
  EXPECT_EQ(run(info + " --section NONE " + valid).exit, 1);
  EXPECT_EQ(run(info + " --annotate --section NONE " + valid).exit, 1);
  EXPECT_EQ(run(info + " --annotate --section NODE " + valid).exit, 0);
  EXPECT_EQ(run(validate + " --memory-limit -1 " + valid).exit, 1);
  EXPECT_EQ(run(info + " " + (kCorpus / "index.json").string()).exit, 3);
  EXPECT_EQ(run(info + " " + (kCorpus / "invalid/LSP-0104-other-major.lsp").string()).exit, 5);
  EXPECT_EQ(run(info + " /no/such/file.lsp").exit, 2);
  EXPECT_EQ(run(info + " --quiet " + valid).out + run(info + " --quiet --annotate " + valid).out, "");
  const Json one = Json::parse(run(info + " --json --section NODE " + valid).out, nullptr, false);
  ASSERT_EQ(one["sections"].size(), 1u);
  EXPECT_EQ(one["sections"][0]["name"], "NODE");
  const lsp::test::TemporaryFolder folder;
  ASSERT_EQ(mkfifo((folder.path() / "pipe").c_str(), 0600), 0);  // nobody writes to it
  for (const std::string& program : {validate, info})
    EXPECT_EQ(run(program + " " + (folder.path() / "pipe").string()).exit, 2) << program;
}

// An older version is one to bake again, not one to look for a newer program for.
TEST(Program, AFileOfVersion1IsRefusedByThatName) {
  const lsp::test::TemporaryFolder folder;
  const std::string path = (folder.path() / "one.lsp").string();
  std::string bytes = lsp::test::read_bytes(kCorpus / "valid/full.lsp");
  bytes[8] = 1;  // version_major
  std::ofstream(path, std::ios::binary) << bytes;
  for (const std::string program : {LSP_VALIDATE, LSP_INFO}) {
    const Output output = run("(" + program + " " + path + " 2>&1)");
    EXPECT_EQ(output.exit, 5) << program;
    EXPECT_NE(output.out.find("/header/version_major"), std::string::npos) << output.out;
    EXPECT_NE(output.out.find("is 1: bake it again"), std::string::npos) << output.out;
    EXPECT_EQ(output.out.find("newer"), std::string::npos) << output.out;
  }
}

}  // namespace
