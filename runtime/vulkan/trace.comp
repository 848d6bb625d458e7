// One ray per invocation: rays from a buffer, hits into another. With LSP_COUNT defined, sums of the work done
// are added to the counters. With LSP_ADDRESSES defined, the sections are read through buffer device addresses; with
// LSP_NTREE, the base structure is an NTree; with LSP_CELLS, cells answer; with LSP_INSTANCES, instances of files.
#version 460
#extension GL_GOOGLE_include_directive : require
#ifdef LSP_ADDRESSES
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_buffer_reference_uvec2 : require
#endif

#define LSP_PARTS_CONSTANT_ID LSP_VULKAN_PARTS_CONSTANT
#include "lsp/lsp.glsl"

layout(local_size_x = LSP_VULKAN_GROUP_SIZE) in;

#include "rays.glsl"

// The kind of trace is part of the pipeline: what it does not need (look-ups in an exact trace) is compiled
// away, which matters most where a device runs both sides of every branch.
layout(constant_id = LSP_VULKAN_FLAGS_CONSTANT) const uint kFlags = 0u;

#ifdef LSP_INSTANCES
layout(push_constant) uniform Constants { lsp_vulkan_instance_constants constants; };
#else
layout(push_constant) uniform Constants { lsp_vulkan_trace_constants constants; };
#endif

#ifdef LSP_COUNT
layout(std430, set = 0, binding = LSP_BINDING_COUNTERS) buffer CounterBuffer { uint counter_words[]; };

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
  LspRay ray = load_ray(index);

#ifdef LSP_INSTANCES
  LspTraced traced = lsp_trace_ray_instances(constants.instance_count, ray, constants.mask, kFlags);
#else
  LspTraced traced = lsp_trace_ray(lsp_bound_scene(), ray, kFlags, constants.lod, constants.dial);
#endif
  LspHit hit = traced.hit;
#ifdef LSP_COUNT
  if ((hit.flags & LSP_HIT_INCOMPLETE) == 0u) {  // an incomplete ray is traced, and counted, again
    add(LSP_COUNTER_INVALID, traced.valid ? 0u : 1u);
    add(LSP_COUNTER_HITS, hit.t < LSP_INFINITY ? 1u : 0u);
    add(LSP_COUNTER_NODES, traced.counts.nodes);
    add(LSP_COUNTER_SHAFTS, traced.counts.shafts);
    add(LSP_COUNTER_TRIANGLES, traced.counts.triangles);
    add(LSP_COUNTER_SPLITS, traced.counts.splits);
    add(LSP_COUNTER_EXACT, traced.counts.exact);
    add(LSP_COUNTER_EXACT_NODES, traced.counts.exact_nodes);
  }
#endif
  store_hit(index, hit);
}
