// The corpus: what lies in the repository is what its program makes, valid files are valid, every rule has a
// file that breaks it, and every report is the expected one.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <set>

#include "check.h"
#include "file.h"
#include "mutations.h"
#include "scenes.h"
#include "source.h"

namespace {

using namespace lsp;
using namespace lsp::corpus;
using namespace lsp::format;

const std::filesystem::path kCorpus = std::filesystem::path(LSP_CORPUS_DIR);

Bytes read(const std::filesystem::path& path) {
  const MappedFile file(path);
  return {file.bytes().begin(), file.bytes().end()};
}

CheckOptions options_of(const InvalidFile& file) {
  CheckOptions options;
  for (size_t i = 0; i + 1 < file.arguments.size(); i += 2) {
    if (file.arguments[i] == "--level") options.level = Level::kGeometry;
    if (file.arguments[i] == "--memory-limit") options.memory_limit = std::stoull(file.arguments[i + 1]);
    if (file.arguments[i] == "--mesh")
      options.source = hash_sources(
          std::vector<std::filesystem::path>{kCorpus / "2.0/invalid" / file.arguments[i + 1]}, {});
  }
  return options;
}

TEST(Corpus, RepositoryHoldsWhatTheProgramMakes) {
  const auto expect_same = [](const std::filesystem::path& path, const Bytes& bytes) {
    ASSERT_TRUE(std::filesystem::exists(path)) << path << " is missing, run lsp_make_corpus";
    EXPECT_TRUE(read(path) == bytes) << path << " differs, run lsp_make_corpus";
  };
  std::set<std::filesystem::path> known;
  for (const ValidFile& file : valid_files()) {
    const auto path = kCorpus / "2.0/valid" / (file.name + ".lsp");
    expect_same(path, file.bytes);
    known.insert(path);
  }
  for (const InvalidFile& file : invalid_files()) {
    const auto path = kCorpus / "2.0/invalid" / (file.name + ".lsp");
    expect_same(path, file.bytes);
    known.insert(path);
  }
  for (const auto& entry : std::filesystem::recursive_directory_iterator(kCorpus / "2.0"))
    EXPECT_TRUE(entry.path().extension() != ".lsp" || known.contains(entry.path())) << entry.path();
}

// Files of every released version stay readable: a new version adds a folder, and none is ever remade.
TEST(Corpus, FilesOfEveryReleasedVersionAreValid) {
  size_t count = 0;
  for (const auto& version : std::filesystem::directory_iterator(kCorpus)) {
    if (!std::filesystem::is_directory(version.path() / "valid")) continue;
    for (const auto& entry : std::filesystem::directory_iterator(version.path() / "valid")) {
      const MappedFile file(entry.path());
      const Report report = check_file(file.bytes(), {.level = Level::kGeometry});
      EXPECT_EQ(report.verdict(), Verdict::kValid) << entry.path() << "\n" << to_text(report);
      EXPECT_EQ(report.count(Severity::kWarning), 0u) << entry.path() << "\n" << to_text(report);
      ++count;
    }
  }
  EXPECT_GE(count, 19u);
}

TEST(Corpus, EveryRuleHasAFileThatBreaksIt) {
  std::set<RuleId> broken;
  for (const InvalidFile& file : invalid_files()) {
    const Report report = check_file(file.bytes, options_of(file));
    EXPECT_TRUE(report.has(file.rule)) << file.name << "\n" << to_text(report);
    const Rule& expected = rule(file.rule);
    if (expected.severity == Severity::kFatal || expected.severity == Severity::kError)
      EXPECT_NE(report.verdict(), Verdict::kValid) << file.name;
    else
      EXPECT_EQ(report.count(expected.severity), report.findings().at(file.rule).count) << file.name;
    broken.insert(file.rule);
  }
  for (const Rule& rule : rules())
    EXPECT_TRUE(broken.contains(rule.id)) << rule_label(rule.id) << " has no file";
}

TEST(Corpus, ReportsAreTheExpectedOnes) {
  for (const InvalidFile& file : invalid_files()) {
    std::ifstream stream(kCorpus / "2.0/invalid" / (file.name + ".json"));
    const auto expected = nlohmann::ordered_json::parse(stream, nullptr, false);
    EXPECT_EQ(to_json(check_file(file.bytes, options_of(file))), expected) << file.name;
  }
}

TEST(Corpus, TheRuleTableForHumansIsUpToDate) {
  std::ifstream stream(std::filesystem::path(LSP_FORMAT_DIR) / "RULES.md");
  const std::string text((std::istreambuf_iterator<char>(stream)), {});
  EXPECT_EQ(text, rules_markdown()) << "run lsp-validate --rules > format-spec/RULES.md";
}

TEST(Corpus, TheCapChangesTheExamplesOnly) {
  for (const InvalidFile& file : invalid_files()) {
    CheckOptions none = options_of(file), all = none;
    none.examples_per_rule = 0;
    all.examples_per_rule = 1000000;
    const Report few = check_file(file.bytes, none), many = check_file(file.bytes, all);
    EXPECT_EQ(few.verdict(), many.verdict()) << file.name;
    ASSERT_EQ(few.findings().size(), many.findings().size()) << file.name;
    for (const auto& [id, finding] : many.findings()) {
      EXPECT_EQ(finding.count, few.findings().at(id).count) << file.name;
      EXPECT_EQ(finding.count, finding.examples.size()) << file.name;
      for (const Example& example : finding.examples) {
        EXPECT_FALSE(example.path.empty()) << file.name;
        EXPECT_FALSE(example.message.empty()) << file.name;
      }
    }
  }
}

// A file that breaks a rule of one level breaks it on every deeper level too.
TEST(Corpus, DeeperLevelsFindNoLess) {
  for (const InvalidFile& file : invalid_files()) {
    CheckOptions options = options_of(file);
    options.level = Level::kContainer;
    const Report container = check_file(file.bytes, options);
    options.level = Level::kStructure;
    const Report structure = check_file(file.bytes, options);
    options.level = Level::kGeometry;
    const Report geometry = check_file(file.bytes, options);
    for (const auto& [id, finding] : container.findings()) EXPECT_TRUE(structure.has(id)) << file.name;
    for (const auto& [id, finding] : structure.findings()) EXPECT_TRUE(geometry.has(id)) << file.name;
  }
}

}  // namespace
