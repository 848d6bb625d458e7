#include "gpu.h"

#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>

#include <algorithm>
#include <utility>

#include "lsp/vk_start.hpp"

namespace lsp::sample {
namespace {

VKAPI_ATTR VkBool32 VKAPI_CALL on_message(VkDebugUtilsMessageSeverityFlagBitsEXT,
                                          VkDebugUtilsMessageTypeFlagsEXT,
                                          const VkDebugUtilsMessengerCallbackDataEXT* data, void* gpu) {
  static_cast<Gpu*>(gpu)->messages.emplace_back(data->pMessage);
  return VK_FALSE;
}

[[noreturn]] void unsupported(const std::string& message) { throw Failure(Exit::kUnsupported, "", message); }

}  // namespace

void vk_check(VkResult result, const char* where) {
  if (result == VK_SUCCESS) return;
  if (result == VK_ERROR_OUT_OF_DEVICE_MEMORY || result == VK_ERROR_OUT_OF_HOST_MEMORY)
    throw Failure(Exit::kLimit, "", std::string("no memory left in ") + where + "; make the window smaller");
  throw Failure(Exit::kInternal, "", std::string(where) + " failed with VkResult " + std::to_string(result));
}

Gpu::Gpu(GLFWwindow* window, bool validation) {
  try {
    create_instance(validation);
    vk_check(glfwCreateWindowSurface(instance, window, nullptr, &surface), "glfwCreateWindowSurface");
    choose_physical();
    create_device();
  } catch (...) {
    destroy();
    throw;
  }
}

Gpu::~Gpu() { destroy(); }

void Gpu::destroy() noexcept {
  if (device != VK_NULL_HANDLE) {
    vkDeviceWaitIdle(device);
    vkDestroyFence(device, fence_, nullptr);
    vkDestroyCommandPool(device, pool_, nullptr);
    vkDestroyDevice(device, nullptr);
  }
  if (surface != VK_NULL_HANDLE) vkDestroySurfaceKHR(instance, surface, nullptr);
  if (messenger_ != VK_NULL_HANDLE) vkDestroyDebugUtilsMessengerEXT(instance, messenger_, nullptr);
  if (instance != VK_NULL_HANDLE) vkDestroyInstance(instance, nullptr);
}

void Gpu::create_instance(bool validation) {
  if (volkInitialize() != VK_SUCCESS)
    unsupported("there is no Vulkan loader; install libvulkan1, or use lsp-render");
  uint32_t count = 0;
  const char** needed = glfwGetRequiredInstanceExtensions(&count);
  if (needed == nullptr)
    unsupported("no Vulkan driver shows on this display; install mesa-vulkan-drivers, or use lsp-render");
  std::vector<const char*> extensions(needed, needed + count);

  auto application = vk_make<VkApplicationInfo>(VK_STRUCTURE_TYPE_APPLICATION_INFO);
  application.pApplicationName = "lsp-view";
  application.apiVersion = VK_API_VERSION_1_1;
  const VkValidationFeatureEnableEXT enabled = VK_VALIDATION_FEATURE_ENABLE_SYNCHRONIZATION_VALIDATION_EXT;
  auto features = vk_make<VkValidationFeaturesEXT>(VK_STRUCTURE_TYPE_VALIDATION_FEATURES_EXT);
  features.enabledValidationFeatureCount = 1;
  features.pEnabledValidationFeatures = &enabled;
  VkDebugUtilsMessengerCreateInfoEXT messenger = messenger_info(on_message, this);
  auto info = vk_make<VkInstanceCreateInfo>(VK_STRUCTURE_TYPE_INSTANCE_CREATE_INFO);
  info.pApplicationInfo = &application;
  const char* layer = "VK_LAYER_KHRONOS_validation";
  if (validation) {
    extensions.push_back(VK_EXT_DEBUG_UTILS_EXTENSION_NAME);
    extensions.push_back(VK_EXT_VALIDATION_FEATURES_EXTENSION_NAME);
    info.enabledLayerCount = 1;
    info.ppEnabledLayerNames = &layer;
    messenger.pNext = &features;
    info.pNext = &messenger;
  }
  info.enabledExtensionCount = static_cast<uint32_t>(extensions.size());
  info.ppEnabledExtensionNames = extensions.data();
  const VkResult result = vkCreateInstance(&info, nullptr, &instance);
  if (result == VK_ERROR_LAYER_NOT_PRESENT) unsupported("the validation layer is not installed");
  if (result == VK_ERROR_INCOMPATIBLE_DRIVER)
    unsupported("there is no Vulkan driver; install mesa-vulkan-drivers");
  vk_check(result, "vkCreateInstance");
  volkLoadInstance(instance);
  if (!validation) return;
  messenger.pNext = nullptr;
  vk_check(vkCreateDebugUtilsMessengerEXT(instance, &messenger, nullptr, &messenger_),
           "vkCreateDebugUtilsMessengerEXT");
}

void Gpu::choose_physical() {
  uint32_t count = 0;
  vkEnumeratePhysicalDevices(instance, &count, nullptr);
  std::vector<VkPhysicalDevice> devices(count);
  vkEnumeratePhysicalDevices(instance, &count, devices.data());
  int best = 100;
  for (const VkPhysicalDevice candidate : devices) {
    VkPhysicalDeviceProperties found;
    vkGetPhysicalDeviceProperties(candidate, &found);
    if (found.apiVersion < VK_API_VERSION_1_1 || device_rank(found.deviceType) >= best) continue;
    uint32_t families = 0;
    vkGetPhysicalDeviceQueueFamilyProperties(candidate, &families, nullptr);
    std::vector<VkQueueFamilyProperties> queues(families);
    vkGetPhysicalDeviceQueueFamilyProperties(candidate, &families, queues.data());
    for (uint32_t i = 0; i < families; ++i) {
      VkBool32 presents = VK_FALSE;
      vkGetPhysicalDeviceSurfaceSupportKHR(candidate, i, surface, &presents);
      if (presents == VK_FALSE || (queues[i].queueFlags & VK_QUEUE_COMPUTE_BIT) == 0) continue;
      best = device_rank(found.deviceType);
      physical = candidate;
      properties = found;
      family = i;
      const bool timed = queues[i].timestampValidBits != 0;
      seconds_per_tick = timed ? static_cast<double>(found.limits.timestampPeriod) * 1e-9 : 0.0;
      break;
    }
  }
  if (physical == VK_NULL_HANDLE)
    unsupported("no Vulkan 1.1 device computes and shows on this display; install mesa-vulkan-drivers");
}

void Gpu::create_device() {
  const float priority = 1.0f;
  auto queue_info = vk_make<VkDeviceQueueCreateInfo>(VK_STRUCTURE_TYPE_DEVICE_QUEUE_CREATE_INFO);
  queue_info.queueFamilyIndex = family;
  queue_info.queueCount = 1;
  queue_info.pQueuePriorities = &priority;
  // Files come from anywhere: an index that leads out of a section must not lead out of its buffer.
  VkPhysicalDeviceFeatures available{};
  vkGetPhysicalDeviceFeatures(physical, &available);
  VkPhysicalDeviceFeatures features{};
  features.robustBufferAccess = available.robustBufferAccess;
  const char* swapchain = VK_KHR_SWAPCHAIN_EXTENSION_NAME;
  auto info = vk_make<VkDeviceCreateInfo>(VK_STRUCTURE_TYPE_DEVICE_CREATE_INFO);
  info.queueCreateInfoCount = 1;
  info.pQueueCreateInfos = &queue_info;
  info.enabledExtensionCount = 1;
  info.ppEnabledExtensionNames = &swapchain;
  info.pEnabledFeatures = &features;
  vk_check(vkCreateDevice(physical, &info, nullptr, &device), "vkCreateDevice");
  vkGetDeviceQueue(device, family, 0, &queue);

  auto pool_info = vk_make<VkCommandPoolCreateInfo>(VK_STRUCTURE_TYPE_COMMAND_POOL_CREATE_INFO);
  pool_info.flags = VK_COMMAND_POOL_CREATE_RESET_COMMAND_BUFFER_BIT;
  pool_info.queueFamilyIndex = family;
  vk_check(vkCreateCommandPool(device, &pool_info, nullptr, &pool_), "vkCreateCommandPool");
  auto commands_info = vk_make<VkCommandBufferAllocateInfo>(VK_STRUCTURE_TYPE_COMMAND_BUFFER_ALLOCATE_INFO);
  commands_info.commandPool = pool_;
  commands_info.commandBufferCount = 1;
  vk_check(vkAllocateCommandBuffers(device, &commands_info, &commands_), "vkAllocateCommandBuffers");
  const auto fence_info = vk_make<VkFenceCreateInfo>(VK_STRUCTURE_TYPE_FENCE_CREATE_INFO);
  vk_check(vkCreateFence(device, &fence_info, nullptr, &fence_), "vkCreateFence");
}

int Gpu::memory_type(uint32_t bits, VkMemoryPropertyFlags wanted) const {
  VkPhysicalDeviceMemoryProperties memory;
  vkGetPhysicalDeviceMemoryProperties(physical, &memory);
  for (uint32_t i = 0; i < memory.memoryTypeCount; ++i)
    if ((bits >> i & 1u) != 0 && (memory.memoryTypes[i].propertyFlags & wanted) == wanted)
      return static_cast<int>(i);
  return -1;
}

void Gpu::run(const std::function<void(VkCommandBuffer)>& record, VkSemaphore wait, VkSemaphore signal) {
  auto begin = vk_make<VkCommandBufferBeginInfo>(VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO);
  begin.flags = VK_COMMAND_BUFFER_USAGE_ONE_TIME_SUBMIT_BIT;
  vk_check(vkBeginCommandBuffer(commands_, &begin), "vkBeginCommandBuffer");
  record(commands_);
  vk_check(vkEndCommandBuffer(commands_), "vkEndCommandBuffer");
  const VkPipelineStageFlags at = VK_PIPELINE_STAGE_TRANSFER_BIT;
  auto submit = vk_make<VkSubmitInfo>(VK_STRUCTURE_TYPE_SUBMIT_INFO);
  submit.commandBufferCount = 1;
  submit.pCommandBuffers = &commands_;
  submit.waitSemaphoreCount = wait != VK_NULL_HANDLE ? 1 : 0;
  submit.pWaitSemaphores = &wait;
  submit.pWaitDstStageMask = &at;
  submit.signalSemaphoreCount = signal != VK_NULL_HANDLE ? 1 : 0;
  submit.pSignalSemaphores = &signal;
  vk_check(vkQueueSubmit(queue, 1, &submit, fence_), "vkQueueSubmit");
  vk_check(vkWaitForFences(device, 1, &fence_, VK_TRUE, UINT64_MAX), "vkWaitForFences");
  vk_check(vkResetFences(device, 1, &fence_), "vkResetFences");
}

GpuBuffer::GpuBuffer(Gpu& gpu, VkDeviceSize bytes, VkBufferUsageFlags usage, Memory memory) : gpu_(&gpu) {
  try {
    auto info = vk_make<VkBufferCreateInfo>(VK_STRUCTURE_TYPE_BUFFER_CREATE_INFO);
    info.size = std::max<VkDeviceSize>(bytes, 4);
    info.usage = usage;
    vk_check(vkCreateBuffer(gpu.device, &info, nullptr, &buffer_), "vkCreateBuffer");
    VkMemoryRequirements needs;
    vkGetBufferMemoryRequirements(gpu.device, buffer_, &needs);
    const VkMemoryPropertyFlags wanted = memory == Memory::kDevice ? VK_MEMORY_PROPERTY_DEVICE_LOCAL_BIT
                                                                   : VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT |
                                                                         VK_MEMORY_PROPERTY_HOST_COHERENT_BIT;
    auto allocation = vk_make<VkMemoryAllocateInfo>(VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_INFO);
    allocation.allocationSize = needs.size;
    allocation.memoryTypeIndex =
        static_cast<uint32_t>(std::max(gpu.memory_type(needs.memoryTypeBits, wanted), 0));
    vk_check(vkAllocateMemory(gpu.device, &allocation, nullptr, &memory_), "vkAllocateMemory");
    vk_check(vkBindBufferMemory(gpu.device, buffer_, memory_, 0), "vkBindBufferMemory");
    if (memory == Memory::kHost)
      vk_check(vkMapMemory(gpu.device, memory_, 0, VK_WHOLE_SIZE, 0, &mapped_), "vkMapMemory");
  } catch (...) {
    *this = GpuBuffer();
    throw;
  }
}

GpuBuffer::~GpuBuffer() {
  if (gpu_ == nullptr) return;
  vkDestroyBuffer(gpu_->device, buffer_, nullptr);
  vkFreeMemory(gpu_->device, memory_, nullptr);
}

GpuBuffer& GpuBuffer::operator=(GpuBuffer&& other) noexcept {
  std::swap(gpu_, other.gpu_);
  std::swap(buffer_, other.buffer_);
  std::swap(memory_, other.memory_);
  std::swap(mapped_, other.mapped_);
  return *this;
}

void record_barrier(VkCommandBuffer commands, VkPipelineStageFlags from, VkAccessFlags written,
                    VkPipelineStageFlags to, VkAccessFlags used) {
  auto barrier = vk_make<VkMemoryBarrier>(VK_STRUCTURE_TYPE_MEMORY_BARRIER);
  barrier.srcAccessMask = written;
  barrier.dstAccessMask = used;
  vkCmdPipelineBarrier(commands, from, to, 0, 1, &barrier, 0, nullptr, 0, nullptr);
}

}  // namespace lsp::sample
