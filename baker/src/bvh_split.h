// What object and spatial splits of a node have in common: references, bins, and what a split costs.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "box.h"
#include "box4.h"
#include "plane_cuts.h"

namespace lsp {

inline constexpr int kBins = PlaneCuts::kPlanes;

// A triangle, or after spatial splits the part of it inside `box`.
struct Reference {
  Box box;
  uint32_t triangle;
};

// Maps a coordinate to a bin; the same arithmetic decides bins and partitions.
struct Binning {
  float lo, scale;
  Binning(float lo_, float hi) : lo(lo_), scale(hi > lo_ ? kBins / (hi - lo_) : 0) {
    if (!std::isfinite(scale)) scale = 0;
  }
  int operator()(float x) const {
    const float b = (x - lo) * scale;
    return b > 0 ? (b < kBins - 1 ? int(b) : kBins - 1) : 0;
  }
  float plane(int bin) const { return lo + float(bin) / scale; }
};

// Calls f(b, box of the bins below b, box of the others) for every border between two bins.
template <typename F>
void sweep(const std::array<Box4, kBins>& boxes, F&& f) {
  std::array<Box4, kBins> right;
  Box4 box;
  for (int b = kBins - 1; b > 0; --b) {
    box.grow(boxes[b]);
    right[b] = box;
  }
  box = Box4();
  for (int b = 1; b < kBins; ++b) {
    box.grow(boxes[b - 1]);
    f(b, box, right[b]);
  }
}

// Of the children, in areas of half a box; infinite where one would be empty.
inline double split_cost(double triangle_cost, size_t left, const Box4& left_box, size_t right,
                         const Box4& right_box) {
  if (left == 0 || right == 0) return INFINITY;
  return triangle_cost * (double(left) * left_box.half_area() + double(right) * right_box.half_area());
}

}  // namespace lsp
