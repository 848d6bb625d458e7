// The tree: references, order, boxes, declared bounds, and the Line Space references beside them.
//
// A child's index is greater than its parent's, so one pass up the array sees every parent before its
// children and one pass down sees every subtree whole: no recursion, no stack that a hostile file could
// overflow.
#include <algorithm>
#include <cmath>
#include <cstddef>

#include "layers.h"

namespace lsp::format {
namespace {

constexpr uint32_t kNoParent = LSP_NONE;

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
  uint32_t node_end = 0;  // one past its last node
  Run triangles;
  Run line_spaces;
};

// One child of a node, or the root.
struct Slot {
  uint32_t child;
  uint32_t line_space;
  uint64_t node;  // that holds it
  int side;       // 0 or 1; -1: the header's root
};

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
    parent_slot_.assign(nodes_.size(), kNoParent);
    depth_.assign(nodes_.size(), 0);
    line_space_seen_.assign(header_.line_space_count <= line_spaces_.size() ? line_spaces_.size() : 0, false);
    check_slot(root());
    for (uint64_t i = 0; i < nodes_.size(); ++i) check_node(i);
    check_bounds();
    subtrees_.resize(nodes_.size());
    for (uint64_t i = nodes_.size(); i-- > 0;) gather(i);
    gather_root();
    check_unused();
  }

 private:
  Slot root() const { return {header_.root, header_.root_line_space, 0, -1}; }
  Slot slot(uint64_t i, int side) const {
    const LspNode& node = nodes_[i];
    return side == 0 ? Slot{node.child0, node.line_space0, i, 0} : Slot{node.child1, node.line_space1, i, 1};
  }

  enum class Field { kChild, kLineSpace, kBox };
  void find(RuleId id, const Slot& at, Field field, const std::string& message) {
    static constexpr const char* kNames[2][3] = {{"child0", "line_space0", "lo0"},
                                                 {"child1", "line_space1", "lo1"}};
    static constexpr uint64_t kOffsets[3] = {offsetof(LspNode, child0), offsetof(LspNode, line_space0),
                                             offsetof(LspNode, lo0)};
    const int which = static_cast<int>(field);
    const uint64_t bytes = field == Field::kBox ? 28 : 4;  // lo, child, hi
    if (at.side < 0) {
      report_.add(
          id, field == Field::kLineSpace ? offsetof(LspHeader, root_line_space) : offsetof(LspHeader, root),
          4, field == Field::kLineSpace ? "/header/root_line_space" : "/header/root", message);
      return;
    }
    const uint64_t first = at.node * sizeof(LspNode) + 32u * static_cast<uint64_t>(at.side) + kOffsets[which];
    report_.add(id, view_.offset_of(Kind::kNode, first), view_.length_of(Kind::kNode, bytes),
                element_path(Kind::kNode, at.node, kNames[at.side][which]), message);
  }

  void check_node(uint64_t i) {
    if (i != 0 && parent_slot_[i] == kNoParent)
      report_.add(
          RuleId::kUnreachable, view_.offset_of(Kind::kNode, i * sizeof(LspNode)),
          view_.length_of(Kind::kNode, sizeof(LspNode)), [&] {
            return std::pair{element_path(Kind::kNode, i), std::string("no node before it refers to it")};
          });
    deepest_ = std::max(deepest_, depth_[i] + 1);
    const Slot first = slot(i, 0), second = slot(i, 1);
    check_slot(first);
    check_slot(second);
    if (first.child == LSP_NONE && second.child == LSP_NONE && first.line_space == LSP_NONE &&
        second.line_space == LSP_NONE)
      report_.add(RuleId::kNodeEmpty, view_.offset_of(Kind::kNode, i * sizeof(LspNode)),
                  view_.length_of(Kind::kNode, sizeof(LspNode)), element_path(Kind::kNode, i),
                  "has nothing below it");
    const LspNode& node = nodes_[i];
    check_box(first, node.lo0, node.hi0);
    check_box(second, node.lo1, node.hi1);
  }

  void check_slot(const Slot& at) {
    if (at.child == LSP_NONE) {
      if (at.line_space != LSP_NONE && exact_)
        find(RuleId::kChildMissing, at, Field::kChild,
             "nothing is below the Line Space, but the file is exact");
      if (at.line_space != LSP_NONE) ++ends_;
    } else if (at.child & LSP_LEAF_BIT) {
      check_leaf(at);
    } else {
      check_link(at);
    }
    if (at.line_space != LSP_NONE) check_line_space_reference(at);
  }

  void check_leaf(const Slot& at) {
    ++ends_;
    const uint64_t first = at.child & LSP_LEAF_FIRST_MASK;
    const uint64_t count = (at.child >> LSP_LEAF_COUNT_SHIFT & LSP_LEAF_COUNT_MASK) + 1;
    if (!in_range(first, count, header_.triangle_count) && at.side >= 0)
      find(RuleId::kLeafOutOfRange, at, Field::kChild,
           "triangles " + std::to_string(first) + " to " + std::to_string(first + count - 1) + " of " +
               std::to_string(header_.triangle_count));
    if (count > header_.max_leaf_triangles)
      find(RuleId::kLeafTooLarge, at, Field::kChild,
           std::to_string(count) + " triangles, max_leaf_triangles is " +
               std::to_string(header_.max_leaf_triangles));
  }

  // A reference to a node: notes the child's parent and depth, unless the reference is unsound.
  void check_link(const Slot& at) {
    if (at.side < 0) return;  // the header's layer has checked the root
    if (at.child >= nodes_.size())
      find(RuleId::kChildOutOfRange, at, Field::kChild,
           "names node " + std::to_string(at.child) + " of " + std::to_string(nodes_.size()));
    else if (at.child <= at.node)
      find(RuleId::kChildNotAfterParent, at, Field::kChild,
           "names node " + std::to_string(at.child) + ", which is not after its parent");
    else if (parent_slot_[at.child] != kNoParent)
      find(RuleId::kTwoParents, at, Field::kChild,
           "names node " + std::to_string(at.child) + ", which node " +
               std::to_string(parent_slot_[at.child] / 2) + " already has as a child");
    else {
      parent_slot_[at.child] = static_cast<uint32_t>(at.node * 2 + static_cast<uint64_t>(at.side));
      depth_[at.child] = depth_[at.node] + 1;
    }
  }

  bool linked(const Slot& at) const {
    return at.child < nodes_.size() && at.child > at.node &&
           parent_slot_[at.child] == at.node * 2 + static_cast<uint64_t>(at.side);
  }

  void check_line_space_reference(const Slot& at) {
    const uint32_t index = at.line_space & LSP_LINE_SPACE_MASK;
    if (index >= header_.line_space_count) {
      if (at.side >= 0)
        find(RuleId::kLineSpaceOutOfRange, at, Field::kLineSpace,
             "names Line Space " + std::to_string(index) + " of " + std::to_string(header_.line_space_count));
      return;
    }
    if (index >= line_space_seen_.size()) return;
    if (line_space_seen_[index])
      find(RuleId::kLineSpaceUsedTwice, at, Field::kLineSpace,
           "names Line Space " + std::to_string(index) + ", which another node carries");
    line_space_seen_[index] = true;
    if (line_spaces_[index].child != at.child)
      report_.add(RuleId::kLineSpaceChild,
                  view_.offset_of(Kind::kLspc, index * sizeof(LspLineSpace) + offsetof(LspLineSpace, child)),
                  view_.length_of(Kind::kLspc, 4), element_path(Kind::kLspc, index, "child"),
                  "is not the child reference beside the reference to this Line Space");
  }

  void check_box(const Slot& at, const lsp_float3& lo, const lsp_float3& hi) {
    if (at.child == LSP_NONE && at.line_space == LSP_NONE) return;
    // A sum is finite only if every term is; overflow of finite terms is sorted out in the slow path.
    const float sum = (lo.x + lo.y + lo.z) + (hi.x + hi.y + hi.z);
    if (!std::isfinite(sum) && !(std::isfinite(lo.x) && std::isfinite(lo.y) && std::isfinite(lo.z) &&
                                 std::isfinite(hi.x) && std::isfinite(hi.y) && std::isfinite(hi.z))) {
      find(RuleId::kBoxNotFinite, at, Field::kBox, "a corner of the box is not finite");
      return;
    }
    if (lo.x > hi.x || lo.y > hi.y || lo.z > hi.z) {
      find(RuleId::kBoxNotFinite, at, Field::kBox, "the box is inside out");
      return;
    }
    const lsp_float3 *outer_lo = &header_.bounds_min, *outer_hi = &header_.bounds_max;
    if (const uint32_t parent = parent_slot_[at.node]; parent != kNoParent) {
      const LspNode& node = nodes_[parent / 2];
      outer_lo = parent % 2 == 0 ? &node.lo0 : &node.lo1;
      outer_hi = parent % 2 == 0 ? &node.hi0 : &node.hi1;
    }
    if (lo.x < outer_lo->x || lo.y < outer_lo->y || lo.z < outer_lo->z || hi.x > outer_hi->x ||
        hi.y > outer_hi->y || hi.z > outer_hi->z)
      find(RuleId::kBoxOutsideParent, at, Field::kBox, "the box reaches outside its parent's");
  }

  void check_bounds() {
    if (deepest_ > header_.max_depth)
      report_.add(RuleId::kDepthExceeded, offsetof(LspHeader, max_depth), 4, "/header/max_depth",
                  "is " + std::to_string(header_.max_depth) + ", but a leaf is " + std::to_string(deepest_) +
                      " deep");
    if (deepest_ > header_.max_stack)
      report_.add(RuleId::kStackExceeded, offsetof(LspHeader, max_stack), 4, "/header/max_stack",
                  "is " + std::to_string(header_.max_stack) + ", but a traversal may need " +
                      std::to_string(deepest_));
    if (nodes_.size() + ends_ > header_.max_steps)
      report_.add(RuleId::kStepsExceeded, offsetof(LspHeader, max_steps), 4, "/header/max_steps",
                  "is " + std::to_string(header_.max_steps) + ", but there are " +
                      std::to_string(nodes_.size()) + " nodes and " + std::to_string(ends_) +
                      " leaves or Line Spaces in place of them");
  }

  // What is below a slot; its own Line Space not counted.
  Subtree below(const Slot& at) const {
    if (at.side < 0 ? !nodes_.empty() : linked(at)) return subtrees_[at.side < 0 ? 0 : at.child];
    Subtree result;
    if (at.child == LSP_NONE) {
      // A subtree that was left out: its triangles are those of its Line Space.
      if (at.line_space != LSP_NONE)
        result.triangles = line_space_triangles(at.line_space & LSP_LINE_SPACE_MASK);
    } else if (at.child & LSP_LEAF_BIT) {
      const uint32_t first = at.child & LSP_LEAF_FIRST_MASK;
      const uint32_t count = (at.child >> LSP_LEAF_COUNT_SHIFT & LSP_LEAF_COUNT_MASK) + 1;
      if (in_range(first, count, header_.triangle_count)) result.triangles = {first, first + count};
    }
    return result;
  }

  Run line_space_triangles(uint32_t index) const {
    if (index >= line_spaces_.size()) return {};
    const LspLineSpace& space = line_spaces_[index];
    if (!in_range(space.triangle_first, space.triangle_count, header_.triangle_count)) return {};
    return {space.triangle_first, space.triangle_first + space.triangle_count};
  }

  // Adds a slot to the runs of the node above it, and checks what only a whole subtree can tell.
  void gather_slot(const Slot& at, Subtree& above) {
    const Subtree inside = below(at);
    if (at.line_space != LSP_NONE) {
      const uint32_t index = at.line_space & LSP_LINE_SPACE_MASK;
      const bool terminal = (at.line_space & LSP_TERMINAL_BIT) != 0;
      if (terminal != inside.line_spaces.empty())
        find(RuleId::kTerminalBit, at, Field::kLineSpace,
             terminal ? "TERMINAL is set, but there are Line Spaces below"
                      : "TERMINAL is clear, but no Line Space is below");
      if (index < line_spaces_.size()) {
        const LspLineSpace& space = line_spaces_[index];
        const Run own = line_space_triangles(index);
        const bool within = in_range(space.triangle_first, space.triangle_count, header_.triangle_count) &&
                            (own.empty() || at.child == LSP_NONE ||
                             (own.first >= inside.triangles.first && own.end <= inside.triangles.end));
        if (!within)
          report_.add(RuleId::kLineSpaceTriangles,
                      view_.offset_of(Kind::kLspc,
                                      index * sizeof(LspLineSpace) + offsetof(LspLineSpace, triangle_first)),
                      view_.length_of(Kind::kLspc, 4), element_path(Kind::kLspc, index, "triangle_first"),
                      std::to_string(space.triangle_count) + " triangles from " +
                          std::to_string(space.triangle_first) + " on, but the node has [" +
                          std::to_string(inside.triangles.first) + ", " +
                          std::to_string(inside.triangles.end) + ")");
        append_line_spaces(above, {index, index + 1}, at);
      }
    }
    append_line_spaces(above, inside.line_spaces, at);
    if (!above.triangles.append(inside.triangles))
      find(RuleId::kLeafOrder, at, Field::kChild,
           "its triangles begin at " + std::to_string(inside.triangles.first) +
               ", not where those before it end");
  }

  void append_line_spaces(Subtree& above, Run next, const Slot& at) {
    if (!above.line_spaces.append(next))
      find(RuleId::kLineSpaceOrder, at, Field::kLineSpace,
           "Line Space " + std::to_string(next.first) +
               " does not follow the one before it in depth-first order");
  }

  void gather(uint64_t i) {
    Subtree& subtree = subtrees_[i];
    subtree.node_end = static_cast<uint32_t>(i + 1);
    for (int side : {0, 1}) {
      const Slot at = slot(i, side);
      if (linked(at)) {
        if (at.child != subtree.node_end)
          find(RuleId::kNotDepthFirst, at, Field::kChild,
               "names node " + std::to_string(at.child) + ", depth-first order asks for " +
                   std::to_string(subtree.node_end));
        subtree.node_end = std::max(subtree.node_end, subtrees_[at.child].node_end);
      }
      gather_slot(at, subtree);
    }
  }

  void gather_root() {
    Subtree whole;
    gather_slot(root(), whole);
    const uint64_t covered = whole.triangles.first == 0 ? whole.triangles.end : 0;
    if (covered != header_.triangle_count && view_.part(Kind::kTria).usable)
      report_.add(RuleId::kTrianglesUnused, view_.offset_of(Kind::kTria, covered * sizeof(LspTriangle)),
                  view_.length_of(Kind::kTria, (header_.triangle_count - covered) * sizeof(LspTriangle)),
                  element_path(Kind::kTria, covered),
                  "the tree covers triangles [" + std::to_string(whole.triangles.first) + ", " +
                      std::to_string(whole.triangles.end) + ") of " + std::to_string(header_.triangle_count));
  }

  void check_unused() {
    for (uint64_t i = 0; i < line_space_seen_.size(); ++i)
      if (!line_space_seen_[i])
        report_.add(RuleId::kLineSpaceUnused, view_.offset_of(Kind::kLspc, i * sizeof(LspLineSpace)),
                    view_.length_of(Kind::kLspc, sizeof(LspLineSpace)), [&] {
                      return std::pair{element_path(Kind::kLspc, i), std::string("no node carries it")};
                    });
  }

  const FileView& view_;
  Report& report_;
  const LspHeader& header_;
  std::span<const LspNode> nodes_;
  std::span<const LspLineSpace> line_spaces_;
  bool exact_;
  std::vector<uint32_t> parent_slot_;  // parent * 2 + side
  std::vector<uint32_t> depth_;
  std::vector<bool> line_space_seen_;
  std::vector<Subtree> subtrees_;
  uint32_t deepest_ = 0;
  uint64_t ends_ = 0;  // leaves, and Line Spaces that stand for a subtree left out
};

}  // namespace

void check_tree(const FileView& view, Report& report) { TreeCheck(view, report).run(); }

}  // namespace lsp::format
