#include "bake_first.h"

#include <fcntl.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <nlohmann/json.hpp>

#include "lsp/program.h"

namespace lsp::sample {
namespace {

std::string find_baker() {
  std::error_code error;
  const std::filesystem::path self = std::filesystem::read_symlink("/proc/self/exe", error);
  const std::filesystem::path beside = self.parent_path() / "lsp-bake";
  return !error && ::access(beside.c_str(), X_OK) == 0 ? beside.string() : "lsp-bake";
}

// The signals that would end this program, but for those that are ignored, wait for as long as this lives.
class HeldSignals {
 public:
  HeldSignals() {
    sigemptyset(&held_);
    sigaddset(&held_, SIGCHLD);
    for (const int signal : {SIGINT, SIGTERM, SIGHUP}) {
      struct sigaction action {};
      if (sigaction(signal, nullptr, &action) == 0 && action.sa_handler != SIG_IGN) sigaddset(&held_, signal);
    }
    sigprocmask(SIG_BLOCK, &held_, &before_);
  }
  ~HeldSignals() { sigprocmask(SIG_SETMASK, &before_, nullptr); }
  HeldSignals(const HeldSignals&) = delete;
  HeldSignals& operator=(const HeldSignals&) = delete;
  const sigset_t& before() const { return before_; }

  // Waits for the child, which is to end where this program is.
  int wait_for(pid_t child, int* status) const {
    int ended_by = 0;
    while (waitpid(child, status, WNOHANG) != child) {
      const int signal = sigwaitinfo(&held_, nullptr);
      if (signal <= 0 || signal == SIGCHLD) continue;
      ended_by = signal;
      kill(child, signal);
    }
    return ended_by;
  }

 private:
  sigset_t held_, before_;
};

struct Ended {
  int exit;    // the program's exit code
  int signal;  // that this program got meanwhile, 0: none
};

// Runs a program with its standard output in the file `out`.
Ended run_into(const std::filesystem::path& out, const std::vector<std::string>& words) {
  std::vector<char*> arguments;
  for (const std::string& word : words) arguments.push_back(const_cast<char*>(word.c_str()));
  arguments.push_back(nullptr);
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, out.c_str(), O_WRONLY | O_CREAT, 0600);
  const HeldSignals held;
  posix_spawnattr_t attributes;
  posix_spawnattr_init(&attributes);
  posix_spawnattr_setsigmask(&attributes, &held.before());
  posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETSIGMASK);
  pid_t child = 0;
  const int failed = posix_spawnp(&child, arguments[0], &actions, &attributes, arguments.data(), environ);
  posix_spawnattr_destroy(&attributes);
  posix_spawn_file_actions_destroy(&actions);
  if (failed != 0) {
    throw Failure(
        Exit::kFile, words[0],
        std::string("cannot be run (") + std::strerror(failed) + "); install it beside this program");
  }
  int status = 0;
  const int signal = held.wait_for(child, &status);
  return {WIFEXITED(status) ? WEXITSTATUS(status) : static_cast<int>(Exit::kInternal), signal};
}

// What a baker's report says is wrong, behind a colon; nothing where it says nothing.
std::string reason(const nlohmann::json& report) {
  const bool said = report.is_object() && report.contains("error") && report["error"].is_string();
  return said ? ": " + report["error"].get<std::string>() : "";
}

// For a folder of this program's own; `mesh` is what it is wanted for.
std::filesystem::path make_folder(const std::string& mesh) {
  std::error_code error;
  const std::filesystem::path parent = std::filesystem::temp_directory_path(error);
  std::string pattern = (parent / "lsp-view-XXXXXX").string();
  if (error || ::mkdtemp(pattern.data()) == nullptr)
    throw Failure(Exit::kFile, mesh,
                  "is baked into a folder for temporary files, which cannot be made (" +
                      (error ? error.message() : std::strerror(errno)) +
                      "); set TMPDIR to one you can write to");
  return pattern;
}

}  // namespace

BakedFile::BakedFile(const std::string& mesh, bool quiet) {
  folder_ = make_folder(mesh);
  path_ = folder_ / "scene.lsp";
  try {
    std::vector<std::string> words{find_baker(), mesh, "-o", path_.string(), "--json"};
    if (quiet) words.emplace_back("--quiet");
    const std::filesystem::path path = folder_ / "report.json";
    const Ended ended = run_into(path, words);
    std::ifstream text(path);
    const nlohmann::json report = nlohmann::json::parse(text, nullptr, false);
    text.close();
    if (ended.signal != 0) {
      std::error_code ignored;
      std::filesystem::remove_all(folder_, ignored);
      raise(ended.signal);
    }
    if (ended.exit != 0)
      throw Failure(static_cast<Exit>(ended.exit), mesh,
                    "cannot be shown, as lsp-bake could not bake it" + reason(report));
    notes_ = report.at("notes").get<std::vector<std::string>>();
  } catch (...) {
    std::error_code ignored;
    std::filesystem::remove_all(folder_, ignored);
    throw;
  }
}

BakedFile::~BakedFile() {
  std::error_code ignored;
  std::filesystem::remove_all(folder_, ignored);
}

}  // namespace lsp::sample
