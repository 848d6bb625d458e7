#include "bvh.h"

#include <tbb/task_group.h>

#include <array>
#include <atomic>
#include <cmath>
#include <memory>

#include "box.h"
#include "lsp/program.h"

namespace lsp {
namespace {

constexpr int kBins = 32;
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
  Box overlap;
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
    for (const Reference& r : references) node.box.grow(r.box);
    const size_t count = references.size();
    if (count <= 1) return make_leaf(node, references);

    std::vector<Reference> left, right;
    bool split = false;
    if (depth < options_.heuristic_depth) {
      const ObjectSplit object = find_object_split(references);
      SpatialSplit spatial;
      const bool overlapping = spare > 0 && patience > 0 && !object.overlap.empty() &&
                               object.overlap.half_area() > options_.split_overlap * root_area_;
      if (overlapping) spatial = find_spatial_split(references, node.box);
      const double area = node.box.half_area();
      const double leaf_cost = options_.triangle_cost * double(count) * area;
      const bool use_spatial = spatial.cost < object.cost && spatial.left + spatial.right <= count + spare &&
                               spatial.left && spatial.right;
      if (overlapping) patience = use_spatial ? kPatience : patience - 1;
      const double cost = options_.traversal_cost * area + (use_spatial ? spatial.cost : object.cost);
      if (count <= options_.max_leaf_triangles && leaf_cost <= cost) return make_leaf(node, references);
      if (use_spatial) {
        split_spatially(references, spatial, left, right);
        // Both sides of a plane may end up with everything when slivers lie along it.
        split = left.size() < count && right.size() < count && !left.empty() && !right.empty();
      }
      if (!split && std::isfinite(object.cost)) {
        left.clear();
        right.clear();
        split_objects(references, object, left, right);
        split = !left.empty() && !right.empty();
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

  // Calls f(b, box of the bins below b, box of the others) for every border between two bins.
  template <typename F>
  static void sweep(const std::array<Box, kBins>& boxes, F&& f) {
    std::array<Box, kBins> right;
    Box box;
    for (int b = kBins - 1; b > 0; --b) {
      box.grow(boxes[b]);
      right[b] = box;
    }
    box = Box();
    for (int b = 1; b < kBins; ++b) {
      box.grow(boxes[b - 1]);
      f(b, box, right[b]);
    }
  }

  // Of the children; infinite where one would be empty.
  double split_cost(size_t left, const Box& left_box, size_t right, const Box& right_box) const {
    if (left == 0 || right == 0) return INFINITY;
    return options_.triangle_cost *
           (double(left) * left_box.half_area() + double(right) * right_box.half_area());
  }

  ObjectSplit find_object_split(const std::vector<Reference>& references) const {
    Box centroids;
    for (const Reference& r : references) centroids.grow(r.box.centre());
    ObjectSplit best;
    for (int axis = 0; axis < 3; ++axis) {
      const Binning bin(centroids.lo[axis], centroids.hi[axis]);
      if (bin.scale == 0) continue;
      std::array<Box, kBins> boxes;
      std::array<size_t, kBins> counts{};
      for (const Reference& r : references) {
        const int b = bin(r.box.centre()[axis]);
        boxes[b].grow(r.box);
        ++counts[b];
      }
      size_t left = 0;
      sweep(boxes, [&](int b, const Box& left_box, const Box& right_box) {
        left += counts[b - 1];
        const double cost = split_cost(left, left_box, references.size() - left, right_box);
        if (cost < best.cost) best = {cost, axis, b, intersection(left_box, right_box)};
      });
    }
    return best;
  }

  void split_objects(const std::vector<Reference>& references, const ObjectSplit& split,
                     std::vector<Reference>& left, std::vector<Reference>& right) const {
    Box centroids;
    for (const Reference& r : references) centroids.grow(r.box.centre());
    const Binning bin(centroids.lo[split.axis], centroids.hi[split.axis]);
    for (const Reference& r : references)
      (bin(r.box.centre()[split.axis]) < split.bin ? left : right).push_back(r);
  }

  // The parts of a reference's box on both sides of a plane that cuts it: bounds of the triangle's corners
  // and of its edges' intersections with the plane, inside the reference's own box.
  void cut(const Reference& r, int axis, float plane, Box& left, Box& right) const {
    left = Box();
    right = Box();
    for (int c = 0; c < 3; ++c) {
      const glm::vec3 a = corner(r.triangle, c), b = corner(r.triangle, (c + 1) % 3);
      if (a[axis] <= plane) left.grow(a);
      if (a[axis] >= plane) right.grow(a);
      if ((a[axis] < plane && b[axis] > plane) || (a[axis] > plane && b[axis] < plane)) {
        // In double and from the lower end, so that neighbours sharing the edge get the same point.
        const bool up = a[axis] < b[axis];
        const glm::dvec3 p = up ? a : b, q = up ? b : a;
        glm::vec3 x(p + (q - p) * ((double(plane) - p[axis]) / (q[axis] - p[axis])));
        x[axis] = plane;
        left.grow(x);
        right.grow(x);
      }
    }
    left = intersection(left, r.box);
    right = intersection(right, r.box);
    left.hi[axis] = std::min(left.hi[axis], plane);
    right.lo[axis] = std::max(right.lo[axis], plane);
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

  SpatialSplit find_spatial_split(const std::vector<Reference>& references, const Box& bounds) const {
    SpatialSplit best;
    for (int axis = 0; axis < 3; ++axis) {
      const Binning bin(bounds.lo[axis], bounds.hi[axis]);
      if (bin.scale == 0 || !separates(bounds, axis)) continue;
      std::array<Box, kBins> boxes;
      std::array<size_t, kBins> entries{}, exits{};
      for (const Reference& r : references) {
        const int first = bin(r.box.lo[axis]), last = bin(r.box.hi[axis]);
        Reference rest = r;
        for (int b = first; b < last; ++b) {
          Box left, right;
          cut(rest, axis, bin.plane(b + 1), left, right);
          if (!left.empty()) boxes[b].grow(left);
          if (right.empty()) {
            rest.box = Box();
            break;
          }
          rest.box = right;
        }
        if (!rest.box.empty()) boxes[last].grow(rest.box);
        ++entries[first];
        ++exits[last];
      }
      size_t left = 0, exited = 0;
      sweep(boxes, [&](int b, const Box& left_box, const Box& right_box) {
        left += entries[b - 1];
        exited += exits[b - 1];
        const size_t right = references.size() - exited;
        const double cost = split_cost(left, left_box, right, right_box);
        if (cost < best.cost) best = {cost, axis, bin.plane(b), left, right};
      });
    }
    return best;
  }

  void split_spatially(const std::vector<Reference>& references, const SpatialSplit& split,
                       std::vector<Reference>& left, std::vector<Reference>& right) const {
    // First the references on one side only; then each that straddles goes where it costs least (Stich 4.4).
    Box left_box, right_box;
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
