// Light on a surface of a path from the sky, the sun, or an emitter or the lamp: one ray to it.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "path.glsl"
#include "count.glsl"

layout(std430, set = 1, binding = VIEW_BINDING_EMITTERS) readonly buffer EmitterBuffer { ViewEmitter emitters[]; };

// Towards a light: the ray's direction and reach, and what arrives if nothing is in the way, over pi.
struct Light {
  vec3 way;
  float reach;
  vec3 radiance;
};

Light sky_light(ViewVertex v, vec2 u) {
  vec3 direction = above(v, cosine_direction(v.shading_normal, u));
  return Light(direction, LSP_INFINITY, sky_radiance(direction));
}

Light sun_light(ViewVertex v, vec2 u) {
  vec3 t, b;
  make_frame(frame.sun_direction, t, b);
  float r = sqrt(u.x) * frame.sun_radius;
  vec3 direction = normalize(frame.sun_direction + r * cos(kTau * u.y) * t + r * sin(kTau * u.y) * b);
  return Light(direction, LSP_INFINITY, frame.sun_irradiance * (max(dot(direction, v.shading_normal), 0.0) * 2.0 / kTau));
}

// Of a point that shines with `intensity` towards v, before the distance; the ray ends at `reach` of the way there.
Light near_light(ViewVertex v, vec3 point, vec3 intensity, float reach) {
  vec3 way = point - v.origin;
  float distance2 = dot(way, way);
  float cosine = dot(way, v.shading_normal) / sqrt(distance2);
  return Light(way, reach, distance2 > 0.0 ? intensity * (max(cosine, 0.0) * 2.0 / (distance2 * kTau)) : vec3(0.0));
}

Light lamp_light(ViewVertex v, vec2 u) {
  float z = 1.0 - 2.0 * u.x;
  float r = sqrt(max(1.0 - z * z, 0.0));
  vec3 on_ball = vec3(r * cos(kTau * u.y), z, r * sin(kTau * u.y));
  return near_light(v, frame.lamp_position + frame.lamp_radius * on_ball, frame.lamp_intensity, 1.0);
}

Light emitter_light(ViewVertex v, vec2 u, float chance) {
  uint lo = 0u, hi = frame.emitters - 1u;
  while (lo < hi) {
    uint middle = (lo + hi) / 2u;
    if (emitters[middle].cumulative <= chance) lo = middle + 1u;
    else hi = middle;
  }
  ViewEmitter e = emitters[lo];
  float root = sqrt(u.x);
  vec3 point = e.corner + root * (1.0 - u.y) * e.edge1 + root * u.y * e.edge2;
  float there = abs(dot(normalize(point - v.origin), normalize(cross(e.edge1, e.edge2))));
  return near_light(v, point, e.radiance * (there / e.pdf), 0.999);
}

void light(Pixel pixel) {
  bool bounce = region.vertex == VIEW_BOUNCE;
  ViewVertex v = vertices[pixel.item + (bounce ? VIEW_SLICE_PIXELS : 0u)];
  if (v.alive == 0u) return;
  vec2 u = random(pixel, (bounce ? kBounceLight : kDirectLight) + region.light);
  Light found;
  if (region.light == VIEW_SKY) found = sky_light(v, u);
  else if (region.light == VIEW_SUN) found = sun_light(v, u);
  else if (frame.emitters > 0u) found = emitter_light(v, u, random(pixel, kEmitterChoice + region.vertex).x);
  else found = lamp_light(v, u);
  vec3 radiance = found.radiance * v.weight;
  if (radiance == vec3(0.0) || dot(found.way, v.geometric_normal) <= 0.0) return;
  LspRay ray = LspRay(v.origin, 0.0, found.way, found.reach);
  LspHit hit = trace(ray).hit;
  if (bounce) count_ray(hit);
  if (hit.primitive == LSP_NONE && (hit.flags & LSP_HIT_INCOMPLETE) == 0u) add(pixel, radiance);
}

void main() {
  Pixel pixel;
  if (find_pixel(pixel)) light(pixel);
}
