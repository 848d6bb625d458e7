// Random damage for tests and fuzzers: changes that look like a file's own values, with hashes made right
// again so that the deep rules are reached.
#pragma once

#include <cstdint>

#include "image.h"

namespace lsp::corpus {

// A small generator with the same numbers everywhere (SplitMix64, Steele et al. 2014).
class Random {
 public:
  explicit Random(uint64_t seed) : state_(seed) {}
  uint64_t next() {
    uint64_t z = state_ += 0x9E3779B97F4A7C15u;
    z = (z ^ z >> 30) * 0xBF58476D1CE4E5B9u;
    z = (z ^ z >> 27) * 0x94D049BB133111EBu;
    return z ^ z >> 31;
  }
  // In [0, count); count is not zero.
  uint64_t below(uint64_t count) { return next() % count; }
  // In [0, 1).
  float unit() { return static_cast<float>(next() >> 40) * 0x1p-24f; }

 private:
  uint64_t state_;
};

// Changes `bytes` in one to four places: words of the header, the table or a section become extreme, near to
// what they were, or another word of the file; rarely the file is cut or made longer, or a section's entry is
// exchanged for another's.
// Hashes are repaired afterwards in fifteen of sixteen cases. Never makes a file longer than max_size.
void mutate(Bytes& bytes, Random& random, size_t max_size = SIZE_MAX);

}  // namespace lsp::corpus
