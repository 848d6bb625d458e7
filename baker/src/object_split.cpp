#include "object_split.h"

#include <algorithm>
#include <bit>
#include <functional>
#include <iterator>

namespace lsp {
namespace {

// References by the bin of their centre along an axis.
struct ObjectBins {
  uint32_t used = 0;  // bits of the bins that hold any
  std::array<Box4, kBins> boxes;
  std::array<uint32_t, kBins> counts{};

  void add(int b, const Box4& box) {
    boxes[b].grow(box);
    ++counts[b];
    used |= 1u << b;
  }
};

// Borders with an empty bin below them divide the references as the one before does.
void try_borders(const ObjectBins& bins, int axis, size_t count, double triangle_cost, ObjectSplit& best) {
  std::array<Box4, kBins> right;  // of a bin that is used and those above it
  Box4 box;
  for (uint32_t rest = bins.used; rest != 0;) {
    const int b = std::bit_width(rest) - 1;
    rest &= ~(1u << b);
    box.grow(bins.boxes[b]);
    right[b] = box;
  }
  box = Box4();
  size_t left = 0;
  for (uint32_t rest = bins.used; (rest & (rest - 1)) != 0;) {
    const int b = std::countr_zero(rest);
    rest &= rest - 1;
    const Box4& others = right[std::countr_zero(rest)];
    box.grow(bins.boxes[b]);
    left += bins.counts[b];
    const double cost = split_cost(triangle_cost, left, box, count - left, others);
    if (cost < best.cost) best = {cost, axis, b + 1, intersection(box, others)};
  }
}

}  // namespace

ObjectSplit find_object_split(const std::vector<Reference>& references, double triangle_cost) {
  Box4 centroids;
  for (const Reference& r : references) centroids.grow(Box4(r.box).centre());
  const Binning bin[] = {{centroids.lo[0], centroids.hi[0]},
                         {centroids.lo[1], centroids.hi[1]},
                         {centroids.lo[2], centroids.hi[2]}};
  std::array<ObjectBins, 3> bins;
  for (const Reference& r : references) {
    const Box4 box(r.box);
    const Float4 centre = box.centre();
    for (int axis = 0; axis < 3; ++axis) bins[axis].add(bin[axis](centre[axis]), box);
  }
  ObjectSplit best;
  for (int axis = 0; axis < 3; ++axis)
    if (bin[axis].scale != 0) try_borders(bins[axis], axis, references.size(), triangle_cost, best);
  return best;
}

void split_objects(std::vector<Reference>& references, const ObjectSplit& split, std::vector<Reference>& left,
                   std::vector<Reference>& right) {
  Box centroids;
  for (const Reference& r : references) centroids.grow(r.box.centre());
  const Binning bin(centroids.lo[split.axis], centroids.hi[split.axis]);
  const auto goes_left = [&](const Reference& r) { return bin(r.box.centre()[split.axis]) < split.bin; };
  right.reserve(size_t(std::count_if(references.begin(), references.end(), std::not_fn(goes_left))));
  std::copy_if(references.begin(), references.end(), std::back_inserter(right), std::not_fn(goes_left));
  references.resize(size_t(std::remove_if(references.begin(), references.end(), std::not_fn(goes_left)) -
                           references.begin()));
  left = std::move(references);
}

}  // namespace lsp
