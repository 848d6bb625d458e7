#include "timing.h"

#include <algorithm>
#include <chrono>
#include <cmath>

namespace lsp::bench {
namespace {

double quantile(const std::vector<double>& sorted, double share) {
  const double at = share * static_cast<double>(sorted.size() - 1);
  const auto below = static_cast<size_t>(at);
  const size_t above = std::min(below + 1, sorted.size() - 1);
  return sorted[below] + (at - static_cast<double>(below)) * (sorted[above] - sorted[below]);
}

}  // namespace

Timing timing_of(std::vector<double> seconds) {
  Timing timing;
  if (seconds.empty()) return timing;
  std::sort(seconds.begin(), seconds.end());
  timing.median = quantile(seconds, 0.5);
  timing.least = seconds.front();
  timing.repeats = seconds.size();
  if (timing.median > 0) timing.spread = (quantile(seconds, 0.75) - quantile(seconds, 0.25)) / timing.median;
  return timing;
}

bool ratio_is_meaningless(const Timing& a, const Timing& b) {
  return a.spread * a.median + b.spread * b.median >= std::abs(a.median - b.median);
}

std::vector<Timing> race(const std::vector<Contender>& contenders, int warm_up, int repeats) {
  std::vector<std::vector<double>> seconds(contenders.size());
  for (int turn = -warm_up; turn < repeats; ++turn) {
    for (size_t i = 0; i < contenders.size(); ++i) {
      const size_t k = turn % 2 == 0 ? i : contenders.size() - 1 - i;
      const double took = contenders[k].run();
      if (turn >= 0) seconds[k].push_back(took);
    }
  }
  std::vector<Timing> timings;
  for (const auto& all : seconds) timings.push_back(timing_of(all));
  return timings;
}

double seconds_since_start() {
  using Clock = std::chrono::steady_clock;
  static const Clock::time_point start = Clock::now();
  return std::chrono::duration<double>(Clock::now() - start).count();
}

}  // namespace lsp::bench
