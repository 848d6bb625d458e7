#include "fuzz_input.h"

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <vector>

#include "mutator.h"

namespace lsp::fuzz {

void found(const char* what) {
  std::fprintf(stderr, "finding: %s\n", what);
  std::abort();
}

void trace_rays(const lsp_scene& scene, uint64_t seed, size_t count, bool validated) {
  const LspHeader& header = *scene.header;
  corpus::Random random(seed);
  std::vector<LspRay> rays(count);
  std::vector<LspHit> hits(count), singly(count);
  const lsp_float3 &lo = header.bounds_min, &hi = header.bounds_max;
  for (LspRay& ray : rays) {
    ray.origin = {lo.x + (hi.x - lo.x) * random.unit(), lo.y + (hi.y - lo.y) * random.unit(),
                  lo.z + (hi.z - lo.z) * random.unit()};
    ray.direction = {random.unit() - 0.5f, random.unit() - 0.5f, random.unit() - 0.5f};
    if (random.below(4) == 0)
      ray.direction = {random.below(2) ? 1.0f : 0.0f, random.below(2) ? -1.0f : 0.0f, 0};
    ray.tmin = 0;
    ray.tmax = random.below(4) == 0 ? 1.0f : INFINITY;
    if (random.below(32) == 0) std::memset(&ray, static_cast<int>(random.below(256)), sizeof ray);
  }
  for (uint32_t flags = 0; flags <= LSP_TRACE_ALL_FLAGS; ++flags) {
    const bool able =
        header.required_features &
        (flags & LSP_TRACE_APPROXIMATE ? LSP_FEATURE_LINE_SPACES | LSP_FEATURE_CELLS | LSP_FEATURE_EXACT
                                       : LSP_FEATURE_EXACT);
    const uint32_t dial = random.below(2) ? LSP_TRACE_MAX_LOSS : 0u;
    const lsp_trace_options options{flags | dial, random.unit(), uint32_t(random.below(LSP_QUALITY_COUNT)),
                                    110 * random.unit() - 5};
    const bool sensible = dial == 0 || (options.max_loss >= 0 && options.max_loss <= 100);
    lsp_trace_counts counts{};
    const lsp_status status = lsp_trace(&scene, &options, rays.data(), hits.data(), count, nullptr, nullptr);
    if (status != (!sensible ? LSP_ERROR_INVALID : able ? LSP_OK : LSP_ERROR_UNSUPPORTED))
      found("lsp_trace does not do what the features promise");
    if (status != LSP_OK) continue;
    lsp_trace(&scene, &options, rays.data(), singly.data(), count, &counts, nullptr);
    if (validated && count != 0 && std::memcmp(hits.data(), singly.data(), count * sizeof(LspHit)) != 0)
      found("rays that are counted are answered otherwise");
    for (size_t i = 0; i < count; ++i) {
      const LspHit& hit = hits[i];
      if (validated && (hit.flags & LSP_HIT_INCOMPLETE)) found("a validated file's bounds stop a traversal");
      if (hit.primitive == LSP_NONE) continue;
      if (!(hit.t > rays[i].tmin && hit.t < rays[i].tmax)) found("a hit outside the ray");
    }
  }
}

}  // namespace lsp::fuzz

extern "C" size_t LLVMFuzzerMutate(uint8_t* data, size_t size, size_t max_size);

// One in three mutations is libFuzzer's own with the hashes made right again; the others know the format.
extern "C" size_t LLVMFuzzerCustomMutator(uint8_t* data, size_t size, size_t max_size, unsigned int seed) {
  lsp::corpus::Random random(seed);
  lsp::corpus::Bytes bytes;
  const auto assign = [&](size_t length) {
    const auto* first = reinterpret_cast<const std::byte*>(data);
    bytes.assign(first, first + length);
  };
  if (random.below(3) == 0) {
    assign(LLVMFuzzerMutate(data, size, max_size));
    if (random.below(8) != 0) lsp::corpus::repair_hashes(bytes);
  } else {
    assign(size);
    lsp::corpus::mutate(bytes, random, max_size);
  }
  if (bytes.size() > max_size) bytes.resize(max_size);
  if (!bytes.empty()) std::memcpy(data, bytes.data(), bytes.size());
  return bytes.size();
}
