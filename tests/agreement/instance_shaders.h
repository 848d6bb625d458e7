// Runs shaders that include lsp.glsl with LSP_INSTANCES, for what the ready trace shader does not call. Both
// throw lsp::Failure where there is no Vulkan device (kUnsupported).
#pragma once

#include <vector>

#include "lsp/instances.hpp"

namespace lsp::test {

// lsp_instance_hit_offset of hits of these instances (instance_offset.comp).
std::vector<float> offsets_on_device(const Instances& instances, const std::vector<LspHit>& hits);

// lsp_trace of every ray in one asset alone: of ray i in asset i modulo their number (asset_trace.comp). The
// assets need what exact and approximate rays do.
std::vector<LspHit> hits_in_assets(const std::vector<const lsp_scene*>& assets,
                                   const lsp_trace_options& options, const std::vector<LspRay>& rays);

}  // namespace lsp::test
