// What an import may still allocate.
#pragma once

#include <algorithm>
#include <cstdint>
#include <string>
#include <vector>

namespace lsp {

// Charged before every allocation whose size a file decides. Charges are estimates from above of what a step
// keeps alive; they are released where a large temporary ends, and all of a file's at its end.
class Budget {
 public:
  // `limit` in bytes, 0 for the machine's physical memory.
  explicit Budget(uint64_t limit);

  // Throws Failure kLimit, naming `file`, where count * bytes_each more would pass the limit.
  void charge(const std::string& file, uint64_t count, uint64_t bytes_each = 1);
  // Appends to a vector, charging its growth: both halves while it moves.
  template <typename T>
  void push_back(const std::string& file, std::vector<T>& vector, const T& value) {
    if (vector.size() == vector.capacity()) {
      const size_t before = vector.capacity(), after = std::max<size_t>(64, 2 * before);
      charge(file, after, sizeof(T));
      vector.reserve(after);
      release(before * sizeof(T));
    }
    vector.push_back(value);
  }

  // Forgets all charges but `alive` bytes.
  void settle(uint64_t alive) { used_ = std::min(alive, limit_); }
  uint64_t left() const { return limit_ - used_; }
  void release(uint64_t bytes) { used_ -= bytes < used_ ? bytes : used_; }

 private:
  uint64_t limit_;
  uint64_t used_ = 0;
};

}  // namespace lsp
