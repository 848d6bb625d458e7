// The Vulkan device that a window shows on, its buffers and its command buffers: what an engine has already.
#pragma once

#include <volk.h>

#include <functional>
#include <string>
#include <vector>

#include "lsp/program.h"
#include "lsp/vk_make.hpp"

struct GLFWwindow;

namespace lsp::sample {

// Throws lsp::Failure unless `result` is VK_SUCCESS: kLimit when memory ran out, else kInternal.
void vk_check(VkResult result, const char* where);

class Gpu {
 public:
  // A device with a queue that computes and presents to the window: a GPU if there is one, else what there
  // is. `validation` switches the Khronos layer on, core and synchronization. Throws lsp::Failure
  // (kUnsupported).
  Gpu(GLFWwindow* window, bool validation);
  ~Gpu();
  Gpu(const Gpu&) = delete;
  Gpu& operator=(const Gpu&) = delete;

  int memory_type(uint32_t bits, VkMemoryPropertyFlags wanted) const;  // -1: none

  // Records, submits and waits: one thing at a time. `wait` (at transfers) and `signal` may be null.
  void run(const std::function<void(VkCommandBuffer)>& record, VkSemaphore wait = VK_NULL_HANDLE,
           VkSemaphore signal = VK_NULL_HANDLE);

  VkInstance instance = VK_NULL_HANDLE;
  VkSurfaceKHR surface = VK_NULL_HANDLE;
  VkPhysicalDevice physical = VK_NULL_HANDLE;
  VkPhysicalDeviceProperties properties{};
  VkDevice device = VK_NULL_HANDLE;
  uint32_t family = 0;
  VkQueue queue = VK_NULL_HANDLE;
  double seconds_per_tick = 0;        // of time stamps; 0: the queue has none
  std::vector<std::string> messages;  // of the validation layer; empty is clean

 private:
  void create_instance(bool validation);
  void choose_physical();
  void create_device();
  void destroy() noexcept;

  VkDebugUtilsMessengerEXT messenger_ = VK_NULL_HANDLE;
  VkCommandPool pool_ = VK_NULL_HANDLE;
  VkCommandBuffer commands_ = VK_NULL_HANDLE;
  VkFence fence_ = VK_NULL_HANDLE;
};

enum class Memory { kDevice, kHost };

// A buffer with memory of its own; kHost: mapped for as long as it lives.
class GpuBuffer {
 public:
  GpuBuffer() = default;
  GpuBuffer(Gpu& gpu, VkDeviceSize bytes, VkBufferUsageFlags usage, Memory memory);
  ~GpuBuffer();
  GpuBuffer(GpuBuffer&& other) noexcept { *this = std::move(other); }
  GpuBuffer& operator=(GpuBuffer&& other) noexcept;

  VkBuffer handle() const { return buffer_; }
  void* mapped() const { return mapped_; }

 private:
  Gpu* gpu_ = nullptr;
  VkBuffer buffer_ = VK_NULL_HANDLE;
  VkDeviceMemory memory_ = VK_NULL_HANDLE;
  void* mapped_ = nullptr;
};

// Everything written before in `from` is seen by what reads or writes in `to`.
void record_barrier(VkCommandBuffer commands, VkPipelineStageFlags from, VkAccessFlags written,
                    VkPipelineStageFlags to, VkAccessFlags used);

}  // namespace lsp::sample
