// Hits of the CPU, and whether two tracers agree to the bit.
#pragma once

#include <gtest/gtest.h>

#include <cstring>
#include <vector>

#include "lsp/lsp.h"

namespace lsp::test {

inline std::vector<LspHit> trace(const lsp_scene& scene, const lsp_trace_options& options,
                                 const std::vector<LspRay>& rays, lsp_trace_counts* counts = nullptr) {
  std::vector<LspHit> hits(rays.size());
  lsp_error error;
  EXPECT_EQ(lsp_trace(&scene, &options, rays.data(), hits.data(), rays.size(), counts, &error), LSP_OK)
      << error.message;
  return hits;
}

inline bool same_bits(const std::vector<LspHit>& a, const std::vector<LspHit>& b) {
  return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(LspHit)) == 0;
}

}  // namespace lsp::test
