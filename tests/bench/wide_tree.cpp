#include "wide_tree.h"

#include <algorithm>
#include <cmath>

#include "lsp/program.h"
#include "timing.h"

namespace lsp::bench {
namespace {

// A child on its way into a wide node.
struct Branch {
  lsp_float3 lo, hi;
  uint32_t ref;  // as in the file

  float area() const {
    const float x = hi.x - lo.x, y = hi.y - lo.y, z = hi.z - lo.z;
    return x * y + y * z + z * x;
  }
  bool is_leaf() const { return ref & LSP_LEAF_BIT; }
};

// What a visit costs, of a node and of a block of triangles; only the ratio matters.
constexpr float kNodeCost = 1.0f, kBlockCost = 0.6f;

// Chooses which binary nodes become wide ones so that the surface area heuristic's cost is least, by dynamic
// programming (Ylitie, Karras, Laine 2017, section 3.2): cost(n, k) is that of the subtree of n cut into at
// most k branches of one wide node.
class Collapse {
 public:
  Collapse(const lsp_scene& scene, std::vector<WideNode>& nodes, std::vector<TriangleBlock>& blocks)
      : scene_(scene), nodes_(nodes), blocks_(blocks), plans_(scene.header->node_count) {
    const LspHeader& header = *scene.header;
    const Branch root{header.bounds_min, header.bounds_max, header.root};
    if (header.root == LSP_NONE) {
      add_node({});
      return;
    }
    plan(root);
    if (is_leaf(root))
      add_node({root});
    else
      add_node(branches_of(root));
  }

 private:
  struct Plan {
    float cost[kWideChildren] = {};    // [k - 1]: with at most k branches
    uint8_t left[kWideChildren] = {};  // branches for child 0 where it is cut into exactly k; 0: not cut
    uint32_t triangles = 0;
    bool leaf = false;  // best ended here, in one block
  };

  static uint32_t leaf_count(uint32_t ref) {
    return ((ref >> LSP_LEAF_COUNT_SHIFT) & LSP_LEAF_COUNT_MASK) + 1;
  }
  static Branch child_of(const LspNode& node, int k) {
    return k == 0 ? Branch{node.lo0, node.hi0, node.child0} : Branch{node.lo1, node.hi1, node.child1};
  }

  bool is_leaf(const Branch& branch) const { return branch.is_leaf() || plans_[branch.ref].leaf; }

  uint32_t triangles_of(const Branch& branch) const {
    if (branch.ref == LSP_NONE) return 0;
    return branch.is_leaf() ? leaf_count(branch.ref) : plans_[branch.ref].triangles;
  }

  float cost_of(const Branch& branch, size_t k) const {
    if (branch.ref == LSP_NONE) return 0;
    if (!branch.is_leaf()) return plans_[branch.ref].cost[k - 1];
    const uint32_t blocks = (leaf_count(branch.ref) + kBlockTriangles - 1) / kBlockTriangles;
    return branch.area() * kBlockCost * static_cast<float>(blocks);
  }

  // Recursion is as deep as the tree, which the format bounds.
  void plan(const Branch& branch) {
    if (branch.ref == LSP_NONE || branch.is_leaf()) return;
    const LspNode& node = scene_.nodes[branch.ref];
    const Branch children[2] = {child_of(node, 0), child_of(node, 1)};
    for (const Branch& child : children) plan(child);
    Plan& plan = plans_[branch.ref];
    plan.triangles = triangles_of(children[0]) + triangles_of(children[1]);
    float cut[kWideChildren + 1] = {};  // into at most k branches, two at least
    for (size_t k = 2; k <= kWideChildren; ++k) {
      cut[k] = INFINITY;
      for (size_t left = 1; left < k; ++left) {
        const float cost = cost_of(children[0], left) + cost_of(children[1], k - left);
        if (cost < cut[k]) {
          cut[k] = cost;
          plan.left[k - 1] = static_cast<uint8_t>(left);
        }
      }
    }
    const float as_node = branch.area() * kNodeCost + cut[kWideChildren];
    const float as_leaf = plan.triangles <= kBlockTriangles ? branch.area() * kBlockCost : INFINITY;
    plan.leaf = as_leaf <= as_node;
    plan.cost[0] = std::min(as_leaf, as_node);
    for (size_t k = 2; k < kWideChildren; ++k) {
      plan.cost[k - 1] = std::min(plan.cost[k - 2], cut[k]);
      if (!(cut[k] < plan.cost[k - 2])) plan.left[k - 1] = 0;  // fewer branches do as well
    }
  }

  // The branches of a wide node: what the plan cuts `branch` into.
  std::vector<Branch> branches_of(const Branch& branch) const {
    std::vector<Branch> out;
    cut(branch, kWideChildren, true, out);
    return out;
  }

  void cut(const Branch& branch, size_t k, bool is_root, std::vector<Branch>& out) const {
    if (branch.ref == LSP_NONE) return;
    if (!branch.is_leaf()) {
      const Plan& plan = plans_[branch.ref];
      if (!is_root) {
        while (k > 1 && plan.left[k - 1] == 0) --k;
      }
      if (k > 1) {
        const LspNode& node = scene_.nodes[branch.ref];
        cut(child_of(node, 0), plan.left[k - 1], false, out);
        cut(child_of(node, 1), k - plan.left[k - 1], false, out);
        return;
      }
    }
    out.push_back(branch);
  }

  uint32_t add_node(std::vector<Branch> branches) {
    std::stable_sort(branches.begin(), branches.end(),
                     [](const Branch& a, const Branch& b) { return a.area() > b.area(); });
    const auto index = static_cast<uint32_t>(nodes_.size());
    WideNode& node = nodes_.emplace_back();
    for (size_t k = 0; k < kWideChildren; ++k) {
      const bool used = k < branches.size();
      const lsp_float3 lo = used ? branches[k].lo : lsp_float3{INFINITY, INFINITY, INFINITY};
      const lsp_float3 hi = used ? branches[k].hi : lsp_float3{-INFINITY, -INFINITY, -INFINITY};
      const float planes[6] = {lo.x, lo.y, lo.z, hi.x, hi.y, hi.z};
      for (size_t p = 0; p < 6; ++p) node.plane[p][k] = planes[p];
      node.child[k] = LSP_NONE;
    }
    node.children = static_cast<uint32_t>(branches.size());
    for (size_t k = 0; k < branches.size(); ++k) {
      const uint32_t child =
          is_leaf(branches[k]) ? add_leaf(branches[k].ref) : add_node(branches_of(branches[k]));
      nodes_[index].child[k] = child;  // not through `node`: the vector may have moved
    }
    return index;
  }

  void collect(uint32_t ref, std::vector<uint32_t>& records) const {
    if (ref == LSP_NONE) return;
    if (ref & LSP_LEAF_BIT) {
      for (uint32_t i = 0; i < leaf_count(ref); ++i) records.push_back((ref & LSP_LEAF_FIRST_MASK) + i);
      return;
    }
    collect(scene_.nodes[ref].child0, records);
    collect(scene_.nodes[ref].child1, records);
  }

  uint32_t add_leaf(uint32_t ref) {
    std::vector<uint32_t> records;
    collect(ref, records);
    const auto first = static_cast<uint32_t>(blocks_.size());
    for (size_t i = 0; i < records.size(); i += kBlockTriangles) {
      TriangleBlock& block = blocks_.emplace_back();
      for (size_t k = 0; k < kBlockTriangles; ++k) {
        const bool used = i + k < records.size();
        block.record[k] = used ? records[i + k] : LSP_NONE;
        if (!used) {
          for (auto& values : block.corner) values[k] = 0;
          continue;
        }
        const LspTriangle& tri = scene_.triangles[records[i + k]];
        const lsp_float3 corners[3] = {tri.v0, tri.v1, tri.v2};
        for (size_t c = 0; c < 3; ++c) {
          block.corner[3 * c + 0][k] = corners[c].x;
          block.corner[3 * c + 1][k] = corners[c].y;
          block.corner[3 * c + 2][k] = corners[c].z;
        }
      }
    }
    const auto count = static_cast<uint32_t>(blocks_.size()) - first;
    return LSP_LEAF_BIT | (count - 1) << LSP_LEAF_COUNT_SHIFT | first;
  }

  const lsp_scene& scene_;
  std::vector<WideNode>& nodes_;
  std::vector<TriangleBlock>& blocks_;
  std::vector<Plan> plans_;  // of the file's nodes
};

class WideTracer : public Tracer {
 public:
  WideTracer(const WideTree& tree, unsigned threads) : tree_(tree), threads_(threads) {}
  std::string name() const override { return "wide tree"; }
  double trace(const Mode& mode, std::span<const LspRay> rays, std::span<LspHit> hits) override {
    return run_in_chunks(rays.size(), threads_, [&](size_t first, size_t count) {
      tree_.trace(mode.any, rays.subspan(first, count), hits.subspan(first, count));
    });
  }

 private:
  const WideTree& tree_;
  unsigned threads_;
};

}  // namespace

WideTree::WideTree(const OpenFile& file) : scene_(&file.scene()) {
  if (!file.has_exact_tree() || scene_->header->base_structure != LSP_BASE_BVH) {
    throw Failure(Exit::kUnsupported, file.path().string(), "has no exact BVH that could be made wide");
  }
  Collapse(*scene_, nodes_, blocks_);
}

size_t WideTree::bytes() const {
  return nodes_.size() * sizeof(WideNode) + blocks_.size() * sizeof(TriangleBlock);
}

std::unique_ptr<Tracer> wide_tracer(const WideTree& tree, unsigned threads) {
  return std::make_unique<WideTracer>(tree, threads);
}

}  // namespace lsp::bench
