#include "ntree.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <atomic>
#include <bit>
#include <cmath>
#include <glm/glm.hpp>

#include "box.h"
#include "lsp/program.h"
#include "vectors.h"

namespace lsp {
namespace {

using Cell3 = glm::ivec3;
constexpr float kLeastCell = 2;  // margins

// Does a triangle, its corners given from the centre of a cube, reach into the cube of this half edge?
// Separating axes (Akenine-Moeller, "Fast 3D Triangle-Box Overlap Testing", 2001); the nine axes and the
// plane, the box's own having been tested. Errs towards yes.
bool reaches(const glm::dvec3 (&v)[3], double half) {
  const glm::dvec3 e[3] = {v[1] - v[0], v[2] - v[1], v[0] - v[2]};
  const glm::dvec3 n = glm::cross(e[0], e[1]);
  const auto separates = [&](const glm::dvec3& axis) {
    const double a = glm::dot(axis, v[0]), b = glm::dot(axis, v[1]), c = glm::dot(axis, v[2]);
    const double r = half * (std::fabs(axis.x) + std::fabs(axis.y) + std::fabs(axis.z));
    const double slack = 1e-12 * (r + std::fabs(a) + std::fabs(b) + std::fabs(c));
    return std::min({a, b, c}) > r + slack || std::max({a, b, c}) < -r - slack;
  };
  if (separates(n)) return false;
  for (const glm::dvec3& edge : e)
    if (separates({0, -edge.z, edge.y}) || separates({edge.z, 0, -edge.x}) || separates({-edge.y, edge.x, 0}))
      return false;
  return true;
}

// A subtree, its numbers counting from its own beginning.
struct Subtree {
  std::vector<LspBitWord> grid;
  std::vector<LspCell> cells;
  std::vector<uint32_t> references;
  uint32_t nodes = 0;
  uint32_t levels = 0;
  uint32_t max_leaf = 0;
};

class Builder {
 public:
  Builder(std::span<const LspTriangle> triangles, const NTreeOptions& options,
          const std::function<void(double)>& progress)
      : triangles_(triangles), options_(options), progress_(progress) {
    Box bounds;
    for (const LspTriangle& t : triangles)
      for (const lsp_float3& v : {t.v0, t.v1, t.v2}) bounds.grow({v.x, v.y, v.z});
    const glm::vec3 extent = bounds.extent();
    const glm::vec3 reach = glm::max(glm::abs(bounds.lo), glm::abs(bounds.hi));
    const float edge = std::max({extent.x, extent.y, extent.z});
    const float farthest = std::max({reach.x, reach.y, reach.z});
    // What a traversal's rounding may shift a ray by, for origins up to four edges away (lsp/ntree.h); the
    // cube holds the scene with as much to spare.
    tree_.margin = edge * 0x1p-18f + farthest * 0x1p-20f + 0x1p-126f;
    // Cells under two margins would hold each other's triangles: the cube grows, and cells are cut no
    // further.
    tree_.size = std::max(edge + 4 * tree_.margin, kLeastCell * tree_.margin * float(options.branching)) *
                 (1 + 0x1p-20f);
    const glm::vec3 lo = bounds.lo + 0.5f * (extent - tree_.size);
    tree_.lo = {lo.x, lo.y, lo.z};
    tree_.branching = options.branching;
    if (!std::isfinite(tree_.size) || !std::isfinite(lo.x + lo.y + lo.z))
      throw Failure(Exit::kLimit, "", "the scene is too large for a cube around it, use --base bvh");
  }

  NTree build() {
    std::vector<uint32_t> all(triangles_.size());
    for (size_t i = 0; i < all.size(); ++i) all[i] = uint32_t(i);
    Subtree root = build_node(all, Cell3(0), 1);
    tree_.grid = std::move(root.grid);
    tree_.cells = std::move(root.cells);
    tree_.references = std::move(root.references);
    tree_.node_count = root.nodes;
    tree_.levels = root.levels;
    tree_.max_leaf_triangles = root.max_leaf;
    return std::move(tree_);
  }

 private:
  // The cells of one node that a triangle reaches into, as indices. `origin` is the node's first cell.
  template <typename F>
  void for_each_cell(uint32_t triangle, const Cell3& origin, double cell, F&& f) const {
    const LspTriangle& t = triangles_[triangle];
    const glm::dvec3 v[3] = {dvec(t.v0), dvec(t.v1), dvec(t.v2)};
    const glm::dvec3 lo = glm::min(glm::min(v[0], v[1]), v[2]) - double(tree_.margin);
    const glm::dvec3 hi = glm::max(glm::max(v[0], v[1]), v[2]) + double(tree_.margin);
    const glm::dvec3 corner = dvec(tree_.lo) + glm::dvec3(origin) * cell;
    const int n = int(options_.branching);
    const auto clamp = [n](double x) { return int(std::clamp(std::floor(x), 0.0, double(n - 1))); };
    int first[3], last[3];
    for (int a = 0; a < 3; ++a) {
      if ((hi[a] - corner[a]) / cell < 0 || (lo[a] - corner[a]) / cell > n) return;
      first[a] = clamp((lo[a] - corner[a]) / cell);
      last[a] = clamp((hi[a] - corner[a]) / cell);
    }
    const double half = 0.5 * cell + double(tree_.margin);
    const bool one = first[0] == last[0] && first[1] == last[1] && first[2] == last[2];
    for (int z = first[2]; z <= last[2]; ++z)
      for (int y = first[1]; y <= last[1]; ++y)
        for (int x = first[0]; x <= last[0]; ++x) {
          const glm::dvec3 centre = corner + (glm::dvec3(x, y, z) + 0.5) * cell;
          const glm::dvec3 local[3] = {v[0] - centre, v[1] - centre, v[2] - centre};
          if (one || reaches(local, half)) f(uint32_t(LSP_CELL_INDEX(x, y, z, n)));
        }
  }

  // The node whose cells are at `level` (the root's: 1) and start at `origin`, counted in cells of that
  // level.
  Subtree build_node(const std::vector<uint32_t>& triangles, const Cell3& origin, uint32_t level) {
    const uint32_t n = options_.branching, cell_count = n * n * n;
    double cell = tree_.size;
    for (uint32_t l = 0; l < level; ++l) cell /= n;

    std::vector<uint32_t> begin(cell_count + 1);
    for (uint32_t t : triangles) for_each_cell(t, origin, cell, [&](uint32_t c) { ++begin[c + 1]; });
    for (uint32_t c = 0; c < cell_count; ++c) begin[c + 1] += begin[c];
    std::vector<uint32_t> inside(begin[cell_count]), next(begin.begin(), begin.end() - 1);
    for (uint32_t t : triangles) for_each_cell(t, origin, cell, [&](uint32_t c) { inside[next[c]++] = t; });

    std::vector<uint32_t> filled;
    for (uint32_t c = 0; c < cell_count; ++c)
      if (begin[c + 1] > begin[c]) filled.push_back(c);
    const auto count_of = [&](uint32_t c) { return begin[c + 1] - begin[c]; };
    const bool can_cut = level < options_.levels && cell / n >= double(kLeastCell * tree_.margin);
    const auto is_cut = [&](uint32_t c) { return can_cut && count_of(c) > options_.leaf_triangles; };

    std::vector<Subtree> below(filled.size());
    std::atomic<size_t> done{0};
    tbb::parallel_for(size_t(0), filled.size(), [&](size_t i) {
      const uint32_t c = filled[i];
      if (is_cut(c)) {
        const std::vector<uint32_t> part(inside.begin() + begin[c], inside.begin() + begin[c + 1]);
        const Cell3 at(c % n, c / n % n, c / (n * n));
        below[i] = build_node(part, (origin + at) * int(n), level + 1);
      }
      if (level == 1 && progress_) progress_(double(++done) / double(filled.size()));
    });

    Subtree node;
    node.nodes = 1;
    node.levels = level;
    node.grid.resize(LSP_GRID_WORDS(n));
    node.cells.resize(filled.size());
    for (size_t i = 0; i < filled.size(); ++i) {
      const uint32_t c = filled[i];
      node.grid[c / 32].bits |= 1u << c % 32;
      LspCell& record = node.cells[i];
      record.line_space = LSP_NONE;
      if (is_cut(c)) continue;
      record.child = LSP_LEAF_BIT | uint32_t(node.references.size());
      record.count = count_of(c);
      node.references.insert(node.references.end(), inside.begin() + begin[c], inside.begin() + begin[c + 1]);
      node.max_leaf = std::max(node.max_leaf, record.count);
    }
    uint32_t offset = 0;
    for (LspBitWord& w : node.grid) {
      w.offset = offset;
      offset += uint32_t(std::popcount(w.bits));
    }
    for (size_t i = 0; i < filled.size(); ++i) {
      if (!is_cut(filled[i])) continue;
      node.cells[i].child = node.nodes;
      node.cells[i].count = 0;
      append(node, below[i]);
      below[i] = {};
    }
    check_size(node);
    return node;
  }

  static void append(Subtree& node, const Subtree& child) {
    const uint32_t cells = uint32_t(node.cells.size()), references = uint32_t(node.references.size());
    for (LspBitWord w : child.grid) node.grid.push_back({w.bits, w.offset + cells});
    for (LspCell c : child.cells) {
      c.child += (c.child & LSP_LEAF_BIT) ? references : node.nodes;
      node.cells.push_back(c);
    }
    node.references.insert(node.references.end(), child.references.begin(), child.references.end());
    node.nodes += child.nodes;
    node.levels = std::max(node.levels, child.levels);
    node.max_leaf = std::max(node.max_leaf, child.max_leaf);
  }

  void check_size(const Subtree& node) const {
    const uint64_t bytes = node.grid.size() * sizeof(LspBitWord) + node.cells.size() * sizeof(LspCell) +
                           node.references.size() * sizeof(uint32_t);
    const uint64_t steps =
        3ull * options_.branching * node.nodes + node.cells.size() + node.references.size();
    if (steps >= LSP_LEAF_BIT || (options_.max_bytes && bytes > options_.max_bytes))
      throw Failure(Exit::kLimit, "",
                    "the NTree grows to over " + std::to_string(bytes >> 20) +
                        " MiB, lower --branching or --levels, or raise --memory-limit");
  }

  std::span<const LspTriangle> triangles_;
  const NTreeOptions& options_;
  const std::function<void(double)>& progress_;
  NTree tree_;
};

}  // namespace

NTree build_ntree(std::span<const LspTriangle> triangles, const NTreeOptions& options,
                  const std::function<void(double)>& progress) {
  if (triangles.empty()) return {};
  return Builder(triangles, options, progress).build();
}

}  // namespace lsp
