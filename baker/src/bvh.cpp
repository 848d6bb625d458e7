#include "bvh.h"

#include <tbb/task_group.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <bit>
#include <cmath>
#include <functional>
#include <iterator>
#include <memory>

#include "box.h"
#include "lsp/program.h"
#include "plane_cuts.h"
#include "triangle_cut.h"

namespace lsp {
namespace {

constexpr int kBins = PlaneCuts::kPlanes;
constexpr size_t kTaskReferences = 4096;  // smaller subtrees are built by one task

// Where this many nodes in a row found no spatial split worth its cost, those below are not asked any more:
// in a heap of triangles that all overlap none ever is, and looking for one takes most of the time.
constexpr uint32_t kPatience = 8;

// A triangle, or after spatial splits the part of it inside `box`.
struct Reference {
  Box box;
  uint32_t triangle;
};

struct TreeNode {
  Box box;
  std::unique_ptr<TreeNode> child[2];
  std::vector<uint32_t> triangles;  // of a leaf
};

struct ObjectSplit {
  double cost = INFINITY;
  int axis = 0;
  int bin = 0;  // references of bins below it go left
  Box4 overlap;
};

struct SpatialSplit {
  double cost = INFINITY;
  int axis = 0;
  float plane = 0;
  size_t left = 0, right = 0;
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

class Builder {
 public:
  Builder(const Mesh& mesh, const BvhOptions& options, const std::function<void(double)>& progress)
      : mesh_(mesh), options_(options), progress_(progress) {}

  std::unique_ptr<TreeNode> build() {
    std::vector<Reference> references(mesh_.triangles.size());
    Box bounds;
    for (size_t i = 0; i < references.size(); ++i) {
      references[i].triangle = uint32_t(i);
      for (int c = 0; c < 3; ++c) references[i].box.grow(corner(uint32_t(i), c));
      if (options_.within) clip(references[i], *options_.within);
      bounds.grow(references[i].box);
    }
    root_area_ = bounds.half_area();
    const size_t spare =
        options_.spatial_splits ? size_t(double(references.size()) * options_.split_budget) : 0;
    auto root = std::make_unique<TreeNode>();
    build_node(*root, std::move(references), spare, 0, kPatience);
    return root;
  }

 private:
  const glm::vec3& corner(uint32_t triangle, int c) const {
    return mesh_.positions[mesh_.triangles[triangle][c]];
  }

  void build_node(TreeNode& node, std::vector<Reference> references, size_t spare, uint32_t depth,
                  uint32_t patience) {
    node.box = bounds_of(references).box();
    const size_t count = references.size();
    if (count <= 1) return make_leaf(node, references);

    std::vector<Reference> left, right;
    bool split = false;
    if (depth < options_.heuristic_depth) {
      const ObjectSplit object = find_object_split(references);
      SpatialSplit spatial;
      const bool overlapping = spare > 0 && patience > 0 && !object.overlap.empty() &&
                               object.overlap.half_area() > options_.split_overlap * root_area_;
      const double area = node.box.half_area(), traversal_cost = options_.traversal_cost * area;
      const double leaf_cost = options_.triangle_cost * double(count) * area;
      const bool may_be_leaf = count <= options_.max_leaf_triangles;
      // What costs more would not be chosen.
      const double most = may_be_leaf ? std::min(object.cost, leaf_cost - traversal_cost) : object.cost;
      if (overlapping) spatial = find_spatial_split(references, node.box, most);
      const bool use_spatial = spatial.cost < object.cost && spatial.left + spatial.right <= count + spare &&
                               spatial.left && spatial.right;
      if (overlapping) patience = use_spatial ? kPatience : patience - 1;
      const double cost = traversal_cost + (use_spatial ? spatial.cost : object.cost);
      if (may_be_leaf && leaf_cost <= cost) return make_leaf(node, references);
      if (use_spatial) {
        split_spatially(references, spatial, left, right);
        // Both sides of a plane may end up with everything when slivers lie along it.
        split = left.size() < count && right.size() < count && !left.empty() && !right.empty();
      }
      if (!split && std::isfinite(object.cost)) {
        left.clear();
        right.clear();
        split_objects(references, object, left, right);
        split = true;
      }
    }
    if (!split) {
      if (count <= options_.max_leaf_triangles) return make_leaf(node, references);
      left.assign(references.begin(), references.begin() + ptrdiff_t(count / 2));
      right.assign(references.begin() + ptrdiff_t(count / 2), references.end());
    }
    std::vector<Reference>().swap(references);
    const size_t added = left.size() + right.size() - count;
    spare -= std::min(spare, added);
    const size_t spare_left =
        size_t(double(spare) * double(left.size()) / double(left.size() + right.size()));
    const size_t spare_right = spare - spare_left;
    node.child[0] = std::make_unique<TreeNode>();
    node.child[1] = std::make_unique<TreeNode>();
    if (count > kTaskReferences) {
      tbb::task_group tasks;
      tasks.run([&] { build_node(*node.child[0], std::move(left), spare_left, depth + 1, patience); });
      build_node(*node.child[1], std::move(right), spare_right, depth + 1, patience);
      tasks.wait();
    } else {
      build_node(*node.child[0], std::move(left), spare_left, depth + 1, patience);
      build_node(*node.child[1], std::move(right), spare_right, depth + 1, patience);
    }
    // Any-hit rays take child 0 first: a hit is likeliest in the larger one.
    if (node.child[1]->box.half_area() > node.child[0]->box.half_area())
      std::swap(node.child[0], node.child[1]);
  }

  void make_leaf(TreeNode& node, const std::vector<Reference>& references) {
    for (const Reference& r : references) node.triangles.push_back(r.triangle);
    if (!progress_) return;
    const size_t before = done_.fetch_add(references.size());
    const size_t step = mesh_.triangles.size() / 100 + 1;
    if (before / step != (before + references.size()) / step)
      progress_(std::min(1.0, double(before) / double(mesh_.triangles.size())));
  }

  static Box4 bounds_of(const std::vector<Reference>& references) {
    Box4 bounds;
    for (const Reference& r : references) bounds.grow(Box4(r.box));
    return bounds;
  }

  // Calls f(b, box of the bins below b, box of the others) for every border between two bins.
  template <typename F>
  static void sweep(const std::array<Box4, kBins>& boxes, F&& f) {
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

  // Of the children; infinite where one would be empty.
  double split_cost(size_t left, const Box4& left_box, size_t right, const Box4& right_box) const {
    if (left == 0 || right == 0) return INFINITY;
    return options_.triangle_cost *
           (double(left) * left_box.half_area() + double(right) * right_box.half_area());
  }

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

  ObjectSplit find_object_split(const std::vector<Reference>& references) const {
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
      if (bin[axis].scale != 0) try_borders(bins[axis], axis, references.size(), best);
    return best;
  }

  // Borders with an empty bin below them divide the references as the one before does.
  void try_borders(const ObjectBins& bins, int axis, size_t count, ObjectSplit& best) const {
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
      const double cost = split_cost(left, box, count - left, others);
      if (cost < best.cost) best = {cost, axis, b + 1, intersection(box, others)};
    }
  }

  // Leaves those on the left where they are.
  static void split_objects(std::vector<Reference>& references, const ObjectSplit& split,
                            std::vector<Reference>& left, std::vector<Reference>& right) {
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

  TriangleCut cut_of(uint32_t triangle, int axis) const {
    return {{&corner(triangle, 0), &corner(triangle, 1), &corner(triangle, 2)}, axis};
  }

  // The parts of a box on both sides of a plane that cuts a triangle in it.
  static void cut(const TriangleCut& triangle, const Box4& box, int axis, float plane, Box4& left,
                  Box4& right) {
    triangle.at(plane, left, right);
    left = intersection(left, box);
    right = intersection(right, box);
    const Float4 planes = Float4{} + plane;
    left.hi = Int4{0, 1, 2, 3} == axis ? lesser(left.hi, planes) : left.hi;
    right.lo = Int4{0, 1, 2, 3} == axis ? greater(right.lo, planes) : right.lo;
  }
  void cut(const Reference& r, int axis, float plane, Box& left, Box& right) const {
    Box4 below, above;
    cut(cut_of(r.triangle, axis), Box4(r.box), axis, plane, below, above);
    left = below.box();
    right = above.box();
  }

  // Leaves of a reference's box what is inside another one; all of it where rounding leaves nothing.
  void clip(Reference& r, const Box& within) const {
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

  // Whether the borders of the bins are apart by more than rounding.
  static bool separates(const Box& bounds, int axis) {
    const float reach = std::max(std::fabs(bounds.lo[axis]), std::fabs(bounds.hi[axis]));
    return bounds.hi[axis] - bounds.lo[axis] > float(kBins) * 4 * 0x1p-23f * reach;
  }

  // The borders between bins along an axis of a node, how many references begin and end in a bin, and the
  // bounds of points of theirs that a split above or below the bin cannot part from it.
  struct SpatialBins {
    Binning bin;
    std::array<float, kBins> planes;  // above a bin
    std::array<uint32_t, kBins> entries{}, exits{};
    std::array<Box4, kBins> points;

    SpatialBins(const Box& bounds, int axis) : bin(bounds.lo[axis], bounds.hi[axis]) {
      for (int b = 0; b + 1 < kBins; ++b) planes[b] = bin.plane(b + 1);
      planes[kBins - 1] = INFINITY;
    }
  };

  // A part of a triangle holds the corners on its side. Along all axes at once.
  void add_corners(const std::vector<Reference>& references, std::array<SpatialBins, 3>& bins) const {
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
  void add_cuts(const std::vector<Reference>& references, int axis, SpatialBins& bins) const {
    PlaneCuts cuts;
    for (const Reference& r : references) {
      const int first = bins.bin(r.box.lo[axis]), last = bins.bin(r.box.hi[axis]);
      if (first == last) continue;
      cuts.add({corner(r.triangle, 0), corner(r.triangle, 1), corner(r.triangle, 2)}, r.box, axis,
               bins.planes, first, last);
    }
    for (int b = 0; b + 1 < kBins; ++b) {
      const Box4 cut = cuts.at(b, axis, bins.planes[b]);
      bins.points[b].grow(cut);
      bins.points[b + 1].grow(cut);
    }
  }

  // No split along the axis costs less than this, but for rounding: its parts hold the bins' points, and
  // reach to the plane.
  double least_cost(size_t count, int axis, const SpatialBins& bins) const {
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
    return options_.triangle_cost * least;
  }

  // The best split that costs less than `limit`; where there is none, one that costs as much or infinitely
  // much.
  SpatialSplit find_spatial_split(const std::vector<Reference>& references, const Box& bounds,
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

  void try_planes(const std::vector<Reference>& references, int axis, const SpatialBins& bins,
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
        cut(triangle, rest, axis, bins.planes[b], left, right);
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
      const double cost = split_cost(left, left_box, right, right_box);
      if (cost < best.cost) best = {cost, axis, bins.planes[b - 1], left, right};
    });
  }

  void split_spatially(const std::vector<Reference>& references, const SpatialSplit& split,
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

  const Mesh& mesh_;
  const BvhOptions& options_;
  const std::function<void(double)>& progress_;
  double root_area_ = 0;
  std::atomic<size_t> done_{0};
};

// Lays the tree out depth first.
class Flattener {
 public:
  explicit Flattener(Bvh& bvh) : bvh_(bvh) {}

  uint32_t add(const TreeNode& node, uint32_t depth) {
    bvh_.max_depth = std::max(bvh_.max_depth, depth);
    if (!node.child[0]) {
      const uint32_t count = uint32_t(node.triangles.size());
      const uint32_t first = uint32_t(bvh_.records.size());
      if (size_t(first) + count > LSP_LEAF_FIRST_MASK)
        throw Failure(Exit::kLimit, "",
                      "the tree needs more than 134,217,727 triangle records, split the input");
      bvh_.records.insert(bvh_.records.end(), node.triangles.begin(), node.triangles.end());
      bvh_.max_leaf_triangles = std::max(bvh_.max_leaf_triangles, count);
      ++bvh_.leaf_count;
      return LSP_LEAF_BIT | (count - 1) << LSP_LEAF_COUNT_SHIFT | first;
    }
    const uint32_t index = uint32_t(bvh_.nodes.size());
    bvh_.nodes.emplace_back();
    uint32_t child[2];
    for (int i = 0; i < 2; ++i) child[i] = add(*node.child[i], depth + 1);
    const Box &a = node.child[0]->box, &b = node.child[1]->box;
    bvh_.nodes[index] = {{a.lo.x, a.lo.y, a.lo.z}, child[0], {a.hi.x, a.hi.y, a.hi.z}, LSP_NONE,
                         {b.lo.x, b.lo.y, b.lo.z}, child[1], {b.hi.x, b.hi.y, b.hi.z}, LSP_NONE};
    return index;
  }

 private:
  Bvh& bvh_;
};

}  // namespace

Bvh build_bvh(const Mesh& mesh, const BvhOptions& options, const std::function<void(double)>& progress) {
  Bvh bvh;
  if (mesh.triangles.empty()) return bvh;
  const std::unique_ptr<TreeNode> root = Builder(mesh, options, progress).build();
  bvh.root = Flattener(bvh).add(*root, 0);
  return bvh;
}

}  // namespace lsp
