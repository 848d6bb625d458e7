#include "shared_bake.h"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include "lsp/program.h"
#include "process.h"

namespace lsp::bench {
namespace {

namespace fs = std::filesystem;

// Held until the end of the scope; another process's baked() of the same file waits.
class FileLock {
 public:
  explicit FileLock(const fs::path& path)
      : descriptor_(open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0666)) {
    if (descriptor_ < 0 || flock(descriptor_, LOCK_EX) != 0) {
      throw Failure(Exit::kFile, path.string(), "cannot be locked");
    }
  }
  ~FileLock() { close(descriptor_); }
  FileLock(const FileLock&) = delete;
  FileLock& operator=(const FileLock&) = delete;

 private:
  int descriptor_;
};

}  // namespace

fs::path shared_bake(const fs::path& input, const std::vector<std::string>& options,
                     const fs::path& directory) {
  std::string name = input.filename().string();
  for (const std::string& option : options) name += option;
  const fs::path out = directory / (name + ".lsp");
  const fs::path program = program_path("lsp-bake");
  fs::create_directories(directory);
  const FileLock lock(directory / (name + ".lock"));
  if (fs::exists(out) && fs::last_write_time(out) > fs::last_write_time(program) &&
      fs::last_write_time(out) > fs::last_write_time(input)) {
    return out;
  }
  std::vector<std::string> command = {program.string(), input.string(), "-o", out.string(), "--quiet"};
  command.insert(command.end(), options.begin(), options.end());
  const ProcessResult result = run_process(command);
  if (result.exit_code != 0) {
    throw Failure(Exit::kInternal, input.string(), "lsp-bake failed: " + result.errors);
  }
  return out;
}

}  // namespace lsp::bench
