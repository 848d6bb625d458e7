// A mesh to look at: baked by lsp-bake, as a process of its own, into a file that lasts as long as an object.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace lsp::sample {

class BakedFile {
 public:
  // Bakes `mesh` by the lsp-bake beside this program, or else on the PATH; it says on standard error what it
  // does, unless `quiet`. Throws lsp::Failure with lsp-bake's exit code.
  BakedFile(const std::string& mesh, bool quiet);
  ~BakedFile();
  BakedFile(const BakedFile&) = delete;
  BakedFile& operator=(const BakedFile&) = delete;

  const std::filesystem::path& path() const { return path_; }
  // What lsp-bake has left out or taken otherwise than the mesh has it.
  const std::vector<std::string>& notes() const { return notes_; }

 private:
  std::filesystem::path folder_;
  std::filesystem::path path_;
  std::vector<std::string> notes_;
};

}  // namespace lsp::sample
