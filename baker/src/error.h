// The error of a baked file, measured on rays such as indirect light casts.
#pragma once

#include <cstdint>

#include "bake.h"

namespace lsp {

// Approximate answers (near field exact, level of detail 0) against exact ones.
struct MeasuredError {
  uint64_t rays = 0;
  uint64_t wrong_hits = 0;    // a hit where there is none
  uint64_t wrong_misses = 0;  // none where there is one
  double depth_error = 0;     // mean of |t - exact t| over rays where both hit, in diagonals of the scene
  double wrong_share() const { return rays ? double(wrong_hits + wrong_misses) / double(rays) : 0; }
};

// Casts `rays` rays from points spread evenly over the surfaces (a 1e-4 of the diagonal above them),
// cosine-distributed about the geometric normal, on all threads. Needs an exact tree and Line Spaces; without
// either the result has no rays. Deterministic.
MeasuredError measure_error(const Baked& baked, uint64_t rays);

}  // namespace lsp
