// Not installed.
#pragma once

#include <vulkan/vulkan_core.h>

namespace lsp {

// A Vulkan struct with its type set and all else zero.
template <typename Struct>
Struct vk_make(VkStructureType type) {
  Struct out{};
  out.sType = type;
  return out;
}

}  // namespace lsp
