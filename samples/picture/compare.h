// How far apart two pictures are.
#pragma once

#include "picture.h"

namespace lsp::sample {

struct Comparison {
  double mean_absolute = 0;   // of the channels' differences, linear
  double rmse = 0;            // linear
  double relative_mean = 0;   // mean absolute difference over the reference's mean; infinity if it is black
  double psnr_db = 0;         // of the tone-mapped, sRGB-encoded pictures, peak 1; infinity if they are equal
  double mean_reference = 0;  // mean of the reference's channels
  double mean_test = 0;
  uint64_t pixels_over_5_percent = 0;  // encoded difference of some channel over 0.05
};

// Compares pictures of the same size; other sizes throw lsp::Failure (kInvalid).
Comparison compare(const Picture& reference, const Picture& test);

// |reference - test| times `factor`, as display light: black where they agree.
Picture difference(const Picture& reference, const Picture& test, float factor);

}  // namespace lsp::sample
