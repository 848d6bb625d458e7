// Runs instance_offset.comp: lsp_instance_hit_offset as a shader has it.
#pragma once

#include <vector>

#include "lsp/instances.hpp"

namespace lsp::test {

// The offsets of hits of these instances. Throws lsp::Failure where there is no Vulkan device
// (kUnsupported).
std::vector<float> offsets_on_device(const Instances& instances, const std::vector<LspHit>& hits);

}  // namespace lsp::test
