// Triangles across lanes: for trace_wide_lanes.cpp, four of a leaf at a time, and wide_calls-inl.h, one of
// every ray. The test is lsp_triangle (lsp/traverse.h), operation by operation: a lane has the bits of a
// single triangle.
#if defined(LSP_WIDE_TRIANGLES_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef LSP_WIDE_TRIANGLES_INL_H
#undef LSP_WIDE_TRIANGLES_INL_H
#else
#define LSP_WIDE_TRIANGLES_INL_H
#endif

#include <hwy/highway.h>
#include <bit>
#include <cmath>

#include "trace_subset.h"

HWY_BEFORE_NAMESPACE();
namespace lsp {
namespace HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;
using namespace subset;

constexpr size_t kLeafLanes = 4;
using D4 = hn::CappedTag<float, kLeafLanes>;
using V4 = hn::Vec<D4>;
using M4 = hn::Mask<D4>;
constexpr D4 d4;

template <class D>
HWY_INLINE uint32_t mask_bits(D d, hn::Mask<D> mask) {
  uint8_t bytes[8] = {};
  hn::StoreMaskBits(d, mask, bytes);
  return bytes[0];
}

// lsp_min and lsp_max, of a NaN as well: x86 takes the second where neither is less.
template <class V>
HWY_INLINE V min_of(V a, V b) {
#if HWY_ARCH_X86
  return hn::Min(b, a);
#else
  return hn::IfThenElse(hn::Lt(b, a), b, a);
#endif
}
template <class V>
HWY_INLINE V max_of(V a, V b) {
#if HWY_ARCH_X86
  return hn::Max(b, a);
#else
  return hn::IfThenElse(hn::Lt(a, b), b, a);
#endif
}

// A point or vector a lane.
template <class D>
struct Points {
  hn::Vec<D> x, y, z;
};
template <class D>
HWY_INLINE Points<D> minus(const Points<D>& a, const Points<D>& b) {
  return {hn::Sub(a.x, b.x), hn::Sub(a.y, b.y), hn::Sub(a.z, b.z)};
}
template <class D>
HWY_INLINE Points<D> plus(const Points<D>& a, const Points<D>& b) {
  return {hn::Add(a.x, b.x), hn::Add(a.y, b.y), hn::Add(a.z, b.z)};
}
template <class D>
HWY_INLINE Points<D> cross(const Points<D>& a, const Points<D>& b) {
  return {hn::Sub(hn::Mul(a.y, b.z), hn::Mul(a.z, b.y)), hn::Sub(hn::Mul(a.z, b.x), hn::Mul(a.x, b.z)),
          hn::Sub(hn::Mul(a.x, b.y), hn::Mul(a.y, b.x))};
}
template <class D>
HWY_INLINE Points<D> times(const Points<D>& a, hn::Vec<D> b) {
  return {hn::Mul(a.x, b), hn::Mul(a.y, b), hn::Mul(a.z, b)};
}
template <class D>
HWY_INLINE Points<D> select(hn::Mask<D> m, const Points<D>& a, const Points<D>& b) {
  return {hn::IfThenElse(m, a.x, b.x), hn::IfThenElse(m, a.y, b.y), hn::IfThenElse(m, a.z, b.z)};
}
template <class D>
HWY_INLINE hn::Vec<D> dot(const Points<D>& a, const Points<D>& b) {
  return hn::Add(hn::Add(hn::Mul(a.x, b.x), hn::Mul(a.y, b.y)), hn::Mul(a.z, b.z));
}
template <class D>
HWY_INLINE hn::Vec<D> least(const Points<D>& a) {
  return min_of(min_of(a.x, a.y), a.z);
}
template <class D>
HWY_INLINE hn::Vec<D> greatest(const Points<D>& a) {
  return max_of(max_of(a.x, a.y), a.z);
}
template <class D>
HWY_INLINE hn::Vec<D> largest(const Points<D>& a) {
  return max_of(max_of(hn::Abs(a.x), hn::Abs(a.y)), hn::Abs(a.z));
}

// What a ray has hit so far: LspBest (lsp/traverse.h), and of an exact hit the weights of corners 1 and 2.
struct Best {
  float t, u, v;
  uint32_t triangle, primitive, flags;
};

// Lines of rays, and triangles that they pass through: lsp_triangle up to the determinant.
template <class D>
struct Passages {
  Points<D> x, y;  // the corners', seen along the ray
  hn::Vec<D> v, w, det;
  hn::Mask<D> met;
};
template <class D>
HWY_INLINE Passages<D> pass(const Points<D>& a, const Points<D>& b, const Points<D>& c, hn::Vec<D> shear_x,
                            hn::Vec<D> shear_y) {
  using V = hn::Vec<D>;
  using M = hn::Mask<D>;
  const D d;
  const auto seen = [&](V i, V shear, V z) HWY_ATTR { return hn::Sub(i, hn::Mul(shear, z)); };
  const Points<D> x = {seen(a.x, shear_x, a.z), seen(b.x, shear_x, b.z), seen(c.x, shear_x, c.z)};
  const Points<D> y = {seen(a.y, shear_y, a.z), seen(b.y, shear_y, b.z), seen(c.y, shear_y, c.z)};
  const V u = hn::Sub(hn::Mul(x.z, y.y), hn::Mul(y.z, x.y));
  const V v = hn::Sub(hn::Mul(x.x, y.z), hn::Mul(y.x, x.z));
  const V w = hn::Sub(hn::Mul(x.y, y.x), hn::Mul(y.y, x.x));
  const V zero = hn::Zero(d), det = hn::Add(hn::Add(u, v), w);
  // Of a NaN among them the determinant is one.
  const M below = hn::Lt(hn::Min(hn::Min(u, v), w), zero), above = hn::Gt(hn::Max(hn::Max(u, v), w), zero);
  // Finite and not zero; no number is neither less.
  const M sound = hn::And(hn::Lt(hn::Abs(det), hn::Set(d, HUGE_VALF)), hn::Gt(hn::Abs(det), zero));
  const auto beside = [&](const Points<D>& p)
                          HWY_ATTR { return hn::Or(hn::Gt(least(p), zero), hn::Lt(greatest(p), zero)); };
  const M outside = hn::Or(hn::And(below, above), hn::Or(beside(x), beside(y)));
  return {x, y, v, w, det, hn::AndNot(outside, sound)};
}

// lsp_crossings, held between lo and hi.
template <class D>
HWY_INLINE void narrow(hn::Vec<D>& lo, hn::Vec<D>& hi, const Points<D>& q, const Points<D>& z) {
  using V = hn::Vec<D>;
  using M = hn::Mask<D>;
  const D d;
  const V zero = hn::Zero(d);
  const M none_above = hn::Le(greatest(q), zero);
  const auto is_above = [&](V i) HWY_ATTR {
    return hn::Or(hn::Gt(i, zero), hn::And(none_above, hn::Eq(i, zero)));
  };
  const M x = is_above(q.x), y = is_above(q.y), w = is_above(q.z);
  const M not_x = hn::Xor(y, w), not_y = hn::Xor(x, w);
  const auto from_lone = [&](const Points<D>& i) HWY_ATTR {
    return select<D>(not_x, select<D>(not_y, {i.z, i.x, i.y}, {i.y, i.z, i.x}), i);
  };
  const Points<D> p = from_lone(q), at = from_lone(z);
  const auto crossing = [&](V other, V at_other) HWY_ATTR {
    return hn::Add(at.x, hn::Mul(hn::Sub(at_other, at.x), hn::Div(p.x, hn::Sub(p.x, other))));
  };
  const V one = crossing(p.y, at.y), two = crossing(p.z, at.z);
  lo = max_of(min_of(one, two), lo);
  hi = min_of(max_of(one, two), hi);
}

constexpr float kEdgeOn = 0.015625f;  // LSP_EDGE_ON, which is not known yet

// lsp_plane_depth of those that are met; the scaled normal times the direction goes to *across.
template <class D>
HWY_INLINE hn::Vec<D> plane_depth(const Points<D>& direction, hn::Vec<D> shear_z, const Points<D>& a,
                                  const Points<D>& b, const Points<D>& c, const Passages<D>& passes,
                                  hn::Vec<D>* across = nullptr) {
  using V = hn::Vec<D>;
  using M = hn::Mask<D>;
  const D d;
  const hn::RebindToUnsigned<D> du;
  const Points<D> ab = minus(b, a), bc = minus(c, b), ca = minus(a, c);
  const V length_ab = largest(ab), length_bc = largest(bc), length_ca = largest(ca);
  const M at_a = hn::And(hn::Ge(length_bc, length_ab), hn::Ge(length_bc, length_ca));
  const M at_b = hn::Ge(length_ca, length_ab);
  const Points<D> p = select<D>(at_a, a, select<D>(at_b, b, c));
  const Points<D> e = select<D>(at_a, ab, select<D>(at_b, bc, ca));
  const Points<D> f = select<D>(at_a, ca, select<D>(at_b, ab, bc));
  const auto longest = hn::BitCast(du, max_of(max_of(length_ab, length_bc), length_ca));
  const auto exponent =
      hn::Min(hn::Max(hn::ShiftRight<23>(longest), hn::Set(du, uint32_t{1})), hn::Set(du, uint32_t{253}));
  const V shrink = hn::BitCast(d, hn::ShiftLeft<23>(hn::Sub(hn::Set(du, uint32_t{254}), exponent)));
  const Points<D> g = times<D>(e, shrink), h = times<D>(f, shrink);
  const Points<D> n = cross(g, h);
  const V slope = dot(n, direction);
  if (across != nullptr) *across = slope;
  const V t = hn::Div(dot(n, p), slope);
  const Points<D> z = {hn::Mul(a.z, shear_z), hn::Mul(b.z, shear_z), hn::Mul(c.z, shear_z)};
  V lo = least(z), hi = greatest(z);
  const M edge_on = hn::And(passes.met, hn::Lt(hn::Abs(slope), hn::Set(d, kEdgeOn)));
  if (!hn::AllFalse(d, edge_on)) [[unlikely]] {
    const auto extent = [](const Points<D>& i) HWY_ATTR { return hn::Sub(greatest(i), least(i)); };
    const Points<D> q = select<D>(hn::Ge(extent(passes.x), extent(passes.y)), passes.x, passes.y);
    V edges_lo = lo, edges_hi = hi;
    narrow<D>(edges_lo, edges_hi, q, z);
    lo = hn::IfThenElse(edge_on, edges_lo, lo);
    hi = hn::IfThenElse(edge_on, edges_hi, hi);
  }
  return min_of(hi, max_of(lo, t));
}

using P4 = Points<D4>;

// Bytes of a corner whose axes are rotated so that the ray's comes last: lsp_rotate.
alignas(16) constexpr uint8_t kRotations[3][16] = {
    {4, 5, 6, 7, 8, 9, 10, 11, 0, 1, 2, 3, 12, 13, 14, 15},
    {8, 9, 10, 11, 0, 1, 2, 3, 4, 5, 6, 7, 12, 13, 14, 15},
    {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15},
};
using Bytes = hn::Vec<hn::Repartition<uint8_t, D4>>;
HWY_INLINE V4 rotated(V4 v, Bytes by) {
  return hn::BitCast(d4, hn::TableLookupBytes(hn::BitCast(hn::Repartition<uint8_t, D4>(), v), by));
}

// A ray as triangles take it, its axis last.
struct RayRows {
  const float *origin, *shear, *direction;
  float tmin;
  Bytes rotation;
  const LspRay* given;
};

// Whether a triangle is not there for this ray; of most nothing is asked.
template <class Text>
HWY_INLINE bool is_passed(const LspTriangle& triangle, const LspRay& ray) {
  if (!Text::lsp_has_gaps(triangle)) [[likely]]
    return false;
  typename Text::LspSetup s;
  s.hash = Text::lsp_ray_hash(ray);
  return Text::lsp_passes(s, triangle);
}

// Of the triangles that the ray's line passes through, a bit each.
template <class Text, class NumberOf>
HWY_INLINE void keep_nearest(const lsp_scene& scene, const LspTriangle* const (&records)[kLeafLanes],
                             uint32_t met, const RayRows& r, const P4& a, const P4& b, const P4& c,
                             const Passages<D4>& passes, NumberOf number_of, Best& best) {
  const P4 direction = {hn::Set(d4, r.direction[0]), hn::Set(d4, r.direction[1]),
                        hn::Set(d4, r.direction[2])};
  const V4 t = plane_depth<D4>(direction, hn::Set(d4, r.shear[2]), a, b, c, passes);
  met &= mask_bits(d4, hn::And(hn::Gt(t, hn::Set(d4, r.tmin)), hn::Le(t, hn::Set(d4, best.t))));
  if (met == 0) return;
  HWY_ALIGN float ts[kLeafLanes], vs[kLeafLanes], ws[kLeafLanes], dets[kLeafLanes];
  hn::Store(t, d4, ts);
  hn::Store(passes.v, d4, vs);
  hn::Store(passes.w, d4, ws);
  hn::Store(passes.det, d4, dets);
  for (; met != 0; met &= met - 1) {
    const auto lane = static_cast<uint32_t>(std::countr_zero(met));
    const uint32_t primitive = records[lane]->primitive;
    if (!(ts[lane] < best.t || (ts[lane] == best.t && primitive < best.primitive))) continue;
    if (is_passed<Text>(*records[lane], *r.given)) continue;
    best.t = ts[lane];
    best.u = vs[lane] / dets[lane];
    best.v = ws[lane] / dets[lane];
    best.triangle = number_of(lane);
    best.primitive = primitive;
    if (scene.normals != nullptr) fetch(scene.normals, best.triangle);
  }
}

// Of `count` records of the four; number_of a lane is that of its record.
template <class Text, class NumberOf>
HWY_INLINE void hit_triangles(const lsp_scene& scene, const LspTriangle* const (&records)[kLeafLanes],
                              uint32_t count, const RayRows& r, NumberOf number_of, Best& best) {
  // Seen from the origin, the ray's axis last.
  const auto corner = [&](size_t c) HWY_ATTR {
    const auto row = [&](size_t i) HWY_ATTR {
      return rotated(hn::LoadU(d4, reinterpret_cast<const float*>(records[i]) + 4 * c), r.rotation);
    };
    const V4 a = row(0), b = row(1), e = row(2), f = row(3);
    const hn::Repartition<uint64_t, D4> d64;
    const auto pair = [&](V4 v) HWY_ATTR { return hn::BitCast(d64, v); };
    const auto ab_low = pair(hn::InterleaveLower(d4, a, b)), ef_low = pair(hn::InterleaveLower(d4, e, f));
    const auto ab_high = pair(hn::InterleaveUpper(d4, a, b)), ef_high = pair(hn::InterleaveUpper(d4, e, f));
    const V4 x = hn::BitCast(d4, hn::InterleaveLower(d64, ab_low, ef_low));
    const V4 y = hn::BitCast(d4, hn::InterleaveUpper(d64, ab_low, ef_low));
    const V4 z = hn::BitCast(d4, hn::InterleaveLower(d64, ab_high, ef_high));
    return P4{hn::Sub(x, hn::Set(d4, r.origin[0])), hn::Sub(y, hn::Set(d4, r.origin[1])),
              hn::Sub(z, hn::Set(d4, r.origin[2]))};
  };
  const P4 a = corner(0), b = corner(1), c = corner(2);
  const Passages<D4> p = pass<D4>(a, b, c, hn::Set(d4, r.shear[0]), hn::Set(d4, r.shear[1]));
  const uint32_t met = mask_bits(d4, p.met) & ((1u << count) - 1);
  if (met != 0) keep_nearest<Text>(scene, records, met, r, a, b, c, p, number_of, best);
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace lsp
HWY_AFTER_NAMESPACE();

#endif
