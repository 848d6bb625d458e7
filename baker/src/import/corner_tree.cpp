#include "import/corner_tree.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace lsp {

namespace {

// Adds `value` to an expansion, numbers of growing size without common bits whose sum is exact (Shewchuk
// 1997). Returns its new length.
int grow(double* expansion, int length, double value) {
  int kept = 0;
  for (int i = 0; i < length; ++i) {
    const double sum = value + expansion[i], part = sum - value;
    const double error = (value - (sum - part)) + (expansion[i] - part);
    if (error != 0) expansion[kept++] = error;
    value = sum;
  }
  expansion[kept++] = value;
  return kept;
}

}  // namespace

double area2(const glm::dvec2& a, const glm::dvec2& b, const glm::dvec2& c) {
  const double left = (b.x - a.x) * (c.y - a.y), right = (b.y - a.y) * (c.x - a.x), area = left - right;
  constexpr double kRounding = 4e-16;
  if (std::abs(area) > kRounding * (std::abs(left) + std::abs(right))) return area;
  // a x b + b x c + c x a, without any rounding.
  double expansion[12];
  int length = 0;
  const auto add = [&](double x, double y) {
    const double product = x * y;
    length = grow(expansion, length, std::fma(x, y, -product));
    length = grow(expansion, length, product);
  };
  for (const auto& [p, q] : {std::pair(a, b), std::pair(b, c), std::pair(c, a)}) {
    add(p.x, q.y);
    add(-p.y, q.x);
  }
  double sum = 0;
  for (int i = 0; i < length; ++i) sum += expansion[i];
  return sum;
}

void CornerTree::build(std::span<const glm::dvec2> at) {
  constexpr size_t kCornersALeaf = 6;
  at_ = at;
  const auto n = uint32_t(at.size());
  leaves_ = 1;
  while (size_t{leaves_} * kCornersALeaf < n) leaves_ *= 2;
  order_.resize(n);
  for (uint32_t i = 0; i < n; ++i) order_[i] = i;
  begins_.assign(leaves_ + 1, n);
  leaf_of_.resize(n);
  count_.assign(2 * size_t{leaves_}, 0);
  there_.assign(n, 0);
  boxes_.resize(2 * size_t{leaves_});
  split(1, 0, n);
}

void CornerTree::split(uint32_t node, uint32_t begin, uint32_t end) {
  Box& box = boxes_[node];
  box = {glm::dvec2(INFINITY), glm::dvec2(-INFINITY)};
  for (uint32_t i = begin; i < end; ++i) {
    box.low = glm::min(box.low, at_[order_[i]]);
    box.high = glm::max(box.high, at_[order_[i]]);
  }
  if (node >= leaves_) {
    begins_[node - leaves_] = begin;
    for (uint32_t i = begin; i < end; ++i) leaf_of_[order_[i]] = node;
    return;
  }
  const uint32_t middle = begin + (end - begin) / 2;
  const int axis = box.high.x - box.low.x > box.high.y - box.low.y ? 0 : 1;
  std::nth_element(order_.begin() + begin, order_.begin() + middle, order_.begin() + end,
                   [&](uint32_t a, uint32_t b) { return at_[a][axis] < at_[b][axis]; });
  split(2 * node, begin, middle);
  split(2 * node + 1, middle, end);
}

void CornerTree::set(uint32_t corner, bool there) {
  if (bool(there_[corner]) == there) return;
  there_[corner] = there;
  for (uint32_t node = leaf_of_[corner]; node > 0; node /= 2) count_[node] += there ? 1u : ~0u;
}

bool CornerTree::is_outside(uint32_t node, const glm::dvec2 (&triangle)[3]) const {
  const Box& box = boxes_[node];
  for (int k = 0; k < 2; ++k) {
    const double low = std::min(triangle[0][k], std::min(triangle[1][k], triangle[2][k]));
    const double high = std::max(triangle[0][k], std::max(triangle[1][k], triangle[2][k]));
    if (box.high[k] < low || box.low[k] > high) return true;
  }
  for (int i = 0; i < 3; ++i) {
    // The box's corner farthest to the left of the edge, which the triangle lies to the left of.
    const glm::dvec2 from = triangle[i], edge = triangle[(i + 1) % 3] - from;
    const double x = (edge.y > 0 ? box.low.x : box.high.x) - from.x;
    const double y = (edge.x > 0 ? box.high.y : box.low.y) - from.y;
    const double up = edge.x * y, down = edge.y * x;
    constexpr double kMargin = 1e-12;  // for what is rounded here
    if (up - down < -kMargin * (std::abs(up) + std::abs(down))) return true;
  }
  return false;
}

}  // namespace lsp
