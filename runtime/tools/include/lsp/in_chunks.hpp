// Work on many rays, shared out among threads. Not installed.
#pragma once

#include <tbb/blocked_range.h>
#include <tbb/global_control.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <thread>

namespace lsp {

// Threads that run at once on this machine, at least 1.
inline unsigned machine_threads() { return std::max(1u, std::thread::hardware_concurrency()); }

// Calls work(first, count) for parts of [0, total) that cover it once, `threads` (at least 1) of them at a
// time: one by one in this thread, or at once. Returns the wall-clock seconds. Throws what `work` throws, of
// several one.
template <class Work>
double run_in_chunks(size_t total, unsigned threads, const Work& work) {
  constexpr size_t kChunk = 4096;  // small enough to share evenly, large enough that taking one costs nothing
  using Clock = std::chrono::steady_clock;
  auto start = Clock::now();
  threads = static_cast<unsigned>(std::min<size_t>(threads, (total + kChunk - 1) / kChunk));
  if (threads <= 1) {
    for (size_t first = 0; first < total; first += kChunk) work(first, std::min(kChunk, total - first));
  } else {
    // Without this oneTBB would never use more threads than there are cores.
    const tbb::global_control allowed(tbb::global_control::max_allowed_parallelism, threads);
    tbb::task_arena arena(static_cast<int>(threads));
    arena.execute([&] {
      start = Clock::now();
      tbb::parallel_for(tbb::blocked_range<size_t>(0, total, kChunk),
                        [&](const auto& part) { work(part.begin(), part.size()); });
    });
  }
  return std::chrono::duration<double>(Clock::now() - start).count();
}

}  // namespace lsp
