// An .lsp file open for as long as the object lives, with its path and what it holds.
#pragma once

#include <filesystem>

#include "lsp/failures.hpp"
#include "lsp/scene_file.hpp"

namespace lsp::bench {

class OpenFile : public SceneFile {
 public:
  // Throws Failure with the library's own words.
  explicit OpenFile(const std::filesystem::path& path)
      : SceneFile(with_failures([&] { return SceneFile(path.string()); })), path_(path) {}

  const std::filesystem::path& path() const { return path_; }
  bool has_line_spaces() const { return header().required_features & LSP_FEATURE_LINE_SPACES; }
  bool has_cells() const { return header().required_features & LSP_FEATURE_CELLS; }
  bool has_exact_tree() const { return header().required_features & LSP_FEATURE_EXACT; }

 private:
  std::filesystem::path path_;
};

}  // namespace lsp::bench
