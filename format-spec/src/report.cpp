#include "report.h"

#include <lsp/program.h>

#include <nlohmann/json.hpp>

namespace lsp::format {

uint64_t Report::count(Severity severity) const {
  uint64_t total = 0;
  for (const auto& [id, finding] : findings_)
    if (rule(id).severity == severity) total += finding.count;
  return total;
}

Verdict Report::verdict() const {
  bool found[5] = {};
  for (const auto& [id, finding] : findings_) {
    const Rule& broken = rule(id);
    if (broken.severity == Severity::kFatal || broken.severity == Severity::kError)
      found[static_cast<int>(broken.verdict)] = true;
  }
  for (Verdict verdict : {Verdict::kUnsupported, Verdict::kInvalid, Verdict::kLimit, Verdict::kDiffer})
    if (found[static_cast<int>(verdict)]) return verdict;
  return Verdict::kValid;
}

Exit exit_code(Verdict verdict) {
  switch (verdict) {
    case Verdict::kValid:
      return Exit::kDone;
    case Verdict::kInvalid:
      return Exit::kInvalid;
    case Verdict::kUnsupported:
      return Exit::kUnsupported;
    case Verdict::kLimit:
      return Exit::kLimit;
    case Verdict::kDiffer:
      return Exit::kDiffer;
  }
  return Exit::kInternal;
}

nlohmann::ordered_json to_json(const Report& report) {
  nlohmann::ordered_json json;
  json["verdict"] = to_string(report.verdict());
  json["exit"] = static_cast<int>(exit_code(report.verdict()));
  for (Severity severity : {Severity::kFatal, Severity::kError, Severity::kWarning, Severity::kInfo})
    json["counts"][to_string(severity)] = report.count(severity);
  json["findings"] = nlohmann::ordered_json::array();
  for (const auto& [id, finding] : report.findings()) {
    const Rule& broken = rule(id);
    nlohmann::ordered_json entry;
    entry["id"] = rule_label(id);
    entry["name"] = broken.name;
    entry["severity"] = to_string(broken.severity);
    entry["layer"] = to_string(broken.layer);
    entry["rule"] = broken.sentence;
    entry["count"] = finding.count;
    for (const Example& example : finding.examples)
      entry["examples"].push_back({{"path", example.path},
                                   {"offset", example.offset},
                                   {"bytes", example.bytes},
                                   {"message", example.message}});
    json["findings"].push_back(std::move(entry));
  }
  return json;
}

std::string to_text(const Report& report) {
  std::string text;
  for (const auto& [id, finding] : report.findings()) {
    const Rule& broken = rule(id);
    if (broken.severity == Severity::kInfo) continue;
    for (const Example& example : finding.examples)
      text += std::string(to_string(broken.severity)) + " " + rule_label(id) + " " + broken.name + " " +
              example.path + " [" + std::to_string(example.offset) + ", " +
              std::to_string(example.offset + example.bytes) + "): " + example.message + "\n";
    if (finding.count > finding.examples.size())
      text += std::string(to_string(broken.severity)) + " " + rule_label(id) + " " + broken.name + ": and " +
              std::to_string(finding.count - finding.examples.size()) + " more\n";
  }
  return text;
}

}  // namespace lsp::format
