// The images of a window, which pixels in a buffer are copied to.
#pragma once

#include "gpu.h"

namespace lsp::sample {

class Swapchain {
 public:
  explicit Swapchain(Gpu& gpu) : gpu_(gpu) {}
  ~Swapchain();
  Swapchain(const Swapchain&) = delete;
  Swapchain& operator=(const Swapchain&) = delete;

  // Makes images as large as the window, given in pixels, whose surface may know better: see extent().
  void resize(uint32_t width, uint32_t height);
  VkExtent2D extent() const { return extent_; }
  bool blue_first() const { return blue_first_; }  // bytes are BGRA, else RGBA

  // Shows the extent's pixels, four bytes each, written by shaders before. False: the window has changed and
  // nothing was shown; resize, then show again. Where `copy` is not null, the image's bytes are copied there
  // just before it is shown.
  bool show(VkBuffer pixels, VkBuffer copy);

 private:
  void destroy() noexcept;
  void record(VkCommandBuffer commands, VkImage image, VkBuffer pixels, VkBuffer copy) const;

  Gpu& gpu_;
  VkSwapchainKHR swapchain_ = VK_NULL_HANDLE;
  VkExtent2D extent_{};
  bool blue_first_ = true;
  std::vector<VkImage> images_;
  VkSemaphore acquired_ = VK_NULL_HANDLE;
  std::vector<VkSemaphore> drawn_;  // one an image: presenting one may still wait when the next is drawn
};

}  // namespace lsp::sample
