// Bytes at a multiple of 16, as loaders ask for, and of exactly their size, so that the sanitizers see any
// access beyond them.
#pragma once

#include <cstddef>
#include <cstring>
#include <memory>
#include <new>
#include <span>

namespace lsp::corpus {

class AlignedBytes {
 public:
  explicit AlignedBytes(size_t size) : data_(new (std::align_val_t{16}) std::byte[size]), size_(size) {}
  AlignedBytes(const void* bytes, size_t size) : AlignedBytes(size) {
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

}  // namespace lsp::corpus
