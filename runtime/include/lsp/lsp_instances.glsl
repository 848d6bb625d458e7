/* Of lsp.glsl with LSP_INSTANCES defined: traces rays through instances (lsp/lsp_instances.h), the tree over them and
 * the assets in one shader, with the bits of lsp_trace_instances. Assets are any mixture of what bakes make by default:
 * cells, whose exact rays walk wide nodes, and wide nodes alone.
 *
 *   #define LSP_INSTANCES
 *   #include "lsp/lsp.glsl"
 *
 *   LspHit hit = lsp_trace_instances(count, ray, 0xFFu, LSP_TRACE_APPROXIMATE);
 *   bool shadowed = lsp_occluded_instances(count, ray, 0xFFu, LSP_TRACE_APPROXIMATE);
 *
 * and, for several scenes in one pipeline that no instance places, an asset by its number:
 *
 *   LspHit hit = lsp_trace(lsp_asset(number), ray, LSP_TRACE_APPROXIMATE);
 *
 * `count` is that of the instances, 0 allowed. Bindings, all read-only storage buffers:
 *   +0 the assets, an lsp_vulkan_asset each, in the order in which instances number them
 *   +1 the memory that lsp_instances_build has filled, as it is
 *   +2 +3 +4 the pool, one buffer with the sections of all assets; with LSP_ADDRESSES none, see lsp_sections.glsl
 * LSP_SET, LSP_FIRST_BINDING, the stack and the parts are those of lsp.glsl, of all assets together: the largest stack,
 * every part that any of them needs. Flags that are a constant leave out what they do not need.
 */
#ifndef LSP_INSTANCES_GLSL
#define LSP_INSTANCES_GLSL

/* The text of cells, and that of wide nodes by names of its own. */
#undef LSP_WIDE
#include "lsp/traverse.h"
#undef LSP_CELLS
#define LSP_WIDE
#define LSP_TRAVERSE_AGAIN
#define LspWalk LspWideWalk
#define lsp_walk lsp_wide_walk
#define lsp_stack_ref lsp_wide_stack_ref
#define lsp_is_far lsp_wide_is_far
#define lsp_begin lsp_wide_begin
#define lsp_advance lsp_wide_advance
#define lsp_test_leaf lsp_wide_test_leaf
#define lsp_look_up lsp_wide_look_up
#define lsp_end lsp_wide_end
#define lsp_walk_ready lsp_wide_walk_ready
#include "lsp/traverse.h"
#undef LspWalk
#undef lsp_walk
#undef lsp_stack_ref
#undef lsp_is_far
#undef lsp_begin
#undef lsp_advance
#undef lsp_test_leaf
#undef lsp_look_up
#undef lsp_end
#undef lsp_walk_ready

/* lsp_instance_record, ten words each, then lsp_instance_node, two each. */
layout(std430, set = LSP_SET, binding = LSP_FIRST_BINDING + LSP_BINDING_INSTANCES) readonly buffer LspInstanceBuffer {
  uvec4 lsp_instance_words[];
};

struct LspInstanceNode {
  vec3 lo;
  uint child;
  vec3 hi;
  float growth;
};

/* From scene to object space: rows of the inverse, and the point of the scene that is taken off first, in two parts. */
struct LspPlace {
  vec3 row_0;
  vec3 row_1;
  vec3 row_2;
  vec3 translation;
  vec3 translation_rest;
};

/* The instances whose buffer is bound. */
struct LspInstances {
  uint count;
};

uint lsp_load_instance_mask(LspInstances instances, uint i) { return lsp_instance_words[10u * i + 3u].y; }

LspInstanceNode lsp_load_instance_node(LspInstances instances, uint i) {
  uvec4 lo = lsp_instance_words[10u * instances.count + 2u * i];
  uvec4 hi = lsp_instance_words[10u * instances.count + 2u * i + 1u];
  return LspInstanceNode(uintBitsToFloat(lo.xyz), lo.w, uintBitsToFloat(hi.xyz), uintBitsToFloat(hi.w));
}

#include "lsp/instance_walk.h"

LspPlace lsp_load_place(uint i) {
  vec4 a = uintBitsToFloat(lsp_instance_words[10u * i + 4u]);
  vec4 b = uintBitsToFloat(lsp_instance_words[10u * i + 5u]);
  vec4 c = uintBitsToFloat(lsp_instance_words[10u * i + 6u]);
  vec4 d = uintBitsToFloat(lsp_instance_words[10u * i + 7u]);
  return LspPlace(a.xyz, vec3(a.w, b.xy), vec3(b.zw, c.x), c.yzw, d.xyz);
}

LspScene lsp_asset(uint number) { return LspScene(lsp_assets[number].sections, number, lsp_assets[number].header); }
LspScene lsp_asset_of(uint instance) { return lsp_asset(lsp_instance_words[10u * instance].x); }

/* Whether the asset's cells answer; else its wide nodes do. */
bool lsp_asks_cells(LspScene scene, uint flags) {
  return (flags & LSP_TRACE_APPROXIMATE) != 0u && LSP_HEADER(scene).base_structure == LSP_BASE_CELLS;
}

/* Takes a valid ray in an asset's own space to its end. */
LspWalked lsp_walk_asset(LspScene scene, LspSetup s, uint flags) {
  LspQuery q = lsp_query(flags, 0.0f, lsp_assets[scene.asset].dial);
  if (lsp_asks_cells(scene, flags)) return lsp_walk_ready(scene, s, q);
  q.flags &= ~LSP_TRACE_APPROXIMATE;
  return lsp_wide_walk_ready(scene, s, q);
}

/* A ray in one asset's own space, without instances: the hit is that of lsp_trace with the asset's dial. */
LspHit lsp_trace(LspScene scene, LspRay ray, uint flags) {
  LspSetup s = lsp_setup(scene, ray);
  if (!s.valid) return lsp_no_hit();
  LspBest best = lsp_walk_asset(scene, s, flags).best;
  return lsp_finish_as(scene, s, ray, best, flags, lsp_asks_cells(scene, flags));
}
bool lsp_occluded(LspScene scene, LspRay ray, uint flags) {
  return lsp_trace(scene, ray, flags | LSP_TRACE_OCCLUSION).t < LSP_INFINITY;
}

LspCounts lsp_add_counts(LspCounts a, LspCounts b) {
  return LspCounts(a.nodes + b.nodes, a.shafts + b.shafts, a.triangles + b.triangles, a.splits + b.splits,
                   a.exact + b.exact, a.exact_nodes + b.exact_nodes);
}

/* What a ray has met on its way through instances. */
struct LspNearest {
  uint instance; /* LSP_NONE: nothing */
  float t;       /* as given */
  LspBest best;  /* in the asset */
  uint flags;    /* LSP_HIT_INCOMPLETE where a walk was cut short */
  LspCounts counts;
};

/* What the nearest is, which is looked up once, not in every asset. */
LspHit lsp_finish_instance(LspRay ray, LspNearest nearest, uint flags) {
  LspHit hit = lsp_no_hit();
  if (nearest.instance != LSP_NONE) {
    LspScene scene = lsp_asset_of(nearest.instance);
    LspPlace place = lsp_load_place(nearest.instance);
    LspRay moved = lsp_move_ray(place, ray);
    hit = lsp_finish_as(scene, lsp_setup(scene, moved), moved, nearest.best, flags, lsp_asks_cells(scene, flags));
    hit.flags |= nearest.instance << LSP_HIT_INSTANCE_SHIFT;
    if ((flags & LSP_TRACE_OCCLUSION) == 0u) hit.normal = lsp_move_normal(place, hit.normal);
  }
  hit.flags |= nearest.flags;
  return hit;
}

/* As lsp_trace_instances below, with the work done; nodes are those of both kinds of trees. */
LspTraced lsp_trace_ray_instances(uint count, LspRay ray, uint mask, uint flags) {
  LspTraced traced = lsp_invalid_ray();
  traced.valid = lsp_is_valid(ray);
  if (!traced.valid || count == 0u) return traced;
  LspInstances instances = LspInstances(count);
  bool any_hit = (LSP_TRACE_IMPLIED(flags) & LSP_TRACE_ANY_HIT) != 0u;
  LspInstanceRay r = lsp_begin_instances(instances, ray);
  LspNearest nearest;
  nearest.instance = LSP_NONE;
  nearest.t = ray.tmax;
  nearest.flags = 0u;
  nearest.counts = lsp_no_counts();
  bool going = true;
  while (going) {
    uint number = lsp_next_instance(instances, r, mask, nearest.t);
    going = number != LSP_NONE;
    if (going) {
      LspScene scene = lsp_asset_of(number);
      LspRay moved = lsp_move_ray(lsp_load_place(number), ray);
      /* Of hits at one t the lowest instance is the answer. */
      moved.tmax = number < nearest.instance && nearest.instance != LSP_NONE ? lsp_step_up(nearest.t) : nearest.t;
      LspSetup s = lsp_setup(scene, moved);
      if (s.valid) {
        LspWalked walked = lsp_walk_asset(scene, s, flags);
        nearest.counts = lsp_add_counts(nearest.counts, walked.counts);
        if (!walked.best.complete) nearest.flags = LSP_HIT_INCOMPLETE;
        float t = walked.best.t * s.to_given;
        if (walked.best.triangle != LSP_NONE && t > moved.tmin && t < moved.tmax) {
          nearest.instance = number;
          nearest.t = t;
          nearest.best = walked.best;
          going = !any_hit;
          if (any_hit) lsp_instance_ref[0] = LSP_NONE;
        }
      }
    }
  }
  if (lsp_instance_ref[0] != LSP_NONE) nearest.flags = LSP_HIT_INCOMPLETE;
  traced.counts = nearest.counts;
  traced.counts.nodes += lsp_instance_visited;
  nearest.best.complete = true;
  traced.hit = lsp_finish_instance(ray, nearest, flags);
  return traced;
}

/* Of `count` instances those are seen whose mask shares a bit with the lowest 8 of `mask`. flags: LSP_TRACE_*; what is
 * for Line Spaces says nothing here. The hit is that of lsp_trace_instances in lsp/lsp_instances.h. */
LspHit lsp_trace_instances(uint count, LspRay ray, uint mask, uint flags) {
  return lsp_trace_ray_instances(count, ray, mask, flags).hit;
}

/* Whether anything lies on the ray: without a look-up of what it is. */
bool lsp_occluded_instances(uint count, LspRay ray, uint mask, uint flags) {
  return lsp_trace_instances(count, ray, mask, flags | LSP_TRACE_OCCLUSION).t < LSP_INFINITY;
}

/* As lsp_instance_hit_offset: how far off a hit a ray that goes on from there begins. */
float lsp_instance_hit_offset(LspHit hit) {
  if (hit.primitive == LSP_NONE) return 0.0f;
  uint number = hit.flags >> LSP_HIT_INSTANCE_SHIFT;
  vec4 a = uintBitsToFloat(lsp_instance_words[10u * number]); /* the asset, then the transform, object to scene space */
  vec4 b = uintBitsToFloat(lsp_instance_words[10u * number + 1u]);
  vec4 c = uintBitsToFloat(lsp_instance_words[10u * number + 2u]);
  vec3 stretched = vec3(a.y, a.z, a.w) * hit.normal.x + vec3(b.y, b.z, b.w) * hit.normal.y +
                   vec3(c.y, c.z, c.w) * hit.normal.z;
  return lsp_hit_offset(lsp_asset_of(number), hit) * length(stretched);
}

#endif
