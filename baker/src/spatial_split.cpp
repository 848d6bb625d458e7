#include "spatial_split.h"

#include <algorithm>

namespace lsp {
namespace {

// The parts of a box on both sides of a plane that cuts a triangle in it.
void cut_box(const TriangleCut& triangle, const Box4& box, int axis, float plane, Box4& left, Box4& right) {
  triangle.at(plane, left, right);
  left = intersection(left, box);
  right = intersection(right, box);
  const Float4 planes = Float4{} + plane;
  left.hi = Int4{0, 1, 2, 3} == axis ? lesser(left.hi, planes) : left.hi;
  right.lo = Int4{0, 1, 2, 3} == axis ? greater(right.lo, planes) : right.lo;
}

// Whether the borders of the bins are apart by more than rounding.
bool separates(const Box& bounds, int axis) {
  const float reach = std::max(std::fabs(bounds.lo[axis]), std::fabs(bounds.hi[axis]));
  return bounds.hi[axis] - bounds.lo[axis] > float(kBins) * 4 * 0x1p-23f * reach;
}

}  // namespace

// The borders between bins along an axis of a node, how many references begin and end in a bin, and the
// bounds of points of theirs that a split above or below the bin cannot part from it.
struct SpatialSplitter::SpatialBins {
  Binning bin;
  std::array<float, kBins> planes;  // above a bin
  std::array<uint32_t, kBins> entries{}, exits{};
  std::array<Box4, kBins> points;

  SpatialBins(const Box& bounds, int axis) : bin(bounds.lo[axis], bounds.hi[axis]) {
    for (int b = 0; b + 1 < kBins; ++b) planes[b] = bin.plane(b + 1);
    planes[kBins - 1] = INFINITY;
  }
};

void SpatialSplitter::cut(const Reference& r, int axis, float plane, Box& left, Box& right) const {
  Box4 below, above;
  cut_box(cut_of(r.triangle, axis), Box4(r.box), axis, plane, below, above);
  left = below.box();
  right = above.box();
}

void SpatialSplitter::clip(Reference& r, const Box& within) const {
  for (int axis = 0; axis < 3; ++axis) {
    Box outside, rest;
    if (r.box.lo[axis] < within.lo[axis]) {
      cut(r, axis, within.lo[axis], outside, rest);
      if (!rest.empty()) r.box = rest;
    }
    if (r.box.hi[axis] > within.hi[axis]) {
      cut(r, axis, within.hi[axis], rest, outside);
      if (!rest.empty()) r.box = rest;
    }
  }
}

// A part of a triangle holds the corners on its side. Along all axes at once.
void SpatialSplitter::add_corners(const std::vector<Reference>& references,
                                  std::array<SpatialBins, 3>& bins) const {
  const Binning &x = bins[0].bin, &y = bins[1].bin, &z = bins[2].bin;
  const Float4 lo = {x.lo, y.lo, z.lo, 0}, scale = {x.scale, y.scale, z.scale, 0};
  const auto bins_of = [&](Float4 at) {  // as Binning
    return __builtin_convertvector(lesser(greater(Float4{}, (at - lo) * scale), Float4{} + (kBins - 1)),
                                   Int4);
  };
  for (const Reference& r : references) {
    const Box4 box(r.box);
    const Int4 first = bins_of(box.lo), last = bins_of(box.hi);
    for (int axis = 0; axis < 3; ++axis) {
      ++bins[size_t(axis)].entries[size_t(first[axis])];
      ++bins[size_t(axis)].exits[size_t(last[axis])];
    }
    for (int c = 0; c < 3; ++c) {
      const Float4 at = float4(corner(r.triangle, c));
      if (!box.holds(at)) continue;
      Int4 bin = bins_of(at);
      bin = bin < first ? first : bin;
      bin = last < bin ? last : bin;
      for (int axis = 0; axis < 3; ++axis) bins[size_t(axis)].points[size_t(bin[axis])].grow(at);
    }
  }
}

// And both parts hold the points in which the plane between them cuts its edges.
void SpatialSplitter::add_cuts(const std::vector<Reference>& references, int axis, SpatialBins& bins) const {
  PlaneCuts cuts;
  for (const Reference& r : references) {
    const int first = bins.bin(r.box.lo[axis]), last = bins.bin(r.box.hi[axis]);
    if (first == last) continue;
    cuts.add({corner(r.triangle, 0), corner(r.triangle, 1), corner(r.triangle, 2)}, r.box, axis, bins.planes,
             first, last);
  }
  for (int b = 0; b + 1 < kBins; ++b) {
    const Box4 cut = cuts.at(b, axis, bins.planes[b]);
    bins.points[b].grow(cut);
    bins.points[b + 1].grow(cut);
  }
}

// No split along the axis costs less than this, but for rounding: its parts hold the bins' points, and
// reach to the plane.
double SpatialSplitter::least_cost(size_t count, int axis, const SpatialBins& bins) const {
  double least = INFINITY;
  size_t left = 0, exited = 0;
  sweep(bins.points, [&](int b, Box4 left_box, Box4 right_box) {
    left += bins.entries[b - 1];
    exited += bins.exits[b - 1];
    if (left > exited) {
      const float plane = bins.planes[b - 1];
      left_box.hi = Int4{0, 1, 2, 3} == axis ? greater(left_box.hi, Float4{} + plane) : left_box.hi;
      right_box.lo = Int4{0, 1, 2, 3} == axis ? lesser(right_box.lo, Float4{} + plane) : right_box.lo;
    }
    if (left == 0 || exited == count) return;
    least = std::min(least, double(left) * double(left_box.rough_half_area()) +
                                double(count - exited) * double(right_box.rough_half_area()));
  });
  return triangle_cost_ * least;
}

SpatialSplit SpatialSplitter::find(const std::vector<Reference>& references, const Box& bounds,
                                   double limit) const {
  SpatialSplit best;
  std::array<SpatialBins, 3> by_axis = {SpatialBins{bounds, 0}, {bounds, 1}, {bounds, 2}};
  add_corners(references, by_axis);
  for (int axis = 0; axis < 3; ++axis) {
    SpatialBins& bins = by_axis[size_t(axis)];
    if (bins.bin.scale == 0 || !separates(bounds, axis)) continue;
    constexpr double kRounding = 1e-4;
    const auto may_pay = [&] {
      return (1 - kRounding) * least_cost(references.size(), axis, bins) <= std::min(limit, best.cost);
    };
    if (!may_pay()) continue;
    add_cuts(references, axis, bins);
    if (may_pay()) try_planes(references, axis, bins, best);
  }
  return best;
}

void SpatialSplitter::try_planes(const std::vector<Reference>& references, int axis, const SpatialBins& bins,
                                 SpatialSplit& best) const {
  std::array<Box4, kBins> boxes;
  for (const Reference& r : references) {
    const int first = bins.bin(r.box.lo[axis]), last = bins.bin(r.box.hi[axis]);
    if (first == last) {
      boxes[first].grow(Box4(r.box));
      continue;
    }
    const TriangleCut triangle = cut_of(r.triangle, axis);
    Box4 rest(r.box);
    for (int b = first; b < last && !rest.empty(); ++b) {
      Box4 left, right;
      cut_box(triangle, rest, axis, bins.planes[b], left, right);
      if (!left.empty()) boxes[b].grow(left);
      rest = right;
    }
    if (!rest.empty()) boxes[last].grow(rest);
  }
  size_t left = 0, exited = 0;
  sweep(boxes, [&](int b, const Box4& left_box, const Box4& right_box) {
    left += bins.entries[b - 1];
    exited += bins.exits[b - 1];
    const size_t right = references.size() - exited;
    const double cost = split_cost(triangle_cost_, left, left_box, right, right_box);
    if (cost < best.cost) best = {cost, axis, bins.planes[b - 1], left, right};
  });
}

void SpatialSplitter::split(const std::vector<Reference>& references, const SpatialSplit& split,
                            std::vector<Reference>& left, std::vector<Reference>& right) const {
  // First the references on one side only; then each that straddles goes where it costs least (Stich 4.4).
  Box left_box, right_box;
  left.reserve(split.left);
  right.reserve(split.right);
  std::vector<Reference> straddling;
  for (const Reference& r : references) {
    if (r.box.hi[split.axis] <= split.plane) {
      left.push_back(r);
      left_box.grow(r.box);
    } else if (r.box.lo[split.axis] >= split.plane) {
      right.push_back(r);
      right_box.grow(r.box);
    } else {
      straddling.push_back(r);
    }
  }
  for (const Reference& r : straddling) {
    Box a, b;
    cut(r, split.axis, split.plane, a, b);
    if (a.empty() || b.empty()) {  // only the box straddles, not the triangle
      const bool to_left = !a.empty() || b.empty();
      (to_left ? left : right).push_back(r);
      (to_left ? left_box : right_box).grow(r.box);
      continue;
    }
    Box left_cut = left_box, right_cut = right_box, left_whole = left_box, right_whole = right_box;
    left_cut.grow(a);
    right_cut.grow(b);
    left_whole.grow(r.box);
    right_whole.grow(r.box);
    const double n_left = double(left.size()), n_right = double(right.size());
    const double both = left_cut.half_area() * (n_left + 1) + right_cut.half_area() * (n_right + 1);
    const double only_left = left_whole.half_area() * (n_left + 1) + right_box.half_area() * n_right;
    const double only_right = left_box.half_area() * n_left + right_whole.half_area() * (n_right + 1);
    if (both <= only_left && both <= only_right) {
      left.push_back({a, r.triangle});
      right.push_back({b, r.triangle});
      left_box = left_cut;
      right_box = right_cut;
    } else if (only_left <= only_right) {
      left.push_back(r);
      left_box = left_whole;
    } else {
      right.push_back(r);
      right_box = right_whole;
    }
  }
}

}  // namespace lsp
