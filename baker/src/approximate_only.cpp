// --no-exact: what an approximate trace never reads is left out.
#include <algorithm>
#include <bit>

#include "bake.h"

namespace lsp {
namespace {

// Replaces the candidate entries of a Line Space, local triangle numbers, by f of them.
template <typename F>
void for_each_entry(Baked& baked, const LspLineSpace& r, F&& f) {
  const uint32_t bytes = entry_bytes(r);
  if (bytes == 0) return;
  const uint32_t n = r.format & LSP_FORMAT_RESOLUTION_MASK;
  const bool dense = r.format & LSP_FORMAT_DENSE;
  const uint32_t entries = dense ? 30 * n * n * n * n : r.filled;
  const uint32_t mask = bytes == 4 ? LSP_NONE : (1u << bytes * 8) - 1;
  for (uint32_t e = 0; e < entries; ++e) {
    uint32_t& word = baked.line_spaces.candidates[r.candidate_first + e * bytes / 4];
    const uint32_t shift = e * bytes % 4 * 8;
    const uint32_t value = word >> shift & mask;
    if (dense && value == mask) continue;
    word = (word & ~(mask << shift)) | f(value) << shift;
  }
}

// The triangles that some shaft refers to.
std::vector<bool> referred_triangles(Baked& baked) {
  std::vector<bool> referred(baked.triangles.size(), false);
  for (const LspLineSpace& r : baked.line_spaces.records) {
    if (entry_bytes(r) == 0) referred[r.triangle_first] = true;
    for_each_entry(baked, r, [&](uint32_t local) {
      referred[r.triangle_first + local] = true;
      return local;
    });
  }
  return referred;
}

// Keeps of a BVH the nodes above the terminal Line Spaces and the triangles that some shaft refers to. Leaves
// above keep theirs.
class BvhReduction {
 public:
  explicit BvhReduction(Baked& baked)
      : baked_(baked), referred_(referred_triangles(baked)), place_(baked.triangles.size(), LSP_NONE) {}

  void run() {
    baked_.header.root = copy(baked_.header.root, baked_.header.root_line_space, 0);
    LspHeader& h = baked_.header;
    h.max_steps = uint32_t(nodes_.size()) + ends_ + 1;
    h.max_depth = depth_;
    h.max_stack = std::max(1u, depth_);
    h.max_leaf_triangles = max_leaf_;
    baked_.nodes = std::move(nodes_);
    baked_.triangles = std::move(triangles_);
    baked_.normals = std::move(normals_);
  }

 private:
  uint32_t keep(uint32_t first, uint32_t count) {
    const uint32_t start = uint32_t(triangles_.size());
    for (uint32_t i = first; i < first + count; ++i) {
      place_[i] = uint32_t(triangles_.size());
      triangles_.push_back(baked_.triangles[i]);
      if (!baked_.normals.empty()) normals_.push_back(baked_.normals[i]);
    }
    return start;
  }

  // Keeps the referred triangles of a terminal site; the subtree itself goes.
  void keep_site(uint32_t index) {
    const LspLineSpace& r = baked_.line_spaces.records[index];
    const uint32_t start = uint32_t(triangles_.size());
    for (uint32_t i = r.triangle_first; i < r.triangle_first + r.triangle_count; ++i)
      if (referred_[i]) keep(i, 1);
    renumber(index, start, LSP_NONE);
  }

  // A Line Space whose node now is `child` and whose triangles lie from `start` to the last one kept.
  void renumber(uint32_t index, uint32_t start, uint32_t child) {
    LspLineSpace& r = baked_.line_spaces.records[index];
    for_each_entry(baked_, r, [&](uint32_t local) { return place_[r.triangle_first + local] - start; });
    r.triangle_first = start;
    r.triangle_count = uint32_t(triangles_.size()) - start;
    r.child = child;
  }

  uint32_t copy(uint32_t child, uint32_t line_space, uint32_t depth) {
    if (child == LSP_NONE) return child;
    depth_ = std::max(depth_, depth);
    if (line_space != LSP_NONE && (line_space & LSP_TERMINAL_BIT)) {
      keep_site(line_space & LSP_LINE_SPACE_MASK);
      ++ends_;
      return LSP_NONE;
    }
    if (child & LSP_LEAF_BIT) {
      const uint32_t count = (child >> LSP_LEAF_COUNT_SHIFT & LSP_LEAF_COUNT_MASK) + 1;
      ++ends_;
      max_leaf_ = std::max(max_leaf_, count);
      return (child & ~LSP_LEAF_FIRST_MASK) | keep(child & LSP_LEAF_FIRST_MASK, count);
    }
    const uint32_t index = uint32_t(nodes_.size()), start = uint32_t(triangles_.size());
    const LspNode old = baked_.nodes[child];
    nodes_.push_back(old);
    const uint32_t child0 = copy(old.child0, old.line_space0, depth + 1);
    nodes_[index].child0 = child0;
    const uint32_t child1 = copy(old.child1, old.line_space1, depth + 1);
    nodes_[index].child1 = child1;
    if (line_space != LSP_NONE) renumber(line_space, start, index);
    return index;
  }

  Baked& baked_;
  std::vector<bool> referred_;
  std::vector<uint32_t> place_;  // of a kept triangle among the kept ones
  uint32_t ends_ = 0;            // leaves and terminal Line Spaces
  uint32_t depth_ = 0;
  uint32_t max_leaf_ = 0;
  std::vector<LspNode> nodes_;
  std::vector<LspTriangle> triangles_;
  std::vector<LspCornerNormals> normals_;
};

// The same of an NTree.
class NTreeReduction {
 public:
  explicit NTreeReduction(Baked& baked) : baked_(baked), kept_(referred_triangles(baked)) {}

  void run() {
    NTree& tree = baked_.ntree;
    const LspHeader& h = baked_.header;
    if (h.root_line_space != LSP_NONE && (h.root_line_space & LSP_TERMINAL_BIT)) {
      baked_.header.root = LSP_NONE;
      baked_.line_spaces.records[h.root_line_space & LSP_LINE_SPACE_MASK].child = LSP_NONE;
    } else {
      copy(0, 1);
    }
    tree.grid = std::move(grid_);
    tree.cells = std::move(cells_);
    tree.references = std::move(references_);
    tree.node_count = nodes_;
    baked_.header.max_leaf_triangles = max_leaf_;
    baked_.header.max_depth = baked_.header.max_stack = baked_.header.ntree_depth = std::max(1u, levels_);
    keep_triangles();
  }

 private:
  void copy(uint32_t node, uint32_t level) {
    const NTree& tree = baked_.ntree;
    const uint32_t words = LSP_GRID_WORDS(tree.branching);
    const LspBitWord* grid = &tree.grid[size_t(node) * words];
    const uint32_t first = grid[0].offset, begin = uint32_t(cells_.size());
    uint32_t count = 0;
    ++nodes_;
    levels_ = std::max(levels_, level);
    for (uint32_t w = 0; w < words; ++w) {
      grid_.push_back({grid[w].bits, begin + count});
      count += uint32_t(std::popcount(grid[w].bits));
    }
    for (uint32_t i = 0; i < count; ++i) {
      LspCell cell = tree.cells[first + i];
      if (is_terminal(cell)) {
        cell.child = LSP_NONE;
        cell.count = 0;
        set_child(cell);
      } else if (cell.child & LSP_LEAF_BIT) {
        const uint32_t from = cell.child & ~LSP_LEAF_BIT;
        cell.child = LSP_LEAF_BIT | uint32_t(references_.size());
        max_leaf_ = std::max(max_leaf_, cell.count);
        for (uint32_t r = from; r < from + cell.count; ++r) {
          references_.push_back(tree.references[r]);
          kept_[tree.references[r]] = true;
        }
      }
      cells_.push_back(cell);
    }
    for (uint32_t i = 0; i < count; ++i) {
      LspCell& cell = cells_[begin + i];
      if (cell.child & LSP_LEAF_BIT) continue;  // LSP_NONE too
      const uint32_t old = cell.child;
      cell.child = nodes_;
      set_child(cell);
      copy(old, level + 1);
    }
  }

  static bool is_terminal(const LspCell& cell) {
    return cell.line_space != LSP_NONE && (cell.line_space & LSP_TERMINAL_BIT);
  }

  void set_child(const LspCell& cell) {
    if (cell.line_space != LSP_NONE)
      baked_.line_spaces.records[cell.line_space & LSP_LINE_SPACE_MASK].child = cell.child;
  }

  void keep_triangles() {
    std::vector<uint32_t> place(kept_.size(), LSP_NONE);
    uint32_t count = 0;
    for (size_t i = 0; i < kept_.size(); ++i) {
      if (!kept_[i]) continue;
      baked_.triangles[count] = baked_.triangles[i];
      if (!baked_.normals.empty()) baked_.normals[count] = baked_.normals[i];
      place[i] = count++;
    }
    baked_.triangles.resize(count);
    if (!baked_.normals.empty()) baked_.normals.resize(count);
    for (uint32_t& r : baked_.ntree.references) r = place[r];
    for (LspLineSpace& r : baked_.line_spaces.records) {
      // A Line Space's first and last triangle are candidates and stay.
      const uint32_t first = r.triangle_first, last = first + r.triangle_count - 1;
      const uint32_t end = place[entry_bytes(r) ? last : first];
      for_each_entry(baked_, r, [&](uint32_t local) { return place[first + local] - place[first]; });
      r.triangle_first = place[first];
      r.triangle_count = end - place[first] + 1;
    }
  }

  Baked& baked_;
  std::vector<bool> kept_;  // triangles
  std::vector<LspBitWord> grid_;
  std::vector<LspCell> cells_;
  std::vector<uint32_t> references_;
  uint32_t nodes_ = 0;
  uint32_t levels_ = 0;
  uint32_t max_leaf_ = 0;
};

}  // namespace

void keep_approximate_only(Baked& baked) {
  const bool ntree = baked.header.base_structure == LSP_BASE_NTREE;
  const size_t nodes = baked.header.node_count, triangles = baked.triangles.size();
  if (ntree)
    NTreeReduction(baked).run();
  else
    BvhReduction(baked).run();
  baked.header.required_features &= ~LSP_FEATURE_EXACT;
  set_counts(baked);
  baked.skipped.push_back("nodes below Line Spaces: " + with_commas(nodes - baked.header.node_count));
  baked.skipped.push_back("triangles no shaft refers to: " + with_commas(triangles - baked.triangles.size()));
}

void keep_tables_only(Baked& baked) {
  CellTables& tables = baked.cell_tables;
  std::vector<uint32_t> number(baked.triangles.size(), LSP_NONE);
  std::vector<LspTriangle> triangles;
  std::vector<LspCornerNormals> normals;
  for (uint32_t& record : tables.plane_records) {
    if (number[record] == LSP_NONE) {
      number[record] = uint32_t(triangles.size());
      triangles.push_back(baked.triangles[record]);
      if (!baked.normals.empty()) normals.push_back(baked.normals[record]);
    }
    record = number[record];
  }
  baked.skipped.push_back(
      "triangles that no plane is of: " + with_commas(baked.triangles.size() - triangles.size()) + " of " +
      with_commas(baked.triangles.size()));
  baked.triangles = std::move(triangles);
  baked.normals = std::move(normals);
  baked.wide = {};
  baked.qualities.fill(baked.qualities[LSP_QUALITY_FAST]);  // tables alone are left
  tables.nodes.clear();
  tables.references.clear();
  for (LspFilledCell& cell : tables.cells) {
    cell.root = LSP_CELL_NO_CHILD;
    cell.node_first = cell.reference_first = cell.max_steps = 0;
  }
  LspHeader& h = baked.header;
  h.required_features &= ~(LSP_FEATURE_EXACT | LSP_FEATURE_WIDE);
  h.root = LSP_NONE;
  h.max_depth = h.max_steps = h.max_leaf_triangles = 0;
  h.max_stack = 1;
  for (uint32_t& classes : h.quality) classes = LSP_HEEDS_TABLES;
  for (uint32_t& part : h.quality_part) part = 0;
  set_counts(baked);
}

void leave_out_tables(Baked& baked, const std::string& reason) {
  baked.cell_grid = {};
  baked.cell_tables = {};
  set_counts(baked);  // while the file is still one of cells: of another the counts of their sections stay
  LspHeader& h = baked.header;
  h.cells = {};
  for (uint32_t& classes : h.quality) classes = 0;
  for (uint32_t& part : h.quality_part) part = 0;
  baked.qualities = {};
  h.base_structure = LSP_BASE_WIDE;
  h.required_features = (h.required_features & ~LSP_FEATURE_CELLS) | LSP_FEATURE_WIDE | LSP_FEATURE_WIDE_BASE;
  std::erase_if(baked.skipped, [](const std::string& s) { return s.starts_with("empty cells: "); });
  baked.skipped.insert(baked.skipped.begin(), "tables: " + reason);
}

}  // namespace lsp
