// The invalid files of the corpus: one named mutation of a valid file for every rule.
#pragma once

#include <string>
#include <vector>

#include "image.h"
#include "rules.h"

namespace lsp::corpus {

struct InvalidFile {
  format::RuleId rule;                 // that the mutation breaks; others may break with it
  std::string name;                    // without ".lsp": the rule's id and name
  std::string mutation;                // what was changed, one sentence
  std::vector<std::string> arguments;  // of lsp-validate, besides the file and --json
  Bytes bytes;
};

std::vector<InvalidFile> invalid_files();

// What the source that full.lsp claims to be baked from would be; for the rules of the layer "source".
inline constexpr const char* kSourceName = "source.obj";
inline constexpr const char* kSourceText = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";

}  // namespace lsp::corpus
