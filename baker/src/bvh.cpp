#include "bvh.h"

#include <tbb/task_group.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <memory>

#include "lsp/program.h"
#include "object_split.h"
#include "spatial_split.h"

namespace lsp {
namespace {

constexpr size_t kTaskReferences = 4096;  // smaller subtrees are built by one task

// Where this many nodes in a row found no spatial split worth its cost, those below are not asked any more:
// in a heap of triangles that all overlap none ever is, and looking for one takes most of the time.
constexpr uint32_t kPatience = 8;

struct TreeNode {
  Box box;
  std::unique_ptr<TreeNode> child[2];
  std::vector<uint32_t> triangles;  // of a leaf
};

class Builder {
 public:
  Builder(const Mesh& mesh, const BvhOptions& options, const std::function<void(double)>& progress)
      : mesh_(mesh), options_(options), progress_(progress), spatial_(mesh, options.triangle_cost) {}

  std::unique_ptr<TreeNode> build() {
    std::vector<Reference> references(mesh_.triangles.size());
    Box bounds;
    for (size_t i = 0; i < references.size(); ++i) {
      references[i].triangle = uint32_t(i);
      for (int c = 0; c < 3; ++c) references[i].box.grow(spatial_.corner(uint32_t(i), c));
      if (options_.within) spatial_.clip(references[i], *options_.within);
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
  void build_node(TreeNode& node, std::vector<Reference> references, size_t spare, uint32_t depth,
                  uint32_t patience) {
    node.box = bounds_of(references).box();
    const size_t count = references.size();
    if (count <= 1) return make_leaf(node, references);

    std::vector<Reference> left, right;
    bool split = false;
    if (depth < options_.heuristic_depth) {
      const ObjectSplit object = find_object_split(references, options_.triangle_cost);
      SpatialSplit spatial;
      const bool overlapping = spare > 0 && patience > 0 && !object.overlap.empty() &&
                               object.overlap.half_area() > options_.split_overlap * root_area_;
      const double area = node.box.half_area(), traversal_cost = options_.traversal_cost * area;
      const double leaf_cost = options_.triangle_cost * double(count) * area;
      const bool may_be_leaf = count <= options_.max_leaf_triangles;
      // What costs more would not be chosen.
      const double most = may_be_leaf ? std::min(object.cost, leaf_cost - traversal_cost) : object.cost;
      if (overlapping) spatial = spatial_.find(references, node.box, most);
      const bool use_spatial = spatial.cost < object.cost && spatial.left + spatial.right <= count + spare &&
                               spatial.left && spatial.right;
      if (overlapping) patience = use_spatial ? kPatience : patience - 1;
      const double cost = traversal_cost + (use_spatial ? spatial.cost : object.cost);
      if (may_be_leaf && leaf_cost <= cost) return make_leaf(node, references);
      if (use_spatial) {
        spatial_.split(references, spatial, left, right);
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

  const Mesh& mesh_;
  const BvhOptions& options_;
  const std::function<void(double)>& progress_;
  const SpatialSplitter spatial_;
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
