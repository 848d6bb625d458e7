#include <algorithm>
#include <chrono>
#include <cstring>
#include <map>
#include <memory>
#include <tuple>

#include "lsp/instances.hpp"
#include "ray_batches.h"
#include "scene_buffers.h"
#include "trace_shader.h"

namespace lsp {
namespace {

double seconds_since(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

void check_sizes(std::span<const LspRay> rays, std::span<LspHit> hits) {
  if (hits.size() != rays.size()) throw Failure(Exit::kInternal, "", "as many hits as rays are needed");
}

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
  Pipelines(Device& device, TraceShader& shader, uint32_t stack)
      : device_(device), shader_(shader), stack_(stack) {}
  ~Pipelines() {
    for (const auto& [key, pipeline] : made_) device_.vk.vkDestroyPipeline(device_.handle, pipeline, nullptr);
  }
  Pipelines(const Pipelines&) = delete;
  Pipelines& operator=(const Pipelines&) = delete;
  VkPipeline get(lsp_vulkan_plan plan, bool counting, const lsp_vulkan_kind& kind) {
    plan.base_structure = kind.base_structure;
    return find({kind.base_structure, plan.addresses, counting, kind.flags, kind.parts}, kind,
                [&](size_t* bytes) { return lsp_vulkan_trace_spirv(&plan, counting ? 1 : 0, bytes); });
  }
  // The same of a pass, by kind.pass; it does not count.
  VkPipeline get_pass(const lsp_vulkan_kind& kind) {
    return find({kPasses + kind.pass, kind.addresses, false, kind.flags, kind.parts}, kind,
                [&](size_t* bytes) { return lsp_vulkan_passes_spirv(&kind, bytes); });
  }
  // The same of instances, whose assets need these parts of the shader.
  VkPipeline get_instances(bool counting, const lsp_vulkan_kind& kind) {
    return find({kInstances, kind.addresses, counting, kind.flags, kind.parts}, kind,
                [&](size_t* bytes) { return lsp_vulkan_instances_spirv(&kind, counting ? 1 : 0, bytes); });
  }

 private:
  // No base structures' numbers.
  static constexpr uint32_t kInstances = 0;
  static constexpr uint32_t kPasses = 100;

  // What is traced, by base structure or as above; addresses, counting, flags and parts.
  using Key = std::tuple<uint32_t, uint32_t, bool, uint32_t, uint32_t>;

  // The pipeline made before, or one of the words that `spirv` answers.
  template <typename Spirv>
  VkPipeline find(const Key& key, lsp_vulkan_kind kind, Spirv&& spirv) {
    VkPipeline& pipeline = made_[key];
    if (pipeline != VK_NULL_HANDLE) return pipeline;
    kind.stack = stack_;
    size_t bytes = 0;
    const uint32_t* words = spirv(&bytes);
    return pipeline = shader_.create_pipeline(words, bytes, kind);
  }

  Device& device_;
  TraceShader& shader_;
  uint32_t stack_;
  std::map<Key, VkPipeline> made_;
};

// A scene on the device.
struct Loaded {
  lsp_scene scene{};
  SceneBuffers buffers;
  bool imported = false;
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
  void load_all(std::span<const lsp_scene* const> scenes, LoadPath path);
  void load_next(const lsp_scene& scene, const lsp_vulkan_plan& plan, LoadPath path);
  void plan(std::span<const lsp_scene* const> scenes);
  bool pooled() const { return instanced_ && (uses_ & LSP_USE_ADDRESSES_ALWAYS) == 0; }
  std::string name_of_scene(size_t number) const;
  bool try_import(const lsp_scene& scene, const lsp_vulkan_plan& plan, bool forced);
  void attach(const lsp_scene& scene, SceneBuffers&& buffers, bool imported);
  void try_instances();
  void check_assets(std::span<const lsp_scene* const> scenes) const;
  lsp_trace_options options_for(uint32_t use) const;
  lsp_trace_options as_loaded(lsp_trace_options options) const;
  void put_instances(const lsp_instances& instances, const lsp_trace_options& options);

  VulkanOptions options_;
  uint32_t uses_ = 0;
  bool instanced_ = false;  // the scenes are assets of instances
  PoolPlan plan_;           // of the scenes that are loaded
  std::string name_;        // of the scene that is being loaded, before what is wrong with it
  std::unique_ptr<RayBatches> batches_;
  std::unique_ptr<TraceShader> shader_;
  VkDescriptorSet set_ = VK_NULL_HANDLE;
  std::unique_ptr<Pipelines> pipelines_;
  Buffer pool_;       // the sections of all assets; none where they are read through addresses
  Buffer assets_;     // an lsp_vulkan_asset for each that is loaded
  Buffer instances_;  // as lsp_instances_build has filled it
  VkDeviceSize instances_capacity_ = 0;
};

void VulkanTracer::Impl::open() {
  device = std::make_unique<Device>(options_);
  device_name = device->properties.deviceName;
  batches_ = std::make_unique<RayBatches>(*device);
  shader_ = std::make_unique<TraceShader>(*device, 1);
  set_ = shader_->allocate_set();
}

void VulkanTracer::Impl::close() noexcept {
  unload();
  instances_ = {};
  instances_capacity_ = 0;
  shader_.reset();
  batches_.reset();
  device.reset();
}

void VulkanTracer::Impl::unload() noexcept {
  pipelines_.reset();
  assets_ = {};
  loaded.clear();
  pool_ = {};
}

// Refuses, by its number, an asset that the shader of instances cannot trace for every use.
void VulkanTracer::Impl::check_assets(std::span<const lsp_scene* const> scenes) const {
  if ((uses_ & LSP_USE_EXACT) != 0) plan_instances(scenes, plan_.buffers, options_for(LSP_USE_EXACT));
  if ((uses_ & (LSP_USE_APPROXIMATE | LSP_USE_TABLES)) != 0)
    plan_instances(scenes, plan_.buffers, options_for(LSP_USE_APPROXIMATE));
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

bool VulkanTracer::Impl::try_import(const lsp_scene& scene, const lsp_vulkan_plan& plan, bool forced) {
  std::string why = "the device has memory of its own";
  if (forced || device->shares_memory) {
    try {
      attach(scene, SceneBuffers::import_mapping(*device, scene, plan), true);
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

void VulkanTracer::Impl::load_next(const lsp_scene& scene, const lsp_vulkan_plan& plan, LoadPath path) {
  if (path != LoadPath::kUpload && try_import(scene, plan, path == LoadPath::kImport)) return;
  attach(scene, SceneBuffers::upload(*device, scene, plan, options_.discrete), false);
}

// Which buffers the scenes need, and of assets that are not read through addresses where in the pool they
// lie. What no way of loading can mend is said here, before the first is tried.
void VulkanTracer::Impl::plan(std::span<const lsp_scene* const> scenes) {
  plan_ = {};
  for (size_t i = 0; i < scenes.size(); ++i) {
    lsp_vulkan_plan& buffers = plan_.buffers.emplace_back();
    lsp_error error;
    lsp_status status = lsp_vulkan_plan_buffers(scenes[i], uses_, &device->limits, &buffers, &error);
    if (status == LSP_OK && pooled())
      status = lsp_vulkan_place_buffers(&buffers, &device->limits, &plan_.bytes,
                                        plan_.places.emplace_back().data(), &error);
    if (status != LSP_OK) throw Failure(static_cast<Exit>(status), "", name_of_scene(i) + error.message);
  }
}

std::string VulkanTracer::Impl::name_of_scene(size_t number) const {
  return instanced_ ? "asset " + std::to_string(number) + ": " : "";
}

void VulkanTracer::Impl::load_all(std::span<const lsp_scene* const> scenes, LoadPath path) {
  if (instanced_) check_assets(scenes);
  uint32_t stack = 1;
  for (const lsp_scene* scene : scenes) stack = std::max(stack, scene->header->max_stack);
  pipelines_ = std::make_unique<Pipelines>(*device, *shader_, stack);
  loaded.reserve(scenes.size());
  if (pooled()) {
    name_.clear();
    std::vector<SceneBuffers> buffers =
        SceneBuffers::upload_pool(*device, scenes, plan_, options_.discrete, pool_);
    for (size_t i = 0; i < scenes.size(); ++i) attach(*scenes[i], std::move(buffers[i]), false);
  }
  for (size_t i = loaded.size(); i < scenes.size(); ++i) {
    name_ = name_of_scene(i);
    try {
      load_next(*scenes[i], plan_.buffers[i], path);
    } catch (const DeviceLost&) {
      throw;
    } catch (const Failure& failure) {
      unload();
      throw Failure(failure.exit(), failure.file(), name_ + failure.what());
    }
  }
  if (instanced_ && !loaded.empty()) try_instances();
}

void VulkanTracer::Impl::load(std::span<const lsp_scene* const> scenes, uint32_t uses, LoadPath path,
                              bool numbered) {
  const auto start = std::chrono::steady_clock::now();
  instanced_ = numbered;
  uses_ = uses | (device->address_uses & (numbered ? LSP_USE_ADDRESSES_ALWAYS : ~0u));
  // Only by addresses assets are read where they are.
  if (numbered && path == LoadPath::kImport) uses_ |= LSP_USE_ADDRESSES_ALWAYS;
  if ((uses_ & LSP_USE_ADDRESSES_ALWAYS) != 0 && device->address_uses == 0)
    throw Failure(Exit::kUnsupported, "",
                  "assets can be imported only where they are read through buffer addresses "
                  "(bufferDeviceAddress), which the device lacks; upload them");
  load_note.clear();
  unload();
  try {
    plan(scenes);
  } catch (const Failure& failure) {
    // So are as many bytes as there may be.
    if (!numbered || failure.exit() != Exit::kLimit || device->address_uses == 0) throw;
    uses_ |= LSP_USE_ADDRESSES_ALWAYS;
    plan(scenes);
  }
  try {
    load_all(scenes, path);
  } catch (const DeviceLost& lost) {
    // An import may cost the device: on a new one everything is a copy.
    if (path == LoadPath::kUpload) throw;
    close();
    open();
    load_note = name_ + lost.what();
    if (path == LoadPath::kImport)
      throw Failure(Exit::kUnsupported, "", name_ + "the mapping cannot be imported: " + lost.what());
    load_all(scenes, LoadPath::kUpload);
  }
  const bool imported = std::ranges::any_of(loaded, &Loaded::imported);
  load_path = imported ? LoadPath::kImport : LoadPath::kUpload;
  load_seconds = seconds_since(start);
}

VulkanTrace VulkanTracer::Impl::trace(const lsp_trace_options& options, std::span<const LspRay> rays,
                                      std::span<LspHit> hits, bool count, size_t number) {
  if (number >= loaded.size())
    throw Failure(Exit::kUnsupported, "", "the scene is not loaded for this kind of trace");
  const auto start = std::chrono::steady_clock::now();
  batches_->reserve(rays.size());
  const Loaded& scene = loaded[number];
  lsp_vulkan_kind kind;
  lsp_error error;
  const lsp_status status =
      lsp_vulkan_plan_trace(&scene.scene, &scene.buffers.plan(), &options, &kind, &error);
  if (status != LSP_OK) throw Failure(static_cast<Exit>(status), "", error.message);
  lsp_vulkan_write_descriptors(&device->functions, device->handle, set_, &scene.buffers.plan(),
                               scene.buffers.handles(), batches_->rays(), batches_->hits(),
                               batches_->counters());
  if (scene.buffers.plan().addresses != 0) {
    lsp_vulkan_write_address_table(&device->functions, device->handle, set_, scene.buffers.addresses());
  }
  const bool passes = !count && rays.size() >= options_.passes_from && lsp_vulkan_has_passes(&kind) != 0;
  VkPipeline pipelines[LSP_VULKAN_PASS_KINDS]{};
  if (passes) {
    batches_->reserve_queue();
    lsp_vulkan_write_queue(&device->functions, device->handle, set_, batches_->queue());
    for (kind.pass = 0; kind.pass < LSP_VULKAN_PASS_KINDS; ++kind.pass)
      pipelines[kind.pass] = pipelines_->get_pass(kind);
  } else {
    pipelines[0] = pipelines_->get(scene.buffers.plan(), count, kind);
  }
  const auto record = [&](VkCommandBuffer commands, uint32_t size) {
    const lsp_vulkan_trace_constants constants{options.lod, 0, size, kind.dial};
    if (passes) {
      lsp_vulkan_record_passes(&device->functions, commands, pipelines, shader_->layout(), set_,
                               batches_->queue(), &constants);
    } else {
      lsp_vulkan_record_trace(&device->functions, commands, pipelines[0], shader_->layout(), set_,
                              &constants);
    }
  };
  const lsp_trace_options again = as_loaded(options);
  const auto retrace = [&](const LspRay& ray, LspHit& hit, lsp_trace_counts* counts, lsp_error* error) {
    return lsp_trace(&scene.scene, &again, &ray, &hit, 1, counts, error);
  };
  VulkanTrace result = batches_->trace(record, retrace, rays, hits, count);
  result.passes = passes;
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
    const lsp_status status = lsp_vulkan_describe_asset(&loaded[i].scene, &buffers.plan(), buffers.places(),
                                                        &options, &described[i], &error);
    if (status != LSP_OK) throw Failure(static_cast<Exit>(status), "", name_of_scene(i) + error.message);
  }
  const size_t bytes = described.size() * sizeof described[0];
  if (assets_.handle() == VK_NULL_HANDLE)
    assets_ = Buffer(*device, bytes, VK_BUFFER_USAGE_STORAGE_BUFFER_BIT, kHostMemory, kNear);
  memcpy(assets_.mapped(), described.data(), bytes);
  const VkDeviceSize size = lsp_instances_bytes(instances.count);
  if (size > device->limits.max_storage_buffer_range)
    throw Failure(Exit::kLimit, "",
                  std::to_string(instances.count) + " instances have " + std::to_string(size) +
                      " bytes, storage buffers of this device at most " +
                      std::to_string(device->limits.max_storage_buffer_range) + "; trace them on the CPU");
  if (size > instances_capacity_ || instances_.handle() == VK_NULL_HANDLE) {
    instances_ = {};
    instances_ = Buffer(*device, std::max<VkDeviceSize>(size, 16), VK_BUFFER_USAGE_STORAGE_BUFFER_BIT,
                        kHostMemory, kNear);
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
  batches_->reserve(rays.size());
  put_instances(instances, wanted);
  lsp_vulkan_write_instance_descriptors(&device->functions, device->handle, set_, assets_.handle(),
                                        instances_.handle(), pool_.handle(), batches_->rays(),
                                        batches_->hits(), batches_->counters());
  const VkPipeline pipeline = pipelines_->get_instances(count, kind);
  const auto record = [&](VkCommandBuffer commands, uint32_t size) {
    const lsp_vulkan_instance_constants constants{instances.count, 0, size, mask};
    lsp_vulkan_record_instances(&device->functions, commands, pipeline, shader_->layout(), set_, &constants);
  };
  const lsp_trace_options again = as_loaded(wanted);
  const auto retrace = [&](const LspRay& ray, LspHit& hit, lsp_trace_counts* counts, lsp_error* error) {
    return lsp_trace_instances(&instances, &again, mask, &ray, &hit, 1, counts, error);
  };
  VulkanTrace result = batches_->trace(record, retrace, rays, hits, count);
  result.seconds = seconds_since(start);
  return result;
}

bool VulkanTracer::available(std::string* why) { return Device::any(why); }

VulkanTracer::VulkanTracer(const VulkanOptions& options) : impl_(std::make_unique<Impl>(options)) {}
VulkanTracer::~VulkanTracer() = default;

void VulkanTracer::load(const lsp_scene& scene, uint32_t uses, LoadPath path) {
  const lsp_scene* const scenes[] = {&scene};
  impl_->load(scenes, uses, path, false);
}

void VulkanTracer::load(std::span<const lsp_scene* const> assets, uint32_t uses, LoadPath path) {
  impl_->load(assets, uses, path, true);
}

VulkanTrace VulkanTracer::trace(const lsp_trace_options& options, std::span<const LspRay> rays,
                                std::span<LspHit> hits, bool count, size_t scene) {
  check_sizes(rays, hits);
  return impl_->trace(options, rays, hits, count, scene);
}

VulkanTrace VulkanTracer::trace_instances(const lsp_instances& instances, const lsp_trace_options& options,
                                          uint32_t mask, std::span<const LspRay> rays, std::span<LspHit> hits,
                                          bool count) {
  check_sizes(rays, hits);
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
