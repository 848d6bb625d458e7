// The SPIR-V of shaders/, compiled once for each structure (LSP_BASE_*) that a file may have, and for
// instances.
#pragma once

#include <cstdint>
#include <span>

namespace lsp::sample {

// In place of a structure, as in an lsp_vulkan_kind of instances.
constexpr uint32_t kInstancesShader = 0;

std::span<const uint32_t> eye_code(uint32_t base_structure);
std::span<const uint32_t> gather_code(uint32_t base_structure);
std::span<const uint32_t> light_code(uint32_t base_structure);
std::span<const uint32_t> show_code();

}  // namespace lsp::sample
