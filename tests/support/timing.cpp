#include "timing.h"

#include <algorithm>
#include <atomic>
#include <barrier>
#include <chrono>
#include <cmath>
#include <exception>
#include <mutex>
#include <thread>

namespace lsp::bench {
namespace {

using Clock = std::chrono::steady_clock;

double since(Clock::time_point start) { return std::chrono::duration<double>(Clock::now() - start).count(); }

// Small enough to share evenly, large enough that taking one costs nothing.
constexpr size_t kChunk = 4096;

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

unsigned machine_threads() { return std::max(1u, std::thread::hardware_concurrency()); }

double seconds_since_start() {
  static const Clock::time_point start = Clock::now();
  return since(start);
}

double run_in_chunks(size_t total, unsigned threads, const std::function<void(size_t, size_t)>& work) {
  if (threads <= 1) {
    const Clock::time_point start = Clock::now();
    for (size_t first = 0; first < total; first += kChunk) work(first, std::min(kChunk, total - first));
    return since(start);
  }
  std::atomic<size_t> next{0};
  std::exception_ptr failure;
  std::mutex failure_mutex;
  std::barrier ready(static_cast<ptrdiff_t>(threads) + 1);
  std::vector<std::jthread> crew;
  for (unsigned i = 0; i < threads; ++i) {
    crew.emplace_back([&] {
      ready.arrive_and_wait();
      try {
        for (size_t first; (first = next.fetch_add(kChunk)) < total;)
          work(first, std::min(kChunk, total - first));
      } catch (...) {
        const std::scoped_lock lock(failure_mutex);
        failure = std::current_exception();
      }
    });
  }
  ready.arrive_and_wait();
  const Clock::time_point start = Clock::now();
  crew.clear();  // joins
  const double took = since(start);
  if (failure) std::rethrow_exception(failure);
  return took;
}

}  // namespace lsp::bench
