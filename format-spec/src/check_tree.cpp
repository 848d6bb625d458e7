// The tree: references, order, boxes, declared bounds, and the Line Space references beside them.
//
// Nodes are in depth-first order, so one pass down the array, from the last node to the first, finds the
// subtrees of a node's children on top of a stack, child 0 above child 1. There is no recursion, a sound file
// needs a stack of its depth, and any other order shows as a child that is not on top.
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <limits>

#include "layers.h"

namespace lsp::format {
namespace {

// A run [first, end) of triangles or Line Spaces that a subtree holds.
struct Run {
  uint32_t first = 0;
  uint32_t end = 0;
  bool empty() const { return first == end; }
  // Appends `next`, which begins where this run ends. Returns false where it does not.
  bool append(Run next) {
    if (next.empty()) return true;
    const bool joins = empty() || next.first == end;
    first = empty() ? next.first : std::min(first, next.first);
    end = std::max(end, next.end);
    return joins;
  }
};

struct Subtree {
  uint32_t node = 0;    // its first
  uint32_t height = 0;  // edges to its deepest leaf
  Run triangles;
  Run line_spaces;
};

// A box as two vectors of four; the fourth numbers are of no meaning (a node has its references there).
struct Box {
  typedef float Vector __attribute__((vector_size(16)));
  Vector lo, hi;
};

Box load_box(const float* lo, const float* hi) {
  Box box;
  std::memcpy(&box.lo, lo, sizeof box.lo);
  std::memcpy(&box.hi, hi, sizeof box.hi);
  return box;
}

// One child of a node, or the root.
struct Slot {
  uint32_t child;
  uint32_t line_space;
  uint64_t node;  // that holds it
  int side;       // 0 or 1; -1: the header's root
  Box box;
  bool empty() const { return child == LSP_NONE && line_space == LSP_NONE; }
};

// Whether `inner` lies in `outer` and neither is inside out; false where a number is NaN. With a finite outer
// box, true says that the inner one is finite too.
inline bool nested(const Box& outer, const Box& inner) {
  const auto inside = (outer.lo <= inner.lo) & (inner.lo <= inner.hi) & (inner.hi <= outer.hi);
  return (inside[0] & inside[1] & inside[2]) != 0;
}

bool finite(const Box::Vector& v) {
  return std::isfinite(v[0]) && std::isfinite(v[1]) && std::isfinite(v[2]);
}

class TreeCheck {
 public:
  TreeCheck(const FileView& view, Report& report)
      : view_(view),
        report_(report),
        header_(view.header),
        nodes_(view.elements<LspNode>(Kind::kNode)),
        line_spaces_(view.elements<LspLineSpace>(Kind::kLspc)),
        exact_((header_.required_features & LSP_FEATURE_EXACT) != 0) {}

  void run() {
    has_parent_.assign(nodes_.size(), false);
    line_space_seen_.assign(line_spaces_.size(), false);
    for (uint64_t i = nodes_.size(); i-- > 0;) stack_.push_back(check_node(i));
    check_root();
    check_unused();
  }

 private:
  Slot slot(uint64_t i, int side) const {
    const LspNode& node = nodes_[i];
    return side == 0 ? Slot{node.child0, node.line_space0, i, 0, load_box(&node.lo0.x, &node.hi0.x)}
                     : Slot{node.child1, node.line_space1, i, 1, load_box(&node.lo1.x, &node.hi1.x)};
  }

  enum class Field { kChild, kLineSpace, kBox };
  [[gnu::cold]] void find(RuleId id, const Slot& at, Field field, const std::string& message) {
    static constexpr const char* kNames[2][3] = {{"child0", "line_space0", "lo0"},
                                                 {"child1", "line_space1", "lo1"}};
    static constexpr uint64_t kOffsets[3] = {offsetof(LspNode, child0), offsetof(LspNode, line_space0),
                                             offsetof(LspNode, lo0)};
    const int which = static_cast<int>(field);
    const uint64_t bytes = field == Field::kBox ? 28 : 4;  // lo, child, hi
    if (at.side < 0) {
      const bool line_space = field == Field::kLineSpace;
      report_.add(id, line_space ? offsetof(LspHeader, root_line_space) : offsetof(LspHeader, root), 4,
                  line_space ? "/header/root_line_space" : "/header/root", message);
      return;
    }
    const uint64_t first = at.node * sizeof(LspNode) + 32u * static_cast<uint64_t>(at.side) + kOffsets[which];
    report_.add(id, view_.offset_of(Kind::kNode, first), view_.length_of(Kind::kNode, bytes),
                element_path(Kind::kNode, at.node, kNames[at.side][which]), message);
  }
  [[gnu::cold]] void find_node(RuleId id, uint64_t i, const char* message) {
    report_.add(id, view_.offset_of(Kind::kNode, i * sizeof(LspNode)),
                view_.length_of(Kind::kNode, sizeof(LspNode)), [&] {
                  return std::pair{element_path(Kind::kNode, i), std::string(message)};
                });
  }

  Subtree check_node(uint64_t i) {
    Subtree subtree;
    subtree.node = static_cast<uint32_t>(i);
    const Slot first = slot(i, 0), second = slot(i, 1);
    if (first.empty() && second.empty()) [[unlikely]]
      find_node(RuleId::kNodeEmpty, i, "has nothing below it");
    check_slot(first, subtree);
    check_slot(second, subtree);
    return subtree;
  }

  // What runs for every slot is always inlined: a call and the copies it makes cost as much as the checks.

  // Checks a slot and adds it to the subtree of the node that holds it.
  [[gnu::always_inline]] inline void check_slot(const Slot& at, Subtree& above) {
    Subtree inside;
    if (at.child == LSP_NONE) {
      if (at.line_space != LSP_NONE) inside.triangles = left_out(at);
    } else if (at.child & LSP_LEAF_BIT) {
      inside.triangles = leaf(at);
    } else if (link(at)) {
      inside = take(at);
      check_nesting(at);
    }
    if (!at.empty()) above.height = std::max(above.height, inside.height + 1);
    if (at.line_space != LSP_NONE) check_line_space(at, inside, above);
    append_line_spaces(above, inside.line_spaces, at);
    if (!above.triangles.append(inside.triangles)) [[unlikely]]
      find(RuleId::kLeafOrder, at, Field::kChild,
           "its triangles begin at " + std::to_string(inside.triangles.first) +
               ", not where those before it end");
  }

  // A subtree that was left out: its triangles are those of its Line Space.
  Run left_out(const Slot& at) {
    ++ends_;
    if (exact_) [[unlikely]]
      find(RuleId::kChildMissing, at, Field::kChild,
           "nothing is below the Line Space, but the file is exact");
    return line_space_triangles(at.line_space & LSP_LINE_SPACE_MASK);
  }

  [[gnu::always_inline]] inline Run leaf(const Slot& at) {
    ++ends_;
    const uint32_t first = at.child & LSP_LEAF_FIRST_MASK;
    const uint32_t count = (at.child >> LSP_LEAF_COUNT_SHIFT & LSP_LEAF_COUNT_MASK) + 1;
    if (count > header_.max_leaf_triangles) [[unlikely]]
      find(RuleId::kLeafTooLarge, at, Field::kChild,
           std::to_string(count) + " triangles, max_leaf_triangles is " +
               std::to_string(header_.max_leaf_triangles));
    if (in_range(first, count, header_.triangle_count)) [[likely]]
      return {first, first + count};
    if (at.side >= 0)  // the header's layer has checked the root
      find(RuleId::kLeafOutOfRange, at, Field::kChild,
           "triangles " + std::to_string(first) + " to " + std::to_string(first + count - 1) + " of " +
               std::to_string(header_.triangle_count));
    return {};
  }

  // A reference to a node; false where it is unsound.
  [[gnu::always_inline]] inline bool link(const Slot& at) {
    if (at.side < 0) return !nodes_.empty() && at.child == 0;
    if (at.child >= nodes_.size()) [[unlikely]]
      return unsound(RuleId::kChildOutOfRange, at, " of " + std::to_string(nodes_.size()));
    if (at.child <= at.node) [[unlikely]]
      return unsound(RuleId::kChildNotAfterParent, at, ", which is not after its parent");
    if (has_parent_[at.child]) [[unlikely]]
      return unsound(RuleId::kTwoParents, at, ", which is the child of another node too");
    has_parent_[at.child] = true;
    return true;
  }

  // Takes the subtree of a sound reference off the stack.
  [[gnu::always_inline]] inline Subtree take(const Slot& at) {
    if (stack_.empty() || stack_.back().node != at.child) [[unlikely]]
      if (!find_below(at)) return {};
    const Subtree subtree = stack_.back();
    stack_.pop_back();
    return subtree;
  }

  // Nodes out of order: looks for the child among the last few subtrees and drops those above it, so that one
  // mistake does not make every node above it another. False when it is not there.
  [[gnu::cold]] bool find_below(const Slot& at) {
    constexpr size_t kReach = 64;
    if (at.side >= 0)
      find(
          RuleId::kNotDepthFirst, at, Field::kChild,
          "names node " + std::to_string(at.child) + ", which does not follow what is before it depth first");
    const auto last = std::find_if(stack_.rbegin(),
                                   stack_.rbegin() + static_cast<ptrdiff_t>(std::min(kReach, stack_.size())),
                                   [&](const Subtree& subtree) { return subtree.node == at.child; });
    if (last == stack_.rbegin() + static_cast<ptrdiff_t>(std::min(kReach, stack_.size()))) return false;
    stack_.erase(last.base(), stack_.end());
    return true;
  }
  [[gnu::cold]] bool unsound(RuleId id, const Slot& at, const std::string& what) {
    find(id, at, Field::kChild, "names node " + std::to_string(at.child) + what);
    return false;
  }

  // The boxes inside a child that is a node, against the child's own.
  [[gnu::always_inline]] inline void check_nesting(const Slot& at) {
    for (int side : {0, 1}) {
      const Slot inner = slot(at.child, side);
      if (!nested(at.box, inner.box) && !inner.empty()) [[unlikely]]
        explain_box(inner, at.box);
    }
  }

  [[gnu::cold]] void explain_box(const Slot& at, const Box& outer) {
    const Box& box = at.box;
    if (!finite(box.lo) || !finite(box.hi))
      find(RuleId::kBoxNotFinite, at, Field::kBox, "a corner of the box is not finite");
    else if (box.lo[0] > box.hi[0] || box.lo[1] > box.hi[1] || box.lo[2] > box.hi[2])
      find(RuleId::kBoxNotFinite, at, Field::kBox, "the box is inside out");
    else if (finite(outer.lo) && finite(outer.hi))  // else the outer box has a finding of its own
      find(RuleId::kBoxOutsideParent, at, Field::kBox, "the box reaches outside its parent's");
  }

  [[gnu::noinline]] void check_line_space(const Slot& at, const Subtree& inside, Subtree& above) {
    const uint32_t index = at.line_space & LSP_LINE_SPACE_MASK;
    const bool terminal = (at.line_space & LSP_TERMINAL_BIT) != 0;
    if (terminal != inside.line_spaces.empty())
      find(RuleId::kTerminalBit, at, Field::kLineSpace,
           terminal ? "TERMINAL is set, but there are Line Spaces below"
                    : "TERMINAL is clear, but no Line Space is below");
    if (index >= header_.line_space_count) {
      if (at.side >= 0)  // the header's layer has checked the root
        find(RuleId::kLineSpaceOutOfRange, at, Field::kLineSpace,
             "names Line Space " + std::to_string(index) + " of " + std::to_string(header_.line_space_count));
      return;
    }
    if (index >= line_space_seen_.size()) return;
    if (line_space_seen_[index])
      find(RuleId::kLineSpaceUsedTwice, at, Field::kLineSpace,
           "names Line Space " + std::to_string(index) + ", which another node carries");
    line_space_seen_[index] = true;
    const LspLineSpace& space = line_spaces_[index];
    if (space.child != at.child)
      find_line_space(RuleId::kLineSpaceChild, index, "child", offsetof(LspLineSpace, child),
                      "is not the child reference beside the reference to this Line Space");
    const Run own = line_space_triangles(index);
    const bool within = in_range(space.triangle_first, space.triangle_count, header_.triangle_count) &&
                        (own.empty() || at.child == LSP_NONE ||
                         (own.first >= inside.triangles.first && own.end <= inside.triangles.end));
    if (!within)
      find_line_space(
          RuleId::kLineSpaceTriangles, index, "triangle_first", offsetof(LspLineSpace, triangle_first),
          std::to_string(space.triangle_count) + " triangles from " + std::to_string(space.triangle_first) +
              " on, but the node has [" + std::to_string(inside.triangles.first) + ", " +
              std::to_string(inside.triangles.end) + ")");
    append_line_spaces(above, {index, index + 1}, at);
  }

  void find_line_space(RuleId id, uint64_t i, const char* field, uint64_t offset,
                       const std::string& message) {
    report_.add(id, view_.offset_of(Kind::kLspc, i * sizeof(LspLineSpace) + offset),
                view_.length_of(Kind::kLspc, 4), element_path(Kind::kLspc, i, field), message);
  }

  Run line_space_triangles(uint32_t index) const {
    if (index >= line_spaces_.size()) return {};
    const LspLineSpace& space = line_spaces_[index];
    if (!in_range(space.triangle_first, space.triangle_count, header_.triangle_count)) return {};
    return {space.triangle_first, space.triangle_first + space.triangle_count};
  }

  [[gnu::always_inline]] inline void append_line_spaces(Subtree& above, Run next, const Slot& at) {
    if (!above.line_spaces.append(next)) [[unlikely]]
      find(RuleId::kLineSpaceOrder, at, Field::kLineSpace,
           "Line Space " + std::to_string(next.first) +
               " does not follow the one before it in depth-first order");
  }

  // The root, and what the header declares about the whole tree.
  void check_root() {
    const uint32_t deepest = stack_.empty() ? 0 : stack_.back().height;  // of node 0
    const Slot root{header_.root, header_.root_line_space, 0, -1,
                    load_box(&header_.bounds_min.x, &header_.bounds_max.x)};
    Subtree whole;
    check_slot(root, whole);
    if (deepest > header_.max_depth)
      report_.add(
          RuleId::kDepthExceeded, offsetof(LspHeader, max_depth), 4, "/header/max_depth",
          "is " + std::to_string(header_.max_depth) + ", but a leaf is " + std::to_string(deepest) + " deep");
    if (deepest > header_.max_stack)
      report_.add(RuleId::kStackExceeded, offsetof(LspHeader, max_stack), 4, "/header/max_stack",
                  "is " + std::to_string(header_.max_stack) + ", but a traversal may need " +
                      std::to_string(deepest));
    if (nodes_.size() + ends_ > header_.max_steps)
      report_.add(RuleId::kStepsExceeded, offsetof(LspHeader, max_steps), 4, "/header/max_steps",
                  "is " + std::to_string(header_.max_steps) + ", but there are " +
                      std::to_string(nodes_.size()) + " nodes and " + std::to_string(ends_) +
                      " leaves or Line Spaces in place of them");
    const uint64_t covered = whole.triangles.first == 0 ? whole.triangles.end : 0;
    if (covered != header_.triangle_count && view_.part(Kind::kTria).usable)
      report_.add(RuleId::kTrianglesUnused, view_.offset_of(Kind::kTria, covered * sizeof(LspTriangle)),
                  view_.length_of(Kind::kTria, (header_.triangle_count - covered) * sizeof(LspTriangle)),
                  element_path(Kind::kTria, covered),
                  "the tree covers triangles [" + std::to_string(whole.triangles.first) + ", " +
                      std::to_string(whole.triangles.end) + ") of " + std::to_string(header_.triangle_count));
  }

  void check_unused() {
    for (uint64_t i = 1; i < has_parent_.size(); ++i)
      if (!has_parent_[i]) [[unlikely]]
        find_unreachable(i);
    for (uint64_t i = 0; i < line_space_seen_.size(); ++i)
      if (!line_space_seen_[i])
        report_.add(RuleId::kLineSpaceUnused, view_.offset_of(Kind::kLspc, i * sizeof(LspLineSpace)),
                    view_.length_of(Kind::kLspc, sizeof(LspLineSpace)), [&] {
                      return std::pair{element_path(Kind::kLspc, i), std::string("no node carries it")};
                    });
  }

  // Its boxes were compared with no parent's: they are looked at here.
  [[gnu::cold]] void find_unreachable(uint64_t i) {
    find_node(RuleId::kUnreachable, i, "no node before it refers to it");
    constexpr float kInfinity = std::numeric_limits<float>::infinity();
    const Box everything{{-kInfinity, -kInfinity, -kInfinity, 0}, {kInfinity, kInfinity, kInfinity, 0}};
    for (int side : {0, 1})
      if (const Slot inner = slot(i, side); !inner.empty()) explain_box(inner, everything);
  }

  const FileView& view_;
  Report& report_;
  const LspHeader& header_;
  std::span<const LspNode> nodes_;
  std::span<const LspLineSpace> line_spaces_;
  bool exact_;
  std::vector<bool> has_parent_;
  std::vector<bool> line_space_seen_;
  std::vector<Subtree> stack_;  // of nodes that no node before them has taken yet
  uint64_t ends_ = 0;           // leaves, and Line Spaces that stand for a subtree left out
};

}  // namespace

void check_tree(const FileView& view, Report& report) { TreeCheck(view, report).run(); }

}  // namespace lsp::format
