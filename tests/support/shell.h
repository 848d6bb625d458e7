// Programs run as a user runs them.
#pragma once

#include <sys/wait.h>

#include <cstdlib>
#include <filesystem>
#include <string>

#include "temporary_folder.h"

namespace lsp::test {

// Runs a line of sh in a folder; the build's programs are found first. Returns its exit code, -1 where a
// signal ended it.
inline int shell(const std::string& line, const std::filesystem::path& folder = ".") {
  const int status =
      std::system(("cd '" + folder.string() + "' && PATH='" LSP_BIN_DIR ":'\"$PATH\" && " + line).c_str());
  return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

}  // namespace lsp::test
