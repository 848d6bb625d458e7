// A ray's way through the tree over instances on the CPU: by the text that shaders have, and by vectors.
#pragma once

#include "lsp/lsp_instances.h"
#include "trace_subset.h"

namespace lsp {
namespace instance_subset {

using namespace subset;
using LspInstances = const lsp_instances&;

struct LspInstanceNode {
  vec3 lo;
  uint child;
  vec3 hi;
  float growth;
};
struct LspPlace {
  vec3 row_0, row_1, row_2;
  vec3 translation;
  vec3 translation_rest;
};

inline vec3 vector_of(const float v[3]) { return {v[0], v[1], v[2]}; }
inline LspInstanceNode lsp_load_instance_node(LspInstances instances, uint i) {
  const lsp_instance_node& node = instances.nodes[i];
  return {vector_of(node.lo), node.child, vector_of(node.hi), node.growth};
}
inline uint lsp_load_instance_mask(LspInstances instances, uint i) {
  return instances.records[i].instance.mask;
}
inline LspPlace lsp_load_place(LspInstances instances, uint i) {
  const lsp_instance_record& record = instances.records[i];
  return {vector_of(record.inverse), vector_of(record.inverse + 3), vector_of(record.inverse + 6),
          vector_of(record.translation), vector_of(record.translation_rest)};
}

// A ray on its way through the tree over instances.
struct InstanceWalk {
#include "lsp/arithmetic.h"
#include "lsp/instance_walk.h"

  LspInstanceRay ray;
  bool is_wide;  // what waits are children of wide nodes
};

}  // namespace instance_subset

using instance_subset::InstanceWalk;

// In place of an instance's number: more would wait than a ray has room for.
constexpr uint32_t kNoRoom = LSP_NONE - 1;

// Walks that stand at their next instances.
struct InstanceQueue {
  const lsp_instances& instances;
  uint32_t mask;
  InstanceWalk* walks;
  const uint32_t* number;  // of the walk, of each of `count`
  const float* tmax;       // by the walk's number: where the ray ends now
  uint32_t* next;          // of each: the instance, LSP_NONE or kNoRoom
  uint32_t count;
};

// One vector instruction set, and the loop compiled for it: lsp_next_instance of each walk that is wide, but
// that instances may come in another order.
struct WideInstances {
  const char* name;
  bool (*runs_here)();  // on this CPU
  void (*trace)(const InstanceQueue& queue);
};

// All that are compiled in, the best first, and a last one whose name is null.
extern const WideInstances kWideInstances[];

// The best that runs here. Null: none does.
const WideInstances* wide_instances();

}  // namespace lsp
