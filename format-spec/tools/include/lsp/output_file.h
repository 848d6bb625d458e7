// A file that is there only once it is whole: what all programs write their results with.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>

namespace lsp {

// What is written has no name, or where the file system knows no files without one, another name beside
// `path`, until commit(): a run that fails or is killed leaves nothing, and an older file as it was. A link
// is followed. A device or a pipe, which cannot be replaced, is written to directly. All functions throw
// Failure with Exit::kFile, naming `path`.
class OutputFile {
 public:
  explicit OutputFile(const std::filesystem::path& path);
  ~OutputFile();
  OutputFile(const OutputFile&) = delete;
  OutputFile& operator=(const OutputFile&) = delete;

  void write(const void* data, size_t size);
  void pad_to(uint64_t position);  // with zeros
  // No more is written: the bytes are on the disk.
  void finish();
  // Gives the file its name, after finish() if need be: an older one of it is replaced.
  void commit();
  const std::filesystem::path& path() const { return path_; }

 private:
  [[noreturn]] void fail(const char* what) const;
  bool open_without_a_name();
  void give_a_name();

  std::filesystem::path path_, target_;  // the latter where links lead to
  std::string temporary_;                // the name until commit(), empty where there is none
  int fd_ = -1;
  uint64_t position_ = 0;
  bool direct_ = false, synced_ = false;
};

// A whole file at once.
void write_file(const std::filesystem::path& path, std::string_view bytes);

// To be called before the work. Throws Failure: kFile where `output` has no folder to lie in, that folder
// cannot be written to, or `output` is a folder itself; kUsage where it is one of `inputs`, which would be
// lost.
void check_output(const std::filesystem::path& output, std::span<const std::filesystem::path> inputs = {});

}  // namespace lsp
