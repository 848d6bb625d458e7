// Wide nodes: references, order, boxes and declared bounds.
//
// The order of the nodes and of the triangles says what every node has to state: one walk, depth first,
// counts both, compares, and goes on with what it counted. So each node is visited once whatever the file
// says, and one mistake is one finding. There is no recursion; the walk needs a stack of at most seven nodes
// a level.
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstring>

#include "layers.h"
#include "wide.h"

namespace lsp::format {
namespace {

// What holds of the planes of all eight children, by one byte of a vector a child.
struct Planes {
  typedef uint8_t Bytes __attribute__((vector_size(8)));

  static Bytes smaller(const Bytes& a, const Bytes& b) { return a < b ? a : b; }

  explicit Planes(const LspWideNode& node) {
    Bytes inside_out{}, none = ~Bytes{};
    for (int a = 0; a < 3; ++a) {
      Bytes l, h;
      std::memcpy(&l, &node.planes[2 * a], sizeof l);
      std::memcpy(&h, &node.planes[6 + 2 * a], sizeof h);
      inside_out |= l > h;
      none &= (l == 255) & (h == 0);
      l = smaller(l, __builtin_shufflevector(l, l, 4, 5, 6, 7, 0, 1, 2, 3));
      l = smaller(l, __builtin_shufflevector(l, l, 2, 3, 0, 1, 6, 7, 4, 5));
      l = smaller(l, __builtin_shufflevector(l, l, 1, 0, 3, 2, 5, 4, 7, 6));
      h = ~smaller(~h, ~__builtin_shufflevector(h, h, 4, 5, 6, 7, 0, 1, 2, 3));
      h = ~smaller(~h, ~__builtin_shufflevector(h, h, 2, 3, 0, 1, 6, 7, 4, 5));
      h = ~smaller(~h, ~__builtin_shufflevector(h, h, 1, 0, 3, 2, 5, 4, 7, 6));
      lowest[a] = l[0];
      highest[a] = h[0];
    }
    std::memcpy(&this->inside_out, &inside_out, sizeof inside_out);
    std::memcpy(&this->none, &none, sizeof none);
  }

  uint32_t lowest[3], highest[3];  // of all children: those that are none move neither
  uint64_t inside_out, none;       // a byte FF for each child that is
};

class WideCheck {
 public:
  WideCheck(const FileView& view, Report& report)
      : view_(view), report_(report), header_(view.header), nodes_(view.elements<LspWideNode>(Kind::kWnod)) {
    const lsp_float3 &lo = header_.bounds_min, &hi = header_.bounds_max;
    bounds_ = {{lo.x, lo.y, lo.z}, {hi.x, hi.y, hi.z}};
    double largest = 0, extent = 0;
    for (int a = 0; a < 3; ++a) {
      largest = std::max({largest, std::fabs(bounds_.lo[a]), std::fabs(bounds_.hi[a])});
      extent = std::max(extent, bounds_.hi[a] - bounds_.lo[a]);
    }
    // What the rounding of a frame's corner and step to floats makes of a box.
    slack_ = std::ldexp(largest + extent, -20);
  }

  void run() {
    if (!nodes_.empty()) {
      waiting_.push_back({0, 0, 0, 0});
      next_node_ = 1;
    }
    while (!waiting_.empty()) {
      const Visit at = waiting_.back();
      waiting_.pop_back();
      visit(at);
    }
    check_unused();
    check_declared();
  }

 private:
  struct Visit {
    uint32_t node;
    uint32_t parent;  // of the root: itself
    uint32_t child;   // of the parent
    uint32_t depth;
  };

  struct Field {
    const char* name;
    uint64_t offset, bytes;
  };
  static constexpr Field kNodeFirst{"node_first", offsetof(LspWideNode, node_first), 4};
  static constexpr Field kTriangleFirst{"triangle_first", offsetof(LspWideNode, triangle_first), 4};
  static constexpr Field kFrame{"lo", 0, 28};
  static constexpr Field kChildren{"children", offsetof(LspWideNode, children), 16};
  static constexpr Field kPlanes{"planes", offsetof(LspWideNode, planes), 48};

  // A finding about a field of a node, `describe` as in Report::add but for the path.
  template <class Describe>
  [[gnu::cold]] void find(RuleId id, uint64_t node, const Field& field, Describe&& describe) {
    report_.add(id, view_.offset_of(Kind::kWnod, node * sizeof(LspWideNode) + field.offset),
                view_.length_of(Kind::kWnod, field.bytes), [&] {
                  return std::pair{element_path(Kind::kWnod, node, field.name), std::string(describe())};
                });
  }
  static std::string child_text(uint32_t k) { return "child " + std::to_string(k) + " "; }

  void visit(const Visit& at) {
    const LspWideNode& node = nodes_[at.node];
    const bool framed =
        finite(node.lo) && finite(node.step) && node.step.x >= 0 && node.step.y >= 0 && node.step.z >= 0;
    if (!framed) [[unlikely]]
      find(RuleId::kWideFrame, at.node, kFrame,
           [] { return "the corner or a step is not finite, or a step is negative"; });
    const WideBox outer = at.depth == 0 ? bounds_ : wide_box(nodes_[at.parent], at.child);
    const bool comparable = framed && sound(outer);  // else the outer box has a finding of its own
    const Planes planes(node);
    const bool fits = !comparable || inside(node, planes, outer);
    uint32_t nodes = 0, leaves = 0, triangles = 0;
    for (uint32_t k = 0; k < LSP_WIDE_CHILDREN; ++k) {
      const uint32_t child = wide_child(node, k);
      if (child == LSP_WIDE_NO_CHILD) {
        if ((planes.none >> 8 * k & 1) == 0) [[unlikely]]
          find(RuleId::kWideNone, at.node, kPlanes, [&] { return child_text(k) + "is none, but has a box"; });
        continue;
      }
      if (child & LSP_WIDE_NODE_BIT) {
        if ((child & ~LSP_WIDE_NODE_BIT) != nodes) [[unlikely]]
          find(RuleId::kWideChild, at.node, kChildren, [&] {
            return child_text(k) + "is node " + std::to_string(child & ~LSP_WIDE_NODE_BIT) + ", not " +
                   std::to_string(nodes) + " of the node's";
          });
        ++nodes;
      } else {
        check_leaf(at.node, k, child, triangles);
        triangles += wide_leaf_count(child);
        ++leaves;
      }
      if ((planes.inside_out >> 8 * k & 1) != 0) [[unlikely]]
        find(RuleId::kBoxNotFinite, at.node, kPlanes, [&] { return child_text(k) + "has a box inside out"; });
      else if (!fits) [[unlikely]]
        check_box(at.node, k, outer);
    }
    if (nodes + leaves == 0) [[unlikely]]
      find(RuleId::kNodeEmpty, at.node, kChildren, [] { return "has no child"; });
    ends_ += leaves;
    longest_ = std::max(longest_, at.depth + 1);
    if (leaves != 0) deepest_ = std::max(deepest_, at.depth + 1);
    count(at, nodes, triangles);
  }

  // `before`: triangles of the node's leaves before this one.
  void check_leaf(uint64_t node, uint32_t k, uint32_t child, uint32_t before) {
    const uint32_t count = wide_leaf_count(child);
    if (wide_leaf_first(child) != before) [[unlikely]]
      find(RuleId::kWideChild, node, kChildren, [&] {
        return child_text(k) + "is a leaf that begins at triangle " + std::to_string(wide_leaf_first(child)) +
               ", not " + std::to_string(before) + " of the node's";
      });
    if (count > header_.max_leaf_triangles) [[unlikely]]
      find(RuleId::kLeafTooLarge, node, kChildren, [&] {
        return child_text(k) + "has " + std::to_string(count) + " triangles, max_leaf_triangles is " +
               std::to_string(header_.max_leaf_triangles);
      });
    const uint64_t first = next_triangle_ + before;
    if (!in_range(first, count, header_.triangle_count)) [[unlikely]]
      find(RuleId::kLeafOutOfRange, node, kChildren, [&] {
        return child_text(k) + "has triangles " + std::to_string(first) + " to " +
               std::to_string(first + count - 1) + " of " + std::to_string(header_.triangle_count);
      });
  }

  // Finite, and not inside out.
  static bool sound(const WideBox& box) {
    bool good = true;
    for (int a = 0; a < 3; ++a)
      good = good && std::isfinite(box.lo[a]) && std::isfinite(box.hi[a]) && box.lo[a] <= box.hi[a];
    return good;
  }

  // Whether all children lie inside `outer`. Planes grow with their bytes.
  bool inside(const LspWideNode& node, const Planes& planes, const WideBox& outer) const {
    const double lo[3] = {node.lo.x, node.lo.y, node.lo.z}, step[3] = {node.step.x, node.step.y, node.step.z};
    bool good = true;
    for (int a = 0; a < 3; ++a)
      good = good && lo[a] + planes.lowest[a] * step[a] >= outer.lo[a] - slack_ &&
             lo[a] + planes.highest[a] * step[a] <= outer.hi[a] + slack_;
    return good;
  }

  [[gnu::cold]] void check_box(uint64_t node, uint32_t k, const WideBox& outer) {
    const WideBox box = wide_box(nodes_[node], k);
    bool inside = true;
    for (int a = 0; a < 3; ++a)
      inside = inside && box.lo[a] >= outer.lo[a] - slack_ && box.hi[a] <= outer.hi[a] + slack_;
    if (!inside)
      find(RuleId::kBoxOutsideParent, node, kPlanes,
           [&] { return child_text(k) + "has a box that reaches outside its parent's"; });
  }

  // Compares what the node states with what was counted, and goes on with the latter.
  void count(const Visit& at, uint32_t nodes, uint32_t triangles) {
    const LspWideNode& node = nodes_[at.node];
    if (node.triangle_first != next_triangle_) [[unlikely]]
      find(RuleId::kLeafOrder, at.node, kTriangleFirst, [&] {
        return "is " + std::to_string(node.triangle_first) + ", but " + std::to_string(next_triangle_) +
               " triangles are before";
      });
    if (node.node_first != next_node_) [[unlikely]]
      find(RuleId::kNotDepthFirst, at.node, kNodeFirst, [&] {
        return "is " + std::to_string(node.node_first) + ", but " + std::to_string(next_node_) +
               " nodes are before";
      });
    next_triangle_ += triangles;
    if (!in_range(next_node_, nodes, nodes_.size())) [[unlikely]]
      find(RuleId::kChildOutOfRange, at.node, kChildren, [&] {
        return std::to_string(nodes) + " children are nodes from " + std::to_string(next_node_) + " on, of " +
               std::to_string(nodes_.size());
      });
    // The first child comes uppermost.
    uint64_t below = next_node_ + nodes;
    for (uint32_t k = LSP_WIDE_CHILDREN; k-- > 0 && nodes != 0;) {
      const uint32_t child = wide_child(node, k);
      if (child == LSP_WIDE_NO_CHILD || !(child & LSP_WIDE_NODE_BIT)) continue;
      if (--below < nodes_.size())
        waiting_.push_back({static_cast<uint32_t>(below), at.node, k, at.depth + 1});
    }
    next_node_ += nodes;
  }

  void check_unused() {
    for (uint64_t i = next_node_; i < nodes_.size(); ++i)
      find(RuleId::kUnreachable, i, {nullptr, 0, sizeof(LspWideNode)},
           [] { return "no node before it refers to it"; });
    if (next_triangle_ < header_.triangle_count && view_.part(Kind::kTria).usable)
      report_.add(
          RuleId::kTrianglesUnused, view_.offset_of(Kind::kTria, next_triangle_ * sizeof(LspTriangle)),
          view_.length_of(Kind::kTria, (header_.triangle_count - next_triangle_) * sizeof(LspTriangle)),
          element_path(Kind::kTria, next_triangle_),
          "the nodes cover " + std::to_string(next_triangle_) + " triangles of " +
              std::to_string(header_.triangle_count));
  }

  // What the header declares about the whole tree.
  void check_declared() {
    if (deepest_ > header_.max_depth)
      report_.add(RuleId::kDepthExceeded, offsetof(LspHeader, max_depth), 4, "/header/max_depth",
                  "is " + std::to_string(header_.max_depth) + ", but a leaf is " + std::to_string(deepest_) +
                      " deep");
    if (longest_ > header_.max_stack)
      report_.add(RuleId::kStackExceeded, offsetof(LspHeader, max_stack), 4, "/header/max_stack",
                  "is " + std::to_string(header_.max_stack) + ", but a traversal may need " +
                      std::to_string(longest_));
    if (nodes_.size() + ends_ > header_.max_steps)
      report_.add(RuleId::kStepsExceeded, offsetof(LspHeader, max_steps), 4, "/header/max_steps",
                  "is " + std::to_string(header_.max_steps) + ", but there are " +
                      std::to_string(nodes_.size()) + " nodes and " + std::to_string(ends_) + " leaves");
  }

  const FileView& view_;
  Report& report_;
  const LspHeader& header_;
  std::span<const LspWideNode> nodes_;
  WideBox bounds_;
  double slack_;
  std::vector<Visit> waiting_;
  uint64_t next_node_ = 0;      // as many nodes are the root or a child of one visited
  uint64_t next_triangle_ = 0;  // as many triangles are of leaves of one visited
  uint64_t ends_ = 0;           // leaves
  uint32_t longest_ = 0;        // nodes on the longest path from the root
  uint32_t deepest_ = 0;        // edges to the deepest leaf
};

}  // namespace

void check_wide(const FileView& view, Report& report) { WideCheck(view, report).run(); }

}  // namespace lsp::format
