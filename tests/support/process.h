// Running the project's own programs as a user would.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace lsp::bench {

struct ProcessResult {
  int exit_code = -1;       // 128 + signal where a signal ended it
  std::string output;       // standard output
  std::string errors;       // standard error
  double seconds = 0;       // wall clock
  uint64_t peak_bytes = 0;  // largest resident set, looked at every 10 ms
};

// Runs `command` and waits. Throws Failure(kInternal) where it cannot be started.
ProcessResult run_process(const std::vector<std::string>& command);

// A program of this project: beside this executable. Throws Failure(kFile) where it is not built.
std::filesystem::path program_path(const std::string& name);

}  // namespace lsp::bench
