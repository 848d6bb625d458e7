#include "wide_tree.h"

#include <tbb/parallel_invoke.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "box.h"
#include "lsp/program.h"
#include "vectors.h"

namespace lsp {
namespace {

constexpr size_t kChildren = LSP_WIDE_CHILDREN;

// What is paid for a node, and for a leaf and each of its triangles; only the ratios matter. With 0.1 or 0.6
// for the latter a ray visits as many nodes within 3 %.
constexpr double kNodeCost = 1.0, kLeafCost = 0.3, kTriangleCost = 0.3;
constexpr uint32_t kMaxLeaf = 4;  // triangles that subtrees are put together to

// A child on its way into a wide node: where the BVH refers to it.
struct Branch {
  Box box;
  uint32_t* slot;
  uint32_t ref() const { return *slot; }
};

bool is_leaf_reference(uint32_t ref) { return (ref & LSP_LEAF_BIT) != 0; }
uint32_t count_of(uint32_t leaf) { return (leaf >> LSP_LEAF_COUNT_SHIFT & LSP_LEAF_COUNT_MASK) + 1; }

class Collapse {
 public:
  Collapse(const Mesh& mesh, Bvh& bvh) : mesh_(mesh), bvh_(bvh), plans_(bvh.nodes.size()) {}

  WideTree run() {
    if (bvh_.root == LSP_NONE) return {};
    plan_all(0, static_cast<uint32_t>(bvh_.nodes.size()));
    order_.reserve(bvh_.records.size());
    std::vector<Branch> root;
    if (is_leaf_reference(bvh_.root))
      root.push_back({box_of_records(bvh_.root), &bvh_.root});
    else
      root = cut(bvh_.root);
    tree_.nodes.emplace_back();
    fill(0, root, 0);
    std::vector<uint32_t> records(bvh_.records.size());
    for (size_t i = 0; i < order_.size(); ++i) records[i] = bvh_.records[order_[i]];
    bvh_.records = std::move(records);
    tree_.max_steps = static_cast<uint32_t>(tree_.nodes.size()) + leaves_;
    return std::move(tree_);
  }

 private:
  // How a ray that enters a box fares: it hits something with this probability, and pays so much to know.
  struct Fate {
    double hit = 0, cost = 0;
    double worth() const { return hit / cost; }
  };

  // Of a node of the BVH.
  struct Plan {
    double cost[kChildren] = {};   // [k - 1]: of its subtree cut into at most k branches of one wide node
    uint8_t left[kChildren] = {};  // branches for child 0 where it is cut into exactly k; 0: it is not cut
    uint32_t triangles = 0;
    bool leaf = false;  // best made one leaf
    Fate fate;
  };

  Branch child_of(uint32_t ref, int k) const {
    LspNode& n = bvh_.nodes[ref];
    return k == 0 ? Branch{{vec(n.lo0), vec(n.hi0)}, &n.child0} : Branch{{vec(n.lo1), vec(n.hi1)}, &n.child1};
  }
  bool is_leaf(uint32_t ref) const { return is_leaf_reference(ref) || plans_[ref].leaf; }
  uint32_t triangles_of(uint32_t ref) const {
    return is_leaf_reference(ref) ? count_of(ref) : plans_[ref].triangles;
  }
  static double leaf_cost(double area, uint32_t triangles) {
    return area * (kLeafCost + kTriangleCost * triangles);
  }
  double cost_of(const Branch& b, size_t k) const {
    return is_leaf_reference(b.ref()) ? leaf_cost(b.box.half_area(), count_of(b.ref()))
                                      : plans_[b.ref()].cost[k - 1];
  }

  // Plans a subtree, the nodes from `first` to `end`: in depth-first order, child 0 before child 1.
  void plan_all(uint32_t first, uint32_t end) {
    constexpr uint32_t kTaskNodes = 4096;  // smaller subtrees are planned by one task
    if (end - first > kTaskNodes) {
      const LspNode& n = bvh_.nodes[first];
      const bool both = !is_leaf_reference(n.child0) && !is_leaf_reference(n.child1);
      const uint32_t second = both ? n.child1 : end;
      tbb::parallel_invoke([&] { plan_all(first + 1, second); }, [&] { plan_all(second, end); });
      return plan(first);
    }
    // Children come after their parents: from the last node on, what is below is known.
    for (uint32_t i = end; i-- > first;) plan(i);
  }

  // Dynamic programming over the ways to cut a subtree (Ylitie, section 3.2).
  void plan(uint32_t ref) {
    Plan& plan = plans_[ref];
    const Branch children[2] = {child_of(ref, 0), child_of(ref, 1)};
    Box box = children[0].box;
    box.grow(children[1].box);
    const double area = box.half_area();
    plan.triangles = triangles_of(children[0].ref()) + triangles_of(children[1].ref());
    std::array<double, kChildren + 1> cost{};  // cut into at most k branches, two at least
    for (size_t k = 2; k <= kChildren; ++k) {
      cost[k] = INFINITY;
      for (size_t left = 1; left < k; ++left) {
        const double both = cost_of(children[0], left) + cost_of(children[1], k - left);
        if (both < cost[k]) {
          cost[k] = both;
          plan.left[k - 1] = static_cast<uint8_t>(left);
        }
      }
    }
    const double as_node = area * kNodeCost + cost[kChildren];
    const double as_leaf = plan.triangles <= kMaxLeaf ? leaf_cost(area, plan.triangles) : INFINITY;
    plan.leaf = as_leaf <= as_node;
    plan.cost[0] = std::min(as_leaf, as_node);
    for (size_t k = 2; k < kChildren; ++k) {
      plan.cost[k - 1] = std::min(plan.cost[k - 2], cost[k]);
      if (!(cost[k] < plan.cost[k - 2])) plan.left[k - 1] = 0;  // fewer branches do as well
    }
    if (!plan.leaf) {
      std::vector<Branch> branches = cut(ref);
      sort_by_worth(branches);
      plan.fate = fate_of(branches, area);
    }
  }

  // The branches of the wide node that a node of the BVH becomes.
  std::vector<Branch> cut(uint32_t ref) const {
    std::vector<Branch> branches;
    const size_t left = plans_[ref].left[kChildren - 1];
    add_cut(child_of(ref, 0), left, branches);
    add_cut(child_of(ref, 1), kChildren - left, branches);
    return branches;
  }
  // At most kChildren deep.
  void add_cut(const Branch& branch, size_t k, std::vector<Branch>& branches) const {
    if (!is_leaf_reference(branch.ref())) {
      const Plan& plan = plans_[branch.ref()];
      while (k > 1 && plan.left[k - 1] == 0) --k;
      if (k > 1) {
        add_cut(child_of(branch.ref(), 0), plan.left[k - 1], branches);
        add_cut(child_of(branch.ref(), 1), k - plan.left[k - 1], branches);
        return;
      }
    }
    branches.push_back(branch);
  }

  Box box_of_records(uint32_t leaf) const {
    Box box;
    for (uint32_t i = 0; i < count_of(leaf); ++i)
      for (int c = 0; c < 3; ++c)
        box.grow(mesh_.positions[mesh_.triangles[bvh_.records[(leaf & LSP_LEAF_FIRST_MASK) + i]][c]]);
    return box;
  }

  // Chance that a ray through a box passes all triangles of a subtree that becomes a leaf: a line that meets
  // a box of surface S meets a triangle in it of area A in 2 A / S of the cases.
  double misses(uint32_t ref, double half_surface) const {
    if (!is_leaf_reference(ref))
      return misses(bvh_.nodes[ref].child0, half_surface) * misses(bvh_.nodes[ref].child1, half_surface);
    double all = 1;
    for (uint32_t i = 0; i < count_of(ref); ++i) {
      const glm::uvec3 t = mesh_.triangles[bvh_.records[(ref & LSP_LEAF_FIRST_MASK) + i]];
      const glm::dvec3 a = mesh_.positions[t.x], b = mesh_.positions[t.y], c = mesh_.positions[t.z];
      const double area = 0.5 * glm::length(glm::cross(b - a, c - a));
      all *= 1 - (area < half_surface ? area / half_surface : 1);
    }
    return all;
  }

  Fate fate_of(const Branch& b) const {
    if (!is_leaf(b.ref())) return plans_[b.ref()].fate;
    return {1 - misses(b.ref(), b.box.half_area()), leaf_cost(1, triangles_of(b.ref()))};
  }
  Fate fate_of(const std::vector<Branch>& branches, double area) const {
    Fate fate{1, kNodeCost};
    for (const Branch& b : branches) {
      const double enters = area > 0 ? std::min(1.0, b.box.half_area() / area) : 1;
      const Fate below = fate_of(b);
      fate.cost += enters * below.cost * fate.hit;
      fate.hit *= 1 - enters * below.hit;  // so far: the chance of none
    }
    fate.hit = 1 - fate.hit;
    return fate;
  }
  // A stable sort: there are few.
  void sort_by_worth(std::vector<Branch>& branches) const {
    std::array<double, kChildren> worth;
    for (size_t i = 0; i < branches.size(); ++i) {
      const Branch branch = branches[i];
      const double own = fate_of(branch).worth();
      size_t at = i;
      for (; at > 0 && own > worth[at - 1]; --at) {
        worth[at] = worth[at - 1];
        branches[at] = branches[at - 1];
      }
      worth[at] = own;
      branches[at] = branch;
    }
  }

  void collect(uint32_t ref, std::vector<uint32_t*>& leaves) {
    if (is_leaf_reference(ref)) return;
    for (uint32_t* child : {&bvh_.nodes[ref].child0, &bvh_.nodes[ref].child1})
      if (is_leaf_reference(*child))
        leaves.push_back(child);
      else
        collect(*child, leaves);
  }

  // Gives a leaf's records their new places, and the BVH's leaves below it theirs.
  uint32_t place(uint32_t& ref) {
    std::vector<uint32_t*> leaves;
    if (is_leaf_reference(ref))
      leaves.push_back(&ref);
    else
      collect(ref, leaves);
    uint32_t count = 0;
    for (uint32_t* leaf : leaves) {
      const uint32_t first = *leaf & LSP_LEAF_FIRST_MASK;
      *leaf = (*leaf & ~LSP_LEAF_FIRST_MASK) | static_cast<uint32_t>(order_.size());
      for (uint32_t i = 0; i < count_of(*leaf); ++i) order_.push_back(first + i);
      count += count_of(*leaf);
    }
    return count;
  }

  // Makes node `at` of these branches. As deep as the tree.
  void fill(uint32_t at, std::vector<Branch>& branches, uint32_t depth) {
    sort_by_worth(branches);
    Box box;
    for (const Branch& b : branches) box.grow(b.box);
    LspWideNode n{};
    n.lo = f3(box.lo);
    n.step = {step(box, 0), step(box, 1), step(box, 2)};
    n.node_first = static_cast<uint32_t>(tree_.nodes.size());
    n.triangle_first = static_cast<uint32_t>(order_.size());
    uint32_t inner = 0;
    for (size_t k = 0; k < kChildren; ++k) {
      const bool used = k < branches.size();
      uint32_t child = LSP_WIDE_NO_CHILD;
      if (used && is_leaf(branches[k].ref())) {
        const auto first = static_cast<uint32_t>(order_.size()) - n.triangle_first;
        const uint32_t count = place(*branches[k].slot);
        child = (count - 1) << LSP_WIDE_LEAF_COUNT_SHIFT | first;
        tree_.max_leaf_triangles = std::max(tree_.max_leaf_triangles, count);
        ++leaves_;
      } else if (used) {
        child = LSP_WIDE_NODE_BIT | inner++;
      }
      n.children[k / 2] |= child << (k % 2 * 16);
      for (int axis = 0; axis < 3; ++axis) {
        const auto [lo, hi] = used ? bytes(n, branches[k].box, axis) : std::pair<uint32_t, uint32_t>{255, 0};
        n.planes[2 * static_cast<size_t>(axis) + k / 4] |= lo << (k % 4 * 8);
        n.planes[6 + 2 * static_cast<size_t>(axis) + k / 4] |= hi << (k % 4 * 8);
      }
    }
    tree_.max_depth = std::max(tree_.max_depth, depth + 1);
    tree_.nodes.resize(tree_.nodes.size() + inner);
    if (tree_.nodes.size() > kMaxNodes)
      throw Failure(Exit::kLimit, "", "the tree needs more than 134,217,727 nodes, split the input");
    tree_.nodes[at] = n;
    uint32_t next = n.node_first;
    for (const Branch& b : branches) {
      if (is_leaf(b.ref())) continue;
      std::vector<Branch> below = cut(b.ref());
      fill(next++, below, depth + 1);
    }
  }

  // The smallest float of which 255 reach across the box.
  static float step(const Box& box, int axis) {
    const double extent = static_cast<double>(box.hi[axis]) - box.lo[axis];
    auto s = static_cast<float>(extent / 255);
    while (255.0 * s < extent) s = std::nextafter(s, INFINITY);
    return s;
  }

  // The steps that a box begins before and ends behind.
  static std::pair<uint32_t, uint32_t> bytes(const LspWideNode& n, const Box& box, int axis) {
    const double corner = (&n.lo.x)[axis], step = (&n.step.x)[axis];
    if (step == 0) return {0, 0};
    const double lo = std::floor((box.lo[axis] - corner) / step),
                 hi = std::ceil((box.hi[axis] - corner) / step);
    return {static_cast<uint32_t>(std::clamp(lo, 0.0, 255.0)),
            static_cast<uint32_t>(std::clamp(hi, 0.0, 255.0))};
  }

  static constexpr size_t kMaxNodes = LSP_LEAF_FIRST_MASK;

  const Mesh& mesh_;
  Bvh& bvh_;
  std::vector<Plan> plans_;
  std::vector<uint32_t> order_;  // of the old records
  WideTree tree_;
  uint32_t leaves_ = 0;
};

}  // namespace

WideTree build_wide_tree(const Mesh& mesh, Bvh& bvh) { return Collapse(mesh, bvh).run(); }

void set_wide(const WideTree& tree, LspHeader& header) {
  header.root = LSP_NONE;
  header.root_line_space = LSP_NONE;
  header.node_count = 0;
  header.wide_node_count = static_cast<uint32_t>(tree.nodes.size());
  header.max_depth = tree.max_depth;
  header.max_stack = std::max(1u, tree.max_depth);
  header.max_steps = tree.max_steps;
  header.max_leaf_triangles = tree.max_leaf_triangles;
}

}  // namespace lsp
