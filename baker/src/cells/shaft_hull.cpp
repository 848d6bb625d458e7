#include "shaft_hull.h"

#include <array>
#include <optional>

namespace lsp {
namespace {

using Rectangle = std::array<glm::vec3, 4>;

// Its corners in turn.
Rectangle rectangle(const Box& box) {
  const int axis = box.lo.x == box.hi.x   ? 0
                   : box.lo.y == box.hi.y ? 1
                                          : 2,
            u = axis == 0 ? 1 : 0, v = axis == 2 ? 1 : 2;
  Rectangle r = {box.lo, box.lo, box.hi, box.hi};
  r[1][u] = box.hi[u];
  r[3] = box.lo;
  r[3][v] = box.hi[v];
  return r;
}

// The half-space whose border is the plane through an edge of one of two rectangles and a corner of the
// other, if it holds both.
std::optional<HalfSpace> supporting(const glm::vec3& a, const glm::vec3& b, const glm::vec3& c,
                                    const Rectangle& from, const Rectangle& to) {
  const glm::vec3 across = glm::cross(b - a, c - a);
  const float area = glm::length(across), edge = glm::length(b - a);
  if (!(area > 1e-4f * edge * edge)) return {};
  HalfSpace h{across / area, 0};
  float least = 0, most = 0;
  for (const Rectangle* r : {&from, &to})
    for (const glm::vec3& p : *r) {
      const float d = glm::dot(h.normal, p - a);
      least = std::min(least, d);
      most = std::max(most, d);
    }
  const float tolerance = 1e-4f * edge;
  if (least < -tolerance && most > tolerance) return {};
  if (most > tolerance) h.normal = -h.normal;
  h.distance = glm::dot(h.normal, a) + tolerance;
  return h;
}

}  // namespace

std::vector<HalfSpace> shaft_hull(const Box& from, const Box& to) {
  const Rectangle a = rectangle(from), b = rectangle(to);
  std::vector<HalfSpace> hull;
  for (const auto* side : {&a, &b})
    for (size_t i = 0; i < 4; ++i)
      for (const glm::vec3& p : side == &a ? b : a)
        if (const auto plane = supporting((*side)[i], (*side)[(i + 1) % 4], p, a, b)) hull.push_back(*plane);
  return hull;
}

}  // namespace lsp
