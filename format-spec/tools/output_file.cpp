#include "lsp/output_file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <utility>

#include "lsp/program.h"

namespace lsp {
namespace {

namespace fs = std::filesystem;

fs::path folder_of(const fs::path& path) { return path.has_parent_path() ? path.parent_path() : "."; }

// By which a file without a name can be linked.
std::string name_of(int fd) { return "/proc/self/fd/" + std::to_string(fd); }

// `target`'s name with `end`, cut where a file system allows no more.
std::string beside(const fs::path& target, const std::string& end) {
  constexpr size_t kLongestName = 255;
  const std::string name = target.filename().string();
  return (target.parent_path() / (name.substr(0, kLongestName - end.size()) + end)).string();
}

constexpr const char* kRemedy = "; give another place or make room";

}  // namespace

OutputFile::OutputFile(const fs::path& path) : path_(path), target_(path) {
  struct stat status {};
  if (stat(path.c_str(), &status) == 0) {
    direct_ = !S_ISREG(status.st_mode);
    std::error_code error;
    const fs::path real = fs::canonical(path, error);
    if (!error && !direct_) target_ = real;
  }
  if (direct_) {
    fd_ = open(path.c_str(), O_WRONLY | O_CLOEXEC);
  } else if (!open_without_a_name()) {
    temporary_ = beside(target_, ".XXXXXX");
    fd_ = mkostemp(temporary_.data(), O_CLOEXEC);
    const mode_t mask = umask(0);
    umask(mask);
    if (fd_ >= 0) (void)!fchmod(fd_, 0666 & ~mask);
    if (fd_ < 0) temporary_.clear();
  }
  if (fd_ < 0) fail("cannot be written");
}

OutputFile::~OutputFile() {
  if (fd_ >= 0) close(fd_);
  if (!temporary_.empty()) unlink(temporary_.c_str());
}

bool OutputFile::open_without_a_name() {
  fd_ = open(folder_of(target_).c_str(), O_TMPFILE | O_WRONLY | O_CLOEXEC, 0666);
  if (fd_ >= 0 && access(name_of(fd_).c_str(), F_OK) != 0) close(std::exchange(fd_, -1));
  return fd_ >= 0;
}

// One beside its own, which only renaming can take from another file.
void OutputFile::give_a_name() {
  const auto link_to = [&](const fs::path& name) {
    return linkat(AT_FDCWD, name_of(fd_).c_str(), AT_FDCWD, name.c_str(), AT_SYMLINK_FOLLOW) == 0;
  };
  for (uint32_t number = 0; temporary_.empty(); ++number) {
    const std::string name =
        beside(target_, ".tmp" + std::to_string(getpid()) + "-" + std::to_string(number));
    if (link_to(name)) temporary_ = name;
    if (temporary_.empty() && errno != EEXIST) fail("cannot be written");
  }
}

void OutputFile::write(const void* data, size_t size) {
  const char* p = static_cast<const char*>(data);
  while (size > 0) {
    const ssize_t n = ::write(fd_, p, size);
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) fail("cannot be written");
    p += n;
    size -= size_t(n);
    position_ += uint64_t(n);
  }
}

void OutputFile::pad_to(uint64_t position) {
  static const char zeros[4096] = {};
  while (position_ < position) write(zeros, size_t(std::min<uint64_t>(sizeof zeros, position - position_)));
}

void OutputFile::finish() {
  if (synced_) return;
  if (!direct_ && fsync(fd_) != 0) fail("cannot be written");
  synced_ = true;
  // A scene's assets wait for one another, and descriptors are few.
  constexpr int kMostOpen = 256;
  if (fd_ < kMostOpen && temporary_.empty()) return;
  if (temporary_.empty()) give_a_name();
  if (close(std::exchange(fd_, -1)) != 0) fail("cannot be written");
}

void OutputFile::commit() {
  finish();
  if (!direct_) {
    if (temporary_.empty()) give_a_name();
    if (rename(temporary_.c_str(), target_.c_str()) != 0) fail("cannot be replaced");
    temporary_.clear();
  }
  if (fd_ >= 0 && close(std::exchange(fd_, -1)) != 0) fail("cannot be written");
}

void OutputFile::fail(const char* what) const {
  throw Failure(Exit::kFile, path_.string(), std::string(what) + ": " + std::strerror(errno) + kRemedy);
}

void write_file(const fs::path& path, std::string_view bytes) {
  OutputFile file(path);
  file.write(bytes.data(), bytes.size());
  file.commit();
}

void check_output(const fs::path& output, std::span<const fs::path> inputs) {
  std::error_code error;
  const fs::path folder = folder_of(output);
  if (!fs::is_directory(folder, error))
    throw Failure(Exit::kFile, output.string(),
                  "cannot be written: there is no folder " + folder.string() + ", make it or choose another");
  const bool is_folder = fs::is_directory(output, error);
  if (error == std::errc::filename_too_long)
    throw Failure(Exit::kFile, output.string(),
                  "cannot be written: the name is too long, give a shorter one");
  if (is_folder) throw Failure(Exit::kFile, output.string(), "is a folder; give the name of a file in it");
  for (const fs::path& input : inputs)
    if (fs::equivalent(output, input, error))
      throw Failure(Exit::kUsage, output.string(), "is read, too, and would be lost; give another name");
  const bool replaced = !fs::exists(output, error) || fs::is_regular_file(output, error);
  if (replaced && access(folder.c_str(), W_OK) != 0)
    throw Failure(Exit::kFile, output.string(),
                  "cannot be written: " + std::string(std::strerror(errno)) + kRemedy);
}

}  // namespace lsp
