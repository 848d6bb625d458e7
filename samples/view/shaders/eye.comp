// What the eye sees: one exact ray a pixel. Begins the sample: adds what is seen without further rays.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "path.glsl"

void main() {
  Pixel pixel;
  if (!find_pixel(pixel)) return;
  vec2 point = vec2(pixel.at) + random(pixel, kPixelPoint);
  vec2 size = vec2(frame.width, frame.height);
  vec2 on_picture = (2.0 * point - size) / size.y * frame.half_height;
  vec3 direction = normalize(frame.forward + on_picture.x * frame.right - on_picture.y * frame.up);
  LspRay ray = LspRay(frame.eye, 0.0, direction, LSP_INFINITY);
  LspHit hit = trace(ray).hit;

  vec3 seen = vec3(0.0);
  Surface s;
  s.vertex.alive = 0u;
  if (hit.primitive != LSP_NONE) {
    s = surface_of(ray, hit);
    if (frame.effect == VIEW_LIGHT) seen = s.emission;
  } else if (frame.effect == VIEW_AO) {
    seen = vec3(1.0);
  } else if (frame.effect == VIEW_LIGHT) {
    seen = sky_radiance(direction);
  }
  vertices[pixel.item] = s.vertex;
  vec4 before = frame.sample_number == 0u ? vec4(0.0) : sums[pixel.number];
  sums[pixel.number] = before + vec4(0.0, 0.0, 0.0, 1.0);
  add(pixel, seen);
}
