// The C++ side of the library in one header: files and instances that own what they need, traces of whole
// arrays, errors that are thrown. Header-only, C++17; an engine without exceptions takes lsp.h.
//
//   const lsp::SceneFile file("scene.lsp");
//   std::vector<LspRay> rays = ...;
//   std::vector<LspHit> hits(rays.size());
//   lsp::trace(file.scene(), {LSP_TRACE_APPROXIMATE, 0.0f}, rays, hits);
#pragma once

#include "lsp/error.hpp"
#include "lsp/instances.hpp"
#include "lsp/scene_file.hpp"
#include "lsp/view.hpp"

namespace lsp {

// lsp_trace of arrays of one size (vectors, arrays, spans), else LSP_ERROR_LIMIT. Adds to *counts unless it
// is null.
inline void trace(const lsp_scene& scene, const lsp_trace_options& options, View<const LspRay> rays,
                  View<LspHit> hits, lsp_trace_counts* counts = nullptr) {
  require_one_size(rays, hits);
  lsp_error error;
  throw_unless_ok(lsp_trace(&scene, &options, rays.data(), hits.data(), rays.size(), counts, &error), error);
}

}  // namespace lsp
