// An open scene's sections as buffers of a device, by import of the mapping or by upload; or those of several
// scenes in one buffer.
#pragma once

#include <array>
#include <span>
#include <string>
#include <vector>

#include "device.h"

namespace lsp {

// A scene's buffers in memory, by the plan's order: addresses, or places in the pool.
using BufferPlaces = std::array<VkDeviceAddress, LSP_VULKAN_MAX_BUFFERS>;

// Which buffers each of several scenes needs, and where these lie in one buffer for all, the pool.
struct PoolPlan {
  std::vector<lsp_vulkan_plan> buffers;
  std::vector<BufferPlaces> places;  // empty where there is no pool
  uint64_t bytes = 0;                // the pool's
};

class SceneBuffers {
 public:
  // Imports scene->bytes. Throws Failure(kUnsupported) where the device does not allow it; DeviceLost and
  // other failures of Vulkan as they come. The scene's bytes must outlive the buffers.
  static SceneBuffers import_mapping(Device& device, const lsp_scene& scene, const lsp_vulkan_plan& plan);

  // Copies the sections to memory of the device. With `staging` always through a ring of staging buffers,
  // else straight into device memory that the host sees where there is such memory.
  static SceneBuffers upload(Device& device, const lsp_scene& scene, const lsp_vulkan_plan& plan,
                             bool staging);

  // Of every scene, each its own SceneBuffers without handles: the sections of all lie in `pool`.
  static std::vector<SceneBuffers> upload_pool(Device& device, std::span<const lsp_scene* const> scenes,
                                               const PoolPlan& plan, bool staging, Buffer& pool);

  ~SceneBuffers();
  SceneBuffers(SceneBuffers&& other) noexcept;
  SceneBuffers& operator=(SceneBuffers&& other) = delete;

  const lsp_vulkan_plan& plan() const { return plan_; }
  const VkBuffer* handles() const { return handles_; }
  // The buffer with the sections' addresses; null where the plan does without.
  VkBuffer addresses() const { return addresses_.handle(); }
  // Addresses of the buffers, or their places in the pool, in the plan's order; zero where there is neither.
  const VkDeviceAddress* places() const { return places_.data(); }
  uint64_t bytes_imported() const { return bytes_imported_; }
  uint64_t bytes_uploaded() const { return bytes_uploaded_; }

 private:
  SceneBuffers(Device& device, const lsp_vulkan_plan& plan) : device_(&device), plan_(plan) {}
  void write_addresses();

  Device* device_;
  lsp_vulkan_plan plan_{};
  VkBuffer handles_[LSP_VULKAN_MAX_BUFFERS]{};
  BufferPlaces places_{};
  Buffer addresses_;
  std::vector<Buffer> owned_;                 // upload: the buffers behind the handles
  VkDeviceMemory imported_ = VK_NULL_HANDLE;  // import: the one memory behind all buffers
  uint64_t bytes_imported_ = 0;
  uint64_t bytes_uploaded_ = 0;
};

}  // namespace lsp
