#include "near_rays.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "../clones.h"

namespace lsp {
namespace {

constexpr size_t kMost = NearRays::kMost;
using Floats = NearRays::Floats;

// Where on which piece of the surface rays begin, and numbers for their directions.
struct Starts {
  std::array<Floats, 5> numbers;
  std::array<Floats, 3> a, b, c, normal;  // the piece's; the normal on the side of the ray
};

// Of a direction about a normal: a point of the unit circle at `b` in [0, 1) turns, by polynomials, for a
// library's sine may differ between machines; and from the square of its sine, `a`, that and its cosine.
struct Turn {
  float x, y, radius, height;
};
[[gnu::always_inline]] inline Turn turn(float a, float b) {
  const auto quarter = int32_t(4 * b);
  const float x = (4 * b - float(quarter) - 0.5f) * 1.57079633f, x2 = x * x;
  const float s = x * (1 - x2 * (1 / 6.0f - x2 * (1 / 120.0f - x2 / 5040)));
  const float c = 1 - x2 * (0.5f - x2 * (1 / 24.0f - x2 * (1 / 720.0f)));
  const bool odd = (quarter & 1) != 0;
  const float first = odd ? s : c, second = odd ? c : s;
  const float rest = 1 - a;
  return {((quarter == 1) | (quarter == 2)) ? -first : first, quarter >= 2 ? -second : second, std::sqrt(a),
          std::sqrt(rest > 0.0f ? rest : 0.0f)};
}

// The place of a coordinate in a row of patches, from 0 to their number.
[[gnu::always_inline]] inline float along_patches(float x, float size, float patches) {
  const float q = x / size * patches, low = q < 0.0f ? 0.0f : q;
  return patches < low ? patches : low;
}

// Directions are cosine-distributed about the normals (Duff et al., "Building an Orthonormal Basis,
// Revisited", 2017).
LSP_CLONES void set_out(const SubCell& cell, const Starts& s, NearRays& rays, std::array<Floats, 3>& ways) {
  const float offset = cell.offset;
  for (size_t i = 0; i < kMost; ++i) {
    const float root = std::sqrt(s.numbers[1][i]);
    const float w1 = root * (1 - s.numbers[2][i]), w2 = root * s.numbers[2][i];
    for (size_t k = 0; k < 3; ++k)
      rays.origin[k][i] =
          s.a[k][i] + (s.b[k][i] - s.a[k][i]) * w1 + (s.c[k][i] - s.a[k][i]) * w2 + s.normal[k][i] * offset;
  }
  for (size_t i = 0; i < kMost; ++i) {
    const float nx = s.normal[0][i], ny = s.normal[1][i], nz = s.normal[2][i];
    const float sign = nz >= 0 ? 1.0f : -1.0f, p = -1 / (sign + nz), q = nx * ny * p;
    const Turn t = turn(s.numbers[3][i], s.numbers[4][i]);
    const float u = t.radius * t.x, v = t.radius * t.y;
    ways[0][i] = (1 + sign * nx * nx * p) * u + q * v + nx * t.height;
    ways[1][i] = sign * q * u + (sign + ny * ny * p) * v + ny * t.height;
    ways[2][i] = -sign * nx * u + -ny * v + nz * t.height;
  }
}

// Where the rays leave the cell.
LSP_CLONES void leave(const SubCell& cell, const std::array<Floats, 3>& ways, NearRays& rays) {
  const float size = cell.cell_size, lo_x = cell.cell_lo.x, lo_y = cell.cell_lo.y, lo_z = cell.cell_lo.z;
  const float patches = float(cell.patches);
  const auto most = int32_t(cell.patches) - 1, m = int32_t(cell.patches);
  for (size_t i = 0; i < kMost; ++i) {
    const float x = ways[0][i], y = ways[1][i], z = ways[2][i];
    const float ox = rays.origin[0][i], oy = rays.origin[1][i], oz = rays.origin[2][i];
    const float tx = ((x > 0 ? lo_x + size : lo_x) - ox) / x;
    const float ty = ((y > 0 ? lo_y + size : lo_y) - oy) / y;
    const float tz = ((z > 0 ? lo_z + size : lo_z) - oz) / z;
    constexpr float kInfinity = std::numeric_limits<float>::infinity();
    float way = ((x != 0) & (tx < kInfinity)) ? tx : kInfinity;
    const bool by_y = (y != 0) & (ty < way);
    way = by_y ? ty : way;
    const bool by_z = (z != 0) & (tz < way);
    way = by_z ? tz : way;
    const bool leaves = (way > 0) & (way < kInfinity);
    way = leaves ? way : 0.0f;
    const float wx = x * way, wy = y * way, wz = z * way;
    rays.way[0][i] = wx;
    rays.way[1][i] = wy;
    rays.way[2][i] = wz;
    // Sides are 0 and 1 across x, 2 and 3 across y; patches go along the other two axes, in order.
    const float on_x = ox + wx - lo_x, on_y = oy + wy - lo_y, on_z = oz + wz - lo_z;
    const float across = by_z ? z : by_y ? y : x;
    const int32_t face = (by_z ? 4 : by_y ? 2 : 0) + (across > 0 ? 1 : 0);
    const float u = along_patches((by_z | by_y) ? on_x : on_y, size, patches);
    const float v = along_patches(by_z ? on_y : on_z, size, patches);
    const int32_t in_u = int32_t(u), in_v = int32_t(v);
    const int32_t column = in_u < most ? in_u : most, row = in_v < most ? in_v : most;
    rays.place[3][i] = 2 * (u - float(column)) - 1;
    rays.place[4][i] = 2 * (v - float(row)) - 1;
    rays.entry[i] = leaves ? uint32_t(face * m * m + column + m * row) : NearRays::kNone;
  }
  const float per_half = 2 / cell.edge;
  for (size_t k = 0; k < 3; ++k) {
    const float lo = cell.lo[int(k)];
    for (size_t i = 0; i < kMost; ++i) rays.place[k][i] = (rays.origin[k][i] - lo) * per_half - 1.0f;
  }
}

}  // namespace

void NearRays::make(const Surface& surface, const Sequence<5>& sequence, uint32_t first,
                    const SubCell& cell) {
  Starts s;
  for (size_t i = 0; i < kMost; ++i) {
    const std::array<float, 5> numbers = sequence(first + uint32_t(i));
    for (size_t k = 0; k < 5; ++k) s.numbers[k][i] = numbers[k];
  }
  for (size_t i = 0; i < kMost; ++i) {
    const float wanted = s.numbers[0][i] * surface.area.back();
    const size_t piece = std::min(
        size_t(std::upper_bound(surface.area.begin(), surface.area.end(), wanted) - surface.area.begin()),
        surface.area.size() - 1);
    const auto& [a, b, c] = surface.pieces[piece];
    const glm::vec3 normal = (first + i) % 2 != 0 ? -surface.normals[piece] : surface.normals[piece];
    for (int k = 0; k < 3; ++k) {
      s.a[size_t(k)][i] = a[k];
      s.b[size_t(k)][i] = b[k];
      s.c[size_t(k)][i] = c[k];
      s.normal[size_t(k)][i] = normal[k];
    }
  }
  std::array<Floats, 3> ways;
  set_out(cell, s, *this, ways);
  leave(cell, ways, *this);
}

}  // namespace lsp
