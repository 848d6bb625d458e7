// Rays under way in lanes, for trace_cells_wide.cpp and wide_calls-inl.h: where they are kept, and what cells
// calculate with.
#if defined(LSP_WIDE_LANES_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef LSP_WIDE_LANES_INL_H
#undef LSP_WIDE_LANES_INL_H
#else
#define LSP_WIDE_LANES_INL_H
#endif

#include "wide_vectors-inl.h"

// What does not depend on the instruction set.
#ifndef LSP_LANE_ORDERS
#define LSP_LANE_ORDERS
namespace lsp {

// By a mask of lanes: the numbers of those that are set, a byte each, the first lowest. (Highway's own table
// is copied to the stack at every use, by gcc 12.)
struct LaneOrders {
  uint64_t of[256];
};
constexpr LaneOrders lane_orders() {
  LaneOrders orders{};
  for (uint64_t mask = 0; mask < 256; ++mask)
    for (uint64_t lane = 0, at = 0; lane < 8; ++lane)
      if ((mask >> lane & 1) != 0) orders.of[mask] |= lane << (8 * at++);
  return orders;
}
static constexpr LaneOrders kLaneOrders = lane_orders();

}  // namespace lsp
#endif

HWY_BEFORE_NAMESPACE();
namespace lsp {
namespace HWY_NAMESPACE {
namespace {

// The text of single rays.
struct Text {
#define LSP_CELLS
#include "lsp/traverse.h"
#undef LSP_CELLS
};
static_assert(kEdgeOn == LSP_EDGE_ON);

// Rays of a round, a bit of a word each.
constexpr size_t kPool = 64;

// Of the rays from i on, n in all, those whose bits are set.
HWY_INLINE Bits lanes_of(Bits bits, size_t i, size_t n = kPool) {
  return bits >> i & ((Bits{1} << (n - i < kLanes ? n - i : kLanes)) - 1);
}

// Lanes that are set, one after the other.
HWY_INLINE VI lane_order(Bits bits) {
  if constexpr (kLanes > 8) return hn::Compress(hn::Iota(di, 0), as_int(mask_of(bits)));
  const hn::Rebind<uint8_t, DI> bytes;
  return hn::PromoteTo(di, hn::LoadU(bytes, reinterpret_cast<const uint8_t*>(&kLaneOrders.of[bits & 255])));
}

// Moves lanes of a vector at i that are set to `at` and on.
class Mover {
 public:
  HWY_INLINE Mover(size_t i, size_t at, Bits lanes) : Mover(i, at, lane_order(lanes)) {}
  HWY_INLINE void operator()(const float* from, float* to) const { move(from, to, of_f_); }
  HWY_INLINE void operator()(const int32_t* from, int32_t* to) const { move(from, to, of_i_); }
  HWY_INLINE void operator()(const uint32_t* from, uint32_t* to) const { move(from, to, of_u_); }

 private:
  HWY_INLINE Mover(size_t i, size_t at, VI order)
      : i_(i),
        at_(at),
        of_f_(hn::IndicesFromVec(df, order)),
        of_i_(hn::IndicesFromVec(di, order)),
        of_u_(hn::IndicesFromVec(du, order)) {}
  template <typename T, class Indices>
  HWY_INLINE void move(const T* from, T* to, Indices indices) const {
    store(hn::TableLookupLanes(load(from + i_), indices), to + at_);
  }
  size_t i_, at_;
  decltype(hn::IndicesFromVec(df, VI())) of_f_;
  decltype(hn::IndicesFromVec(di, VI())) of_i_;
  decltype(hn::IndicesFromVec(du, VI())) of_u_;
};

// Rays under way, a value a lane: where they have come.
template <size_t kMost>
struct Rays {
  template <typename T>
  using Of = T[kMost + kLanes];
  Of<uint32_t> ray_, step_, mode_, waiting_;
  Of<float> origin_[3], direction_[3], inverse_[3], tmin_, tmax_, t_, t_last_;
  Of<int32_t> cell_[3], axis_;

  // Those of `from`'s lanes at i that are set, to `at` and on.
  template <size_t kFrom>
  HWY_NOINLINE void take(const Rays<kFrom>& from, size_t i, Bits lanes, size_t at) {
    const Mover move(i, at, lanes);
    for (size_t k = 0; k < 3; ++k) {
      move(from.origin_[k], origin_[k]);
      move(from.direction_[k], direction_[k]);
      move(from.inverse_[k], inverse_[k]);
      move(from.cell_[k], cell_[k]);
    }
    move(from.tmin_, tmin_);
    move(from.tmax_, tmax_);
    move(from.t_, t_);
    move(from.t_last_, t_last_);
    move(from.axis_, axis_);
    move(from.ray_, ray_);
    move(from.step_, step_);
    move(from.mode_, mode_);
    move(from.waiting_, waiting_);
  }
};

// floor(q > 0 ? q : 0), held below n: lsp_cell_patch.
HWY_INLINE VF patch_of(VF q, VF n) {
  const VF i = hn::Floor(hn::IfThenElseZero(hn::Gt(q, hn::Zero(df)), q));
  return select(hn::Lt(i, n), i, hn::Sub(n, set(1.0f)));
}
HWY_INLINE VF place_of(VF q, VF first) { return hn::Sub(hn::Mul(set(2.0f), hn::Sub(q, first)), set(1.0f)); }
HWY_INLINE V3 corner_of(VI x, VI y, VI z) {
  return {hn::ConvertTo(df, x), hn::ConvertTo(df, y), hn::ConvertTo(df, z)};
}
// origin + direction * t.
HWY_INLINE V3 point_at(const V3& o, const V3& d, VF t) {
  return {hn::Add(o.x, hn::Mul(d.x, t)), hn::Add(o.y, hn::Mul(d.y, t)), hn::Add(o.z, hn::Mul(d.z, t))};
}
// Arrays of the scene, see or_zero.
struct Arrays {
  const LspFilledCell* cells;
  const LspPlane* planes;
  const LspSplit* splits;
  VU cell_count, plane_count, split_count, word_count;
};

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace lsp
HWY_AFTER_NAMESPACE();

#endif
