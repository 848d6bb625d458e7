#include "sites.h"

#include <algorithm>
#include <glm/glm.hpp>
#include <utility>

namespace lsp {
namespace {

bool is_leaf(uint32_t child) { return (child & LSP_LEAF_BIT) != 0; }

bool at_depth(const LineSpaceOptions& options, uint32_t depth) {
  return std::find(options.depths.begin(), options.depths.end(), depth) != options.depths.end();
}

uint32_t last_depth(const LineSpaceOptions& options) {
  return *std::max_element(options.depths.begin(), options.depths.end());
}

// Walks a BVH depth first.
class BvhChooser {
 public:
  BvhChooser(const Bvh& bvh, const LineSpaceOptions& options)
      : bvh_(bvh), options_(options), last_depth_(last_depth(options)) {}

  void visit(uint32_t child, const lsp_float3& lo, const lsp_float3& hi, uint32_t depth, size_t parent) {
    const auto [first, count] = records(child);
    const bool small = count < options_.triangles;
    if (small || (at_depth(options_, depth) && !is_leaf(child))) {
      sites.push_back({child, lo, hi, child, lo, hi, first, count, parent});
      parent = sites.size() - 1;
    }
    if (small || is_leaf(child) || depth >= last_depth_) return;
    const LspNode& node = bvh_.nodes[child];
    visit(node.child0, node.lo0, node.hi0, depth + 1, parent);
    visit(node.child1, node.lo1, node.hi1, depth + 1, parent);
  }

  std::vector<LineSpaceSite> sites;

 private:
  // First and number of the records of a subtree, from its first leaf's start to its last leaf's end.
  std::pair<uint32_t, uint32_t> records(uint32_t child) const {
    uint32_t first = child, last = child;
    while (!is_leaf(first)) first = bvh_.nodes[first].child0;
    while (!is_leaf(last)) last = bvh_.nodes[last].child1;
    const uint32_t end =
        (last & LSP_LEAF_FIRST_MASK) + ((last >> LSP_LEAF_COUNT_SHIFT) & LSP_LEAF_COUNT_MASK) + 1;
    return {first & LSP_LEAF_FIRST_MASK, end - (first & LSP_LEAF_FIRST_MASK)};
  }

  const Bvh& bvh_;
  const LineSpaceOptions& options_;
  uint32_t last_depth_;
};

// Walks an NTree node by node, its cells in their order.
class NTreeChooser {
 public:
  NTreeChooser(const NTree& ntree, const Bvh& bvh, const LspHeader& bounds, const LineSpaceOptions& options)
      : ntree_(ntree), bvh_(bvh), bounds_(bounds), options_(options), last_depth_(last_depth(options)) {}

  std::vector<LineSpaceSite> run() {
    const glm::vec3 lo(ntree_.lo.x, ntree_.lo.y, ntree_.lo.z);
    size_t parent = kNoSite;
    if (at_depth(options_, 0)) parent = add(0, lo, lo + ntree_.size, parent);
    visit(0, glm::ivec3(0), 1, parent);
    // From the order of the walk to that of the cells.
    std::vector<size_t> order(sites_.size()), place(sites_.size());
    for (size_t i = 0; i < order.size(); ++i) order[i] = i;
    std::sort(order.begin(), order.end(),
              [&](size_t a, size_t b) { return sites_[a].cell + 1 < sites_[b].cell + 1; });
    for (size_t i = 0; i < order.size(); ++i) place[order[i]] = i;
    std::vector<LineSpaceSite> sorted;
    for (size_t i : order) {
      sorted.push_back(sites_[i]);
      if (sorted.back().parent != kNoSite) sorted.back().parent = place[sorted.back().parent];
    }
    return sorted;
  }

 private:
  // `level` is that of the node's cells, `origin` its first cell.
  void visit(uint32_t node, const glm::ivec3& origin, uint32_t level, size_t parent) {
    if (level > last_depth_) return;
    const uint32_t n = ntree_.branching, words = LSP_GRID_WORDS(n);
    float cell = ntree_.size;
    for (uint32_t l = 0; l < level; ++l) cell /= float(n);
    uint32_t index = ntree_.grid[size_t(node) * words].offset;
    for (uint32_t c = 0; c < n * n * n; ++c) {
      if (!(ntree_.grid[size_t(node) * words + c / 32].bits >> c % 32 & 1)) continue;
      const LspCell& record = ntree_.cells[index];
      const glm::ivec3 at = origin + glm::ivec3(c % n, c / n % n, c / (n * n));
      const bool leaf = is_leaf(record.child);
      const bool small = leaf && record.count < options_.triangles;
      size_t own = parent;
      if (small || (at_depth(options_, level) && !leaf)) {
        const glm::vec3 root(ntree_.lo.x, ntree_.lo.y, ntree_.lo.z);
        own = add(record.child, root + glm::vec3(at) * cell, root + glm::vec3(at + 1) * cell, parent);
        sites_[own].cell = index;
      }
      if (!leaf) visit(record.child, at * int(n), level + 1, own);
      ++index;
    }
  }

  size_t add(uint32_t child, const glm::vec3& lo, const glm::vec3& hi, size_t parent) {
    LineSpaceSite site{child,
                       {lo.x, lo.y, lo.z},
                       {hi.x, hi.y, hi.z},
                       bvh_.root,
                       bounds_.bounds_min,
                       bounds_.bounds_max,
                       0,
                       0,
                       parent};
    // The smallest subtree that has all that reaches into the box.
    const auto apart = [&](const lsp_float3& l, const lsp_float3& h) {
      // More than the margin that fill_line_spaces gives a box.
      const glm::vec3 margin = 1e-3f * (hi - lo) + 1e-5f * glm::max(glm::abs(lo), glm::abs(hi));
      return l.x > hi.x + margin.x || l.y > hi.y + margin.y || l.z > hi.z + margin.z ||
             h.x < lo.x - margin.x || h.y < lo.y - margin.y || h.z < lo.z - margin.z;
    };
    while (!is_leaf(site.subtree)) {
      const LspNode& node = bvh_.nodes[site.subtree];
      const bool first = !apart(node.lo0, node.hi0), second = !apart(node.lo1, node.hi1);
      if (first == second) break;
      site.subtree = first ? node.child0 : node.child1;
      site.subtree_lo = first ? node.lo0 : node.lo1;
      site.subtree_hi = first ? node.hi0 : node.hi1;
    }
    sites_.push_back(site);
    return sites_.size() - 1;
  }

  const NTree& ntree_;
  const Bvh& bvh_;
  const LspHeader& bounds_;
  const LineSpaceOptions& options_;
  uint32_t last_depth_;
  std::vector<LineSpaceSite> sites_;
};

}  // namespace

std::vector<LineSpaceSite> choose_sites(const Bvh& bvh, const LspHeader& bounds,
                                        const LineSpaceOptions& options) {
  if (bvh.root == LSP_NONE || options.depths.empty()) return {};
  BvhChooser chooser(bvh, options);
  chooser.visit(bvh.root, bounds.bounds_min, bounds.bounds_max, 0, kNoSite);
  return std::move(chooser.sites);
}

uint32_t attach(Bvh& bvh, const std::vector<LineSpaceSite>& sites, const std::vector<uint32_t>& references) {
  // A child reference names its node or leaf uniquely.
  std::vector<std::pair<uint32_t, uint32_t>> by_child;
  for (size_t i = 0; i < sites.size(); ++i) by_child.emplace_back(sites[i].child, references[i]);
  std::sort(by_child.begin(), by_child.end());
  const auto reference_of = [&](uint32_t child) {
    const auto it = std::lower_bound(by_child.begin(), by_child.end(), std::pair(child, 0u));
    return it != by_child.end() && it->first == child ? it->second : LSP_NONE;
  };
  for (LspNode& node : bvh.nodes) {
    node.line_space0 = reference_of(node.child0);
    node.line_space1 = reference_of(node.child1);
  }
  return reference_of(bvh.root);
}

std::vector<LineSpaceSite> choose_sites(const NTree& ntree, const Bvh& bvh, const LspHeader& bounds,
                                        const LineSpaceOptions& options) {
  if (ntree.node_count == 0 || options.depths.empty()) return {};
  return NTreeChooser(ntree, bvh, bounds, options).run();
}

uint32_t attach(NTree& ntree, const std::vector<LineSpaceSite>& sites,
                const std::vector<uint32_t>& references) {
  uint32_t root = LSP_NONE;
  for (size_t i = 0; i < sites.size(); ++i)
    (sites[i].cell == kNoCell ? root : ntree.cells[sites[i].cell].line_space) = references[i];
  return root;
}

}  // namespace lsp
