// Writes lsp_instance_hit_offset of every hit: hits are read where the trace shader reads rays, offsets written where
// it writes hits.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "lsp/lsp.glsl"

layout(local_size_x = LSP_VULKAN_GROUP_SIZE) in;
layout(std430, set = 0, binding = LSP_BINDING_RAYS) readonly buffer Hits { LspHit hits[]; };
layout(std430, set = 0, binding = LSP_BINDING_HITS) writeonly buffer Offsets { float offsets[]; };

void main() {
  uint i = gl_GlobalInvocationID.x;
  if (i < hits.length()) offsets[i] = lsp_instance_hit_offset(hits[i]);
}
