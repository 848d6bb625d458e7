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

class Collapse {
 public:
  Collapse(const lsp_scene& scene, std::vector<WideNode>& nodes, std::vector<TriangleBlock>& blocks)
      : scene_(scene), nodes_(nodes), blocks_(blocks), triangles_(scene.header->node_count) {
    const LspHeader& header = *scene.header;
    if (header.root != LSP_NONE) count(header.root);
    add_node({{header.bounds_min, header.bounds_max, header.root}});
  }

 private:
  static uint32_t leaf_count(uint32_t ref) {
    return ((ref >> LSP_LEAF_COUNT_SHIFT) & LSP_LEAF_COUNT_MASK) + 1;
  }

  // Triangles below a reference; recursion is as deep as the tree, which the format bounds.
  uint32_t count(uint32_t ref) {
    if (ref == LSP_NONE) return 0;
    if (ref & LSP_LEAF_BIT) return leaf_count(ref);
    const LspNode& node = scene_.nodes[ref];
    return triangles_[ref] = count(node.child0) + count(node.child1);
  }

  // One block holds it all: no need to go on.
  bool is_small(const Branch& branch) const {
    return branch.is_leaf() || triangles_[branch.ref] <= kBlockTriangles;
  }

  void expand(std::vector<Branch>& branches, size_t at) const {
    const LspNode& node = scene_.nodes[branches[at].ref];
    branches.erase(branches.begin() + static_cast<ptrdiff_t>(at));
    if (node.child0 != LSP_NONE) branches.push_back({node.lo0, node.hi0, node.child0});
    if (node.child1 != LSP_NONE) branches.push_back({node.lo1, node.hi1, node.child1});
  }

  // Opens the largest branch again and again while there is room, then the rest become nodes and leaves.
  uint32_t add_node(std::vector<Branch> branches) {
    std::erase_if(branches, [](const Branch& branch) { return branch.ref == LSP_NONE; });
    while (branches.size() < kWideChildren) {
      size_t best = branches.size();
      for (size_t i = 0; i < branches.size(); ++i) {
        if (is_small(branches[i])) continue;
        if (best == branches.size() || branches[i].area() > branches[best].area()) best = i;
      }
      if (best == branches.size()) break;
      expand(branches, best);
    }
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
      const uint32_t child = is_small(branches[k]) ? add_leaf(branches[k].ref) : add_node({branches[k]});
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
  std::vector<uint32_t> triangles_;  // below each node of the file
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
