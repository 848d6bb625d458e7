// Traversal of the wide tree, compiled once for every instruction set and chosen at run time.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "wide_trace.cpp"
#include <hwy/foreach_target.h>
// What Highway compiles for must be known first.
#include <hwy/highway.h>

#include "wide_subset.h"
#include "wide_tree.h"

HWY_BEFORE_NAMESPACE();
namespace lsp::bench {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;
using hn::CappedTag;
using LspBest = wide::Text::LspBest;
using LspSetup = wide::Text::LspSetup;

// Lanes of a mask as bits, lane 0 lowest.
template <class D, class M>
HWY_INLINE uint32_t bits_of(D d, M mask) {
  uint8_t bytes[8];
  hn::StoreMaskBits(d, mask, bytes);
  return bytes[0] & ((1u << hn::Lanes(d)) - 1u);
}

// Which planes of a box a ray meets first, and the moved origins that grow the box (lsp_box). Then the order
// of the axes for the triangle test (lsp_rotate).
struct Frame {
  size_t near[3], far[3];
  float near_origin[3], far_origin[3], inverse[3];
  size_t order[3];
  float origin[3], shear[3];

  explicit Frame(const LspSetup& s) {
    const float inverse_of[3] = {s.inverse.x, s.inverse.y, s.inverse.z};
    const float plus[3] = {s.origin_plus.x, s.origin_plus.y, s.origin_plus.z};
    const float minus[3] = {s.origin_minus.x, s.origin_minus.y, s.origin_minus.z};
    const float at[3] = {s.origin.x, s.origin.y, s.origin.z};
    for (size_t k = 0; k < 3; ++k) {
      const bool forward = inverse_of[k] > 0;
      inverse[k] = inverse_of[k];
      near[k] = forward ? k : k + 3;
      far[k] = forward ? k + 3 : k;
      near_origin[k] = forward ? plus[k] : minus[k];
      far_origin[k] = forward ? minus[k] : plus[k];
      order[k] = (static_cast<size_t>(s.axis) + 1 + k) % 3;
      origin[k] = at[order[k]];
    }
    shear[0] = s.shear.x;
    shear[1] = s.shear.y;
    shear[2] = s.shear.z;
  }
};

// Children hit within (tmin, tmax) as bits, and where they are entered.
HWY_INLINE uint32_t hit_children(const WideNode& node, const Frame& frame, float tmin, float tmax,
                                 float* t_in) {
  const CappedTag<float, kWideChildren> d;
  uint32_t bits = 0;
  for (size_t i = 0; i < kWideChildren; i += hn::Lanes(d)) {
    auto first = hn::Set(d, tmin);
    auto last = hn::Set(d, tmax);
    for (size_t k = 0; k < 3; ++k) {
      const auto inverse = hn::Set(d, frame.inverse[k]);
      const auto near = hn::Load(d, node.plane[frame.near[k]] + i);
      const auto far = hn::Load(d, node.plane[frame.far[k]] + i);
      first = hn::Max(first, hn::Mul(hn::Sub(near, hn::Set(d, frame.near_origin[k])), inverse));
      last = hn::Min(last, hn::Mul(hn::Sub(far, hn::Set(d, frame.far_origin[k])), inverse));
    }
    hn::Store(first, d, t_in + i);
    bits |= bits_of(d, hn::Le(first, last)) << i;
  }
  return bits;
}

// lsp_triangle for four: the edge functions side by side, the depth of those few that pass by the library's
// own lsp_plane_depth.
// `partial` are the records of a scene where some are there in part, else null.
HWY_INLINE void hit_block(const TriangleBlock& block, const LspTriangle* partial, const LspSetup& s,
                          const Frame& frame, LspBest& best) {
  const CappedTag<float, kBlockTriangles> d;
  wide::Text text;
  const glm::vec3 direction = text.lsp_rotate(s.direction, s.axis);
  const size_t x = frame.order[0], y = frame.order[1], z = frame.order[2];
  for (size_t i = 0; i < kBlockTriangles; i += hn::Lanes(d)) {
    const auto corner = [&](size_t c, size_t axis, size_t place) HWY_ATTR {
      return hn::Sub(hn::Load(d, block.corner[3 * c + axis] + i), hn::Set(d, frame.origin[place]));
    };
    const auto shear_x = hn::Set(d, frame.shear[0]), shear_y = hn::Set(d, frame.shear[1]);
    const auto az = corner(0, z, 2), bz = corner(1, z, 2), cz = corner(2, z, 2);
    const auto ax = hn::Sub(corner(0, x, 0), hn::Mul(shear_x, az));
    const auto ay = hn::Sub(corner(0, y, 1), hn::Mul(shear_y, az));
    const auto bx = hn::Sub(corner(1, x, 0), hn::Mul(shear_x, bz));
    const auto by = hn::Sub(corner(1, y, 1), hn::Mul(shear_y, bz));
    const auto cx = hn::Sub(corner(2, x, 0), hn::Mul(shear_x, cz));
    const auto cy = hn::Sub(corner(2, y, 1), hn::Mul(shear_y, cz));
    const auto u = hn::Sub(hn::Mul(cx, by), hn::Mul(cy, bx));
    const auto v = hn::Sub(hn::Mul(ax, cy), hn::Mul(ay, cx));
    const auto w = hn::Sub(hn::Mul(bx, ay), hn::Mul(by, ax));
    const auto zero = hn::Zero(d);
    const auto below = hn::Or(hn::Lt(u, zero), hn::Or(hn::Lt(v, zero), hn::Lt(w, zero)));
    const auto above = hn::Or(hn::Gt(u, zero), hn::Or(hn::Gt(v, zero), hn::Gt(w, zero)));
    // A hit's depth lies between those of its corners.
    const auto scale = hn::Set(d, frame.shear[2]);
    const auto ta = hn::Mul(az, scale), tb = hn::Mul(bz, scale), tc = hn::Mul(cz, scale);
    const auto outside = hn::Or(hn::Ge(hn::Min(ta, hn::Min(tb, tc)), hn::Set(d, best.t)),
                                hn::Le(hn::Max(ta, hn::Max(tb, tc)), hn::Set(d, s.tmin)));
    uint32_t left = ~bits_of(d, hn::Or(hn::And(below, above), outside)) & ((1u << hn::Lanes(d)) - 1u);
    if (left == 0) continue;
    HWY_ALIGN float us[kBlockTriangles], vs[kBlockTriangles], ws[kBlockTriangles];
    hn::Store(u, d, us);
    hn::Store(v, d, vs);
    hn::Store(w, d, ws);
    for (; left != 0; left &= left - 1) {
      const auto lane = static_cast<size_t>(hwy::Num0BitsBelowLS1Bit_Nonzero32(left));
      const float det = us[lane] + vs[lane] + ws[lane];
      if (det == 0.0f || !text.lsp_is_finite(det)) continue;
      const auto seen = [&](size_t c) {
        const auto value = [&](size_t axis, size_t place) {
          return block.corner[3 * c + axis][i + lane] - frame.origin[place];
        };
        return glm::vec3(value(x, 0), value(y, 1), value(z, 2));
      };
      const float t = text.lsp_plane_depth(direction, s.shear.z, seen(0), seen(1), seen(2));
      if (!(t > s.tmin && t < best.t)) continue;
      if (partial != nullptr && text.lsp_passes(s, partial[block.record[i + lane]])) continue;
      best.t = t;
      best.u = vs[lane] / det;
      best.v = ws[lane] / det;
      best.triangle = block.record[i + lane];
    }
  }
}

// A tree as deep as the format allows, all children but one of every node waiting.
constexpr size_t kStack = LSP_MAX_STACK * (kWideChildren - 1) + 1;

template <bool kAny>
HWY_INLINE void traverse(const WideNode* nodes, const TriangleBlock* blocks, const LspTriangle* partial,
                         const LspSetup& s, LspBest& best) {
  struct Entry {
    float t;
    uint32_t ref;
  };
  Entry stack[kStack];
  size_t top = 0;
  const Frame frame(s);
  uint32_t ref = 0;
  for (;;) {
    if (ref & LSP_LEAF_BIT) {
      const TriangleBlock* block = blocks + (ref & LSP_LEAF_FIRST_MASK);
      const uint32_t count = ((ref >> LSP_LEAF_COUNT_SHIFT) & LSP_LEAF_COUNT_MASK) + 1;
      for (uint32_t i = 0; i < count; ++i) hit_block(block[i], partial, s, frame, best);
      if (kAny && best.triangle != LSP_NONE) return;
    } else {
      const WideNode& node = nodes[ref];
      HWY_ALIGN float t_in[kWideChildren];
      uint32_t hit = hit_children(node, frame, s.tmin, best.t, t_in);
      if (hit != 0) {
        // The child to go on with, in a register: the nearest, for any hit the largest. Most nodes have one
        // or two.
        const auto first = hwy::Num0BitsBelowLS1Bit_Nonzero32(hit);
        Entry next{t_in[first], node.child[first]};
        if (kAny) {
          for (uint32_t rest = hit & (hit - 1); rest != 0;) {
            const auto k = static_cast<uint32_t>(31 - hwy::Num0BitsAboveMS1Bit_Nonzero32(rest));
            rest ^= 1u << k;
            stack[top++] = {t_in[k], node.child[k]};
          }
        } else {
          const size_t bottom = top;
          for (uint32_t rest = hit & (hit - 1); rest != 0; rest &= rest - 1) {
            const auto k = hwy::Num0BitsBelowLS1Bit_Nonzero32(rest);
            Entry entry{t_in[k], node.child[k]};
            if (entry.t < next.t) std::swap(entry, next);
            size_t at = top++;
            for (; at > bottom && stack[at - 1].t < entry.t; --at) stack[at] = stack[at - 1];
            stack[at] = entry;
          }
        }
        ref = next.ref;
        continue;
      }
    }
    do {
      if (top == 0) return;
      --top;
    } while (!(stack[top].t <= best.t));
    ref = stack[top].ref;
  }
}

void trace_rays(const WideTree& tree, bool any, std::span<const LspRay> rays, std::span<LspHit> hits) {
  const lsp_scene& scene = tree.scene();
  const WideNode* nodes = tree.nodes().data();
  const TriangleBlock* blocks = tree.blocks().data();
  const bool any_partial = (scene.header->required_features & LSP_FEATURE_COVERAGE) != 0;
  const LspTriangle* partial = any_partial ? scene.triangles : nullptr;
  wide::Text text;
  for (size_t i = 0; i < rays.size(); ++i) {
    const LspSetup s = text.lsp_setup(scene, rays[i]);
    if (!s.valid) {
      hits[i] = text.lsp_no_hit();
      continue;
    }
    LspBest best = text.lsp_no_best(s);
    if (any)
      traverse<true>(nodes, blocks, partial, s, best);
    else
      traverse<false>(nodes, blocks, partial, s, best);
    best.complete = true;
    hits[i] = text.lsp_finish(scene, s, rays[i], best);
  }
}

const char* target_name() { return hwy::TargetName(HWY_TARGET); }

}  // namespace HWY_NAMESPACE
}  // namespace lsp::bench
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace lsp::bench {

HWY_EXPORT(trace_rays);
HWY_EXPORT(target_name);

void WideTree::trace(bool any, std::span<const LspRay> rays, std::span<LspHit> hits) const {
  HWY_DYNAMIC_DISPATCH(trace_rays)(*this, any, rays, hits);
}

const char* wide_target() { return HWY_DYNAMIC_DISPATCH(target_name)(); }

}  // namespace lsp::bench
#endif
