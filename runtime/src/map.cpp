// Files as read-only mappings. Nothing is read here: pages come in when they are first touched.
#include <cerrno>
#include <cstring>

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include "error.h"

namespace {

// The GNU strerror_r, which may answer without using the buffer; strerror is not safe between threads.
struct SystemMessage {
  char buffer[96];
  const char* text;
  explicit SystemMessage(int code) noexcept : buffer{}, text(strerror_r(code, buffer, sizeof buffer)) {}
};

}  // namespace

extern "C" lsp_status lsp_map_file(const char* path, lsp_mapping* mapping, lsp_error* error) {
  mapping->bytes = nullptr;
  mapping->size = 0;
  // Non-blocking, or opening a pipe without a writer would wait for one.
  const int file = open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK);
  if (file < 0) {
    const SystemMessage why(errno);
    return lsp::fail(error, LSP_ERROR_FILE, 0, "cannot be opened (%s); check the path and its permissions",
                     why.text);
  }
  struct stat status {};
  if (fstat(file, &status) != 0) {
    const SystemMessage why(errno);
    close(file);
    return lsp::fail(error, LSP_ERROR_FILE, 0, "its size cannot be read (%s)", why.text);
  }
  if (!S_ISREG(status.st_mode)) {
    close(file);
    return lsp::fail(error, LSP_ERROR_FILE, 0, "%s; give a regular file, which can be mapped",
                     S_ISDIR(status.st_mode) ? "is a directory" : "is not a regular file");
  }
  if (status.st_size == 0) {
    close(file);
    return lsp::fail(error, LSP_ERROR_INVALID, 0, "is empty; bake it again");
  }
  // Shared, not private: only for shared mappings is it defined that a change of the file shows in them.
  void* bytes = mmap(nullptr, static_cast<size_t>(status.st_size), PROT_READ, MAP_SHARED, file, 0);
  const int code = errno;
  close(file);
  if (bytes == MAP_FAILED) {
    const SystemMessage why(code);
    return lsp::fail(error, LSP_ERROR_FILE, 0, "cannot be mapped (%s)", why.text);
  }
  mapping->bytes = bytes;
  mapping->size = static_cast<uint64_t>(status.st_size);
  return lsp::succeed(error);
}

extern "C" void lsp_unmap_file(lsp_mapping* mapping) {
  if (mapping->bytes != nullptr)
    munmap(const_cast<void*>(mapping->bytes), static_cast<size_t>(mapping->size));
  mapping->bytes = nullptr;
  mapping->size = 0;
}

extern "C" void lsp_release_pages(const lsp_mapping* mapping) {
  // Of a file, not of memory: what is dropped is still there. Where the system refuses nothing is lost.
  if (mapping->bytes != nullptr)
    madvise(const_cast<void*>(mapping->bytes), static_cast<size_t>(mapping->size), MADV_DONTNEED);
}
