// An array that only grows, in memory or, told so, in a temporary file that has no name: for sections that
// may be larger than memory.
#pragma once

#include <cstddef>
#include <filesystem>
#include <span>
#include <utility>

namespace lsp {

// The bytes of a LargeArray. Not thread-safe while it grows.
class LargeBytes {
 public:
  LargeBytes() = default;
  ~LargeBytes();
  LargeBytes(LargeBytes&& other) noexcept { swap(other); }
  LargeBytes& operator=(LargeBytes&& other) noexcept {
    LargeBytes(std::move(other)).swap(*this);
    return *this;
  }

  // From now on the bytes lie in a file in `folder`. Only before the first append. Throws Failure.
  void keep_in_file(const std::filesystem::path& folder);
  // Throws Failure with Exit::kFile when the file cannot grow, Exit::kLimit when memory cannot.
  void append(const void* bytes, size_t size);
  // The bytes in a file need not stay in memory any longer; they come back when they are read.
  void release() const;

  std::byte* data() const { return data_; }
  size_t size() const { return size_; }

 private:
  void swap(LargeBytes& other) noexcept {
    std::swap(data_, other.data_);
    std::swap(size_, other.size_);
    std::swap(capacity_, other.capacity_);
    std::swap(file_, other.file_);
    std::swap(folder_, other.folder_);
  }
  void reserve(size_t capacity);

  std::byte* data_ = nullptr;
  size_t size_ = 0;
  size_t capacity_ = 0;  // of the mapping
  int file_ = -1;
  std::filesystem::path folder_;
};

template <typename T>
class LargeArray {
 public:
  void keep_in_file(const std::filesystem::path& folder) { bytes_.keep_in_file(folder); }
  void append(std::span<const T> elements) { bytes_.append(elements.data(), elements.size_bytes()); }
  void release() const { bytes_.release(); }

  T* data() const { return reinterpret_cast<T*>(bytes_.data()); }
  size_t size() const { return bytes_.size() / sizeof(T); }
  bool empty() const { return size() == 0; }
  T& operator[](size_t i) const { return data()[i]; }
  T* begin() const { return data(); }
  T* end() const { return data() + size(); }

 private:
  LargeBytes bytes_;
};

}  // namespace lsp
