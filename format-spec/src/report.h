// What a check found: every broken rule with its count and its first examples.
#pragma once

#include <cstdint>
#include <map>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <utility>
#include <vector>

#include "lsp/program.h"
#include "rules.h"

namespace lsp::format {

struct Example {
  std::string path;     // "/sections/NODE/1234/child1"
  uint64_t offset = 0;  // bytes [offset, offset + bytes) of the file; of the stored frame in a packed section
  uint64_t bytes = 0;
  std::string message;
};

struct Finding {
  uint64_t count = 0;
  std::vector<Example> examples;  // the first few
};

class Report {
 public:
  explicit Report(uint32_t examples_per_rule = 4) : examples_per_rule_(examples_per_rule) {}

  // Counts a finding. `describe` returns {path, message} and is called only while examples are kept, so that
  // a million equal findings cost a counter.
  template <class Describe>
  void add(RuleId id, uint64_t offset, uint64_t bytes, Describe&& describe) {
    Finding& finding = findings_[id];
    if (finding.count++ >= examples_per_rule_) return;
    std::pair<std::string, std::string> text = describe();
    finding.examples.push_back({std::move(text.first), offset, bytes, std::move(text.second)});
  }
  void add(RuleId id, uint64_t offset, uint64_t bytes, std::string path, std::string message) {
    add(id, offset, bytes, [&] { return std::pair{std::move(path), std::move(message)}; });
  }

  bool has(RuleId id) const { return findings_.contains(id); }
  uint64_t count(Severity severity) const;
  bool fatal() const { return count(Severity::kFatal) != 0; }

  // The worst of what was found; the order is unsupported, invalid, limit, differ, valid.
  Verdict verdict() const;

  const std::map<RuleId, Finding>& findings() const { return findings_; }

 private:
  uint32_t examples_per_rule_;
  std::map<RuleId, Finding> findings_;
};

// The exit code of a verdict.
Exit exit_code(Verdict verdict);

// The report as report.schema.json describes it, without the file's name.
nlohmann::ordered_json to_json(const Report& report);

// One line a finding, examples folded: "error LSP-0503 two-parents /sections/NODE/7 [1234, 1238): ...".
// Findings of severity info are left out.
std::string to_text(const Report& report);

}  // namespace lsp::format
