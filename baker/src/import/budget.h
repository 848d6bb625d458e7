// What an import may still allocate.
#pragma once

#include <cstdint>
#include <string>

namespace lsp {

// Charged before every allocation whose size a file decides. Charges are estimates from above of what a step
// keeps alive; they are released only where a large temporary ends.
class Budget {
 public:
  // `limit` in bytes, 0 for the machine's physical memory.
  explicit Budget(uint64_t limit);

  // Throws Failure kLimit, naming `file`, where count * bytes_each more would pass the limit.
  void charge(const std::string& file, uint64_t count, uint64_t bytes_each = 1);
  uint64_t left() const { return limit_ - used_; }
  void release(uint64_t bytes) { used_ -= bytes < used_ ? bytes : used_; }

 private:
  uint64_t limit_;
  uint64_t used_ = 0;
};

}  // namespace lsp
