// Traces rays through instances on the CPU: small batches on the stack, assets by lsp_trace.
#include "error.h"
#include "instance_batch.h"
#include "trace_options.h"

namespace lsp {
namespace {

// Rays that walk together. Of 1, 16, 64, 128 and 256 this was the best in all: 1 is a tenth faster for
// shuffled rays and up to 1.4 times slower for others, more only takes more of the stack.
constexpr uint32_t kBatch = 64;
using Arrays = InstanceArrays<kBatch>;
static_assert(sizeof(Arrays) <= 20 * 1024);

}  // namespace
}  // namespace lsp

extern "C" lsp_status lsp_trace_instances(const lsp_instances* instances, const lsp_trace_options* options,
                                          uint32_t mask, const LspRay* rays, LspHit* hits, uint64_t count,
                                          lsp_trace_counts* counts, lsp_error* error) {
  if (const lsp_status status = lsp::check_options(*options, error); status != LSP_OK) return status;
  for (uint32_t i = 0; i < instances->asset_count; ++i) {
    lsp_error fault;
    if (const lsp_status status = lsp::check_scene(*instances->assets[i], *options, &fault); status != LSP_OK)
      return lsp::fail(error, status, 0, "asset %u: %s", i, fault.message);
  }
  const auto trace_asset = [instances, error](uint32_t asset, const lsp_trace_options& how,
                                              const LspRay* moved, LspHit* found, uint32_t size,
                                              lsp_trace_counts* counted) {
    return lsp_trace(instances->assets[asset], &how, moved, found, size, counted, error) == LSP_OK;
  };
  lsp::Arrays arrays;
  lsp::InstanceBatch batch(*instances, *options, mask, counts != nullptr, arrays, trace_asset);
  for (uint64_t first = 0; first < count; first += lsp::kBatch) {
    const auto size = static_cast<uint32_t>(std::min<uint64_t>(lsp::kBatch, count - first));
    if (!batch.trace(rays + first, hits + first, size)) return LSP_ERROR_UNSUPPORTED;
  }
  if (counts != nullptr) lsp_add_counts(counts, &batch.counts());
  return LSP_OK;
}

extern "C" float lsp_instance_hit_offset(const lsp_instances* instances, const LspHit* hit) {
  if (hit->primitive == LSP_NONE) return 0;
  const lsp_instance& instance = instances->records[LSP_HIT_INSTANCE(*hit)].instance;
  const float* t = instance.transform;
  // A plane moves along its normal n by the length of transposed(transform) n for every unit in object space.
  const lsp_float3 n = hit->normal;
  const float x = t[0] * n.x + t[4] * n.y + t[8] * n.z;
  const float y = t[1] * n.x + t[5] * n.y + t[9] * n.z;
  const float z = t[2] * n.x + t[6] * n.y + t[10] * n.z;
  return lsp_hit_offset(instances->assets[instance.asset], hit) * std::hypot(x, y, z);
}
