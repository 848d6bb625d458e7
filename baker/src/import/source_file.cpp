#include "import/source_file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "lsp/program.h"

namespace lsp {
namespace {

// Closes the descriptor on every way out.
struct Descriptor {
  int fd;
  ~Descriptor() {
    if (fd >= 0) close(fd);
  }
};

void append_utf8(std::string& out, uint32_t code) {
  if (code < 0x80) {
    out += char(code);
  } else if (code < 0x800) {
    out += char(0xC0 | code >> 6);
    out += char(0x80 | (code & 0x3F));
  } else if (code < 0x10000) {
    out += char(0xE0 | code >> 12);
    out += char(0x80 | (code >> 6 & 0x3F));
    out += char(0x80 | (code & 0x3F));
  } else {
    out += char(0xF0 | code >> 18);
    out += char(0x80 | (code >> 12 & 0x3F));
    out += char(0x80 | (code >> 6 & 0x3F));
    out += char(0x80 | (code & 0x3F));
  }
}

std::string utf8_of_utf16(std::string_view bytes, bool big_endian) {
  const auto unit = [&](size_t i) {
    const auto first = uint8_t(bytes[2 * i]), second = uint8_t(bytes[2 * i + 1]);
    return uint32_t(big_endian ? first << 8 | second : second << 8 | first);
  };
  const size_t count = bytes.size() / 2;
  std::string out;
  out.reserve(count);
  for (size_t i = 0; i < count; ++i) {
    uint32_t code = unit(i);
    if (code >= 0xD800 && code < 0xDC00 && i + 1 < count && unit(i + 1) >= 0xDC00 && unit(i + 1) < 0xE000) {
      code = 0x10000 + ((code - 0xD800) << 10) + (unit(i + 1) - 0xDC00);
      ++i;
    } else if (code >= 0xD800 && code < 0xE000) {
      code = '?';
    }
    append_utf8(out, code);
  }
  return out;
}

// How many bytes the UTF-8 character at `i` has; 0 where there is none. No overlong forms, no surrogates,
// nothing beyond U+10FFFF.
size_t utf8_length(std::string_view text, size_t i) {
  const auto lead = uint8_t(text[i]);
  const size_t length = lead < 0x80                   ? 1
                        : lead >= 0xC2 && lead < 0xE0 ? 2
                        : lead >= 0xE0 && lead < 0xF0 ? 3
                        : lead >= 0xF0 && lead < 0xF5 ? 4
                                                      : 0;
  if (i + length > text.size()) return 0;
  for (size_t k = 1; k < length; ++k) {
    if ((uint8_t(text[i + k]) & 0xC0) != 0x80) return 0;
  }
  if (length < 3) return length;
  const auto second = uint8_t(text[i + 1]);
  const bool wrong = (lead == 0xE0 && second < 0xA0) || (lead == 0xED && second >= 0xA0) ||
                     (lead == 0xF0 && second < 0x90) || (lead == 0xF4 && second >= 0x90);
  return wrong ? 0 : length;
}

}  // namespace

std::string read_file(const std::filesystem::path& path, Budget& budget) {
  // Non-blocking, or opening a pipe without a writer would wait for one.
  const Descriptor file{open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK)};
  struct stat status {};
  if (file.fd < 0 || fstat(file.fd, &status) != 0) {
    throw Failure(
        Exit::kFile, path.string(),
        std::string("cannot be read (") + std::strerror(errno) + "), check the path and its permissions");
  }
  if (!S_ISREG(status.st_mode)) {
    throw Failure(Exit::kFile, path.string(), "is not a regular file, give a mesh file");
  }
  const auto size = uint64_t(status.st_size);
  budget.charge(path.string(), size);
  std::string bytes(size, '\0');
  size_t done = 0;
  while (done < bytes.size()) {
    const ssize_t got = read(file.fd, bytes.data() + done, bytes.size() - done);
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) {
      throw Failure(Exit::kFile, path.string(),
                    std::string("cannot be read to its end (") + std::strerror(errno) + "), check the disk");
    }
    if (got == 0) break;
    done += size_t(got);
  }
  bytes.resize(done);
  if (bytes.starts_with("version https://git-lfs.github.com/spec/")) {
    throw Failure(Exit::kInvalid, path.string(),
                  "is a pointer of Git LFS and not the file itself, run git lfs pull");
  }
  return bytes;
}

std::string read_text(const std::filesystem::path& path, Budget& budget) {
  std::string bytes = read_file(path, budget);
  const auto byte = [&](size_t i) { return i < bytes.size() ? uint8_t(bytes[i]) : 0x100u; };
  if (byte(0) == 0xEF && byte(1) == 0xBB && byte(2) == 0xBF) {
    bytes.erase(0, 3);
  } else if ((byte(0) == 0xFE && byte(1) == 0xFF) || (byte(0) == 0xFF && byte(1) == 0xFE) ||
             (bytes.size() >= 4 && ((byte(0) == 0) != (byte(1) == 0)))) {
    const bool marked = byte(0) >= 0xFE && byte(1) >= 0xFE;
    const bool big_endian = marked ? byte(0) == 0xFE : byte(0) == 0;
    budget.charge(path.string(), bytes.size(), 2);
    return utf8_of_utf16(std::string_view(bytes).substr(marked ? 2 : 0), big_endian);
  }
  return bytes;
}

std::string printable(std::string_view text) {
  std::string out;
  out.reserve(text.size());
  for (size_t i = 0; i < text.size();) {
    const size_t length = utf8_length(text, i);
    const bool control = uint8_t(text[i]) < 0x20 || text[i] == 0x7F;
    out.append(length && !control ? text.substr(i, length) : "?");
    i += std::max<size_t>(length, 1);
  }
  return out;
}

std::string valid_utf8(std::string_view text) {
  std::string out;
  out.reserve(text.size());
  for (size_t i = 0; i < text.size();) {
    const size_t length = utf8_length(text, i);
    out.append(length ? text.substr(i, length) : "?");
    i += std::max<size_t>(length, 1);
  }
  return out;
}

}  // namespace lsp
