// Rays of a scene of cells across the lanes of a vector (Google Highway), compiled for each instruction set
// and chosen when a trace is asked for.
//
// A pool of rays goes round by round, one cell a ray and round. A round has stages, and each asks for what
// the next one reads, for all rays of the pool, so that no ray waits for memory alone (as trace_group.h does
// it for trees): to the next cell and its entry; what the entry says; the side of a split; the plane. Rays
// that are done make room for new ones, whose first cells are looked at apart from the others': only there
// origin tables are asked. Rays that are to be traced exactly in a cell leave the pool for lanes of their own
// (wide_calls-inl.h), and come back if they hit nothing there.
//
// Exact rays ask no table: each cell that they come to is traced exactly until one has a hit. What numbers do
// not settle (Calls::kUnsettled) and rays from afar are traced again by the tree, so that the hits are its.
//
// This is a second text of what lsp/cells.h says from lsp_begin to lsp_cell_meet, and of the half of
// lsp_setup (lsp/traverse.h) that this needs, operation by operation: nothing is contracted, and comparisons
// and selections stand for min and max, so that a lane has the bits of a single ray. tests/agreement/
// test_wide_cells.cpp compares the two.
#include "trace_cells_wide.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "simd_targets.h"
#include "trace_loops.h"
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "trace_cells_wide.cpp"
#include <hwy/foreach_target.h>
// What Highway compiles for must be known first.
#include <hwy/highway.h>

// Without vectors there is the loop of trace_cells.cpp.
#if HWY_TARGET != HWY_SCALAR && HWY_TARGET != HWY_EMU128
#include "wide_calls-inl.h"
#include "wide_found-inl.h"
#include "wide_lanes-inl.h"

HWY_BEFORE_NAMESPACE();
namespace lsp {
namespace HWY_NAMESPACE {
namespace {

// How far from the grid exact rays may begin, in the sum of its sides.
constexpr float kFarthestOrigin = 2;

// A ray's mode_: LspWalk.mode, and where a miss of it is a mistake (LspWalk.closed) this.
constexpr uint32_t kModes = 3, kClosed = 4;

// Exact traces that are kept under way when room is made for others.
constexpr size_t kKept = 48;

struct Tracer : Rays<kPool> {
  const lsp_scene& scene;
  const LspCellGrid& grid;
  const LspRay* rays;
  LspHit* hits;
  const uint32_t count;
  const uint32_t dial;
  const uint32_t flags;
  const bool any_hit;
  const bool tables;   // or exact rays
  const bool partial;  // some triangles are there in part
  Arrays arrays;

  // A value a lane, of rays in a round.
  template <typename T>
  using Lanes = T[kPool + kLanes];
  size_t n = 0;
  // Of a round: where a ray goes next, its entry and its place there, its plane.
  Lanes<int32_t> next_cell[3]{}, axis_out{};
  Lanes<uint32_t> index{}, entry{}, plane_first{}, plane_count{}, plane{};
  Lanes<float> t_out{}, place[5]{};
  // What an entry loses in classes, the ray's place in addition, and what is asked for: lsp_is_lossy.
  Lanes<float> loss{}, risk{}, heeded{};
  // Rays that look into a filled cell, of which some do not know what they lose there; that are done; that
  // are to be traced exactly; whose answer is a split; that have a plane to meet; whose plane is there in
  // part, so that they are to be traced exactly as well.
  Bits filled = 0, unknown = 0, over = 0, exact = 0, split = 0, meets = 0, in_part = 0;

  uint32_t next = 0;
  Found<kPool + Calls::kMost> found;
  // Rays that are to be traced exactly, and those that were and hit nothing. New ones begin only when none
  // waits: no more than kPool + kMost are under way. Where `more` of them make room for themselves they are
  // in the pool still, and of the others kKept or kMost - more are left: the rest waits at most.
  Calls calls;
  Rays<kPool + Calls::kMost - kKept> waiting;
  size_t waiting_count = 0;

  Tracer(const lsp_scene& scene, uint32_t flags, uint32_t dial, const LspRay* rays, LspHit* hits,
         uint32_t count)
      : scene(scene),
        grid(scene.header->cells),
        rays(rays),
        hits(hits),
        count(count),
        dial(dial),
        flags(flags),
        any_hit((flags & LSP_TRACE_ANY_HIT) != 0),
        tables((flags & LSP_TRACE_APPROXIMATE) != 0),
        partial((scene.header->required_features & LSP_FEATURE_COVERAGE) != 0),
        arrays{or_zero(scene.filled_cells, scene.header->filled_cell_count),
               or_zero(scene.planes, scene.header->plane_count),
               or_zero(scene.splits, scene.header->split_count),
               set_u(scene.header->filled_cell_count),
               set_u(scene.header->plane_count),
               set_u(scene.header->split_count),
               set_u(scene.header->entry_word_count)},
        calls(scene, rays, any_hit, !tables) {}

  void end(uint32_t number, uint32_t flags) {
    hits[number] = Text::lsp_no_hit();
    hits[number].flags = flags;
  }

  // An exact ray by the tree.
  void settle(uint32_t number) { trace_wide(scene, flags, 0, rays + number, hits + number, 1, nullptr); }

  static HWY_INLINE MF is_finite(VF x) {
    const VU exponent = set_u(0x7F800000u);
    return as_float(hn::Ne(hn::And(hn::BitCast(du, x), exponent), exponent));
  }
  static HWY_INLINE MF is_finite(const V3& v) {
    return hn::And(is_finite(v.x), hn::And(is_finite(v.y), is_finite(v.z)));
  }
  // New rays into free lanes: what lsp_setup says of direction and interval, lsp_cell_ray. An invalid ray
  // ends before it begins.
  HWY_INLINE void set_up(size_t i) {
    const VU number = hn::Iota(du, next);
    VU record[8];
    const auto* words = reinterpret_cast<const uint32_t*>(rays);
    load_records<sizeof(LspRay) / 4>(words, number, set_u(count), record);
    load_records<sizeof(LspRay) / 4>(words + 4, number, set_u(count), record + 4);
    VF field[8];
    for (size_t k = 0; k < 8; ++k) field[k] = hn::BitCast(df, record[k]);
    const V3 o{field[0], field[1], field[2]}, d{field[4], field[5], field[6]};
    const VF from = field[3], to = field[7];
    const Scaled by = scale(d);
    // A NaN of either end is not ordered; a direction without an exponent is none.
    const VU exponent = hn::ShiftRight<23>(hn::BitCast(du, by.stretch));
    const MF valid = hn::And(hn::And(is_finite(o), is_finite(d)),
                             hn::And(hn::Le(from, to), as_float(hn::Ne(exponent, hn::Zero(du)))));
    const VF to_scaled = by.stretch;
    const V3 scaled = by.direction;
    const VF a_step = hn::Mul(hn::BitCast(df, set_u(1)), to_scaled);
    const VF most = set(std::numeric_limits<float>::max());
    const VF first = hn::Add(hn::Mul(from, to_scaled), a_step);
    const VF last = min_of(hn::Sub(hn::Mul(min_of(to, most), to_scaled), a_step), most);
    const VF per_size = set(grid.per_size), size = set(grid.size);
    const V3 lo = {set(grid.lo.x), set(grid.lo.y), set(grid.lo.z)};
    const V3 in_cells = minus(o, lo);
    store_3({hn::Mul(in_cells.x, per_size), hn::Mul(in_cells.y, per_size), hn::Mul(in_cells.z, per_size)},
            origin_, i);
    store_3({hn::Mul(scaled.x, per_size), hn::Mul(scaled.y, per_size), hn::Mul(scaled.z, per_size)},
            direction_, i);
    store_3({hn::Mul(reciprocal(scaled.x), size), hn::Mul(reciprocal(scaled.y), size),
             hn::Mul(reciprocal(scaled.z), size)},
            inverse_, i);
    store(first, tmin_ + i);
    store(last, tmax_ + i);
    store(number, ray_ + i);
    store(hn::Zero(du), waiting_ + i);
    // Beyond, the margin of cells does not make up for what is rounded.
    const VF reach = set(kFarthestOrigin * static_cast<float>(grid.cells_x + grid.cells_y + grid.cells_z));
    begin(i, first, last, tables ? valid : hn::And(valid, hn::Lt(largest(load_3(origin_, i)), reach)));
  }

  // The beginning of lsp_begin: where rays begin, or enter the grid.
  struct Entered {
    VF t, t_last;
    VI axis, cell[3];
  };
  HWY_INLINE Entered enter(size_t i, VF first, VF last) const {
    const V3 o = load_3(origin_, i), inv = load_3(inverse_, i);
    const VF zero = hn::Zero(df);
    const V3 dims = {set(static_cast<float>(grid.cells_x)), set(static_cast<float>(grid.cells_y)),
                     set(static_cast<float>(grid.cells_z))};
    const V3 lo = minus({zero, zero, zero}, o), hi = minus(dims, o);
    const V3 a = {hn::Mul(lo.x, inv.x), hn::Mul(lo.y, inv.y), hn::Mul(lo.z, inv.z)};
    const V3 b = {hn::Mul(hi.x, inv.x), hn::Mul(hi.y, inv.y), hn::Mul(hi.z, inv.z)};
    const V3 enters = {min_of(a.x, b.x), min_of(a.y, b.y), min_of(a.z, b.z)};
    const VF t_in = max_of(max_of(enters.x, enters.y), enters.z);
    const VF leaves = min_of(min_of(max_of(a.x, b.x), max_of(a.y, b.y)), max_of(a.z, b.z));
    const MF outside = hn::Gt(t_in, first);
    const VF begins = select(outside, t_in, first);
    const VI side = hn::IfThenZeroElse(as_int(hn::Eq(t_in, enters.x)),
                                       select(as_int(hn::Eq(t_in, enters.y)), set_i(1), set_i(2)));
    const V3 p = point_at(o, load_3(direction_, i), begins);
    return {begins,
            min_of(leaves, last),
            select(as_int(outside), side, set_i(LSP_NONE)),
            {cell_at(p.x, grid.cells_x), cell_at(p.y, grid.cells_y), cell_at(p.z, grid.cells_z)}};
  }
  HWY_INLINE void begin(size_t i, VF first, VF last, MF valid) {
    const Entered at = enter(i, first, last);
    store(hn::IfThenElse(valid, at.t_last, set(-std::numeric_limits<float>::infinity())), t_last_ + i);
    store(at.t, t_ + i);
    store(at.axis, axis_ + i);
    for (size_t k = 0; k < 3; ++k) store(at.cell[k], cell_[k] + i);
    store(hn::Zero(du), step_ + i);
    const MU leaves = as_uint(hn::Lt(load(t_last_ + i), last));
    const uint32_t mode = any_hit && (dial >> 8u) != 0 ? LSP_WALK_WAITS : LSP_WALK_CALLS;
    store(select(leaves, set_u(mode), set_u(LSP_WALK_CALLS)), mode_ + i);
  }

  // lsp_cell_at, along an axis of `cells`.
  static HWY_INLINE VI cell_at(VF p, uint32_t cells) {
    return hn::ConvertTo(di, min_of(max_of(hn::Zero(df), p), set(static_cast<float>(cells) - 0.5f)));
  }

  // Of rays that have come to their end and are to go on, see lsp_advance. Those of which cells wait pass
  // through all cells again, where a single ray goes back to the first that waits: on the way there none is
  // asked.
  HWY_NOINLINE void begin_again(size_t i, Bits lanes) {
    const MF these = mask_of(lanes);
    const Entered at = enter(i, load(tmin_ + i), load(tmax_ + i));
    for (size_t k = 0; k < 3; ++k)
      store(select(as_int(these), at.cell[k], load(next_cell[k] + i)), next_cell[k] + i);
    store(select(these, at.t, load(t_out + i)), t_out + i);
    store(select(as_int(these), hn::Max(at.axis, hn::Zero(di)), load(axis_out + i)), axis_out + i);
    const VU mode = load(mode_ + i);
    const MU some = hn::And(in_mode(i, LSP_WALK_WAITS), hn::Ne(load(waiting_ + i), hn::Zero(du)));
    const VU after =
        select(some, hn::Or(hn::And(mode, set_u(kClosed)), set_u(LSP_WALK_MAKES_UP)), set_u(LSP_WALK_AGAIN));
    store(select(as_uint(these), after, mode), mode_ + i);
    store(select(as_uint(these), set_u(LSP_NONE), load(step_ + i)), step_ + i);  // compact adds one
  }

  // Lanes whose LspWalk.mode is this.
  HWY_INLINE MU in_mode(size_t i, uint32_t mode) const {
    return hn::Eq(hn::And(load(mode_ + i), set_u(kModes)), set_u(mode));
  }
  // Rays that began again for the cells that waited, all of which are made up for.
  HWY_INLINE MF has_made_up(size_t i) const {
    return as_float(hn::And(in_mode(i, LSP_WALK_MAKES_UP), hn::Eq(load(waiting_ + i), hn::Zero(du))));
  }
  // Rays that begin again if they come to their end.
  HWY_INLINE MF may_begin_again(size_t i) const {
    const VU mode = load(mode_ + i);
    const MU waits = hn::And(in_mode(i, LSP_WALK_WAITS), hn::Ne(load(waiting_ + i), hn::Zero(du)));
    return as_float(hn::Or(waits, hn::Ne(hn::And(mode, set_u(kClosed)), hn::Zero(du))));
  }
  // lsp_step_bit.
  HWY_INLINE VU step_bit(size_t i) const {
    return hn::Shl(set_u(1), hn::Min(load(step_ + i), set_u(LSP_LAST_WAITING)));
  }
  // Of rays at filled cells those that look into them: where they make up for what waited the others have
  // answered, and that is traced exactly.
  HWY_INLINE MF make_up(size_t i, MF going, MF is_filled, VU word) {
    const MU makes_up =
        hn::And(in_mode(i, LSP_WALK_MAKES_UP), hn::Lt(load(step_ + i), set_u(LSP_LAST_WAITING)));
    const MU known = hn::And(makes_up, as_uint(going));
    if (bits_of(as_float(known)) == 0) return is_filled;
    const VU bit = step_bit(i), waiting = load(waiting_ + i);
    const MU called =
        hn::And(hn::And(known, as_uint(is_filled)), hn::Ne(hn::And(waiting, bit), hn::Zero(du)));
    store(select(known, hn::AndNot(bit, waiting), waiting), waiting_ + i);
    store(hn::And(word, set_u(~LSP_CELL_FILLED)), index + i);
    exact |= bits_of(as_float(called)) << i;
    return hn::AndNot(as_float(known), is_filled);
  }

  // A vector of new rays at a time.
  void begin_rays() {
    while (n + kLanes <= kPool && next < count) {
      set_up(n);
      const uint32_t more = count - next < kLanes ? count - next : static_cast<uint32_t>(kLanes);
      next += more;
      n += more;
    }
  }

  // lsp_cell_origin, of lanes that begin in their cell; the others' entry is LSP_NONE.
  HWY_INLINE VU find_in_origin_table(size_t i, MF begins, VU cell, const V3& from, VF to_u, VF to_v,
                                     VI face) {
    VU record[4];
    load_records<sizeof(LspFilledCell) / 4>(&arrays.cells->sub_mask_lo,
                                            select(as_uint(begins), cell, set_u(LSP_NONE)), arrays.cell_count,
                                            record);
    const VF sub_cells = set(static_cast<float>(grid.sub_cells));
    const VF patches = set(static_cast<float>(grid.origin_patches));
    const V3 p = {hn::Mul(from.x, sub_cells), hn::Mul(from.y, sub_cells), hn::Mul(from.z, sub_cells)};
    const V3 sub = {patch_of(p.x, sub_cells), patch_of(p.y, sub_cells), patch_of(p.z, sub_cells)};
    const VF u = hn::Mul(to_u, patches), v = hn::Mul(to_v, patches);
    const VF patch_u = patch_of(u, patches), patch_v = patch_of(v, patches);
    store(place_of(p.x, sub.x), place[0] + i);
    store(place_of(p.y, sub.y), place[1] + i);
    store(place_of(p.z, sub.z), place[2] + i);
    store(place_of(u, patch_u), place[3] + i);
    store(place_of(v, patch_v), place[4] + i);
    // Numbers this small are exact as floats.
    const VU number = whole(hn::Add(sub.x, hn::Mul(sub_cells, hn::Add(sub.y, hn::Mul(sub_cells, sub.z)))));
    const VU patch = whole(hn::Add(patch_u, hn::Mul(patches, patch_v)));
    const VU bit = hn::Shl(set_u(1), hn::And(number, set_u(31)));
    const MU is_low = hn::Lt(number, set_u(32));
    const VU mask = select(is_low, record[0], record[1]);
    const VU before = hn::Add(hn::PopulationCount(hn::And(mask, hn::Sub(bit, set_u(1)))),
                              hn::IfThenZeroElse(is_low, hn::PopulationCount(record[0])));
    const VU table = hn::Add(record[2], before);
    const VU at = hn::Add(hn::Mul(hn::Add(hn::Mul(table, set_u(6)), hn::BitCast(du, face)),
                                  set_u(grid.origin_patches * grid.origin_patches)),
                          patch);
    const auto second_half = [&](VF q, uint32_t bit) HWY_ATTR {
      return hn::IfThenElseZero(as_uint(hn::Ge(hn::Add(q, q), patches)), set_u(bit));
    };
    const VU quarter = hn::Add(second_half(patch_u, 1), second_half(patch_v, 2));
    const VU way = hn::Add(hn::ShiftLeft<2>(hn::BitCast(du, face)), quarter);
    const MU ends_outside = as_uint(hn::Lt(load(t_last_ + i), load(tmax_ + i)));
    const VU closed =
        hn::And(hn::Shr(record[3], hn::And(way, set_u(31))), set_u(dial == LSP_DIAL_TABLES ? 0 : 1));
    const VU mode = load(mode_ + i);
    store(hn::Or(mode, hn::IfThenElseZero(ends_outside, hn::ShiftLeft<2>(closed))), mode_ + i);
    static_assert(kClosed == 1 << 2);
    const MU none = hn::Eq(hn::And(mask, bit), hn::Zero(du));
    return select(none, set_u(LSP_NONE), hn::Add(set_u(grid.origin_entry_first), at));
  }

  static HWY_INLINE VU whole(VF x) { return hn::BitCast(du, hn::ConvertTo(di, x)); }

  // lsp_cell_far, of lanes that are asked; the others keep their places.
  HWY_INLINE VU find_in_far_table(size_t i, MF asked, VU cell, VF from_u, VF from_v, VF to_u, VF to_v,
                                  VI face_in, VI face_out) {
    const VF patches = set(static_cast<float>(grid.far_patches));
    const VF at[4] = {hn::Mul(from_u, patches), hn::Mul(from_v, patches), hn::Mul(to_u, patches),
                      hn::Mul(to_v, patches)};
    VF first[4];
    for (size_t k = 0; k < 4; ++k) {
      first[k] = patch_of(at[k], patches);
      store(select(asked, place_of(at[k], first[k]), load(place[k] + i)), place[k] + i);
    }
    store(hn::IfThenZeroElse(asked, load(place[4] + i)), place[4] + i);
    const VU patch_in = whole(hn::Add(first[0], hn::Mul(patches, first[1])));
    const VU patch_out = whole(hn::Add(first[2], hn::Mul(patches, first[3])));
    // LSP_SHAFT_INDEX. A mask is -1.
    const uint32_t of_face = grid.far_patches * grid.far_patches;
    const VI other = hn::Add(face_out, hn::VecFromMask(di, hn::Gt(face_out, face_in)));
    const VU faces = hn::BitCast(du, hn::Add(hn::Mul(face_in, set_i(5)), other));
    const VU shaft =
        hn::Add(hn::Mul(hn::Add(hn::Mul(faces, set_u(of_face)), patch_in), set_u(of_face)), patch_out);
    const VU entry_of = hn::Add(hn::Mul(cell, set_u(30u * of_face * of_face)), shaft);
    return select(hn::RebindMask(du, hn::Eq(face_in, face_out)), set_u(LSP_NONE), entry_of);
  }

  // The loop of lsp_advance, once, up to the entry of a filled cell; kFirst: what lsp_begin does in the cells
  // that rays begin in.
  template <bool kFirst>
  HWY_INLINE void advance(size_t i, size_t end_of_lanes) {
    const V3 o = load_3(origin_, i), d = load_3(direction_, i), inverse = load_3(inverse_, i);
    const VI x = load(cell_[0] + i), y = load(cell_[1] + i), z = load(cell_[2] + i);
    const VF t = load(t_ + i);
    const VI axis = load(axis_ + i);
    const MF here = first_lanes(end_of_lanes - i);
    const MU in_time = hn::Lt(load(step_ + i), set_u(grid.cells_x + grid.cells_y + grid.cells_z));
    const MU inside = hn::And(hn::And(hn::Lt(hn::BitCast(du, x), set_u(grid.cells_x)),
                                      hn::Lt(hn::BitCast(du, y), set_u(grid.cells_y))),
                              hn::Lt(hn::BitCast(du, z), set_u(grid.cells_z)));
    MF going = hn::And(hn::And(here, as_float(hn::And(in_time, inside))), hn::Lt(t, load(t_last_ + i)));
    if (any_hit) going = hn::AndNot(has_made_up(i), going);
    Bits again = 0;
    if (const Bits ended = bits_of(hn::AndNot(going, here)); ended != 0) {
      const Bits complete = bits_of(as_float(in_time));
      again = ended & complete & bits_of(may_begin_again(i));
      LSP_FOR_BITS(k, ended & ~again) {
        const bool is_over = (complete >> k & 1) != 0;
        end(ray_[i + k], is_over ? 0 : LSP_HIT_INCOMPLETE);
        if (!tables && !(is_over && t_last_[i + k] > -HUGE_VALF)) [[unlikely]]
          settle(ray_[i + k]);
      }
      over |= (ended & ~again) << i;
    }
    const VI of_grid = hn::Add(hn::Mul(hn::Add(hn::Mul(z, set_i(grid.cells_y)), y), set_i(grid.cells_x)), x);
    const VU word = load_words(scene.cell_words, hn::BitCast(du, of_grid), as_uint(going));
    const MI is_filled = hn::Lt(hn::BitCast(di, word), hn::Zero(di));
    const VI jump = hn::IfThenZeroElse(is_filled, hn::BitCast(di, hn::And(word, set_u(LSP_CELL_MAX_JUMP))));
    const VI jump_1 = hn::Add(jump, set_i(1));
    const MF back[3] = {hn::Lt(inverse.x, hn::Zero(df)), hn::Lt(inverse.y, hn::Zero(df)),
                        hn::Lt(inverse.z, hn::Zero(df))};
    const auto side = [&](VI c, size_t k)
                          HWY_ATTR { return select(as_int(back[k]), hn::Sub(c, jump), hn::Add(c, jump_1)); };
    const V3 plane_of = corner_of(side(x, 0), side(y, 1), side(z, 2));
    const V3 t_side = {hn::Mul(hn::Sub(plane_of.x, o.x), inverse.x),
                       hn::Mul(hn::Sub(plane_of.y, o.y), inverse.y),
                       hn::Mul(hn::Sub(plane_of.z, o.z), inverse.z)};
    const MF x_le_y = hn::Le(t_side.x, t_side.y);
    const MF out_x = hn::And(x_le_y, hn::Le(t_side.x, t_side.z));
    const MF out_y = hn::AndNot(x_le_y, hn::Le(t_side.y, t_side.z));
    const VI axis_to = hn::IfThenZeroElse(as_int(out_x), select(as_int(out_y), set_i(1), set_i(2)));
    const VF t_to = max_of(along(t_side, out_x, out_y), t);
    const V3 point = point_at(o, d, t_to);
    const auto next = [&](VI c, VF p, MF by_it, size_t k) HWY_ATTR {
      const VI beyond = select(as_int(back[k]), hn::Sub(c, jump_1), hn::Add(c, jump_1));
      const VF lo = hn::ConvertTo(df, hn::Sub(c, jump)), hi = hn::ConvertTo(df, hn::Add(c, jump));
      const VF cell_of = hn::Floor(p);
      const VF within = select(hn::Gt(cell_of, lo), select(hn::Lt(cell_of, hi), cell_of, hi), lo);
      store(select(as_int(by_it), beyond, hn::ConvertTo(di, within)), next_cell[k] + i);
    };
    next(x, point.x, out_x, 0);
    next(y, point.y, out_y, 1);
    next(z, point.z, hn::Not(hn::Or(out_x, out_y)), 2);
    store(t_to, t_out + i);
    store(axis_to, axis_out + i);
    if (again != 0) begin_again(i, again);
    MF looks = as_float(is_filled);
    if (any_hit) looks = make_up(i, going, looks, word);
    const Bits look_bits = bits_of(looks);
    if (look_bits == 0) return;
    filled |= look_bits << i;

    const VU cell = hn::And(word, set_u(~LSP_CELL_FILLED));
    if (!tables) {
      store(cell, index + i);
      exact |= look_bits << i;
      LSP_FOR_BITS(k, look_bits) fetch(scene.filled_cells, index[i + k]);
      return;
    }
    const V3 corner = corner_of(x, y, z);
    const V3 from = minus(point_at(o, d, t), corner), to = minus(point, corner);
    const auto face = [&](VI a, MF is_x, MF is_y, VI at_back, VI ahead) HWY_ATTR {
      const MF goes_back = hn::Or(hn::And(is_x, back[0]),
                                  hn::Or(hn::And(is_y, back[1]), hn::AndNot(hn::Or(is_x, is_y), back[2])));
      return hn::Add(hn::Add(a, a), select(as_int(goes_back), at_back, ahead));
    };
    const VI zero = hn::Zero(di), one = set_i(1);
    const VI face_out = face(axis_to, out_x, out_y, zero, one);
    const VF to_u = select(out_x, to.y, to.x);
    const VF to_v = select(hn::Or(out_x, out_y), to.z, to.y);
    VU found_entry = set_u(LSP_NONE);
    MF far = looks;
    V3 entered = from;
    VI axis_in = axis;
    if constexpr (kFirst) {
      const MF begins = hn::And(looks, as_float(hn::Lt(axis, zero)));
      found_entry = find_in_origin_table(i, begins, cell, from, to_u, to_v, face_out);
      const MF is_unknown = hn::And(begins, as_float(hn::Eq(found_entry, set_u(LSP_NONE))));
      unknown |= bits_of(is_unknown) << i;
      far = hn::Or(is_unknown, hn::AndNot(begins, looks));
      // lsp_cell_through.
      const V3 behind =
          corner_of(select(as_int(back[0]), hn::Add(x, one), x), select(as_int(back[1]), hn::Add(y, one), y),
                    select(as_int(back[2]), hn::Add(z, one), z));
      const V3 t_in = {hn::Mul(hn::Sub(behind.x, o.x), inverse.x), hn::Mul(hn::Sub(behind.y, o.y), inverse.y),
                       hn::Mul(hn::Sub(behind.z, o.z), inverse.z)};
      const MF x_ge_y = hn::Ge(t_in.x, t_in.y);
      const MF in_x = hn::And(x_ge_y, hn::Ge(t_in.x, t_in.z)),
               in_y = hn::AndNot(x_ge_y, hn::Ge(t_in.y, t_in.z));
      const V3 through = minus(point_at(o, d, along(t_in, in_x, in_y)), corner);
      entered = {select(is_unknown, through.x, from.x), select(is_unknown, through.y, from.y),
                 select(is_unknown, through.z, from.z)};
      axis_in = select(as_int(is_unknown),
                       hn::IfThenZeroElse(as_int(in_x), select(as_int(in_y), one, set_i(2))), axis);
    }
    if (!kFirst || bits_of(far) != 0) {
      const MF in_x = as_float(hn::Eq(axis_in, zero)), in_y = as_float(hn::Eq(axis_in, one));
      const VI face_in = face(axis_in, in_x, in_y, one, zero);
      const VU far_entry =
          find_in_far_table(i, far, cell, select(in_x, entered.y, entered.x),
                            select(hn::Or(in_x, in_y), entered.z, entered.y), to_u, to_v, face_in, face_out);
      found_entry = select(as_uint(far), far_entry, found_entry);
    }
    store(cell, index + i);
    store(found_entry, entry + i);
    LSP_FOR_BITS(k, look_bits) {
      fetch(scene.entries, entry[i + k] >> 1u);
      fetch(scene.filled_cells, index[i + k]);
    }
  }

  // What the entries say.
  HWY_INLINE void classify(size_t i) {
    const MF looks = mask_of(filled >> i);
    const VU at = load(entry + i);
    const VU half = hn::ShiftRight<1>(at);
    const MU there =
        hn::And(hn::And(as_uint(looks), hn::Ne(at, set_u(LSP_NONE))), hn::Lt(half, arrays.word_count));
    const VU word = load_words(scene.entries, half, there);
    const MU is_odd = hn::Ne(hn::And(at, set_u(1)), hn::Zero(du));
    VU said = select(is_odd, hn::ShiftRight<16>(word), hn::And(word, set_u(0xFFFF)));
    said = select(hn::Eq(at, set_u(LSP_NONE)), set_u(LSP_ANSWER_EMPTY), said);
    const MF begins = as_float(hn::Lt(load(axis_ + i), hn::Zero(di)));
    said =
        select(as_uint(mask_of(unknown >> i)), hn::Or(said, set_u(LSP_LOSS_UNKNOWN << LSP_LOSS_SHIFT)), said);
    const VU number = hn::ShiftRight<LSP_LOSS_SHIFT>(said);
    const VU table = select(as_uint(begins), set_u(LSP_RISK_ORIGIN), set_u(LSP_RISK_FAR));
    const VU counts = hn::And(hn::Shr(table, hn::ShiftLeft<2>(number)), set_u(15));
    const VF classes = select(as_float(hn::Eq(number, set_u(LSP_LOSS_UNKNOWN))), set(LSP_RISK_UNKNOWN),
                              hn::Sub(hn::ConvertTo(df, hn::BitCast(di, counts)), set(7)));
    const VF all = set(-INFINITY);
    const VF limit = select(as_float(hn::Eq(load(mode_ + i), set_u(LSP_WALK_AGAIN))), all,
                            select(begins, set(heeded_of(dial & 0xFFu)), set(heeded_of(dial >> 8u))));
    store(classes, loss + i);
    store(limit, heeded + i);
    store(hn::Zero(df), risk + i);
    const VU answer = hn::And(said, set_u(LSP_ANSWER_MASK));
    const MF has_answer = as_float(hn::Lt(answer, set_u(LSP_ANSWER_LIMIT)));
    const VF empty = select(begins, set(LSP_RISK_NO_SPLIT(true)), set(LSP_RISK_NO_SPLIT(false)));
    const MF exactly = hn::And(
        looks, hn::Or(hn::Eq(limit, all), hn::AndNot(has_answer, hn::Ge(hn::Add(classes, empty), limit))));
    const MF answers = hn::AndNot(exactly, hn::And(looks, has_answer));
    const MU is_sky = hn::And(hn::Eq(answer, set_u(LSP_ANSWER_SKY)), hn::Lt(load(mode_ + i), set_u(kClosed)));
    const Bits sky = bits_of(hn::AndNot(exactly, hn::And(looks, as_float(is_sky))));
    LSP_FOR_BITS(k, sky) end(ray_[i + k], 0);
    over |= sky << i;
    trace_exactly(i, exactly);
    const Bits answer_bits = bits_of(answers);
    if (answer_bits == 0) return;

    VU record[4];
    load_records<sizeof(LspFilledCell) / 4>(&arrays.cells->plane_first, load(index + i), arrays.cell_count,
                                            record);
    const MU direct = hn::Lt(answer, record[1]);
    store(record[0], plane_first + i);
    store(record[1], plane_count + i);
    store(hn::Add(select(direct, record[0], hn::Sub(record[2], record[1])), answer), plane + i);
    const Bits direct_bits = bits_of(hn::And(answers, as_float(direct)));
    meets |= direct_bits << i;
    split |= (answer_bits & ~direct_bits) << i;
    LSP_FOR_BITS(k, direct_bits) fetch_plane(plane[i + k]);
    LSP_FOR_BITS(k, answer_bits & ~direct_bits) fetch(scene.splits, plane[i + k]);
  }

  // From which class on a cell is traced exactly: lsp_is_lossy.
  static float heeded_of(uint32_t parts) {
    if (parts == 0) return -INFINITY;
    if (parts >= LSP_DIAL_PARTS * (LSP_LOSS_UNKNOWN + 1)) return INFINITY;
    return static_cast<float>(parts) / float{LSP_DIAL_PARTS};
  }
  HWY_INLINE MF is_lossy(size_t i, VF more) const {
    return hn::Ge(hn::Add(load(loss + i), more), load(heeded + i));
  }
  HWY_INLINE void trace_exactly(size_t i, MF these) {
    exact |= (any_hit ? wait(i, these) : bits_of(these)) << i;
  }
  // Of rays that are to be traced exactly those that do not wait until no table has a hit.
  HWY_INLINE Bits wait(size_t i, MF exactly) {
    const MF waits = hn::And(exactly, may_wait(i));
    const VU waiting = load(waiting_ + i);
    store(select(as_uint(waits), hn::Or(waiting, step_bit(i)), waiting), waiting_ + i);
    return bits_of(hn::AndNot(waits, exactly));
  }
  HWY_INLINE MF may_wait(size_t i) const {
    const MU waits = in_mode(i, LSP_WALK_WAITS);
    const MU some =
        hn::Or(hn::Ne(load(waiting_ + i), hn::Zero(du)), hn::Lt(load(step_ + i), set_u(LSP_LAST_WAITING)));
    return as_float(hn::And(waits, some));
  }

  HWY_INLINE void fetch_plane(uint32_t number) {
    fetch(scene.planes, number);
    fetch(scene.plane_records, number);
  }

  // lsp_split_weight, of the six bits below `shift` bits from the top.
  template <int kFromTop>
  static HWY_INLINE VF weight(VU bits) {
    return hn::ConvertTo(df, hn::ShiftRight<26>(hn::BitCast(di, hn::ShiftLeft<kFromTop>(bits))));
  }

  // lsp_split_risk.
  static HWY_INLINE VF split_risk(VF side, MF has_plane, MF begins) {
    const auto choose = [&](float plane_far, float plane_origin, float far, float origin) HWY_ATTR {
      return select(has_plane, select(begins, set(plane_origin), set(plane_far)),
                    select(begins, set(origin), set(far)));
    };
    const VF least = choose(-2, 0, -5, -3), most = choose(2, 2, 7, 4);
    const VF per_form = choose(0.125f, 0.0625f, 0.5f, 0.125f);
    return max_of(least, hn::Sub(most, hn::Mul(per_form, hn::Abs(side))));
  }

  // The side of the splits: lsp_split_side, lsp_cell_plane.
  HWY_INLINE void choose(size_t i) {
    const MU asked = as_uint(mask_of(split >> i));
    const VU number = load(plane + i);
    const MU there = hn::And(asked, hn::Lt(number, arrays.split_count));
    const VU twice = hn::Add(number, number);
    const VU answers = load_words(&arrays.splits->answers, twice, there);
    const VU weights = load_words(&arrays.splits->answers, hn::Add(twice, set_u(1)), there);
    VF sum = weight<2>(answers);
    sum = hn::Add(sum, hn::Mul(weight<26>(weights), load(place[0] + i)));
    sum = hn::Add(sum, hn::Mul(weight<20>(weights), load(place[1] + i)));
    sum = hn::Add(sum, hn::Mul(weight<14>(weights), load(place[2] + i)));
    sum = hn::Add(sum, hn::Mul(weight<8>(weights), load(place[3] + i)));
    sum = hn::Add(sum, hn::Mul(weight<2>(weights), load(place[4] + i)));
    const MU first = as_uint(hn::Gt(sum, hn::Zero(df)));
    const VU side = hn::And(select(first, answers, hn::ShiftRight<12>(answers)), set_u(LSP_SPLIT_MASK));
    const MU has_plane = hn::And(asked, hn::Lt(side, load(plane_count + i)));
    const Bits is_plane = bits_of(as_float(has_plane));
    store(select(asked, hn::Add(load(plane_first + i), side), number), plane + i);
    meets |= is_plane << i;
    const VF more = split_risk(sum, as_float(has_plane), as_float(hn::Lt(load(axis_ + i), hn::Zero(di))));
    store(hn::IfThenElseZero(as_float(asked), more), risk + i);
    trace_exactly(i, hn::And(as_float(hn::AndNot(has_plane, asked)), is_lossy(i, more)));
    LSP_FOR_BITS(k, is_plane) fetch_plane(plane[i + k]);
  }

  // Where the rays meet their planes: lsp_cell_meet.
  HWY_INLINE void meet(size_t i) {
    const MF asked = mask_of(meets >> i);
    VU record[4];
    load_records<sizeof(LspPlane) / 4>(reinterpret_cast<const uint32_t*>(arrays.planes), load(plane + i),
                                       select(as_uint(asked), arrays.plane_count, hn::Zero(du)), record);
    const V3 normal = {hn::BitCast(df, record[0]), hn::BitCast(df, record[1]), hn::BitCast(df, record[2])};
    const V3 corner = corner_of(load(cell_[0] + i), load(cell_[1] + i), load(cell_[2] + i));
    const VF half = set(0.5f);
    const V3 centre = {hn::Add(corner.x, half), hn::Add(corner.y, half), hn::Add(corner.z, half)};
    const V3 origin = minus(load_3(origin_, i), centre);
    const VF t_in = load(t_ + i), t_to = load(t_out + i);
    const VF tmin = load(tmin_ + i);
    const VF t =
        hn::Div(hn::Sub(hn::BitCast(df, record[3]), dot(normal, origin)), dot(normal, load_3(direction_, i)));
    const VF slack = hn::Mul(set(LSP_CELL_SLACK), hn::Sub(t_to, t_in));
    const MF begins = as_float(hn::Lt(load(axis_ + i), hn::Zero(di)));
    const MF ahead = hn::And(hn::Gt(t, tmin), hn::Gt(t, select(begins, t_in, hn::Sub(t_in, slack))));
    const MF meets_it = hn::And(ahead, hn::Le(t, hn::Add(t_to, slack)));
    const MF within = hn::Le(t, t_to);
    const MF at_once = hn::Lt(t, hn::Add(t_in, hn::Mul(set(2), slack)));
    const VF beyond = set(8);
    const VF of_origin = select(
        ahead, select(at_once, set(6), select(within, set(2), select(meets_it, beyond, set(1)))), set(-1));
    const VF of_far =
        hn::IfThenElseZero(meets_it, select(hn::Lt(t, t_in), set(4), hn::IfThenZeroElse(within, beyond)));
    const MF exactly =
        hn::And(asked, is_lossy(i, hn::Add(load(risk + i), select(begins, of_origin, of_far))));
    trace_exactly(i, exactly);
    const MF met = hn::AndNot(exactly, hn::And(asked, meets_it));
    VF hit = select(hn::Lt(t, t_in), t_in, t);
    hit = select(hn::Gt(hit, t_to), t_to, hit);
    const Bits hit_bits = bits_of(hn::And(met, hn::And(hn::Gt(hit, tmin), hn::Lt(hit, load(tmax_ + i)))));
    if (hit_bits == 0) return;
    HWY_ALIGN float hit_t[kLanes];
    hn::Store(hit, df, hit_t);
    LSP_FOR_BITS(k, hit_bits) {
      Best best{};
      best.t = hit_t[k];
      best.triangle = lsp_load_plane_record(scene, plane[i + k]);
      best.flags = LSP_HIT_LINE_SPACE | (axis_[i + k] < 0 ? LSP_HIT_ORIGIN_INSIDE : 0u);
      if (partial && Text::lsp_has_gaps(lsp_load_triangle(scene, best.triangle))) [[unlikely]] {
        meet_in_part(i + k, best);
      } else {
        over |= Bits{1} << (i + k);
        add_found(ray_[i + k], best);
      }
    }
  }

  // A plane of a triangle that is there in part: the cell is traced exactly; from tables alone the ray either
  // meets it or goes on.
  HWY_NOINLINE void meet_in_part(size_t k, const Best& plane) {
    if (dial == LSP_DIAL_TABLES) {
      if (is_passed<Text>(lsp_load_triangle(scene, plane.triangle), rays[ray_[k]])) return;
      over |= Bits{1} << k;
      add_found(ray_[k], plane);
      return;
    }
    if ((bits_of(may_wait(k)) & 1) != 0)
      waiting_[k] |= Text::lsp_step_bit(step_[k]);
    else
      in_part |= Bits{1} << k;
  }

  HWY_INLINE void add_found(uint32_t number, const Best& best) {
    found.add(scene, number, best.triangle, best.t, best.u, best.v, best.flags);
  }

  // Goes on with the exact traces until no more than `most` are under way.
  HWY_NOINLINE void trace_calls(size_t most) {
    calls.trace(
        most,
        [&](uint32_t ray, const Best& best) {
          if (best.triangle == Calls::kUnsettled) [[unlikely]]
            settle(ray);
          else
            add_found(ray, best);
        },
        [&](const Rays<Calls::kMost>& from, size_t i, Bits lanes) HWY_ATTR {
          waiting.take(from, i, lanes, waiting_count);
          waiting_count += static_cast<size_t>(std::popcount(lanes));
        });
  }

  // Those that hit nothing there come back.
  void join() {
    while (waiting_count != 0 && n < kPool) {
      const size_t room = kPool - n < kLanes ? kPool - n : kLanes;
      const size_t more = waiting_count < room ? waiting_count : room;
      waiting_count -= more;
      this->take(waiting, waiting_count, (Bits{1} << more) - 1, n);
      n += more;
    }
  }

  // The rays of this round to the cells they go to, those that are to be traced exactly to the calls, and the
  // others that go on into the first lanes.
  void compact() {
    const Bits called = exact | in_part;
    if (const auto more = static_cast<size_t>(std::popcount(called)); calls.size() + more > Calls::kMost)
      trace_calls(std::min(size_t{Calls::kMost} - more, kKept));
    size_t at = 0;
    for (size_t i = 0; i < n; i += kLanes) {
      const Bits calling = lanes_of(called, i);
      const V3 corner = corner_of(load(cell_[0] + i), load(cell_[1] + i), load(cell_[2] + i));
      const VF t_in = load(t_ + i);
      for (size_t k = 0; k < 3; ++k) store(load(next_cell[k] + i), cell_[k] + i);
      store(load(t_out + i), t_ + i);
      store(load(axis_out + i), axis_ + i);
      store(hn::Add(load(step_ + i), set_u(1)), step_ + i);
      if (calling != 0) calls.add(*this, i, calling, load(index + i), corner, t_in);
      const Bits on = lanes_of(~(over | called), i, n);
      this->take(*this, i, on, at);
      at += static_cast<size_t>(std::popcount(on));
    }
    calls.begin(count);
    n = at;
  }

  void run() {
    for (;;) {
      filled = unknown = over = exact = split = meets = in_part = 0;
      if (n == 0 && next == count && waiting_count == 0) trace_calls(0);
      join();
      const size_t old = n;
      for (size_t i = 0; i < old; i += kLanes) advance<false>(i, old);
      begin_rays();
      for (size_t i = old; i < n; i += kLanes) advance<true>(i, n);
      if (n == 0 && found.size() == 0) return;
      for (size_t i = 0; i < n; i += kLanes)
        if (tables && lanes_of(filled, i) != 0) classify(i);
      // Of the round before.
      found.answer({scene, rays, hits, count, (flags & LSP_TRACE_OCCLUSION) != 0, tables});
      for (size_t i = 0; i < n; i += kLanes)
        if (lanes_of(split, i) != 0) choose(i);
      for (size_t i = 0; i < n; i += kLanes)
        if (lanes_of(meets, i) != 0) meet(i);
      compact();
    }
  }
};

void trace(const lsp_scene& scene, uint32_t flags, uint32_t dial, const LspRay* rays, LspHit* hits,
           uint64_t count) {
  constexpr uint64_t kAtOnce = 1u << 30;  // numbers of rays have 32 bits
  for (uint64_t first = 0; first < count; first += kAtOnce) {
    const uint64_t rest = count - first;
    Tracer tracer(scene, flags, dial, rays + first, hits + first,
                  static_cast<uint32_t>(rest < kAtOnce ? rest : kAtOnce));
    static_assert(sizeof tracer <= 50 * 1024);  // of the stack, as lsp/lsp.h says
    tracer.run();
  }
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace lsp
HWY_AFTER_NAMESPACE();
#endif

#if HWY_ONCE
namespace lsp {

const WideCells kWideCells[] = {
#include "simd_loops.inc"
};

const WideCells* wide_cells(const lsp_scene& scene) {
  const LspHeader& header = *scene.header;
  // Indices of words are signed in a gather.
  constexpr uint32_t kReach = 1u << 30;
  if (header.entry_word_count >= kReach || header.split_count >= kReach) return nullptr;
  return best_here(kWideCells);
}

const WideCells* wide_cells_for_exact_rays(const lsp_scene& scene) {
  const WideCells* best = wide_cells(scene);
  if (best == nullptr || scene.cell_references == nullptr) return nullptr;
#if HWY_TARGETS & HWY_AVX3
  if (best->runs_here == has_avx3) return best;
#endif
  return nullptr;
}

}  // namespace lsp
#endif
