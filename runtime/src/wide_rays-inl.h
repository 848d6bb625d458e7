// Rays made ready for a tree of wide nodes, a vector of them at a time: for trace_wide_lanes.cpp.
#if defined(LSP_WIDE_RAYS_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef LSP_WIDE_RAYS_INL_H
#undef LSP_WIDE_RAYS_INL_H
#else
#define LSP_WIDE_RAYS_INL_H
#endif

#include <algorithm>
#include <cmath>
#include <limits>

#include "wide_vectors-inl.h"

HWY_BEFORE_NAMESPACE();
namespace lsp {
namespace HWY_NAMESPACE {
namespace {

constexpr size_t kChildren = LSP_WIDE_CHILDREN;
using D8 = hn::CappedTag<float, kChildren>;
using DU8 = hn::RebindToUnsigned<D8>;
using V8 = hn::Vec<D8>;
constexpr D8 d8;
constexpr DU8 du8;
constexpr size_t kBoxes = hn::MaxLanes(D8());  // 8, or 4 twice; rays are made ready as many at a time
constexpr size_t kParts = kChildren / kBoxes;
constexpr size_t kGroup = 32;  // any-hit rays that go down the tree together, a bit each

// Beyond these products of reciprocals and positions may overflow.
constexpr float kTame = 0x1p40f;

HWY_INLINE float farthest(const lsp_float3& v) {
  return std::max(std::max(std::fabs(v.x), std::fabs(v.y)), std::fabs(v.z));
}

// Rays made ready, of which every one then has its rows: what boxes and triangles take of lsp_setup,
// operation by operation. Where a coordinate is not tame, or a ray is invalid, it is not ready.
class Batch {
 public:
  using Rows = float[kGroup][4];  // x, y, z, and zero
  using Values = float[kGroup];
  // For boxes: where a plane is met is plane * inverse + base, of those met first and of those met last.
  HWY_ALIGN Rows inverse, first_base, last_base;
  // For triangles, the ray's axis last.
  HWY_ALIGN Rows origin, shear, direction;
  HWY_ALIGN Values tmin, tmax;
  HWY_ALIGN uint32_t axis[kGroup];
  HWY_ALIGN uint32_t forward[kGroup];  // axes along which the ray goes up, a bit each

  explicit Batch(const LspHeader& header) : lo_(header.bounds_min), hi_(header.bounds_max) {
    if (!(farthest(lo_) < kTame) || !(farthest(hi_) < kTame)) most_largest_ = 0;
  }

  // `count` rays, from one to kGroup, from number 0 on. Returns which are ready, a bit each.
  HWY_INLINE uint32_t make_ready(const LspRay* rays, size_t count) {
    uint32_t ready = 0;
    for (size_t i = 0; i < count; i += kBoxes)
      ready |= make_ready(rays + i, count - i < kBoxes ? count - i : kBoxes, i) << i;
    return count < kGroup ? ready & ((1u << count) - 1) : ready;
  }

  HWY_INLINE RayRows rows(size_t i, const LspRay& ray) const {
    const auto rotation = hn::Load(hn::Repartition<uint8_t, D4>(), kRotations[axis[i]]);
    return {origin[i], shear[i], direction[i], tmin[i], rotation, &ray};
  }

 private:
  struct P8 {
    V8 x, y, z;
  };
  // Rays as lanes: the fields of LspRay.
  struct Rays {
    P8 origin, direction;
    V8 tmin, tmax;
  };
  static HWY_INLINE Rays load(const LspRay* rays, size_t count) {
    LspRay padded[kBoxes];
    if (count < kBoxes) {
      for (size_t i = 0; i < kBoxes; ++i) padded[i] = rays[i < count ? i : count - 1];
      rays = padded;
    }
    // Of half of them in turn: origin and tmin in even lanes, direction and tmax in odd ones.
    V8 low[4], high[4], even[4], odd[4];
    hn::LoadInterleaved4(d8, &rays[0].origin.x, low[0], low[1], low[2], low[3]);
    hn::LoadInterleaved4(d8, &rays[kBoxes / 2].origin.x, high[0], high[1], high[2], high[3]);
    for (size_t k = 0; k < 4; ++k) {
      even[k] = hn::ConcatEven(d8, high[k], low[k]);
      odd[k] = hn::ConcatOdd(d8, high[k], low[k]);
    }
    return {{even[0], even[1], even[2]}, {odd[0], odd[1], odd[2]}, even[3], odd[3]};
  }

  static HWY_INLINE V8 largest_of(V8 x, V8 y, V8 z) { return hn::Max(hn::Max(x, y), z); }
  static HWY_INLINE V8 reciprocal(V8 d) {
    const V8 one = hn::Set(d8, 1.0f);
    const auto is_zero = hn::Eq(d, hn::Zero(d8));
    return hn::IfThenElse(is_zero, hn::Set(d8, 1.2089258e24f), hn::Div(one, hn::IfThenElse(is_zero, one, d)));
  }
  static HWY_INLINE void store(const P8& v, float (*to)[4]) {
    hn::StoreInterleaved4(v.x, v.y, v.z, hn::Zero(d8), d8, to[0]);
  }

  // As many as there are lanes, or fewer, from number `at` on.
  HWY_NOINLINE uint32_t make_ready(const LspRay* from, size_t count, size_t at) {
    const auto word = [&](uint32_t x) HWY_ATTR { return hn::Set(du8, x); };
    const Rays rays = load(from, count);
    const P8 o = rays.origin, d = rays.direction;
    const V8 mx = hn::Abs(d.x), my = hn::Abs(d.y), mz = hn::Abs(d.z);
    const V8 largest = largest_of(mx, my, mz);
    const V8 far_out = largest_of(hn::Abs(o.x), hn::Abs(o.y), hn::Abs(o.z));
    // A NaN is ordered to nothing; the largest of several may have lost one.
    const auto is_number =
        hn::And(hn::And(hn::Eq(d.x, d.x), hn::Eq(d.y, d.y)), hn::And(hn::Eq(o.x, o.x), hn::Eq(o.y, o.y)));
    const auto is_tame =
        hn::And(hn::Lt(far_out, hn::Set(d8, most_largest_)), hn::And(hn::Eq(d.z, d.z), hn::Eq(o.z, o.z)));
    const auto is_direction =
        hn::And(hn::Lt(largest, hn::Set(d8, HUGE_VALF)), hn::Ge(largest, hn::Set(d8, 0x1p-126f)));

    const auto exponent = hn::Min(hn::ShiftRight<23>(hn::BitCast(du8, largest)), word(253));
    const V8 shrink = hn::BitCast(d8, hn::ShiftLeft<23>(hn::Sub(word(254), exponent)));
    const V8 to_scaled = hn::BitCast(d8, hn::ShiftLeft<23>(exponent));
    const V8 step = hn::Mul(hn::BitCast(d8, word(1)), to_scaled),
             most = hn::Set(d8, std::numeric_limits<float>::max());
    hn::Store(hn::Add(hn::Mul(rays.tmin, to_scaled), step), d8, tmin + at);
    hn::Store(hn::Min(hn::Sub(hn::Mul(hn::Min(rays.tmax, most), to_scaled), step), most), d8, tmax + at);

    const auto scaled = [&](V8 x) HWY_ATTR {
      const V8 s = hn::Mul(x, shrink);
      return hn::IfThenZeroElse(hn::Lt(hn::Abs(s), hn::Set(d8, 8.6736174e-19f)), s);
    };
    const P8 way = {scaled(d.x), scaled(d.y), scaled(d.z)};
    set_slabs(o, {reciprocal(way.x), reciprocal(way.y), reciprocal(way.z)}, far_out, at);

    const auto at_x = hn::And(hn::Ge(mx, my), hn::Ge(mx, mz)),
               at_y = hn::AndNot(hn::Ge(mx, my), hn::Ge(my, mz));
    const auto rotated = [&](const P8& v) HWY_ATTR {
      return P8{hn::IfThenElse(at_x, v.y, hn::IfThenElse(at_y, v.z, v.x)),
                hn::IfThenElse(at_x, v.z, hn::IfThenElse(at_y, v.x, v.y)),
                hn::IfThenElse(at_x, v.x, hn::IfThenElse(at_y, v.y, v.z))};
    };
    const P8 p = rotated(way);
    store(p, direction + at);
    store(rotated(o), origin + at);
    store({hn::Div(p.x, p.z), hn::Div(p.y, p.z), hn::Div(hn::Set(d8, 1.0f), p.z)}, shear + at);
    const auto mask_u = [&](auto mask) HWY_ATTR { return hn::RebindMask(du8, mask); };
    hn::Store(hn::IfThenZeroElse(mask_u(at_x), hn::IfThenElse(mask_u(at_y), word(1), word(2))), du8,
              axis + at);
    return mask_bits(
        d8, hn::And(hn::And(is_number, is_tame), hn::And(is_direction, hn::Le(rays.tmin, rays.tmax))));
  }

  // Boxes are grown by moving the origin: origin_plus and origin_minus.
  HWY_INLINE void set_slabs(const P8& o, const P8& by, V8 far_out, size_t at) {
    const auto reach_of = [&](float from, float to, V8 x) HWY_ATTR {
      return hn::Max(hn::Abs(hn::Sub(hn::Set(d8, from), x)), hn::Abs(hn::Sub(hn::Set(d8, to), x)));
    };
    const V8 reach =
        largest_of(reach_of(lo_.x, hi_.x, o.x), reach_of(lo_.y, hi_.y, o.y), reach_of(lo_.z, hi_.z, o.z));
    const V8 err =
        hn::Add(hn::Mul(reach, hn::Set(d8, 9.5367432e-7f)), hn::Mul(far_out, hn::Set(d8, 2.3841858e-7f)));
    auto ups = hn::Zero(du8);
    const auto bases = [&](V8 x, V8 slope, uint32_t bit, V8& first, V8& last) HWY_ATTR {
      const auto up = hn::Gt(slope, hn::Zero(d8));
      const V8 plus = hn::Neg(hn::Mul(hn::Add(x, err), slope)),
               minus = hn::Neg(hn::Mul(hn::Sub(x, err), slope));
      first = hn::IfThenElse(up, plus, minus);
      last = hn::IfThenElse(up, minus, plus);
      ups = hn::Or(ups, hn::IfThenElseZero(hn::RebindMask(du8, up), hn::Set(du8, bit)));
    };
    P8 first, last;
    bases(o.x, by.x, 1, first.x, last.x);
    bases(o.y, by.y, 2, first.y, last.y);
    bases(o.z, by.z, 4, first.z, last.z);
    store(by, inverse + at);
    store(first, first_base + at);
    store(last, last_base + at);
    hn::Store(ups, du8, forward + at);
  }

  const lsp_float3 lo_, hi_;
  float most_largest_ = kTame;  // coordinate of an origin; none, where the scene's are not tame
};

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace lsp
HWY_AFTER_NAMESPACE();

#endif
