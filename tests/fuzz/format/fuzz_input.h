// What the fuzzers of the format share: a mutator that repairs hashes, bytes at a multiple of 16, rays.
#pragma once

#include <lsp/lsp.h>

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <memory>
#include <new>
#include <span>

#include "check.h"

namespace lsp::fuzz {

// What a packed file may unfold to here: a fuzzer's process is not to be killed for its memory.
inline constexpr uint64_t kMemoryLimit = uint64_t{1} << 26;

// Bytes at a multiple of 16, of exactly their size: the sanitizers see any access beyond them.
class AlignedBytes {
 public:
  explicit AlignedBytes(size_t size) : data_(new (std::align_val_t{16}) std::byte[size]), size_(size) {}
  AlignedBytes(const uint8_t* bytes, size_t size) : AlignedBytes(size) {
    if (size != 0) std::memcpy(data_.get(), bytes, size);
  }
  std::byte* data() { return data_.get(); }
  size_t size() const { return size_; }
  std::span<const std::byte> bytes() const { return {data_.get(), size_}; }

 private:
  struct Free {
    void operator()(std::byte* bytes) const { operator delete[](bytes, std::align_val_t{16}); }
  };
  std::unique_ptr<std::byte[], Free> data_;
  size_t size_;
};

// Traces `count` rays derived from `seed` in every mode that the scene allows. Ends the process when a hit
// makes no sense: not ahead, of no primitive of a validated file, or left incomplete.
void trace_rays(const lsp_scene& scene, uint64_t seed, size_t count, bool validated);

// Ends the process with a message: the finding that libFuzzer keeps.
[[noreturn]] void found(const char* what);

}  // namespace lsp::fuzz
