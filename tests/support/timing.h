// Timing that can be argued with: warm-up, interleaved repeats, medians with their spread.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

namespace lsp::bench {

// Median and how far the repeats lie apart: (greatest - least of the middle half) / median.
struct Timing {
  double median = 0;
  double least = 0;
  double spread = 0;
  size_t repeats = 0;
};
Timing timing_of(std::vector<double> seconds);

// True where the two medians cannot be told apart: the middle halves' widths together are more than the
// difference between the medians.
bool ratio_is_meaningless(const Timing& a, const Timing& b);

// One of several things to time against each other. `run` does the work once and returns the seconds that
// count.
struct Contender {
  std::string name;
  std::function<double()> run;
};

// Runs every contender `warm_up` times without counting, then all of them in turn, `repeats` times; every
// second turn goes backwards, so that none is always first after another.
std::vector<Timing> race(const std::vector<Contender>& contenders, int warm_up, int repeats);

double seconds_since_start();  // wall clock, since the first call

}  // namespace lsp::bench
