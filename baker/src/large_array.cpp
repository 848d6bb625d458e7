#include "large_array.h"

#include <fcntl.h>
#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <string>

#include "lsp/program.h"

namespace lsp {
namespace {

[[noreturn]] void fail_file(const std::filesystem::path& folder) {
  throw Failure(Exit::kFile, folder.string(),
                std::string("a temporary file cannot be written here: ") + std::strerror(errno) +
                    "; make room, give another place with -o, or raise --memory-limit");
}

}  // namespace

LargeBytes::~LargeBytes() {
  if (data_ != nullptr) munmap(data_, capacity_);
  if (file_ >= 0) close(file_);
}

void LargeBytes::keep_in_file(const std::filesystem::path& folder) {
  folder_ = folder.empty() ? "." : folder;
  file_ = open(folder_.c_str(), O_TMPFILE | O_RDWR | O_CLOEXEC, 0600);
  if (file_ >= 0) return;
  // Some file systems know no files without a name.
  std::string name = (folder_ / ".lsp-bake.XXXXXX").string();
  file_ = mkostemp(name.data(), O_CLOEXEC);
  if (file_ < 0) fail_file(folder_);
  unlink(name.c_str());
}

void LargeBytes::reserve(size_t capacity) {
  if (capacity <= capacity_) return;
  constexpr size_t kStep = size_t{1} << 20;
  capacity = std::max((capacity + kStep - 1) / kStep * kStep, capacity_ + capacity_ / 2);
  if (file_ >= 0 && ftruncate(file_, static_cast<off_t>(capacity)) != 0) fail_file(folder_);
  void* grown = nullptr;
  if (data_ != nullptr)
    grown = mremap(data_, capacity_, capacity, MREMAP_MAYMOVE);
  else
    grown = mmap(nullptr, capacity, PROT_READ | PROT_WRITE,
                 file_ >= 0 ? MAP_SHARED : MAP_PRIVATE | MAP_ANONYMOUS, file_, 0);
  if (grown == MAP_FAILED)
    throw Failure(Exit::kLimit, "",
                  "there is no memory for " + std::to_string(capacity >> 20) +
                      " MiB of Line Spaces: lower --resolution or --depth, or give a --memory-limit");
  data_ = static_cast<std::byte*>(grown);
  capacity_ = capacity;
}

void LargeBytes::append(const void* bytes, size_t size) {
  if (size == 0) return;
  reserve(size_ + size);
  if (file_ < 0) {
    std::memcpy(data_ + size_, bytes, size);
  } else {
    // Not through the mapping: a full disk is an error here, there it would be a signal.
    const char* from = static_cast<const char*>(bytes);
    for (size_t done = 0; done < size;) {
      const ssize_t n = pwrite(file_, from + done, size - done, static_cast<off_t>(size_ + done));
      if (n < 0 && errno == EINTR) continue;
      if (n <= 0) fail_file(folder_);
      done += static_cast<size_t>(n);
    }
  }
  size_ += size;
}

void LargeBytes::release() const {
  if (file_ >= 0 && data_ != nullptr) madvise(data_, capacity_, MADV_DONTNEED);
}

}  // namespace lsp
