#include "output_file.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <string>

#include "lsp/program.h"

namespace lsp::sample {

void write_file(const std::filesystem::path& path, std::string_view bytes) {
  const std::string temporary = path.string() + ".tmp" + std::to_string(::getpid());
  const auto fail = [&](const char* what) {
    const int error = errno;
    ::unlink(temporary.c_str());
    throw Failure(Exit::kFile, path.string(),
                  std::string(what) + " (" + std::strerror(error) + "); choose a folder you can write to");
  };
  const int file = ::open(temporary.c_str(), O_CREAT | O_EXCL | O_WRONLY | O_CLOEXEC, 0666);
  if (file < 0) fail("cannot be created");
  size_t done = 0;
  while (done < bytes.size()) {
    const ssize_t count = ::write(file, bytes.data() + done, bytes.size() - done);
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) {
      ::close(file);
      fail("cannot be written");
    }
    done += static_cast<size_t>(count);
  }
  if (::fsync(file) != 0) {
    ::close(file);
    fail("cannot be written");
  }
  if (::close(file) != 0) fail("cannot be written");
  if (::rename(temporary.c_str(), path.c_str()) != 0) fail("cannot be replaced");
}

}  // namespace lsp::sample
