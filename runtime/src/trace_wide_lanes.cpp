// Exact rays through wide nodes (lsp/wide.h), a node's eight boxes side by side in the lanes of a vector, and
// four triangles of a leaf (Google Highway), compiled for each instruction set and chosen when a trace is
// asked for.
//
// The triangle test is that of lsp/traverse.h, operation by operation: a lane has the bits of a single
// triangle. The boxes are not: a plane lo + q * step is met at q * (step / d) + (lo / d - o / d), fused where
// the machine can. What a ray hits does not depend on it, nor on the order in which children are visited (see
// lsp_triangle; any-hit rays keep to the order of the file), as long as no box is missed whose triangle would
// be hit. Rays are made ready a vector at a time, lsp_setup across lanes. Rounding, with the words of
// lsp/traverse.h: along the axis (o / d) is off by u max|o|, lo / d by u (max|o| + R), their sum and step / d
// by u R and 2 u R, q times that and the sum by 3 u R: 8 u R and 2 u max|o| beside the 5 u R of the triangle,
// where a box is grown by 16 u R + 4 u max|o|. Where a product might overflow, in scenes or from origins
// beyond 2^40, rays are traced by the text of single ones.
#include "trace_wide_lanes.h"

#include <algorithm>

#include "simd_targets.h"
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "trace_wide_lanes.cpp"
#include <hwy/foreach_target.h>
// What Highway compiles for must be known first.
#include <hwy/highway.h>

// Without vectors there is the loop of trace_wide.cpp.
#if HWY_TARGET != HWY_SCALAR && HWY_TARGET != HWY_EMU128
#include "trace_loops.h"
#include "trace_subset.h"
#include "trace_variant.h"
#include "wide_found-inl.h"

HWY_BEFORE_NAMESPACE();
namespace lsp {
namespace HWY_NAMESPACE {
namespace {

// The text of single rays.
struct Text {
#define LSP_WIDE
#include "lsp/traverse.h"
#undef LSP_WIDE
};

constexpr size_t kChildren = LSP_WIDE_CHILDREN;
using D8 = hn::CappedTag<float, kChildren>;
using V8 = hn::Vec<D8>;
constexpr D8 d8;
constexpr size_t kBoxes = hn::MaxLanes(D8());  // 8, or 4 twice; rays are made ready as many at a time
constexpr size_t kParts = kChildren / kBoxes;

// All children but one of every node on a path wait, and a mark below them.
constexpr uint32_t kStack = LSP_MAX_STACK * (kChildren - 1) + 1;

// Beyond these products of reciprocals and positions may overflow.
constexpr float kTame = 0x1p40f;

// The larger; `than` where x is no number.
HWY_INLINE V8 larger(V8 x, V8 than) {
#if HWY_ARCH_X86
  return hn::Max(x, than);
#else
  return hn::IfThenElse(hn::Lt(than, x), x, than);
#endif
}
HWY_INLINE V8 smaller(V8 x, V8 than) {
#if HWY_ARCH_X86
  return hn::Min(x, than);
#else
  return hn::IfThenElse(hn::Lt(x, than), x, than);
#endif
}

// By the axes along which a ray goes up, a bit each: bytes of the planes that it meets first.
constexpr uint8_t kPlanes[8][3] = {{24, 32, 40}, {0, 32, 40}, {24, 8, 40}, {0, 8, 40},
                                   {24, 32, 16}, {0, 32, 16}, {24, 8, 16}, {0, 8, 16}};

// Rays made ready, a lane each, of which every ray then has its rows: what boxes and triangles take of
// lsp_setup, operation by operation.
struct Batch {
  using Rows = float[kBoxes][4];  // x, y, z, and zero
  using Values = float[kBoxes];
  // For boxes: where a plane is met is plane * inverse + base, of those met first and of those met last.
  HWY_ALIGN Rows inverse, first_base, last_base;
  // For triangles, the ray's axis last.
  HWY_ALIGN Rows origin, shear, direction;
  HWY_ALIGN Values tmin, tmax;
  HWY_ALIGN uint32_t axis[kBoxes];
  HWY_ALIGN uint32_t forward[kBoxes];  // axes along which the ray goes up, a bit each
  uint32_t ready;                      // of the others nothing else is set: they are invalid, or not tame
};

// One of them, on its way.
struct Ready {
  V8 inverse, first_base, last_base;  // in every block of four lanes
  const uint8_t *first, *last;  // by axis the planes that are met first and last: byte of LspWideNode.planes
  float tmin, tmax;
  const float *origin, *shear, *direction;
  size_t axis;
  Bytes rotation;
  const LspRay* given;

  HWY_INLINE Ready(const Batch& b, size_t i, const LspRay& ray)
      : inverse(hn::LoadDup128(d8, b.inverse[i])),
        first_base(hn::LoadDup128(d8, b.first_base[i])),
        last_base(hn::LoadDup128(d8, b.last_base[i])),
        first(kPlanes[b.forward[i]]),
        last(kPlanes[7 - b.forward[i]]),
        tmin(b.tmin[i]),
        tmax(b.tmax[i]),
        origin(b.origin[i]),
        shear(b.shear[i]),
        direction(b.direction[i]),
        axis(b.axis[i]),
        rotation(hn::Load(hn::Repartition<uint8_t, D4>(), kRotations[axis])),
        given(&ray) {}
};

// What is waiting, of closest rays a child of a node: where it is entered, and 8 * node + child. Of any-hit
// rays all children of a node that are left, a bit each. What they refer to is looked up when it is their
// turn: most never have one.
struct Waiting {
  union {
    float t;
    uint32_t children;
  } of;
  uint32_t node;
};
constexpr uint32_t kNoNode = LSP_NONE;

class Tracer {
 public:
  explicit Tracer(const lsp_scene& scene)
      : scene_(scene),
        nodes_(scene.wide_nodes),
        node_count_(scene.header->wide_node_count),
        triangle_count_(scene.header->triangle_count),
        most_(scene.header->max_steps) {
    const lsp_float3 lo = scene.header->bounds_min, hi = scene.header->bounds_max;
    stack_[0] = {{-HUGE_VALF}, kNoNode};
    if (!is_tame(lsp_vec3(lo)) || !is_tame(lsp_vec3(hi))) most_largest_ = 0;
  }

  template <bool kAny>
  HWY_INLINE void trace(const LspRay* rays, LspHit* hits, uint64_t count, uint32_t flags) {
    for (uint64_t first = 0; first < count; first += kBoxes) {
      const uint64_t left = count - first;
      const size_t here = left < kBoxes ? static_cast<size_t>(left) : kBoxes;
      make_ready(rays + first, here);
      for (size_t i = 0; i < here; ++i) {
        const uint64_t k = first + i;
        if ((batch_.ready >> i & 1u) != 0)
          trace_one<kAny>(Ready(batch_, i, rays[k]), static_cast<uint32_t>(k), hits[k]);
        else
          hits[k] = trace_singly(rays[k], flags);
      }
      if (found_.size() >= kLanes) finish(rays, hits, count, flags);
    }
    finish(rays, hits, count, flags);
  }

 private:
  HWY_INLINE void finish(const LspRay* rays, LspHit* hits, uint64_t count, uint32_t flags) {
    found_.answer(
        {scene_, rays, hits, static_cast<uint32_t>(count), (flags & LSP_TRACE_OCCLUSION) != 0, false});
  }

  template <bool kAny>
  HWY_INLINE void trace_one(const Ready& r, uint32_t number, LspHit& hit) {
    Best best{};
    best.t = r.tmax;
    best.triangle = LSP_NONE;
    const bool complete = node_count_ == 0 || walk<kAny>(r, best);
    const uint32_t flags = complete ? 0 : LSP_HIT_INCOMPLETE;
    if (best.triangle != LSP_NONE) {
      found_.add(scene_, number, best.triangle, best.t, best.u, best.v, flags);
    } else {
      hit = Text::lsp_no_hit();
      hit.flags = flags;
    }
  }

  static bool is_tame(const vec3& v) { return Text::lsp_largest(v) < kTame; }

  // Invalid rays, and those whose products may overflow.
  LspHit trace_singly(const LspRay& ray, uint32_t flags) const {
    LspHit hit;
    trace_wide(scene_, flags, 0, &ray, &hit, 1, nullptr);
    return hit;
  }

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
  static HWY_INLINE void store(const P8& v, Batch::Rows& to) {
    hn::StoreInterleaved4(v.x, v.y, v.z, hn::Zero(d8), d8, to[0]);
  }

  // lsp_setup of as many rays as there are lanes, or fewer.
  HWY_INLINE void make_ready(const LspRay* from, size_t count) {
    const hn::RebindToUnsigned<D8> du;
    const auto set_u = [&](uint32_t x) HWY_ATTR { return hn::Set(du, x); };
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
    batch_.ready = mask_bits(
        d8, hn::And(hn::And(is_number, is_tame), hn::And(is_direction, hn::Le(rays.tmin, rays.tmax))));

    const auto exponent = hn::Min(hn::ShiftRight<23>(hn::BitCast(du, largest)), set_u(253));
    const V8 shrink = hn::BitCast(d8, hn::ShiftLeft<23>(hn::Sub(set_u(254), exponent)));
    const V8 to_scaled = hn::BitCast(d8, hn::ShiftLeft<23>(exponent));
    const V8 step = hn::Mul(hn::BitCast(d8, set_u(1)), to_scaled), most = hn::Set(d8, LSP_FLOAT_MAX);
    hn::Store(hn::Add(hn::Mul(rays.tmin, to_scaled), step), d8, batch_.tmin);
    hn::Store(hn::Min(hn::Sub(hn::Mul(hn::Min(rays.tmax, most), to_scaled), step), most), d8, batch_.tmax);

    const auto scaled = [&](V8 x) HWY_ATTR {
      const V8 s = hn::Mul(x, shrink);
      return hn::IfThenZeroElse(hn::Lt(hn::Abs(s), hn::Set(d8, 8.6736174e-19f)), s);
    };
    const P8 direction = {scaled(d.x), scaled(d.y), scaled(d.z)};
    set_slabs(o, {reciprocal(direction.x), reciprocal(direction.y), reciprocal(direction.z)}, far_out);

    const auto at_x = hn::And(hn::Ge(mx, my), hn::Ge(mx, mz)),
               at_y = hn::AndNot(hn::Ge(mx, my), hn::Ge(my, mz));
    const auto rotated = [&](const P8& v) HWY_ATTR {
      return P8{hn::IfThenElse(at_x, v.y, hn::IfThenElse(at_y, v.z, v.x)),
                hn::IfThenElse(at_x, v.z, hn::IfThenElse(at_y, v.x, v.y)),
                hn::IfThenElse(at_x, v.x, hn::IfThenElse(at_y, v.y, v.z))};
    };
    const P8 p = rotated(direction);
    store(p, batch_.direction);
    store(rotated(o), batch_.origin);
    store({hn::Div(p.x, p.z), hn::Div(p.y, p.z), hn::Div(hn::Set(d8, 1.0f), p.z)}, batch_.shear);
    const auto mask_u = [&](auto mask) HWY_ATTR { return hn::RebindMask(du, mask); };
    hn::Store(hn::IfThenZeroElse(mask_u(at_x), hn::IfThenElse(mask_u(at_y), set_u(1), set_u(2))), du,
              batch_.axis);
  }

  // Boxes are grown by moving the origin: origin_plus and origin_minus.
  HWY_INLINE void set_slabs(const P8& o, const P8& inverse, V8 far_out) {
    const hn::RebindToUnsigned<D8> du;
    const lsp_float3 lo = scene_.header->bounds_min, hi = scene_.header->bounds_max;
    const auto reach_of = [&](float from, float to, V8 x) HWY_ATTR {
      return hn::Max(hn::Abs(hn::Sub(hn::Set(d8, from), x)), hn::Abs(hn::Sub(hn::Set(d8, to), x)));
    };
    const V8 reach =
        largest_of(reach_of(lo.x, hi.x, o.x), reach_of(lo.y, hi.y, o.y), reach_of(lo.z, hi.z, o.z));
    const V8 err =
        hn::Add(hn::Mul(reach, hn::Set(d8, 9.5367432e-7f)), hn::Mul(far_out, hn::Set(d8, 2.3841858e-7f)));
    auto forward = hn::Zero(du);
    const auto bases = [&](V8 x, V8 by, uint32_t bit, V8& first, V8& last) HWY_ATTR {
      const auto up = hn::Gt(by, hn::Zero(d8));
      const V8 plus = hn::Neg(hn::Mul(hn::Add(x, err), by)), minus = hn::Neg(hn::Mul(hn::Sub(x, err), by));
      first = hn::IfThenElse(up, plus, minus);
      last = hn::IfThenElse(up, minus, plus);
      forward = hn::Or(forward, hn::IfThenElseZero(hn::RebindMask(du, up), hn::Set(du, bit)));
    };
    P8 first, last;
    bases(o.x, inverse.x, 1, first.x, last.x);
    bases(o.y, inverse.y, 2, first.y, last.y);
    bases(o.z, inverse.z, 4, first.z, last.z);
    store(inverse, batch_.inverse);
    store(first, batch_.first_base);
    store(last, batch_.last_base);
    hn::Store(forward, du, batch_.forward);
  }

  static HWY_INLINE V8 planes_at(const uint8_t* bytes) {
    const hn::Rebind<uint8_t, D8> d_bytes;
    const hn::RebindToSigned<D8> d_int;
    return hn::ConvertTo(d8, hn::PromoteTo(d_int, hn::LoadU(d_bytes, bytes)));
  }
  static HWY_INLINE V8 row_of(const float* row) {
    alignas(16) static constexpr uint32_t kThree[4] = {~0u, ~0u, ~0u, 0};
    // What else is in the row would be a denormal.
    const hn::RebindToUnsigned<D8> du;
    return hn::And(hn::LoadDup128(d8, row), hn::BitCast(d8, hn::LoadDup128(du, kThree)));
  }

  // Children of a node that the ray hits between tmin and tmax, a bit each, and where it enters them. To a
  // ray from far away boxes that are inside out are as wide as others: there may be no child.
  static HWY_INLINE uint32_t hit_children(const LspWideNode& node, const Ready& r, V8 tmin, V8 tmax,
                                          float* entries) {
    const V8 lo = row_of(&node.lo.x);
    const V8 unit = hn::Mul(row_of(&node.step.x), r.inverse);
    const V8 near = hn::MulAdd(lo, r.inverse, r.first_base), far = hn::MulAdd(lo, r.inverse, r.last_base);
    const auto* bytes = reinterpret_cast<const uint8_t*>(node.planes);
    uint32_t hits = 0;
    for (size_t part = 0; part < kParts; ++part, bytes += kBoxes) {
      const V8 first_x =
          hn::MulAdd(planes_at(bytes + r.first[0]), hn::Broadcast<0>(unit), hn::Broadcast<0>(near));
      const V8 first_y =
          hn::MulAdd(planes_at(bytes + r.first[1]), hn::Broadcast<1>(unit), hn::Broadcast<1>(near));
      const V8 first_z =
          hn::MulAdd(planes_at(bytes + r.first[2]), hn::Broadcast<2>(unit), hn::Broadcast<2>(near));
      const V8 last_x =
          hn::MulAdd(planes_at(bytes + r.last[0]), hn::Broadcast<0>(unit), hn::Broadcast<0>(far));
      const V8 last_y =
          hn::MulAdd(planes_at(bytes + r.last[1]), hn::Broadcast<1>(unit), hn::Broadcast<1>(far));
      const V8 last_z =
          hn::MulAdd(planes_at(bytes + r.last[2]), hn::Broadcast<2>(unit), hn::Broadcast<2>(far));
      const V8 first = larger(first_z, larger(first_y, larger(first_x, tmin)));
      const V8 last = smaller(last_z, smaller(last_y, smaller(last_x, tmax)));
      hn::Store(first, d8, entries + part * kBoxes);
      hits |= mask_bits(d8, hn::Le(first, last)) << (part * kBoxes);
    }
    return hits;
  }

  static HWY_INLINE uint32_t child_of(const LspWideNode& node, uint32_t number) {
    return reinterpret_cast<const uint16_t*>(node.children)[number];
  }

  // lsp_triangle of a leaf's, four at a time.
  HWY_NOINLINE void hit_leaf(const LspWideNode& node, uint32_t child, const Ready& r, Best& best) const {
    uint32_t first = (node.triangle_first + (child & LSP_WIDE_LEAF_FIRST_MASK)) & LSP_LEAF_FIRST_MASK;
    uint32_t count = (child >> LSP_WIDE_LEAF_COUNT_SHIFT & LSP_LEAF_COUNT_MASK) + 1;
    if (first >= triangle_count_ || count > triangle_count_ - first) return;  // of a damaged file
    for (; count > kLeafLanes; count -= kLeafLanes, first += kLeafLanes) hit_four(first, kLeafLanes, r, best);
    hit_four(first, count, r, best);
  }

  HWY_INLINE void hit_four(uint32_t first, uint32_t count, const Ready& r, Best& best) const {
    // Where there are fewer, what follows is read with them and not heeded.
    const LspTriangle* triangles = scene_.triangles + first;
    LspTriangle copies[kLeafLanes];
    if (triangle_count_ - first < kLeafLanes) [[unlikely]]
      triangles = copy_last(first, copies);
    const LspTriangle* const records[kLeafLanes] = {triangles, triangles + 1, triangles + 2, triangles + 3};
    const auto number_of = [&](uint32_t lane) HWY_ATTR { return first + lane; };
    hit_triangles<Text>(scene_, records, count, {r.origin, r.shear, r.direction, r.tmin, r.rotation, r.given},
                        number_of, best);
  }

  // The file's last triangles, from `first` on, and as many more as make four.
  HWY_NOINLINE const LspTriangle* copy_last(uint32_t first, LspTriangle* copies) const {
    for (uint32_t i = 0; i < kLeafLanes; ++i)
      copies[i] = scene_.triangles[first + i < triangle_count_ ? first + i : triangle_count_ - 1];
    return copies;
  }

  // From the root on. False: the file's bounds are wrong.
  template <bool kAny>
  HWY_INLINE bool walk(const Ready& r, Best& best) {
    const V8 tmin = hn::Set(d8, r.tmin);
    uint32_t left = most_, at = 0;
    const LspWideNode* node = nodes_;
    Waiting* top = stack_ + 1;
    for (;;) {
      if (left == 0) return false;
      --left;
      HWY_ALIGN float t[kChildren];
      ask_for_children(*node);
      uint32_t hits = hit_children(*node, r, tmin, hn::Set(d8, best.t), t);
      uint32_t child = LSP_WIDE_NO_CHILD;
      if (hits != 0) {
        const auto first = static_cast<uint32_t>(std::countr_zero(hits));
        hits &= hits - 1;
        if (top > stack_ + kStack - kChildren) return false;
        if constexpr (kAny) {
          *top = {{.children = hits}, at};
          top += hits != 0 ? 1 : 0;
          child = child_of(*node, first);
        } else {
          child = child_of(*node, hits == 0 ? first : push_farther(*node, at, t, first, hits, top));
        }
      } else if (!pop<kAny>(best.t, top, node, child)) {
        return true;
      }
      // What is below.
      for (;;) {
        if ((child & LSP_WIDE_NODE_BIT) != 0) {
          const uint32_t number = child & ~LSP_WIDE_NODE_BIT;
          at = node->node_first + number;
          // Where it lies is known sooner from where the first child does.
          node = advance(nodes_ + node->node_first, number);
          if (child != LSP_WIDE_NO_CHILD && at < node_count_) break;
        } else {
          if (left == 0) return false;
          --left;
          hit_leaf(*node, child, r, best);
          if (kAny && best.triangle != LSP_NONE) return true;
        }
        if (!pop<kAny>(best.t, top, node, child)) return true;
      }
    }
  }

  // The product has 32 bits: then it is not made one with another of 64.
  static HWY_INLINE const LspWideNode* advance(const LspWideNode* first, uint32_t number) {
    static_assert(sizeof(LspWideNode) * LSP_WIDE_NO_CHILD < 0xFFFFFFFFu);
    const uint32_t bytes = number * uint32_t{sizeof(LspWideNode)};
    return reinterpret_cast<const LspWideNode*>(reinterpret_cast<const uint8_t*>(first) + bytes);
  }

  // Of children `first` and those of `hits`, entered at t: the nearest is returned, the others wait, the
  // farthest lowest.
  HWY_INLINE uint32_t push_farther(const LspWideNode& node, uint32_t at, const float* t, uint32_t first,
                                   uint32_t hits, Waiting*& top) {
    const Waiting* const bottom = top;
    uint32_t nearest = first;
    do {
      auto child = static_cast<uint32_t>(std::countr_zero(hits));
      hits &= hits - 1;
      const bool is_nearer = t[child] < t[nearest];
      const uint32_t other = is_nearer ? nearest : child;
      nearest = is_nearer ? child : nearest;
      Waiting* place = top++;
      for (; place > bottom && place[-1].of.t < t[other]; --place) *place = place[-1];
      *place = {{.t = t[other]}, at << 3 | other};
      ask_for(node, child_of(node, other));
    } while (hits != 0);
    return nearest;
  }

  // Before it is known which of them are hit: of leaves and of nodes those that are likely to be (lines of
  // memory; children lie in the order of what they are worth to any-hit rays).
  HWY_INLINE void ask_for_children(const LspWideNode& node) const {
    const auto ask = [](const void* array, uint64_t bytes, uint32_t lines) HWY_ATTR {
      const uintptr_t first = reinterpret_cast<uintptr_t>(array) + bytes;
      for (uint32_t i = 0; i < lines; ++i) __builtin_prefetch(reinterpret_cast<const void*>(first + 64 * i));
    };
    ask(scene_.triangles, uint64_t{node.triangle_first} * sizeof(LspTriangle), 3);
    ask(nodes_, uint64_t{node.node_first} * sizeof(LspWideNode), 2);
  }

  // What waits is read later, if it is: it comes nearer meanwhile. Sponza 1.14 times as fast with it, the
  // bunny, whose tree is in the cache, the same.
  HWY_INLINE void ask_for(const LspWideNode& node, uint32_t child) const {
    static_assert(sizeof(LspWideNode) == 2 * sizeof(LspTriangle));
    const bool is_node = (child & LSP_WIDE_NODE_BIT) != 0;
    const uint32_t index = is_node ? node.node_first + (child & ~LSP_WIDE_NODE_BIT)
                                   : node.triangle_first + (child & LSP_WIDE_LEAF_FIRST_MASK);
    const auto array =
        is_node ? reinterpret_cast<uintptr_t>(nodes_) : reinterpret_cast<uintptr_t>(scene_.triangles);
    const uintptr_t first = array + (size_t{index} << (is_node ? 1 : 0)) * sizeof(LspTriangle);
    __builtin_prefetch(reinterpret_cast<const void*>(first));
    __builtin_prefetch(reinterpret_cast<const void*>(first + sizeof(LspWideNode) - 1));
  }

  // Takes what waits on top of the stack: a child of a node. False: nothing.
  template <bool kAny>
  HWY_INLINE bool pop(float best_t, Waiting*& top, const LspWideNode*& node, uint32_t& child) {
    if constexpr (kAny) {
      Waiting& group = top[-1];
      if (group.node == kNoNode) return false;
      node = nodes_ + group.node;
      child = child_of(*node, static_cast<uint32_t>(std::countr_zero(group.of.children)));
      group.of.children &= group.of.children - 1;
      top -= group.of.children == 0 ? 1 : 0;
    } else {
      --top;
      while (top->of.t > best_t) --top;
      const uint32_t waiting = top->node;
      if (waiting == kNoNode) return false;
      node = nodes_ + (waiting >> 3);
      child = child_of(*node, waiting & 7);
    }
    return true;
  }

  const lsp_scene& scene_;
  const LspWideNode* nodes_;
  const uint32_t node_count_, triangle_count_, most_;
  float most_largest_ = kTame;  // coordinate of an origin; none, where the scene's are not tame
  Batch batch_;
  Found<kBoxes + kLanes> found_;
  Waiting stack_[kStack];
};

void trace(const lsp_scene& scene, uint32_t flags, const LspRay* rays, LspHit* hits, uint64_t count) {
  Tracer tracer(scene);
  static_assert(sizeof tracer <= 20 * 1024);  // of the stack, as lsp/lsp.h says
  constexpr uint64_t kAtOnce = 1u << 30;      // numbers of rays have 32 bits
  for (uint64_t first = 0; first < count; first += kAtOnce) {
    const uint64_t here = std::min(count - first, kAtOnce);
    if ((flags & LSP_TRACE_ANY_HIT) != 0)
      tracer.trace<true>(rays + first, hits + first, here, flags);
    else
      tracer.trace<false>(rays + first, hits + first, here, flags);
  }
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace lsp
HWY_AFTER_NAMESPACE();
#endif

#if HWY_ONCE
namespace lsp {

const WideExact kWideExact[] = {
#include "simd_loops.inc"
};

const WideExact* wide_exact() { return best_here(kWideExact); }

}  // namespace lsp
#endif
