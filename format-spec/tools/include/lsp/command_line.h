// The part of a command line that all programs share: CLI11 with the project's exit codes, common options and
// a progress bar. A program that includes this links CLI11.
#pragma once

#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <iostream>
#include <mutex>
#include <new>
#include <string>
#include <string_view>
#include <type_traits>

#include "lsp/help_text.h"
#include "lsp/layout.h"
#include "lsp/program.h"

namespace lsp {

struct CommonOptions {
  bool quiet = false;  // no progress, no figures
  bool json = false;   // one JSON object on standard output and nothing else there
};

// Adds --version, --quiet and --json, and gives --help its form.
inline void add_common_options(CLI::App& app, const char* program, CommonOptions& options) {
  app.name(program);
  app.formatter(std::make_shared<HelpText>());
  app.set_help_flag("-h,--help", "Print this and exit");
  app.set_version_flag("--version",
                       std::string(program) + " " + kProgramVersion + ", format " +
                           std::to_string(LSP_VERSION_MAJOR) + "." + std::to_string(LSP_VERSION_MINOR),
                       "Print the versions of program and format and exit");
  app.add_flag("--quiet", options.quiet, "Print nothing but errors");
  app.add_flag("--json", options.json, "Print one JSON object on standard output");
}

// An option that is a number of bytes, as 512MB or 2GiB.
inline CLI::Option* add_size_option(CLI::App& app, const std::string& name, uint64_t& bytes,
                                    const std::string& description, bool kb_is_1000 = false) {
  // CLI11 alone takes -1 for the largest number there is.
  const auto refuse_negative = [](std::string& text) {
    return text.find('-') == std::string::npos ? std::string() : text + " is no size";
  };
  return app.add_option(name, bytes, description)
      ->transform(CLI::AsSizeValue(kb_is_1000))
      ->transform(CLI::Validator(refuse_negative, ""));  // the last that is added is the first that runs
}

// What was printed has come out, or is no success.
inline void check_standard_output() {
  std::cout.flush();
  if (!std::cout || std::fflush(stdout) != 0 || std::ferror(stdout) != 0)
    throw Failure(Exit::kFile, "standard output", "cannot be written, make room");
}

// CLI11 takes "nan" for a number, and for one in every range.
inline void refuse_nan(const CLI::App& app) {
  for (const CLI::Option* option : app.get_options()) {
    if (!option->get_type_name().starts_with("FLOAT")) continue;
    for (const std::string& text : option->results())
      if (double value = 0; CLI::detail::lexical_cast(text, value) && std::isnan(value))
        throw CLI::ValidationError(option->get_name(), text + " is no number");
  }
}

// Parses, runs `body` and returns its exit code: that of the Exit or int it returns, 0 if it returns nothing.
// Turns what is thrown into a message on standard error.
template <typename Body>
int run_program(const char* program, CLI::App& app, int argc, char** argv, Body&& body) {
  try {
    try {
      app.parse(argc, argv);
    } catch (const CLI::Success& e) {  // --help, --version
      app.exit(e);
      check_standard_output();
      return static_cast<int>(Exit::kDone);
    }
    refuse_nan(app);
    int exit = 0;
    if constexpr (std::is_void_v<decltype(body())>)
      body();
    else
      exit = static_cast<int>(body());
    check_standard_output();
    return exit;
  } catch (const CLI::ParseError& e) {
    std::cerr << program << ": " << e.what() << "; see " << program << " --help\n";
    return static_cast<int>(Exit::kUsage);
  } catch (const Failure& e) {
    std::cerr << program << ": " << (e.file().empty() ? "" : e.file() + ": ") << e.what() << "\n";
    return static_cast<int>(e.exit());
  } catch (const std::bad_alloc&) {
    std::cerr << program << ": out of memory; use a smaller input or a machine with more memory\n";
    return static_cast<int>(Exit::kLimit);
  } catch (const std::exception& e) {
    std::cerr << program << ": internal error: " << e.what() << "; please report it\n";
    return static_cast<int>(Exit::kInternal);
  }
}

// A bar on standard error while that is a terminal; silent otherwise. May be called from any thread.
class ProgressBar {
 public:
  explicit ProgressBar(bool wanted) : shown_(wanted && isatty(STDERR_FILENO)) {}
  ~ProgressBar() { clear(); }
  ProgressBar(const ProgressBar&) = delete;
  ProgressBar& operator=(const ProgressBar&) = delete;

  void show(std::string_view stage, double done) {
    if (!shown_) return;
    const std::lock_guard lock(mutex_);
    constexpr int kWidth = 40;
    const int filled = done < 0 ? 0 : done > 1 ? kWidth : int(done * kWidth);
    std::fprintf(stderr, "\r%-16.*s [%.*s%*s] %3d %%", int(stage.size()), stage.data(), filled,
                 "########################################", kWidth - filled, "", int(done * 100));
    std::fflush(stderr);
    drawn_ = true;
  }
  void clear() {
    const std::lock_guard lock(mutex_);
    if (drawn_) std::fprintf(stderr, "\r\033[K");
    drawn_ = false;
  }

 private:
  const bool shown_;
  bool drawn_ = false;
  std::mutex mutex_;
};

}  // namespace lsp
