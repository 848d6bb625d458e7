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

DeviceScene::DeviceScene(Gpu& gpu, const RenderScene& scene)
    : gpu_(gpu), path_(scene.path()), instances_(scene.instances()) {
  if (instances_ == nullptr) {
    scenes_.push_back(scene.single());
  } else {
    scenes_.assign(instances_->assets, instances_->assets + instances_->asset_count);
  }
  plan(gpu.properties.limits);
  staging_ = GpuBuffer(gpu, kPiece, VK_BUFFER_USAGE_TRANSFER_SRC_BIT, Memory::kHost);
  if (instances_ != nullptr)
    upload_instances();
  else
    upload_single();
  upload_shading(scene);
  staging_ = GpuBuffer();
}

// [lsp] Which buffers the files need, for rays of both kinds. What cannot be traced is refused here.
void DeviceScene::plan(const VkPhysicalDeviceLimits& device) {
  const uint32_t uses = LSP_USE_EXACT | LSP_USE_APPROXIMATE;
  const lsp_vulkan_limits limits{device.maxStorageBufferRange, 0, device.maxComputeWorkGroupCount[0], 0};
  lsp_error error;
  lsp_status status = lsp_vulkan_load_functions(gpu_.device, vkGetDeviceProcAddr, &functions_, &error);
  if (status != LSP_OK) throw Failure(static_cast<Exit>(status), path_, error.message);
  for (size_t i = 0; i < scenes_.size(); ++i) {
    status = lsp_vulkan_plan_buffers(scenes_[i], uses, &limits, &plans_.emplace_back(), &error);
    if (status == LSP_OK && instances_ != nullptr)
      status =
          lsp_vulkan_place_buffers(&plans_[i], &limits, &pool_bytes_, places_.emplace_back().data(), &error);
    if (status == LSP_ERROR_LIMIT) refuse_size();
    const std::string number = instances_ != nullptr ? "asset " + std::to_string(i) + ": " : "";
    if (status != LSP_OK) throw Failure(static_cast<Exit>(status), path_, number + error.message);
  }
  for (const uint32_t flags : {0u, LSP_TRACE_APPROXIMATE}) kind({flags, 0, LSP_QUALITY_BALANCED, 0});
}

// The window's shaders read storage buffers; lsp_vulkan.h has a way through addresses, which lsp-render goes.
void DeviceScene::refuse_size() const {
  throw Failure(Exit::kLimit, path_,
                std::string(instances_ != nullptr ? "its assets have" : "a section has") +
                    " more bytes than a storage buffer of this device may hold (" +
                    std::to_string(gpu_.properties.limits.maxStorageBufferRange) +
                    "): bake with --max-size, or make pictures with lsp-render, which has no such limit");
}

lsp_vulkan_kind DeviceScene::kind(const lsp_trace_options& options) const {
  lsp_vulkan_kind kind;
  lsp_error error;
  const auto count = static_cast<uint32_t>(scenes_.size());
  const lsp_status status =
      instances_ != nullptr
          ? lsp_vulkan_plan_instances(scenes_.data(), plans_.data(), count, &options, &kind, &error)
          : lsp_vulkan_plan_trace(scenes_[0], plans_.data(), &options, &kind, &error);
  if (status != LSP_OK) throw Failure(static_cast<Exit>(status), path_, error.message);
  return kind;
}

// [lsp] The sections as they lie in the file, straight from the mapping. `destination` is told a piece, moves
// its offset where it has to, and answers the buffer.
template <class Destination>
void DeviceScene::upload_sections(size_t number, const Destination& destination) {
  lsp_vulkan_copy piece;
  for (uint64_t cursor = 0;
       lsp_vulkan_next_copy(scenes_[number], &plans_[number], kPiece, &cursor, &piece) != 0;) {
    std::memcpy(staging_.mapped(), piece.source, piece.bytes);
    const VkBuffer buffer = destination(piece);
    gpu_.run([&](VkCommandBuffer commands) {
      lsp_vulkan_record_copy(&functions_, commands, &piece, staging_.handle(), 0, buffer);
      lsp_vulkan_record_upload_barrier(&functions_, commands);
    });
  }
}

// [lsp] One file: a buffer for each of its sections.
void DeviceScene::upload_single() {
  const lsp_vulkan_plan& plan = plans_[0];
  for (uint32_t i = 0; i < plan.buffer_count; ++i) {
    sections_.emplace_back(gpu_, plan.buffers[i].bytes, plan.usage, Memory::kDevice);
    handles_.push_back(sections_.back().handle());
  }
  upload_sections(0, [&](const lsp_vulkan_copy& piece) { return handles_[piece.buffer]; });
}

// [lsp] All assets in one buffer, the tree over instances as it was built, and room for what the shader reads
// of every asset.
void DeviceScene::upload_instances() {
  sections_.emplace_back(gpu_, pool_bytes_, LSP_VULKAN_BUFFER_USAGE, Memory::kDevice);
  for (size_t i = 0; i < scenes_.size(); ++i) {
    upload_sections(i, [&](lsp_vulkan_copy& piece) {
      piece.buffer_offset += places_[i][piece.buffer];
      return sections_[0].handle();
    });
  }
  placed_ = upload(instances_->records, lsp_instances_bytes(instances_->count), "instances");
  assets_ = GpuBuffer(gpu_, scenes_.size() * sizeof(lsp_vulkan_asset), VK_BUFFER_USAGE_STORAGE_BUFFER_BIT,
                      Memory::kHost);
}

void DeviceScene::set_dial(const lsp_trace_options& options) {
  if (instances_ == nullptr) return;
  auto* const described = static_cast<lsp_vulkan_asset*>(assets_.mapped());
  for (size_t i = 0; i < scenes_.size(); ++i) {
    lsp_error error;
    const lsp_status status =
        lsp_vulkan_describe_asset(scenes_[i], &plans_[i], places_[i].data(), &options, &described[i], &error);
    if (status != LSP_OK)
      throw Failure(static_cast<Exit>(status), path_, "asset " + std::to_string(i) + ": " + error.message);
  }
}

void DeviceScene::write_set(VkDescriptorSet set, VkBuffer unused) const {
  if (instances_ != nullptr)
    lsp_vulkan_write_instance_descriptors(&functions_, gpu_.device, set, assets_.handle(), placed_.handle(),
                                          sections_[0].handle(), unused, unused, VK_NULL_HANDLE);
  else
    lsp_vulkan_write_descriptors(&functions_, gpu_.device, set, plans_.data(), handles_.data(), unused,
                                 unused, VK_NULL_HANDLE);
}

// Of all files one behind the other.
void DeviceScene::upload_shading(const RenderScene& scene) {
  std::vector<LspMaterial> materials;
  std::vector<uint32_t> triangles;
  std::vector<ViewFile> files;
  for (size_t i = 0; i < scenes_.size(); ++i) {
    const auto own_triangles = scene.triangles_of_primitives(i);
    const auto own_materials = scene.materials(i);
    files.push_back({static_cast<uint32_t>(triangles.size()), static_cast<uint32_t>(own_triangles.size()),
                     static_cast<uint32_t>(materials.size()), static_cast<uint32_t>(own_materials.size())});
    triangles.insert(triangles.end(), own_triangles.begin(), own_triangles.end());
    materials.insert(materials.end(), own_materials.begin(), own_materials.end());
  }
  const std::vector<ViewEmitter> emitters = emitters_of(scene);
  materials_ = upload(materials, "materials");
  triangles_ = upload(triangles, "primitives");
  files_ = upload(files, "assets");
  emitters_ = upload(emitters, "light-emitting triangles");
  emitter_count_ = static_cast<uint32_t>(emitters.size());
}

template <class T>
GpuBuffer DeviceScene::upload(const std::vector<T>& items, const char* what) {
  return upload(items.data(), items.size() * sizeof(T), what);
}

GpuBuffer DeviceScene::upload(const void* bytes, uint64_t size, const char* what) {
  if (size > gpu_.properties.limits.maxStorageBufferRange) {
    throw Failure(
        Exit::kLimit, path_,
        std::string("has more ") + what +
            " than a buffer of this device may hold; make pictures with lsp-render, which has no such limit");
  }
  GpuBuffer buffer(gpu_, size, VK_BUFFER_USAGE_STORAGE_BUFFER_BIT | VK_BUFFER_USAGE_TRANSFER_DST_BIT,
                   Memory::kDevice);
  for (uint64_t done = 0; done < size; done += kPiece) {
    const VkBufferCopy piece{0, done, std::min(kPiece, size - done)};
    std::memcpy(staging_.mapped(), static_cast<const char*>(bytes) + done, piece.size);
    gpu_.run([&](VkCommandBuffer commands) {
      vkCmdCopyBuffer(commands, staging_.handle(), buffer.handle(), 1, &piece);
      lsp_vulkan_record_upload_barrier(&functions_, commands);
    });
  }
  return buffer;
}

}  // namespace lsp::sample
