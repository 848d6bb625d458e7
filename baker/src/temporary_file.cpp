#include "temporary_file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <string>

#include "lsp/program.h"

namespace lsp {

TemporaryFile::TemporaryFile(const std::filesystem::path& path) : path_(path), temporary_(path) {
  temporary_ += ".XXXXXX";
  std::string name = temporary_.string();
  fd_ = mkstemp(name.data());
  temporary_ = name;
  if (fd_ < 0) fail("cannot write here");
  fchmod_default();
}

TemporaryFile::~TemporaryFile() {
  if (fd_ >= 0) {
    close(fd_);
    unlink(temporary_.c_str());
  }
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

void TemporaryFile::commit() {
  if (fsync(fd_) != 0) fail("cannot write");
  if (rename(temporary_.c_str(), path_.c_str()) != 0) fail("cannot replace the file");
  close(fd_);
  fd_ = -1;
}

void TemporaryFile::fchmod_default() {
  const mode_t mask = umask(0);
  umask(mask);
  (void)!fchmod(fd_, 0666 & ~mask);
}

void TemporaryFile::fail(const char* what) {
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
