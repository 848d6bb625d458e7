// Vulkan's functions are loaded by volk at run time: programs start, and trace on the CPU, without Vulkan.
#define VOLK_IMPLEMENTATION
#include "device.h"

#include <algorithm>
#include <cstring>
#include <utility>

#include "lsp/vk_start.hpp"

namespace lsp {
namespace {

constexpr uint32_t kApiVersion = VK_API_VERSION_1_1;           // that is needed
constexpr uint32_t kAddressesApiVersion = VK_API_VERSION_1_2;  // for buffer addresses
constexpr const char* kValidationLayer = "VK_LAYER_KHRONOS_validation";

VkResult initialize_loader() {
  static const VkResult result = volkInitialize();
  return result;
}

VKAPI_ATTR VkBool32 VKAPI_CALL on_message(VkDebugUtilsMessageSeverityFlagBitsEXT,
                                          VkDebugUtilsMessageTypeFlagsEXT,
                                          const VkDebugUtilsMessengerCallbackDataEXT* data, void* user) {
  auto* device = static_cast<Device*>(user);
  const std::lock_guard lock(device->messages_mutex);
  device->messages.emplace_back(data->pMessage);
  return VK_FALSE;
}

// The first queue family that computes; -1: none.
int compute_family(VkPhysicalDevice physical, VkQueueFamilyProperties* chosen) {
  uint32_t count = 0;
  vkGetPhysicalDeviceQueueFamilyProperties(physical, &count, nullptr);
  std::vector<VkQueueFamilyProperties> families(count);
  vkGetPhysicalDeviceQueueFamilyProperties(physical, &count, families.data());
  for (uint32_t i = 0; i < count; ++i) {
    if ((families[i].queueFlags & VK_QUEUE_COMPUTE_BIT) != 0) {
      *chosen = families[i];
      return static_cast<int>(i);
    }
  }
  return -1;
}

bool has_extension(VkPhysicalDevice physical, const char* name) {
  uint32_t count = 0;
  vkEnumerateDeviceExtensionProperties(physical, nullptr, &count, nullptr);
  std::vector<VkExtensionProperties> extensions(count);
  vkEnumerateDeviceExtensionProperties(physical, nullptr, &count, extensions.data());
  return std::any_of(extensions.begin(), extensions.end(),
                     [&](const VkExtensionProperties& e) { return strcmp(e.extensionName, name) == 0; });
}

std::vector<VkPhysicalDevice> physical_devices(VkInstance instance) {
  uint32_t count = 0;
  if (vkEnumeratePhysicalDevices(instance, &count, nullptr) != VK_SUCCESS) return {};
  std::vector<VkPhysicalDevice> devices(count);
  if (vkEnumeratePhysicalDevices(instance, &count, devices.data()) != VK_SUCCESS) return {};
  return devices;
}

VkInstanceCreateInfo instance_info(const VkApplicationInfo* application) {
  auto info = vk_make<VkInstanceCreateInfo>(VK_STRUCTURE_TYPE_INSTANCE_CREATE_INFO);
  info.pApplicationInfo = application;
  return info;
}

VkApplicationInfo application_info() {
  auto info = vk_make<VkApplicationInfo>(VK_STRUCTURE_TYPE_APPLICATION_INFO);
  info.pApplicationName = "lsp";
  info.apiVersion = kAddressesApiVersion;
  return info;
}

[[noreturn]] void unsupported(const std::string& message) { throw Failure(Exit::kUnsupported, "", message); }

}  // namespace

void check(VkResult result, const char* where) {
  if (result == VK_SUCCESS) return;
  if (result == VK_ERROR_DEVICE_LOST) throw DeviceLost(where);
  if (result == VK_ERROR_OUT_OF_DEVICE_MEMORY || result == VK_ERROR_OUT_OF_HOST_MEMORY) {
    throw Failure(Exit::kLimit, "", std::string("no memory left in ") + where + "; trace it on the CPU");
  }
  throw Failure(Exit::kInternal, "", std::string(where) + " failed with VkResult " + std::to_string(result));
}

bool Device::any(std::string* why) {
  std::string reason;
  if (initialize_loader() != VK_SUCCESS) {
    reason = "there is no Vulkan loader (install libvulkan1)";
  } else {
    const VkApplicationInfo application = application_info();
    const VkInstanceCreateInfo info = instance_info(&application);
    VkInstance instance = VK_NULL_HANDLE;
    if (vkCreateInstance(&info, nullptr, &instance) != VK_SUCCESS) {
      reason = "there is no Vulkan driver (install mesa-vulkan-drivers)";
    } else {
      volkLoadInstanceOnly(instance);
      if (physical_devices(instance).empty())
        reason = "there is no Vulkan device (install mesa-vulkan-drivers)";
      vkDestroyInstance(instance, nullptr);
    }
  }
  if (why != nullptr) *why = reason;
  return reason.empty();
}

Device::Device(const VulkanOptions& options) {
  try {
    create_instance(options);
    choose_physical(options);
    create_device(options);
  } catch (...) {
    destroy();
    throw;
  }
}

Device::~Device() { destroy(); }

void Device::destroy() noexcept {
  if (handle != VK_NULL_HANDLE) {
    vk.vkDeviceWaitIdle(handle);
    if (pool != VK_NULL_HANDLE) vk.vkDestroyCommandPool(handle, pool, nullptr);
    vk.vkDestroyDevice(handle, nullptr);
  }
  if (messenger_ != VK_NULL_HANDLE) vkDestroyDebugUtilsMessengerEXT(instance, messenger_, nullptr);
  if (instance != VK_NULL_HANDLE) vkDestroyInstance(instance, nullptr);
}

void Device::create_instance(const VulkanOptions& options) {
  if (initialize_loader() != VK_SUCCESS)
    unsupported("there is no Vulkan loader; install libvulkan1 or use the CPU");
  const VkApplicationInfo application = application_info();
  VkInstanceCreateInfo info = instance_info(&application);
  const VkValidationFeatureEnableEXT enabled = VK_VALIDATION_FEATURE_ENABLE_SYNCHRONIZATION_VALIDATION_EXT;
  auto features = vk_make<VkValidationFeaturesEXT>(VK_STRUCTURE_TYPE_VALIDATION_FEATURES_EXT);
  features.enabledValidationFeatureCount = 1;
  features.pEnabledValidationFeatures = &enabled;
  VkDebugUtilsMessengerCreateInfoEXT messenger = messenger_info(on_message, this);
  messenger.pNext = &features;
  const char* extensions[] = {VK_EXT_DEBUG_UTILS_EXTENSION_NAME, VK_EXT_VALIDATION_FEATURES_EXTENSION_NAME};
  if (options.validation) {
    info.enabledLayerCount = 1;
    info.ppEnabledLayerNames = &kValidationLayer;
    info.enabledExtensionCount = 2;
    info.ppEnabledExtensionNames = extensions;
    info.pNext = &messenger;
  }
  const VkResult result = vkCreateInstance(&info, nullptr, &instance);
  if (result == VK_ERROR_LAYER_NOT_PRESENT) unsupported("the validation layer is not installed");
  if (result == VK_ERROR_INCOMPATIBLE_DRIVER) {
    unsupported("there is no Vulkan driver; install mesa-vulkan-drivers or use the CPU");
  }
  check(result, "vkCreateInstance");
  volkLoadInstanceOnly(instance);
  if (options.validation) {
    messenger.pNext = nullptr;
    check(vkCreateDebugUtilsMessengerEXT(instance, &messenger, nullptr, &messenger_),
          "vkCreateDebugUtilsMessengerEXT");
  }
}

void Device::choose_physical(const VulkanOptions& options) {
  int best = 100;
  std::string seen;
  for (const VkPhysicalDevice candidate : physical_devices(instance)) {
    VkPhysicalDeviceProperties found;
    vkGetPhysicalDeviceProperties(candidate, &found);
    seen += (seen.empty() ? "" : ", ") + std::string(found.deviceName);
    if (std::string(found.deviceName).find(options.device) == std::string::npos) continue;
    VkQueueFamilyProperties queue_properties{};
    const int family = compute_family(candidate, &queue_properties);
    if (found.apiVersion < kApiVersion || family < 0 || device_rank(found.deviceType) >= best) continue;
    best = device_rank(found.deviceType);
    physical = candidate;
    properties = found;
    family_ = static_cast<uint32_t>(family);
    const bool timed = queue_properties.timestampValidBits != 0;
    seconds_per_tick = timed ? static_cast<double>(found.limits.timestampPeriod) * 1e-9 : 0.0;
  }
  if (physical != VK_NULL_HANDLE) return;
  if (seen.empty()) unsupported("there is no Vulkan device; install mesa-vulkan-drivers or use the CPU");
  unsupported("no Vulkan 1.1 device with compute is called \"" + options.device + "\"; there are: " + seen);
}

void Device::create_device(const VulkanOptions& options) {
  shares_memory = !options.discrete && (properties.deviceType == VK_PHYSICAL_DEVICE_TYPE_CPU ||
                                        properties.deviceType == VK_PHYSICAL_DEVICE_TYPE_INTEGRATED_GPU);
  imports = has_extension(physical, VK_EXT_EXTERNAL_MEMORY_HOST_EXTENSION_NAME);
  limits.max_storage_buffer_range =
      std::min(properties.limits.maxStorageBufferRange, options.max_storage_buffer_range);
  limits.max_group_count = properties.limits.maxComputeWorkGroupCount[0];
  // What a device does not know stays zero: no import, no largest buffer.
  auto host = vk_make<VkPhysicalDeviceExternalMemoryHostPropertiesEXT>(
      VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_EXTERNAL_MEMORY_HOST_PROPERTIES_EXT);
  auto maintenance = vk_make<VkPhysicalDeviceMaintenance4PropertiesKHR>(
      VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_MAINTENANCE_4_PROPERTIES_KHR);
  auto all = vk_make<VkPhysicalDeviceProperties2>(VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_PROPERTIES_2);
  if (imports) all.pNext = &host;
  if (has_extension(physical, VK_KHR_MAINTENANCE_4_EXTENSION_NAME)) {
    maintenance.pNext = all.pNext;
    all.pNext = &maintenance;
  }
  vkGetPhysicalDeviceProperties2(physical, &all);
  limits.import_alignment = host.minImportedHostPointerAlignment;
  limits.max_buffer_size = maintenance.maxBufferSize;
  vkGetPhysicalDeviceMemoryProperties(physical, &memory);

  const float priority = 1.0f;
  auto queue_info = vk_make<VkDeviceQueueCreateInfo>(VK_STRUCTURE_TYPE_DEVICE_QUEUE_CREATE_INFO);
  queue_info.queueFamilyIndex = family_;
  queue_info.queueCount = 1;
  queue_info.pQueuePriorities = &priority;
  // Files come from anywhere: an index that leads out of a section must not lead out of its buffer.
  VkPhysicalDeviceFeatures available{};
  vkGetPhysicalDeviceFeatures(physical, &available);
  VkPhysicalDeviceFeatures features{};
  features.robustBufferAccess = available.robustBufferAccess;
  std::vector<const char*> extensions;
  if (imports) extensions.push_back(VK_EXT_EXTERNAL_MEMORY_HOST_EXTENSION_NAME);
  auto addresses = vk_make<VkPhysicalDeviceBufferDeviceAddressFeatures>(
      VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_BUFFER_DEVICE_ADDRESS_FEATURES);
  if (properties.apiVersion >= kAddressesApiVersion) {
    auto all = vk_make<VkPhysicalDeviceFeatures2>(VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_FEATURES_2);
    all.pNext = &addresses;
    vkGetPhysicalDeviceFeatures2(physical, &all);
    addresses.bufferDeviceAddressCaptureReplay = VK_FALSE;
    addresses.bufferDeviceAddressMultiDevice = VK_FALSE;
    if (addresses.bufferDeviceAddress == VK_TRUE)
      address_uses = options.addresses ? LSP_USE_ADDRESSES_ALWAYS : LSP_USE_ADDRESSES_IF_NEEDED;
  }
  if (options.addresses && address_uses == 0) {
    unsupported("the device has no buffer addresses");
  }
  auto info = vk_make<VkDeviceCreateInfo>(VK_STRUCTURE_TYPE_DEVICE_CREATE_INFO);
  info.queueCreateInfoCount = 1;
  info.pQueueCreateInfos = &queue_info;
  if (address_uses != 0) info.pNext = &addresses;
  info.enabledExtensionCount = static_cast<uint32_t>(extensions.size());
  info.ppEnabledExtensionNames = extensions.data();
  info.pEnabledFeatures = &features;
  check(vkCreateDevice(physical, &info, nullptr, &handle), "vkCreateDevice");
  volkLoadDeviceTable(&vk, handle);
  lsp_error error;
  if (lsp_vulkan_load_functions(handle, vkGetDeviceProcAddr, &functions, &error) != LSP_OK)
    unsupported(error.message);
  vk.vkGetDeviceQueue(handle, family_, 0, &queue);

  auto pool_info = vk_make<VkCommandPoolCreateInfo>(VK_STRUCTURE_TYPE_COMMAND_POOL_CREATE_INFO);
  pool_info.flags = VK_COMMAND_POOL_CREATE_RESET_COMMAND_BUFFER_BIT;
  pool_info.queueFamilyIndex = family_;
  check(vk.vkCreateCommandPool(handle, &pool_info, nullptr, &pool), "vkCreateCommandPool");
}

int Device::memory_type(uint32_t bits, VkMemoryPropertyFlags need, VkMemoryPropertyFlags prefer) const {
  for (const VkMemoryPropertyFlags wanted : {need | prefer, need}) {
    for (uint32_t i = 0; i < memory.memoryTypeCount; ++i) {
      if ((bits & (1u << i)) != 0 && (memory.memoryTypes[i].propertyFlags & wanted) == wanted) {
        return static_cast<int>(i);
      }
    }
  }
  return -1;
}

Commands::Commands(Device& device) : device_(device) {
  try {
    auto info = vk_make<VkCommandBufferAllocateInfo>(VK_STRUCTURE_TYPE_COMMAND_BUFFER_ALLOCATE_INFO);
    info.commandPool = device.pool;
    info.commandBufferCount = 1;
    check(device.vk.vkAllocateCommandBuffers(device.handle, &info, &commands_), "vkAllocateCommandBuffers");
    const auto fence = vk_make<VkFenceCreateInfo>(VK_STRUCTURE_TYPE_FENCE_CREATE_INFO);
    check(device.vk.vkCreateFence(device.handle, &fence, nullptr, &fence_), "vkCreateFence");
  } catch (...) {
    destroy();
    throw;
  }
}

Commands::~Commands() { destroy(); }

void Commands::destroy() noexcept {
  if (submitted_) device_.vk.vkWaitForFences(device_.handle, 1, &fence_, VK_TRUE, UINT64_MAX);
  device_.vk.vkDestroyFence(device_.handle, fence_, nullptr);
  if (commands_ != VK_NULL_HANDLE)
    device_.vk.vkFreeCommandBuffers(device_.handle, device_.pool, 1, &commands_);
}

VkCommandBuffer Commands::record() {
  wait();
  auto begin = vk_make<VkCommandBufferBeginInfo>(VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO);
  begin.flags = VK_COMMAND_BUFFER_USAGE_ONE_TIME_SUBMIT_BIT;
  check(device_.vk.vkBeginCommandBuffer(commands_, &begin), "vkBeginCommandBuffer");
  return commands_;
}

void Commands::submit() {
  check(device_.vk.vkEndCommandBuffer(commands_), "vkEndCommandBuffer");
  check(device_.vk.vkResetFences(device_.handle, 1, &fence_), "vkResetFences");
  auto submit = vk_make<VkSubmitInfo>(VK_STRUCTURE_TYPE_SUBMIT_INFO);
  submit.commandBufferCount = 1;
  submit.pCommandBuffers = &commands_;
  check(device_.vk.vkQueueSubmit(device_.queue, 1, &submit, fence_), "vkQueueSubmit");
  submitted_ = true;
}

void Commands::wait() {
  if (!std::exchange(submitted_, false)) return;
  check(device_.vk.vkWaitForFences(device_.handle, 1, &fence_, VK_TRUE, UINT64_MAX), "vkWaitForFences");
}

Buffer::Buffer(Device& device, VkDeviceSize bytes, VkBufferUsageFlags usage, VkMemoryPropertyFlags need,
               VkMemoryPropertyFlags prefer)
    : device_(&device), bytes_(std::max<VkDeviceSize>(bytes, 4)) {
  try {
    auto info = vk_make<VkBufferCreateInfo>(VK_STRUCTURE_TYPE_BUFFER_CREATE_INFO);
    info.size = bytes_;
    info.usage = usage;
    check(device.vk.vkCreateBuffer(device.handle, &info, nullptr, &buffer_), "vkCreateBuffer");
    VkMemoryRequirements requirements;
    device.vk.vkGetBufferMemoryRequirements(device.handle, buffer_, &requirements);
    auto allocation = vk_make<VkMemoryAllocateInfo>(VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_INFO);
    allocation.allocationSize = requirements.size;
    auto flags = vk_make<VkMemoryAllocateFlagsInfo>(VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_FLAGS_INFO);
    flags.flags = VK_MEMORY_ALLOCATE_DEVICE_ADDRESS_BIT;
    if ((usage & VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT) != 0) allocation.pNext = &flags;
    VkResult result = VK_ERROR_OUT_OF_DEVICE_MEMORY;
    int type = -1;
    // The preferred memory may be a small heap: where it is full, what is merely needed will do.
    for (const VkMemoryPropertyFlags wanted : {prefer, VkMemoryPropertyFlags{0}}) {
      type = device.memory_type(requirements.memoryTypeBits, need, wanted);
      if (type < 0) continue;
      allocation.memoryTypeIndex = static_cast<uint32_t>(type);
      result = device.vk.vkAllocateMemory(device.handle, &allocation, nullptr, &memory_);
      if (result == VK_SUCCESS) break;
    }
    check(result, ("vkAllocateMemory of " + std::to_string(requirements.size) + " bytes").c_str());
    check(device.vk.vkBindBufferMemory(device.handle, buffer_, memory_, 0), "vkBindBufferMemory");
    const VkMemoryPropertyFlags got = device.memory.memoryTypes[type].propertyFlags;
    if (((need | prefer) & kHostMemory) != 0 && (got & kHostMemory) == kHostMemory) {
      check(device.vk.vkMapMemory(device.handle, memory_, 0, VK_WHOLE_SIZE, 0, &mapped_), "vkMapMemory");
    }
  } catch (...) {
    destroy();
    throw;
  }
}

Buffer::~Buffer() { destroy(); }

Buffer& Buffer::operator=(Buffer&& other) noexcept {
  std::swap(device_, other.device_);
  std::swap(buffer_, other.buffer_);
  std::swap(memory_, other.memory_);
  std::swap(mapped_, other.mapped_);
  std::swap(bytes_, other.bytes_);
  return *this;
}

void Buffer::destroy() noexcept {
  if (device_ == nullptr) return;
  device_->vk.vkDestroyBuffer(device_->handle, buffer_, nullptr);
  device_->vk.vkFreeMemory(device_->handle, memory_, nullptr);
  device_ = nullptr;
}

}  // namespace lsp
