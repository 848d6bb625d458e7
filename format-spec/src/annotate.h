// Accounts for every byte of a file, sound or damaged.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <string>

namespace lsp::format {

// Bytes [offset, offset + bytes) of the file, and what they are.
struct Range {
  uint64_t offset;
  uint64_t bytes;
  std::string path;  // "/sections/NODE/12", "/padding", "/unknown"
  std::string meaning;
};

struct AnnotateOptions {
  std::string section;  // its elements are all listed; of the other sections the first few and the last
};

// Calls `visit` with ranges in ascending order that touch, do not overlap, and cover the file from its first
// byte to its last. The bytes may be hostile.
void annotate(std::span<const std::byte> file, const AnnotateOptions& options,
              const std::function<void(const Range&)>& visit);

}  // namespace lsp::format
