// PLY files: the header, and the values of the body one by one.
#pragma once

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <string>
#include <string_view>
#include <vector>

#include "import/text.h"

namespace lsp::ply {

enum class Type { kInt8, kUint8, kInt16, kUint16, kInt32, kUint32, kFloat32, kFloat64 };
enum class Encoding { kAscii, kLittle, kBig };

struct Property {
  std::string name;
  Type type = Type::kFloat32;
  bool is_list = false;
  Type count_type = Type::kUint8;
};

struct Element {
  std::string name;
  uint64_t count = 0;
  std::vector<Property> properties;
};

inline size_t size_of(Type type) {
  switch (type) {
    case Type::kInt8:
    case Type::kUint8:
      return 1;
    case Type::kInt16:
    case Type::kUint16:
      return 2;
    case Type::kFloat64:
      return 8;
    default:
      return 4;
  }
}

// Throws Failure kInvalid.
[[noreturn]] void fail(const std::string& file, const std::string& what);

struct Header {
  Encoding encoding = Encoding::kAscii;
  std::vector<Element> elements;
  std::vector<std::string> textures;  // named by comments, as some programs do; faces count them from 0
};

// Takes the header off `text`. Throws Failure kInvalid, kUnsupported (a format PLY does not know).
Header read_header(const std::string& file, std::string_view& text);

// Values of the body one after the other. An element of an ASCII body may be broken over lines; what its last
// line holds beyond the declared properties is passed over, as files with undeclared values exist.
class Body {
 public:
  Body(const std::string& file, std::string_view bytes, Encoding encoding)
      : file_(file), bytes_(bytes), encoding_(encoding) {}

  size_t left() const { return bytes_.size(); }

  double number(Type type) {
    if (encoding_ == Encoding::kAscii) return numbers_.read(word());
    switch (type) {
      case Type::kInt8:
        return double(binary<int8_t>());
      case Type::kUint8:
        return double(binary<uint8_t>());
      case Type::kInt16:
        return double(binary<int16_t>());
      case Type::kUint16:
        return double(binary<uint16_t>());
      case Type::kInt32:
        return double(binary<int32_t>());
      case Type::kUint32:
        return double(binary<uint32_t>());
      case Type::kFloat32:
        return double(binary<float>());
      default:
        return binary<double>();
    }
  }

  // -1 for what is no whole number of 0 or more (strips end with -1).
  int64_t index(Type type) {
    if (encoding_ == Encoding::kAscii) {
      const std::string_view text = word();
      int64_t value = -1;
      if (integer_of(text, value)) return value;
      return whole(number_of(text));
    }
    return whole(number(type));
  }

  void end_element() {
    if (encoding_ != Encoding::kAscii) return;
    size_t end = 0;
    while (end < bytes_.size() && !is_line_end(bytes_[end])) ++end;
    passed_over_ = passed_over_ || !trim(bytes_.substr(0, end)).empty();
    bytes_.remove_prefix(end);
  }
  const NumberReader& numbers() const { return numbers_; }
  // Whether lines held values that the header does not declare.
  bool passed_over() const { return passed_over_; }
  // Bytes that are not blank behind what was read.
  size_t tail() const { return trim(bytes_).size(); }

  void skip(const Property& property) {
    const uint64_t count = property.is_list ? list_length(property) : 1;
    if (encoding_ != Encoding::kAscii) {
      take(count * size_of(property.type));
    } else {
      for (uint64_t i = 0; i < count; ++i) word();
    }
  }

  uint64_t list_length(const Property& property) {
    const int64_t count = index(property.count_type);
    const size_t least = encoding_ == Encoding::kAscii ? 1 : size_of(property.type);
    if (count < 0 || uint64_t(count) > left() / least)
      fail(file_, "has a list longer than what is left of it");
    return uint64_t(count);
  }

 private:
  static int64_t whole(double value) {
    return value >= 0 && value < 9e15 && value == std::floor(value) ? int64_t(value) : -1;
  }

  std::string_view word() {
    size_t begin = 0;
    const auto is_space = [](char c) { return is_blank(c) || is_line_end(c); };
    while (begin < bytes_.size() && is_space(bytes_[begin])) ++begin;
    size_t end = begin;
    while (end < bytes_.size() && !is_space(bytes_[end])) ++end;
    const std::string_view found = bytes_.substr(begin, end - begin);
    if (found.empty()) fail(file_, "holds less than its header says");
    bytes_.remove_prefix(end);
    return found;
  }

  std::string_view take(uint64_t count) {
    if (count > bytes_.size()) fail(file_, "holds less than its header says");
    const std::string_view taken = bytes_.substr(0, count);
    bytes_.remove_prefix(count);
    return taken;
  }

  template <typename T>
  T binary() {
    char raw[sizeof(T)];
    std::memcpy(raw, take(sizeof(T)).data(), sizeof(T));
    static_assert(std::endian::native == std::endian::little);
    if (encoding_ == Encoding::kBig) std::reverse(raw, raw + sizeof(T));
    T value;
    std::memcpy(&value, raw, sizeof(T));
    return value;
  }

  const std::string& file_;
  std::string_view bytes_;
  const Encoding encoding_;
  NumberReader numbers_;
  bool passed_over_ = false;
};

}  // namespace lsp::ply
