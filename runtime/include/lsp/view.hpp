// Arrays as functions of the C++ side take them. Header-only.
#pragma once

#include <cstddef>
#include <iterator>
#include <string>

#include "lsp/error.hpp"

namespace lsp {

// Elements side by side, of a vector, an array, a span or a pointer: not owned. C++17 has no std::span.
template <class T>
class View {
 public:
  View(T* data, size_t size) : data_(data), size_(size) {}  // `size` elements from `data` on
  // All of a range that has data and size.
  template <class Range>
  View(Range&& range) : data_(std::data(range)), size_(std::size(range)) {}
  T* data() const { return data_; }      // the first
  size_t size() const { return size_; }  // how many

 private:
  T* data_;
  size_t size_;
};

// Throws LSP_ERROR_LIMIT unless there is a hit for every ray.
inline void require_one_size(View<const LspRay> rays, View<LspHit> hits) {
  if (rays.size() == hits.size()) return;
  throw Error(LSP_ERROR_LIMIT, "",
              std::to_string(rays.size()) + " rays have " + std::to_string(hits.size()) +
                  " hits to go to; make both of one size");
}

}  // namespace lsp
