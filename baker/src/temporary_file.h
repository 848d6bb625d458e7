// A file that appears under its name when it is whole, and never otherwise.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>

namespace lsp {

// A file under a temporary name, beside its own, until commit(). Throws Failure with Exit::kFile.
class TemporaryFile {
 public:
  explicit TemporaryFile(const std::filesystem::path& path);
  ~TemporaryFile();
  TemporaryFile(const TemporaryFile&) = delete;
  TemporaryFile& operator=(const TemporaryFile&) = delete;

  void write(const void* data, size_t size);
  // Writes zeros up to there.
  void pad_to(uint64_t position);
  void commit();

 private:
  void fchmod_default();
  [[noreturn]] void fail(const char* what);

  std::filesystem::path path_, temporary_;
  int fd_ = -1;
  uint64_t position_ = 0;
};

// Throws Failure with Exit::kFile where `output` has no folder to lie in: before the work.
void check_folder(const std::filesystem::path& output);

}  // namespace lsp
