// Rays through the tree over instances, a node's eight boxes side by side in the lanes of a vector (Google
// Highway), compiled for each instruction set and chosen when a trace is asked for.
//
// Which instance is hit first along a ray does not depend on the order in which they are visited, as long as
// none is left out whose box lsp_instance_entry (lsp/instance_walk.h) would have the ray enter in time for
// good reason. Where a plane is met is (plane - o) / d -+ margin / |d| here, and (plane -+ margin - o) / d
// there: a difference, a reciprocal, a product and a sum in either case, which round by u R each along the
// axis; the sum here may be fused, which spares one. So the four roundings for which the margin has room
// (NUMERICS.md, Instances) are those of today's text. A margin of its own for every child: one that is
// sheared a lot does not widen its neighbours. What is no number (infinity minus infinity, of rays from
// beyond the range of floats) bounds nothing.
#include "trace_instances.h"

#include <bit>

#include "simd_targets.h"
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "trace_instances_lanes.cpp"
#include <hwy/foreach_target.h>
// What Highway compiles for must be known first.
#include <hwy/highway.h>

// Without vectors there is the text of trace_instances.cpp.
#if HWY_TARGET != HWY_SCALAR && HWY_TARGET != HWY_EMU128
#include "wide_rays-inl.h"

HWY_BEFORE_NAMESPACE();
namespace lsp {
namespace HWY_NAMESPACE {
namespace {

using Node = lsp_instance_wide_node;
static_assert(sizeof(Node::growth) / sizeof(float) == kChildren);

// A ray in every lane.
class Boxes {
 public:
  HWY_INLINE explicit Boxes(const InstanceWalk& walk, float last)
      : reach_(hn::Set(d8, walk.ray.reach)), tmin_(hn::Set(d8, walk.ray.tmin)), last_(hn::Set(d8, last)) {
    for (int i = 0; i < 3; ++i) {
      const float slope = walk.ray.inverse[i];
      origin_[i] = hn::Set(d8, walk.ray.origin[i]);
      slope_[i] = hn::Set(d8, slope);
      steepness_[i] = hn::Abs(slope_[i]);
      goes_up_[i] = slope > 0;
    }
  }

  // Children that the ray enters in time, a bit each, and where.
  HWY_INLINE uint32_t hit(const Node& node, float* entries) const {
    uint32_t hits = 0;
    for (size_t at = 0; at < kChildren; at += kBoxes) {
      const V8 margin = hn::Mul(hn::LoadU(d8, node.growth + at), reach_);
      V8 in = tmin_, out = last_;
      for (int i = 0; i < 3; ++i) {
        const float* const first = goes_up_[i] ? node.lo[i] : node.hi[i];
        const float* const second = goes_up_[i] ? node.hi[i] : node.lo[i];
        const V8 wider = hn::Mul(margin, steepness_[i]);
        in = max_of(in, hn::MulSub(hn::Sub(hn::LoadU(d8, first + at), origin_[i]), slope_[i], wider));
        out = min_of(out, hn::MulAdd(hn::Sub(hn::LoadU(d8, second + at), origin_[i]), slope_[i], wider));
      }
      hn::Store(in, d8, entries + at);
      hits |= mask_bits(d8, hn::Le(in, out)) << at;
    }
    return hits;
  }

 private:
  V8 origin_[3], slope_[3], steepness_[3], reach_, tmin_, last_;
  bool goes_up_[3];
};

// What waits to be visited of a walk, the nearest on top.
struct Stack {
  uint32_t* ref;
  float* t;
  uint32_t top;

  // Of the children `hits` of a node the nearest is returned, the others wait, the farthest lowest.
  HWY_INLINE uint32_t push_farther(const Node& node, const float* entries, uint32_t hits) {
    auto nearest = static_cast<uint32_t>(std::countr_zero(hits));
    const uint32_t bottom = top;
    while ((hits &= hits - 1) != 0) {
      const auto child = static_cast<uint32_t>(std::countr_zero(hits));
      const bool is_nearer = entries[child] < entries[nearest];
      const uint32_t other = is_nearer ? nearest : child;
      nearest = is_nearer ? child : nearest;
      uint32_t place = top++;
      for (; place > bottom && t[place - 1] < entries[other]; --place) {
        t[place] = t[place - 1];
        ref[place] = ref[place - 1];
      }
      t[place] = entries[other];
      ref[place] = node.child[other];
    }
    return node.child[nearest];
  }
};

HWY_INLINE uint32_t next_instance(const lsp_instances& instances, uint32_t mask, InstanceWalk& walk,
                                  float tmax) {
  const float last = InstanceWalk::lsp_min(tmax * walk.ray.to_scaled, LSP_FLOAT_MAX);
  const Boxes boxes(walk, last);
  Stack stack = {walk.lsp_instance_ref, walk.lsp_instance_t, walk.lsp_instance_top};
  uint32_t found = LSP_NONE;
  while (found == LSP_NONE && stack.top > 0) {
    --stack.top;
    if (!(stack.t[stack.top] <= last)) continue;
    uint32_t ref = stack.ref[stack.top];
    while ((ref & LSP_INSTANCE_BIT) == 0) {
      const Node& node = instances.wide[ref];
      HWY_ALIGN float entries[kChildren];
      const uint32_t hits = boxes.hit(node, entries);
      if (stack.top + static_cast<uint32_t>(std::popcount(hits)) > LSP_INSTANCE_DEPTH) return kNoRoom;
      ref = hits == 0 ? LSP_NONE : stack.push_farther(node, entries, hits);
    }
    // To a ray from far away lanes without a child are as wide as others.
    if (ref == LSP_NONE) continue;
    const uint32_t number = ref & ~LSP_INSTANCE_BIT;
    if ((instances.records[number].instance.mask & mask & 0xFFu) != 0) found = number;
  }
  walk.lsp_instance_top = stack.top;
  return found;
}

void trace(const InstanceQueue& queue) {
  for (uint32_t k = 0; k < queue.count; ++k) {
    const uint32_t i = queue.number[k];
    if (!queue.walks[i].is_wide) continue;
    queue.next[k] = next_instance(queue.instances, queue.mask, queue.walks[i], queue.tmax[i]);
  }
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace lsp
HWY_AFTER_NAMESPACE();
#endif

#if HWY_ONCE
namespace lsp {

const WideInstances kWideInstances[] = {
#include "simd_loops.inc"
};

const WideInstances* wide_instances() { return best_here(kWideInstances); }

}  // namespace lsp
#endif
