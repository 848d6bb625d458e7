#include "wide_instances.h"

#include <cmath>

namespace lsp {
namespace {

constexpr uint32_t kChildren = 8;

double half_area(const lsp_instance_node& node) {
  const double x = double(node.hi[0]) - node.lo[0], y = double(node.hi[1]) - node.lo[1],
               z = double(node.hi[2]) - node.lo[2];
  return x * y + y * z + z * x;
}

bool is_instance(const lsp_instance_node& node) { return (node.child & LSP_INSTANCE_BIT) != 0; }

class Widener {
 public:
  Widener(const lsp_instance_node* nodes, lsp_instance_wide_node* wide) : nodes_(nodes), wide_(wide) {}

  // The wide node of a binary one that has children; answers its index. As deep as the binary tree at most.
  // Inlined into itself it is ten times as long.
  __attribute__((noinline)) uint32_t make(uint32_t binary) {
    uint32_t below[kChildren] = {nodes_[binary].child, nodes_[binary].child + 1};
    uint32_t count = 2;
    for (uint32_t k; count < kChildren && (k = largest(below, count)) < count; ++count) {
      below[count] = nodes_[below[k]].child + 1;
      below[k] = nodes_[below[k]].child;
    }
    const uint32_t index = count_++;
    for (uint32_t k = 0; k < kChildren; ++k) {
      lsp_instance_wide_node& wide = wide_[index];
      const bool is_there = k < count;
      for (uint32_t axis = 0; axis < 3; ++axis) {
        wide.lo[axis][k] = is_there ? nodes_[below[k]].lo[axis] : INFINITY;
        wide.hi[axis][k] = is_there ? nodes_[below[k]].hi[axis] : -INFINITY;
      }
      wide.growth[k] = is_there ? nodes_[below[k]].growth : 0;
      wide.child[k] = !is_there                       ? LSP_NONE
                      : is_instance(nodes_[below[k]]) ? nodes_[below[k]].child
                                                      : make(below[k]);
    }
    return index;
  }

 private:
  // Which has the largest box of those that have children; `count`: none has.
  uint32_t largest(const uint32_t* below, uint32_t count) const {
    uint32_t best = count;
    double best_area = -1;
    for (uint32_t k = 0; k < count; ++k) {
      if (is_instance(nodes_[below[k]])) continue;
      const double area = half_area(nodes_[below[k]]);
      if (!(area > best_area)) continue;
      best = k;
      best_area = area;
    }
    return best;
  }

  const lsp_instance_node* nodes_;
  lsp_instance_wide_node* wide_;
  uint32_t count_ = 0;
};

}  // namespace

void widen(const lsp_instance_node* nodes, lsp_instance_wide_node* wide) {
  if (!is_instance(nodes[0])) Widener(nodes, wide).make(0);
}

}  // namespace lsp
