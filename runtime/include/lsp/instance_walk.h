/* The way of a ray through instances, in the common subset of GLSL 4.6 and C++20: the tree over their boxes, and the
 * step into an instance's own space and back. Layout: lsp_instance_record and lsp_instance_node of lsp/lsp_instances.h.
 *
 * As lsp/traverse.h, which it stands beside: lsp_instances.glsl includes it in shaders, runtime/src/trace_instances.cpp
 * in a struct, both behind lsp/arithmetic.h, and have defined LspInstances, LspInstanceNode, LspPlace and
 * lsp_load_instance_*. One text, so that both take instances in one order and move a ray to the same bits. Rounding:
 * NUMERICS.md, Instances.
 */
#ifndef GL_core_profile
#define precise
#endif

/* A ray of the scene, for boxes; t is in lengths of the direction scaled as in lsp_setup. */
struct LspInstanceRay {
  vec3 origin;
  vec3 inverse;
  float reach; /* the largest distance along an axis from the origin to a side of the root's box */
  float tmin;
  float to_scaled;
};

/* What waits to be visited: children of nodes, and where the ray enters their boxes. Entry 0 is LSP_NONE once nothing
 * waits any more: a device may end loops early, and then only memory tells, see lsp/bvh.h. */
uint lsp_instance_ref[LSP_INSTANCE_DEPTH];
float lsp_instance_t[LSP_INSTANCE_DEPTH];
uint lsp_instance_top;
uint lsp_instance_visited; /* nodes */

/* As lsp_setup has it: rays that are not valid are misses everywhere. */
LSP_FN bool lsp_is_valid(LspRay ray) {
  vec3 o = lsp_vec3(ray.origin);
  vec3 d = lsp_vec3(ray.direction);
  bool finite = lsp_all_finite(o) && lsp_all_finite(d) && !lsp_is_nan(ray.tmin) && !lsp_is_nan(ray.tmax);
  return finite && ray.tmin <= ray.tmax && (floatBitsToUint(lsp_largest(d)) >> 23u) != 0u;
}

/* Where the ray enters the node's box, grown, not before tmin; infinity: it misses it. */
LSP_FN float lsp_instance_entry(LspInstanceRay r, LspInstanceNode node) {
  precise float margin = node.growth * r.reach;
  precise vec3 a = (node.lo - r.origin - vec3(margin, margin, margin)) * r.inverse;
  precise vec3 b = (node.hi - r.origin + vec3(margin, margin, margin)) * r.inverse;
  float t_in = lsp_max(lsp_max(lsp_min(a.x, b.x), lsp_min(a.y, b.y)), lsp_max(lsp_min(a.z, b.z), r.tmin));
  float t_out = lsp_min(lsp_min(lsp_max(a.x, b.x), lsp_max(a.y, b.y)), lsp_max(a.z, b.z));
  return t_in <= t_out ? t_in : LSP_INFINITY;
}

/* To the root; of a valid ray, and of one instance at least. */
LSP_STEP LspInstanceRay lsp_begin_instances(LspInstances instances, LspRay ray) {
  LspInstanceNode root = lsp_load_instance_node(instances, 0u);
  vec3 d = lsp_vec3(ray.direction);
  uint exponent = floatBitsToUint(lsp_largest(d)) >> 23u;
  exponent = exponent > 253u ? 253u : exponent;
  float shrink = uintBitsToFloat((254u - exponent) << 23u); /* 2^(127 - exponent) */
  LspInstanceRay r;
  r.origin = lsp_vec3(ray.origin);
  r.inverse = vec3(lsp_reciprocal(lsp_no_trifle(d.x * shrink)), lsp_reciprocal(lsp_no_trifle(d.y * shrink)),
                   lsp_reciprocal(lsp_no_trifle(d.z * shrink)));
  r.reach = lsp_max(lsp_largest(root.lo - r.origin), lsp_largest(root.hi - r.origin));
  r.to_scaled = uintBitsToFloat(exponent << 23u); /* 2^(exponent - 127) */
  precise float first = ray.tmin * r.to_scaled;
  r.tmin = first;
  lsp_instance_ref[0] = root.child;
  lsp_instance_t[0] = lsp_instance_entry(r, root);
  lsp_instance_top = 1u;
  lsp_instance_visited = 0u;
  return r;
}

/* The number of the next instance, nearest box first, that shares a bit with `mask` and that the ray enters at tmax, in
 * lengths of the direction given, at the latest; LSP_NONE: there is none. */
LSP_STEP uint lsp_next_instance(LspInstances instances, LspInstanceRay r, uint mask, float tmax) {
  precise float last = tmax * r.to_scaled;
  last = lsp_min(last, LSP_FLOAT_MAX);
  uint top = lsp_instance_top;
  uint visited = lsp_instance_visited;
  uint found = LSP_NONE;
  uint ref = LSP_NONE; /* a child that the ray enters in time */
  bool going = top > 0u;
  if (!going) lsp_instance_ref[0] = LSP_NONE;
  while (going) {
    /* One after the other, not one of three: a device that runs all of them anyhow goes round less often. */
    if (ref == LSP_NONE) {
      --top;
      ref = lsp_instance_t[top] <= last ? lsp_instance_ref[top] : LSP_NONE;
    }
    if ((ref & LSP_INSTANCE_BIT) == 0u) {
      LspInstanceNode node_0 = lsp_load_instance_node(instances, ref);
      LspInstanceNode node_1 = lsp_load_instance_node(instances, ref + 1u);
      float t_0 = lsp_instance_entry(r, node_0);
      float t_1 = lsp_instance_entry(r, node_1);
      bool swapped = t_1 < t_0;
      float farther = swapped ? t_0 : t_1;
      ref = (swapped ? t_1 : t_0) <= last ? (swapped ? node_1.child : node_0.child) : LSP_NONE;
      if (farther <= last && top < LSP_INSTANCE_DEPTH) {
        lsp_instance_ref[top] = swapped ? node_0.child : node_1.child;
        lsp_instance_t[top] = farther;
        ++top;
      }
      ++visited;
    }
    if ((ref & LSP_INSTANCE_BIT) != 0u && ref != LSP_NONE) {
      uint number = ref & ~LSP_INSTANCE_BIT;
      found = (lsp_load_instance_mask(instances, number) & mask & 0xFFu) != 0u ? number : LSP_NONE;
      ref = LSP_NONE;
    }
    going = found == LSP_NONE && (ref != LSP_NONE || top > 0u);
    if (!going && found == LSP_NONE) lsp_instance_ref[0] = LSP_NONE;
  }
  lsp_instance_top = top;
  lsp_instance_visited = visited;
  return found;
}

/* The next number up. */
LSP_FN float lsp_step_up(float t) {
  uint bits = floatBitsToUint(t);
  return t == 0.0f ? uintBitsToFloat(1u) : uintBitsToFloat(t > 0.0f ? bits + 1u : bits - 1u);
}

/* The ray in the instance's space. Its direction is not made a unit vector: t is the same in both spaces. */
LSP_FN LspRay lsp_move_ray(LspPlace place, LspRay ray) {
  precise vec3 from = lsp_vec3(ray.origin) - place.translation - place.translation_rest;
  vec3 d = lsp_vec3(ray.direction);
  LspRay moved;
  moved.origin =
      lsp_float3_of(vec3(lsp_dot(place.row_0, from), lsp_dot(place.row_1, from), lsp_dot(place.row_2, from)));
  moved.direction = lsp_float3_of(vec3(lsp_dot(place.row_0, d), lsp_dot(place.row_1, d), lsp_dot(place.row_2, d)));
  moved.tmin = ray.tmin;
  moved.tmax = ray.tmax;
  return moved;
}

/* An instance's unit normal in the scene: normals go with the inverse transpose. */
LSP_FN vec3 lsp_move_normal(LspPlace place, vec3 normal) {
  precise vec3 n = place.row_0 * normal.x + place.row_1 * normal.y + place.row_2 * normal.z;
  uint exponent = floatBitsToUint(lsp_largest(n)) >> 23u;
  exponent = exponent < 1u ? 1u : (exponent > 253u ? 253u : exponent);
  n = n * uintBitsToFloat((254u - exponent) << 23u);
  precise float r = 1.0f / sqrt(lsp_dot(n, n));
  precise vec3 unit = n * r;
  return unit;
}

#ifndef GL_core_profile
#undef precise
#endif
