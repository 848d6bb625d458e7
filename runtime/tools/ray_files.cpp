#include "ray_files.h"

#include <cerrno>
#include <cstring>

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include "lsp/output_file.h"
#include "lsp/program.h"

namespace lsp {
namespace {

// A file descriptor that closes itself.
class File {
 public:
  // Non-blocking, or opening a pipe without a writer would wait for one.
  explicit File(const std::string& path) : handle_(open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK)) {}
  ~File() {
    if (handle_ >= 0) close(handle_);
  }
  File(const File&) = delete;
  File& operator=(const File&) = delete;
  int handle() const { return handle_; }

 private:
  int handle_;
};

[[noreturn]] void fail(const std::string& path, const char* what, const char* remedy) {
  throw Failure(Exit::kFile, path, std::string(what) + " (" + strerror(errno) + "); " + remedy);
}

}  // namespace

std::vector<LspRay> read_rays(const std::string& path) {
  const File file(path);
  if (file.handle() < 0) fail(path, "cannot be opened", "check the path and its permissions");
  struct stat status {};
  if (fstat(file.handle(), &status) != 0) fail(path, "cannot be read", "check the file");
  if (!S_ISREG(status.st_mode))
    throw Failure(Exit::kFile, path, "is not a regular file; give a file of rays");
  const auto bytes = static_cast<size_t>(status.st_size);
  if (bytes % sizeof(LspRay) != 0) {
    throw Failure(Exit::kInvalid, path,
                  "has " + std::to_string(bytes) +
                      " bytes, not a multiple of 32; rays are origin, tmin, direction, "
                      "tmax as float32");
  }
  std::vector<LspRay> rays(bytes / sizeof(LspRay));
  for (size_t done = 0; done < bytes;) {
    const ssize_t got = read(file.handle(), reinterpret_cast<char*>(rays.data()) + done, bytes - done);
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) fail(path, "cannot be read", "check the file");
    if (got == 0) throw Failure(Exit::kFile, path, "became shorter while it was read; try again");
    done += static_cast<size_t>(got);
  }
  return rays;
}

void write_hits(const std::string& path, std::span<const LspHit> hits) {
  write_file(path, {reinterpret_cast<const char*>(hits.data()), hits.size_bytes()});
}

}  // namespace lsp
