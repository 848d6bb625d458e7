// Seconds of the stages of a program.
#pragma once

#include <chrono>
#include <utility>

namespace lsp {

// Seconds since it was made or asked before.
class Timer {
 public:
  double operator()() {
    const auto now = std::chrono::steady_clock::now();
    return std::chrono::duration<double>(now - std::exchange(start_, now)).count();
  }

 private:
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

}  // namespace lsp
