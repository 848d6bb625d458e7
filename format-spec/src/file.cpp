#include "file.h"

#include <fcntl.h>
#include <lsp/program.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

namespace lsp::format {
namespace {

// Closes what it holds; the mapping outlives the descriptor.
struct Descriptor {
  int fd;
  ~Descriptor() {
    if (fd >= 0) close(fd);
  }
};

}  // namespace

MappedFile::MappedFile(const std::filesystem::path& path) {
  const auto fail = [&](const std::string& what) -> void { throw Failure(Exit::kFile, path.string(), what); };
  // Non-blocking, or opening a pipe without a writer would wait for one.
  const Descriptor file{open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK)};
  if (file.fd < 0)
    fail(std::string("cannot be opened: ") + std::strerror(errno) + "; check the name and the permissions");
  struct stat status {};
  if (fstat(file.fd, &status) != 0) fail(std::string("cannot be examined: ") + std::strerror(errno));
  if (!S_ISREG(status.st_mode)) fail("is not a regular file: give the name of one");
  size_ = static_cast<size_t>(status.st_size);
  if (size_ == 0) return;
  data_ = mmap(nullptr, size_, PROT_READ, MAP_PRIVATE, file.fd, 0);
  if (data_ == MAP_FAILED) {
    data_ = nullptr;
    fail(std::string("cannot be mapped: ") + std::strerror(errno));
  }
  madvise(data_, size_, MADV_WILLNEED);
}

MappedFile::~MappedFile() {
  if (data_ != nullptr) munmap(data_, size_);
}

}  // namespace lsp::format
