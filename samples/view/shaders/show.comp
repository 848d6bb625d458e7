// The sums as the window's pixels: exposed, tone-mapped, encoded, with the line between the halves.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "../interface.h"

layout(local_size_x = VIEW_GROUP_EDGE, local_size_y = VIEW_GROUP_EDGE) in;
layout(std430, set = 1, binding = VIEW_BINDING_FRAME) readonly buffer FrameBuffer { ViewFrame frame; };
layout(std430, set = 1, binding = VIEW_BINDING_SUMS) readonly buffer SumBuffer { vec4 sums[]; };
layout(std430, set = 1, binding = VIEW_BINDING_SHOWN) writeonly buffer ShownBuffer { uint shown[]; };

// As tone_map of samples/picture: Narkowicz's fit to the ACES reference transform.
vec3 tone_map(vec3 radiance) {
  vec3 x = radiance * 0.6;
  return clamp(x * (2.51 * x + 0.03) / (x * (2.43 * x + 0.59) + 0.14), 0.0, 1.0);
}

vec3 to_srgb(vec3 linear) {
  return mix(12.92 * linear, 1.055 * pow(linear, vec3(1.0 / 2.4)) - 0.055, greaterThan(linear, vec3(0.0031308)));
}

vec3 color_of(vec4 sum) {
  vec3 mean = sum.xyz / max(sum.w, 1.0);
  if (frame.effect == VIEW_HEAT) return clamp(3.0 * mean.x / frame.heat_white - vec3(0.0, 1.0, 2.0), 0.0, 1.0);
  return frame.effect == VIEW_AO ? min(mean, 1.0) : tone_map(mean * frame.exposure);
}

void main() {
  uvec2 at = gl_GlobalInvocationID.xy;
  if (at.x >= frame.window_width || at.y >= frame.window_height) return;
  uvec2 traced = at / frame.scale;
  vec3 color = color_of(sums[traced.y * frame.width + traced.x]);
  if (frame.split > 0u && frame.split < frame.window_width) {
    int off = int(at.x) - int(frame.split);
    if (off == -1 || off == 0) color = vec3(1.0);
    if (off == -2 || off == 1) color *= 0.25;
  }
  uvec3 bytes = uvec3(to_srgb(color) * 255.0 + 0.5);
  if (frame.blue_first != 0u) bytes = bytes.zyx;
  shown[at.y * frame.window_width + at.x] = bytes.x | bytes.y << 8 | bytes.z << 16 | 0xFF000000u;
}
