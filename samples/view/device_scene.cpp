#include "device_scene.h"

#include <algorithm>
#include <cstring>

namespace lsp::sample {
namespace {

constexpr uint64_t kPiece = 1u << 20;  // larger pieces are slow from a mapping that is not in memory yet

std::vector<ViewEmitter> emitters_of(const RenderScene& scene) {
  std::vector<ViewEmitter> emitters;
  for (const EmitterTriangle& e : scene.emitters())
    emitters.push_back({from_glm(e.corner), e.cumulative, from_glm(e.edge1), e.pdf, from_glm(e.edge2), 0,
                        from_glm(e.radiance), 0});
  return emitters;
}

}  // namespace

DeviceScene::DeviceScene(Gpu& gpu, const RenderScene& scene) : scene_(*scene.single()) {
  const VkPhysicalDeviceLimits& device = gpu.properties.limits;
  const uint64_t largest = device.maxStorageBufferRange;
  staging_ = GpuBuffer(gpu, kPiece, VK_BUFFER_USAGE_TRANSFER_SRC_BIT, Memory::kHost);

  // [lsp] Which buffers the file needs, for rays of both kinds.
  const lsp_vulkan_limits limits{largest, 0, device.maxComputeWorkGroupCount[0], 0};
  lsp_error error;
  lsp_status status =
      lsp_vulkan_plan_buffers(&scene_, LSP_USE_EXACT | LSP_USE_APPROXIMATE, &limits, &plan_, &error);
  if (status == LSP_OK)
    status = lsp_vulkan_load_functions(gpu.device, vkGetDeviceProcAddr, &functions_, &error);
  if (status != LSP_OK) throw Failure(static_cast<Exit>(status), scene.path(), error.message);
  upload_sections(gpu);

  const auto materials = scene.materials();
  const auto triangles = scene.triangles_of_primitives();
  const std::vector<ViewEmitter> emitters = emitters_of(scene);
  materials_ = upload(gpu, materials.data(), materials.size_bytes(), largest);
  triangles_ = upload(gpu, triangles.data(), triangles.size_bytes(), largest);
  emitters_ = upload(gpu, emitters.data(), emitters.size() * sizeof(ViewEmitter), largest);
  emitter_count_ = static_cast<uint32_t>(emitters.size());
  staging_ = GpuBuffer();
}

// [lsp] The sections as they lie in the file, straight from the mapping.
void DeviceScene::upload_sections(Gpu& gpu) {
  for (uint32_t i = 0; i < plan_.buffer_count; ++i) {
    sections_.emplace_back(gpu, plan_.buffers[i].bytes, plan_.usage, Memory::kDevice);
    handles_[i] = sections_.back().handle();
  }
  lsp_vulkan_copy piece;
  for (uint64_t cursor = 0; lsp_vulkan_next_copy(&scene_, &plan_, kPiece, &cursor, &piece) != 0;) {
    std::memcpy(staging_.mapped(), piece.source, piece.bytes);
    gpu.run([&](VkCommandBuffer commands) {
      lsp_vulkan_record_copy(&functions_, commands, &piece, staging_.handle(), 0, handles_[piece.buffer]);
      lsp_vulkan_record_upload_barrier(&functions_, commands);
    });
  }
}

GpuBuffer DeviceScene::upload(Gpu& gpu, const void* bytes, uint64_t size, uint64_t largest) {
  if (size > largest) {
    throw Failure(
        Exit::kLimit, "",
        "has more primitives than a buffer of this device may number; use lsp-render --backend cpu");
  }
  GpuBuffer buffer(gpu, size, VK_BUFFER_USAGE_STORAGE_BUFFER_BIT | VK_BUFFER_USAGE_TRANSFER_DST_BIT,
                   Memory::kDevice);
  for (uint64_t done = 0; done < size; done += kPiece) {
    const VkBufferCopy piece{0, done, std::min(kPiece, size - done)};
    std::memcpy(staging_.mapped(), static_cast<const char*>(bytes) + done, piece.size);
    gpu.run([&](VkCommandBuffer commands) {
      vkCmdCopyBuffer(commands, staging_.handle(), buffer.handle(), 1, &piece);
      lsp_vulkan_record_upload_barrier(&functions_, commands);
    });
  }
  return buffer;
}

}  // namespace lsp::sample
