#include "open_file.h"

#include "lsp/program.h"

namespace lsp::bench {

OpenFile::OpenFile(const std::filesystem::path& path) : path_(path) {
  lsp_error error{};
  if (lsp_map_file(path.c_str(), &mapping_, &error) != LSP_OK) {
    throw Failure(static_cast<Exit>(error.status), path.string(), error.message);
  }
  if (lsp_open(mapping_.bytes, mapping_.size, &scene_, &error) != LSP_OK) {
    lsp_unmap_file(&mapping_);
    throw Failure(static_cast<Exit>(error.status), path.string(), error.message);
  }
}

OpenFile::~OpenFile() { lsp_unmap_file(&mapping_); }

}  // namespace lsp::bench
