// A file of the corpus as a tracer takes it, and rays to trace it with.
#pragma once

#include <lsp/lsp.h>

#include <array>
#include <cmath>
#include <memory>

#include "aligned_bytes.h"
#include "image.h"
#include "mutator.h"

namespace lsp::corpus {

inline constexpr uint64_t kMemoryLimit = uint64_t{1} << 26;

// In memory, unpacked when it is packed.
struct Opened {
  lsp_status status = LSP_OK;
  lsp_error error{};
  std::unique_ptr<AlignedBytes> bytes;
  lsp_scene scene{};
};

inline Opened open(const Bytes& file) {
  Opened opened;
  opened.bytes = std::make_unique<AlignedBytes>(file.data(), file.size());
  opened.status = lsp_open(opened.bytes->data(), file.size(), &opened.scene, &opened.error);
  if (opened.status != LSP_ERROR_UNSUPPORTED) return opened;
  uint64_t size = 0;
  const lsp_status status = lsp_unpacked_size(opened.bytes->data(), file.size(), &size, &opened.error);
  if (status != LSP_OK || size > kMemoryLimit) return opened;
  auto raw = std::make_unique<AlignedBytes>(size);
  opened.status = lsp_unpack(opened.bytes->data(), file.size(), raw->data(), size, &opened.error);
  if (opened.status != LSP_OK) return opened;
  opened.bytes = std::move(raw);
  opened.status = lsp_open(opened.bytes->data(), opened.bytes->size(), &opened.scene, &opened.error);
  return opened;
}

// Sixteen rays through the scene's bounds: thirteen at random, two along axes, one invalid.
inline std::array<LspRay, 16> rays_through(const LspHeader& header) {
  std::array<LspRay, 16> rays;
  Random random(42);
  const lsp_float3 &lo = header.bounds_min, &hi = header.bounds_max;
  for (LspRay& ray : rays) {
    ray.origin = {lo.x + (hi.x - lo.x) * random.unit(), lo.y + (hi.y - lo.y) * random.unit(),
                  lo.z + (hi.z - lo.z) * random.unit()};
    ray.direction = {random.unit() - 0.5f, random.unit() - 0.5f, random.unit() - 0.5f};
    ray.tmin = 0;
    ray.tmax = INFINITY;
  }
  rays[0].direction = {1, 0, 0};
  rays[1].direction = {0, -1, 0};
  rays[2].direction = {0, 0, 0};
  return rays;
}

}  // namespace lsp::corpus
