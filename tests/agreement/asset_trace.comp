// Traces every ray in one asset alone, in the asset's own space: ray i in asset i modulo their number.
#version 460
#extension GL_GOOGLE_include_directive : require
#define LSP_PARTS_CONSTANT_ID LSP_VULKAN_PARTS_CONSTANT
#include "lsp/lsp.glsl"

layout(local_size_x = LSP_VULKAN_GROUP_SIZE) in;
layout(constant_id = LSP_VULKAN_FLAGS_CONSTANT) const uint kFlags = 0u;
layout(std430, set = 0, binding = LSP_BINDING_RAYS) readonly buffer Rays { LspRay rays[]; };
layout(std430, set = 0, binding = LSP_BINDING_HITS) writeonly buffer Hits { LspHit hits[]; };

void main() {
  uint i = gl_GlobalInvocationID.x;
  if (i < rays.length()) hits[i] = lsp_trace(lsp_asset(i % uint(lsp_assets.length())), rays[i], kFlags);
}
