/* Arithmetic of rays, in the common subset of GLSL 4.6 and C++20; lsp/traverse.h and lsp/instance_walk.h build on it.
 * Included as they are: see there. min and max are written out because their answers to NaN are not the same
 * everywhere. */
#ifndef GL_core_profile
#define precise
#endif

#define LSP_INFINITY uintBitsToFloat(0x7F800000u)
#define LSP_FLOAT_MAX uintBitsToFloat(0x7F7FFFFFu)

LSP_FN float lsp_min(float a, float b) { return b < a ? b : a; }
LSP_FN float lsp_max(float a, float b) { return a < b ? b : a; }

LSP_FN float lsp_dot(vec3 a, vec3 b) {
  precise float r = a.x * b.x + a.y * b.y + a.z * b.z;
  return r;
}

LSP_FN vec3 lsp_cross(vec3 a, vec3 b) {
  precise vec3 r = vec3(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x);
  return r;
}

LSP_FN bool lsp_is_nan(float x) { return (floatBitsToUint(x) & 0x7FFFFFFFu) > 0x7F800000u; }
LSP_FN bool lsp_is_finite(float x) { return (floatBitsToUint(x) & 0x7F800000u) != 0x7F800000u; }
LSP_FN bool lsp_all_finite(vec3 v) { return lsp_is_finite(v.x) && lsp_is_finite(v.y) && lsp_is_finite(v.z); }

/* |d| under 2^-60 of the largest component cannot move a ray by an ulp of the scene: it is taken for zero, or
 * products of it would underflow in the triangle test. Its slab is either hit along its whole length or
 * missed, and a finite reciprocal keeps 0 * infinity out of the arithmetic. */
LSP_FN float lsp_no_trifle(float d) { return abs(d) < 8.6736174e-19f ? 0.0f : d; }

LSP_FN float lsp_reciprocal(float d) {
  precise float r = 1.0f / (d == 0.0f ? 1.0f : d);
  return d == 0.0f ? 1.2089258e24f : r;
}

LSP_FN float lsp_largest(vec3 v) {
  vec3 m = abs(v);
  return lsp_max(lsp_max(m.x, m.y), m.z);
}

#ifndef GL_core_profile
#undef precise
#endif
