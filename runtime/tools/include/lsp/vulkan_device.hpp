// A Vulkan device of one's own that traces files: for programs without an engine around them.
//
// An engine has its device already and uses lsp_vulkan.h. This helper is what lsp-trace, lsp-render,
// lsp-bench and the tests share: it finds a device, puts scenes on it by import or by upload, and traces
// batches of rays, through instances, too.
#pragma once

#include <memory>
#include <span>
#include <string>
#include <vector>

#include "lsp/lsp_instances.h"
#include "lsp/lsp_vulkan.h"

namespace lsp {

enum class LoadPath {
  kAutomatic,  // import where the device shares the host's memory and allows it, upload otherwise
  kImport,     // the mapping itself is the buffer; an error where that is impossible
  kUpload,     // one copy from the mapping
};

// "import", "upload" or "automatic", the words of the programs' options and reports.
const char* name_of(LoadPath path);

struct VulkanOptions {
  std::string device;       // part of the device's name; empty: a GPU if there is one, else what there is
  bool validation = false;  // the Khronos layer, core and synchronization; see validation_messages
  bool addresses = false;   // read sections through buffer addresses even where other ways would do
  bool discrete = false;    // treat the device as a discrete GPU: staging buffers, never an import on its own
  uint32_t max_storage_buffer_range = 0xFFFFFFFFu;  // or the device's, where that is less
  // Rays at once, from which on cells are traced in passes: lsp_vulkan_record_passes.
  size_t passes_from = 8192;
};

struct VulkanTrace {
  double seconds = 0;         // wall clock, copies of rays and hits included
  double gpu_seconds = 0;     // in the shader, by the device's timestamps; 0 where it has none
  uint64_t retraced = 0;      // rays that the device cut short, traced again on the CPU
  uint64_t batches = 0;       // of rays; a dispatch each, or with passes a dispatch a pass
  bool passes = false;        // cells were traced in passes
  lsp_trace_counts counts{};  // rays and, if asked for, the rest
};

// One device with one scene on it, or several. Not for use by several threads at once. Every function throws
// lsp::Failure: kUnsupported without a device or a feature of it, kLimit where a limit of the device is in
// the way, kInternal where Vulkan fails.
class VulkanTracer {
 public:
  // Is there a device at all? If not, *why (unless null) says what is missing.
  static bool available(std::string* why = nullptr);

  explicit VulkanTracer(const VulkanOptions& options = {});
  ~VulkanTracer();
  VulkanTracer(const VulkanTracer&) = delete;
  VulkanTracer& operator=(const VulkanTracer&) = delete;

  // Puts `scene` on the device for `uses` (LSP_USE_*), in place of the one before, and traces a ray to see
  // that it works. The scene's bytes must stay mapped until the next load or the end of the tracer: imported
  // they are the buffer, and rays that the device cuts short are traced from them.
  void load(const lsp_scene& scene, uint32_t uses, LoadPath path = LoadPath::kAutomatic);

  // Puts several on it, as the assets of instances: each once, however many instances it has, all in one
  // buffer. Where they are more than a storage buffer may hold, or are to be imported, or with
  // options.addresses, each has its own, and the device needs buffer addresses (kUnsupported, kLimit). An
  // asset needs cells or wide nodes for every use. Failures name the asset by its number.
  void load(std::span<const lsp_scene* const> assets, uint32_t uses, LoadPath path = LoadPath::kAutomatic);

  // Traces `rays` into `hits`, of the same size. Counting uses a second, slower shader.
  VulkanTrace trace(const lsp_trace_options& options, std::span<const LspRay> rays, std::span<LspHit> hits,
                    bool count = false, size_t scene = 0);

  // As lsp_trace_instances, with its bits, of instances whose assets are loaded, in their order; the device
  // walks the tree over them. The instances may be others, or elsewhere, every time.
  VulkanTrace trace_instances(const lsp_instances& instances, const lsp_trace_options& options, uint32_t mask,
                              std::span<const LspRay> rays, std::span<LspHit> hits, bool count = false);

  size_t scene_count() const;  // that are loaded
  const std::string& device_name() const;
  LoadPath load_path() const;            // kImport where a scene was imported, else kUpload
  const std::string& load_note() const;  // why an automatic load did not import all, empty if it did
  uint64_t bytes_imported() const;       // of the mappings, 0 after an upload
  uint64_t bytes_uploaded() const;
  double load_seconds() const;  // wall clock of load, the first dispatch included
  // What the validation layer has said so far; empty is clean. Without options.validation always empty.
  std::vector<std::string> validation_messages() const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace lsp
