// Instance, device, queue and memory, each released with its C++ object.
#pragma once

#include <mutex>
#include <string>
#include <vector>

#define VK_NO_PROTOTYPES
#include <volk.h>

#include "lsp/program.h"
#include "lsp/vk_make.hpp"
#include "lsp/vulkan_device.hpp"

namespace lsp {

// The device was lost: the one failure after which another way of loading is worth a try on a new device.
class DeviceLost : public Failure {
 public:
  explicit DeviceLost(const char* where)
      : Failure(Exit::kInternal, "", std::string("the Vulkan device was lost in ") + where) {}
};

// Throws unless `result` is VK_SUCCESS: DeviceLost, kLimit when memory ran out, kInternal otherwise.
void check(VkResult result, const char* where);

// Memory that the host writes and reads.
constexpr VkMemoryPropertyFlags kHostMemory =
    VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT | VK_MEMORY_PROPERTY_HOST_COHERENT_BIT;

class Device {
 public:
  explicit Device(const VulkanOptions& options);
  ~Device();
  Device(const Device&) = delete;
  Device& operator=(const Device&) = delete;

  // Loads the Vulkan loader and lists the devices there are. False: none, and *why says what is missing.
  static bool any(std::string* why);

  // Index of a memory type out of `bits` that has all of `need`, and all of `prefer` if there is one; -1:
  // none.
  int memory_type(uint32_t bits, VkMemoryPropertyFlags need, VkMemoryPropertyFlags prefer) const;

  VkInstance instance = VK_NULL_HANDLE;
  VkPhysicalDevice physical = VK_NULL_HANDLE;
  VkDevice handle = VK_NULL_HANDLE;
  VkQueue queue = VK_NULL_HANDLE;
  VkCommandPool pool = VK_NULL_HANDLE;
  VolkDeviceTable vk{};
  lsp_vulkan_functions functions{};
  lsp_vulkan_limits limits{};
  VkPhysicalDeviceProperties properties{};
  VkPhysicalDeviceMemoryProperties memory{};
  bool shares_memory = false;     // with the host: importing costs nothing at run time
  uint32_t address_uses = 0;      // LSP_USE_ADDRESSES_*: whether sections may be read through addresses
  bool imports = false;           // VK_EXT_external_memory_host is on
  double seconds_per_tick = 0.0;  // of timestamps, 0: the queue has none

  // Of the validation layer.
  mutable std::mutex messages_mutex;
  std::vector<std::string> messages;

 private:
  void create_instance(const VulkanOptions& options);
  void choose_physical(const VulkanOptions& options);
  void create_device(const VulkanOptions& options);
  void destroy() noexcept;
  VkDebugUtilsMessengerEXT messenger_ = VK_NULL_HANDLE;
  uint32_t family_ = 0;
};

// A command buffer and the fence that says when the device is done with it.
class Commands {
 public:
  explicit Commands(Device& device);
  ~Commands();  // waits
  Commands(const Commands&) = delete;
  Commands& operator=(const Commands&) = delete;

  // Waits for what was submitted before, and begins anew.
  VkCommandBuffer record();
  // What was recorded.
  void submit();
  // For what was submitted, if anything was.
  void wait();

 private:
  void destroy() noexcept;
  Device& device_;
  VkCommandBuffer commands_ = VK_NULL_HANDLE;
  VkFence fence_ = VK_NULL_HANDLE;
  bool submitted_ = false;
};

// A buffer with memory of its own.
class Buffer {
 public:
  Buffer() = default;
  // Host-visible where `need` says so, and then mapped for as long as it lives. Size 0 is made 4.
  Buffer(Device& device, VkDeviceSize bytes, VkBufferUsageFlags usage, VkMemoryPropertyFlags need,
         VkMemoryPropertyFlags prefer);
  ~Buffer();
  Buffer(Buffer&& other) noexcept { *this = std::move(other); }
  Buffer& operator=(Buffer&& other) noexcept;

  VkBuffer handle() const { return buffer_; }
  void* mapped() const { return mapped_; }  // null: not host-visible
  VkDeviceSize bytes() const { return bytes_; }

 private:
  void destroy() noexcept;
  Device* device_ = nullptr;
  VkBuffer buffer_ = VK_NULL_HANDLE;
  VkDeviceMemory memory_ = VK_NULL_HANDLE;
  void* mapped_ = nullptr;
  VkDeviceSize bytes_ = 0;
};

}  // namespace lsp
