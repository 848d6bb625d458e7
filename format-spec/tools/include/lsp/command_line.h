// The part of a command line that all programs share: CLI11 with the project's exit codes, common options and
// a progress bar. A program that includes this links CLI11.
#pragma once

#include <unistd.h>

#include <cerrno>
#include <CLI/CLI.hpp>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <iostream>
#include <mutex>
#include <new>
#include <string>
#include <string_view>
#include <type_traits>

#include "lsp/help_text.h"
#include "lsp/json_result.h"
#include "lsp/layout.h"
#include "lsp/program.h"
#include "lsp/usage_error.h"

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
  app.add_flag(
      "--json", options.json,
      "Print one JSON object on standard output: what was done, exit (the exit code) and, where that is "
      "not 0, error (what is wrong)");
}

// An option that is a number of bytes, as 512MB or 2GiB.
inline CLI::Option* add_size_option(CLI::App& app, const std::string& name, uint64_t& bytes,
                                    const std::string& description, bool kb_is_1000 = false) {
  // CLI11 alone takes -1, and what is larger, for the largest number there is.
  const auto refuse_none = [](std::string& text) {
    if (text.find('-') != std::string::npos) return text + " is no size";
    errno = 0;
    (void)std::strtoull(text.c_str(), nullptr, 10);
    return errno == ERANGE ? text + " is too large" : std::string();
  };
  return app.add_option(name, bytes, description)
      ->transform(CLI::AsSizeValue(kb_is_1000))
      ->transform(CLI::Validator(refuse_none, ""));  // the last that is added is the first that runs
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

// How a program ended; `error` is empty where nothing is to be said.
struct Ending {
  Exit exit = Exit::kDone;
  std::string file = {};  // that `error` is about, where it is about one
  std::string error = {};
};

// Whether --json is among the words: asked of these, as an error in one keeps CLI11 from reading the next.
inline bool asks_for_json(int argc, char** argv) {
  for (int i = 1; i < argc && std::string_view(argv[i]) != "--"; ++i)
    if (std::string_view(argv[i]) == "--json") return true;
  return false;
}

// Parses, runs `body` and says how that ended. `says_itself`: it was asked for --help or --version.
template <typename Body>
Ending parse_and_run(const char* program, CLI::App& app, int argc, char** argv, Body& body,
                     bool& says_itself) {
  try {
    refuse_empty_words(app, argc, argv);
    try {
      app.parse(argc, argv);
    } catch (const CLI::Success& e) {
      says_itself = true;
      app.exit(e);
      return {};
    }
    refuse_nan(app);
    if constexpr (std::is_void_v<decltype(body())>) {
      body();
      return {};
    } else {
      return body();
    }
  } catch (const CLI::ParseError& e) {
    return {Exit::kUsage, "", in_plain_words(app, e) + "; see " + program + " --help"};
  } catch (const Failure& e) {
    return {e.exit(), e.file(), e.what()};
  } catch (const std::bad_alloc&) {
    return {Exit::kLimit, "", "out of memory; use a smaller input or a machine with more memory"};
  } catch (const std::exception& e) {
    return {Exit::kInternal, "", std::string("internal error: ") + e.what() + "; please report it"};
  }
}

// The object of --json, whatever has been put into json_result().
inline void print_result(const char* program, const Ending& ending) {
  nlohmann::ordered_json json = {{"program", program}, {"version", kProgramVersion}};
  if (!json_result().is_null()) json.update(json_result());
  json["exit"] = static_cast<int>(ending.exit);
  if (!ending.file.empty() && !json.contains("file")) json["file"] = ending.file;
  if (!ending.error.empty()) json["error"] = ending.error;
  print_json(json);
}

// Runs `body`, which returns nothing or an Ending, once the arguments are parsed, and returns the exit code.
// What is thrown becomes a message on standard error and a member of --json's object.
template <typename Body>
int run_program(const char* program, CLI::App& app, int argc, char** argv, Body&& body) {
  const auto complain = [&](const Ending& ending) {
    if (!ending.error.empty())
      std::cerr << program << ": " << (ending.file.empty() ? "" : ending.file + ": ") << ending.error << "\n";
    return static_cast<int>(ending.exit);
  };
  bool says_itself = false;
  const Ending ending = parse_and_run(program, app, argc, argv, body, says_itself);
  const int exit = complain(ending);
  try {
    if (asks_for_json(argc, argv) && !says_itself) print_result(program, ending);
    check_standard_output();
    return exit;
  } catch (const Failure& e) {
    return exit != 0 ? exit : complain({e.exit(), e.file(), e.what()});
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
