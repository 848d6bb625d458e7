#include "scene_buffers.h"

#include <algorithm>
#include <cstring>
#include <deque>
#include <memory>
#include <utility>

namespace lsp {
namespace {

constexpr uint64_t kPieceBytes = 1u << 20;  // larger pieces are slow from a mapping that is not in memory yet
constexpr size_t kRingSlots = 4;
constexpr VkExternalMemoryHandleTypeFlagBits kHostPointer =
    VK_EXTERNAL_MEMORY_HANDLE_TYPE_HOST_ALLOCATION_BIT_EXT;

[[noreturn]] void refuse(const std::string& why) { throw Failure(Exit::kUnsupported, "", why); }

// Staging memory and the commands that empty it.
struct Slot {
  explicit Slot(Device& device)
      : staging(device, kPieceBytes, VK_BUFFER_USAGE_TRANSFER_SRC_BIT, kHostMemory, 0), commands(device) {}
  Buffer staging;
  Commands commands;  // ends, and with it what it does, before the memory
};

class Ring {
 public:
  explicit Ring(Device& device) : device_(device) {
    for (size_t i = 0; i < kRingSlots; ++i) slots_.emplace_back(device);
  }

  void copy(const lsp_vulkan_copy& piece, VkBuffer destination) {
    Slot& slot = slots_[next_++ % kRingSlots];
    const VkCommandBuffer commands = slot.commands.record();
    memcpy(slot.staging.mapped(), piece.source, piece.bytes);
    lsp_vulkan_record_copy(&device_.functions, commands, &piece, slot.staging.handle(), 0, destination);
    lsp_vulkan_record_upload_barrier(&device_.functions, commands);
    slot.commands.submit();
  }

  void finish() {
    for (Slot& slot : slots_) slot.commands.wait();
  }

 private:
  Device& device_;
  std::deque<Slot> slots_;
  size_t next_ = 0;
};

// Where a buffer of a plan goes to: from `offset` of `buffer` on.
struct Destination {
  const Buffer* buffer;
  VkDeviceSize offset;
};

// Copies the sections, straight into memory that the host sees, or else, or with `staging`, through a ring.
void upload_sections(Device& device, const lsp_scene& scene, const lsp_vulkan_plan& plan,
                     std::span<const Destination> to, bool staging) {
  const auto is_hidden = [](const Destination& place) { return place.buffer->mapped() == nullptr; };
  const bool staged = staging || std::ranges::any_of(to, is_hidden);
  std::unique_ptr<Ring> ring;
  if (staged) ring = std::make_unique<Ring>(device);
  lsp_vulkan_copy piece;
  for (uint64_t cursor = 0; lsp_vulkan_next_copy(&scene, &plan, kPieceBytes, &cursor, &piece) != 0;) {
    const Destination& place = to[piece.buffer];
    piece.buffer_offset += place.offset;
    if (staged)
      ring->copy(piece, place.buffer->handle());
    else
      memcpy(static_cast<unsigned char*>(place.buffer->mapped()) + piece.buffer_offset, piece.source,
             piece.bytes);
  }
  if (staged) ring->finish();
}

// Creates a buffer that may lie in imported host memory.
VkBuffer create_importable(Device& device, uint64_t bytes, VkBufferUsageFlags usage) {
  auto external =
      vk_make<VkExternalMemoryBufferCreateInfo>(VK_STRUCTURE_TYPE_EXTERNAL_MEMORY_BUFFER_CREATE_INFO);
  external.handleTypes = kHostPointer;
  auto info = vk_make<VkBufferCreateInfo>(VK_STRUCTURE_TYPE_BUFFER_CREATE_INFO);
  info.pNext = &external;
  info.size = bytes;
  info.usage = usage;
  VkBuffer buffer = VK_NULL_HANDLE;
  check(device.vk.vkCreateBuffer(device.handle, &info, nullptr, &buffer), "vkCreateBuffer");
  return buffer;
}

void check_importable(const Device& device) {
  auto info =
      vk_make<VkPhysicalDeviceExternalBufferInfo>(VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_EXTERNAL_BUFFER_INFO);
  info.usage = VK_BUFFER_USAGE_STORAGE_BUFFER_BIT;
  info.handleType = kHostPointer;
  auto properties = vk_make<VkExternalBufferProperties>(VK_STRUCTURE_TYPE_EXTERNAL_BUFFER_PROPERTIES);
  vkGetPhysicalDeviceExternalBufferProperties(device.physical, &info, &properties);
  if ((properties.externalMemoryProperties.externalMemoryFeatures &
       VK_EXTERNAL_MEMORY_FEATURE_IMPORTABLE_BIT) == 0) {
    refuse("the device does not import host memory into storage buffers");
  }
}

}  // namespace

SceneBuffers::SceneBuffers(SceneBuffers&& other) noexcept
    : device_(other.device_),
      plan_(other.plan_),
      places_(other.places_),
      addresses_(std::move(other.addresses_)),
      owned_(std::move(other.owned_)),
      imported_(std::exchange(other.imported_, VK_NULL_HANDLE)),
      bytes_imported_(other.bytes_imported_),
      bytes_uploaded_(other.bytes_uploaded_) {
  std::copy(std::begin(other.handles_), std::end(other.handles_), handles_);
  std::fill(std::begin(other.handles_), std::end(other.handles_), VkBuffer{VK_NULL_HANDLE});
}

SceneBuffers::~SceneBuffers() {
  if (!owned_.empty()) return;  // they end with their owners
  for (VkBuffer buffer : handles_) device_->vk.vkDestroyBuffer(device_->handle, buffer, nullptr);
  device_->vk.vkFreeMemory(device_->handle, imported_, nullptr);
}

SceneBuffers SceneBuffers::import_mapping(Device& device, const lsp_scene& scene,
                                          const lsp_vulkan_plan& plan) {
  SceneBuffers result(device, plan);
  lsp_error error;
  if (lsp_vulkan_check_import(&scene, &device.limits, &error) != LSP_OK) refuse(error.message);
  check_importable(device);

  auto pointer =
      vk_make<VkMemoryHostPointerPropertiesEXT>(VK_STRUCTURE_TYPE_MEMORY_HOST_POINTER_PROPERTIES_EXT);
  if (device.vk.vkGetMemoryHostPointerPropertiesEXT(device.handle, kHostPointer, scene.bytes, &pointer) !=
      VK_SUCCESS) {
    refuse("the device cannot import this memory");
  }
  uint32_t types = pointer.memoryTypeBits;
  for (uint32_t i = 0; i < result.plan_.buffer_count; ++i) {
    const lsp_vulkan_buffer& planned = result.plan_.buffers[i];
    result.handles_[i] =
        create_importable(device, planned.bytes, result.plan_.usage & ~VK_BUFFER_USAGE_TRANSFER_DST_BIT);
    VkMemoryRequirements requirements;
    device.vk.vkGetBufferMemoryRequirements(device.handle, result.handles_[i], &requirements);
    types &= requirements.memoryTypeBits;
    if (planned.file_offset % requirements.alignment != 0 ||
        planned.file_offset + requirements.size > scene.size) {
      refuse("a section does not lie in the file as the device's buffers have to lie in memory");
    }
  }
  const int type = device.memory_type(types, 0, VK_MEMORY_PROPERTY_HOST_CACHED_BIT);
  if (type < 0) refuse("no memory type of the device fits both the mapping and a storage buffer");

  auto import =
      vk_make<VkImportMemoryHostPointerInfoEXT>(VK_STRUCTURE_TYPE_IMPORT_MEMORY_HOST_POINTER_INFO_EXT);
  import.handleType = kHostPointer;
  import.pHostPointer = const_cast<void*>(scene.bytes);  // the shaders' buffers are read-only
  auto flags = vk_make<VkMemoryAllocateFlagsInfo>(VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_FLAGS_INFO);
  flags.flags = VK_MEMORY_ALLOCATE_DEVICE_ADDRESS_BIT;
  if (result.plan_.addresses != 0) import.pNext = &flags;
  auto allocation = vk_make<VkMemoryAllocateInfo>(VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_INFO);
  allocation.pNext = &import;
  allocation.allocationSize = scene.size;
  allocation.memoryTypeIndex = static_cast<uint32_t>(type);
  if (device.vk.vkAllocateMemory(device.handle, &allocation, nullptr, &result.imported_) != VK_SUCCESS) {
    refuse("the driver refused to import the mapping");
  }
  for (uint32_t i = 0; i < result.plan_.buffer_count; ++i) {
    check(device.vk.vkBindBufferMemory(device.handle, result.handles_[i], result.imported_,
                                       result.plan_.buffers[i].file_offset),
          "vkBindBufferMemory");
  }
  result.write_addresses();
  result.bytes_imported_ = scene.size;
  return result;
}

SceneBuffers SceneBuffers::upload(Device& device, const lsp_scene& scene, const lsp_vulkan_plan& plan,
                                  bool staging) {
  SceneBuffers result(device, plan);
  result.owned_.reserve(result.plan_.buffer_count);
  std::vector<Destination> to;
  for (uint32_t i = 0; i < result.plan_.buffer_count; ++i) {
    result.owned_.emplace_back(device, result.plan_.buffers[i].bytes, result.plan_.usage,
                               VK_MEMORY_PROPERTY_DEVICE_LOCAL_BIT, staging ? 0 : kHostMemory);
    result.handles_[i] = result.owned_.back().handle();
    to.push_back({&result.owned_.back(), 0});
  }
  upload_sections(device, scene, result.plan_, to, staging);
  result.write_addresses();
  result.bytes_uploaded_ = result.plan_.bytes;
  return result;
}

std::vector<SceneBuffers> SceneBuffers::upload_pool(Device& device, std::span<const lsp_scene* const> scenes,
                                                    const PoolPlan& plan, bool staging, Buffer& pool) {
  std::vector<SceneBuffers> results;
  pool = Buffer(device, plan.bytes, LSP_VULKAN_BUFFER_USAGE, VK_MEMORY_PROPERTY_DEVICE_LOCAL_BIT,
                staging ? 0 : kHostMemory);
  for (size_t i = 0; i < scenes.size(); ++i) {
    SceneBuffers result(device, plan.buffers[i]);
    result.places_ = plan.places[i];
    result.bytes_uploaded_ = result.plan_.bytes;
    std::vector<Destination> to;
    for (uint32_t k = 0; k < result.plan_.buffer_count; ++k) to.push_back({&pool, result.places_[k]});
    upload_sections(device, *scenes[i], result.plan_, to, staging);
    results.push_back(std::move(result));
  }
  return results;
}

void SceneBuffers::write_addresses() {
  if (plan_.addresses == 0) return;
  for (uint32_t i = 0; i < plan_.buffer_count; ++i) {
    auto info = vk_make<VkBufferDeviceAddressInfo>(VK_STRUCTURE_TYPE_BUFFER_DEVICE_ADDRESS_INFO);
    info.buffer = handles_[i];
    places_[i] = device_->vk.vkGetBufferDeviceAddress(device_->handle, &info);
  }
  VkDeviceAddress table[LSP_VULKAN_ADDRESS_COUNT];
  lsp_vulkan_address_table(&plan_, places_.data(), table);
  addresses_ = Buffer(*device_, sizeof table, VK_BUFFER_USAGE_STORAGE_BUFFER_BIT, kHostMemory, 0);
  memcpy(addresses_.mapped(), table, sizeof table);
}

}  // namespace lsp
