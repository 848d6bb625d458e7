// The loops over rays, for a struct that holds the text of lsp/traverse.h (trace_bvh.cpp, trace_ntree.cpp)
// and knows what to fetch of a leaf.
//
// Approximate rays are traced in groups, so that what one waits for is fetched while the others work (Chen,
// Ailamaki, Gibbons, Mowry, "Improving Hash Join Performance through Prefetching", 2004: group prefetching).
// A ray goes down the tree to something to test, asks for it and lets the next one go on; a look-up, four
// loads that depend on one another, is done a load at a time for all rays that are at one. The steps are
// those of lsp_trace_ready, ray by ray in the same order: the same bits.
//
// Approximate rays on five meshes are 1.3 to 2.1 times as fast as one after the other in shuffled order, 1.0
// to 1.4 times in order. With 32 rays a group it is the same, with 8 less.
//
// Exact rays go one after the other. In groups they were, on five meshes, 0.87 to 1.06 times as fast in order
// and 0.97 to 1.2 times shuffled in a BVH, in an NTree 0.8 to 1.0 times.
#pragma once

#include "trace_loops.h"
#include "trace_subset.h"

// Where there are no loops with vectors (LSP_SIMD), those of cells and wide nodes are compiled for each of
// these instruction sets, chosen when the program is loaded; nothing is contracted, so that all give the same
// bits. What they bring are registers, population counts and three operands: with AVX-512 1.09 to 1.23 times
// as fast on five meshes, exact and approximate, for three times the code: too much for what is traced
// rarely. Not in clang, which takes no address of a template's clones, not under a sanitizer, whose run time
// is not up yet when the loader chooses, and not where nothing is optimised.
#if !defined(LSP_SIMD) && defined(__x86_64__) && defined(__gnu_linux__) && defined(__OPTIMIZE__) && \
    !defined(__clang__) && !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
#define LSP_CLONES __attribute__((target_clones("arch=x86-64-v4", "arch=x86-64-v3", "default")))
#else
#define LSP_CLONES
#endif

namespace lsp {

// What happens once a ray: no loop needs a copy of its own.
template <class Traversal>
__attribute__((noinline)) typename Traversal::LspSetup set_up(const lsp_scene& scene, const LspRay& ray) {
  return Traversal::lsp_setup(scene, ray);
}
template <class Traversal>
__attribute__((noinline)) LspHit finish(const lsp_scene& scene, const typename Traversal::LspSetup& s,
                                        const LspRay& ray, const typename Traversal::LspBest& best) {
  return Traversal::lsp_finish(scene, s, ray, best, 0);
}

template <class Traced>
LSP_INLINE inline void add(lsp_trace_counts* sums, const Traced& traced) {
  if (sums == nullptr) return;
  sums->rays += 1;
  sums->invalid += traced.valid ? 0 : 1;
  sums->hits += traced.hit.primitive != LSP_NONE ? 1 : 0;
  sums->nodes += traced.counts.nodes;
  sums->shafts += traced.counts.shafts;
  sums->triangles += traced.counts.triangles;
  sums->splits += traced.counts.splits;
  sums->exact += traced.counts.exact;
  sums->exact_nodes += traced.counts.exact_nodes;
}

// Traces the few rays that a base structure treats apart, by code of their own: without them the other's
// is 1.07 to 1.12 times as fast. A shader has one loop, for a device may run both. False: the ray is not one
// of these.
template <class Traversal>
LSP_INLINE inline bool trace_if_far(const lsp_scene& scene, const typename Traversal::LspSetup& s,
                                    uint32_t flags, float lod, const LspRay& ray, LspHit& hit,
                                    lsp_trace_counts* counts) {
  if constexpr (requires { Traversal::trace_far; }) {
    if (!Traversal::lsp_is_far(scene, s)) return false;
    Traversal::trace_far(scene, flags, lod, ray, hit, counts);
    return true;
  }
  return false;
}

// Exact rays.
template <class Traversal>
LSP_INLINE inline void trace_singly(const lsp_scene& scene, uint32_t flags, float lod, const LspRay* rays,
                                    LspHit* hits, uint64_t count, lsp_trace_counts* counts) {
  Traversal traversal;
  flags &= LSP_TRACE_ANY_HIT | LSP_TRACE_OCCLUSION;
  for (uint64_t i = 0; i < count; ++i) {
    const typename Traversal::LspSetup s = set_up<Traversal>(scene, rays[i]);
    if (s.valid && trace_if_far<Traversal>(scene, s, flags, lod, rays[i], hits[i], counts)) continue;
    const auto traced = s.valid ? traversal.lsp_trace_ready(scene, s, {flags, lod, false, 0}, rays[i])
                                : Traversal::lsp_invalid_ray();
    hits[i] = traced.hit;
    add(counts, traced);
  }
}

// One of a group: a ray, how far it has come, and its look-up.
template <class Traversal>
struct Waiting : Traversal {
  typename Traversal::LspSetup s;
  uint64_t ray;
  typename Traversal::LspPassage pass;
  uint32_t entry;
  uint32_t candidate;

  LSP_INLINE const LspLineSpace& line_space(const lsp_scene& scene) const {
    return subset::lsp_load_line_space(scene, Traversal::lsp_line_space_index(this->lsp_walk.ref));
  }

  // To what the ray waits for next, and asks for it.
  LSP_INLINE void advance(const lsp_scene& scene, const typename Traversal::LspQuery& q) {
    this->lsp_advance(scene, s, q);
    const uint32_t ref = this->lsp_walk.ref, hit = this->lsp_walk.best.triangle;
    if (ref == LSP_NONE) {
      if (hit == LSP_NONE) return;
      subset::fetch(scene.triangles, hit);
      if (scene.normals != nullptr) subset::fetch(scene.normals, hit);
    } else if ((ref & LSP_LEAF_BIT) != 0u) {
      this->fetch_leaf(scene);
    } else {
      subset::fetch(scene.line_spaces, Traversal::lsp_line_space_index(ref));
    }
  }

  // The stages of a look-up; each asks for what the next one reads.
  LSP_INLINE void find_shaft(const lsp_scene& scene, const typename Traversal::LspQuery& q) {
    const LspLineSpace& ls = line_space(scene);
    pass = this->lsp_find_shaft(s, q, ls);
    subset::fetch(scene.bit_words, ls.word_first + (pass.shaft >> 5u));
  }
  LSP_INLINE void find_entry(const lsp_scene& scene, const typename Traversal::LspQuery& q) {
    const LspLineSpace& ls = line_space(scene);
    entry = this->lsp_find_entry(scene, q, ls, pass);
    subset::fetch(scene.candidates, ls.candidate_first + (entry >> Traversal::lsp_entry_pack(ls)));
  }
  LSP_INLINE void find_candidate(const lsp_scene& scene) {
    candidate = Traversal::lsp_candidate(scene, line_space(scene), entry);
    subset::fetch(scene.triangles, candidate);
  }
  LSP_INLINE void answer(const lsp_scene& scene, const typename Traversal::LspQuery& q) {
    this->lsp_answer(scene, s, q, line_space(scene), pass, candidate);
  }
};

constexpr uint32_t kGroup = 16;

template <class Traversal>
void trace_group(const lsp_scene& scene, uint32_t flags, float lod, const LspRay* rays, LspHit* hits,
                 uint64_t count, lsp_trace_counts* counts) {
  using Ray = Waiting<Traversal>;
  const typename Traversal::LspQuery q{flags | LSP_TRACE_APPROXIMATE, lod, false, 0};
  Ray group[kGroup];
  static_assert(sizeof group <= 20 * 1024);
  // Numbers of rays of the group: those that go on, and what those wait for that went on.
  uint8_t on[kGroup], leaves[kGroup], look_ups[kGroup], done[kGroup];
  uint32_t on_count = 0;
  uint64_t next = 0;
  const auto answer = [&](const typename Traversal::LspTraced& traced, uint64_t ray) {
    hits[ray] = traced.hit;
    add(counts, traced);
  };
  const auto end = [&](Ray& r) {
    answer({finish<Traversal>(scene, r.s, rays[r.ray], r.lsp_end(scene)), r.lsp_walk.counts, true}, r.ray);
  };
  // The next ray that has something to visit.
  const auto begin = [&](Ray& r) {
    while (next < count) {
      r.ray = next++;
      r.s = set_up<Traversal>(scene, rays[r.ray]);
      if (!r.s.valid) {
        answer(Traversal::lsp_invalid_ray(), r.ray);
      } else if (!trace_if_far<Traversal>(scene, r.s, q.flags, lod, rays[r.ray], hits[r.ray], counts)) {
        r.lsp_begin(scene, r.s, q);
        if (r.lsp_walk.ref != LSP_NONE) return true;
        end(r);
      }
    }
    return false;
  };
  for (uint32_t i = 0; i < kGroup && begin(group[i]); ++i) on[on_count++] = static_cast<uint8_t>(i);
  while (on_count != 0) {
    uint32_t leaf_count = 0, look_up_count = 0, done_count = 0;
    for (uint32_t i = 0; i < on_count; ++i) {
      Ray& r = group[on[i]];
      r.advance(scene, q);
      if (r.lsp_walk.ref == LSP_NONE)
        done[done_count++] = on[i];
      else if ((r.lsp_walk.ref & LSP_LEAF_BIT) != 0u)
        leaves[leaf_count++] = on[i];
      else
        look_ups[look_up_count++] = on[i];
    }
    for (uint32_t i = 0; i < look_up_count; ++i) group[look_ups[i]].find_shaft(scene, q);
    for (uint32_t i = 0; i < leaf_count; ++i) group[leaves[i]].fetch_triangles(scene);
    on_count = 0;
    for (uint32_t i = 0; i < done_count; ++i) {
      end(group[done[i]]);
      if (begin(group[done[i]])) on[on_count++] = done[i];
    }
    for (uint32_t i = 0; i < look_up_count; ++i) group[look_ups[i]].find_entry(scene, q);
    for (uint32_t i = 0; i < leaf_count; ++i) {
      group[leaves[i]].lsp_test_leaf(scene, group[leaves[i]].s);
      on[on_count++] = leaves[i];
    }
    for (uint32_t i = 0; i < look_up_count; ++i) group[look_ups[i]].find_candidate(scene);
    for (uint32_t i = 0; i < look_up_count; ++i) {
      group[look_ups[i]].answer(scene, q);
      on[on_count++] = look_ups[i];
    }
  }
}

}  // namespace lsp
