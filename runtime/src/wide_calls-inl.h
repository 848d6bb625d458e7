// Exact traces of cells, each in the cell's own small tree, across the lanes of vectors: for
// trace_cells_wide.cpp. A second text of lsp_test_leaf (lsp/cells.h) and of what that needs of lsp_setup,
// operation by operation.
//
// A call is a lane. What it needs of the file next differs from lane to lane, so that a vector waits for
// memory once where calls one after the other would wait as often as there are lanes, and nothing branches.
// Lanes at a node wait for those at a leaf and the other way round; calls that are over make room.
#if defined(LSP_WIDE_CALLS_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef LSP_WIDE_CALLS_INL_H
#undef LSP_WIDE_CALLS_INL_H
#else
#define LSP_WIDE_CALLS_INL_H
#endif

#include "wide_lanes-inl.h"

HWY_BEFORE_NAMESPACE();
namespace lsp {
namespace HWY_NAMESPACE {
namespace {

class Calls {
 public:
  static constexpr uint32_t kMost = 64;

  // In place of a triangle, of rays that are exact as a whole: one was met at a t beyond the cell by no more
  // than its rounding (of a plane along which the ray goes): whether it is hit, this call cannot tell.
  static constexpr uint32_t kUnsettled = LSP_NONE - 1;

  Calls(const lsp_scene& scene, const LspRay* rays, bool any_hit, bool exact_rays)
      : scene_(scene),
        grid_(scene.header->cells),
        rays_(rays),
        any_hit_(any_hit),
        exact_rays_(exact_rays),
        partial_((scene.header->required_features & LSP_FEATURE_COVERAGE) != 0) {
    for (uint32_t& mark : stack_[0]) mark = LSP_CELL_NO_CHILD;
  }

  // Under way.
  size_t size() const { return n_; }

  // Of rays' lanes at i, where they go on if nothing is hit, those that are set are to be traced exactly in
  // the filled cell of that number and corner (in cells), which they enter at t_in. begin() is to follow.
  template <size_t kFrom>
  HWY_INLINE void add(const Rays<kFrom>& from, size_t i, Bits lanes, VU cell, const V3& corner, VF t_in) {
    of_.take(from, i, lanes, n_ + added_);
    const VI order = lane_order(lanes);
    const auto of_f = hn::IndicesFromVec(df, order);
    const auto put = [&](VF v, float* to)
                         HWY_ATTR { store(hn::TableLookupLanes(v, of_f), to + n_ + added_); };
    store(hn::TableLookupLanes(cell, hn::IndicesFromVec(du, order)), ref_ + n_ + added_);
    put(corner.x, plus_[0]);
    put(corner.y, plus_[1]);
    put(corner.z, plus_[2]);
    put(t_in, tmin_);
    added_ += static_cast<size_t>(std::popcount(lanes));
  }

  // Makes ready what has been added.
  HWY_INLINE void begin(uint32_t ray_count) {
    for (size_t i = n_; i < n_ + added_; i += kLanes) set_up(i, set_u(ray_count));
    for (size_t k = n_; k < n_ + added_; ++k) {
      number_[k] = static_cast<uint32_t>(std::countr_zero(free_));
      free_ &= free_ - 1;
      fetch(scene_.cell_nodes, node_first_[k] + (ref_[k] < LSP_CELL_LEAF_BIT ? ref_[k] : 0));
      fetch(scene_.cell_references, reference_first_[k]);
    }
    n_ += added_;
    added_ = 0;
  }

  // Goes on with them until no more than `most` are under way. Those that hit something go to
  // found(ray, best), vectors of those that do not to missed(rays, first, lanes).
  template <class Found, class Missed>
  HWY_INLINE void trace(size_t most, Found found, Missed missed) {
    while (n_ > most) {
      Bits over = 0;
      for (size_t i = 0; i < n_; i += kLanes) descend(i, n_);
      for (size_t i = 0; i < n_; i += kLanes) over |= test_or_wait(i, n_) << i;
      const auto done = static_cast<size_t>(std::popcount(over));
      if (done < kLanes && n_ - done > most) continue;
      Bits hit = 0;
      LSP_FOR_BITS(k, over) {
        free_ |= Bits{1} << number_[k];
        if (triangle_[k] == LSP_NONE) continue;
        hit |= Bits{1} << k;
        found(of_.ray_[k], best_of(k));
      }
      for (size_t i = 0; i < n_; i += kLanes)
        if (const Bits lanes = lanes_of(over & ~hit, i); lanes != 0) missed(of_, i, lanes);
      compact(over);
    }
  }

 private:
  template <typename T>
  using Of = T[kMost + kLanes];

  // What t is off by at most, times the cosine that plane_depth divides by, over the largest coordinate of
  // the triangle from the ray's origin: 64 u times the lengths of two edges of at most 2 sqrt(3).
  static constexpr float kRounding = 64 * 0x1p-24f * 12;

  // lsp_setup and the beginning of lsp_test_leaf, of rays that are valid: of what add() says.
  HWY_INLINE void set_up(size_t i, VU ray_count) {
    VU record[8], tree[4];
    const auto* words = reinterpret_cast<const uint32_t*>(rays_);
    load_records<sizeof(LspRay) / 4>(words, load(of_.ray_ + i), ray_count, record);
    load_records<sizeof(LspRay) / 4>(words + 4, load(of_.ray_ + i), ray_count, record + 4);
    const auto* cells = or_zero(scene_.filled_cells, scene_.header->filled_cell_count);
    load_records<sizeof(LspFilledCell) / 4>(&cells->root, load(ref_ + i),
                                            set_u(scene_.header->filled_cell_count), tree);
    store(tree[0], ref_ + i);
    store(tree[1], node_first_ + i);
    store(tree[2], reference_first_ + i);
    store(hn::Min(tree[3], set_u(LSP_CELL_LEAF_BIT)), max_steps_ + i);
    store(set_u(1), top_ + i);
    store(hn::Zero(du), step_ + i);
    store(set_u(LSP_NONE), triangle_ + i);
    store(set_u(LSP_NONE), next_ + i);
    store(hn::Zero(du), primitive_ + i);
    store(hn::Zero(df), u_ + i);
    store(hn::Zero(df), v_ + i);

    const V3 o = floats(record), d = floats(record + 4);
    const V3 size = {hn::Abs(d.x), hn::Abs(d.y), hn::Abs(d.z)};
    const V3 direction = scale(d).direction;
    const VF beyond = hn::Div(set(grid_.margin), hn::Sqrt(dot(direction, direction)));
    store(max_of(load(of_.tmin_ + i), hn::Sub(load(tmin_ + i), beyond)), tmin_ + i);
    store(min_of(load(of_.tmax_ + i), hn::Add(load(of_.t_ + i), beyond)), t_ + i);
    set_slabs(i, o, {reciprocal(direction.x), reciprocal(direction.y), reciprocal(direction.z)});

    const MF x_ge_y = hn::Ge(size.x, size.y);
    const MF at_x = hn::And(x_ge_y, hn::Ge(size.x, size.z)),
             at_y = hn::AndNot(x_ge_y, hn::Ge(size.y, size.z));
    const V3 p = rotated(direction, at_x, at_y);
    store_3(rotated(o, at_x, at_y), origin_, i);
    store_3(p, direction_, i);
    store_3({hn::Div(p.x, p.z), hn::Div(p.y, p.z), hn::Div(set(1.0f), p.z)}, shear_, i);
    store(hn::IfThenZeroElse(as_uint(at_x), select(as_uint(at_y), set_u(1), set_u(2))), axis_ + i);
  }

  // Boxes are grown by moving the origin: origin_plus and origin_minus.
  HWY_INLINE void set_slabs(size_t i, const V3& o, const V3& inverse) {
    const lsp_float3 &lo = scene_.header->bounds_min, &hi = scene_.header->bounds_max;
    const auto away = [&](float from, float to, VF x) HWY_ATTR {
      return max_of(hn::Abs(hn::Sub(set(from), x)), hn::Abs(hn::Sub(set(to), x)));
    };
    const VF reach = max_of(max_of(away(lo.x, hi.x, o.x), away(lo.y, hi.y, o.y)), away(lo.z, hi.z, o.z));
    const VF err = hn::Add(hn::Mul(reach, set(9.5367432e-7f)), hn::Mul(largest(o), set(2.3841858e-7f)));
    const auto slab = [&](float grid_lo, VF x, VF by, size_t k) HWY_ATTR {
      const VF at = hn::Add(set(grid_lo - grid_.margin), hn::Mul(load(plus_[k] + i), set(grid_.size)));
      store(hn::Mul(by, set(grid_.box_step)), unit_[k] + i);
      store(hn::Mul(hn::Sub(at, hn::Add(x, err)), by), plus_[k] + i);
      store(hn::Mul(hn::Sub(at, hn::Sub(x, err)), by), minus_[k] + i);
    };
    slab(grid_.lo.x, o.x, inverse.x, 0);
    slab(grid_.lo.y, o.y, inverse.y, 1);
    slab(grid_.lo.z, o.z, inverse.z, 2);
  }

  // lsp_rotate.
  static HWY_INLINE V3 rotated(const V3& v, MF at_x, MF at_y) {
    return {along({v.y, v.z, v.x}, at_x, at_y), along({v.z, v.x, v.y}, at_x, at_y), along(v, at_x, at_y)};
  }

  // A byte of each lane, as a number.
  template <int kShift>
  static HWY_INLINE VF byte_of(VU word) {
    VU byte = word;
    if constexpr (kShift != 0) byte = hn::ShiftRight<kShift>(byte);
    if constexpr (kShift != 24) byte = hn::And(byte, set_u(0xFF));
    return hn::ConvertTo(df, hn::BitCast(di, byte));
  }

  // lsp_cell_box: whether the box is hit, and where it is entered.
  struct Slabs {
    V3 unit, plus, minus;
    VF first, last;
  };
  static HWY_INLINE MF meets(const Slabs& s, const V3& lo, const V3& hi, VF& t_in) {
    const V3 a = {hn::Add(hn::Mul(lo.x, s.unit.x), s.plus.x), hn::Add(hn::Mul(lo.y, s.unit.y), s.plus.y),
                  hn::Add(hn::Mul(lo.z, s.unit.z), s.plus.z)};
    const V3 b = {hn::Add(hn::Mul(hi.x, s.unit.x), s.minus.x), hn::Add(hn::Mul(hi.y, s.unit.y), s.minus.y),
                  hn::Add(hn::Mul(hi.z, s.unit.z), s.minus.z)};
    t_in = max_of(max_of(min_of(a.x, b.x), min_of(a.y, b.y)), max_of(min_of(a.z, b.z), s.first));
    const VF t_out = min_of(min_of(max_of(a.x, b.x), max_of(a.y, b.y)), min_of(max_of(a.z, b.z), s.last));
    return hn::And(hn::Le(t_in, t_out), hn::Le(t_in, s.last));
  }

  // A step of those that are at a node.
  HWY_INLINE void descend(size_t i, size_t n) {
    const VU ref = load(ref_ + i), step = load(step_ + i);
    const MU at_node = hn::And(hn::And(as_uint(first_lanes(n - i)), hn::Lt(ref, set_u(LSP_CELL_LEAF_BIT))),
                               hn::Lt(step, load(max_steps_ + i)));
    if (bits_of(as_float(at_node)) == 0) return;
    VU node[4];
    const auto* nodes = or_zero(scene_.cell_nodes, scene_.header->cell_node_count);
    load_records<sizeof(LspCellNode) / 4>(&nodes->box_0, hn::Add(load(node_first_ + i), ref),
                                          hn::IfThenElseZero(at_node, set_u(scene_.header->cell_node_count)),
                                          node);
    const Slabs slabs = {load_3(unit_, i), load_3(plus_, i), load_3(minus_, i), load(tmin_ + i),
                         load(t_ + i)};
    VF t_0, t_1;
    const MF in_0 = meets(slabs, {byte_of<0>(node[0]), byte_of<8>(node[0]), byte_of<16>(node[0])},
                          {byte_of<24>(node[0]), byte_of<0>(node[1]), byte_of<8>(node[1])}, t_0);
    const MF in_1 = meets(slabs, {byte_of<16>(node[1]), byte_of<24>(node[1]), byte_of<0>(node[2])},
                          {byte_of<8>(node[2]), byte_of<16>(node[2]), byte_of<24>(node[2])}, t_1);
    const MU is_0_nearer = as_uint(hn::And(in_0, hn::Or(hn::Not(in_1), hn::Le(t_0, t_1))));
    const MU both = hn::And(at_node, as_uint(hn::And(in_0, in_1)));
    const MU none = hn::AndNot(as_uint(hn::Or(in_0, in_1)), at_node);
    const VU child_0 = hn::And(node[3], set_u(0xFFFF)), child_1 = hn::ShiftRight<16>(node[3]);
    const VU top = load(top_ + i), number = load(number_ + i), below = hn::Sub(top, set_u(1));
    // Read before it is written: what has been written last would be waited for.
    const VU popped = load_words(&stack_[0][0], hn::Add(hn::Mul(below, set_u(kMost)), number), none);
    // What is not to wait goes to a row of its own.
    const VU row = select(both, top, set_u(LSP_CELL_STACK));
    hn::ScatterIndex(select(is_0_nearer, child_1, child_0), du, &stack_[0][0],
                     hn::BitCast(di, hn::Add(hn::Mul(row, set_u(kMost)), hn::IfThenElseZero(both, number))));
    const VU next = select(none, popped, select(is_0_nearer, child_0, child_1));
    store(select(at_node, next, ref), ref_ + i);
    const VU pushed = hn::Min(hn::Add(top, set_u(1)), set_u(LSP_CELL_STACK - 1));
    store(select(both, pushed, select(none, hn::Max(below, set_u(1)), top)), top_ + i);
    store(select(at_node, hn::Add(step, set_u(1)), step), step_ + i);
  }

  // Tests a triangle of those that are at a leaf, unless more of the others could be. Those that are over are
  // returned.
  HWY_INLINE Bits test_or_wait(size_t i, size_t n) {
    const VU ref = load(ref_ + i);
    const MU here = as_uint(first_lanes(n - i));
    const MU is_node = hn::Lt(ref, set_u(LSP_CELL_LEAF_BIT)),
             goes_on = hn::Lt(load(step_ + i), load(max_steps_ + i));
    const MU at_leaf = hn::AndNot(hn::Or(is_node, hn::Eq(ref, set_u(LSP_CELL_NO_CHILD))), here);
    const Bits leaves = bits_of(as_float(at_leaf));
    const Bits nodes = bits_of(as_float(hn::And(here, hn::And(is_node, goes_on))));
    const MU known = hn::And(at_leaf, hn::Ne(load(next_ + i), set_u(LSP_NONE)));
    const Bits ready = bits_of(as_float(known));
    const int others = std::popcount(nodes);
    if (ready != 0 && std::popcount(ready) >= others)
      test(i, known, ref);
    else if (leaves != 0 && std::popcount(leaves) >= others)
      look(i, at_leaf, ref);
    return bits_of(as_float(here)) & ~leaves & ~nodes;
  }

  // Of those at a leaf whose triangle is not known, which it is.
  HWY_INLINE void look(size_t i, MU at_leaf, VU ref) {
    const VU known = load(next_ + i);
    const MU asked = hn::And(at_leaf, hn::Eq(known, set_u(LSP_NONE)));
    const Bits lanes = bits_of(as_float(asked));
    if (lanes == 0) return;
    const VU first = hn::And(ref, set_u(LSP_CELL_MAX_REFERENCES - 1));
    const VU reference = hn::Add(load(reference_first_ + i), first);
    const MU there = hn::And(asked, hn::Lt(reference, set_u(scene_.header->cell_reference_count)));
    store(select(asked, load_words(scene_.cell_references, reference, there), known), next_ + i);
    LSP_FOR_BITS(k, lanes) fetch(scene_.triangles, next_[i + k]);
  }

  // lsp_triangle.
  HWY_INLINE void test(size_t i, MU at_leaf, VU ref) {
    const VU number = load(next_ + i);
    store(select(at_leaf, set_u(LSP_NONE), number), next_ + i);
    VU record[3][4];
    const auto* triangles = or_zero(scene_.triangles, scene_.header->triangle_count);
    const VU count = hn::IfThenElseZero(at_leaf, set_u(scene_.header->triangle_count));
    for (size_t c = 0; c < 3; ++c)
      load_records<sizeof(LspTriangle) / 4>(reinterpret_cast<const uint32_t*>(triangles) + 4 * c, number,
                                            count, record[c]);
    const VU axis = load(axis_ + i);
    const MF at_x = as_float(hn::Eq(axis, hn::Zero(du))), at_y = as_float(hn::Eq(axis, set_u(1)));
    const V3 origin = load_3(origin_, i), shear = load_3(shear_, i);
    const auto corner = [&](const VU* r) HWY_ATTR { return minus(rotated(floats(r), at_x, at_y), origin); };
    const V3 a = corner(record[0]), b = corner(record[1]), c = corner(record[2]);
    const Passages<DF> passes = pass<DF>(a, b, c, shear.x, shear.y);
    const MF met = hn::And(as_float(at_leaf), passes.met);
    Bits unsettled = 0;
    if (bits_of(met) != 0) unsettled = keep(i, met, a, b, c, shear.z, passes, number, record[0][3]);

    const MU is_last = hn::Eq(hn::And(ref, set_u(3u << LSP_CELL_LEAF_COUNT_SHIFT)), hn::Zero(du));
    const VU top = load(top_ + i), below = hn::Sub(top, set_u(1));
    const MU pops = hn::And(at_leaf, is_last);
    const VU popped =
        load_words(&stack_[0][0], hn::Add(hn::Mul(below, set_u(kMost)), load(number_ + i)), pops);
    VU next = select(is_last, popped, hn::Sub(ref, set_u((1u << LSP_CELL_LEAF_COUNT_SHIFT) - 1)));
    if (any_hit_)
      next = select(hn::And(is_last, hn::Ne(load(triangle_ + i), set_u(LSP_NONE))), set_u(LSP_CELL_NO_CHILD),
                    next);
    if (unsettled != 0) [[unlikely]]
      next = select(as_uint(mask_of(unsettled)), set_u(LSP_CELL_NO_CHILD), next);
    store(select(at_leaf, next, ref), ref_ + i);
    store(select(pops, hn::Max(below, set_u(1)), top), top_ + i);
  }

  // Of the triangles that rays pass through those that are nearer than what they have. Returned are rays that
  // are not settled.
  HWY_INLINE Bits keep(size_t i, MF met, const V3& a, const V3& b, const V3& c, VF shear_z,
                       const Passages<DF>& passes, VU number, VU primitive) {
    VF across;
    const VF t = plane_depth<DF>(load_3(direction_, i), shear_z, a, b, c, passes, &across),
             best = load(t_ + i);
    const MF before = as_float(hn::Lt(primitive, load(primitive_ + i)));
    const MF nearer = hn::Or(hn::Lt(t, best), hn::And(hn::Eq(t, best), before));
    MF kept = hn::And(met, hn::And(hn::Gt(t, load(tmin_ + i)), nearer));
    if (partial_) [[unlikely]]
      kept = mask_of(bits_of(kept) & ~passed(i, bits_of(kept), number));
    const auto put = [&](auto v, auto* to) HWY_ATTR {
      const auto m = hn::RebindMask(hn::DFromV<decltype(v)>(), kept);
      store(hn::IfThenElse(m, v, load(to + i)), to + i);
    };
    put(t, t_);
    put(hn::Div(passes.v, passes.det), u_);
    put(hn::Div(passes.w, passes.det), v_);
    put(number, triangle_);
    put(primitive, primitive_);
    if (!exact_rays_) return 0;
    // Before the cell or behind it, and of the ray still; behind a hit it does not matter.
    const VF first = load(tmin_ + i);
    const MF is_early = hn::And(hn::Le(t, first), hn::Gt(t, load(of_.tmin_ + i)));
    const MF is_late = hn::And(hn::And(hn::Gt(t, best), hn::Lt(t, load(of_.tmax_ + i))),
                               as_float(hn::Eq(load(triangle_ + i), set_u(LSP_NONE))));
    const VF far_out = max_of(max_of(largest(a), largest(b)), largest(c));
    const VF beyond = hn::Mul(hn::Abs(across), max_of(hn::Sub(first, t), hn::Sub(t, best)));
    const MF unsettled =
        hn::And(hn::And(met, hn::Or(is_early, is_late)), hn::Le(beyond, hn::Mul(far_out, set(kRounding))));
    kept = unsettled;
    put(set_u(kUnsettled), triangle_);
    return bits_of(unsettled);
  }

  // Of lanes those whose triangle is not there for their ray.
  HWY_NOINLINE Bits passed(size_t i, Bits lanes, VU number) {
    HWY_ALIGN uint32_t numbers[kLanes];
    hn::Store(number, du, numbers);
    Bits out = 0;
    LSP_FOR_BITS(k, lanes)
    if (is_passed<Text>(lsp_load_triangle(scene_, numbers[k]), rays_[of_.ray_[i + k]])) out |= Bits{1} << k;
    return out;
  }

  Best best_of(size_t k) const {
    Best best{};
    best.t = t_[k];
    best.u = u_[k];
    best.v = v_[k];
    best.triangle = triangle_[k];
    best.primitive = primitive_[k];
    return best;
  }

  // Those that are not over, into the first lanes.
  HWY_INLINE void compact(Bits over) {
    size_t at = 0;
    for (size_t i = 0; i < n_; i += kLanes) {
      const Bits on = lanes_of(~over, i, n_);
      of_.take(of_, i, on, at);
      const Mover move(i, at, on);
      for (size_t k = 0; k < 3; ++k)
        for (auto* values : {&unit_[k], &plus_[k], &minus_[k], &origin_[k], &shear_[k], &direction_[k]})
          move(*values, *values);
      for (auto* values : {&tmin_, &t_, &u_, &v_}) move(*values, *values);
      for (auto* values : {&ref_, &top_, &step_, &node_first_, &max_steps_, &reference_first_, &axis_,
                           &triangle_, &next_, &primitive_, &number_})
        move(*values, *values);
      at += static_cast<size_t>(std::popcount(on));
    }
    n_ = at;
  }

  const lsp_scene& scene_;
  const LspCellGrid& grid_;
  const LspRay* rays_;
  const bool any_hit_;
  const bool exact_rays_;
  const bool partial_;  // some triangles are there in part
  size_t n_ = 0;        // under way; behind them what begins
  size_t added_ = 0;
  Bits free_ = ~Bits{0};  // rows of the stack
  Rays<kMost> of_;
  // Of boxes: their unit along the ray, and the cell's corner from the origin moved outwards.
  Of<float> unit_[3], plus_[3], minus_[3];
  Of<float> origin_[3], shear_[3], direction_[3];  // the ray's axis last
  Of<float> tmin_, t_, u_, v_;                     // t, u, v, triangle, primitive: the best so far
  Of<uint32_t> triangle_, primitive_;
  Of<uint32_t> next_;  // the triangle that is tested next; LSP_NONE: it is not known
  Of<uint32_t> ref_, top_, step_, node_first_, max_steps_, reference_first_, axis_, number_;
  uint32_t stack_[LSP_CELL_STACK + 1][kMost];  // by a call's number; what never waits goes to the last row
};

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace lsp
HWY_AFTER_NAMESPACE();

#endif
