#include "clip.h"

#include <initializer_list>

#include "../vectors.h"

namespace lsp {

Polygon clip(const LspTriangle& triangle, const glm::vec3& lo, const glm::vec3& hi) {
  Polygon p;
  for (const lsp_float3& v : {triangle.v0, triangle.v1, triangle.v2}) p.corner[p.count++] = vec(v);
  for (int plane = 0; plane < 6 && p.count > 0; ++plane) {
    const int axis = plane / 2;
    float inside[12];
    bool all = true;
    for (int i = 0; i < p.count; ++i) {
      inside[i] = plane % 2 ? hi[axis] - p.corner[i][axis] : p.corner[i][axis] - lo[axis];
      all = all && inside[i] >= 0;
    }
    if (all) continue;
    Polygon q;
    for (int i = 0; i < p.count; ++i) {
      const int next = i + 1 < p.count ? i + 1 : 0;
      const glm::vec3 &a = p.corner[i], &b = p.corner[next];
      const float da = inside[i], db = inside[next];
      if (da >= 0) q.corner[q.count++] = a;
      if ((da > 0 && db < 0) || (da < 0 && db > 0)) q.corner[q.count++] = a + (b - a) * (da / (da - db));
    }
    p = q;
  }
  return p;
}

}  // namespace lsp
