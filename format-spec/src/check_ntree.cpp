// The tree of an NTree: bits and offsets of its grids, the order of its cells, nodes, references and Line
// Spaces, and the declared bounds.
//
// Two passes. The first goes through GRID and CELL side by side and follows every number that has to grow
// with them. The second goes through the cells that are nodes, from the last node to the first: since nodes
// are in depth-first order, the subtrees of a node's children then lie on top of a stack, the first one
// uppermost.
#include <algorithm>
#include <cstddef>

#include "layers.h"

namespace lsp::format {
namespace {

inline uint32_t bit_count(uint32_t bits) {
  bits -= bits >> 1 & 0x55555555u;
  bits = (bits & 0x33333333u) + (bits >> 2 & 0x33333333u);
  bits = (bits + (bits >> 4)) & 0x0F0F0F0Fu;
  return bits * 0x01010101u >> 24;
}

// Whether every reference is below the number of triangles, and how often one is not above that before it.
struct Scan {
  bool in_range = true;
  uint64_t falls = 0;
};

// Marks in `named`, whose size is the number of triangles, what the references name. Block by block, so that
// the three passes, of which the compiler makes vector code but for the last, read memory once.
Scan scan(std::span<const uint32_t> references, std::vector<uint8_t>& named) {
  constexpr size_t kBlock = 4096;
  const uint32_t limit = static_cast<uint32_t>(named.size());
  Scan result;
  for (size_t first = 0; first < references.size(); first += kBlock) {
    const std::span<const uint32_t> block =
        references.subspan(first, std::min(kBlock, references.size() - first));
    uint32_t wrong = 0, falls = 0;
    for (uint32_t reference : block) wrong |= reference >= limit ? 1u : 0u;
    for (size_t i = 1; i < block.size(); ++i) falls += block[i] <= block[i - 1] ? 1u : 0u;
    result.falls += falls + (first != 0 && block[0] <= references[first - 1] ? 1u : 0u);
    if (wrong == 0) {
      for (uint32_t reference : block) named[reference] = 1;
    } else {
      result.in_range = false;
      for (uint32_t reference : block)
        if (reference < limit) named[reference] = 1;
    }
  }
  return result;
}

class NtreeCheck {
 public:
  NtreeCheck(const FileView& view, Report& report)
      : view_(view),
        report_(report),
        header_(view.header),
        words_(LSP_GRID_WORDS(view.header.ntree_branching)),
        grid_(view.elements<LspBitWord>(Kind::kGrid)),
        cells_(view.elements<LspCell>(Kind::kCell)),
        references_(view.elements<uint32_t>(Kind::kRefs)),
        line_spaces_(view.elements<LspLineSpace>(Kind::kLspc)),
        exact_((header_.required_features & LSP_FEATURE_EXACT) != 0) {}

  void run() {
    const uint64_t nodes = grid_.size() / words_;
    has_parent_.assign(nodes, false);
    carries_.assign(nodes, false);
    line_space_seen_.assign(line_spaces_.size(), false);
    if (header_.root_line_space != LSP_NONE) line_space(kRoot, header_.root, header_.root_line_space);
    for (uint64_t i = 0; i < nodes; ++i) node(i);
    // Cells of no node: their references and Line Spaces count all the same.
    for (uint64_t i = std::min<uint64_t>(next_cell_, cells_.size()); i < cells_.size(); ++i)
      cell(i, nodes == 0 ? 0 : nodes - 1);
    if (next_cell_ != header_.cell_count)
      find_header(RuleId::kCellCountWrong, offsetof(LspHeader, cell_count), "cell_count",
                  "is " + std::to_string(header_.cell_count) + ", but " + std::to_string(next_cell_) +
                      " bits are set in GRID");
    check_references();
    check_order(nodes);
    check_unused();
  }

 private:
  static constexpr uint64_t kRoot = ~uint64_t{0};

  struct Field {
    const char* name;
    uint64_t offset;
  };
  static constexpr Field kChild{"child", offsetof(LspCell, child)};
  static constexpr Field kCount{"count", offsetof(LspCell, count)};
  static constexpr Field kLineSpace{"line_space", offsetof(LspCell, line_space)};

  [[gnu::cold]] void find(RuleId id, uint64_t cell, const Field& field, const std::string& message) {
    if (cell == kRoot) {
      find_header(id, offsetof(LspHeader, root_line_space), "root_line_space", message);
      return;
    }
    report_.add(id, view_.offset_of(Kind::kCell, cell * sizeof(LspCell) + field.offset),
                view_.length_of(Kind::kCell, 4), element_path(Kind::kCell, cell, field.name), message);
  }
  [[gnu::cold]] void find_header(RuleId id, uint64_t offset, const char* field, const std::string& message) {
    report_.add(id, offset, 4, std::string("/header/") + field, message);
  }
  [[gnu::cold]] void find_word(RuleId id, uint64_t word, uint64_t bytes, const char* field, uint64_t offset,
                               const std::string& message) {
    report_.add(id, view_.offset_of(Kind::kGrid, word * sizeof(LspBitWord) + offset),
                view_.length_of(Kind::kGrid, bytes), element_path(Kind::kGrid, word, field), message);
  }

  // The words of one node, and its cells.
  void node(uint64_t i) {
    const uint64_t begin = next_cell_;
    for (uint64_t w = i * words_; w < (i + 1) * words_; ++w) {
      if (grid_[w].offset != next_cell_) [[unlikely]]
        find_word(RuleId::kGridOffset, w, 4, "offset", offsetof(LspBitWord, offset),
                  "is " + std::to_string(grid_[w].offset) + ", but " + std::to_string(next_cell_) +
                      " bits are set before");
      next_cell_ += bit_count(grid_[w].bits);
    }
    const uint32_t n = header_.ntree_branching;
    if (const uint32_t tail = n * n * n % 32; tail != 0 && grid_[(i + 1) * words_ - 1].bits >> tail != 0)
        [[unlikely]]
      find_word(RuleId::kGridTail, (i + 1) * words_ - 1, 4, "bits", 0,
                "bits from " + std::to_string(tail) + " on stand for no cell, but some are set");
    if (begin == next_cell_) [[unlikely]]
      find_word(RuleId::kNodeEmpty, i * words_, words_ * sizeof(LspBitWord), nullptr, 0,
                "node " + std::to_string(i) + " has no filled cell");
    const uint64_t end = std::min<uint64_t>(next_cell_, cells_.size());
    for (uint64_t c = begin; c < end; ++c) {
      c = plain_leaves(c, end);
      if (c < end) cell(c, i);
    }
  }

  // Passes over leaves whose references follow those before them and which carry no Line Space, the common
  // case, with everything in registers. Returns the first cell that is none.
  uint64_t plain_leaves(uint64_t c, uint64_t end) {
    const uint32_t most = header_.max_leaf_triangles;
    const uint64_t limit = std::min<uint64_t>(references_.size(), LSP_LEAF_BIT - 1);
    const uint32_t* references = references_.data();
    uint64_t next = next_reference_, falls = 0;
    for (; c < end; ++c) {
      const LspCell& cell = cells_[c];
      if (cell.child != (LSP_LEAF_BIT | static_cast<uint32_t>(next)) || cell.line_space != LSP_NONE ||
          cell.count - 1 >= most || next + cell.count > limit)
        break;
      falls += next != 0 && references[next] <= references[next - 1] ? 1u : 0u;
      next += cell.count;
    }
    next_reference_ = next;
    falls_between_ += falls;
    return c;
  }

  // Any cell, in full.
  [[gnu::noinline]] void cell(uint64_t c, uint64_t node) {
    const LspCell& cell = cells_[c];
    if ((cell.child & LSP_LEAF_BIT) && cell.child != LSP_NONE)
      leaf(c, cell);
    else
      other(c, cell, node);
    if (cell.line_space == LSP_NONE) return;
    if (node < carries_.size()) carries_[node] = true;
    if (cell.child & LSP_LEAF_BIT) check_terminal(c, cell.line_space, false);
    line_space(c, cell.child, cell.line_space);
  }

  void leaf(uint64_t c, const LspCell& cell) {
    const uint32_t first = cell.child & ~LSP_LEAF_BIT;
    if (first != next_reference_) [[unlikely]]
      find(RuleId::kReferencesNotCumulative, c, kChild,
           "its references begin at " + std::to_string(first) + ", those before it end at " +
               std::to_string(next_reference_));
    next_reference_ = uint64_t{first} + cell.count;
    if (cell.count - 1 >= header_.max_leaf_triangles || next_reference_ > header_.reference_count)
        [[unlikely]]
      unusual_leaf(c, cell);
    if (first != 0 && cell.count != 0 && first < references_.size() &&
        references_[first] <= references_[first - 1])
      ++falls_between_;
  }

  [[gnu::cold]] void unusual_leaf(uint64_t c, const LspCell& cell) {
    if (cell.count == 0 && cell.line_space == LSP_NONE)
      find(RuleId::kCellEmpty, c, kCount, "a leaf without references");
    if (cell.count > header_.max_leaf_triangles)
      find(RuleId::kLeafTooLarge, c, kCount,
           std::to_string(cell.count) + " references, max_leaf_triangles is " +
               std::to_string(header_.max_leaf_triangles));
    const uint32_t first = cell.child & ~LSP_LEAF_BIT;
    if (in_range(first, cell.count, header_.reference_count)) return;
    find(RuleId::kLeafOutOfRange, c, kChild,
         "references " + std::to_string(first) + " to " + std::to_string(next_reference_ - 1) + " of " +
             std::to_string(header_.reference_count));
    next_reference_ = std::min<uint64_t>(next_reference_, header_.reference_count);
  }

  void other(uint64_t c, const LspCell& cell, uint64_t node) {
    if (cell.count != 0)
      find(RuleId::kCellReferences, c, kCount,
           "is " + std::to_string(cell.count) + ", but the cell is no leaf");
    if (cell.child != LSP_NONE) {
      inner_.push_back({c, static_cast<uint32_t>(node)});
    } else if (cell.line_space == LSP_NONE) {
      find(RuleId::kCellEmpty, c, kChild, "nothing is in the cell");
    } else if (exact_) {
      find(RuleId::kChildMissing, c, kChild, "nothing is below the Line Space, but the file is exact");
    }
  }

  void check_terminal(uint64_t c, uint32_t reference, bool below) {
    const bool terminal = (reference & LSP_TERMINAL_BIT) != 0;
    if (terminal == below)
      find(RuleId::kTerminalBit, c, kLineSpace,
           terminal ? "TERMINAL is set, but there are Line Spaces below"
                    : "TERMINAL is clear, but no Line Space is below");
  }

  void line_space(uint64_t c, uint32_t child, uint32_t reference) {
    const uint32_t index = reference & LSP_LINE_SPACE_MASK;
    if (index >= header_.line_space_count) {
      if (c != kRoot)  // the header's layer has checked the root
        find(RuleId::kLineSpaceOutOfRange, c, kLineSpace,
             "names Line Space " + std::to_string(index) + " of " + std::to_string(header_.line_space_count));
      return;
    }
    if (index >= line_space_seen_.size()) return;
    if (line_space_seen_[index])
      find(RuleId::kLineSpaceUsedTwice, c, kLineSpace,
           "names Line Space " + std::to_string(index) + ", which another cell carries");
    else if (index != next_line_space_)
      find(RuleId::kLineSpaceOrder, c, kLineSpace,
           "Line Space " + std::to_string(index) +
               " does not follow the one before it, in the order of cells");
    line_space_seen_[index] = true;
    next_line_space_ = index + 1;
    const LspLineSpace& space = line_spaces_[index];
    if (space.child != child)
      find_line_space(RuleId::kLineSpaceChild, index, "child", offsetof(LspLineSpace, child),
                      "is not the child reference beside the reference to this Line Space");
    if (!in_range(space.triangle_first, space.triangle_count, header_.triangle_count))
      find_line_space(
          RuleId::kLineSpaceTriangles, index, "triangle_first", offsetof(LspLineSpace, triangle_first),
          std::to_string(space.triangle_count) + " triangles from " + std::to_string(space.triangle_first) +
              " on, TRIA has " + std::to_string(header_.triangle_count));
  }

  void find_line_space(RuleId id, uint64_t i, const char* field, uint64_t offset,
                       const std::string& message) {
    report_.add(id, view_.offset_of(Kind::kLspc, i * sizeof(LspLineSpace) + offset),
                view_.length_of(Kind::kLspc, 4), element_path(Kind::kLspc, i, field), message);
  }

  // REFS as a whole: in range, growing inside every leaf, each triangle named somewhere.
  void check_references() {
    if (next_reference_ < header_.reference_count)
      report_.add(
          RuleId::kReferencesUnused, view_.offset_of(Kind::kRefs, next_reference_ * 4),
          view_.length_of(Kind::kRefs, (header_.reference_count - next_reference_) * 4),
          element_path(Kind::kRefs, next_reference_),
          std::to_string(header_.reference_count - next_reference_) + " references belong to no leaf");
    // A damaged header may count more triangles than there are, and more than memory has room for.
    std::vector<uint8_t> named(view_.part(Kind::kTria).usable ? header_.triangle_count : 0, 0);
    const Scan whole = scan(references_, named);
    if (!whole.in_range)
      for (uint64_t i = 0; i < references_.size(); ++i)
        if (references_[i] >= named.size())
          find_reference(
              RuleId::kReferenceOutOfRange, i,
              "is " + std::to_string(references_[i]) + ", triangle_count is " + std::to_string(named.size()));
    // Every fall lies between two leaves, where leaves are as they should be: else look for the others.
    if (whole.falls != falls_between_ && !report_.has(RuleId::kReferencesNotCumulative)) find_falls();
    check_triangles(named);
  }

  [[gnu::cold]] void find_falls() {
    for (const LspCell& cell : cells_) {
      if (!(cell.child & LSP_LEAF_BIT) || cell.child == LSP_NONE) continue;
      const uint64_t first = cell.child & ~LSP_LEAF_BIT;
      if (!in_range(first, cell.count, references_.size())) continue;
      for (uint64_t i = first + 1; i < first + cell.count; ++i)
        if (references_[i] <= references_[i - 1])
          find_reference(
              RuleId::kReferenceOrder, i,
              "is " + std::to_string(references_[i]) + " after " + std::to_string(references_[i - 1]));
    }
  }

  [[gnu::cold]] void find_reference(RuleId id, uint64_t i, const std::string& message) {
    report_.add(id, view_.offset_of(Kind::kRefs, i * 4), view_.length_of(Kind::kRefs, 4),
                element_path(Kind::kRefs, i), message);
  }

  // Triangles of no leaf: in an exact file there are none; else candidates stay for their Line Spaces.
  void check_triangles(std::vector<uint8_t>& named) {
    if (!exact_) add_candidates(named);
    const auto unused = std::find(named.begin(), named.end(), uint8_t{0});
    if (unused == named.end()) return;
    const uint64_t first = static_cast<uint64_t>(unused - named.begin());
    report_.add(RuleId::kTrianglesUnused, view_.offset_of(Kind::kTria, first * sizeof(LspTriangle)),
                view_.length_of(Kind::kTria, sizeof(LspTriangle)), element_path(Kind::kTria, first),
                std::to_string(std::count(unused, named.end(), uint8_t{0})) + " triangles are in no leaf" +
                    (exact_ ? "" : " and of no Line Space"));
  }

  // Where ranges begin and end, so that overlapping ones cost no more than others.
  void add_candidates(std::vector<uint8_t>& named) const {
    std::vector<int64_t> change(named.size() + 1, 0);
    for (const LspLineSpace& space : line_spaces_) {
      if (!in_range(space.triangle_first, space.triangle_count, named.size())) continue;
      ++change[space.triangle_first];
      --change[uint64_t{space.triangle_first} + space.triangle_count];
    }
    int64_t open = 0;
    for (size_t i = 0; i < named.size(); ++i) {
      open += change[i];
      if (open > 0) named[i] = 1;
    }
  }

  struct Inner {
    uint64_t cell;
    uint32_t node;  // that the cell belongs to
  };
  struct Subtree {
    uint32_t node = 0;
    uint32_t height = 1;  // nodes on its longest path
    bool carries = false;
  };

  void check_order(uint64_t nodes) {
    size_t last = inner_.size();
    while (last > 0 && inner_[last - 1].node >= nodes) --last;
    for (uint64_t i = nodes; i-- > 0;) {
      Subtree subtree;
      subtree.node = static_cast<uint32_t>(i);
      subtree.carries = carries_[i];
      size_t first = last;
      while (first > 0 && inner_[first - 1].node == i) --first;
      for (size_t k = first; k < last; ++k) {
        const uint64_t c = inner_[k].cell;
        Subtree below;
        if (link(c, i)) {
          below = take(c);
          subtree.height = std::max(subtree.height, below.height + 1);
        }
        if (cells_[c].line_space != LSP_NONE) check_terminal(c, cells_[c].line_space, below.carries);
        subtree.carries = subtree.carries || below.carries;
      }
      last = first;
      stack_.push_back(subtree);
    }
    const Subtree root = stack_.empty() ? Subtree{0, 0, false} : stack_.back();
    if (header_.root_line_space != LSP_NONE) check_terminal(kRoot, header_.root_line_space, root.carries);
    check_bounds(root.height);
  }

  // A cell's reference to a node; false where it is unsound.
  bool link(uint64_t c, uint64_t node) {
    const uint32_t child = cells_[c].child;
    const auto unsound = [&](RuleId id, const std::string& what) {
      find(id, c, kChild, "names node " + std::to_string(child) + what);
      return false;
    };
    if (child >= has_parent_.size())
      return unsound(RuleId::kChildOutOfRange, " of " + std::to_string(has_parent_.size()));
    if (child <= node) return unsound(RuleId::kChildNotAfterParent, ", which is not after its parent");
    if (has_parent_[child]) return unsound(RuleId::kTwoParents, ", which is the child of another cell too");
    has_parent_[child] = true;
    return true;
  }

  // Takes the subtree of a sound reference off the stack. Where nodes are out of order, looks for the child
  // among the last few subtrees and drops those above it, so that one mistake does not make every node
  // another.
  Subtree take(uint64_t c) {
    constexpr size_t kReach = 64;
    const uint32_t child = cells_[c].child;
    size_t at = stack_.size();
    while (at > 0 && stack_.size() - at < kReach && stack_[at - 1].node != child) --at;
    const bool found = at > 0 && stack_[at - 1].node == child;
    if (at != stack_.size() || !found)
      find(RuleId::kNotDepthFirst, c, kChild,
           "names node " + std::to_string(child) + ", which does not follow what is before it depth first");
    if (!found) return {};
    const Subtree subtree = stack_[at - 1];
    stack_.resize(at - 1);
    return subtree;
  }

  void check_bounds(uint32_t height) {
    const auto bound = [&](RuleId id, uint64_t offset, const char* field, uint32_t value, uint64_t needed,
                           const char* what) {
      if (value < needed)
        find_header(id, offset, field,
                    "is " + std::to_string(value) + ", but " + what + " " + std::to_string(needed));
    };
    bound(RuleId::kNtreeTooDeep, offsetof(LspHeader, ntree_depth), "ntree_depth", header_.ntree_depth, height,
          "the nodes on the longest path are");
    bound(RuleId::kDepthExceeded, offsetof(LspHeader, max_depth), "max_depth", header_.max_depth, height,
          "the deepest cell is at level");
    bound(RuleId::kStackExceeded, offsetof(LspHeader, max_stack), "max_stack", header_.max_stack, height,
          "a traversal may need");
    bound(RuleId::kStepsExceeded, offsetof(LspHeader, max_steps), "max_steps", header_.max_steps,
          lsp_ntree_steps(&header_), "a traversal may take");
  }

  void check_unused() {
    for (uint64_t i = 1; i < has_parent_.size(); ++i)
      if (!has_parent_[i]) [[unlikely]]
        find_word(RuleId::kUnreachable, i * words_, words_ * sizeof(LspBitWord), nullptr, 0,
                  "no cell of a node before it refers to node " + std::to_string(i));
    for (uint64_t i = 0; i < line_space_seen_.size(); ++i)
      if (!line_space_seen_[i])
        report_.add(RuleId::kLineSpaceUnused, view_.offset_of(Kind::kLspc, i * sizeof(LspLineSpace)),
                    view_.length_of(Kind::kLspc, sizeof(LspLineSpace)), [&] {
                      return std::pair{element_path(Kind::kLspc, i), std::string("no cell carries it")};
                    });
  }

  const FileView& view_;
  Report& report_;
  const LspHeader& header_;
  uint32_t words_;  // of GRID, a node
  std::span<const LspBitWord> grid_;
  std::span<const LspCell> cells_;
  std::span<const uint32_t> references_;
  std::span<const LspLineSpace> line_spaces_;
  bool exact_;
  uint64_t next_cell_ = 0;       // cells of the words seen
  uint64_t next_reference_ = 0;  // where the leaves seen end
  uint64_t next_line_space_ = 0;
  uint64_t falls_between_ = 0;  // leaves whose first reference is not above the one before it
  std::vector<Inner> inner_;
  std::vector<bool> has_parent_;
  std::vector<bool> carries_;  // nodes with a Line Space in a cell of their own
  std::vector<bool> line_space_seen_;
  std::vector<Subtree> stack_;
};

}  // namespace

void check_ntree(const FileView& view, Report& report) { NtreeCheck(view, report).run(); }

}  // namespace lsp::format
