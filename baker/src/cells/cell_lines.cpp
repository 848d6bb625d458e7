#include "cell_lines.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>

#include "../box4.h"
#include "../clones.h"
#include "../vectors.h"
#include "clip.h"
#include "shaft_hull.h"

namespace lsp {
namespace {

constexpr size_t kMost = CellLines::kMost, kTriangles = CellLines::kTriangles;
// Hits are looked for from this share of the way on.
constexpr float kNearest = 1e-4f;

using Lane = CellLines::Lane;
using Numbers = std::array<uint32_t, kTriangles>;

// Not std::min and std::max: compilers keep their branches, and a loop with branches is not vectorised.
constexpr float lesser(float a, float b) { return b < a ? b : a; }
constexpr float greater(float a, float b) { return a < b ? b : a; }

// From one point, of another side than that of their ends.
struct Lines {
  glm::vec3 origin;
  std::array<std::array<float, kMost>, 3> way;  // from there to the end
  size_t count;
  int axis;           // across the side of their ends
  float sign, plane;  // their way along it: sign * plane
};

// A block's triangles as seen from the origin of lines: a line passes an edge on the side of the sign of its
// product with this.
struct Seen {
  std::array<std::array<Lane, 3>, 3> edge;
  Lane distance;  // of the plane, in lengths of the normal
  Lane t_lo, t_hi;
};

// The hits of a line so far, by lane of the blocks.
struct Found {
  Lane t_first, t_last;
  Numbers first, last;
};

// By box: the lines that enter it, a bit each. Boxes are larger than their content by more than rounding.
[[gnu::always_inline]] inline void enter(const CellLines::Boxes& boxes, const Lines& lines,
                                         const std::array<std::array<float, kMost>, 3>& per_way,
                                         Numbers& entered) {
  std::array<Lane, 3> lo, hi;
  for (size_t k = 0; k < 3; ++k) {
    const float origin = lines.origin[int(k)];
    for (size_t i = 0; i < kTriangles; ++i) {
      lo[k][i] = boxes.lo[k][i] - origin;
      hi[k][i] = boxes.hi[k][i] - origin;
    }
  }
  entered.fill(0);
  for (size_t line = 0; line < lines.count; ++line) {
    const float x = per_way[0][line], y = per_way[1][line], z = per_way[2][line];
    for (size_t i = 0; i < kTriangles; ++i) {
      const float ax = lo[0][i] * x, bx = hi[0][i] * x, ay = lo[1][i] * y, by = hi[1][i] * y;
      const float az = lo[2][i] * z, bz = hi[2][i] * z;
      float begin = 0, end = 1;
      begin = greater(begin, lesser(ax, bx));
      end = lesser(end, greater(ax, bx));
      begin = greater(begin, lesser(ay, by));
      end = lesser(end, greater(ay, by));
      begin = greater(begin, lesser(az, bz));
      end = lesser(end, greater(az, bz));
      entered[i] |= uint32_t(begin <= end) << line;
    }
  }
}

[[gnu::always_inline]] inline void look(const CellLines::Block& block, const Lines& lines, Seen& seen) {
  const glm::vec3 o = lines.origin;
  const size_t axis = size_t(lines.axis);
  const auto& c = block.corners;
  for (size_t i = 0; i < kTriangles; ++i) {
    const float ax = c[0][i] - o.x, ay = c[1][i] - o.y, az = c[2][i] - o.z;
    const float bx = c[3][i] - o.x, by = c[4][i] - o.y, bz = c[5][i] - o.z;
    const float cx = c[6][i] - o.x, cy = c[7][i] - o.y, cz = c[8][i] - o.z;
    seen.edge[0][0][i] = cy * bz - by * cz;
    seen.edge[0][1][i] = cz * bx - bz * cx;
    seen.edge[0][2][i] = cx * by - bx * cy;
    seen.edge[1][0][i] = ay * cz - cy * az;
    seen.edge[1][1][i] = az * cx - cz * ax;
    seen.edge[1][2][i] = ax * cy - cx * ay;
    seen.edge[2][0][i] = by * az - ay * bz;
    seen.edge[2][1][i] = bz * ax - az * bx;
    seen.edge[2][2][i] = bx * ay - ax * by;
    seen.distance[i] = block.normal[0][i] * ax + block.normal[1][i] * ay + block.normal[2][i] * az;
  }
  const float at = o[lines.axis], sign = lines.sign, plane = lines.plane;
  const Lane a = c[axis], b = c[axis + 3], d = c[axis + 6];
  for (size_t i = 0; i < kTriangles; ++i) {
    const float wa = sign * (a[i] - at), wb = sign * (b[i] - at), wd = sign * (d[i] - at);
    seen.t_lo[i] = lesser(lesser(wa, wb), wd) / plane;
    seen.t_hi[i] = greater(greater(wa, wb), wd) / plane;
  }
}

[[gnu::always_inline]] inline void test(const CellLines::Block& block, const Seen& s, float x, float y,
                                        float z, Found& found) {
  for (size_t i = 0; i < kTriangles; ++i) {
    const float e0 = x * s.edge[0][0][i] + y * s.edge[0][1][i] + z * s.edge[0][2][i];
    const float e1 = x * s.edge[1][0][i] + y * s.edge[1][1][i] + z * s.edge[1][2][i];
    const float e2 = x * s.edge[2][0][i] + y * s.edge[2][1][i] + z * s.edge[2][2][i];
    const float lowest = lesser(lesser(e0, e1), e2), highest = greater(greater(e0, e1), e2);
    const float along = x * block.normal[0][i] + y * block.normal[1][i] + z * block.normal[2][i];
    float depth = s.distance[i] / along;
    depth = depth < s.t_lo[i] ? s.t_lo[i] : depth;
    depth = depth > s.t_hi[i] ? s.t_hi[i] : depth;
    const uint32_t number = block.number[i];
    const float t_first = found.t_first[i], t_last = found.t_last[i];
    const uint32_t first = found.first[i], last = found.last[i];
    const bool inside = (lowest >= 0.0f) | (highest <= 0.0f);
    const bool facing = lowest != highest;
    const bool hit = inside & facing & (depth > kNearest) & (depth < CellLines::kMiss);
    const bool nearer = hit & ((depth < t_first) | ((depth == t_first) & (number < first)));
    const bool farther = hit & ((depth > t_last) | ((depth == t_last) & (number < last)));
    found.t_first[i] = nearer ? depth : t_first;
    found.first[i] = nearer ? number : first;
    found.t_last[i] = farther ? depth : t_last;
    found.last[i] = farther ? number : last;
  }
}

// Of equal hits that of the smallest number; LSP_NONE, which is -1 here, where nothing is hit.
[[gnu::always_inline]] inline int32_t least_number(const Lane& t, const Numbers& numbers, float best) {
  Int4 least = Int4{} + INT32_MAX;
  for (size_t i = 0; i < kTriangles; i += 4) {
    Float4 at;
    Int4 number;
    std::memcpy(&at, &t[i], sizeof at);
    std::memcpy(&number, &numbers[i], sizeof number);
    number = at == best ? number : least;
    least = number < least ? number : least;
  }
  return std::min(std::min(least[0], least[1]), std::min(least[2], least[3]));
}

// What counts of all lanes, into the first.
[[gnu::always_inline]] inline void gather(Found& f) {
  Float4 first = Float4{} + CellLines::kMiss, last = Float4{};
  for (size_t i = 0; i < kTriangles; i += 4) {
    Float4 t;
    std::memcpy(&t, &f.t_first[i], sizeof t);
    first = lsp::lesser(first, t);
    std::memcpy(&t, &f.t_last[i], sizeof t);
    last = lsp::greater(last, t);
  }
  const float t_first = lesser(lesser(first[0], first[1]), lesser(first[2], first[3]));
  const float t_last = greater(greater(last[0], last[1]), greater(last[2], last[3]));
  f.first[0] = uint32_t(least_number(f.t_first, f.first, t_first));
  f.last[0] = uint32_t(least_number(f.t_last, f.last, t_last));
  f.t_first[0] = t_first;
  f.t_last[0] = t_last;
}

// Fills in `found` of the lines whose bits it returns: they entered a block.
LSP_CLONES uint32_t cast_all(std::span<const CellLines::Block* const> blocks,
                             std::span<const CellLines::Boxes> boxes, const Lines& lines,
                             std::array<Found, kMost>& found) {
  std::array<std::array<float, kMost>, 3> per_way;
  for (size_t k = 0; k < 3; ++k)
    for (size_t i = 0; i < kMost; ++i) per_way[k][i] = 1.0f / lines.way[k][i];
  uint32_t begun = 0;
  Seen seen;
  Numbers entered;
  for (size_t number = 0; number < blocks.size(); ++number) {
    if (number % kTriangles == 0) enter(boxes[number / kTriangles], lines, per_way, entered);
    const uint32_t bits = entered[number % kTriangles];
    if (bits == 0) continue;
    const CellLines::Block& block = *blocks[number];
    look(block, lines, seen);
    for (uint32_t rest = bits; rest != 0; rest &= rest - 1) {
      const auto i = size_t(std::countr_zero(rest));
      Found& f = found[i];
      if ((begun >> i & 1u) == 0) {
        f.t_first.fill(CellLines::kMiss);
        f.t_last.fill(0.0f);
        f.first.fill(LSP_NONE);
        f.last.fill(LSP_NONE);
      }
      test(block, seen, lines.way[0][i], lines.way[1][i], lines.way[2][i], f);
    }
    begun |= bits;
  }
  for (uint32_t rest = begun; rest != 0; rest &= rest - 1) gather(found[size_t(std::countr_zero(rest))]);
  return begun;
}

// What of a triangle lies in a box, or where rounding leaves nothing, what of its own box does.
Box bounds_within(const LspTriangle& t, const Box& within) {
  Box box;
  const Polygon p = clip(t, within.lo, within.hi);
  for (int i = 0; i < p.count; ++i) box.grow(p.corner[i]);
  if (p.count > 0) return box;
  for (const lsp_float3& v : {t.v0, t.v1, t.v2}) box.grow(vec(v));
  return intersection(box, within);
}

}  // namespace

CellLines::CellLines(std::span<const LspTriangle> triangles, std::span<const uint32_t> records,
                     const Box& box, float margin)
    : box_(box), blocks_((records.size() + kTriangles - 1) / kTriangles) {
  const Box within = {box.lo - margin, box.hi + margin};
  for (size_t i = 0; i < blocks_.size() * kTriangles; ++i) {
    Block& block = blocks_[i / kTriangles];
    const size_t lane = i % kTriangles, last = records.size() - 1;
    const LspTriangle& t = triangles[records[std::min(i, last)]];
    // Lanes behind the last triangle hold a point, which nothing hits.
    const glm::vec3 a = vec(t.v0), b = i > last ? a : vec(t.v1), c = i > last ? a : vec(t.v2);
    const glm::vec3 normal = glm::cross(b - a, c - a);
    for (int k = 0; k < 3; ++k) {
      block.corners[size_t(k)][lane] = a[k];
      block.corners[size_t(k) + 3][lane] = b[k];
      block.corners[size_t(k) + 6][lane] = c[k];
      block.normal[size_t(k)][lane] = normal[k];
    }
    block.number[lane] = i > last ? LSP_NONE : uint32_t(i);
    if (i <= last) block.box.grow(bounds_within(t, within));
  }
  for (Block& block : blocks_) block.box = {block.box.lo - margin, block.box.hi + margin};
}

void CellLines::aim(const Box& from, uint32_t face) {
  face_ = face;
  Box to = box_;
  const int axis = int(face / 2);
  (face % 2 ? to.lo : to.hi)[axis] = (face % 2 ? box_.hi : box_.lo)[axis];
  const std::vector<HalfSpace> hull = shaft_hull(from, to);
  aimed_.clear();
  boxes_.clear();
  for (const Block& block : blocks_) {
    const glm::vec3 centre = block.box.centre(), half = 0.5f * block.box.extent();
    if (std::none_of(hull.begin(), hull.end(), [&](const HalfSpace& h) {
          return glm::dot(h.normal, centre) - glm::dot(glm::abs(h.normal), half) > h.distance;
        }))
      add_aimed(block);
  }
}

void CellLines::add_aimed(const Block& block) {
  const size_t at = aimed_.size() % kTriangles;
  if (at == 0) boxes_.emplace_back();
  for (int k = 0; k < 3; ++k) {
    boxes_.back().lo[size_t(k)][at] = block.box.lo[k];
    boxes_.back().hi[size_t(k)][at] = block.box.hi[k];
  }
  aimed_.push_back(&block);
}

void CellLines::cast(const glm::vec3& origin, std::span<const glm::vec3> ends, Hits& first,
                     Hits& last) const {
  first.t.fill(kMiss);
  last.t.fill(0.0f);
  first.triangle.fill(LSP_NONE);
  last.triangle.fill(LSP_NONE);
  Lines lines;
  lines.origin = origin;
  lines.count = ends.size();
  lines.axis = int(face_ / 2);
  lines.sign = face_ % 2 ? 1.0f : -1.0f;
  lines.plane = lines.sign * ((face_ % 2 ? box_.hi : box_.lo)[lines.axis] - origin[lines.axis]);
  if (aimed_.empty() || !(lines.plane > 0.0f)) return;
  for (size_t i = 0; i < kMost; ++i)
    for (int k = 0; k < 3; ++k) lines.way[size_t(k)][i] = ends[std::min(i, ends.size() - 1)][k] - origin[k];
  std::array<Found, kMost> found;
  const uint32_t begun = cast_all(aimed_, boxes_, lines, found);
  for (size_t i = 0; i < ends.size(); ++i) {
    if ((begun >> i & 1u) == 0) continue;
    first.t[i] = found[i].t_first[0];
    first.triangle[i] = found[i].first[0];
    last.t[i] = found[i].t_last[0];
    last.triangle[i] = found[i].last[0];
  }
}

}  // namespace lsp
