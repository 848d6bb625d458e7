// How wrong a picture of indirect light is, and how much of that a filter would leave: noise falls to a fifth
// under a blur of five by five, a seam, a facet or a leak stays.
#pragma once

#include "image.h"

namespace lsp::bench {

// Errors are relative to the reference's mean, but not to less than this: in a picture that is nearly black a
// small difference is no large one.
inline constexpr double kLeastMean = 0.25;

// Of a pixel the mean over its channels, over the picture the mean and the 99th percentile (nearest rank).
struct PictureErrors {
  double mean = 0, p99 = 0;                  // |image - reference|, relative
  double blurred_mean = 0, blurred_p99 = 0;  // the same of both pictures blurred
  double bias = 0;                           // mean of image - reference, relative

  // What of the error is structure: 1 nothing but, 0.2 noise that knows no neighbour. 0 without an error.
  double structure() const { return mean > 0 ? blurred_mean / mean : 0; }
};

// Two pictures of one size in linear light, on a scale where 1 is white; throws Failure(kInvalid) otherwise.
PictureErrors picture_errors(const Image& reference, const Image& image);

// The mean of the five by five pixels about each, of those inside the picture at its border.
Image blurred(const Image& image);

}  // namespace lsp::bench
