// Exact traces of cells, each in the cell's own small tree, several in turn, so that none waits for its
// triangles: for trace_cells_wide.cpp. A second text of lsp_test_leaf (lsp/cells.h) and of lsp_setup; the
// boxes of a node's two children are tested side by side, and so are a leaf's triangles
// (wide_triangles-inl.h).
#if defined(LSP_WIDE_EXACT_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef LSP_WIDE_EXACT_INL_H
#undef LSP_WIDE_EXACT_INL_H
#else
#define LSP_WIDE_EXACT_INL_H
#endif

#include "wide_lanes-inl.h"

HWY_BEFORE_NAMESPACE();
namespace lsp {
namespace HWY_NAMESPACE {
namespace {

// How far the exact trace of a cell has come, of one of several in turn: lsp_test_leaf in stages.
class ExactTrace {
 public:
  uint32_t lane() const { return lane_; }
  const Text::LspBest& best() const { return best_; }

  // Of `ray` in `cell`, the filled one of number `index`, which it enters at t_in and leaves at t_out.
  HWY_INLINE void begin(const lsp_scene& scene, const LspRay& ray, uint32_t lane, uint32_t index,
                        const ivec3& cell, float t_in, float t_out) {
    lane_ = lane;
    ray_ = &ray;
    set_ray(scene, ray, t_in, t_out);
    set_slabs(scene.header->cells, cell);
    tree_ = lsp_load_cell_tree(scene, index);
    ref_ = tree_.root;
    step_ = 0;
    top_ = 1;
    stack_[0] = LSP_CELL_NO_CHILD;
  }

  // Down to the next leaf, and asks for its triangles. False: there is none.
  HWY_INLINE bool descend(const lsp_scene& scene) {
    const D4 d;
    const auto unit_x = hn::Set(d, unit_[0]), unit_y = hn::Set(d, unit_[1]), unit_z = hn::Set(d, unit_[2]);
    const auto corner_x = hn::Load(d, corner_[0]), corner_y = hn::Load(d, corner_[1]),
               corner_z = hn::Load(d, corner_[2]);
    const auto first = hn::Set(d, tmin_), last = hn::Set(d, best_.t);
    uint32_t ref = ref_, top = top_, step = step_;
    while (ref < LSP_CELL_LEAF_BIT && step < tree_.max_steps) {
      ++step;
      const LspCellNode& node = lsp_load_cell_node(scene, tree_.node_first + ref);
      const auto x = slabs(node, kBytesX, unit_x, corner_x);
      const auto y = slabs(node, kBytesY, unit_y, corner_y);
      const auto z = slabs(node, kBytesZ, unit_z, corner_z);
      // lsp_cell_box: in lanes 0 and 2 those of the children. The others are not read.
      const auto t_in = max_of(max_of(smaller_of(x), smaller_of(y)), max_of(smaller_of(z), first));
      const auto t_out = min_of(min_of(larger_of(x), larger_of(y)), min_of(larger_of(z), last));
      const uint32_t hit = mask_bits(d4, hn::And(hn::Le(t_in, t_out), hn::Le(t_in, last)));
      const bool in_0 = (hit & 1u) != 0, in_1 = (hit & 4u) != 0;
      const bool is_0_nearer =
          in_0 && (!in_1 || (mask_bits(d4, hn::Le(t_in, hn::Shuffle1032(t_in))) & 1u) != 0);
      const uint32_t child_0 = node.children & 0xFFFFu, child_1 = node.children >> 16u;
      const bool both = in_0 && in_1, none = !in_0 && !in_1;
      // Selected without branches, which would be taken as often as not.
      stack_[top] = is_0_nearer ? child_1 : child_0;
      const uint32_t popped = stack_[top - 1];
      ref = none ? popped : (is_0_nearer ? child_0 : child_1);
      top = both ? (top + 1 < LSP_CELL_STACK ? top + 1 : top) : (none && top > 1 ? top - 1 : top);
    }
    ref_ = ref;
    top_ = top;
    step_ = step;
    if (ref < LSP_CELL_LEAF_BIT || ref == LSP_CELL_NO_CHILD) return false;
    first_ = tree_.reference_first + (ref & (LSP_CELL_MAX_REFERENCES - 1u));
    count_ = ((ref >> LSP_CELL_LEAF_COUNT_SHIFT) & 3u) + 1u;
    for (uint32_t i = 0; i < count_; ++i) fetch(scene.triangles, lsp_load_cell_reference(scene, first_ + i));
    return true;
  }

  // Tests the leaf. False: there is nothing more to do.
  HWY_INLINE bool test(const lsp_scene& scene, bool any_hit) {
    const LspTriangle* records[kLeafLanes];
    uint32_t numbers[kLeafLanes];
    for (uint32_t i = 0; i < kLeafLanes; ++i) {  // where there are fewer, the last stands for the others
      numbers[i] = lsp_load_cell_reference(scene, first_ + (i < count_ ? i : count_ - 1));
      records[i] = &lsp_load_triangle(scene, numbers[i]);
    }
    const Bytes rotation = hn::Load(hn::Repartition<uint8_t, D4>(), kRotations[axis_]);
    const auto number_of = [&](uint32_t lane) HWY_ATTR { return numbers[lane]; };
    hit_triangles<Text>(scene, records, count_, {rows_[0], rows_[1], rows_[2], tmin_, rotation, ray_},
                        number_of, best_);
    if (top_ <= 1 || (any_hit && best_.triangle != LSP_NONE)) return false;
    ref_ = stack_[--top_];
    return true;
  }

 private:
  // lsp_setup, operation by operation, of a ray that is valid, its axes side by side and nothing decided by a
  // branch.
  HWY_INLINE void set_ray(const lsp_scene& scene, const LspRay& ray, float t_in, float t_out) {
    const hn::RebindToUnsigned<D4> du;
    // What follows them in the header is read with them and not heeded.
    const lsp_float3 &lo = scene.header->bounds_min, &hi = scene.header->bounds_max;
    const V4 o = first_three(hn::LoadU(d4, &ray.origin.x)), d = first_three(hn::LoadU(d4, &ray.direction.x));
    const V4 size = hn::Abs(d), largest = largest_lane(size);
    const auto exponent = hn::Min(hn::ShiftRight<23>(hn::BitCast(du, largest)), hn::Set(du, uint32_t{253}));
    const V4 shrink = hn::BitCast(d4, hn::ShiftLeft<23>(hn::Sub(hn::Set(du, uint32_t{254}), exponent)));
    const V4 shrunk = hn::Mul(d, shrink), zero = hn::Zero(d4), one = hn::Set(d4, 1.0f);
    const V4 direction = hn::IfThenZeroElse(hn::Lt(hn::Abs(shrunk), hn::Set(d4, 8.6736174e-19f)), shrunk);
    const M4 is_zero = hn::Eq(direction, zero);
    inverse_ = hn::IfThenElse(is_zero, hn::Set(d4, 1.2089258e24f),
                              hn::Div(one, hn::IfThenElse(is_zero, one, direction)));
    const V4 below = hn::Abs(hn::Sub(first_three(hn::LoadU(d4, &lo.x)), o));
    const V4 above = hn::Abs(hn::Sub(first_three(hn::LoadU(d4, &hi.x)), o));
    const V4 err = hn::Add(hn::Mul(largest_lane(hn::Max(below, above)), hn::Set(d4, 9.5367432e-7f)),
                           hn::Mul(largest_lane(hn::Abs(o)), hn::Set(d4, 2.3841858e-7f)));
    origin_plus_ = hn::Add(o, err);
    origin_minus_ = hn::Sub(o, err);

    axis_ = static_cast<uint32_t>(std::countr_zero(mask_bits(d4, hn::Eq(size, largest))));
    const Bytes rotation = hn::Load(hn::Repartition<uint8_t, D4>(), kRotations[axis_]);
    const V4 p = rotated(direction, rotation);
    hn::Store(rotated(o, rotation), d4, rows_[0]);
    hn::Store(hn::Div(hn::IfThenElse(hn::FirstN(d4, 2), p, one), hn::Broadcast<2>(p)), d4, rows_[1]);
    hn::Store(p, d4, rows_[2]);

    HWY_ALIGN float squares[4];
    hn::Store(hn::Mul(direction, direction), d4, squares);
    const float reach = scene.header->cells.margin / std::sqrt(squares[0] + squares[1] + squares[2]);
    const float to_scaled = hn::GetLane(hn::BitCast(d4, hn::ShiftLeft<23>(exponent)));
    const float step = uintBitsToFloat(1u) * to_scaled;
    tmin_ = Text::lsp_max(ray.tmin * to_scaled + step, t_in - reach);
    const float last = Text::lsp_min(ray.tmax, LSP_FLOAT_MAX) * to_scaled - step;
    Text::LspSetup s;
    s.tmax = Text::lsp_min(Text::lsp_min(last, LSP_FLOAT_MAX), t_out + reach);
    best_ = Text::lsp_no_best(s);
  }

  // Planes of nodes' boxes in lengths of the ray, from the origin moved outwards.
  HWY_INLINE void set_slabs(const LspCellGrid& grid, const ivec3& cell) {
    const vec3 at = lsp_vec3(grid.lo) - vec3(grid.margin, grid.margin, grid.margin) +
                    Text::lsp_cell_corner(cell) * grid.size;
    // Put together in registers: what was stored a number at a time could not be loaded as a whole at once.
    const V4 corner = hn::IfThenElse(hn::FirstN(d4, 1), hn::Set(d4, at.x),
                                     hn::IfThenElse(hn::FirstN(d4, 2), hn::Set(d4, at.y), hn::Set(d4, at.z)));
    const V4 plus = hn::Mul(hn::Sub(corner, origin_plus_), inverse_);
    const V4 minus = hn::Mul(hn::Sub(corner, origin_minus_), inverse_);
    hn::Store(hn::Mul(inverse_, hn::Set(d4, grid.box_step)), d4, unit_);
    const V4 xy = hn::InterleaveLower(d4, plus, minus), z = hn::InterleaveUpper(d4, plus, minus);
    hn::Store(hn::ConcatLowerLower(d4, xy, xy), d4, corner_[0]);
    hn::Store(hn::ConcatUpperUpper(d4, xy, xy), d4, corner_[1]);
    hn::Store(hn::ConcatLowerLower(d4, z, z), d4, corner_[2]);
  }

  static HWY_INLINE V4 first_three(V4 v) { return hn::IfThenElseZero(hn::FirstN(d4, 3), v); }
  // The largest of four lanes, none of them a NaN, in all of them.
  static HWY_INLINE V4 largest_lane(V4 v) {
    const V4 pairs = hn::Max(v, hn::Shuffle2301(v));
    return hn::Max(pairs, hn::Shuffle1032(pairs));
  }

  // Of a node's boxes: lo and hi of child 0, lo and hi of child 1, along an axis.
  alignas(16) static constexpr uint8_t kBytesX[16] = {0, 128, 128, 128, 3, 128, 128, 128,
                                                      6, 128, 128, 128, 9, 128, 128, 128};
  alignas(16) static constexpr uint8_t kBytesY[16] = {1, 128, 128, 128, 4,  128, 128, 128,
                                                      7, 128, 128, 128, 10, 128, 128, 128};
  alignas(16) static constexpr uint8_t kBytesZ[16] = {2, 128, 128, 128, 5,  128, 128, 128,
                                                      8, 128, 128, 128, 11, 128, 128, 128};
  static HWY_INLINE V4 slabs(const LspCellNode& node, const uint8_t* bytes, V4 unit, V4 corner) {
    const D4 d;
    const hn::Repartition<uint8_t, D4> d8;
    const hn::RebindToSigned<D4> d_int;
    const auto planes =
        hn::TableLookupBytesOr0(hn::LoadU(d8, reinterpret_cast<const uint8_t*>(&node)), hn::Load(d8, bytes));
    return hn::Add(hn::Mul(hn::ConvertTo(d, hn::BitCast(d_int, planes)), unit), corner);
  }
  static HWY_INLINE V4 smaller_of(V4 planes) { return min_of(planes, hn::Shuffle2301(planes)); }
  static HWY_INLINE V4 larger_of(V4 planes) { return max_of(planes, hn::Shuffle2301(planes)); }

  alignas(16) float corner_[3][4];  // from the origin moved outwards, as lo and hi take it
  alignas(16) float unit_[4];
  alignas(16) float rows_[3][4];  // origin, shear and direction, the ray's axis last
  V4 inverse_, origin_plus_, origin_minus_;
  float tmin_;
  uint32_t axis_, lane_;
  const LspRay* ray_;
  Text::LspBest best_;
  LspFilledCell tree_;
  uint32_t ref_, top_, step_, first_, count_;
  uint32_t stack_[LSP_CELL_STACK + 1];
};

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace lsp
HWY_AFTER_NAMESPACE();

#endif
