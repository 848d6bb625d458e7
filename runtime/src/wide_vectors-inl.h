// Vectors of rays: what the tracers across lanes calculate with, and how lanes read a scene's arrays.
// Included once for every instruction set, as Highway has it.
#if defined(LSP_WIDE_VECTORS_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef LSP_WIDE_VECTORS_INL_H
#undef LSP_WIDE_VECTORS_INL_H
#else
#define LSP_WIDE_VECTORS_INL_H
#endif

#include <hwy/highway.h>
#include <bit>

#include "trace_subset.h"
#include "trace_variant.h"
#include "wide_triangles-inl.h"

HWY_BEFORE_NAMESPACE();
namespace lsp {
namespace HWY_NAMESPACE {
namespace {

using DF = hn::ScalableTag<float>;
using DI = hn::RebindToSigned<DF>;
using DU = hn::RebindToUnsigned<DF>;
using VF = hn::Vec<DF>;
using VI = hn::Vec<DI>;
using VU = hn::Vec<DU>;
using MF = hn::Mask<DF>;
using MI = hn::Mask<DI>;
using MU = hn::Mask<DU>;
constexpr DF df;
constexpr DI di;
constexpr DU du;
constexpr size_t kLanes = hn::MaxLanes(DF());

// A bit a lane.
using Bits = uint64_t;

using V3 = Points<DF>;

HWY_INLINE VF set(float x) { return hn::Set(df, x); }
HWY_INLINE VI set_i(uint32_t x) { return hn::Set(di, static_cast<int32_t>(x)); }
HWY_INLINE VU set_u(uint32_t x) { return hn::Set(du, x); }
HWY_INLINE VF select(MF m, VF yes, VF no) { return hn::IfThenElse(m, yes, no); }
HWY_INLINE VI select(MI m, VI yes, VI no) { return hn::IfThenElse(m, yes, no); }
HWY_INLINE VU select(MU m, VU yes, VU no) { return hn::IfThenElse(m, yes, no); }
HWY_INLINE MF as_float(MI m) { return hn::RebindMask(df, m); }
HWY_INLINE MF as_float(MU m) { return hn::RebindMask(df, m); }
HWY_INLINE MI as_int(MF m) { return hn::RebindMask(di, m); }
HWY_INLINE MU as_uint(MF m) { return hn::RebindMask(du, m); }
HWY_INLINE VF load(const float* from) { return hn::LoadU(df, from); }
HWY_INLINE VI load(const int32_t* from) { return hn::LoadU(di, from); }
HWY_INLINE VU load(const uint32_t* from) { return hn::LoadU(du, from); }
HWY_INLINE void store(VF v, float* to) { hn::StoreU(v, df, to); }
HWY_INLINE void store(VI v, int32_t* to) { hn::StoreU(v, di, to); }
HWY_INLINE void store(VU v, uint32_t* to) { hn::StoreU(v, du, to); }

HWY_INLINE Bits bits_of(MF mask) {
  uint8_t bytes[8] = {};
  hn::StoreMaskBits(df, mask, bytes);
  uint64_t bits;
  __builtin_memcpy(&bits, bytes, sizeof bits);
  return bits & ((Bits{1} << kLanes) - 1);
}
HWY_INLINE MF mask_of(Bits bits) {
  uint8_t bytes[8];
  __builtin_memcpy(bytes, &bits, sizeof bytes);
  return hn::LoadMaskBits(df, bytes);
}
HWY_INLINE MF first_lanes(size_t count) { return hn::FirstN(df, count < kLanes ? count : kLanes); }

// A number of each bit that is set.
#define LSP_FOR_BITS(i, bits)                                           \
  for (Bits rest_##i = (bits); rest_##i != 0; rest_##i &= rest_##i - 1) \
    if (const auto i = static_cast<size_t>(std::countr_zero(rest_##i)); true)

// lsp_no_trifle, lsp_reciprocal.
HWY_INLINE VF no_trifle(VF d) { return hn::IfThenZeroElse(hn::Lt(hn::Abs(d), set(8.6736174e-19f)), d); }
HWY_INLINE VF reciprocal(VF d) {
  const MF is_zero = hn::Eq(d, hn::Zero(df));
  return select(is_zero, set(1.2089258e24f), hn::Div(set(1.0f), select(is_zero, set(1.0f), d)));
}

// A direction times a power of two, so that its largest component is in [1, 4): as in lsp_setup.
struct Scaled {
  VF shrink, stretch;  // the power, and what undoes it
  V3 direction;
};
HWY_INLINE Scaled scale(const V3& d) {
  const VU stated = hn::ShiftRight<23>(hn::BitCast(du, largest(d)));
  const VU exponent = select(hn::Lt(set_u(253), stated), set_u(253), stated);
  const VF shrink = hn::BitCast(df, hn::ShiftLeft<23>(hn::Sub(set_u(254), exponent)));
  return {
      shrink,
      hn::BitCast(df, hn::ShiftLeft<23>(exponent)),
      {no_trifle(hn::Mul(d.x, shrink)), no_trifle(hn::Mul(d.y, shrink)), no_trifle(hn::Mul(d.z, shrink))}};
}

// A point or vector a lane, of three arrays.
template <size_t kCount>
HWY_INLINE V3 load_3(const float (&from)[3][kCount], size_t i) {
  return {load(from[0] + i), load(from[1] + i), load(from[2] + i)};
}
template <size_t kCount>
HWY_INLINE void store_3(const V3& v, float (&to)[3][kCount], size_t i) {
  store(v.x, to[0] + i);
  store(v.y, to[1] + i);
  store(v.z, to[2] + i);
}
HWY_INLINE V3 floats(const VU* words) {
  return {hn::BitCast(df, words[0]), hn::BitCast(df, words[1]), hn::BitCast(df, words[2])};
}
HWY_INLINE VF along(const V3& v, MF is_x, MF is_y) { return select(is_x, v.x, select(is_y, v.y, v.z)); }
// An array of the scene; one that is empty has a zero element, which is what is read beyond the end of any.
template <typename T>
HWY_INLINE const T* or_zero(const T* array, uint32_t count) {
  static const T zero{};
  return count != 0 ? array : &zero;
}

// Four words a lane, from first + lane's index * kWords on; zero where the index is beyond the end.
template <size_t kWords>
HWY_INLINE void load_records(const uint32_t* first, VU index, VU count, VU out[4]) {
  const MU there = hn::Lt(index, count);
  HWY_ALIGN uint32_t at[kLanes];
  hn::Store(hn::IfThenElseZero(there, index), du, at);
  const hn::CappedTag<uint32_t, 4> d4;
  const hn::Repartition<uint64_t, DU> d64;
  VU row[4];  // block b of row k: the record of lane 4 b + k
  for (size_t k = 0; k < 4; ++k) {
    const auto record = [&](size_t lane) HWY_ATTR {
      return hn::LoadU(d4, first + static_cast<size_t>(at[lane]) * kWords);
    };
    if constexpr (kLanes == 4) {
      row[k] = record(k);
    } else if constexpr (kLanes == 8) {
      row[k] = hn::Combine(du, record(4 + k), record(k));
    } else {
      const hn::Half<DU> half;
      row[k] = hn::Combine(du, hn::Combine(half, record(12 + k), record(8 + k)),
                           hn::Combine(half, record(4 + k), record(k)));
    }
  }
  const auto low = [&](VU a, VU b) HWY_ATTR { return hn::BitCast(d64, hn::InterleaveLower(du, a, b)); };
  const auto high = [&](VU a, VU b) HWY_ATTR { return hn::BitCast(d64, hn::InterleaveUpper(du, a, b)); };
  const auto low_01 = low(row[0], row[1]), low_23 = low(row[2], row[3]);
  const auto high_01 = high(row[0], row[1]), high_23 = high(row[2], row[3]);
  out[0] = hn::BitCast(du, hn::InterleaveLower(d64, low_01, low_23));
  out[1] = hn::BitCast(du, hn::InterleaveUpper(d64, low_01, low_23));
  out[2] = hn::BitCast(du, hn::InterleaveLower(d64, high_01, high_23));
  out[3] = hn::BitCast(du, hn::InterleaveUpper(d64, high_01, high_23));
  for (size_t k = 0; k < 4; ++k) out[k] = hn::IfThenElseZero(there, out[k]);
}

// A word a lane; zero where the index is beyond the end. The index is below 2^31.
HWY_INLINE VU load_words(const uint32_t* words, VU index, MU there) {
  return hn::IfThenElseZero(there,
                            hn::GatherIndex(du, words, hn::BitCast(di, hn::IfThenElseZero(there, index))));
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace lsp
HWY_AFTER_NAMESPACE();

#endif
