/* What the shaders of paths share: their buffers, random numbers, and what a surface is. */
#include "../interface.h"
#define LSP_PARTS_CONSTANT_ID VIEW_CONSTANT_PARTS
#include "lsp/lsp.glsl"
#include "sampler.glsl"

layout(local_size_x = VIEW_GROUP_EDGE, local_size_y = VIEW_GROUP_EDGE) in;
layout(constant_id = VIEW_CONSTANT_FLAGS) const uint kFlags = 0u;
layout(push_constant) uniform Constants { ViewRegion region; };

layout(std430, set = 1, binding = VIEW_BINDING_FRAME) readonly buffer FrameBuffer { ViewFrame frame; };
layout(std430, set = 1, binding = VIEW_BINDING_SUMS) buffer SumBuffer { vec4 sums[]; };
layout(std430, set = 1, binding = VIEW_BINDING_VERTICES) buffer VertexBuffer { ViewVertex vertices[]; };
layout(std430, set = 1, binding = VIEW_BINDING_MATERIALS) readonly buffer MaterialBuffer { LspMaterial materials[]; };
layout(std430, set = 1, binding = VIEW_BINDING_TRIANGLES) readonly buffer TriangleBuffer { uint triangle_of[]; };
layout(std430, set = 1, binding = VIEW_BINDING_FILES) readonly buffer FileBuffer { ViewFile files[]; };
layout(std430, set = 1, binding = VIEW_BINDING_STATISTICS) buffer StatisticsBuffer { ViewStatistics statistics[2]; };

struct Pixel {
  uvec2 at;
  uint number; /* in the picture */
  uint item;   /* in the slice */
};

/* False: this invocation lies outside the region. */
bool find_pixel(out Pixel pixel) {
  if (gl_GlobalInvocationID.x >= region.columns || gl_GlobalInvocationID.y >= region.rows) return false;
  pixel.at = uvec2(region.first_column, region.first_row) + gl_GlobalInvocationID.xy;
  pixel.number = pixel.at.y * frame.width + pixel.at.x;
  pixel.item = gl_GlobalInvocationID.y * frame.width + pixel.at.x;
  return true;
}

/* Pairs of random numbers of a pixel's sample, by purpose: those of lsp-render's renderer.cpp. */
const uint kPixelPoint = 0u;
const uint kOcclusionDirection = 2u;
const uint kDirectLight = 3u;
const uint kDiffuseDirection = 7u;
const uint kBounceLight = 8u;
const uint kEmitterChoice = 64u; /* and one more of the bounce */

vec2 random(Pixel pixel, uint purpose) {
  return sobol_point(frame.sample_number, hash_combine(hash_mix(pixel.number + 0x68BC21EBu), purpose));
}

/* A bright sample is cut: it would stay as a white dot. */
void add(Pixel pixel, vec3 radiance) {
  float largest = max(max(radiance.x, radiance.y), radiance.z);
  if (!(largest > 0.0) || isinf(largest)) return;
  sums[pixel.number].xyz += largest > 20.0 ? radiance * (20.0 / largest) : radiance;
}

/* Unit vectors that make a right-handed frame with unit n (Duff et al. 2017). */
void make_frame(vec3 n, out vec3 tangent, out vec3 bitangent) {
  float s = floatBitsToInt(n.z) < 0 ? -1.0 : 1.0; /* as copysign: -0 has a sign */
  float a = -1.0 / (s + n.z);
  float b = n.x * n.y * a;
  tangent = vec3(1.0 + s * n.x * n.x * a, s * b, -s * n.x);
  bitangent = vec3(b, s + n.y * n.y * a, -n.y);
}

const float kTau = 6.28318530717958648;

vec3 cosine_direction(vec3 n, vec2 u) {
  vec3 t, b;
  make_frame(n, t, b);
  float r = sqrt(u.x);
  return normalize(r * cos(kTau * u.y) * t + r * sin(kTau * u.y) * b + sqrt(max(1.0 - u.x, 0.0)) * n);
}

/* A direction that the shading normal allows but that runs into the surface is mirrored out of it. */
vec3 above(ViewVertex v, vec3 direction) {
  float depth = dot(direction, v.geometric_normal);
  return depth < 0.0 ? direction - 2.0 * depth * v.geometric_normal : direction;
}

vec3 sky_radiance(vec3 direction) {
  float height = frame.z_up != 0u ? direction.z : direction.y;
  float haze = pow(1.0 - max(height, 0.0), 3.0);
  vec3 clear = mix(vec3(0.28, 0.52, 1.0), vec3(0.86, 0.92, 1.0), haze) * 2.2;
  float toward = max(dot(direction, frame.sun_direction), 0.0);
  vec3 glow = vec3(1.0, 0.85, 0.6) * (0.9 * pow(toward, 24.0));
  return frame.sky_brightness * mix(vec3(0.24, 0.22, 0.20), clear + glow, clamp(height * 12.0 + 0.5, 0.0, 1.0));
}

/* A triangle in scene space. */
struct Corners {
  vec3 v0;
  vec3 e1;
  vec3 e2;
};

#ifdef LSP_INSTANCES
LspTraced trace(LspRay ray) { return lsp_trace_ray_instances(frame.instance_count, ray, 0xFFu, kFlags); }

uint file_of(LspHit hit) { return lsp_instance_words[10u * (hit.flags >> LSP_HIT_INSTANCE_SHIFT)].x; }
LspScene scene_of(LspHit hit) { return lsp_asset_of(hit.flags >> LSP_HIT_INSTANCE_SHIFT); }
float offset_of(LspHit hit) { return lsp_instance_hit_offset(hit); }

/* By the instance's transform: an lsp_instance_record has its rows and, apart, where the asset's origin lies. */
Corners corners_of(LspHit hit, LspTriangle tri) {
  uint first = 10u * (hit.flags >> LSP_HIT_INSTANCE_SHIFT);
  mat3 linear = transpose(mat3(uintBitsToFloat(lsp_instance_words[first].yzw),
                               uintBitsToFloat(lsp_instance_words[first + 1u].yzw),
                               uintBitsToFloat(lsp_instance_words[first + 2u].yzw)));
  vec3 origin = uintBitsToFloat(lsp_instance_words[first + 6u].yzw);
  return Corners(linear * tri.v0 + origin, linear * (tri.v1 - tri.v0), linear * (tri.v2 - tri.v0));
}
#else
LspTraced trace(LspRay ray) { return lsp_trace_ray(lsp_bound_scene(), ray, kFlags, frame.lod, frame.dial); }

uint file_of(LspHit hit) { return 0u; }
LspScene scene_of(LspHit hit) { return lsp_bound_scene(); }
float offset_of(LspHit hit) { return lsp_hit_offset(lsp_bound_scene(), hit); }
Corners corners_of(LspHit hit, LspTriangle tri) { return Corners(tri.v0, tri.v1 - tri.v0, tri.v2 - tri.v0); }
#endif

struct Surface {
  ViewVertex vertex; /* its weight is the surface's colour */
  vec3 emission;
};

/* The surface that a ray has hit. */
Surface surface_of(LspRay ray, LspHit hit) {
  ViewFile file = files[file_of(hit)];
  Surface s;
  vec3 position = ray.origin + hit.t * ray.direction;
  vec3 shading = hit.normal;
  vec3 geometric = hit.normal;
  uint index = hit.primitive < file.primitives ? triangle_of[file.first_primitive + hit.primitive] : LSP_NONE;
  uint material = 0u;
  if (index != LSP_NONE) {
    LspTriangle tri = lsp_load_triangle(scene_of(hit), index);
    Corners c = corners_of(hit, tri);
    vec3 area = cross(c.e1, c.e2);
    float twice = length(area);
    if (twice > 0.0) geometric = area / twice;
    /* Closer to the triangle than the way along the ray. A table's plane is another: there t counts. */
    if ((hit.flags & LSP_HIT_LINE_SPACE) == 0u) position = c.v0 + hit.u * c.e1 + hit.v * c.e2;
    material = tri.material;
  }
  if (dot(geometric, ray.direction) > 0.0) geometric = -geometric;
  if (dot(geometric, shading) < 0.0) shading = -shading;
  s.vertex.origin = position + offset_of(hit) * geometric;
  s.vertex.alive = 1u;
  s.vertex.geometric_normal = geometric;
  s.vertex.shading_normal = shading;
  LspMaterial m = materials[file.first_material + (material < file.materials ? material : 0u)];
  s.vertex.weight = clamp(m.base_color, 0.0, 1.0); /* metals, too, are seen as diffuse */
  s.emission = m.emission;
  s.vertex.reserved0 = s.vertex.reserved1 = s.vertex.reserved2 = 0u;
  return s;
}
