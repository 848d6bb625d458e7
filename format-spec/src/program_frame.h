// The frame of the format's programs: options that all have, errors, exit codes.
#pragma once

#include <CLI/CLI.hpp>
#include <functional>
#include <string>

namespace lsp::format {

struct CommonOptions {
  bool quiet = false;
  bool json = false;
};

// Adds --quiet, --json and --version to `app`, which lives as long as the parse.
void add_common_options(CLI::App& app, CommonOptions& options);

// Parses the command line and runs `body`, whose result is the exit code. Usage errors end with 1, a Failure
// with its code and "PROGRAM: FILE: MESSAGE" on standard error, anything else with 4.
int run_program(CLI::App& app, int argc, char** argv, const std::function<int()>& body);

}  // namespace lsp::format
