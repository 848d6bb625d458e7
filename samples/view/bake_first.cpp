#include "bake_first.h"

#include <fcntl.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
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

// Runs a program with its standard output in the file `out`, and answers its exit code.
int run_into(const std::filesystem::path& out, const std::vector<std::string>& words) {
  std::vector<char*> arguments;
  for (const std::string& word : words) arguments.push_back(const_cast<char*>(word.c_str()));
  arguments.push_back(nullptr);
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, out.c_str(), O_WRONLY | O_CREAT, 0600);
  pid_t child = 0;
  const int failed = posix_spawnp(&child, arguments[0], &actions, nullptr, arguments.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  if (failed != 0) {
    throw Failure(
        Exit::kFile, words[0],
        std::string("cannot be run (") + std::strerror(failed) + "); install it beside this program");
  }
  int status = 0;
  while (waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  return WIFEXITED(status) ? WEXITSTATUS(status) : static_cast<int>(Exit::kInternal);
}

}  // namespace

BakedFile::BakedFile(const std::string& mesh, bool quiet) {
  std::string pattern = (std::filesystem::temp_directory_path() / "lsp-view-XXXXXX").string();
  if (::mkdtemp(pattern.data()) == nullptr)
    throw Failure(Exit::kFile, pattern, "cannot be made; set TMPDIR to a folder you can write to");
  folder_ = pattern;
  path_ = folder_ / "scene.lsp";
  try {
    std::vector<std::string> words{find_baker(), mesh, "-o", path_.string(), "--json"};
    if (quiet) words.emplace_back("--quiet");
    const std::filesystem::path report = folder_ / "report.json";
    const int exit = run_into(report, words);
    if (exit != 0)
      throw Failure(static_cast<Exit>(exit), mesh, "cannot be shown, as lsp-bake could not bake it");
    std::ifstream text(report);
    notes_ = nlohmann::json::parse(text).at("notes").get<std::vector<std::string>>();
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
