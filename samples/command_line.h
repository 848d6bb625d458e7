// The part of a command line that all sample programs share: CLI11 with the project's exit codes and options.
#pragma once

#include <CLI/CLI.hpp>
#include <functional>
#include <iostream>

#include "lsp/layout.h"
#include "lsp/program.h"

namespace lsp::sample {

struct CommonOptions {
  bool quiet = false;  // no progress, no figures
  bool json = false;   // one JSON object on standard output and nothing else there
};

// Adds --version, --quiet and --json.
inline void add_common_options(CLI::App& app, const char* program, CommonOptions& options) {
  app.set_version_flag("--version", std::string(program) + " " + kProgramVersion + ", format " +
                                        std::to_string(LSP_VERSION_MAJOR) + "." +
                                        std::to_string(LSP_VERSION_MINOR));
  app.add_flag("--quiet", options.quiet, "Print nothing but errors");
  app.add_flag("--json", options.json, "Print one JSON object on standard output");
}

// Parses, runs `body` and turns what is thrown into a message on standard error and an exit code.
inline int run_program(const char* program, CLI::App& app, int argc, char** argv,
                       const std::function<void()>& body) {
  try {
    app.parse(argc, argv);
    body();
    return static_cast<int>(Exit::kDone);
  } catch (const CLI::Success& e) {  // --help, --version
    app.exit(e);
    return static_cast<int>(Exit::kDone);
  } catch (const CLI::ParseError& e) {
    std::cerr << program << ": " << e.what() << "; see " << program << " --help\n";
    return static_cast<int>(Exit::kUsage);
  } catch (const Failure& e) {
    std::cerr << program << ": " << (e.file().empty() ? "" : e.file() + ": ") << e.what() << "\n";
    return static_cast<int>(e.exit());
  } catch (const std::exception& e) {
    std::cerr << program << ": internal error: " << e.what() << "; please report it\n";
    return static_cast<int>(Exit::kInternal);
  }
}

}  // namespace lsp::sample
