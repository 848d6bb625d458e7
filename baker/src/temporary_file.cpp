#include "temporary_file.h"

#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <string>
#include <utility>

#include "lsp/program.h"

namespace lsp {

TemporaryFile::TemporaryFile(const std::filesystem::path& path) : path_(path) {
  std::string name = path.string() + ".XXXXXX";
  fd_ = mkstemp(name.data());
  if (fd_ < 0) fail("cannot write here");
  temporary_ = name;
  const mode_t mask = umask(0);
  umask(mask);
  (void)!fchmod(fd_, 0666 & ~mask);
}

TemporaryFile::~TemporaryFile() {
  if (fd_ >= 0) close(fd_);
  if (!temporary_.empty()) unlink(temporary_.c_str());
}

void TemporaryFile::write(const void* data, size_t size) {
  const char* p = static_cast<const char*>(data);
  while (size > 0) {
    const ssize_t n = ::write(fd_, p, size);
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) fail("cannot write");
    p += n;
    size -= size_t(n);
    position_ += uint64_t(n);
  }
}

void TemporaryFile::pad_to(uint64_t position) {
  static const char zeros[4096] = {};
  while (position_ < position) write(zeros, size_t(std::min<uint64_t>(sizeof zeros, position - position_)));
}

void TemporaryFile::finish() {
  if (fd_ < 0) return;
  if (fsync(fd_) != 0) fail("cannot write");
  close(std::exchange(fd_, -1));
}

void TemporaryFile::commit() {
  finish();
  if (rename(temporary_.c_str(), path_.c_str()) != 0) fail("cannot replace the file");
  temporary_.clear();
}

void TemporaryFile::fail(const char* what) const {
  throw Failure(
      Exit::kFile, path_.string(),
      std::string(what) + ": " + std::strerror(errno) + "; give another place with -o or make room");
}

void check_folder(const std::filesystem::path& output) {
  const std::filesystem::path folder = output.has_parent_path() ? output.parent_path() : ".";
  if (!std::filesystem::is_directory(folder))
    throw Failure(Exit::kFile, output.string(),
                  "cannot be written: there is no folder " + folder.string() + ", make it or choose another");
}

}  // namespace lsp
