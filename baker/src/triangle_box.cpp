#include "triangle_box.h"

#include <initializer_list>

#include "vectors.h"

namespace lsp {
namespace {

// A convex polygon: a triangle and what half-spaces leave of it, each of which adds a corner at most.
struct Polygon {
  static constexpr int kMost = 3 + 6;
  glm::dvec3 corners[kMost];
  int count = 0;
};

// Keeps the part where sign * (x[axis] - border) <= 0.
void clip(Polygon& polygon, int axis, double border, double sign) {
  double value[Polygon::kMost];
  bool any_in = false, any_out = false;
  for (int i = 0; i < polygon.count; ++i) {
    value[i] = sign * (polygon.corners[i][axis] - border);
    (value[i] <= 0 ? any_in : any_out) = true;
  }
  if (!any_out) return;
  if (!any_in) {
    polygon.count = 0;
    return;
  }
  // A polygon that is thinner than rounding may seem to cross the border more than twice: it stays whole,
  // which errs to the safe side and keeps the corners few.
  int crossings = 0;
  for (int i = 0; i < polygon.count; ++i)
    crossings += (value[i] <= 0) != (value[i + 1 == polygon.count ? 0 : i + 1] <= 0);
  if (crossings != 2) return;
  const Polygon old = polygon;
  polygon.count = 0;
  for (int i = 0; i < old.count; ++i) {
    const int next = i + 1 == old.count ? 0 : i + 1;
    const glm::dvec3 &a = old.corners[i], &b = old.corners[next];
    if (value[i] <= 0) polygon.corners[polygon.count++] = a;
    if ((value[i] <= 0) == (value[next] <= 0)) continue;
    polygon.corners[polygon.count++] = a + value[i] / (value[i] - value[next]) * (b - a);
  }
}

}  // namespace

bool reaches_into(const LspTriangle& triangle, const glm::dvec3& lo, const glm::dvec3& hi) {
  Polygon p;
  for (const lsp_float3& v : {triangle.v0, triangle.v1, triangle.v2}) p.corners[p.count++] = dvec(v);
  for (int k = 0; k < 3 && p.count != 0; ++k) {
    clip(p, k, hi[k], 1);
    clip(p, k, lo[k], -1);
  }
  return p.count != 0;
}

}  // namespace lsp
