#include "path_tracer.h"

#include <algorithm>
#include <chrono>
#include <cstring>

namespace lsp::sample {
namespace {

constexpr uint32_t kStamps = 4;  // before and after each half
constexpr uint32_t kVertexBytes = sizeof(ViewVertex) * 2 * VIEW_SLICE_PIXELS;
constexpr VkPipelineStageFlags kCompute = VK_PIPELINE_STAGE_COMPUTE_SHADER_BIT;
constexpr VkAccessFlags kShaderAccess = VK_ACCESS_SHADER_READ_BIT | VK_ACCESS_SHADER_WRITE_BIT;

// Between dispatches, of one submission or of two.
void record_next(VkCommandBuffer commands) {
  record_barrier(commands, kCompute, VK_ACCESS_SHADER_WRITE_BIT, kCompute, kShaderAccess);
}

}  // namespace

PathTracer::PathTracer(Gpu& gpu, const DeviceScene& scene) : gpu_(gpu), scene_(scene) {
  constexpr VkBufferUsageFlags kStorage = VK_BUFFER_USAGE_STORAGE_BUFFER_BIT;
  frame_ = GpuBuffer(gpu, sizeof(ViewFrame), kStorage, Memory::kHost);
  vertices_ = GpuBuffer(gpu, kVertexBytes, kStorage, Memory::kDevice);
  statistics_ = GpuBuffer(gpu, 2 * sizeof(ViewStatistics), kStorage, Memory::kHost);
  try {
    create_layout();
    create_sets();
    if (gpu.seconds_per_tick > 0) {
      auto timer = vk_make<VkQueryPoolCreateInfo>(VK_STRUCTURE_TYPE_QUERY_POOL_CREATE_INFO);
      timer.queryType = VK_QUERY_TYPE_TIMESTAMP;
      timer.queryCount = kStamps;
      vk_check(vkCreateQueryPool(gpu.device, &timer, nullptr, &timer_), "vkCreateQueryPool");
    }
  } catch (...) {
    destroy();
    throw;
  }
}

uint32_t PathTracer::largest_picture() const {
  return gpu_.properties.limits.maxStorageBufferRange / (4 * sizeof(float));
}

void PathTracer::reserve(uint32_t picture, uint32_t window) {
  constexpr VkBufferUsageFlags kStorage = VK_BUFFER_USAGE_STORAGE_BUFFER_BIT;
  sums_ = GpuBuffer(gpu_, VkDeviceSize{picture} * 4 * sizeof(float), kStorage, Memory::kDevice);
  shown_ = GpuBuffer(gpu_, VkDeviceSize{window} * sizeof(uint32_t),
                     kStorage | VK_BUFFER_USAGE_TRANSFER_SRC_BIT, Memory::kDevice);
  write_sets();
}

PathTracer::~PathTracer() { destroy(); }

void PathTracer::destroy() noexcept {
  for (const auto& [key, pipeline] : pipelines_) vkDestroyPipeline(gpu_.device, pipeline, nullptr);
  vkDestroyQueryPool(gpu_.device, timer_, nullptr);
  vkDestroyDescriptorPool(gpu_.device, pool_, nullptr);
  vkDestroyPipelineLayout(gpu_.device, layout_, nullptr);
  for (const VkDescriptorSetLayout layout : set_layouts_)
    vkDestroyDescriptorSetLayout(gpu_.device, layout, nullptr);
}

void PathTracer::create_layout() {
  VkDescriptorSetLayoutBinding scene[LSP_BINDING_COUNT];
  lsp_vulkan_layout_bindings(scene);  // [lsp] set 0
  VkDescriptorSetLayoutBinding own[VIEW_BINDING_COUNT];
  for (uint32_t i = 0; i < VIEW_BINDING_COUNT; ++i)
    own[i] = {i, VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, 1, VK_SHADER_STAGE_COMPUTE_BIT, nullptr};
  const VkDescriptorSetLayoutBinding* const bindings[] = {scene, own};
  const uint32_t counts[] = {LSP_BINDING_COUNT, VIEW_BINDING_COUNT};
  for (size_t i = 0; i < 2; ++i) {
    auto info = vk_make<VkDescriptorSetLayoutCreateInfo>(VK_STRUCTURE_TYPE_DESCRIPTOR_SET_LAYOUT_CREATE_INFO);
    info.bindingCount = counts[i];
    info.pBindings = bindings[i];
    vk_check(vkCreateDescriptorSetLayout(gpu_.device, &info, nullptr, &set_layouts_[i]),
             "vkCreateDescriptorSetLayout");
  }
  const VkPushConstantRange push{VK_SHADER_STAGE_COMPUTE_BIT, 0, sizeof(ViewRegion)};
  auto info = vk_make<VkPipelineLayoutCreateInfo>(VK_STRUCTURE_TYPE_PIPELINE_LAYOUT_CREATE_INFO);
  info.setLayoutCount = 2;
  info.pSetLayouts = set_layouts_;
  info.pushConstantRangeCount = 1;
  info.pPushConstantRanges = &push;
  vk_check(vkCreatePipelineLayout(gpu_.device, &info, nullptr, &layout_), "vkCreatePipelineLayout");
}

void PathTracer::create_sets() {
  const VkDescriptorPoolSize size{VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, LSP_BINDING_COUNT + VIEW_BINDING_COUNT};
  auto pool = vk_make<VkDescriptorPoolCreateInfo>(VK_STRUCTURE_TYPE_DESCRIPTOR_POOL_CREATE_INFO);
  pool.maxSets = 2;
  pool.poolSizeCount = 1;
  pool.pPoolSizes = &size;
  vk_check(vkCreateDescriptorPool(gpu_.device, &pool, nullptr, &pool_), "vkCreateDescriptorPool");
  auto sets = vk_make<VkDescriptorSetAllocateInfo>(VK_STRUCTURE_TYPE_DESCRIPTOR_SET_ALLOCATE_INFO);
  sets.descriptorPool = pool_;
  sets.descriptorSetCount = 2;
  sets.pSetLayouts = set_layouts_;
  vk_check(vkAllocateDescriptorSets(gpu_.device, &sets, sets_), "vkAllocateDescriptorSets");
}

void PathTracer::write_sets() {
  scene_.write_set(sets_[0], vertices_.handle());
  const VkBuffer buffers[VIEW_BINDING_COUNT] = {frame_.handle(),      sums_.handle(),     vertices_.handle(),
                                                scene_.materials(),   scene_.triangles(), scene_.emitters(),
                                                statistics_.handle(), shown_.handle(),    scene_.files()};
  VkDescriptorBufferInfo infos[VIEW_BINDING_COUNT];
  for (size_t i = 0; i < VIEW_BINDING_COUNT; ++i) infos[i] = {buffers[i], 0, VK_WHOLE_SIZE};
  auto write = vk_make<VkWriteDescriptorSet>(VK_STRUCTURE_TYPE_WRITE_DESCRIPTOR_SET);
  write.dstSet = sets_[1];
  write.descriptorCount = VIEW_BINDING_COUNT;
  write.descriptorType = VK_DESCRIPTOR_TYPE_STORAGE_BUFFER;
  write.pBufferInfo = infos;
  vkUpdateDescriptorSets(gpu_.device, 1, &write, 0, nullptr);
}

VkPipeline PathTracer::pipeline(Kernel kernel, const lsp_vulkan_kind& kind) {
  const uint32_t base = kind.base_structure;
  VkPipeline& pipeline = pipelines_[{kernel, base, kind.flags, kind.parts}];
  if (pipeline != VK_NULL_HANDLE) return pipeline;
  made_pipeline_ = true;
  const std::span<const uint32_t> code = shader_code(kernel, base);
  auto module_info = vk_make<VkShaderModuleCreateInfo>(VK_STRUCTURE_TYPE_SHADER_MODULE_CREATE_INFO);
  module_info.pCode = code.data();
  module_info.codeSize = code.size_bytes();
  VkShaderModule module = VK_NULL_HANDLE;
  vk_check(vkCreateShaderModule(gpu_.device, &module_info, nullptr, &module), "vkCreateShaderModule");
  // [lsp] The kind of trace and what the scene needs are compiled in: the rest is compiled away.
  const uint32_t values[] = {kind.stack, kind.flags, kind.parts};
  const VkSpecializationMapEntry entries[] = {{LSP_VULKAN_STACK_CONSTANT, 0, sizeof(uint32_t)},
                                              {VIEW_CONSTANT_FLAGS, sizeof(uint32_t), sizeof(uint32_t)},
                                              {VIEW_CONSTANT_PARTS, 2 * sizeof(uint32_t), sizeof(uint32_t)}};
  const VkSpecializationInfo specialization{kernel == Kernel::kShow ? 0u : 3u, entries, sizeof values,
                                            values};
  auto info = vk_make<VkComputePipelineCreateInfo>(VK_STRUCTURE_TYPE_COMPUTE_PIPELINE_CREATE_INFO);
  info.stage = vk_make<VkPipelineShaderStageCreateInfo>(VK_STRUCTURE_TYPE_PIPELINE_SHADER_STAGE_CREATE_INFO);
  info.stage.stage = VK_SHADER_STAGE_COMPUTE_BIT;
  info.stage.module = module;
  info.stage.pName = "main";
  info.stage.pSpecializationInfo = &specialization;
  info.layout = layout_;
  const VkResult result = vkCreateComputePipelines(gpu_.device, VK_NULL_HANDLE, 1, &info, nullptr, &pipeline);
  vkDestroyShaderModule(gpu_.device, module, nullptr);
  vk_check(result, "vkCreateComputePipelines");
  return pipeline;
}

void PathTracer::bind(VkCommandBuffer commands, VkPipeline pipeline) const {
  vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_COMPUTE, pipeline);
  vkCmdBindDescriptorSets(commands, VK_PIPELINE_BIND_POINT_COMPUTE, layout_, 0, 2, sets_, 0, nullptr);
}

void PathTracer::dispatch(VkCommandBuffer commands, VkPipeline pipeline, const ViewRegion& region) const {
  bind(commands, pipeline);
  vkCmdPushConstants(commands, layout_, VK_SHADER_STAGE_COMPUTE_BIT, 0, sizeof region, &region);
  vkCmdDispatch(commands, (region.columns + VIEW_GROUP_EDGE - 1) / VIEW_GROUP_EDGE,
                (region.rows + VIEW_GROUP_EDGE - 1) / VIEW_GROUP_EDGE, 1);
  record_next(commands);
}

void PathTracer::stamp(VkCommandBuffer commands, uint32_t query) const {
  if (timer_ != VK_NULL_HANDLE)
    vkCmdWriteTimestamp(commands, VK_PIPELINE_STAGE_BOTTOM_OF_PIPE_BIT, timer_, query);
}

// A ray to every light there is.
void PathTracer::record_light(VkCommandBuffer commands, const ViewFrame& frame, ViewRegion region,
                              VkPipeline pipeline) {
  const lsp_float3 lamp = frame.lamp_intensity;
  const bool shines = frame.emitters > 0 || lamp.x > 0 || lamp.y > 0 || lamp.z > 0;
  for (region.light = VIEW_SKY; region.light < (shines ? VIEW_LAMP + 1 : VIEW_LAMP); ++region.light)
    dispatch(commands, pipeline, region);
}

// Indirect light of a half: the ray from what the eye sees, and light on what it meets.
void PathTracer::record_half(VkCommandBuffer commands, const ViewFrame& frame, const ViewRegion& region,
                             const lsp_trace_options& options) {
  lsp_trace_options any = options;
  any.flags |= LSP_TRACE_ANY_HIT;
  const lsp_vulkan_kind of_gather = scene_.kind(frame.effect == VIEW_AO ? any : options);
  dispatch(commands, pipeline(Kernel::kGather, of_gather), region);
  if (frame.effect == VIEW_LIGHT || frame.effect == VIEW_DIFFUSE)
    record_light(commands, frame, region, pipeline(Kernel::kLight, scene_.kind(any)));
}

void PathTracer::record_slice(VkCommandBuffer commands, const ViewFrame& frame, ViewRegion slice,
                              uint32_t split, const lsp_trace_options& options) {
  const lsp_trace_options exact{};
  const lsp_trace_options exact_any{LSP_TRACE_ANY_HIT, 0, 0, 0};
  if (timer_ != VK_NULL_HANDLE) vkCmdResetQueryPool(commands, timer_, 0, kStamps);
  slice.vertex = VIEW_EYE;
  dispatch(commands, pipeline(Kernel::kEye, scene_.kind(exact)), slice);
  if (frame.effect == VIEW_LIGHT)
    record_light(commands, frame, slice, pipeline(Kernel::kLight, scene_.kind(exact_any)));
  slice.vertex = VIEW_BOUNCE;
  for (const uint32_t part : {VIEW_EXACT, VIEW_APPROXIMATE}) {
    ViewRegion half = slice;
    half.part = part;
    half.first_column = part == VIEW_EXACT ? 0 : split;
    half.columns = part == VIEW_EXACT ? split : frame.width - split;
    stamp(commands, 2 * part);
    if (half.columns > 0) record_half(commands, frame, half, part == VIEW_EXACT ? exact : options);
    stamp(commands, 2 * part + 1);
  }
  record_barrier(commands, kCompute, VK_ACCESS_SHADER_WRITE_BIT, VK_PIPELINE_STAGE_HOST_BIT,
                 VK_ACCESS_HOST_READ_BIT);
}

SliceReport PathTracer::trace(const ViewFrame& frame, uint32_t first, uint32_t rows, uint32_t split,
                              const lsp_trace_options& options) {
  const auto start = std::chrono::steady_clock::now();
  std::memcpy(frame_.mapped(), &frame, sizeof frame);
  std::memset(statistics_.mapped(), 0, 2 * sizeof(ViewStatistics));
  made_pipeline_ = false;
  const ViewRegion slice{0, frame.width, first, rows, VIEW_EXACT, VIEW_EYE, VIEW_SKY};
  gpu_.run([&](VkCommandBuffer commands) { record_slice(commands, frame, slice, split, options); });
  SliceReport report;
  report.compiled = made_pipeline_;
  std::memcpy(report.counts, statistics_.mapped(), sizeof report.counts);
  if (timer_ != VK_NULL_HANDLE) {
    uint64_t ticks[kStamps] = {};
    vk_check(vkGetQueryPoolResults(gpu_.device, timer_, 0, kStamps, sizeof ticks, ticks, sizeof ticks[0],
                                   VK_QUERY_RESULT_64_BIT | VK_QUERY_RESULT_WAIT_BIT),
             "vkGetQueryPoolResults");
    for (const uint32_t part : {VIEW_EXACT, VIEW_APPROXIMATE})
      report.seconds[part] =
          static_cast<double>(ticks[2 * part + 1] - ticks[2 * part]) * gpu_.seconds_per_tick;
  }
  report.all_seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return report;
}

void PathTracer::show(const ViewFrame& frame) {
  std::memcpy(frame_.mapped(), &frame, sizeof frame);
  gpu_.run([&](VkCommandBuffer commands) {
    bind(commands, pipeline(Kernel::kShow, {}));
    vkCmdDispatch(commands, (frame.window_width + VIEW_GROUP_EDGE - 1) / VIEW_GROUP_EDGE,
                  (frame.window_height + VIEW_GROUP_EDGE - 1) / VIEW_GROUP_EDGE, 1);
    record_barrier(commands, kCompute, VK_ACCESS_SHADER_WRITE_BIT, VK_PIPELINE_STAGE_TRANSFER_BIT,
                   VK_ACCESS_TRANSFER_READ_BIT);
  });
}

}  // namespace lsp::sample
