// The SPIR-V of shaders/, compiled once for each structure (LSP_BASE_*) that a file may have, and for
// instances.
#pragma once

#include <cstdint>
#include <span>

namespace lsp::sample {

enum class Kernel { kEye, kGather, kLight, kShow };

// `base_structure` is that of an lsp_vulkan_kind, 0 of one of instances; kShow has the same for all.
std::span<const uint32_t> shader_code(Kernel kernel, uint32_t base_structure);

}  // namespace lsp::sample
