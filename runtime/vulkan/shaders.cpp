// The words of the trace shader, by what it is compiled for.
#include "lsp/lsp_vulkan.h"

namespace {

#include "shaders.inc"

struct Spirv {
  const uint32_t* words;
  size_t bytes;
};

// What counts, and what does not.
#define LSP_SPIRV(name)                                        \
  {                                                            \
    {name, sizeof name}, { name##_count, sizeof name##_count } \
  }
// By base structure, addresses, counting.
constexpr Spirv kShaders[4][2][2] = {{LSP_SPIRV(trace), LSP_SPIRV(trace_addresses)},
                                     {LSP_SPIRV(trace_ntree), LSP_SPIRV(trace_ntree_addresses)},
                                     {LSP_SPIRV(trace_cells), LSP_SPIRV(trace_cells_addresses)},
                                     {LSP_SPIRV(trace_wide), LSP_SPIRV(trace_wide_addresses)}};
constexpr Spirv kInstances[2][2] = {LSP_SPIRV(trace_instances), LSP_SPIRV(trace_instances_addresses)};
constexpr Spirv kPasses[2] = {{trace_passes, sizeof trace_passes},
                              {trace_passes_addresses, sizeof trace_passes_addresses}};

}  // namespace

extern "C" const uint32_t* lsp_vulkan_trace_spirv(const lsp_vulkan_plan* plan, int counting, size_t* bytes) {
  const uint32_t base = plan->base_structure - LSP_BASE_BVH;
  const Spirv& shader = kShaders[base < 4 ? base : 0][plan->addresses != 0][counting != 0];
  *bytes = shader.bytes;
  return shader.words;
}

extern "C" const uint32_t* lsp_vulkan_passes_spirv(const lsp_vulkan_kind* kind, size_t* bytes) {
  const Spirv& shader = kPasses[kind->addresses != 0];
  *bytes = shader.bytes;
  return shader.words;
}

extern "C" const uint32_t* lsp_vulkan_instances_spirv(const lsp_vulkan_kind* kind, int counting,
                                                      size_t* bytes) {
  const Spirv& shader = kInstances[kind->addresses != 0][counting != 0];
  *bytes = shader.bytes;
  return shader.words;
}
