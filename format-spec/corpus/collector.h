// Gathers the invalid files of the corpus, each from a valid one and a change.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "mutations.h"
#include "ntree_scenes.h"
#include "scenes.h"

namespace lsp::corpus {

class Collector {
 public:
  std::vector<InvalidFile> files;

  void add(format::RuleId rule, const char* mutation, Bytes bytes, std::vector<std::string> arguments = {},
           const char* base = "-ntree") {
    std::string name = format::rule_label(rule) + "-" + format::rule(rule).name;
    // A rule of several base structures has a file for each.
    const std::string first = name;
    for (const InvalidFile& file : files)
      if (file.name == first) name = first + base;
    files.push_back({rule, name, mutation, std::move(arguments), std::move(bytes)});
  }

  // Each starts from the full scene; hashes are made after the change.
  void image(format::RuleId rule, const char* mutation, const std::function<void(Image&)>& change,
             std::vector<std::string> arguments = {}) {
    Image image = full_scene();
    change(image);
    add(rule, mutation, encode(image), std::move(arguments));
  }
  void geometry(format::RuleId rule, const char* mutation, const std::function<void(Image&)>& change) {
    image(rule, mutation, change, {"--level", "geometry"});
  }
  void ntree(format::RuleId rule, const char* mutation, const std::function<void(Image&)>& change,
             std::vector<std::string> arguments = {}) {
    Image image = full_ntree_scene();
    change(image);
    add(rule, mutation, encode(image), std::move(arguments));
  }
  void ntree_geometry(format::RuleId rule, const char* mutation, const std::function<void(Image&)>& change) {
    ntree(rule, mutation, change, {"--level", "geometry"});
  }
  void ntree_header(format::RuleId rule, const char* mutation,
                    const std::function<void(LspHeader&)>& change) {
    Bytes bytes = encode(full_ntree_scene());
    change(header_of(bytes));
    repair_hashes(bytes);
    add(rule, mutation, std::move(bytes));
  }
  void header(format::RuleId rule, const char* mutation, const std::function<void(LspHeader&)>& change) {
    bytes(rule, mutation, [&](Bytes& bytes) { change(header_of(bytes)); });
  }
  void sections(format::RuleId rule, const char* mutation, const std::function<void(Sections&)>& change) {
    Sections sections = to_sections(full_scene());
    change(sections);
    add(rule, mutation, encode(sections));
  }
  void bytes(format::RuleId rule, const char* mutation, const std::function<void(Bytes&)>& change) {
    Bytes bytes = encode(full_scene());
    change(bytes);
    repair_hashes(bytes);
    add(rule, mutation, std::move(bytes));
  }
  // Like bytes(), but with the hashes left as they were.
  void raw(format::RuleId rule, const char* mutation, const std::function<void(Bytes&)>& change) {
    Bytes bytes = encode(full_scene());
    change(bytes);
    add(rule, mutation, std::move(bytes));
  }
  // Changes the stored frame of NODE in a packed file.
  void frame(format::RuleId rule, const char* mutation, const std::function<void(Section&)>& change,
             std::vector<std::string> arguments = {}) {
    Sections sections = to_sections(full_scene());
    pack(sections);
    change(sections.sections[0]);
    add(rule, mutation, encode(sections), std::move(arguments));
  }
};

// The files that break the rules of the NTree, of cells, and of wide nodes.
void break_ntrees(Collector& c);
void break_cells(Collector& c);
void break_wide_nodes(Collector& c);

}  // namespace lsp::corpus
