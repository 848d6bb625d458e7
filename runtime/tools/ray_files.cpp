#include "ray_files.h"

#include <cerrno>
#include <cstring>
#include <utility>

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include "lsp/program.h"

namespace lsp {
namespace {

// A file descriptor that closes itself.
class File {
 public:
  File(const std::string& path, int flags) : handle_(open(path.c_str(), flags | O_CLOEXEC, 0666)) {}
  ~File() { close_now(); }
  File(const File&) = delete;
  File& operator=(const File&) = delete;
  int handle() const { return handle_; }
  bool close_now() {
    const int handle = std::exchange(handle_, -1);
    return handle < 0 || close(handle) == 0;
  }

 private:
  int handle_;
};

[[noreturn]] void fail(const std::string& path, const char* what, const char* remedy) {
  throw Failure(Exit::kFile, path, std::string(what) + " (" + strerror(errno) + "); " + remedy);
}

}  // namespace

std::vector<LspRay> read_rays(const std::string& path) {
  const File file(path, O_RDONLY);
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
  const std::string temporary = path + ".tmp" + std::to_string(getpid());
  try {
    File file(temporary, O_WRONLY | O_CREAT | O_TRUNC);
    if (file.handle() < 0)
      fail(path, "cannot be created", "check that its folder is there and can be written");
    for (size_t done = 0; done < hits.size_bytes();) {
      const ssize_t got =
          write(file.handle(), reinterpret_cast<const char*>(hits.data()) + done, hits.size_bytes() - done);
      if (got < 0 && errno == EINTR) continue;
      if (got < 0) fail(path, "cannot be written", "check the space on its disk");
      done += static_cast<size_t>(got);
    }
    if (fsync(file.handle()) != 0 || !file.close_now())
      fail(path, "cannot be written", "check the space on its disk");
    if (rename(temporary.c_str(), path.c_str()) != 0)
      fail(path, "cannot be put in place", "check its folder");
  } catch (...) {
    unlink(temporary.c_str());
    throw;
  }
}

}  // namespace lsp
