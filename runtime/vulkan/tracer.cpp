#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstring>
#include <functional>
#include <map>
#include <memory>
#include <tuple>

#include "device.h"
#include "lsp/instances.hpp"
#include "scene_buffers.h"

namespace lsp {
namespace {

constexpr uint32_t kBatchRays = 1u << 20;
constexpr VkMemoryPropertyFlags kHost =
    VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT | VK_MEMORY_PROPERTY_HOST_COHERENT_BIT;

// The counting shader adds to the counts as to 64-bit words.
constexpr bool is_counter(size_t offset, uint32_t number) { return offset == number * sizeof(uint64_t); }
static_assert(is_counter(offsetof(lsp_trace_counts, invalid), LSP_COUNTER_INVALID));
static_assert(is_counter(offsetof(lsp_trace_counts, hits), LSP_COUNTER_HITS));
static_assert(is_counter(offsetof(lsp_trace_counts, nodes), LSP_COUNTER_NODES));
static_assert(is_counter(offsetof(lsp_trace_counts, shafts), LSP_COUNTER_SHAFTS));
static_assert(is_counter(offsetof(lsp_trace_counts, triangles), LSP_COUNTER_TRIANGLES));
static_assert(is_counter(offsetof(lsp_trace_counts, splits), LSP_COUNTER_SPLITS));
static_assert(is_counter(offsetof(lsp_trace_counts, exact), LSP_COUNTER_EXACT));
static_assert(is_counter(offsetof(lsp_trace_counts, exact_nodes), LSP_COUNTER_EXACT_NODES));

double seconds_since(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

void record_barrier(Device& device, VkCommandBuffer commands, VkPipelineStageFlags from,
                    VkAccessFlags written, VkPipelineStageFlags to, VkAccessFlags read) {
  VkMemoryBarrier barrier{};
  barrier.sType = VK_STRUCTURE_TYPE_MEMORY_BARRIER;
  barrier.srcAccessMask = written;
  barrier.dstAccessMask = read;
  device.vk.vkCmdPipelineBarrier(commands, from, to, 0, 1, &barrier, 0, nullptr, 0, nullptr);
}

// Everything of the trace shader that lasts as long as the device: layouts, descriptor set, commands, timer.
class Shader {
 public:
  explicit Shader(Device& device) : device_(device) {
    try {
      create();
    } catch (...) {
      destroy();
      throw;
    }
  }
  ~Shader() { destroy(); }
  Shader(const Shader&) = delete;
  Shader& operator=(const Shader&) = delete;

  // A pipeline of this SPIR-V for traces with `flags`, whose stack has `stack` entries and which needs these
  // parts of the shader. The caller destroys it.
  VkPipeline create_pipeline(const uint32_t* words, size_t bytes, uint32_t flags, uint32_t stack,
                             uint32_t parts) {
    VkShaderModuleCreateInfo module_info{};
    module_info.sType = VK_STRUCTURE_TYPE_SHADER_MODULE_CREATE_INFO;
    module_info.pCode = words;
    module_info.codeSize = bytes;
    VkShaderModule module = VK_NULL_HANDLE;
    check(device_.vk.vkCreateShaderModule(device_.handle, &module_info, nullptr, &module),
          "vkCreateShaderModule");
    const uint32_t values[] = {stack, flags, parts};
    const VkSpecializationMapEntry entries[] = {
        {LSP_VULKAN_STACK_CONSTANT, 0, sizeof(uint32_t)},
        {LSP_VULKAN_FLAGS_CONSTANT, sizeof(uint32_t), sizeof(uint32_t)},
        {LSP_VULKAN_PARTS_CONSTANT, 2 * sizeof(uint32_t), sizeof(uint32_t)}};
    const VkSpecializationInfo specialization{3, entries, sizeof values, values};
    VkComputePipelineCreateInfo info{};
    info.sType = VK_STRUCTURE_TYPE_COMPUTE_PIPELINE_CREATE_INFO;
    info.stage.sType = VK_STRUCTURE_TYPE_PIPELINE_SHADER_STAGE_CREATE_INFO;
    info.stage.stage = VK_SHADER_STAGE_COMPUTE_BIT;
    info.stage.module = module;
    info.stage.pName = "main";
    info.stage.pSpecializationInfo = &specialization;
    info.layout = layout;
    VkPipeline pipeline = VK_NULL_HANDLE;
    const VkResult result =
        device_.vk.vkCreateComputePipelines(device_.handle, VK_NULL_HANDLE, 1, &info, nullptr, &pipeline);
    device_.vk.vkDestroyShaderModule(device_.handle, module, nullptr);
    check(result, "vkCreateComputePipelines");
    return pipeline;
  }

  VkPipelineLayout layout = VK_NULL_HANDLE;
  VkDescriptorSet set = VK_NULL_HANDLE;
  VkCommandBuffer commands = VK_NULL_HANDLE;
  VkFence fence = VK_NULL_HANDLE;
  VkQueryPool timer = VK_NULL_HANDLE;  // null where the device has no timestamps

 private:
  void create() {
    VkDescriptorSetLayoutBinding bindings[LSP_BINDING_COUNT];
    lsp_vulkan_layout_bindings(bindings);
    VkDescriptorSetLayoutCreateInfo set_info{};
    set_info.sType = VK_STRUCTURE_TYPE_DESCRIPTOR_SET_LAYOUT_CREATE_INFO;
    set_info.bindingCount = LSP_BINDING_COUNT;
    set_info.pBindings = bindings;
    check(device_.vk.vkCreateDescriptorSetLayout(device_.handle, &set_info, nullptr, &set_layout_),
          "vkCreateDescriptorSetLayout");
    const VkPushConstantRange push{VK_SHADER_STAGE_COMPUTE_BIT, 0, sizeof(lsp_vulkan_trace_constants)};
    VkPipelineLayoutCreateInfo layout_info{};
    layout_info.sType = VK_STRUCTURE_TYPE_PIPELINE_LAYOUT_CREATE_INFO;
    layout_info.setLayoutCount = 1;
    layout_info.pSetLayouts = &set_layout_;
    layout_info.pushConstantRangeCount = 1;
    layout_info.pPushConstantRanges = &push;
    check(device_.vk.vkCreatePipelineLayout(device_.handle, &layout_info, nullptr, &layout),
          "vkCreatePipelineLayout");

    const VkDescriptorPoolSize size{VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, LSP_BINDING_COUNT};
    VkDescriptorPoolCreateInfo pool_info{};
    pool_info.sType = VK_STRUCTURE_TYPE_DESCRIPTOR_POOL_CREATE_INFO;
    pool_info.maxSets = 1;
    pool_info.poolSizeCount = 1;
    pool_info.pPoolSizes = &size;
    check(device_.vk.vkCreateDescriptorPool(device_.handle, &pool_info, nullptr, &pool_),
          "vkCreateDescriptorPool");
    VkDescriptorSetAllocateInfo set_allocation{};
    set_allocation.sType = VK_STRUCTURE_TYPE_DESCRIPTOR_SET_ALLOCATE_INFO;
    set_allocation.descriptorPool = pool_;
    set_allocation.descriptorSetCount = 1;
    set_allocation.pSetLayouts = &set_layout_;
    check(device_.vk.vkAllocateDescriptorSets(device_.handle, &set_allocation, &set),
          "vkAllocateDescriptorSets");

    VkCommandBufferAllocateInfo commands_info{};
    commands_info.sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_ALLOCATE_INFO;
    commands_info.commandPool = device_.pool;
    commands_info.commandBufferCount = 1;
    check(device_.vk.vkAllocateCommandBuffers(device_.handle, &commands_info, &commands),
          "vkAllocateCommandBuffers");
    VkFenceCreateInfo fence_info{};
    fence_info.sType = VK_STRUCTURE_TYPE_FENCE_CREATE_INFO;
    check(device_.vk.vkCreateFence(device_.handle, &fence_info, nullptr, &fence), "vkCreateFence");
    if (device_.seconds_per_tick > 0) {
      VkQueryPoolCreateInfo timer_info{};
      timer_info.sType = VK_STRUCTURE_TYPE_QUERY_POOL_CREATE_INFO;
      timer_info.queryType = VK_QUERY_TYPE_TIMESTAMP;
      timer_info.queryCount = 2;
      check(device_.vk.vkCreateQueryPool(device_.handle, &timer_info, nullptr, &timer), "vkCreateQueryPool");
    }
  }

  void destroy() noexcept {
    device_.vk.vkDestroyQueryPool(device_.handle, timer, nullptr);
    device_.vk.vkDestroyFence(device_.handle, fence, nullptr);
    if (commands != VK_NULL_HANDLE)
      device_.vk.vkFreeCommandBuffers(device_.handle, device_.pool, 1, &commands);
    device_.vk.vkDestroyDescriptorPool(device_.handle, pool_, nullptr);
    device_.vk.vkDestroyPipelineLayout(device_.handle, layout, nullptr);
    device_.vk.vkDestroyDescriptorSetLayout(device_.handle, set_layout_, nullptr);
  }

  Device& device_;
  VkDescriptorSetLayout set_layout_ = VK_NULL_HANDLE;
  VkDescriptorPool pool_ = VK_NULL_HANDLE;
};

// The kind of trace of instances of these assets. Throws Failure(kUnsupported), by the asset's number.
lsp_vulkan_kind plan_instances(std::span<const lsp_scene* const> scenes,
                               std::span<const lsp_vulkan_plan> plans, const lsp_trace_options& options) {
  lsp_vulkan_kind kind;
  lsp_error error;
  const lsp_status status = lsp_vulkan_plan_instances(
      scenes.data(), plans.data(), static_cast<uint32_t>(scenes.size()), &options, &kind, &error);
  if (status != LSP_OK) throw Failure(static_cast<Exit>(status), "", error.message);
  return kind;
}

// The pipelines for the scenes on a device, one for each kind of trace, made when they are first needed.
// Scenes of one kind share them: the stack is that of the scene that needs the largest.
class Pipelines {
 public:
  Pipelines(Device& device, Shader& shader, uint32_t stack)
      : device_(device), shader_(shader), stack_(stack) {}
  ~Pipelines() {
    for (const auto& [key, pipeline] : made_) device_.vk.vkDestroyPipeline(device_.handle, pipeline, nullptr);
  }
  Pipelines(const Pipelines&) = delete;
  Pipelines& operator=(const Pipelines&) = delete;
  VkPipeline get(lsp_vulkan_plan plan, bool counting, const lsp_vulkan_kind& kind) {
    plan.base_structure = kind.base_structure;
    VkPipeline& pipeline = made_[{kind.base_structure, plan.addresses, counting, kind.flags, kind.parts}];
    if (pipeline != VK_NULL_HANDLE) return pipeline;
    size_t bytes = 0;
    const uint32_t* words = lsp_vulkan_trace_spirv(&plan, counting ? 1 : 0, &bytes);
    return pipeline = shader_.create_pipeline(words, bytes, kind.flags, stack_, kind.parts);
  }
  // The same of instances, whose assets need these parts of the shader.
  VkPipeline get_instances(bool counting, uint32_t flags, uint32_t parts) {
    VkPipeline& pipeline = made_[{kInstances, 1, counting, flags, parts}];
    if (pipeline != VK_NULL_HANDLE) return pipeline;
    size_t bytes = 0;
    const uint32_t* words = lsp_vulkan_instances_spirv(counting ? 1 : 0, &bytes);
    return pipeline = shader_.create_pipeline(words, bytes, flags, stack_, parts);
  }

 private:
  static constexpr uint32_t kInstances = 0;  // no base structure's number

  Device& device_;
  Shader& shader_;
  uint32_t stack_;
  std::map<std::tuple<uint32_t, uint32_t, bool, uint32_t, uint32_t>, VkPipeline> made_;
};

// A scene on the device.
struct Loaded {
  lsp_scene scene{};
  SceneBuffers buffers;
  bool imported = false;
};

// Rays and hits of one batch. Where device and host share memory the shader works on what the host writes; on
// a discrete device it works on memory of its own, filled and emptied by transfers.
struct BatchBuffers {
  Buffer rays;
  Buffer hits;
  Buffer device_rays;  // discrete devices only
  Buffer device_hits;
  uint32_t capacity = 0;

  BatchBuffers() = default;
  BatchBuffers(Device& device, uint32_t count) : capacity(count) {
    const VkDeviceSize bytes = VkDeviceSize{count} * sizeof(LspRay);
    constexpr VkBufferUsageFlags kStorage = VK_BUFFER_USAGE_STORAGE_BUFFER_BIT;
    constexpr VkBufferUsageFlags kFrom = VK_BUFFER_USAGE_TRANSFER_SRC_BIT;
    constexpr VkBufferUsageFlags kTo = VK_BUFFER_USAGE_TRANSFER_DST_BIT;
    rays = Buffer(device, bytes, kStorage | kFrom, kHost, 0);
    hits = Buffer(device, bytes, kStorage | kTo, kHost, VK_MEMORY_PROPERTY_HOST_CACHED_BIT);
    if (device.shares_memory) return;
    device_rays = Buffer(device, bytes, kStorage | kTo, VK_MEMORY_PROPERTY_DEVICE_LOCAL_BIT, 0);
    device_hits = Buffer(device, bytes, kStorage | kFrom, VK_MEMORY_PROPERTY_DEVICE_LOCAL_BIT, 0);
  }
  bool staged() const { return device_rays.handle() != VK_NULL_HANDLE; }
  VkBuffer shader_rays() const { return staged() ? device_rays.handle() : rays.handle(); }
  VkBuffer shader_hits() const { return staged() ? device_hits.handle() : hits.handle(); }
};

}  // namespace

const char* name_of(LoadPath path) {
  switch (path) {
    case LoadPath::kImport:
      return "import";
    case LoadPath::kUpload:
      return "upload";
    default:
      return "automatic";
  }
}

class VulkanTracer::Impl {
 public:
  explicit Impl(const VulkanOptions& options) : options_(options) { open(); }
  ~Impl() { close(); }
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;

  // `numbered`: what fails is named by the scene's number.
  void load(std::span<const lsp_scene* const> scenes, uint32_t uses, LoadPath path, bool numbered);
  VulkanTrace trace(const lsp_trace_options& options, std::span<const LspRay> rays, std::span<LspHit> hits,
                    bool count, size_t scene);
  VulkanTrace trace_instances(const lsp_instances& instances, const lsp_trace_options& options, uint32_t mask,
                              std::span<const LspRay> rays, std::span<LspHit> hits, bool count);

  std::unique_ptr<Device> device;
  std::vector<Loaded> loaded;
  LoadPath load_path = LoadPath::kAutomatic;
  std::string load_note;
  double load_seconds = 0;
  std::string device_name;

 private:
  void open();
  void close() noexcept;
  void unload() noexcept;
  void load_all(std::span<const lsp_scene* const> scenes, LoadPath path, bool numbered);
  void load_next(const lsp_scene& scene, LoadPath path);
  bool try_import(const lsp_scene& scene, bool forced);
  void attach(const lsp_scene& scene, SceneBuffers&& buffers, bool imported);
  void try_instances();
  void check_assets(std::span<const lsp_scene* const> scenes) const;
  lsp_trace_options options_for(uint32_t use) const;
  lsp_trace_options as_loaded(lsp_trace_options options) const;
  void put_instances(const lsp_instances& instances, const lsp_trace_options& options);
  // Records the dispatch that traces so many rays; its pipeline and set are ready.
  using Record = std::function<void(VkCommandBuffer, uint32_t count)>;
  // Traces one ray on the CPU, which adds to the counts unless they are null.
  using Retrace = std::function<lsp_status(const LspRay&, LspHit&, lsp_trace_counts*, lsp_error*)>;
  void begin_trace(std::span<const LspRay> rays, std::span<LspHit> hits);
  uint32_t batch_rays() const { return std::min(lsp_vulkan_max_rays(&device->limits), kBatchRays); }
  VulkanTrace trace_batches(const Record& record, const Retrace& retrace, std::span<const LspRay> rays,
                            std::span<LspHit> hits, bool counting);
  double trace_batch(const Record& record, const LspRay* rays, LspHit* hits, uint32_t count, bool counting);
  void record_batch(const Record& record, uint32_t count);

  VulkanOptions options_;
  uint32_t uses_ = 0;
  bool instanced_ = false;  // the scenes are assets of instances
  std::string name_;        // of the scene that is being loaded, before what is wrong with it
  std::unique_ptr<Shader> shader_;
  std::unique_ptr<Pipelines> pipelines_;
  Buffer counters_;
  BatchBuffers batch_;
  Buffer assets_;     // an lsp_vulkan_asset for each that is loaded
  Buffer instances_;  // as lsp_instances_build has filled it
  VkDeviceSize instances_capacity_ = 0;
};

void VulkanTracer::Impl::open() {
  device = std::make_unique<Device>(options_);
  device_name = device->properties.deviceName;
  shader_ = std::make_unique<Shader>(*device);
  counters_ = Buffer(*device, sizeof(lsp_trace_counts), VK_BUFFER_USAGE_STORAGE_BUFFER_BIT, kHost, 0);
}

void VulkanTracer::Impl::close() noexcept {
  unload();
  instances_ = {};
  instances_capacity_ = 0;
  batch_ = {};
  counters_ = {};
  shader_.reset();
  device.reset();
}

void VulkanTracer::Impl::unload() noexcept {
  pipelines_.reset();
  assets_ = {};
  loaded.clear();
}

// Refuses, by its number, an asset that the shader of instances cannot trace for every use.
void VulkanTracer::Impl::check_assets(std::span<const lsp_scene* const> scenes) const {
  std::vector<lsp_vulkan_plan> plans(scenes.size());
  for (size_t i = 0; i < scenes.size(); ++i) {
    lsp_error error;
    const lsp_status status = lsp_vulkan_plan_buffers(scenes[i], uses_, &device->limits, &plans[i], &error);
    if (status != LSP_OK)
      throw Failure(static_cast<Exit>(status), "", "asset " + std::to_string(i) + ": " + error.message);
  }
  if ((uses_ & LSP_USE_EXACT) != 0) plan_instances(scenes, plans, options_for(LSP_USE_EXACT));
  if ((uses_ & (LSP_USE_APPROXIMATE | LSP_USE_TABLES)) != 0)
    plan_instances(scenes, plans, options_for(LSP_USE_APPROXIMATE));
}

// Rays of one use, such as what is loaded can answer.
lsp_trace_options VulkanTracer::Impl::options_for(uint32_t use) const {
  lsp_trace_options options{};
  if (use != LSP_USE_EXACT) options.flags |= LSP_TRACE_APPROXIMATE;
  if ((uses_ & LSP_USE_OCCLUSION) != 0) options.flags |= LSP_TRACE_OCCLUSION;
  return options;
}

// Adds the scene and traces one ray, so that a device that cannot read it fails here. Of assets that is left
// to try_instances: theirs is another shader, and to compile this one as well takes seconds on lavapipe.
void VulkanTracer::Impl::attach(const lsp_scene& scene, SceneBuffers&& buffers, bool imported) {
  loaded.push_back({scene, std::move(buffers), imported});
  if (instanced_) return;
  try {
    const LspRay ray{scene.header->bounds_min, 0.0f, {1.0f, 1.0f, 1.0f}, 3.402823e38f};
    LspHit hit;
    trace(options_for(uses_ & LSP_USE_EXACT), {&ray, 1}, {&hit, 1}, false, loaded.size() - 1);
  } catch (...) {
    loaded.pop_back();
    throw;
  }
}

// The options by which the CPU traces what the device cut short: where tables alone are loaded, by these.
lsp_trace_options VulkanTracer::Impl::as_loaded(lsp_trace_options options) const {
  if ((options.flags & LSP_TRACE_APPROXIMATE) == 0 || (uses_ & LSP_USE_APPROXIMATE) != 0) return options;
  options.flags |= LSP_TRACE_MAX_LOSS;
  options.max_loss = 100;
  return options;
}

// Traces a ray through an instance of every asset.
void VulkanTracer::Impl::try_instances() {
  std::vector<const lsp_scene*> assets;
  std::vector<lsp_instance> places;
  for (const Loaded& asset : loaded) {
    places.push_back({static_cast<uint32_t>(assets.size()), {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0}, 0xFF, 0});
    assets.push_back(&asset.scene);
  }
  const Instances instances(std::move(assets), places);
  const float* corner = instances.view().nodes[0].lo;
  const LspRay ray{{corner[0], corner[1], corner[2]}, 0.0f, {1.0f, 1.0f, 1.0f}, 3.402823e38f};
  LspHit hit;
  trace_instances(instances.view(), options_for(uses_ & LSP_USE_EXACT), 0xFF, {&ray, 1}, {&hit, 1}, false);
}

bool VulkanTracer::Impl::try_import(const lsp_scene& scene, bool forced) {
  std::string why = "the device has memory of its own";
  if (forced || device->shares_memory) {
    try {
      attach(scene, SceneBuffers::import_mapping(*device, scene, uses_), true);
      return true;
    } catch (const DeviceLost&) {
      throw;
    } catch (const Failure& failure) {
      why = failure.what();
    }
  }
  if (forced) throw Failure(Exit::kUnsupported, "", "the mapping cannot be imported: " + why);
  if (load_note.empty()) load_note = name_ + why;
  return false;
}

void VulkanTracer::Impl::load_next(const lsp_scene& scene, LoadPath path) {
  // What no way of loading can mend is said before the first is tried.
  lsp_vulkan_plan plan;
  lsp_error error;
  const lsp_status status = lsp_vulkan_plan_buffers(&scene, uses_, &device->limits, &plan, &error);
  if (status != LSP_OK) throw Failure(static_cast<Exit>(status), "", error.message);
  if (path != LoadPath::kUpload && try_import(scene, path == LoadPath::kImport)) return;
  attach(scene, SceneBuffers::upload(*device, scene, uses_, options_.discrete), false);
}

void VulkanTracer::Impl::load_all(std::span<const lsp_scene* const> scenes, LoadPath path, bool numbered) {
  unload();
  if (numbered) check_assets(scenes);
  uint32_t stack = 1;
  for (const lsp_scene* scene : scenes) stack = std::max(stack, scene->header->max_stack);
  pipelines_ = std::make_unique<Pipelines>(*device, *shader_, stack);
  loaded.reserve(scenes.size());
  for (size_t i = 0; i < scenes.size(); ++i) {
    name_ = numbered ? "asset " + std::to_string(i) + ": " : "";
    try {
      load_next(*scenes[i], path);
    } catch (const DeviceLost&) {
      throw;
    } catch (const Failure& failure) {
      unload();
      throw Failure(failure.exit(), failure.file(), name_ + failure.what());
    }
  }
  if (numbered && !loaded.empty()) try_instances();
}

void VulkanTracer::Impl::load(std::span<const lsp_scene* const> scenes, uint32_t uses, LoadPath path,
                              bool numbered) {
  const auto start = std::chrono::steady_clock::now();
  if (numbered && device->address_uses == 0)
    throw Failure(Exit::kUnsupported, "",
                  "instances need buffer addresses (bufferDeviceAddress), which the device lacks; trace them "
                  "on the CPU");
  instanced_ = numbered;
  uses_ = uses | (numbered ? LSP_USE_ADDRESSES_ALWAYS : device->address_uses);
  load_note.clear();
  try {
    load_all(scenes, path, numbered);
  } catch (const DeviceLost& lost) {
    // An import may cost the device: on a new one everything is a copy.
    if (path == LoadPath::kUpload) throw;
    close();
    open();
    load_note = name_ + lost.what();
    if (path == LoadPath::kImport)
      throw Failure(Exit::kUnsupported, "", name_ + "the mapping cannot be imported: " + lost.what());
    load_all(scenes, LoadPath::kUpload, numbered);
  }
  const bool imported = std::ranges::any_of(loaded, &Loaded::imported);
  load_path = imported ? LoadPath::kImport : LoadPath::kUpload;
  load_seconds = seconds_since(start);
}

void VulkanTracer::Impl::record_batch(const Record& record, uint32_t count) {
  constexpr VkPipelineStageFlagBits kCompute = VK_PIPELINE_STAGE_COMPUTE_SHADER_BIT;
  constexpr VkPipelineStageFlags kTransfer = VK_PIPELINE_STAGE_TRANSFER_BIT;
  const auto& vk = device->vk;
  const VkCommandBuffer commands = shader_->commands;
  const VkBufferCopy all{0, 0, VkDeviceSize{count} * sizeof(LspRay)};
  VkCommandBufferBeginInfo begin{};
  begin.sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO;
  begin.flags = VK_COMMAND_BUFFER_USAGE_ONE_TIME_SUBMIT_BIT;
  check(vk.vkBeginCommandBuffer(commands, &begin), "vkBeginCommandBuffer");
  if (batch_.staged()) {
    vk.vkCmdCopyBuffer(commands, batch_.rays.handle(), batch_.device_rays.handle(), 1, &all);
    record_barrier(*device, commands, kTransfer, VK_ACCESS_TRANSFER_WRITE_BIT, kCompute,
                   VK_ACCESS_SHADER_READ_BIT);
  }
  if (shader_->timer != VK_NULL_HANDLE) {
    vk.vkCmdResetQueryPool(commands, shader_->timer, 0, 2);
    vk.vkCmdWriteTimestamp(commands, kCompute, shader_->timer, 0);
  }
  record(commands, count);
  if (shader_->timer != VK_NULL_HANDLE) vk.vkCmdWriteTimestamp(commands, kCompute, shader_->timer, 1);
  if (batch_.staged()) {
    record_barrier(*device, commands, kCompute, VK_ACCESS_SHADER_WRITE_BIT, kTransfer,
                   VK_ACCESS_TRANSFER_READ_BIT);
    vk.vkCmdCopyBuffer(commands, batch_.device_hits.handle(), batch_.hits.handle(), 1, &all);
  }
  record_barrier(*device, commands, kCompute | kTransfer,
                 VK_ACCESS_SHADER_WRITE_BIT | VK_ACCESS_TRANSFER_WRITE_BIT, VK_PIPELINE_STAGE_HOST_BIT,
                 VK_ACCESS_HOST_READ_BIT);
}

// Returns the seconds in the shader.
double VulkanTracer::Impl::trace_batch(const Record& record, const LspRay* rays, LspHit* hits, uint32_t count,
                                       bool counting) {
  memcpy(batch_.rays.mapped(), rays, size_t{count} * sizeof(LspRay));
  if (counting) memset(counters_.mapped(), 0, sizeof(lsp_trace_counts));
  record_batch(record, count);
  device->submit_and_wait(shader_->commands, shader_->fence);
  memcpy(hits, batch_.hits.mapped(), size_t{count} * sizeof(LspHit));
  if (shader_->timer == VK_NULL_HANDLE) return 0;
  uint64_t ticks[2] = {};
  check(device->vk.vkGetQueryPoolResults(device->handle, shader_->timer, 0, 2, sizeof ticks, ticks,
                                         sizeof ticks[0], VK_QUERY_RESULT_64_BIT | VK_QUERY_RESULT_WAIT_BIT),
        "vkGetQueryPoolResults");
  return static_cast<double>(ticks[1] - ticks[0]) * device->seconds_per_tick;
}

// Makes room for rays and hits.
void VulkanTracer::Impl::begin_trace(std::span<const LspRay> rays, std::span<LspHit> hits) {
  if (hits.size() != rays.size()) throw Failure(Exit::kInternal, "", "as many hits as rays are needed");
  const auto capacity = static_cast<uint32_t>(std::min<size_t>(rays.size(), batch_rays()));
  if (capacity <= batch_.capacity) return;
  batch_ = {};  // before the new ones are made, not after
  batch_ = BatchBuffers(*device, capacity);
}

VulkanTrace VulkanTracer::Impl::trace_batches(const Record& record, const Retrace& retrace,
                                              std::span<const LspRay> rays, std::span<LspHit> hits,
                                              bool counting) {
  VulkanTrace result;
  const uint32_t most = batch_rays();
  for (size_t first = 0; first < rays.size(); first += most) {
    const auto size = static_cast<uint32_t>(std::min<size_t>(rays.size() - first, most));
    result.gpu_seconds += trace_batch(record, &rays[first], &hits[first], size, counting);
    if (counting) {
      lsp_trace_counts counts;
      memcpy(&counts, counters_.mapped(), sizeof counts);
      lsp_add_counts(&result.counts, &counts);
    }
    ++result.batches;
  }
  for (size_t i = 0; i < hits.size(); ++i) {
    if ((hits[i].flags & LSP_HIT_INCOMPLETE) == 0) continue;
    lsp_trace_counts counts{};
    lsp_error error;
    const lsp_status status = retrace(rays[i], hits[i], counting ? &counts : nullptr, &error);
    if (status != LSP_OK) throw Failure(static_cast<Exit>(status), "", error.message);
    ++result.retraced;
    lsp_add_counts(&result.counts, &counts);
  }
  result.counts.rays = rays.size();  // those retraced are not counted twice
  return result;
}

VulkanTrace VulkanTracer::Impl::trace(const lsp_trace_options& options, std::span<const LspRay> rays,
                                      std::span<LspHit> hits, bool count, size_t number) {
  if (number >= loaded.size())
    throw Failure(Exit::kUnsupported, "", "the scene is not loaded for this kind of trace");
  const auto start = std::chrono::steady_clock::now();
  begin_trace(rays, hits);
  const Loaded& scene = loaded[number];
  lsp_vulkan_kind kind;
  lsp_error error;
  const lsp_status status =
      lsp_vulkan_plan_trace(&scene.scene, &scene.buffers.plan(), &options, &kind, &error);
  if (status != LSP_OK) throw Failure(static_cast<Exit>(status), "", error.message);
  lsp_vulkan_write_descriptors(&device->functions, device->handle, shader_->set, &scene.buffers.plan(),
                               scene.buffers.handles(), batch_.shader_rays(), batch_.shader_hits(),
                               counters_.handle());
  if (scene.buffers.plan().addresses != 0) {
    lsp_vulkan_write_address_table(&device->functions, device->handle, shader_->set,
                                   scene.buffers.addresses());
  }
  const VkPipeline pipeline = pipelines_->get(scene.buffers.plan(), count, kind);
  const auto record = [&](VkCommandBuffer commands, uint32_t size) {
    const lsp_vulkan_trace_constants constants{options.lod, 0, size, kind.dial};
    lsp_vulkan_record_trace(&device->functions, commands, pipeline, shader_->layout, shader_->set,
                            &constants);
  };
  const lsp_trace_options again = as_loaded(options);
  const auto retrace = [&](const LspRay& ray, LspHit& hit, lsp_trace_counts* counts, lsp_error* error) {
    return lsp_trace(&scene.scene, &again, &ray, &hit, 1, counts, error);
  };
  VulkanTrace result = trace_batches(record, retrace, rays, hits, count);
  result.seconds = seconds_since(start);
  return result;
}

// Brings the assets, with the dial of the options, and the instances to the device.
void VulkanTracer::Impl::put_instances(const lsp_instances& instances, const lsp_trace_options& options) {
  constexpr VkMemoryPropertyFlags kNear = VK_MEMORY_PROPERTY_DEVICE_LOCAL_BIT;
  std::vector<lsp_vulkan_asset> described(std::max<size_t>(loaded.size(), 1));
  for (size_t i = 0; i < loaded.size(); ++i) {
    const SceneBuffers& buffers = loaded[i].buffers;
    lsp_error error;
    const lsp_status status = lsp_vulkan_describe_asset(
        &loaded[i].scene, &buffers.plan(), buffers.buffer_addresses(), &options, &described[i], &error);
    if (status != LSP_OK)
      throw Failure(static_cast<Exit>(status), "", "asset " + std::to_string(i) + ": " + error.message);
  }
  const size_t bytes = described.size() * sizeof described[0];
  if (assets_.handle() == VK_NULL_HANDLE)
    assets_ = Buffer(*device, bytes, VK_BUFFER_USAGE_STORAGE_BUFFER_BIT, kHost, kNear);
  memcpy(assets_.mapped(), described.data(), bytes);
  const VkDeviceSize size = lsp_instances_bytes(instances.count);
  if (size > device->limits.max_storage_buffer_range)
    throw Failure(Exit::kLimit, "",
                  std::to_string(instances.count) + " instances have " + std::to_string(size) +
                      " bytes, storage buffers of this device at most " +
                      std::to_string(device->limits.max_storage_buffer_range) + "; trace them on the CPU");
  if (size > instances_capacity_ || instances_.handle() == VK_NULL_HANDLE) {
    instances_ = {};
    instances_ =
        Buffer(*device, std::max<VkDeviceSize>(size, 16), VK_BUFFER_USAGE_STORAGE_BUFFER_BIT, kHost, kNear);
    instances_capacity_ = size;
  }
  if (size > 0) memcpy(instances_.mapped(), instances.records, size);
}

VulkanTrace VulkanTracer::Impl::trace_instances(const lsp_instances& instances,
                                                const lsp_trace_options& wanted, uint32_t mask,
                                                std::span<const LspRay> rays, std::span<LspHit> hits,
                                                bool count) {
  if (instances.count > 0 && instances.asset_count != loaded.size())
    throw Failure(Exit::kInternal, "", "the instances' assets are not those that were loaded");
  const auto start = std::chrono::steady_clock::now();
  std::vector<const lsp_scene*> scenes;
  std::vector<lsp_vulkan_plan> plans;
  for (const Loaded& asset : loaded) {
    scenes.push_back(&asset.scene);
    plans.push_back(asset.buffers.plan());
  }
  const lsp_vulkan_kind kind = plan_instances(scenes, plans, wanted);
  begin_trace(rays, hits);
  put_instances(instances, wanted);
  lsp_vulkan_write_instance_descriptors(&device->functions, device->handle, shader_->set, assets_.handle(),
                                        instances_.handle(), batch_.shader_rays(), batch_.shader_hits(),
                                        counters_.handle());
  const VkPipeline pipeline = pipelines_->get_instances(count, kind.flags, kind.parts);
  const auto record = [&](VkCommandBuffer commands, uint32_t size) {
    const lsp_vulkan_instance_constants constants{instances.count, 0, size, mask};
    lsp_vulkan_record_instances(&device->functions, commands, pipeline, shader_->layout, shader_->set,
                                &constants);
  };
  const lsp_trace_options again = as_loaded(wanted);
  const auto retrace = [&](const LspRay& ray, LspHit& hit, lsp_trace_counts* counts, lsp_error* error) {
    return lsp_trace_instances(&instances, &again, mask, &ray, &hit, 1, counts, error);
  };
  VulkanTrace result = trace_batches(record, retrace, rays, hits, count);
  result.seconds = seconds_since(start);
  return result;
}

bool VulkanTracer::available(std::string* why) { return Device::any(why); }

VulkanTracer::VulkanTracer(const VulkanOptions& options) : impl_(std::make_unique<Impl>(options)) {}
VulkanTracer::~VulkanTracer() = default;
VulkanTracer::VulkanTracer(VulkanTracer&&) noexcept = default;
VulkanTracer& VulkanTracer::operator=(VulkanTracer&&) noexcept = default;

void VulkanTracer::load(const lsp_scene& scene, uint32_t uses, LoadPath path) {
  const lsp_scene* const scenes[] = {&scene};
  impl_->load(scenes, uses, path, false);
}

void VulkanTracer::load(std::span<const lsp_scene* const> assets, uint32_t uses, LoadPath path) {
  impl_->load(assets, uses, path, true);
}

VulkanTrace VulkanTracer::trace(const lsp_trace_options& options, std::span<const LspRay> rays,
                                std::span<LspHit> hits, bool count, size_t scene) {
  return impl_->trace(options, rays, hits, count, scene);
}

VulkanTrace VulkanTracer::trace_instances(const lsp_instances& instances, const lsp_trace_options& options,
                                          uint32_t mask, std::span<const LspRay> rays, std::span<LspHit> hits,
                                          bool count) {
  return impl_->trace_instances(instances, options, mask, rays, hits, count);
}

size_t VulkanTracer::scene_count() const { return impl_->loaded.size(); }
const std::string& VulkanTracer::device_name() const { return impl_->device_name; }
LoadPath VulkanTracer::load_path() const { return impl_->load_path; }
const std::string& VulkanTracer::load_note() const { return impl_->load_note; }
uint64_t VulkanTracer::bytes_imported() const {
  uint64_t sum = 0;
  for (const Loaded& scene : impl_->loaded) sum += scene.buffers.bytes_imported();
  return sum;
}
uint64_t VulkanTracer::bytes_uploaded() const {
  uint64_t sum = 0;
  for (const Loaded& scene : impl_->loaded) sum += scene.buffers.bytes_uploaded();
  return sum;
}
double VulkanTracer::load_seconds() const { return impl_->load_seconds; }

std::vector<std::string> VulkanTracer::validation_messages() const {
  const std::lock_guard lock(impl_->device->messages_mutex);
  return impl_->device->messages;
}

}  // namespace lsp
