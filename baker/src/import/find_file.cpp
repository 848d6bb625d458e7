#include "import/find_file.h"

#include <algorithm>

#include "import/text.h"

namespace lsp {
namespace {

namespace fs = std::filesystem;

bool is_file(const fs::path& path) {
  std::error_code error;
  return fs::is_regular_file(path, error);
}

// Follows `name` part by part, each by its exact name or else by the first that differs in case alone.
fs::path in_any_case(const fs::path& folder, const fs::path& name) {
  fs::path at = folder;
  for (const fs::path& part : name) {
    std::error_code error;
    fs::path next = at / part;
    if (!fs::exists(next, error)) {
      std::string best;
      fs::directory_iterator entry(at.empty() ? "." : at, error);
      for (; !error && entry != fs::directory_iterator(); entry.increment(error)) {
        const std::string found = entry->path().filename().string();
        if (equals_ignoring_case(found, part.string()) && (best.empty() || found < best)) best = found;
      }
      if (best.empty()) return {};
      next = at / best;
    }
    at = next;
  }
  return is_file(at) ? at : fs::path();
}

}  // namespace

fs::path find_file(const fs::path& folder, std::string name, bool& guessed) {
  guessed = false;
  if (name.empty() || name.find('\0') != name.npos) return {};
  if (is_file(folder / name)) return folder / name;
  std::replace(name.begin(), name.end(), '\\', '/');
  const fs::path beside = fs::path(name).filename();
  if (is_file(folder / name)) return folder / name;
  guessed = true;
  if (is_file(folder / beside)) return folder / beside;
  for (const fs::path& tail : {fs::path(name), beside}) {
    if (tail.is_absolute()) continue;
    if (fs::path found = in_any_case(folder, tail); !found.empty()) return found;
  }
  return {};
}

fs::path path_beside(const fs::path& folder, std::string name) {
  std::replace(name.begin(), name.end(), '\\', '/');
  return folder / name.substr(0, name.find('\0'));
}

}  // namespace lsp
