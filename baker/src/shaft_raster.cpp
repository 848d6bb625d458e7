#include "shaft_raster.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "clones.h"

namespace lsp {

// How far, in patches, a ray's end may lie outside a projection and still be tested: far more than rounding
// moves it, and the edge functions decide.
namespace {
constexpr float kSlack = 1e-3f;
// Hits are looked for from this share of the way on. What a box holds is further from its sides (see Filler).
constexpr float kNearest = 1e-4f;
constexpr float kFar = 1e30f;

struct Projection {
  float plane;              // of the face, from the origin, along the way out: positive
  float sign;               // of that way
  float origin[3];          // axis, u, v
  float scale_u, offset_u;  // patches = distance along u from the origin * scale + offset
  float scale_v, offset_v;
  int n;
};

// Not std::min and std::max: compilers keep their branches, and a loop with branches is not vectorised.
constexpr float lesser(float a, float b) { return b < a ? b : a; }
constexpr float greater(float a, float b) { return a < b ? b : a; }

// The patches whose points may lie in the projection of a triangle: columns and rows from the first to before
// the last, four bytes; none: the last is 0. `c` are the corners' coordinates in the order axis, u, v.
LSP_CLONES void project(const Projection& projection, size_t count, const float* const* c,
                        uint32_t* covered) {
  const Projection p = projection;
  const float *a0 = c[0], *u0 = c[1], *v0 = c[2], *a1 = c[3], *u1 = c[4], *v1 = c[5], *a2 = c[6], *u2 = c[7],
              *v2 = c[8];
  const float top = float(p.n);
  const float near = kNearest * p.plane, magnify = p.plane / near;
  for (size_t k = 0; k < count; ++k) {
    const float w0 = p.sign * (a0[k] - p.origin[0]);
    const float w1 = p.sign * (a1[k] - p.origin[0]);
    const float w2 = p.sign * (a2[k] - p.origin[0]);
    const float x0 = u0[k] - p.origin[1], y0 = v0[k] - p.origin[2];
    const float x1 = u1[k] - p.origin[1], y1 = v1[k] - p.origin[2];
    const float x2 = u2[k] - p.origin[1], y2 = v2[k] - p.origin[2];
    float x_lo = kFar, x_hi = -kFar, y_lo = kFar, y_hi = -kFar;
    const auto corner = [&](float w, float x, float y) {
      const float scale = p.plane / w;
      const bool ahead = w > near;
      x_lo = lesser(x_lo, ahead ? x * scale : kFar);
      x_hi = greater(x_hi, ahead ? x * scale : -kFar);
      y_lo = lesser(y_lo, ahead ? y * scale : kFar);
      y_hi = greater(y_hi, ahead ? y * scale : -kFar);
    };
    corner(w0, x0, y0);
    corner(w1, x1, y1);
    corner(w2, x2, y2);
    // Where an edge passes the plane `near`; off by the rounding of the larger of its ends.
    const auto cut = [&](float wi, float xi, float yi, float wj, float xj, float yj) {
      const bool passes = (wi > near) != (wj > near);
      const float f = (near - wi) / (wj - wi);
      const float x = (xi + f * (xj - xi)) * magnify, y = (yi + f * (yj - yi)) * magnify;
      const float off_x = (std::fabs(xi) + std::fabs(xj)) * (magnify * 2.4e-7f);
      const float off_y = (std::fabs(yi) + std::fabs(yj)) * (magnify * 2.4e-7f);
      x_lo = lesser(x_lo, passes ? x - off_x : kFar);
      x_hi = greater(x_hi, passes ? x + off_x : -kFar);
      y_lo = lesser(y_lo, passes ? y - off_y : kFar);
      y_hi = greater(y_hi, passes ? y + off_y : -kFar);
    };
    cut(w0, x0, y0, w1, x1, y1);
    cut(w1, x1, y1, w2, x2, y2);
    cut(w2, x2, y2, w0, x0, y0);
    x_lo = x_lo * p.scale_u + p.offset_u - kSlack;
    x_hi = x_hi * p.scale_u + p.offset_u + kSlack;
    y_lo = y_lo * p.scale_v + p.offset_v - kSlack;
    y_hi = y_hi * p.scale_v + p.offset_v + kSlack;
    // From -1 up: ceil(x) is 1 + the number of points below x, as truncation of what is positive. The clamps
    // keep the conversions defined, a NaN becomes an end of the range.
    const int32_t column0 = int32_t(p.n) - int32_t(top - lesser(greater(x_lo, 0.0f), top));
    const int32_t column1 = int32_t(lesser(greater(x_hi, -1.0f), top - 1.0f) + 1.0f);
    const int32_t row0 = int32_t(p.n) - int32_t(top - lesser(greater(y_lo, 0.0f), top));
    const int32_t row1 = int32_t(lesser(greater(y_hi, -1.0f), top - 1.0f) + 1.0f);
    const bool any = (column0 < column1) & (row0 < row1);
    const uint32_t cells =
        uint32_t(column0) | uint32_t(column1) << 8 | uint32_t(row0) << 16 | uint32_t(row1) << 24;
    covered[k] = any ? cells : 0u;
  }
}

// A triangle as seen from the origin, for the rays from there.
struct Seen {
  float edge[3][3];  // a ray passes the edge on the side of the sign of its product with this
  float normal[3];
  float distance;  // of the plane from the origin, in lengths of the normal
  float t_lo, t_hi;
  uint32_t record;
};

// The rays' hits so far, by patch: an array each.
struct Lists {
  float* t;
  uint32_t* records;
};

LSP_CLONES void test(const Seen& s, size_t begin, size_t end, const float* x, const float* y, const float* z,
                     const Lists& lists) {
  float* const t = lists.t;
  uint32_t* const records = lists.records;
  for (size_t i = begin; i < end; ++i) {
    const float e0 = x[i] * s.edge[0][0] + y[i] * s.edge[0][1] + z[i] * s.edge[0][2];
    const float e1 = x[i] * s.edge[1][0] + y[i] * s.edge[1][1] + z[i] * s.edge[1][2];
    const float e2 = x[i] * s.edge[2][0] + y[i] * s.edge[2][1] + z[i] * s.edge[2][2];
    const float lowest = lesser(lesser(e0, e1), e2), highest = greater(greater(e0, e1), e2);
    float depth = s.distance / (x[i] * s.normal[0] + y[i] * s.normal[1] + z[i] * s.normal[2]);
    depth = depth < s.t_lo ? s.t_lo : depth;
    depth = depth > s.t_hi ? s.t_hi : depth;
    const bool inside = (lowest >= 0.0f) | (highest <= 0.0f);
    const bool facing = lowest != highest;
    const bool hit = inside & facing & (depth > kNearest) & (depth < ShaftRaster::kMiss);
    const bool nearer = hit & ((depth < t[i]) | ((depth == t[i]) & (s.record < records[i])));
    t[i] = nearer ? depth : t[i];
    records[i] = nearer ? s.record : records[i];
  }
}

}  // namespace

ShaftRaster::ShaftRaster(const glm::vec3& lo, const glm::vec3& hi, uint32_t resolution)
    : lo_(lo), hi_(hi), n_(resolution) {
  for (auto& axis : directions_) axis.resize(size_t(n_) * n_);
}

void ShaftRaster::add(const LspTriangle& triangle, uint32_t record) {
  const lsp_float3* corners[] = {&triangle.v0, &triangle.v1, &triangle.v2};
  for (int i = 0; i < 3; ++i) {
    corners_[3 * i].push_back(corners[i]->x);
    corners_[3 * i + 1].push_back(corners[i]->y);
    corners_[3 * i + 2].push_back(corners[i]->z);
  }
  records_.push_back(record);
}

void ShaftRaster::cast(const glm::vec3& origin, uint32_t face, float x, float y,
                       std::span<const glm::vec3> ends, const RasterHits& hits) {
  std::fill(hits.t.begin(), hits.t.end(), kMiss);
  std::fill(hits.records.begin(), hits.records.end(), LSP_NONE);
  const size_t count = size();
  const int axis = int(face / 2), u = axis == 0 ? 1 : 0, v = axis == 2 ? 1 : 2;
  const float end = face % 2 ? hi_[axis] : lo_[axis];
  Projection p;
  p.sign = face % 2 ? 1.0f : -1.0f;
  p.plane = p.sign * (end - origin[axis]);
  if (!(p.plane > 0.0f)) return;
  const int order[] = {axis, u, v};
  for (int i = 0; i < 3; ++i) p.origin[i] = origin[order[i]];
  p.n = int(n_);
  p.scale_u = float(n_) / (hi_[u] - lo_[u]);
  p.scale_v = float(n_) / (hi_[v] - lo_[v]);
  p.offset_u = (origin[u] - lo_[u]) * p.scale_u - x;
  p.offset_v = (origin[v] - lo_[v]) * p.scale_v - y;
  const float* corners[9];
  for (int i = 0; i < 9; ++i) corners[i] = corners_[i / 3 * 3 + order[i % 3]].data();
  covered_.resize(count);
  project(p, count, corners, covered_.data());

  const Lists lists = {hits.t.data(), hits.records.data()};
  for (size_t i = 0; i < ends.size(); ++i)
    for (int j = 0; j < 3; ++j) directions_[j][i] = ends[i][j] - origin[j];
  for (size_t k = 0; k < count; ++k) {
    const uint32_t cells = covered_[k];
    if (cells == 0) continue;
    glm::vec3 corner[3], from_origin[3];
    for (int i = 0; i < 3; ++i) {
      corner[i] = {corners_[3 * i][k], corners_[3 * i + 1][k], corners_[3 * i + 2][k]};
      from_origin[i] = corner[i] - origin;
    }
    const auto &a = from_origin[0], &b = from_origin[1], &c = from_origin[2];
    const glm::vec3 edges[] = {glm::cross(c, b), glm::cross(a, c), glm::cross(b, a)};
    const glm::vec3 normal = glm::cross(corner[1] - corner[0], corner[2] - corner[0]);
    Seen seen;
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) seen.edge[i][j] = edges[i][j];
      seen.normal[i] = normal[i];
    }
    seen.distance = glm::dot(normal, a);
    const float w[] = {p.sign * a[axis], p.sign * b[axis], p.sign * c[axis]};
    seen.t_lo = std::min({w[0], w[1], w[2]}) / p.plane;
    seen.t_hi = std::max({w[0], w[1], w[2]}) / p.plane;
    seen.record = records_[k];
    const uint32_t column0 = cells & 0xFF, column1 = cells >> 8 & 0xFF, row0 = cells >> 16 & 0xFF,
                   row1 = cells >> 24;
    const bool wide = column1 - column0 == n_;  // then the rows are one run of patches
    for (uint32_t row = row0; row < row1; row = wide ? row1 : row + 1)
      test(seen, size_t(row) * n_ + column0, size_t(wide ? row1 - 1 : row) * n_ + column1,
           directions_[0].data(), directions_[1].data(), directions_[2].data(), lists);
  }
}

}  // namespace lsp
