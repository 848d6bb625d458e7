// The words of the trace shader, by what it is compiled for.
#include "lsp/lsp_vulkan.h"

namespace {

constexpr uint32_t kBvh[] =
#include "trace.spv.inc"
    ;
constexpr uint32_t kBvhCount[] =
#include "trace_count.spv.inc"
    ;
constexpr uint32_t kBvhAddresses[] =
#include "trace_addresses.spv.inc"
    ;
constexpr uint32_t kBvhAddressesCount[] =
#include "trace_addresses_count.spv.inc"
    ;
constexpr uint32_t kNTree[] =
#include "trace_ntree.spv.inc"
    ;
constexpr uint32_t kNTreeCount[] =
#include "trace_ntree_count.spv.inc"
    ;
constexpr uint32_t kNTreeAddresses[] =
#include "trace_ntree_addresses.spv.inc"
    ;
constexpr uint32_t kNTreeAddressesCount[] =
#include "trace_ntree_addresses_count.spv.inc"
    ;
constexpr uint32_t kCells[] =
#include "trace_cells.spv.inc"
    ;
constexpr uint32_t kCellsCount[] =
#include "trace_cells_count.spv.inc"
    ;
constexpr uint32_t kCellsAddresses[] =
#include "trace_cells_addresses.spv.inc"
    ;
constexpr uint32_t kCellsAddressesCount[] =
#include "trace_cells_addresses_count.spv.inc"
    ;
constexpr uint32_t kWide[] =
#include "trace_wide.spv.inc"
    ;
constexpr uint32_t kWideCount[] =
#include "trace_wide_count.spv.inc"
    ;
constexpr uint32_t kWideAddresses[] =
#include "trace_wide_addresses.spv.inc"
    ;
constexpr uint32_t kWideAddressesCount[] =
#include "trace_wide_addresses_count.spv.inc"
    ;
constexpr uint32_t kInstances[] =
#include "trace_instances.spv.inc"
    ;
constexpr uint32_t kInstancesCount[] =
#include "trace_instances_count.spv.inc"
    ;

struct Spirv {
  const uint32_t* words;
  size_t bytes;
};
// By base structure, addresses, counting.
constexpr Spirv kShaders[4][2][2] = {
    {{{kBvh, sizeof kBvh}, {kBvhCount, sizeof kBvhCount}},
     {{kBvhAddresses, sizeof kBvhAddresses}, {kBvhAddressesCount, sizeof kBvhAddressesCount}}},
    {{{kNTree, sizeof kNTree}, {kNTreeCount, sizeof kNTreeCount}},
     {{kNTreeAddresses, sizeof kNTreeAddresses}, {kNTreeAddressesCount, sizeof kNTreeAddressesCount}}},
    {{{kCells, sizeof kCells}, {kCellsCount, sizeof kCellsCount}},
     {{kCellsAddresses, sizeof kCellsAddresses}, {kCellsAddressesCount, sizeof kCellsAddressesCount}}},
    {{{kWide, sizeof kWide}, {kWideCount, sizeof kWideCount}},
     {{kWideAddresses, sizeof kWideAddresses}, {kWideAddressesCount, sizeof kWideAddressesCount}}}};

}  // namespace

extern "C" const uint32_t* lsp_vulkan_trace_spirv(const lsp_vulkan_plan* plan, int counting, size_t* bytes) {
  const uint32_t base = plan->base_structure - LSP_BASE_BVH;
  const Spirv& shader = kShaders[base < 4 ? base : 0][plan->addresses != 0][counting != 0];
  *bytes = shader.bytes;
  return shader.words;
}

extern "C" const uint32_t* lsp_vulkan_instances_spirv(int counting, size_t* bytes) {
  *bytes = counting != 0 ? sizeof kInstancesCount : sizeof kInstances;
  return counting != 0 ? kInstancesCount : kInstances;
}
