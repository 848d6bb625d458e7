/* Exact and approximate traversal of an .lsp scene, in the common subset of GLSL 4.6 and C++20: of a BVH; with
 * LSP_NTREE defined of an NTree, with LSP_WIDE of wide nodes, with LSP_CELLS of cells.
 *
 * lsp.glsl includes this file in shaders, runtime/src/trace_bvh.cpp and its like within a struct, whose
 * members the functions and the stack then are: one text, so that both give the same bits. That holds where
 * the compiler contracts nothing (`precise`, -ffp-contract=off), rounds division and square root correctly,
 * and evaluates what stands here.
 *
 * The includer has defined LspScene, lsp_load_* and lsp_fetch_* (lsp.glsl, runtime/src/trace_subset.h). There
 * is no include guard: in C++ a file may hold the text in several structs.
 *
 * LSP_FN marks what depends on its arguments alone, LSP_STEP what goes on with lsp_walk and its stack. These
 * two are global in GLSL, where an array handed to a function is copied, and members in C++, where a struct
 * is. A trace is lsp_setup, lsp_begin, then lsp_advance and what it finds, lsp_test_leaf or the stages of a
 * look-up (lsp_find_shaft, lsp_find_entry, lsp_candidate, lsp_answer), until it finds nothing, then lsp_end
 * and lsp_finish. lsp_trace_ready takes these steps one after the other; the library takes those of several
 * rays in turn. A base structure's own are in its header.
 *
 * Sources. Triangles: Woop, Benthin, Wald, "Watertight Ray/Triangle Intersection", JCGT 2013. Boxes: Ize,
 * "Robust BVH Ray Traversal", JCGT 2013. Line Spaces: Keul, Koss, Mueller, "Fast Indirect Lighting
 * Approximations using the Representative Candidate Line Space", 2018, section 3.1, algorithms 1 and 2.
 *
 * Rounding, u = 2^-24. A direction is scaled by a power of two (exact) until its largest component is in
 * [1, 4). With R the largest distance along an axis from the origin to a side of the scene's box:
 *   - a slab plane (lo - o) * inv is off by 3 u R along the axis at most (one subtraction, the reciprocal,
 *     one product);
 *   - a corner in the triangle's ray space is off by 5 u R (translation, shear quotient, product,
 * difference);
 *   - the sign of an edge function of two such corners is never wrong, only lost to zero: products round
 *     monotonically. Zero counts as inside, so a ray through an edge or corner hits one of the neighbours.
 * A box is therefore grown by err = 16 u R + 4 u max|o| on every side, which covers both, and the rounding of
 * o + err itself: no box is missed whose triangle would be hit, however thin the box is.
 */
#include "lsp/interface.h"
#include "lsp/parts.h"

/* What depends on no base structure; a shader that holds the text of two has it once. */
#ifndef LSP_TRAVERSE_AGAIN
#include "lsp/arithmetic.h"
#endif

#ifndef GL_core_profile
#define precise
#endif

/* The parts compiled in. */
#ifndef LSP_PARTS
#define LSP_PARTS 0xFFFFFFFFu
#endif

#ifndef LSP_TRAVERSE_AGAIN
/* LSP_TRACE_NEAR_SKIP: a surface this close to the origin, in diagonals of the box, is the one the ray
 * starts on. Wrong answers grow with it (bunny, N = 6, D = 9: 0.01 0.48 %, 0.05 0.49 %, 0.15 0.52 %; Sibenik
 * 1.28 %, 1.63 %, 2.62 %), the triangles tested shrink (0.22, 0.13, 0.09 a ray; 0.52, 0.40, 0.25). */
#define LSP_NEAR_SKIP_REACH 0.01f

/* On the stack a reference to a Line Space is its index with bit 30 set; bit 31 is a leaf's. */
#define LSP_STACK_LINE_SPACE_BIT 0x40000000u
/* Of a Line Space: the ray begins inside its box, and what is to be asked is whether it leaves freely. */
#define LSP_STACK_NEAR_BIT 0x20000000u
#define LSP_STACK_INDEX_MASK 0x1FFFFFFFu

/* The work done; where nobody reads it the compiler leaves it out. */
struct LspCounts {
  uint nodes;
  uint shafts;
  uint triangles;
  uint splits; /* of cells, as the next */
  uint exact;  /* traces of a cell's triangles */
  uint exact_nodes;
};

/* What is asked of the scene. */
struct LspQuery {
  uint flags; /* LSP_TRACE_* */
  float lod;
  bool far; /* the ray comes from so far away that the base structure treats it apart: lsp_is_far */
  uint dial; /* LSP_DIAL: entries of cells that lose more are not heeded */
};

/* A ray made ready: t is in lengths of `direction`, which is the given one times 2^-exponent. */
struct LspSetup {
  vec3 origin;
  vec3 direction;
  vec3 inverse;      /* 1 / direction; 2^80 for components too small to matter */
  vec3 origin_plus;  /* origin + err: boxes are grown by moving the origin */
  vec3 origin_minus; /* origin - err */
  float err;         /* see the top of this file */
  vec3 shear;        /* of the triangle test, in the order of `axis` */
  float speed;       /* length of direction */
  float tmin;
  float tmax;
  float to_scaled; /* t (scaled) = t (given) * to_scaled */
  float to_given;
  int axis;   /* of the largest component of direction */
  uint hash;  /* lsp_ray_hash; with LSP_PART_COVERAGE alone */
  bool valid; /* else nothing but this is set */
};

/* A hit in the making: the triangle record and its t (scaled). */
struct LspBest {
  float t;
  uint triangle;  /* record, LSP_NONE: none */
  uint primitive; /* its, of an exact hit */
  uint flags;     /* LSP_HIT_* */
  bool complete; /* the traversal ran to its end */
};

/* What a traversal starts from: nothing nearer than tmax. */
LSP_FN LspBest lsp_no_best(LspSetup s) {
  LspBest best;
  best.t = s.tmax;
  best.triangle = LSP_NONE;
  best.primitive = 0u; /* none comes before it */
  best.flags = 0u;
  best.complete = false;
  return best;
}

LSP_FN LspCounts lsp_no_counts() {
  LspCounts counts;
  counts.nodes = 0u;
  counts.shafts = 0u;
  counts.triangles = 0u;
  counts.splits = 0u;
  counts.exact = 0u;
  counts.exact_nodes = 0u;
  return counts;
}

/* Rotates the axes so that `axis` comes last; keeps their cyclic order. */
LSP_FN vec3 lsp_rotate(vec3 v, int axis) {
  return axis == 2 ? v : (axis == 0 ? vec3(v.y, v.z, v.x) : vec3(v.z, v.x, v.y));
}

/* A step of MurmurHash3 (Appleby 2011), and its end, after which every bit depends on all that went in. */
LSP_FN uint lsp_hash_step(uint hash, uint word) {
  word *= 0xCC9E2D51u;
  word = ((word << 15u) | (word >> 17u)) * 0x1B873593u;
  hash ^= word;
  return ((hash << 13u) | (hash >> 19u)) * 5u + 0xE6546B64u;
}
LSP_FN uint lsp_hash_end(uint hash) {
  hash = (hash ^ (hash >> 16u)) * 0x85EBCA6Bu;
  hash = (hash ^ (hash >> 13u)) * 0xC2B2AE35u;
  return hash ^ (hash >> 16u);
}

/* Of the bits of origin and direction, not the interval: a ray that goes on behind a hit is the same one. */
LSP_FN uint lsp_ray_hash(LspRay ray) {
  uint hash = 0u;
  hash = lsp_hash_step(hash, floatBitsToUint(ray.origin.x));
  hash = lsp_hash_step(hash, floatBitsToUint(ray.origin.y));
  hash = lsp_hash_step(hash, floatBitsToUint(ray.origin.z));
  hash = lsp_hash_step(hash, floatBitsToUint(ray.direction.x));
  hash = lsp_hash_step(hash, floatBitsToUint(ray.direction.y));
  return lsp_hash_step(hash, floatBitsToUint(ray.direction.z));
}

LSP_FN bool lsp_has_gaps(LspTriangle tri) { return (tri.flags >> LSP_TRIANGLE_GAPS_SHIFT) != 0u; }

/* Whether a triangle that is there in part is not there for this ray. It is asked of every record and cell
 * that holds the triangle, and answers the same each time. */
LSP_FN bool lsp_passes(LspSetup s, LspTriangle tri) {
  return (lsp_hash_end(lsp_hash_step(s.hash, tri.primitive)) >> 16u) < (tri.flags >> LSP_TRIANGLE_GAPS_SHIFT);
}

/* Invalid are a NaN anywhere, a non-finite origin or direction, a direction of zero or of denormal length,
 * and tmin > tmax. */
LSP_FN LspSetup lsp_setup(LspScene scene, LspRay ray) {
  LspSetup s;
  s.valid = false;
  vec3 o = lsp_vec3(ray.origin);
  vec3 d = lsp_vec3(ray.direction);
  if (!lsp_all_finite(o) || !lsp_all_finite(d)) return s;
  if (lsp_is_nan(ray.tmin) || lsp_is_nan(ray.tmax) || ray.tmin > ray.tmax) return s;
  vec3 m = abs(d);
  int axis = m.x >= m.y ? (m.x >= m.z ? 0 : 2) : (m.y >= m.z ? 1 : 2);
  float largest = lsp_max(lsp_max(m.x, m.y), m.z);
  uint exponent = floatBitsToUint(largest) >> 23u;
  if (exponent == 0u) return s;
  exponent = exponent > 253u ? 253u : exponent;
  float shrink = uintBitsToFloat((254u - exponent) << 23u); /* 2^(127 - exponent) */
  s.to_given = shrink;
  s.to_scaled = uintBitsToFloat(exponent << 23u); /* 2^(exponent - 127) */
  s.axis = axis;
  s.origin = o;
  s.direction = vec3(lsp_no_trifle(d.x * shrink), lsp_no_trifle(d.y * shrink), lsp_no_trifle(d.z * shrink));
  s.inverse =
      vec3(lsp_reciprocal(s.direction.x), lsp_reciprocal(s.direction.y), lsp_reciprocal(s.direction.z));
  /* A step of the denormals inside the interval: what is given back, rounded among them, must lie in it too.
   */
  precise float step = uintBitsToFloat(1u) * s.to_scaled;
  precise float first = ray.tmin * s.to_scaled + step;
  precise float last = lsp_min(ray.tmax, LSP_FLOAT_MAX) * s.to_scaled - step;
  s.tmin = first;
  s.tmax = lsp_min(last, LSP_FLOAT_MAX);

  vec3 lo = abs(lsp_vec3(lsp_load_header(scene).bounds_min) - o);
  vec3 hi = abs(lsp_vec3(lsp_load_header(scene).bounds_max) - o);
  float r = lsp_max(lsp_max(lsp_max(lo.x, hi.x), lsp_max(lo.y, hi.y)), lsp_max(lo.z, hi.z));
  float a = lsp_max(lsp_max(abs(o.x), abs(o.y)), abs(o.z));
  precise float err = r * 9.5367432e-7f + a * 2.3841858e-7f; /* 16 u r + 4 u a */
  s.err = err;
  s.origin_plus = vec3(o.x + err, o.y + err, o.z + err);
  s.origin_minus = vec3(o.x - err, o.y - err, o.z - err);

  vec3 p = lsp_rotate(s.direction, axis);
  precise float z = 1.0f / p.z;
  precise vec3 shear = vec3(p.x / p.z, p.y / p.z, z);
  s.shear = shear;
  precise float len = sqrt(lsp_dot(s.direction, s.direction));
  s.speed = len;
  if ((LSP_PARTS & LSP_PART_COVERAGE) != 0u) s.hash = lsp_ray_hash(ray);
  s.valid = true;
  return s;
}

/* Where the ray enters the grown box, not before tmin; infinity when it misses. tmax is finite. */
LSP_FN float lsp_box(LspSetup s, vec3 lo, vec3 hi, float tmax) {
  precise vec3 a = (lo - s.origin_plus) * s.inverse;
  precise vec3 b = (hi - s.origin_minus) * s.inverse;
  float t_in = lsp_max(lsp_max(lsp_min(a.x, b.x), lsp_min(a.y, b.y)), lsp_max(lsp_min(a.z, b.z), s.tmin));
  float t_out = lsp_min(lsp_min(lsp_max(a.x, b.x), lsp_max(a.y, b.y)), lsp_min(lsp_max(a.z, b.z), tmax));
  return t_in <= t_out ? t_in : LSP_INFINITY;
}

/* Where the ray leaves the grown box, if it hits it. */
LSP_FN float lsp_box_exit(LspSetup s, vec3 lo, vec3 hi) {
  precise vec3 a = (lo - s.origin_plus) * s.inverse;
  precise vec3 b = (hi - s.origin_minus) * s.inverse;
  return lsp_min(lsp_min(lsp_max(a.x, b.x), lsp_max(a.y, b.y)), lsp_max(a.z, b.z));
}

/* A function that most rays call once or twice: better not inlined into the loop on the CPU. */
#ifndef LSP_FN_RARE
#define LSP_FN_RARE LSP_FN
#endif

/* A triangle whose normal, of edges scaled to lengths about 1, has no more than this of the direction is taken for
 * edge-on: the plane's depth may be off by 1e-4 of the scene and more. */
#define LSP_EDGE_ON 0.015625f

/* The depth at which an edge crosses zero by a coordinate that is p and q at its ends. */
LSP_FN float lsp_crossing(float p, float q, float at_p, float at_q) {
  precise float at = at_p + (at_q - at_p) * (p / (p - q));
  return at;
}

/* The depths of the two edges that cross zero by coordinate q of the corners, whose depths are z. */
LSP_FN vec2 lsp_crossings(vec3 q, vec3 z) {
  /* The corner that is alone on its side; zero is on that side where no other corner is. */
  bool none_above = lsp_max(lsp_max(q.x, q.y), q.z) <= 0.0f;
  bool x = q.x > 0.0f || (none_above && q.x == 0.0f);
  bool y = q.y > 0.0f || (none_above && q.y == 0.0f);
  bool w = q.z > 0.0f || (none_above && q.z == 0.0f);
  vec3 p = y == w ? q : (x == w ? vec3(q.y, q.z, q.x) : vec3(q.z, q.x, q.y));
  vec3 at = y == w ? z : (x == w ? vec3(z.y, z.z, z.x) : vec3(z.z, z.x, z.y));
  return vec2(lsp_crossing(p.x, p.y, at.x, at.y), lsp_crossing(p.x, p.z, at.x, at.z));
}

/* Where the ray meets the plane of a triangle that it passes: a, b, c are the corners seen from the origin,
 * the ray's axis last, as in `direction`, x and y their places across the ray. The corners' own depths averaged
 * by the edge functions would be an error of 5 u R over the smallest height of the triangle off, however near
 * the hit; the plane is off by what the normal is. That is best at the corner opposite the longest edge: of a
 * needle the other two give a difference of large products. No hit lies outside the depths of the corners, and
 * of a triangle that is edge-on none outside those of the two edges that the ray passes between: where the plane
 * says nothing, the ray is at the triangle still. Edges are scaled by a power of two (exact): products of three
 * small lengths would underflow. */
LSP_FN_RARE float lsp_plane_depth(vec3 direction, float shear_z, vec3 a, vec3 b, vec3 c, vec3 x, vec3 y) {
  precise vec3 ab = b - a;
  precise vec3 bc = c - b;
  precise vec3 ca = a - c;
  float length_ab = lsp_largest(ab);
  float length_bc = lsp_largest(bc);
  float length_ca = lsp_largest(ca);
  bool at_a = length_bc >= length_ab && length_bc >= length_ca;
  bool at_b = length_ca >= length_ab;
  vec3 p = at_a ? a : (at_b ? b : c);
  vec3 e = at_a ? ab : (at_b ? bc : ca);
  vec3 f = at_a ? ca : (at_b ? ab : bc);
  uint exponent = floatBitsToUint(lsp_max(lsp_max(length_ab, length_bc), length_ca)) >> 23u;
  exponent = exponent < 1u ? 1u : (exponent > 253u ? 253u : exponent);
  float shrink = uintBitsToFloat((254u - exponent) << 23u);
  vec3 n = lsp_cross(e * shrink, f * shrink);
  precise float across = lsp_dot(n, direction);
  precise float t = lsp_dot(n, p) / across;
  precise vec3 z = vec3(a.z, b.z, c.z) * shear_z;
  vec2 range = vec2(lsp_min(lsp_min(z.x, z.y), z.z), lsp_max(lsp_max(z.x, z.y), z.z));
  if (across < LSP_EDGE_ON && across > -LSP_EDGE_ON) {
    precise float x_extent = lsp_max(lsp_max(x.x, x.y), x.z) - lsp_min(lsp_min(x.x, x.y), x.z);
    precise float y_extent = lsp_max(lsp_max(y.x, y.y), y.z) - lsp_min(lsp_min(y.x, y.y), y.z);
    vec3 q = x_extent >= y_extent ? x : y;
    vec2 edges = lsp_crossings(q, z);
    range = vec2(lsp_max(lsp_min(edges.x, edges.y), range.x), lsp_min(lsp_max(edges.x, edges.y), range.y));
  }
  /* In this order a NaN, of a triangle that the ray lies in, becomes the smallest depth. */
  t = lsp_max(range.x, t);
  return lsp_min(range.y, t);
}

/* A triangle as a ray sees it: the corners from its origin, its axis last; their places across it; and the edge
 * functions there. */
struct LspSight {
  vec3 a;
  vec3 b;
  vec3 c;
  vec3 x;
  vec3 y;
  float u;
  float v;
  float w;
};
LSP_FN LspSight lsp_sight(LspSetup s, LspTriangle tri) {
  LspSight g;
  g.a = lsp_rotate(lsp_vec3(tri.v0) - s.origin, s.axis);
  g.b = lsp_rotate(lsp_vec3(tri.v1) - s.origin, s.axis);
  g.c = lsp_rotate(lsp_vec3(tri.v2) - s.origin, s.axis);
  precise float ax = g.a.x - s.shear.x * g.a.z;
  precise float ay = g.a.y - s.shear.y * g.a.z;
  precise float bx = g.b.x - s.shear.x * g.b.z;
  precise float by = g.b.y - s.shear.y * g.b.z;
  precise float cx = g.c.x - s.shear.x * g.c.z;
  precise float cy = g.c.y - s.shear.y * g.c.z;
  precise float u = cx * by - cy * bx;
  precise float v = ax * cy - ay * cx;
  precise float w = bx * ay - by * ax;
  g.x = vec3(ax, bx, cx);
  g.y = vec3(ay, by, cy);
  g.u = u;
  g.v = v;
  g.w = w;
  return g;
}

/* Weights of corners 1 and 2 of a triangle that a ray has hit. */
LSP_FN vec2 lsp_hit_weights(LspSetup s, LspTriangle tri) {
  LspSight g = lsp_sight(s, tri);
  precise float det = g.u + g.v + g.w;
  precise vec2 weights = vec2(g.v / det, g.w / det); /* not by 1 / det: det may be so small that it is infinite */
  return weights;
}

/* Whether zero is not among three numbers nor between them. */
LSP_FN bool lsp_all_beside(vec3 p) {
  return lsp_min(lsp_min(p.x, p.y), p.z) > 0.0f || lsp_max(lsp_max(p.x, p.y), p.z) < 0.0f;
}

/* Watertight triangle test (Woop et al. 2013). Keeps a hit nearer than best.t and beyond tmin; of those at one
 * distance that of the lowest primitive: the answer does not depend on the order in which triangles are met. */
LSP_FN LspBest lsp_triangle(LspScene scene, LspSetup s, uint index, LspBest best) {
  LspTriangle tri = lsp_load_triangle(scene, index);
  LspSight g = lsp_sight(s, tri);
  if ((g.u < 0.0f || g.v < 0.0f || g.w < 0.0f) && (g.u > 0.0f || g.v > 0.0f || g.w > 0.0f)) return best;
  /* Seen edge-on its corners are in a line, and along that signs are lost to zero beyond its ends, too. */
  if (lsp_all_beside(g.x) || lsp_all_beside(g.y)) return best;
  precise float det = g.u + g.v + g.w;
  if (det == 0.0f || !lsp_is_finite(det)) return best;
  float t = lsp_plane_depth(lsp_rotate(s.direction, s.axis), s.shear.z, g.a, g.b, g.c, g.x, g.y);
  bool nearer = t < best.t || (t == best.t && tri.primitive < best.primitive);
  if (t > s.tmin && nearer) {
    if ((LSP_PARTS & LSP_PART_COVERAGE) != 0u && lsp_passes(s, tri)) return best;
    best.t = t;
    best.triangle = index;
    best.primitive = tri.primitive;
    best.flags = 0u;
  }
  return best;
}

/* Octahedral unit vector of two 16-bit snorm (Cigolle et al. 2014). */
LSP_FN vec3 lsp_unpack_normal(uint packed) {
  float x = float(int(packed << 16u) >> 16) * (1.0f / 32767.0f);
  float y = float(int(packed) >> 16) * (1.0f / 32767.0f);
  precise float z = 1.0f - abs(x) - abs(y);
  float fold = lsp_max(-z, 0.0f);
  precise vec3 n = vec3(x + (x >= 0.0f ? -fold : fold), y + (y >= 0.0f ? -fold : fold), z);
  precise float r = 1.0f / sqrt(lsp_dot(n, n));
  precise vec3 unit = n * r;
  return unit;
}

/* Normal of a point of a triangle's plane by its weights, not normalised. */
LSP_FN vec3 lsp_interpolated_normal(LspScene scene, uint index, float u, float v) {
  LspCornerNormals c = lsp_load_normals(scene, index);
  vec3 n0 = lsp_unpack_normal(c.n0);
  vec3 n1 = lsp_unpack_normal(c.n1);
  vec3 n2 = lsp_unpack_normal(c.n2);
  precise vec3 n = n0 * (1.0f - u - v) + n1 * u + n2 * v;
  return n;
}

/* The paper's edge criterion: does the extrapolated normal leave the cone about the triangle's mean normal?
 */
LSP_FN bool lsp_leaves_cone(LspScene scene, uint index, float u, float v) {
  vec3 n = lsp_interpolated_normal(scene, index, u, v);
  vec3 mean = lsp_interpolated_normal(scene, index, 0.33333334f, 0.33333334f);
  precise float d = lsp_dot(n, mean);
  precise float limit = lsp_load_header(scene).normal_angle_cos * sqrt(lsp_dot(n, n) * lsp_dot(mean, mean));
  return d < limit;
}

/* Weights of corners 1 and 2 at the point of the ray at t, taken to lie in the triangle's plane. */
LSP_FN vec2 lsp_plane_weights(LspSetup s, LspTriangle tri, float t) {
  vec3 v0 = lsp_vec3(tri.v0);
  vec3 e1 = lsp_vec3(tri.v1) - v0;
  vec3 e2 = lsp_vec3(tri.v2) - v0;
  vec3 n = lsp_cross(e1, e2);
  vec3 w = v0 - s.origin;
  precise vec3 r = s.direction * t - w;
  precise float scale = 1.0f / lsp_dot(n, n);
  precise vec2 weights = vec2(lsp_dot(lsp_cross(r, e2), n) * scale, lsp_dot(lsp_cross(e1, r), n) * scale);
  return weights;
}

LSP_FN LspHit lsp_no_hit() {
  LspHit hit;
  hit.t = LSP_INFINITY;
  hit.primitive = LSP_NONE;
  hit.u = 0.0f;
  hit.v = 0.0f;
  hit.normal = lsp_float3_of(vec3(0.0f, 0.0f, 0.0f));
  hit.flags = 0u;
  return hit;
}

/* The answer in the caller's terms: t in lengths of the direction given, unit shading normal. flags: of what is asked,
 * LSP_TRACE_OCCLUSION counts. `cells`: they were traced. */
LSP_FN LspHit lsp_finish_as(LspScene scene, LspSetup s, LspRay ray, LspBest best, uint flags, bool cells) {
  LspHit hit = lsp_no_hit();
  if (!best.complete) hit.flags = LSP_HIT_INCOMPLETE;
  if (best.triangle == LSP_NONE) return hit;
  float t = best.t * s.to_given;
  if (!(t > ray.tmin && t < ray.tmax)) return hit;
  if ((flags & LSP_TRACE_OCCLUSION) != 0u) {
    hit.t = t;
    return hit;
  }
  LspTriangle tri = lsp_load_triangle(scene, best.triangle);
  vec3 v0 = lsp_vec3(tri.v0);
  vec3 n = lsp_cross(lsp_vec3(tri.v1) - v0, lsp_vec3(tri.v2) - v0);
  bool from_table = (best.flags & LSP_HIT_LINE_SPACE) != 0u;
  vec2 weights = from_table ? lsp_plane_weights(s, tri, best.t) : lsp_hit_weights(s, tri);
  if (lsp_has_normals(scene)) {
    vec2 at = weights;
    /* A plane stands for more of the surface here than a candidate does: beyond its triangle extrapolated normals turn
     * further than the surface. */
    if (cells) {
      at.x = lsp_min(lsp_max(at.x, 0.0f), 1.0f);
      at.y = lsp_min(lsp_max(at.y, 0.0f), 1.0f - at.x);
    }
    vec3 smooth_n = lsp_interpolated_normal(scene, best.triangle, at.x, at.y);
    if (lsp_dot(smooth_n, smooth_n) > 1e-12f) n = smooth_n;
  }
  /* A needle may have no area in single precision: then it faces the ray. */
  if (lsp_largest(n) == 0.0f) n = -s.direction;
  /* Scaled by a power of two first: the area vector of a small triangle squared would underflow. */
  uint exponent = floatBitsToUint(lsp_largest(n)) >> 23u;
  exponent = exponent < 1u ? 1u : (exponent > 253u ? 253u : exponent);
  n = n * uintBitsToFloat((254u - exponent) << 23u);
  precise float r = 1.0f / sqrt(lsp_dot(n, n));
  precise vec3 unit = n * r;
  hit.t = t;
  hit.primitive = tri.primitive;
  hit.u = weights.x;
  hit.v = weights.y;
  hit.normal = lsp_float3_of(unit);
  hit.flags |= best.flags;
  return hit;
}

/* As lsp_hit_offset of lsp/lsp.h. */
LSP_FN float lsp_hit_offset(LspScene scene, LspHit hit) {
  LspHeader header = lsp_load_header(scene);
  vec3 extent = lsp_vec3(header.bounds_max) - lsp_vec3(header.bounds_min);
  float diagonal = sqrt(lsp_dot(extent, extent));
  if ((hit.flags & LSP_HIT_LINE_SPACE) == 0u) return LSP_OFFSET_EXACT * diagonal;
  return header.cells.size > 0.0f ? LSP_OFFSET_CELL * header.cells.size : LSP_OFFSET_LINE_SPACE * diagonal;
}

struct LspTraced {
  LspHit hit;
  LspCounts counts;
  bool valid; /* else the ray is invalid, a miss */
};

LSP_FN LspTraced lsp_invalid_ray() {
  LspTraced traced;
  traced.hit = lsp_no_hit();
  traced.counts = lsp_no_counts();
  traced.valid = false;
  return traced;
}

LSP_FN LspQuery lsp_query(uint flags, float lod, uint dial) {
  LspQuery q;
  q.flags = LSP_TRACE_IMPLIED(flags);
  q.lod = lod;
  q.dial = dial;
  q.far = false;
  return q;
}

/* What a traversal has found, and the work done. */
struct LspWalked {
  LspBest best;
  LspCounts counts;
};
#endif

#if !defined(LSP_CELLS) && !defined(LSP_WIDE)
/* Where the ray passes the box of a Line Space, and which shaft it takes. The shaft is in range for any ray;
 * a ray that misses the box has t_in > t_out. Entry and exit face are never the same one: on one axis they
 * are its two sides. */
struct LspPassage {
  float t_in;
  float t_out;
  uint shaft;
  uint reverse; /* the shaft of the opposite direction */
};

LSP_FN uint lsp_patch(vec3 point, vec3 lo, vec3 scale, int axis, uint resolution) {
  precise vec3 q = (point - lo) * scale;
  float top = float(resolution) - 0.5f;
  float u = axis == 0 ? q.y : q.x;
  float v = axis == 2 ? q.y : q.z;
  u = u > 0.0f ? u : 0.0f;
  v = v > 0.0f ? v : 0.0f;
  u = u < top ? u : top;
  v = v < top ? v : top;
  return uint(u) + resolution * uint(v);
}

LSP_FN LspPassage lsp_pass(LspSetup s, LspLineSpace ls) {
  vec3 lo = lsp_vec3(ls.lo);
  vec3 scale = lsp_vec3(ls.scale);
  precise vec3 a = (lo - s.origin) * s.inverse;
  precise vec3 b = (lsp_vec3(ls.hi) - s.origin) * s.inverse;
  vec3 near = vec3(lsp_min(a.x, b.x), lsp_min(a.y, b.y), lsp_min(a.z, b.z));
  vec3 far = vec3(lsp_max(a.x, b.x), lsp_max(a.y, b.y), lsp_max(a.z, b.z));
  LspPassage p;
  int axis_in = near.x >= near.y ? (near.x >= near.z ? 0 : 2) : (near.y >= near.z ? 1 : 2);
  int axis_out = far.x <= far.y ? (far.x <= far.z ? 0 : 2) : (far.y <= far.z ? 1 : 2);
  p.t_in = lsp_max(lsp_max(near.x, near.y), near.z);
  p.t_out = lsp_min(lsp_min(far.x, far.y), far.z);
  precise vec3 point_in = s.origin + s.direction * p.t_in;
  precise vec3 point_out = s.origin + s.direction * p.t_out;
  float sign_in = axis_in == 0 ? s.inverse.x : (axis_in == 1 ? s.inverse.y : s.inverse.z);
  float sign_out = axis_out == 0 ? s.inverse.x : (axis_out == 1 ? s.inverse.y : s.inverse.z);
  uint face_in = 2u * uint(axis_in) + (sign_in < 0.0f ? 1u : 0u);
  uint face_out = 2u * uint(axis_out) + (sign_out < 0.0f ? 0u : 1u);
  uint n = ls.format & LSP_FORMAT_RESOLUTION_MASK;
  uint patch_in = lsp_patch(point_in, lo, scale, axis_in, n);
  uint patch_out = lsp_patch(point_out, lo, scale, axis_out, n);
  if ((ls.format & LSP_FORMAT_SYMMETRIC) == 0u) {
    p.shaft = LSP_SHAFT_INDEX(face_in, face_out, patch_in, patch_out, n);
    p.reverse = LSP_SHAFT_INDEX(face_out, face_in, patch_out, patch_in, n);
  } else {
    if (face_in < face_out)
      p.shaft = LSP_SHAFT_INDEX_SYMMETRIC(face_in, face_out, patch_in, patch_out, n);
    else
      p.shaft = LSP_SHAFT_INDEX_SYMMETRIC(face_out, face_in, patch_out, patch_in, n);
    p.reverse = p.shaft;
  }
  return p;
}

/* Whether a Line Space has bits alone, no candidates. */
LSP_FN bool lsp_is_binary(LspLineSpace ls) {
  return ((ls.format >> LSP_FORMAT_ENTRY_SHIFT) & LSP_FORMAT_ENTRY_MASK) == 0u;
}

/* The paper's algorithm 2: the entry of a shaft, LSP_NONE when the shaft is empty. */
LSP_FN uint lsp_entry(LspScene scene, LspLineSpace ls, uint shaft) {
  if ((ls.format & LSP_FORMAT_DENSE) != 0u) return shaft;
  LspBitWord word = lsp_load_bit_word(scene, ls.word_first + (shaft >> 5u));
  uint bit = shaft & 31u;
  if (((word.bits >> bit) & 1u) == 0u) return LSP_NONE;
  return word.offset + uint(bitCount(word.bits & ((1u << bit) - 1u)));
}

/* Entries in a word of a Line Space that has candidates are 2^this: 4, 2 or 1, of an invalid file too. */
LSP_FN uint lsp_entry_pack(LspLineSpace ls) {
  uint bytes = (ls.format >> LSP_FORMAT_ENTRY_SHIFT) & LSP_FORMAT_ENTRY_MASK;
  return bytes == 1u ? 2u : (bytes == 2u ? 1u : 0u);
}

/* The candidate triangle record of an entry, LSP_NONE when there is none. */
LSP_FN uint lsp_candidate(LspScene scene, LspLineSpace ls, uint entry) {
  if (entry == LSP_NONE) return LSP_NONE;
  if (lsp_is_binary(ls)) return ls.triangle_first; /* any triangle stands for all */
  uint pack = lsp_entry_pack(ls);
  uint bits = 32u >> pack;
  uint mask = LSP_NONE >> (32u - bits);
  uint shift = (entry & ((1u << pack) - 1u)) * bits;
  uint local = (lsp_load_candidate(scene, ls.candidate_first + (entry >> pack)) >> shift) & mask;
  local = local == mask && (ls.format & LSP_FORMAT_DENSE) != 0u ? LSP_NONE : local;
  return local == LSP_NONE ? LSP_NONE : ls.triangle_first + local;
}

/* Whether a ray that passes the box of a Line Space may find something there that is nearer than best. */
LSP_FN bool lsp_may_hit(LspPassage pass, LspBest best) {
  return pass.t_in <= pass.t_out && pass.t_in < best.t;
}

/* The paper's algorithm 1, from the candidate on: it is taken as an infinite plane. A plane hit outside the
 * box by less than the tolerance is moved to the box. */
LSP_FN LspBest lsp_hit_candidate(LspScene scene, LspSetup s, LspLineSpace ls, LspPassage pass, uint candidate,
                                 LspBest best) {
  if ((LSP_PARTS & LSP_PART_BINARY) != 0u && lsp_is_binary(ls)) {
    /* A binary Line Space knows that something is hit, not where: the middle of the passage. */
    precise float middle = 0.5f * (lsp_max(pass.t_in, s.tmin) + pass.t_out);
    if (!(middle > s.tmin && middle < best.t)) return best;
    best.t = middle;
    best.triangle = candidate;
    best.flags = LSP_HIT_LINE_SPACE | (pass.t_in <= s.tmin ? LSP_HIT_ORIGIN_INSIDE : 0u);
    return best;
  }
  LspTriangle tri = lsp_load_triangle(scene, candidate);
  vec3 v0 = lsp_vec3(tri.v0);
  vec3 e1 = lsp_vec3(tri.v1) - v0;
  vec3 e2 = lsp_vec3(tri.v2) - v0;
  vec3 n = lsp_cross(e1, e2);
  vec3 w = v0 - s.origin;
  precise float t = lsp_dot(w, n) / lsp_dot(s.direction, n); /* NaN or infinite along the plane */
  float slack = 0.0f;
  if ((LSP_PARTS & LSP_PART_PLANE_TOLERANCE) != 0u && lsp_load_header(scene).plane_tolerance > 0.0f) {
    vec3 extent = lsp_vec3(ls.hi) - lsp_vec3(ls.lo);
    precise float reach = lsp_load_header(scene).plane_tolerance * sqrt(lsp_dot(extent, extent)) / s.speed;
    slack = reach;
  }
  if (!(t >= pass.t_in - slack && t <= pass.t_out + slack)) return best;
  t = t < pass.t_in ? pass.t_in : t;
  t = t > pass.t_out ? pass.t_out : t;
  if (!(t > s.tmin && t < best.t)) return best;
  if ((LSP_PARTS & LSP_PART_NORMAL_ANGLE) != 0u && lsp_load_header(scene).normal_angle_cos > -1.0f &&
      lsp_has_normals(scene) && (tri.flags & LSP_TRIANGLE_SMOOTH) != 0u) {
    vec2 weights = lsp_plane_weights(s, tri, t);
    if (lsp_leaves_cone(scene, candidate, weights.x, weights.y)) return best;
  }
  best.t = t;
  best.triangle = candidate;
  best.flags = LSP_HIT_LINE_SPACE | (pass.t_in <= s.tmin ? LSP_HIT_ORIGIN_INSIDE : 0u);
  return best;
}

/* Whether the last surface along the line of a ray that starts inside the box of a Line Space, which the
 * shaft of the opposite direction knows, lies behind the origin or is the one the ray starts on: then nothing
 * is ahead. */
LSP_FN bool lsp_is_behind(LspScene scene, LspSetup s, LspLineSpace ls, uint candidate) {
  if ((LSP_PARTS & LSP_PART_BINARY) != 0u && lsp_is_binary(ls)) return false;
  LspTriangle tri = lsp_load_triangle(scene, candidate);
  vec3 v0 = lsp_vec3(tri.v0);
  vec3 n = lsp_cross(lsp_vec3(tri.v1) - v0, lsp_vec3(tri.v2) - v0);
  vec3 w = v0 - s.origin;
  precise float t = lsp_dot(w, n) / lsp_dot(s.direction, n);
  vec3 extent = lsp_vec3(ls.hi) - lsp_vec3(ls.lo);
  precise float reach = LSP_NEAR_SKIP_REACH * sqrt(lsp_dot(extent, extent)) / s.speed;
  return t <= s.tmin + reach;
}

/* Whether a reference is an inner node's; LSP_NONE has a leaf's bit. */
LSP_FN bool lsp_is_node(uint ref) { return (ref & (LSP_LEAF_BIT | LSP_STACK_LINE_SPACE_BIT)) == 0u; }

/* Whether a reference on the stack asks if the ray leaves a box freely; neither a leaf's nor LSP_NONE does.
 */
LSP_FN bool lsp_is_near(uint ref) { return (ref >> 29u) == 3u; }

LSP_FN uint lsp_line_space_index(uint ref) { return ref & LSP_STACK_INDEX_MASK; }

/* What to visit for a child hit at t_in: itself, or in an approximate trace its Line Space. The look-up
 * is left to the caller: a device that runs both sides of every branch would do it for both children of every
 * node. */
LSP_FN uint lsp_visit(LspSetup s, LspQuery q, uint child, uint line_space, vec3 lo, vec3 hi, float t_in) {
  if (line_space == LSP_NONE || (q.flags & LSP_TRACE_APPROXIMATE) == 0u) return child;
  bool exists = child != LSP_NONE;
  if (t_in <= s.tmin && (q.flags & LSP_TRACE_NEAR_APPROXIMATE) == 0u && exists) {
    if ((q.flags & LSP_TRACE_NEAR_SKIP) == 0u) return child;
    return (line_space & LSP_LINE_SPACE_MASK) | LSP_STACK_LINE_SPACE_BIT | LSP_STACK_NEAR_BIT;
  }
  if ((line_space & LSP_TERMINAL_BIT) == 0u && exists) {
    vec3 extent = hi - lo;
    precise float reach = q.lod * t_in * s.speed;
    if (!(lsp_dot(extent, extent) < reach * reach)) return child;
  }
  return (line_space & LSP_LINE_SPACE_MASK) | LSP_STACK_LINE_SPACE_BIT;
}

#ifdef LSP_NTREE
#include "lsp/ntree.h"
#else
#include "lsp/bvh.h"
#endif

/* A look-up is a load after the other, each of which depends on the one before: hence its stages. */

/* Whether lsp_walk.ref asks if the ray leaves the box freely, not what it hits. */
LSP_STEP bool lsp_asks_near(LspQuery q) {
  return (q.flags & LSP_TRACE_NEAR_SKIP) != 0u && lsp_is_near(lsp_walk.ref);
}

LSP_STEP LspPassage lsp_find_shaft(LspSetup s, LspQuery q, LspLineSpace ls) {
  LspPassage pass = lsp_pass(s, ls);
  if (lsp_asks_near(q)) pass.shaft = pass.reverse;
  return pass;
}

LSP_STEP uint lsp_find_entry(LspScene scene, LspQuery q, LspLineSpace ls, LspPassage pass) {
  return lsp_asks_near(q) || lsp_may_hit(pass, lsp_walk.best) ? lsp_entry(scene, ls, pass.shaft) : LSP_NONE;
}

/* A ray that leaves freely is done with the node, one that does not goes on to what the Line Space stands
 * for. */
LSP_STEP void lsp_answer(LspScene scene, LspSetup s, LspQuery q, LspLineSpace ls, LspPassage pass,
                         uint candidate) {
  lsp_walk.counts.shafts += 1u;
  if (lsp_asks_near(q)) {
    bool freely =
        pass.t_in <= pass.t_out && (candidate == LSP_NONE || lsp_is_behind(scene, s, ls, candidate));
    lsp_walk.ref = freely ? LSP_NONE : ls.child;
    return;
  }
  lsp_walk.ref = LSP_NONE;
  if (candidate == LSP_NONE) return;
  LspBest best = lsp_hit_candidate(scene, s, ls, pass, candidate, lsp_walk.best);
  if ((LSP_PARTS & LSP_PART_COVERAGE) != 0u && !lsp_is_binary(ls)) {
    LspTriangle tri = lsp_load_triangle(scene, candidate);
    if (lsp_has_gaps(tri)) {
      /* A candidate that is there in part says nothing of what lies behind it, and a ray that passes it would
       * be stopped a second time by the neighbour that it stands for, too: the ray goes on into the node. */
      lsp_walk.ref = ls.child;
      if (lsp_walk.ref != LSP_NONE) return;
      /* Of an approximate file there is nothing more. */
      if (lsp_passes(s, tri)) best = lsp_walk.best;
    }
  }
  lsp_walk.best = best;
}

LSP_STEP void lsp_look_up(LspScene scene, LspSetup s, LspQuery q) {
  LspLineSpace ls = lsp_load_line_space(scene, lsp_line_space_index(lsp_walk.ref));
  LspPassage pass = lsp_find_shaft(s, q, ls);
  uint entry = lsp_find_entry(scene, q, ls, pass);
  uint candidate = lsp_candidate(scene, ls, entry);
  lsp_answer(scene, s, q, ls, pass, candidate);
}

#elif defined(LSP_WIDE)
#include "lsp/wide.h"
#else
#include "lsp/cells.h"
#endif

/* Takes a valid ray from the root to its end. */
LSP_STEP LspWalked lsp_walk_ready(LspScene scene, LspSetup s, LspQuery q) {
  lsp_begin(scene, s, q);
  bool going = lsp_walk.ref != LSP_NONE;
  while (going) {
    lsp_advance(scene, s, q);
    if ((lsp_walk.ref & LSP_LEAF_BIT) != 0u) {
      going = lsp_walk.ref != LSP_NONE;
      if (going) lsp_test_leaf(scene, s);
    } else if ((q.flags & LSP_TRACE_APPROXIMATE) != 0u) {
      lsp_look_up(scene, s, q);
    } else {
      lsp_walk.ref = LSP_NONE; /* of a damaged file */
    }
  }
  LspWalked walked;
  walked.best = lsp_end(scene);
  walked.counts = lsp_walk.counts;
  return walked;
}

#ifndef LSP_TRAVERSE_AGAIN
LSP_FN LspHit lsp_finish(LspScene scene, LspSetup s, LspRay ray, LspBest best, uint flags) {
#ifdef LSP_CELLS
  return lsp_finish_as(scene, s, ray, best, flags, true);
#else
  return lsp_finish_as(scene, s, ray, best, flags, false);
#endif
}

/* Traces a valid ray. */
LSP_STEP LspTraced lsp_trace_ready(LspScene scene, LspSetup s, LspQuery q, LspRay ray) {
  LspWalked walked = lsp_walk_ready(scene, s, q);
  LspTraced traced;
  traced.hit = lsp_finish(scene, s, ray, walked.best, q.flags);
  traced.counts = walked.counts;
  traced.valid = true;
  return traced;
}

/* Traces one ray. flags: LSP_TRACE_*; lod: see lsp_trace_options; dial: LSP_DIAL, of cells. */
LSP_STEP LspTraced lsp_trace_ray(LspScene scene, LspRay ray, uint flags, float lod, uint dial) {
  LspSetup s = lsp_setup(scene, ray);
  if (!s.valid) return lsp_invalid_ray();
  LspQuery q = lsp_query(flags, lod, dial);
  q.far = lsp_is_far(scene, s);
  return lsp_trace_ready(scene, s, q, ray);
}
#endif

#ifndef GL_core_profile
#undef precise
#endif
