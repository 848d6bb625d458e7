#include "swapchain.h"

#include <algorithm>

namespace lsp::sample {
namespace {

VkSurfaceFormatKHR choose_format(const Gpu& gpu) {
  uint32_t count = 0;
  vkGetPhysicalDeviceSurfaceFormatsKHR(gpu.physical, gpu.surface, &count, nullptr);
  std::vector<VkSurfaceFormatKHR> formats(count);
  vkGetPhysicalDeviceSurfaceFormatsKHR(gpu.physical, gpu.surface, &count, formats.data());
  // The bytes are encoded already: of a format in UNORM or SRGB a copy takes them as they are.
  for (const VkSurfaceFormatKHR& format : formats) {
    for (const VkFormat known : {VK_FORMAT_B8G8R8A8_UNORM, VK_FORMAT_R8G8B8A8_UNORM, VK_FORMAT_B8G8R8A8_SRGB,
                                 VK_FORMAT_R8G8B8A8_SRGB}) {
      if (format.format == known && format.colorSpace == VK_COLOR_SPACE_SRGB_NONLINEAR_KHR) return format;
    }
  }
  throw Failure(Exit::kUnsupported, "", "the display has no format of eight bits a channel; use lsp-render");
}

}  // namespace

Swapchain::~Swapchain() { destroy(); }

void Swapchain::destroy() noexcept {
  vkDeviceWaitIdle(gpu_.device);
  for (const VkSemaphore semaphore : drawn_) vkDestroySemaphore(gpu_.device, semaphore, nullptr);
  drawn_.clear();
  vkDestroySemaphore(gpu_.device, acquired_, nullptr);
  acquired_ = VK_NULL_HANDLE;
  vkDestroySwapchainKHR(gpu_.device, swapchain_, nullptr);
  swapchain_ = VK_NULL_HANDLE;
}

void Swapchain::resize(uint32_t width, uint32_t height) {
  destroy();
  VkSurfaceCapabilitiesKHR can;
  vk_check(vkGetPhysicalDeviceSurfaceCapabilitiesKHR(gpu_.physical, gpu_.surface, &can),
           "vkGetPhysicalDeviceSurfaceCapabilitiesKHR");
  extent_ = can.currentExtent;
  if (extent_.width == UINT32_MAX) {  // the surface takes what it is given
    extent_.width = std::clamp(width, can.minImageExtent.width, can.maxImageExtent.width);
    extent_.height = std::clamp(height, can.minImageExtent.height, can.maxImageExtent.height);
  }
  if (extent_.width == 0 || extent_.height == 0) return;  // minimised
  constexpr VkImageUsageFlags kUsage = VK_IMAGE_USAGE_TRANSFER_DST_BIT | VK_IMAGE_USAGE_TRANSFER_SRC_BIT;
  if ((can.supportedUsageFlags & kUsage) != kUsage)
    throw Failure(Exit::kUnsupported, "",
                  "the display's images cannot be copied to and from; use lsp-render");
  const VkSurfaceFormatKHR format = choose_format(gpu_);
  blue_first_ = format.format == VK_FORMAT_B8G8R8A8_UNORM || format.format == VK_FORMAT_B8G8R8A8_SRGB;
  auto info = vk_make<VkSwapchainCreateInfoKHR>(VK_STRUCTURE_TYPE_SWAPCHAIN_CREATE_INFO_KHR);
  info.surface = gpu_.surface;
  info.minImageCount = can.minImageCount + 1;
  if (can.maxImageCount != 0) info.minImageCount = std::min(info.minImageCount, can.maxImageCount);
  info.imageFormat = format.format;
  info.imageColorSpace = format.colorSpace;
  info.imageExtent = extent_;
  info.imageArrayLayers = 1;
  info.imageUsage = kUsage;
  info.preTransform = can.currentTransform;
  info.compositeAlpha = (can.supportedCompositeAlpha & VK_COMPOSITE_ALPHA_OPAQUE_BIT_KHR) != 0
                            ? VK_COMPOSITE_ALPHA_OPAQUE_BIT_KHR
                            : VK_COMPOSITE_ALPHA_INHERIT_BIT_KHR;
  info.presentMode = VK_PRESENT_MODE_FIFO_KHR;
  info.clipped = VK_FALSE;  // what is copied from an image is all there, whatever hides the window
  vk_check(vkCreateSwapchainKHR(gpu_.device, &info, nullptr, &swapchain_), "vkCreateSwapchainKHR");
  uint32_t count = 0;
  vkGetSwapchainImagesKHR(gpu_.device, swapchain_, &count, nullptr);
  images_.resize(count);
  vkGetSwapchainImagesKHR(gpu_.device, swapchain_, &count, images_.data());
  const auto semaphore = vk_make<VkSemaphoreCreateInfo>(VK_STRUCTURE_TYPE_SEMAPHORE_CREATE_INFO);
  vk_check(vkCreateSemaphore(gpu_.device, &semaphore, nullptr, &acquired_), "vkCreateSemaphore");
  drawn_.resize(count);
  for (VkSemaphore& drawn : drawn_)
    vk_check(vkCreateSemaphore(gpu_.device, &semaphore, nullptr, &drawn), "vkCreateSemaphore");
}

void Swapchain::record(VkCommandBuffer commands, VkImage image, VkBuffer pixels, VkBuffer copy) const {
  constexpr VkPipelineStageFlags kTransfer = VK_PIPELINE_STAGE_TRANSFER_BIT;
  const VkImageSubresourceRange all{VK_IMAGE_ASPECT_COLOR_BIT, 0, 1, 0, 1};
  const auto become = [&](VkImageLayout before, VkImageLayout after, VkAccessFlags written,
                          VkAccessFlags used, VkPipelineStageFlags then) {
    auto barrier = vk_make<VkImageMemoryBarrier>(VK_STRUCTURE_TYPE_IMAGE_MEMORY_BARRIER);
    barrier.srcAccessMask = written;
    barrier.dstAccessMask = used;
    barrier.oldLayout = before;
    barrier.newLayout = after;
    barrier.srcQueueFamilyIndex = barrier.dstQueueFamilyIndex = VK_QUEUE_FAMILY_IGNORED;
    barrier.image = image;
    barrier.subresourceRange = all;
    vkCmdPipelineBarrier(commands, kTransfer, then, 0, 0, nullptr, 0, nullptr, 1, &barrier);
  };
  VkBufferImageCopy region{};
  region.imageSubresource = {VK_IMAGE_ASPECT_COLOR_BIT, 0, 0, 1};
  region.imageExtent = {extent_.width, extent_.height, 1};
  become(VK_IMAGE_LAYOUT_UNDEFINED, VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL, 0, VK_ACCESS_TRANSFER_WRITE_BIT,
         kTransfer);
  vkCmdCopyBufferToImage(commands, pixels, image, VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL, 1, &region);
  VkImageLayout layout = VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL;
  if (copy != VK_NULL_HANDLE) {
    layout = VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL;
    become(VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL, layout, VK_ACCESS_TRANSFER_WRITE_BIT,
           VK_ACCESS_TRANSFER_READ_BIT, kTransfer);
    vkCmdCopyImageToBuffer(commands, image, layout, copy, 1, &region);
    record_barrier(commands, kTransfer, VK_ACCESS_TRANSFER_WRITE_BIT, VK_PIPELINE_STAGE_HOST_BIT,
                   VK_ACCESS_HOST_READ_BIT);
  }
  become(layout, VK_IMAGE_LAYOUT_PRESENT_SRC_KHR, VK_ACCESS_TRANSFER_WRITE_BIT, 0,
         VK_PIPELINE_STAGE_BOTTOM_OF_PIPE_BIT);
}

bool Swapchain::show(VkBuffer pixels, VkBuffer copy) {
  if (swapchain_ == VK_NULL_HANDLE) return false;
  uint32_t index = 0;
  const VkResult acquired =
      vkAcquireNextImageKHR(gpu_.device, swapchain_, UINT64_MAX, acquired_, VK_NULL_HANDLE, &index);
  if (acquired == VK_ERROR_OUT_OF_DATE_KHR) return false;
  if (acquired != VK_SUBOPTIMAL_KHR) vk_check(acquired, "vkAcquireNextImageKHR");
  gpu_.run([&](VkCommandBuffer commands) { record(commands, images_[index], pixels, copy); }, acquired_,
           drawn_[index]);
  auto info = vk_make<VkPresentInfoKHR>(VK_STRUCTURE_TYPE_PRESENT_INFO_KHR);
  info.waitSemaphoreCount = 1;
  info.pWaitSemaphores = &drawn_[index];
  info.swapchainCount = 1;
  info.pSwapchains = &swapchain_;
  info.pImageIndices = &index;
  const VkResult presented = vkQueuePresentKHR(gpu_.queue, &info);
  if (presented == VK_ERROR_OUT_OF_DATE_KHR || presented == VK_SUBOPTIMAL_KHR) return false;
  vk_check(presented, "vkQueuePresentKHR");
  return true;
}

}  // namespace lsp::sample
