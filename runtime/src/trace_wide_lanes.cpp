// Exact rays through wide nodes (lsp/wide.h), a node's eight boxes side by side in the lanes of a vector, and
// four triangles of a leaf (Google Highway), compiled for each instruction set and chosen when a trace is
// asked for.
//
// The triangle test is that of lsp/traverse.h, operation by operation: a lane has the bits of a single
// triangle. The boxes are not: for a ray alone a plane lo + q * step is met at
// q * (step / d) + (lo / d - o / d), fused where the machine can, and for a group at (lo + q * step) / d - o
// / d. What a ray hits does not depend on it, nor on the order in which children are visited (see
// lsp_triangle; any-hit rays keep to the order of the file), as long as no box is missed whose triangle would
// be hit. Rays are made ready a vector at a time, lsp_setup across lanes. Rounding, with the words of
// lsp/traverse.h: along the axis (o / d) is off by u max|o|, lo / d by u (max|o| + R), their sum and step / d
// by u R and 2 u R, q times that and the sum by 3 u R: 8 u R and 2 u max|o| beside the 5 u R of the triangle,
// where a box is grown by 16 u R + 4 u max|o|; of a group q * step is off by 2 u R, its sum with lo and that
// over d by u (max|o| + R) each, the last sum by u R: 5 u R and 3 u max|o|. Where a product might overflow,
// in scenes or from origins beyond 2^40, rays are traced by the text of single ones.
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
#include "ray_order.h"
#include "trace_loops.h"
#include "trace_subset.h"
#include "trace_variant.h"
#include "wide_found-inl.h"
#include "wide_nodes-inl.h"

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

Best no_hit_before(float tmax) {
  Best best{};
  best.t = tmax;
  best.triangle = LSP_NONE;
  return best;
}

// Of children `first` and those of `hits`, entered at t: the nearest is returned, the others wait, the
// farthest lowest.
HWY_INLINE uint32_t push_farther(const Tree<Text>& tree, const LspWideNode& node, const float* t,
                                 uint32_t first, uint32_t hits, Waiting*& top) {
  const auto number = static_cast<uint32_t>(&node - tree.nodes()) << 3;
  const Waiting* const bottom = top;
  uint32_t nearest = first;
  for (; hits != 0; hits &= hits - 1) {
    const auto child = static_cast<uint32_t>(std::countr_zero(hits));
    const bool is_nearer = t[child] < t[nearest];
    const uint32_t other = is_nearer ? nearest : child;
    nearest = is_nearer ? child : nearest;
    Waiting* place = top++;
    for (; place > bottom && place[-1].of.t < t[other]; --place) *place = place[-1];
    *place = {{.t = t[other]}, number | other};
    tree.ask_for(node, Tree<Text>::child_of(node, other));
  }
  return nearest;
}

// Takes what waits on top of the stack, of closest rays what is not behind best_t. False: nothing waits.
template <bool kAny>
HWY_INLINE bool pop(const Tree<Text>& tree, float best_t, Waiting*& top, const LspWideNode*& node,
                    uint32_t& child) {
  if constexpr (kAny) {
    Waiting& waiting = top[-1];
    if (waiting.node == kNoNode) return false;
    node = tree.nodes() + waiting.node;
    child = Tree<Text>::child_of(*node, static_cast<uint32_t>(std::countr_zero(waiting.of.children)));
    waiting.of.children &= waiting.of.children - 1;
    top -= waiting.of.children == 0 ? 1 : 0;
  } else {
    --top;
    while (top->of.t > best_t) --top;
    if (top->node == kNoNode) return false;
    node = tree.nodes() + (top->node >> 3);
    child = Tree<Text>::child_of(*node, top->node & 7);
  }
  return true;
}

// A ray alone from a node on. Closest rays take children from the nearest on, any-hit rays in the order of
// the file, and end with what they hit first. What waits goes between `top` and `end`. False: the file's
// bounds are wrong.
template <bool kAny>
HWY_NOINLINE bool walk_alone(const Tree<Text>& tree, const Lone& r, const LspWideNode* node, Waiting* top,
                             const Waiting* end, uint32_t& left, Best& best) {
  constexpr size_t kPushed = kAny ? 1 : kChildren;
  const V8 tmin = hn::Set(d8, r.tmin);
  *top++ = {{.t = -HUGE_VALF}, kNoNode};
  for (;;) {
    if (left == 0 || top > end - kPushed) return false;
    --left;
    HWY_ALIGN float t[kChildren];
    tree.ask_for_children(*node);
    uint32_t hits = hit_children(*node, r, tmin, hn::Set(d8, best.t), t), child = LSP_WIDE_NO_CHILD;
    if (hits != 0) {
      auto first = static_cast<uint32_t>(std::countr_zero(hits));
      hits &= hits - 1;
      if constexpr (kAny) {
        *top = {{.children = hits}, static_cast<uint32_t>(node - tree.nodes())};
        top += hits != 0 ? 1 : 0;
      } else {
        first = push_farther(tree, *node, t, first, hits, top);
      }
      child = Tree<Text>::child_of(*node, first);
    } else if (!pop<kAny>(tree, best.t, top, node, child)) {
      return true;
    }
    // What is below.
    for (;;) {
      if ((child & LSP_WIDE_NODE_BIT) != 0) {
        if (const LspWideNode* below = tree.below(*node, child)) {
          node = below;
          break;
        }
      } else {
        if (left == 0) return false;
        --left;
        tree.hit_leaf(*node, child, r.rows, best);
        if (kAny && best.triangle != LSP_NONE) return true;
      }
      if (!pop<kAny>(tree, best.t, top, node, child)) return true;
    }
  }
}

// Any-hit rays, a group together: a node is brought near and decoded once for all that visit it, and only a
// ray that is left alone in a subtree goes on by itself. Every ray visits the nodes and leaves that it would
// visit alone, in their order, which is the file's. (Tsakok, "Faster Incoherent Rays: Multi-BVH Ray Stream
// Tracing", 2009.)
class AnyHit {
 public:
  explicit AnyHit(const Tree<Text>& tree) : tree_(tree) { stack_[0].node = kNoNode; }

  // Rays, a bit each of `alive`, from the root on. Those that hit something leave `alive`, by found(ray,
  // best). False: the file's bounds are wrong.
  template <class FoundBy>
  HWY_INLINE bool walk(const Batch& batch, const LspRay* rays, uint32_t& alive, FoundBy found) {
    uint32_t left = tree_.most_steps(), here = alive;
    const LspWideNode* node = tree_.nodes();
    Waiting* top = stack_ + 1;
    const auto keep = [&](uint32_t ray, const Best& best) HWY_ATTR {
      if (best.triangle == LSP_NONE) return;
      found(ray, best);
      alive ^= 1u << ray;
    };
    while (here != 0) {
      if ((here & (here - 1)) == 0) {
        const auto i = static_cast<uint32_t>(std::countr_zero(here));
        Best best = no_hit_before(batch.tmax[i]);
        if (!walk_alone<true>(tree_, Lone(batch, i, rays[i]), node, top, stack_ + kStack, left, best))
          return false;
        keep(i, best);
      } else {
        if (left == 0 || top > stack_ + kStack - kChildren) return false;
        --left;
        push_children(*node, batch, here, top);
      }
      // What waits on top.
      for (;;) {
        --top;
        if (top->node == kNoNode) return true;
        here = top->of.rays & alive;
        if (here == 0) continue;
        node = tree_.nodes() + (top->node >> 3);
        const uint32_t child = Tree<Text>::child_of(*node, top->node & 7);
        if ((child & LSP_WIDE_NODE_BIT) != 0) {
          const LspWideNode* below = tree_.below(*node, child);
          if (below == nullptr) continue;
          node = below;
          break;
        }
        if (left == 0) return false;
        --left;
        for (; here != 0; here &= here - 1) {
          const auto i = static_cast<uint32_t>(std::countr_zero(here));
          Best best = no_hit_before(batch.tmax[i]);
          tree_.hit_leaf(*node, child, batch.rows(i, rays[i]), best);
          keep(i, best);
        }
      }
    }
    return true;
  }

 private:
  HWY_INLINE void push_children(const LspWideNode& node, const Batch& batch, uint32_t here, Waiting*& top) {
    tree_.ask_for_children(node);
    HWY_ALIGN uint32_t by_child[kChildren];
    const auto number = static_cast<uint32_t>(&node - tree_.nodes()) << 3;
    for (uint32_t left = hit_children(node, batch, here, by_child); left != 0;) {
      const uint32_t child = 31u - static_cast<uint32_t>(std::countl_zero(left));
      left ^= 1u << child;
      *top++ = {{.rays = by_child[child]}, number | child};
      tree_.ask_for(node, Tree<Text>::child_of(node, child));
    }
  }

  const Tree<Text>& tree_;
  Waiting stack_[kStack];
};

// Invalid rays, those whose products may overflow, and those that a damaged file leads astray.
LspHit trace_singly(const lsp_scene& scene, const LspRay& ray, uint32_t flags) {
  LspHit hit;
  trace_wide(scene, flags, 0, &ray, &hit, 1, nullptr);
  return hit;
}

using FoundHits = Found<kGroup + kLanes>;

void trace_closest(const Answered& to, uint32_t flags) {
  const Tree<Text> tree(to.scene);
  Batch batch(*to.scene.header);
  Waiting stack[kStack];
  FoundHits found;
  for (uint32_t first = 0; first < to.count; first += kGroup) {
    const auto here = static_cast<uint32_t>(std::min<size_t>(to.count - first, kGroup));
    const uint32_t ready = batch.make_ready(to.rays + first, here);
    for (uint32_t i = 0; i < here; ++i) {
      const LspRay& ray = to.rays[first + i];
      LspHit& hit = to.hits[first + i];
      if ((ready >> i & 1u) == 0) {
        hit = trace_singly(to.scene, ray, flags);
        continue;
      }
      Best best = no_hit_before(batch.tmax[i]);
      uint32_t left = tree.most_steps();
      const bool complete = tree.empty() || walk_alone<false>(tree, Lone(batch, i, ray), tree.nodes(), stack,
                                                              stack + kStack, left, best);
      const uint32_t bits = complete ? 0 : LSP_HIT_INCOMPLETE;
      if (best.triangle != LSP_NONE) {
        found.add(to.scene, first + i, best.triangle, best.t, best.u, best.v, bits);
      } else {
        hit = Text::lsp_no_hit();
        hit.flags = bits;
      }
    }
    if (found.size() >= kLanes) found.answer(to);
  }
  found.answer(to);
}

// So few have little to share, and their order costs more than it saves.
constexpr uint32_t kFewTogether = 48;

// Rays that begin near each other go down the tree together.
void trace_any(const Answered& to, uint32_t flags) {
  const Tree<Text> tree(to.scene);
  Batch batch(*to.scene.header);
  AnyHit any_hit(tree);
  FoundHits found;
  uint16_t order[kMostOrdered];
  const bool together = to.count >= kFewTogether;
  if (together)
    order_by_origin(to.rays, to.count, order);
  else
    for (uint32_t i = 0; i < to.count; ++i) order[i] = static_cast<uint16_t>(i);
  for (uint32_t first = 0; first < to.count; first += kGroup) {
    const auto here = static_cast<uint32_t>(std::min<size_t>(to.count - first, kGroup));
    const uint16_t* numbers = order + first;
    LspRay rays[kGroup];
    for (uint32_t i = 0; i < here; ++i) rays[i] = to.rays[numbers[i]];
    const uint32_t ready = batch.make_ready(rays, here);
    const auto found_by = [&](uint32_t ray, const Best& best) HWY_ATTR {
      found.add(to.scene, numbers[ray], best.triangle, best.t, best.u, best.v, 0);
    };
    uint32_t missed = ready;
    bool complete = true;
    for (uint32_t left = tree.empty() ? 0 : ready, rest; left != 0; left = rest) {
      rest = together ? 0 : left & (left - 1);
      uint32_t alive = left ^ rest;
      complete &= any_hit.walk(batch, rays, alive, found_by);
      missed &= rest | alive | ~left;
    }
    for (uint32_t i = 0; i < here; ++i) {
      const bool is_ready = (ready >> i & 1u) != 0, misses = (missed >> i & 1u) != 0;
      if (is_ready && !misses) continue;
      to.hits[numbers[i]] =
          is_ready && complete ? Text::lsp_no_hit() : trace_singly(to.scene, rays[i], flags);
    }
    if (found.size() >= kLanes) found.answer(to);
  }
  found.answer(to);
}

void trace(const lsp_scene& scene, uint32_t flags, const LspRay* rays, LspHit* hits, uint64_t count) {
  // Of the stack, as lsp/lsp.h says.
  static_assert(sizeof(Batch) + kStack * sizeof(Waiting) + sizeof(FoundHits) <= 20 * 1024);
  static_assert(sizeof(Batch) + sizeof(AnyHit) + sizeof(FoundHits) + kMostOrdered * sizeof(uint16_t) <=
                30 * 1024);
  const bool any_hit = (flags & LSP_TRACE_ANY_HIT) != 0;
  const uint64_t at_once = any_hit ? kMostOrdered : uint64_t{1} << 30;  // numbers of rays have 32 bits
  for (uint64_t first = 0; first < count; first += at_once) {
    const auto here = static_cast<uint32_t>(std::min(count - first, at_once));
    const Answered to = {scene, rays + first, hits + first, here, (flags & LSP_TRACE_OCCLUSION) != 0, false};
    if (any_hit)
      trace_any(to, flags);
    else
      trace_closest(to, flags);
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
