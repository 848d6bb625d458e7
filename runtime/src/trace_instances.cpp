// Traces rays through instances on the CPU. A batch of rays walks a tree over instances, each ray as far as
// its next instance; those that reach instances of one asset are moved to its space and traced together by
// lsp_trace; and so on until no ray has an instance left that could be nearer than what it has hit.
#include <algorithm>
#include <cmath>

#include "error.h"
#include "trace_instances.h"
#include "trace_options.h"

namespace lsp {
namespace {

using namespace instance_subset;

// Rays that walk together: so many that most assets get enough of them to be traced in lanes (kFewRays,
// kFewExactRays). With 64 approximate rays through six assets of cells have 0.7 to 0.8 of the speed, exact
// ones 0.93 to 0.97. To give the slots of rays that have ended to new ones was no faster, and slower where
// neighbours are near.
constexpr uint32_t kBatch = 256;

// From so many instances on boxes are met in vectors. Of exact rays through 2 the wide tree has 0.92 to 0.94
// of the speed, through 9 0.98 to 0.99, through 17 1.08 to 1.10, through 129 1.24 to 1.29.
[[maybe_unused]] constexpr uint32_t kManyInstances = 16;

// A batch of rays and the hits they have so far, whose normals are in object space until the end.
class InstanceBatch {
 public:
  InstanceBatch(const lsp_instances& instances, const lsp_trace_options& options, uint32_t mask,
                bool counting, lsp_error* error)
      : instances_(instances), options_(options), mask_(mask), counting_(counting), error_(error) {
    options_.flags = LSP_TRACE_IMPLIED(options.flags);
#ifdef LSP_SIMD
    // Work is counted as shaders do it, and which hit an any-hit ray names depends on the order of instances:
    // it is that of shaders, too.
    const bool has_their_order =
        (options_.flags & (LSP_TRACE_ANY_HIT | LSP_TRACE_OCCLUSION)) == LSP_TRACE_ANY_HIT;
    if (!counting && !has_their_order && instances.count >= kManyInstances) wide_ = wide_instances();
#endif
  }

  // Traces rays[0, count), at most kBatch.
  lsp_status trace(const LspRay* rays, LspHit* hits, uint32_t count) {
    rays_ = rays;
    hits_ = hits;
    begin(count);
    while (advance()) {
      sort_by_asset();
      for (uint32_t first = 0, end = 0; first < on_count_; first = end) {
        const uint32_t asset = sorted_[first].asset;
        while (end < on_count_ && sorted_[end].asset == asset) ++end;
        if (const lsp_status status = trace_waiting(asset, &sorted_[first], end - first); status != LSP_OK)
          return status;
      }
    }
    for (uint32_t i = 0; i < count; ++i) {
      if (!is_hit(hits[i])) continue;
      ++counts_.hits;
      if ((options_.flags & LSP_TRACE_OCCLUSION) != 0) continue;
      const LspPlace place = lsp_load_place(instances_, LSP_HIT_INSTANCE(hits[i]));
      hits[i].normal = lsp_float3_of(InstanceWalk::lsp_move_normal(place, lsp_vec3(hits[i].normal)));
    }
    return LSP_OK;
  }

  // Of all batches so far.
  const lsp_trace_counts& counts() const { return counts_; }

 private:
  // A ray that waits for its next instance.
  struct Waiting {
    uint32_t asset, instance, ray;
  };
  uint32_t asset_of(uint32_t instance) const { return instances_.records[instance].instance.asset; }

  // Those of an asset side by side, as they were. Of more assets than kPiles several share one: theirs may
  // then come in several parts.
  void sort_by_asset() {
    constexpr uint32_t kPiles = 256;
    uint16_t ends[kPiles + 1] = {};
    for (uint32_t k = 0; k < on_count_; ++k) ++ends[waiting_[k].asset % kPiles + 1];
    const uint32_t piles = std::min(instances_.asset_count, kPiles);
    for (uint32_t i = 1; i < piles; ++i) ends[i + 1] += ends[i];
    for (uint32_t k = 0; k < on_count_; ++k) sorted_[ends[waiting_[k].asset % kPiles]++] = waiting_[k];
  }

  // Of occlusion there may be no more than t.
  static bool is_hit(const LspHit& hit) { return hit.t < INFINITY; }

  void begin(uint32_t count) {
    on_count_ = 0;
    counts_.rays += count;
    for (uint32_t i = 0; i < count; ++i) {
      hits_[i] = {INFINITY, LSP_NONE, 0, 0, {0, 0, 0}, 0};
      if (!InstanceWalk::lsp_is_valid(rays_[i])) {
        ++counts_.invalid;
        continue;
      }
      if (instances_.count == 0) continue;
      begin_walk(walks_[i], rays_[i], wide_ != nullptr);
      on_[on_count_++] = i;
    }
  }
  LSP_INLINE void begin_walk(InstanceWalk& walk, const LspRay& ray, bool is_wide) {
    walk.ray = walk.lsp_begin_instances(instances_, ray);
    walk.is_wide = is_wide;
    if (is_wide) walk.lsp_instance_ref[0] = 0;  // the root
  }

  // Takes every ray that goes on to its next instance. False: none goes on.
  bool advance() {
    uint32_t asking = 0;
    for (uint32_t k = 0; k < on_count_; ++k) {
      const uint32_t i = on_[k];
      const bool hit = is_hit(hits_[i]);
      if (hit && (options_.flags & LSP_TRACE_ANY_HIT) != 0) continue;
      tmax_[i] = hit ? hits_[i].t : rays_[i].tmax;
      on_[asking++] = i;
    }
    if (wide_ != nullptr) wide_->trace({instances_, mask_, walks_, on_, tmax_, next_, asking});
    on_count_ = 0;
    for (uint32_t k = 0; k < asking; ++k) {
      const uint32_t i = on_[k];
      const uint32_t instance = walks_[i].is_wide && next_[k] != kNoRoom ? next_[k] : next_of_two(i);
      if (instance == LSP_NONE) continue;
      waiting_[on_count_] = {asset_of(instance), instance, i};
      on_[on_count_++] = i;
    }
    return on_count_ > 0;
  }

  // The same of one ray through the binary tree.
  LSP_INLINE uint32_t next_of_two(uint32_t i) {
    InstanceWalk& walk = walks_[i];
    if (walk.is_wide) [[unlikely]]
      begin_again(i);
    const uint32_t before = walk.lsp_instance_visited;
    const uint32_t instance = walk.lsp_next_instance(instances_, walk.ray, mask_, tmax_[i]);
    counts_.nodes += walk.lsp_instance_visited - before;
    return instance;
  }

  // Where the wide tree had no room, from the root of the binary one: an instance that was visited has
  // nothing nearer to offer.
  __attribute__((noinline)) void begin_again(uint32_t i) { begin_walk(walks_[i], rays_[i], false); }

  // Traces the rays that wait for instances of one asset.
  lsp_status trace_waiting(uint32_t asset, const Waiting* waiting, uint32_t count) {
    for (uint32_t k = 0; k < count; ++k) {
      const uint32_t i = waiting[k].ray, number = waiting[k].instance;
      LspRay& moved = moved_[k];
      moved = InstanceWalk::lsp_move_ray(lsp_load_place(instances_, number), rays_[i]);
      if (!is_hit(hits_[i])) continue;
      // Of hits at one t the lowest instance is the answer.
      const bool before = number < LSP_HIT_INSTANCE(hits_[i]);
      moved.tmax = before ? InstanceWalk::lsp_step_up(hits_[i].t) : hits_[i].t;
    }
    lsp_trace_counts counts{};
    if (const lsp_status status = lsp_trace(instances_.assets[asset], &options_, moved_, found_, count,
                                            counting_ ? &counts : nullptr, error_);
        status != LSP_OK)
      return status;
    counts.rays = counts.invalid = counts.hits = 0;  // those of the scene are counted here
    lsp_add_counts(&counts_, &counts);
    for (uint32_t k = 0; k < count; ++k) keep(hits_[waiting[k].ray], found_[k], waiting[k].instance);
    return LSP_OK;
  }

  static void keep(LspHit& hit, const LspHit& found, uint32_t number) {
    const uint32_t incomplete = (hit.flags | found.flags) & LSP_HIT_INCOMPLETE;
    if (is_hit(found)) {
      hit = found;
      hit.flags |= number << LSP_HIT_INSTANCE_SHIFT;
    }
    hit.flags |= incomplete;
  }

  const lsp_instances& instances_;
  lsp_trace_options options_;
  const uint32_t mask_;
  const bool counting_;
  const WideInstances* wide_ = nullptr;  // null: by the binary tree
  lsp_error* const error_;
  lsp_trace_counts counts_{};
  const LspRay* rays_ = nullptr;
  LspHit* hits_ = nullptr;
  uint32_t on_count_ = 0;
  InstanceWalk walks_[kBatch];
  uint32_t on_[kBatch];      // rays that go on
  Waiting waiting_[kBatch];  // the same, at their next instances
  Waiting sorted_[kBatch];
  float tmax_[kBatch];
  uint32_t next_[kBatch];
  LspRay moved_[kBatch];
  LspHit found_[kBatch];
};
static_assert(sizeof(InstanceBatch) <= 104 * 1024);

}  // namespace
}  // namespace lsp

extern "C" lsp_status lsp_trace_instances(const lsp_instances* instances, const lsp_trace_options* options,
                                          uint32_t mask, const LspRay* rays, LspHit* hits, uint64_t count,
                                          lsp_trace_counts* counts, lsp_error* error) {
  if (const lsp_status status = lsp::check_options(*options, error); status != LSP_OK) return status;
  for (uint32_t i = 0; i < instances->asset_count; ++i) {
    lsp_error fault;
    if (const lsp_status status = lsp::check_scene(*instances->assets[i], *options, &fault); status != LSP_OK)
      return lsp::fail(error, status, 0, "asset %u: %s", i, fault.message);
  }
  lsp::succeed(error);
  lsp::InstanceBatch batch(*instances, *options, mask, counts != nullptr, error);
  for (uint64_t first = 0; first < count; first += lsp::kBatch) {
    const auto size = static_cast<uint32_t>(std::min<uint64_t>(lsp::kBatch, count - first));
    if (const lsp_status status = batch.trace(rays + first, hits + first, size); status != LSP_OK)
      return status;
  }
  if (counts != nullptr) lsp_add_counts(counts, &batch.counts());
  return LSP_OK;
}

extern "C" float lsp_instance_hit_offset(const lsp_instances* instances, const LspHit* hit) {
  if (hit->primitive == LSP_NONE) return 0;
  const lsp_instance& instance = instances->records[LSP_HIT_INSTANCE(*hit)].instance;
  const float* t = instance.transform;
  // A plane moves along its normal n by the length of transposed(transform) n for every unit in object space.
  const lsp_float3 n = hit->normal;
  const float x = t[0] * n.x + t[4] * n.y + t[8] * n.z;
  const float y = t[1] * n.x + t[5] * n.y + t[9] * n.z;
  const float z = t[2] * n.x + t[6] * n.y + t[10] * n.z;
  return lsp_hit_offset(instances->assets[instance.asset], hit) * std::hypot(x, y, z);
}
