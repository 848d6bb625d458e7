// Exact traces of cells, each in the cell's own small tree, several in turn, so that none waits for its
// triangles: for trace_cells_wide.cpp. A second text of lsp_test_leaf (lsp/cells.h) as far as its boxes; the
// boxes of a node's two children are tested side by side. The triangles are tested by that text itself.
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
    const LspCellGrid& grid = scene.header->cells;
    lane_ = lane;
    s_ = Text::lsp_setup(scene, ray);
    const float reach = grid.margin / s_.speed;
    s_.tmin = Text::lsp_max(s_.tmin, t_in - reach);
    s_.tmax = Text::lsp_min(s_.tmax, t_out + reach);
    best_ = Text::lsp_no_best(s_);
    const vec3 corner = lsp_vec3(grid.lo) - vec3(grid.margin, grid.margin, grid.margin) +
                        Text::lsp_cell_corner(cell) * grid.size;
    const vec3 unit = s_.inverse * grid.box_step;
    const vec3 plus = (corner - s_.origin_plus) * s_.inverse;
    const vec3 minus = (corner - s_.origin_minus) * s_.inverse;
    for (int k = 0; k < 3; ++k) {
      unit_[k] = unit[k];
      for (int side = 0; side < 4; ++side) corner_[k][side] = side % 2 == 0 ? plus[k] : minus[k];
    }
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
    const auto first = hn::Set(d, s_.tmin), last = hn::Set(d, best_.t);
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
      const uint32_t hit = bits_of_4(hn::And(hn::Le(t_in, t_out), hn::Le(t_in, last)));
      const bool in_0 = (hit & 1u) != 0, in_1 = (hit & 4u) != 0;
      const bool is_0_nearer = in_0 && (!in_1 || (bits_of_4(hn::Le(t_in, hn::Shuffle1032(t_in))) & 1u) != 0);
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
    for (uint32_t i = 0; i < count_; ++i)
      best_ = Text::lsp_triangle(scene, s_, lsp_load_cell_reference(scene, first_ + i), best_);
    if (top_ <= 1 || (any_hit && best_.triangle != LSP_NONE)) return false;
    ref_ = stack_[--top_];
    return true;
  }

 private:
  using D4 = hn::CappedTag<float, 4>;
  using V4 = hn::Vec<D4>;

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
  static HWY_INLINE uint32_t bits_of_4(hn::Mask<D4> mask) {
    uint8_t bytes[8] = {};
    hn::StoreMaskBits(D4(), mask, bytes);
    return bytes[0];
  }

  alignas(16) float corner_[3][4];  // from the origin moved outwards, as lo and hi take it
  float unit_[3];
  uint32_t lane_;
  Text::LspSetup s_;
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
