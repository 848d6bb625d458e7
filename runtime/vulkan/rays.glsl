// The buffers of rays and hits of the trace shaders. As words: 16-byte loads and stores are faster than member by
// member, and keep every bit.
layout(std430, set = 0, binding = LSP_BINDING_RAYS) readonly buffer RayBuffer { uvec4 ray_words[]; };
layout(std430, set = 0, binding = LSP_BINDING_HITS) buffer HitBuffer { uvec4 hit_words[]; };

LspRay load_ray(uint index) {
  uvec4 a = ray_words[2u * index];
  uvec4 b = ray_words[2u * index + 1u];
  return LspRay(uintBitsToFloat(a.xyz), uintBitsToFloat(a.w), uintBitsToFloat(b.xyz), uintBitsToFloat(b.w));
}

void store_hit(uint index, LspHit hit) {
  hit_words[2u * index] =
      uvec4(floatBitsToUint(hit.t), hit.primitive, floatBitsToUint(hit.u), floatBitsToUint(hit.v));
  hit_words[2u * index + 1u] = uvec4(floatBitsToUint(hit.normal), hit.flags);
}
