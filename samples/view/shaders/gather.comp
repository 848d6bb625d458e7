// Indirect light: one ray a pixel from what the eye sees, exact or approximate. Of ambient occlusion and heat it is the
// last; else it leaves the surface that it meets to light.comp.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "path.glsl"
#include "count.glsl"

void gather(Pixel pixel) {
  vertices[VIEW_SLICE_PIXELS + pixel.item].alive = 0u;
  ViewVertex from = vertices[pixel.item];
  if (from.alive == 0u) return;
  bool occlusion = frame.effect == VIEW_AO;
  vec2 u = random(pixel, occlusion ? kOcclusionDirection : kDiffuseDirection);
  vec3 direction = above(from, cosine_direction(from.shading_normal, u));
  LspRay ray = LspRay(from.origin, 0.0, direction, occlusion ? frame.ao_reach : LSP_INFINITY);
  LspTraced traced = trace(ray);
  count_ray(traced.hit);
  if ((traced.hit.flags & LSP_HIT_INCOMPLETE) != 0u) return;
  if (frame.effect == VIEW_HEAT) {
    LspCounts c = traced.counts;
    uint steps = c.nodes + c.exact_nodes + c.shafts + c.triangles;
    count_steps(steps);
    sums[pixel.number].xyz += vec3(float(steps));
  } else if (occlusion) {
    if (traced.hit.primitive == LSP_NONE) add(pixel, vec3(1.0));
  } else if (traced.hit.primitive != LSP_NONE) {
    // What shines there is direct light already.
    Surface s = surface_of(ray, traced.hit);
    s.vertex.weight *= from.weight;
    vertices[VIEW_SLICE_PIXELS + pixel.item] = s.vertex;
  }
}

void main() {
  Pixel pixel;
  if (find_pixel(pixel)) gather(pixel);
}
