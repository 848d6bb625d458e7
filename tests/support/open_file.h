// An .lsp file mapped and open for as long as the object lives.
#pragma once

#include <filesystem>

#include "lsp/lsp.h"

namespace lsp::bench {

class OpenFile {
 public:
  // Throws Failure with the library's own words and exit code.
  explicit OpenFile(const std::filesystem::path& path);
  ~OpenFile();
  OpenFile(const OpenFile&) = delete;
  OpenFile& operator=(const OpenFile&) = delete;

  const lsp_scene& scene() const { return scene_; }
  const lsp_mapping& mapping() const { return mapping_; }
  const std::filesystem::path& path() const { return path_; }
  bool has_line_spaces() const { return scene_.header->required_features & LSP_FEATURE_LINE_SPACES; }
  bool has_cells() const { return scene_.header->required_features & LSP_FEATURE_CELLS; }
  bool has_exact_tree() const { return scene_.header->required_features & LSP_FEATURE_EXACT; }

 private:
  std::filesystem::path path_;
  lsp_mapping mapping_{};
  lsp_scene scene_{};
};

}  // namespace lsp::bench
