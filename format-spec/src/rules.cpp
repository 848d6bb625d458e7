#include "rules.h"

#include <algorithm>
#include <cstdio>
#include <stdexcept>

namespace lsp::format {
namespace {

constexpr Rule kRules[] = {
#define LSP_RULE(number, constant, name, severity, layer, verdict, sentence) \
  {RuleId::k##constant, name, Severity::severity, Layer::layer, Verdict::verdict, sentence},
#include "rules.def"
#undef LSP_RULE
};

constexpr bool strictly_ascending() {
  for (size_t i = 1; i < std::size(kRules); ++i)
    if (kRules[i - 1].id >= kRules[i].id) return false;
  return true;
}
static_assert(strictly_ascending(), "the numbers of the rules ascend and none is used twice");

}  // namespace

std::span<const Rule> rules() { return kRules; }

const Rule& rule(RuleId id) {
  const auto* found = std::lower_bound(std::begin(kRules), std::end(kRules), id,
                                       [](const Rule& rule, RuleId wanted) { return rule.id < wanted; });
  if (found == std::end(kRules) || found->id != id) throw std::logic_error("no such rule");
  return *found;
}

std::string rule_label(RuleId id) {
  char text[16];
  std::snprintf(text, sizeof text, "LSP-%04u", static_cast<unsigned>(id));
  return text;
}

const char* to_string(Severity severity) {
  switch (severity) {
    case Severity::kFatal:
      return "fatal";
    case Severity::kError:
      return "error";
    case Severity::kWarning:
      return "warning";
    case Severity::kInfo:
      return "info";
  }
  return "";
}

const char* to_string(Layer layer) {
  switch (layer) {
    case Layer::kIdentification:
      return "identification";
    case Layer::kHeader:
      return "header";
    case Layer::kSectionTable:
      return "section table";
    case Layer::kHashAndCodec:
      return "hash and codec";
    case Layer::kTree:
      return "tree";
    case Layer::kLineSpace:
      return "Line Space";
    case Layer::kBitset:
      return "bitset";
    case Layer::kCandidate:
      return "candidate";
    case Layer::kGeometry:
      return "geometry";
    case Layer::kMetadata:
      return "metadata";
    case Layer::kSource:
      return "source";
    case Layer::kCell:
      return "cell";
  }
  return "";
}

const char* to_string(Verdict verdict) {
  switch (verdict) {
    case Verdict::kValid:
      return "valid";
    case Verdict::kInvalid:
      return "invalid";
    case Verdict::kUnsupported:
      return "unsupported";
    case Verdict::kLimit:
      return "limit";
    case Verdict::kDiffer:
      return "differ";
  }
  return "";
}

std::string rules_markdown() {
  std::string text =
      "# Rules\n\n"
      "Made by `lsp-validate --rules` from `src/rules.def`; do not edit. Numbers are never used again. The\n"
      "severity `fatal` ends the check, `error` makes the file invalid, `warning` and `info` do not. The\n"
      "verdict says which exit code an error leads to: invalid 3, unsupported 5, limit 6, differ 7.\n\n"
      "| id | name | severity | layer | verdict | what must hold |\n|---|---|---|---|---|---|\n";
  for (const Rule& rule : kRules) {
    const bool counts = rule.severity == Severity::kFatal || rule.severity == Severity::kError;
    text += "| " + rule_label(rule.id) + " | `" + rule.name + "` | " + to_string(rule.severity) + " | " +
            to_string(rule.layer) + " | " + (counts ? to_string(rule.verdict) : "") + " | " + rule.sentence +
            " |\n";
  }
  return text;
}

}  // namespace lsp::format
