// Rays on their way through instances: the text that the CPU's tracer and the one that hands assets to a
// device have in common. A batch of rays walks the tree over instances, each ray as far as its next instance;
// those that reach instances of one asset are moved to its space and traced together; and so on until no ray
// has an instance left that could be nearer than what it has hit.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

#include "instances.h"

namespace lsp {

// As lsp_setup of traverse.h has it: such rays are misses everywhere.
inline bool is_valid(const LspRay& ray) {
  const lsp_float3 o = ray.origin, d = ray.direction;
  const float largest = std::max({std::abs(d.x), std::abs(d.y), std::abs(d.z)});
  const float sum = std::abs(o.x) * 0 + std::abs(o.y) * 0 + std::abs(o.z) * 0 + d.x * 0 + d.y * 0 + d.z * 0;
  return sum == 0 && largest >= 0x1p-126f && ray.tmin <= ray.tmax;
}

// A ray on its way through the tree over instances. Planes are met in double: no direction is too short for
// its reciprocal.
class InstanceWalk {
 public:
  void begin(const lsp_instances& instances, const LspRay& ray) {
    const float o[3] = {ray.origin.x, ray.origin.y, ray.origin.z};
    const float d[3] = {ray.direction.x, ray.direction.y, ray.direction.z};
    const lsp_instance_node& root = instances.nodes[0];
    reach_ = 0;
    for (int i = 0; i < 3; ++i) {
      origin_[i] = o[i];
      inverse_[i] = d[i] == 0 ? 0x1p600 : 1.0 / d[i];
      reach_ = std::max({reach_, std::abs(origin_[i] - root.lo[i]), std::abs(origin_[i] - root.hi[i])});
    }
    tmin_ = ray.tmin;
    stack_[0] = 0;
    size_ = 1;
  }

  // The number of the next instance, nearest box first, that shares a bit with `mask` and that the ray enters
  // at tmax, a finite one, at the latest. LSP_NONE: there is none.
  uint32_t next(const lsp_instances& instances, uint32_t mask, double tmax, uint64_t& visited) {
    while (size_ > 0) {
      uint32_t index = stack_[--size_];
      if (!(entry(instances.nodes[index]) <= tmax)) continue;
      while (index != LSP_NONE) {
        const uint32_t child = instances.nodes[index].child;
        if ((child & kInstanceBit) != 0) {
          const uint32_t instance = child & ~kInstanceBit;
          if ((instances.records[instance].instance.mask & mask) != 0) return instance;
          break;
        }
        ++visited;
        index = descend(instances, child, tmax);
      }
    }
    return LSP_NONE;
  }

 private:
  // Of two nodes side by side the nearer; the other waits. LSP_NONE: neither is met.
  uint32_t descend(const lsp_instances& instances, uint32_t first, double tmax) {
    const double t0 = entry(instances.nodes[first]);
    const double t1 = entry(instances.nodes[first + 1]);
    const bool met0 = t0 <= tmax, met1 = t1 <= tmax;
    if (!met0 && !met1) return LSP_NONE;
    if (!met1) return first;
    if (!met0) return first + 1;
    const uint32_t nearer = t1 < t0 ? first + 1 : first;
    stack_[size_++] = nearer ^ first ^ (first + 1);
    return nearer;
  }

  // Where the ray enters the node's box, not before tmin; infinity: it misses it.
  double entry(const lsp_instance_node& node) const {
    const double margin = node.growth * reach_;
    double t_in = tmin_, t_out = INFINITY;
    for (int i = 0; i < 3; ++i) {
      const double a = (node.lo[i] - margin - origin_[i]) * inverse_[i];
      const double b = (node.hi[i] + margin - origin_[i]) * inverse_[i];
      t_in = std::max(t_in, std::min(a, b));
      t_out = std::min(t_out, std::max(a, b));
    }
    return t_in <= t_out ? t_in : INFINITY;
  }

  double origin_[3];
  double inverse_[3];
  double reach_;  // the largest distance along an axis from the origin to a side of the root's box
  double tmin_;
  uint32_t stack_[kInstanceDepth];
  uint32_t size_;
};

inline lsp_float3 to_float3(const double v[3]) {
  return {static_cast<float>(v[0]), static_cast<float>(v[1]), static_cast<float>(v[2])};
}

// The ray in object space. Its direction is not made a unit vector: t is the same in both spaces.
inline LspRay move_ray(const lsp_instance_record& record, const LspRay& ray) {
  const double from[3] = {ray.origin.x - record.translation[0], ray.origin.y - record.translation[1],
                          ray.origin.z - record.translation[2]};
  const double along[3] = {ray.direction.x, ray.direction.y, ray.direction.z};
  double origin[3], direction[3];
  multiply(record.inverse, from, origin);
  multiply(record.inverse, along, direction);
  return {to_float3(origin), ray.tmin, to_float3(direction), ray.tmax};
}

// Normals go with the inverse transpose.
inline void move_normal(const lsp_instance_record& record, LspHit& hit) {
  const double normal[3] = {hit.normal.x, hit.normal.y, hit.normal.z};
  double moved[3];
  multiply_transposed(record.inverse, normal, moved);
  const double largest = std::max({std::abs(moved[0]), std::abs(moved[1]), std::abs(moved[2])});
  for (double& x : moved) x /= largest;
  const double length = std::sqrt(moved[0] * moved[0] + moved[1] * moved[1] + moved[2] * moved[2]);
  for (double& x : moved) x /= length;
  hit.normal = to_float3(moved);
}

// What a batch of at most `Count` rays works on, of fixed size. Any other type with these members, sequences,
// will do as well.
template <uint32_t Count>
struct InstanceArrays {
  InstanceWalk walks[Count];
  uint32_t on[Count];       // rays that go on
  uint64_t waiting[Count];  // asset, instance and ray, see InstanceBatch
  LspRay moved[Count];
  LspHit found[Count];
};

// Rays of a batch at most, whatever it works on.
constexpr uint32_t kLargestInstanceBatch = 1u << 20;

// A batch of rays and the hits they have so far, whose normals are in object space until the end. `Memory` is
// what it works on; `Trace` traces an asset:
//   bool operator()(uint32_t asset, const lsp_trace_options&, const LspRay*, LspHit*, uint32_t count,
//                   lsp_trace_counts*)
// into zeroed counts, or nullptr where nothing is counted. False: it cannot, and the batch ends.
template <class Memory, class Trace>
class InstanceBatch {
 public:
  InstanceBatch(const lsp_instances& instances, const lsp_trace_options& options, uint32_t mask,
                bool counting, Memory& memory, Trace trace)
      : instances_(instances),
        options_(options),
        mask_(mask & 0xFF),
        counting_(counting),
        memory_(memory),
        trace_asset_(trace) {
    // Hits are told apart by their primitives here.
    if ((options_.flags & LSP_TRACE_OCCLUSION) == 0) return;
    options_.flags = (options_.flags & ~LSP_TRACE_OCCLUSION) | LSP_TRACE_ANY_HIT;
  }

  // Traces rays[0, count), at most kLargestInstanceBatch and as many as the memory is for. False: an asset
  // cannot be traced.
  bool trace(const LspRay* rays, LspHit* hits, uint32_t count) {
    rays_ = rays;
    hits_ = hits;
    begin(count);
    while (advance()) {
      ++rounds_;
      std::sort(&memory_.waiting[0], &memory_.waiting[0] + waiting_count_);
      for (uint32_t first = 0, end = 0; first < waiting_count_; first = end) {
        const uint32_t asset = asset_at(first);
        while (end < waiting_count_ && asset_at(end) == asset) ++end;
        if (!trace_waiting(asset, &memory_.waiting[first], end - first)) return false;
      }
    }
    for (uint32_t i = 0; i < count; ++i) {
      if (hits[i].primitive == LSP_NONE) continue;
      move_normal(instances_.records[LSP_HIT_INSTANCE(hits[i])], hits[i]);
      ++counts_.hits;
    }
    return true;
  }

  // Of all batches so far.
  const lsp_trace_counts& counts() const { return counts_; }
  uint64_t rounds() const { return rounds_; }  // times that rays went on to an instance

 private:
  // A ray that waits, as a number to sort by: its asset's (the lowest 20 bits of it: others may come between
  // those of one, which are then traced in several parts), its instance's, its own.
  static constexpr uint32_t kRayBits = 20, kInstanceBits = 24;
  static_assert(1u << kRayBits == kLargestInstanceBatch && 1u << kInstanceBits > LSP_MAX_INSTANCES);
  static uint32_t ray_of(uint64_t waiting) {
    return static_cast<uint32_t>(waiting) & (kLargestInstanceBatch - 1);
  }
  static uint32_t instance_of(uint64_t waiting) {
    return static_cast<uint32_t>(waiting >> kRayBits) & LSP_MAX_INSTANCES;
  }
  uint32_t asset_of(uint32_t instance) const { return instances_.records[instance].instance.asset; }
  uint32_t asset_at(uint32_t k) const { return asset_of(instance_of(memory_.waiting[k])); }

  void begin(uint32_t count) {
    on_count_ = 0;
    counts_.rays += count;
    for (uint32_t i = 0; i < count; ++i) {
      hits_[i] = {INFINITY, LSP_NONE, 0, 0, {0, 0, 0}, 0};
      if (!is_valid(rays_[i])) {
        ++counts_.invalid;
        continue;
      }
      if (instances_.count == 0) continue;
      memory_.walks[i].begin(instances_, rays_[i]);
      memory_.on[on_count_++] = i;
    }
  }

  // Takes every ray that goes on to its next instance. False: none goes on.
  bool advance() {
    waiting_count_ = 0;
    uint32_t going = 0;
    for (uint32_t k = 0; k < on_count_; ++k) {
      const uint32_t i = memory_.on[k];
      const bool hit = hits_[i].primitive != LSP_NONE;
      if (hit && (options_.flags & LSP_TRACE_ANY_HIT) != 0) continue;
      const float tmax = std::min(hit ? hits_[i].t : rays_[i].tmax, std::numeric_limits<float>::max());
      const uint32_t instance = memory_.walks[i].next(instances_, mask_, tmax, counts_.nodes);
      if (instance == LSP_NONE) continue;
      memory_.on[going++] = i;
      memory_.waiting[waiting_count_++] =
          uint64_t{asset_of(instance)} << (kInstanceBits + kRayBits) | uint64_t{instance} << kRayBits | i;
    }
    on_count_ = going;
    return going > 0;
  }

  // Traces the rays that wait for instances of one asset.
  bool trace_waiting(uint32_t asset, const uint64_t* waiting, uint32_t count) {
    for (uint32_t k = 0; k < count; ++k) {
      const uint32_t i = ray_of(waiting[k]), number = instance_of(waiting[k]);
      LspRay& moved = memory_.moved[k];
      moved = move_ray(instances_.records[number], rays_[i]);
      if (hits_[i].primitive == LSP_NONE) continue;
      // Of hits at one t the lowest instance is the answer.
      const bool before = number < LSP_HIT_INSTANCE(hits_[i]);
      moved.tmax = before ? std::nextafter(hits_[i].t, INFINITY) : hits_[i].t;
    }
    lsp_trace_counts counts{};
    if (!trace_asset_(asset, options_, &memory_.moved[0], &memory_.found[0], count,
                      counting_ ? &counts : nullptr))
      return false;
    counts.rays = counts.invalid = counts.hits = 0;  // those of the scene are counted here
    lsp_add_counts(&counts_, &counts);
    for (uint32_t k = 0; k < count; ++k)
      keep(hits_[ray_of(waiting[k])], memory_.found[k], instance_of(waiting[k]));
    return true;
  }

  static void keep(LspHit& hit, const LspHit& found, uint32_t number) {
    const uint32_t incomplete = (hit.flags | found.flags) & LSP_HIT_INCOMPLETE;
    if (found.primitive != LSP_NONE) {
      hit = found;
      hit.flags |= number << LSP_HIT_INSTANCE_SHIFT;
    }
    hit.flags |= incomplete;
  }

  const lsp_instances& instances_;
  lsp_trace_options options_;
  const uint32_t mask_;
  const bool counting_;
  Memory& memory_;
  Trace trace_asset_;
  lsp_trace_counts counts_{};
  uint64_t rounds_ = 0;
  const LspRay* rays_ = nullptr;
  LspHit* hits_ = nullptr;
  uint32_t on_count_ = 0;
  uint32_t waiting_count_ = 0;
};

}  // namespace lsp
