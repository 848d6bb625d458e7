// A k-d tree over the corners of an outline.
#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <span>
#include <vector>

namespace lsp {

// Twice the signed area of a triangle. Its sign is right for these coordinates, whatever rounds: were it not
// the same for the same three corners in any order, ears that are none would be cut.
double area2(const glm::dvec2& a, const glm::dvec2& b, const glm::dvec2& c);

// Corners that are fixed in the plane and come and go: what is asked for is who is there in a triangle.
// Balanced by number, so that corners may crowd as they like (Bentley 1975).
class CornerTree {
 public:
  // `at` must outlive the tree. None is there at first.
  void build(std::span<const glm::dvec2> at);
  void set(uint32_t corner, bool there);

  // Calls found(corner) for corners that are there in or on a counter-clockwise triangle, and for a few
  // beside it, until it returns true: then that corner, else `none`. `work` is lowered by what was looked at.
  template <typename Found>
  uint32_t find(const glm::dvec2 (&triangle)[3], uint32_t none, uint64_t& work, const Found& found) const {
    uint32_t stack[kMostLevels + 1], top = 0;
    stack[top++] = 1;
    while (top > 0) {
      const uint32_t node = stack[--top];
      work -= work > 0;
      if (count_[node] == 0 || is_outside(node, triangle)) continue;
      if (node < leaves_) {
        stack[top++] = 2 * node + 1;
        stack[top++] = 2 * node;
        continue;
      }
      for (uint32_t i = begins_[node - leaves_]; i < begins_[node - leaves_ + 1]; ++i) {
        if (!there_[order_[i]]) continue;
        work -= work > 0;
        if (found(order_[i])) return order_[i];
      }
    }
    return none;
  }

 private:
  struct Box {
    glm::dvec2 low, high;
  };
  static constexpr uint32_t kMostLevels = 32;

  void split(uint32_t node, uint32_t begin, uint32_t end);
  bool is_outside(uint32_t node, const glm::dvec2 (&triangle)[3]) const;

  std::span<const glm::dvec2> at_;
  uint32_t leaves_ = 0;           // a power of two; node i has children 2 i and 2 i + 1, the root is 1
  std::vector<uint32_t> order_;   // corners, leaf after leaf
  std::vector<uint32_t> begins_;  // of leaves in order_
  std::vector<uint32_t> leaf_of_;
  std::vector<uint32_t> count_;  // of corners that are there, below each node
  std::vector<uint8_t> there_;
  std::vector<Box> boxes_;
};

}  // namespace lsp
