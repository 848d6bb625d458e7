// Rays through cells in passes. A device runs invocations side by side, and of the rays that it runs so some are
// answered by tables while others are traced exactly in a cell, for which all wait. So a ray that comes to such a cell
// leaves: how far it has come waits in the place of its hit, its number in the list of the next pass, which takes the
// rays of its list side by side. The last pass takes the few that are left to their end. What a ray hits is what it
// hits in one pass. With LSP_ADDRESSES defined, the sections are read through buffer device addresses.
#version 460
#extension GL_GOOGLE_include_directive : require
#ifdef LSP_ADDRESSES
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_buffer_reference_uvec2 : require
#endif

#define LSP_CELLS
#define LSP_PARTS_CONSTANT_ID LSP_VULKAN_PARTS_CONSTANT
#include "lsp/lsp.glsl"

layout(local_size_x = LSP_VULKAN_GROUP_SIZE) in;

#include "rays.glsl"

layout(std430, set = 0, binding = LSP_BINDING_QUEUE) buffer QueueBuffer { uint queue[]; };

layout(constant_id = LSP_VULKAN_FLAGS_CONSTANT) const uint kFlags = 0u;
layout(constant_id = LSP_VULKAN_PASS_CONSTANT) const uint kPass = LSP_VULKAN_FIRST_PASS;

layout(push_constant) uniform Constants { lsp_vulkan_pass_constants constants; };

// Where the list of a pass begins.
uint list_of(uint pass) { return LSP_VULKAN_QUEUE_HEAD + (pass & 1u) * constants.count; }

// The ray of this invocation; LSP_NONE: there is none.
uint find_ray() {
  uint number = gl_GlobalInvocationID.x;
  if (kPass == LSP_VULKAN_FIRST_PASS) return number < constants.count ? constants.first + number : LSP_NONE;
  return number < queue[4u * constants.pass] ? queue[list_of(constants.pass) + number] : LSP_NONE;
}

// Leaves the ray, which is to be traced exactly in the cell that it has passed, to the next pass.
void leave(uint index) {
  uint head = 4u * (constants.pass + 1u);
  uint number = atomicAdd(queue[head], 1u);
  if (number % LSP_VULKAN_GROUP_SIZE == 0u) atomicAdd(queue[head + 1u], 1u);
  queue[list_of(constants.pass + 1u) + number] = index;
  uint bits = uint(lsp_walk.axis) | (lsp_walk.closed ? 4u : 0u) | lsp_walk.mode << 3u | lsp_walk.step << 5u;
  uvec3 cell = uvec3(lsp_walk.cell) & 0xFFFFu; // one of them may be -1
  hit_words[2u * index] = uvec4(lsp_walk.ref, bits, cell.x | cell.y << 16u, cell.z);
  hit_words[2u * index + 1u] = uvec4(floatBitsToUint(vec3(lsp_walk.t, lsp_walk.exact_t, lsp_walk.t_last)), lsp_walk.waiting);
}

// Takes up a ray where it was left.
void take_up(LspScene scene, LspSetup s, LspQuery q, uint index) {
  uvec4 a = hit_words[2u * index];
  uvec4 b = hit_words[2u * index + 1u];
  lsp_walk.best = lsp_no_best(s);
  lsp_walk.ref = a.x;
  lsp_walk.axis = int(a.y & 3u);
  lsp_walk.closed = (a.y & 4u) != 0u;
  lsp_walk.mode = (a.y >> 3u) & 3u;
  lsp_walk.step = a.y >> 5u;
  lsp_walk.cell = ivec3(int(a.z << 16u) >> 16, int(a.z) >> 16, int(a.w << 16u) >> 16);
  lsp_walk.t = uintBitsToFloat(b.x);
  lsp_walk.exact_t = uintBitsToFloat(b.y);
  lsp_walk.t_last = uintBitsToFloat(b.z);
  lsp_walk.waiting = b.w;
  /* Such a cell is passed alone, so that the ray has come from the one before. (By the signs of s.inverse: with what
   * lsp_cell_ray answers assigned here, glslang's search for what `precise` concerns has no end.) */
  lsp_walk.exact_cell = lsp_walk.cell;
  if (lsp_walk.axis == 0) lsp_walk.exact_cell.x += s.inverse.x < 0.0f ? 1 : -1;
  if (lsp_walk.axis == 1) lsp_walk.exact_cell.y += s.inverse.y < 0.0f ? 1 : -1;
  if (lsp_walk.axis == 2) lsp_walk.exact_cell.z += s.inverse.z < 0.0f ? 1 : -1;
  lsp_walk.any_hit = (q.flags & LSP_TRACE_ANY_HIT) != 0u;
  lsp_walk.counts = lsp_no_counts();
  lsp_stack_ref[0] = lsp_walk.ref;
}

void main() {
  uint index = find_ray();
  if (index == LSP_NONE) return;
  LspScene scene = lsp_bound_scene();
  LspRay ray = load_ray(index);
  LspSetup s = lsp_setup(scene, ray);
  if (!s.valid) {
    store_hit(index, lsp_invalid_ray().hit);
    return;
  }
  LspQuery q = lsp_query(kFlags, 0.0, constants.dial);
  if (kPass == LSP_VULKAN_FIRST_PASS) {
    lsp_begin(scene, s, q);
  } else {
    take_up(scene, s, q, index);
  }
  bool last = kPass == LSP_VULKAN_LAST_PASS;
  bool calls = kPass != LSP_VULKAN_FIRST_PASS;
  bool going = true;
  while (going) {
    if (calls) lsp_test_leaf(scene, s);
    lsp_advance(scene, s, q);
    going = last && lsp_walk.ref != LSP_NONE;
  }
  if (!last && lsp_walk.ref != LSP_NONE) {
    leave(index);
    return;
  }
  LspBest best = lsp_end(scene);
  store_hit(index, lsp_finish(scene, s, ray, best, q.flags));
}
