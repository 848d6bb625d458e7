// A file that is there only once it is whole.
#pragma once

#include <cstdint>
#include <filesystem>

namespace lsp {

// Written beside `path` under another name, removed again unless commit() is called. All functions throw
// Failure with Exit::kFile, naming `path`.
class TemporaryFile {
 public:
  explicit TemporaryFile(const std::filesystem::path& path);
  ~TemporaryFile();
  TemporaryFile(const TemporaryFile&) = delete;
  TemporaryFile& operator=(const TemporaryFile&) = delete;

  void write(const void* data, size_t size);
  void pad_to(uint64_t position);  // with zeros
  // No more is written: the bytes are on the disk, and the file is closed.
  void finish();
  // Gives the file its name, after finish() if need be: an older one of it is replaced.
  void commit();
  const std::filesystem::path& path() const { return path_; }

 private:
  [[noreturn]] void fail(const char* what) const;

  std::filesystem::path path_, temporary_;  // the latter empty once it is gone
  int fd_ = -1;
  uint64_t position_ = 0;
};

// Throws Failure with Exit::kFile where `output` has no folder to lie in: before the work.
void check_folder(const std::filesystem::path& output);

}  // namespace lsp
