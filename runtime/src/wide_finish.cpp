// Answers of rays in the caller's terms across the lanes of a vector: lsp_finish (lsp/traverse.h) and what it
// needs of lsp_setup, operation by operation, compiled for each instruction set.
#include <limits>

#include "simd_targets.h"
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "wide_finish.cpp"
#include <hwy/foreach_target.h>
// What Highway compiles for must be known first.
#include <hwy/highway.h>

#if HWY_TARGET != HWY_SCALAR && HWY_TARGET != HWY_EMU128
#include "wide_found-inl.h"

HWY_BEFORE_NAMESPACE();
namespace lsp {
namespace HWY_NAMESPACE {
namespace {

// Scaled by a power of two first, as there.
HWY_INLINE V3 unit_of(const V3& n) {
  const VU stated = hn::ShiftRight<23>(hn::BitCast(du, largest(n)));
  const VU exponent = hn::Min(hn::Max(stated, set_u(1)), set_u(253));
  const V3 scaled = times<DF>(n, hn::BitCast(df, hn::ShiftLeft<23>(hn::Sub(set_u(254), exponent))));
  return times<DF>(scaled, hn::Div(set(1.0f), hn::Sqrt(dot(scaled, scaled))));
}

// lsp_unpack_normal.
HWY_INLINE V3 unpacked(VU packed) {
  const VF unit = set(1.0f / 32767.0f), zero = hn::Zero(df);
  const VI low = hn::ShiftRight<16>(hn::BitCast(di, hn::ShiftLeft<16>(packed)));
  const VF x = hn::Mul(hn::ConvertTo(df, low), unit);
  const VF y = hn::Mul(hn::ConvertTo(df, hn::ShiftRight<16>(hn::BitCast(di, packed))), unit);
  const VF z = hn::Sub(hn::Sub(set(1.0f), hn::Abs(x)), hn::Abs(y));
  const VF fold = max_of(hn::Neg(z), zero);
  const auto folded = [&](VF c) HWY_ATTR { return hn::Add(c, select(hn::Ge(c, zero), hn::Neg(fold), fold)); };
  const V3 n = {folded(x), folded(y), z};
  return times<DF>(n, hn::Div(set(1.0f), hn::Sqrt(dot(n, n))));
}

// lsp_interpolated_normal.
HWY_INLINE V3 interpolated(const lsp_scene& scene, VU triangle, MU there, VF u, VF v) {
  static_assert(sizeof(LspCornerNormals) == 12);
  const auto* words = &scene.normals->n0;
  const VU first = hn::Mul(triangle, set_u(3));
  const VF rest = hn::Sub(hn::Sub(set(1.0f), u), v);
  const V3 n0 = times<DF>(unpacked(load_words(words, first, there)), rest);
  const V3 n1 = times<DF>(unpacked(load_words(words, hn::Add(first, set_u(1)), there)), u);
  const V3 n2 = times<DF>(unpacked(load_words(words, hn::Add(first, set_u(2)), there)), v);
  return plus(plus(n0, n1), n2);
}

// What has been hit, where it is in time.
HWY_INLINE void describe(const Answered& of, const FoundArrays& found, size_t i, MU here, const V3& o,
                         const V3& direction, MU in_time, VU (&out)[8]) {
  const lsp_scene& scene = of.scene;
  VU record[3][4];
  const auto* triangles = or_zero(scene.triangles, scene.header->triangle_count);
  const VU number = load(found.triangle + i);
  const VU count = hn::IfThenElseZero(here, set_u(scene.header->triangle_count));
  for (size_t c = 0; c < 3; ++c)
    load_records<sizeof(LspTriangle) / 4>(reinterpret_cast<const uint32_t*>(triangles) + 4 * c, number, count,
                                          record[c]);
  const V3 v0 = floats(record[0]), e1 = minus(floats(record[1]), v0), e2 = minus(floats(record[2]), v0);
  V3 n = cross(e1, e2);
  // lsp_plane_weights.
  const VF t = load(found.t + i);
  const V3 w = minus(v0, o);
  const V3 r = {hn::Sub(hn::Mul(direction.x, t), w.x), hn::Sub(hn::Mul(direction.y, t), w.y),
                hn::Sub(hn::Mul(direction.z, t), w.z)};
  const VF scale = hn::Div(set(1.0f), dot(n, n));
  const VU flags = load(found.flags + i);
  const MF by_plane = as_float(hn::Ne(hn::And(flags, set_u(LSP_HIT_LINE_SPACE)), hn::Zero(du)));
  const VF u = select(by_plane, hn::Mul(dot(cross(r, e2), n), scale), load(found.u + i));
  const VF v = select(by_plane, hn::Mul(dot(cross(e1, r), n), scale), load(found.v + i));
  if (scene.normals != nullptr) {
    const VF zero = hn::Zero(df), one = set(1.0f);
    const VF at_u = of.cells ? min_of(max_of(u, zero), one) : u;
    const VF at_v = of.cells ? min_of(max_of(v, zero), hn::Sub(one, at_u)) : v;
    const V3 smooth = interpolated(scene, number, hn::Lt(number, count), at_u, at_v);
    n = select<DF>(hn::Gt(dot(smooth, smooth), set(1e-12f)), smooth, n);
  }
  const V3 towards = {hn::Neg(direction.x), hn::Neg(direction.y), hn::Neg(direction.z)};
  const V3 unit = unit_of(select<DF>(hn::Eq(largest(n), hn::Zero(df)), towards, n));
  const auto put = [&](size_t k, VU value) HWY_ATTR { out[k] = select(in_time, value, out[k]); };
  put(1, record[0][3]);
  put(2, hn::BitCast(du, u));
  put(3, hn::BitCast(du, v));
  put(4, hn::BitCast(du, unit.x));
  put(5, hn::BitCast(du, unit.y));
  put(6, hn::BitCast(du, unit.z));
  put(7, flags);
}

// Of the rays from i on.
HWY_INLINE void answer(const Answered& of, const FoundArrays& found, size_t i) {
  const MU here = as_uint(first_lanes(found.count - i));
  VU ray[8];
  const auto* words = reinterpret_cast<const uint32_t*>(of.rays);
  const VU count = hn::IfThenElseZero(here, set_u(of.count));
  load_records<sizeof(LspRay) / 4>(words, load(found.ray + i), count, ray);
  load_records<sizeof(LspRay) / 4>(words + 4, load(found.ray + i), count, ray + 4);
  const V3 o = floats(ray), d = floats(ray + 4);
  const Scaled scaled = scale(d);
  const VF t = hn::Mul(load(found.t + i), scaled.shrink);
  const MF in_time = hn::And(hn::Gt(t, hn::BitCast(df, ray[3])), hn::Lt(t, hn::BitCast(df, ray[7])));
  const VU flags = load(found.flags + i);
  VU out[8] = {hn::BitCast(du, select(in_time, t, set(std::numeric_limits<float>::infinity()))),
               set_u(LSP_NONE),
               hn::Zero(du),
               hn::Zero(du),
               hn::Zero(du),
               hn::Zero(du),
               hn::Zero(du),
               hn::And(flags, set_u(LSP_HIT_INCOMPLETE))};
  if (!of.occlusion) describe(of, found, i, here, o, scaled.direction, as_uint(in_time), out);
  HWY_ALIGN uint32_t low[4 * kLanes], high[4 * kLanes];
  hn::StoreInterleaved4(out[0], out[1], out[2], out[3], du, low);
  hn::StoreInterleaved4(out[4], out[5], out[6], out[7], du, high);
  static_assert(sizeof(LspHit) == 32);
  for (size_t k = 0; k < kLanes && i + k < found.count; ++k) {
    auto* to = reinterpret_cast<uint8_t*>(&of.hits[found.ray[i + k]]);
    __builtin_memcpy(to, low + 4 * k, 16);
    __builtin_memcpy(to + 16, high + 4 * k, 16);
  }
}

}  // namespace

void finish(const Answered& of, const FoundArrays& found) {
  for (size_t i = 0; i < found.count; i += kLanes) answer(of, found, i);
}

}  // namespace HWY_NAMESPACE
}  // namespace lsp
HWY_AFTER_NAMESPACE();
#endif
