// One ray per invocation: rays from a buffer, hits into another. With LSP_COUNT defined, sums of the work done
// are added to the counters (struct lsp_trace_counts of lsp.h, less its first field: the host knows the rays).
// With LSP_ADDRESSES defined, the sections are read through buffer device addresses; with LSP_NTREE, the base
// structure is an NTree.
#version 460
#extension GL_GOOGLE_include_directive : require

#define LSP_PARTS_CONSTANT_ID 2
#ifdef LSP_ADDRESSES
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_buffer_reference_uvec2 : require
#include "lsp/lsp_addresses.glsl"
#else
#include "lsp/lsp.glsl"
#endif

layout(local_size_x = 64) in;

// As words: 16-byte loads and stores are faster than member by member, and keep every bit.
layout(std430, set = 0, binding = 9) readonly buffer RayBuffer { uvec4 ray_words[]; };
layout(std430, set = 0, binding = 10) writeonly buffer HitBuffer { uvec4 hit_words[]; };

// The kind of trace is part of the pipeline: what it does not need (look-ups in an exact trace) is compiled
// away, which matters most where a device runs both sides of every branch.
layout(constant_id = 1) const uint kFlags = 0u;

layout(push_constant) uniform Constants {
  float lod;
  uint first;
  uint count;
} constants;

#ifdef LSP_COUNT
layout(std430, set = 0, binding = 11) buffer CounterBuffer { uint counter_words[]; };

// Adds to the 64-bit field `field`; the carry is taken by whoever caused it.
void add(uint field, uint n) {
  if (n == 0u) return;
  uint before = atomicAdd(counter_words[2u * field], n);
  if (before + n < before) atomicAdd(counter_words[2u * field + 1u], 1u);
}
#endif

void main() {
  if (gl_GlobalInvocationID.x >= constants.count) return;
  uint index = constants.first + gl_GlobalInvocationID.x;
  uvec4 a = ray_words[2u * index];
  uvec4 b = ray_words[2u * index + 1u];
  LspRay ray = LspRay(uintBitsToFloat(a.xyz), uintBitsToFloat(a.w), uintBitsToFloat(b.xyz), uintBitsToFloat(b.w));

  bool valid;
#ifdef LSP_COUNT
  LspCounts counts = LspCounts(0u, 0u, 0u);
  LspHit hit = lsp_trace_ray(ray, kFlags, constants.lod, valid, counts);
  if ((hit.flags & LSP_HIT_INCOMPLETE) == 0u) {  // an incomplete ray is traced, and counted, again
    add(1u, valid ? 0u : 1u);
    add(2u, hit.primitive != LSP_NONE ? 1u : 0u);
    add(3u, counts.nodes);
    add(4u, counts.shafts);
    add(5u, counts.triangles);
  }
#else
  LspHit hit = lsp_trace_ray(ray, kFlags, constants.lod, valid);
#endif

  hit_words[2u * index] =
      uvec4(floatBitsToUint(hit.t), hit.primitive, floatBitsToUint(hit.u), floatBitsToUint(hit.v));
  hit_words[2u * index + 1u] = uvec4(floatBitsToUint(hit.normal), hit.flags);
}
