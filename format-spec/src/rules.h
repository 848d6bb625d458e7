// The numbered rules that a file is checked against. Ids are stable; see rules.def for the table.
#pragma once

#include <cstdint>
#include <span>
#include <string>

namespace lsp::format {

enum class Severity { kFatal, kError, kWarning, kInfo };  // kFatal: nothing behind it can be checked
enum class Layer {
  kIdentification,
  kHeader,
  kSectionTable,
  kHashAndCodec,
  kTree,
  kLineSpace,
  kBitset,
  kCandidate,
  kGeometry,
  kMetadata,
  kSource,
  kCell,
};
// What a broken rule of severity fatal or error says about the file.
enum class Verdict { kValid, kInvalid, kUnsupported, kLimit, kDiffer };

enum class RuleId : uint16_t {
#define LSP_RULE(number, constant, name, severity, layer, verdict, sentence) k##constant = number,
#include "rules.def"
#undef LSP_RULE
};

struct Rule {
  RuleId id;
  const char* name;  // kebab-case, as stable as the id
  Severity severity;
  Layer layer;
  Verdict verdict;
  const char* sentence;  // what must hold
};

// All rules in the order of their numbers.
std::span<const Rule> rules();
const Rule& rule(RuleId id);

// "LSP-0503"
std::string rule_label(RuleId id);
const char* to_string(Severity severity);
const char* to_string(Layer layer);
const char* to_string(Verdict verdict);

// The catalogue as a Markdown table: the text of RULES.md.
std::string rules_markdown();

}  // namespace lsp::format
