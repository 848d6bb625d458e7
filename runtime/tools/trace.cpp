// lsp-trace: traces a file of rays against an .lsp file or a scene of instances.
#include <algorithm>
#include <iostream>
#include <optional>

#include <unistd.h>

#include <nlohmann/json.hpp>

#include "lsp/command_line.h"
#include "lsp/in_chunks.hpp"
#include "lsp/instanced_scene.hpp"
#include "lsp/json_result.h"
#include "lsp/output_file.h"
#include "lsp/scene_file.hpp"
#include "lsp/trace_arguments.hpp"
#include "ray_files.h"
#include "trace_run.h"

namespace lsp {
namespace {

struct Options {
  std::string file;
  std::string rays;
  std::string hits;
  std::string backend = "cpu";
  std::string mode;  // empty: approximate where the file has Line Spaces, else exact
  std::string query = "closest";
  std::string load_path = "automatic";
  std::string device;
  TraceArguments trace;
  uint32_t repeats = 1;
  uint32_t threads = 0;  // all
  CommonOptions common;
};

void define(CLI::App& app, Options& options) {
  add_common_options(app, "lsp-trace", options.common);
  app.add_option("FILE.lsp", options.file, "The scene: an .lsp file, or .json with instances of several")
      ->required();
  app.add_option("--rays", options.rays, "Rays: 32 bytes each, origin, tmin, direction, tmax as float32")
      ->required();
  app.add_option("--hits", options.hits,
                 "Hits to write: 32 bytes each, t, primitive, u, v, normal as float32 (primitive uint32), "
                 "flags uint32, from bit 8 on the instance's number")
      ->required();
  app.add_option(
         "--backend", options.backend,
         "Where to trace (default cpu); of a scene of instances vulkan needs assets with cells or wide nodes")
      ->check(CLI::IsMember({"cpu", "vulkan"}));
  app.add_option("--mode", options.mode,
                 "Down to triangles or by Line Spaces; without it by Line Spaces if there are any")
      ->check(CLI::IsMember({"exact", "approximate"}));
  app.add_option(
         "--query", options.query,
         "The closest hit, any hit, or no more than whether there is one: then only t says something, "
         "finite where there is (default closest)")
      ->check(CLI::IsMember({"closest", "any", "occlusion"}));
  add_trace_arguments(app, options.trace);
  app.add_option("--repeat", options.repeats, "Times to trace all rays (default 1)")
      ->check(CLI::Range(1u, 1000000u));
  add_threads(app, options.threads, "Threads of the CPU backend");
  app.add_option("--device", options.device,
                 "Part of the Vulkan device's name; without it a GPU if there is one");
  app.add_option("--load", options.load_path, "How the scene gets to the Vulkan device (default automatic)")
      ->check(CLI::IsMember({"automatic", "import", "upload"}));
  arrange_help(app, "lsp-trace room.lsp --rays rays.bin --hits hits.bin --json",
               {{"What most people need",
                 {"FILE.lsp", "--rays FILE", "--hits FILE", "--mode", "--query", "--backend"}},
                {"Approximate mode", {"--near", "--lod", "--quality", "--max-loss PERCENT"}},
                {"The machine", {"--repeat", "--threads", "--device NAME", "--load"}}});
}

double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  const size_t half = values.size() / 2;
  return values.size() % 2 == 1 ? values[half] : 0.5 * (values[half - 1] + values[half]);
}

double per(double sum, uint64_t count) { return count == 0 ? 0.0 : sum / static_cast<double>(count); }

// What a packed file may grow to: the machine's memory.
uint64_t physical_memory() {
  const long pages = sysconf(_SC_PHYS_PAGES);
  const long page = sysconf(_SC_PAGESIZE);
  return pages > 0 && page > 0 ? static_cast<uint64_t>(pages) * static_cast<uint64_t>(page) : UINT64_MAX;
}

// What a program's argument names: one file, or several and their instances.
class Scene {
 public:
  explicit Scene(const std::string& path) {
    if (is_instanced_scene(path)) {
      scene_.emplace(path, physical_memory());
      for (const auto& asset : scene_->assets()) add(*asset);
      target_.instances = &scene_->instances().view();
    } else {
      file_.emplace(with_failures([&] { return SceneFile(path, physical_memory()); }));
      add(*file_);
      target_.scene = &file_->scene();
    }
  }
  const TraceTarget& target() const { return target_; }
  const InstancedScene* instanced() const { return scene_ ? &*scene_ : nullptr; }
  uint64_t bytes_mapped() const { return bytes_mapped_; }
  bool any_has(uint32_t features) const { return (features_ & features) != 0; }

  const std::vector<const LspHeader*>& headers() const { return headers_; }

 private:
  void add(const SceneFile& file) {
    headers_.push_back(&file.header());
    features_ |= file.header().required_features;
    bytes_mapped_ += file.bytes_mapped();
    if (file.unpacked())
      ++target_.unpacked;
    else
      target_.mapped.push_back(&file.scene());
  }

  std::optional<SceneFile> file_;
  std::optional<InstancedScene> scene_;
  std::vector<const LspHeader*> headers_;
  uint32_t features_ = 0;
  uint64_t bytes_mapped_ = 0;
  TraceTarget target_;
};

TraceRequest make_request(const Options& options, const Scene& scene) {
  TraceRequest request;
  const bool line_spaces = scene.any_has(LSP_FEATURE_LINE_SPACES | LSP_FEATURE_CELLS);
  const bool approximate = options.mode.empty() ? line_spaces : options.mode == "approximate";
  request.options = to_trace_options(options.trace, approximate);
  if (options.query == "any") request.options.flags |= LSP_TRACE_ANY_HIT;
  if (options.query == "occlusion") request.options.flags |= LSP_TRACE_OCCLUSION;
  request.vulkan = options.backend == "vulkan";
  request.repeats = options.repeats;
  request.threads = options.threads != 0 ? options.threads : machine_threads();
  request.device = options.device;
  if (options.load_path == "import") request.load_path = LoadPath::kImport;
  if (options.load_path == "upload") request.load_path = LoadPath::kUpload;
  request.progress = !options.common.quiet && isatty(STDERR_FILENO) != 0;
  return request;
}

nlohmann::ordered_json to_json(const Options& options, const TraceRequest& request, const Scene& scene,
                               const TraceReport& report) {
  const lsp_trace_counts& counts = report.counts;
  nlohmann::ordered_json json;
  json["file"] = options.file;
  if (const InstancedScene* instanced = scene.instanced(); instanced != nullptr) {
    json["instances"] = instanced->instances().size();
    json["assets"] = instanced->assets().size();
  }
  json["backend"] = options.backend;
  json["mode"] = (request.options.flags & LSP_TRACE_APPROXIMATE) != 0 ? "approximate" : "exact";
  json["query"] = options.query;
  json["near"] = options.trace.near;
  json["lod"] = options.trace.lod;
  json["threads"] = request.vulkan ? 0u : request.threads;
  json["rays"] = counts.rays;
  json["invalid"] = counts.invalid;
  json["hits"] = counts.hits;
  json["seconds"] = report.seconds;
  if (request.vulkan) json["gpu_seconds"] = report.gpu_seconds;
  const double seconds = median(report.seconds);
  json["mrays_per_second"] = seconds > 0 ? static_cast<double>(counts.rays) * 1e-6 / seconds : 0.0;
  json["device"] = report.device;
  json["load_path"] = report.load_path;
  if (!report.load_note.empty()) json["load_note"] = report.load_note;
  if (request.vulkan) json["load_seconds"] = report.load_seconds;
  json["bytes_mapped"] = scene.bytes_mapped();
  json["bytes_paged_in"] = report.bytes_paged_in;
  json["bytes_imported"] = report.bytes_imported;
  json["bytes_uploaded"] = report.bytes_uploaded;
  json["retraced"] = report.retraced;
  if (scene.any_has(LSP_FEATURE_CELLS | LSP_FEATURE_WIDE_BASE)) {
    json["quality"] = options.trace.quality_name();
    if (options.trace.max_loss >= 0) json["max_loss"] = options.trace.max_loss;
    json["steps_per_ray"] = per(static_cast<double>(counts.nodes), counts.rays);
    json["lookups_per_ray"] = per(static_cast<double>(counts.shafts), counts.rays);
    json["splits_per_ray"] = per(static_cast<double>(counts.splits), counts.rays);
    json["exact_calls_per_ray"] = per(static_cast<double>(counts.exact), counts.rays);
    json["exact_nodes_per_ray"] = per(static_cast<double>(counts.exact_nodes), counts.rays);
  }
  json["nodes_per_ray"] = per(static_cast<double>(counts.nodes), counts.rays);
  json["shafts_per_ray"] = per(static_cast<double>(counts.shafts), counts.rays);
  json["triangles_per_ray"] = per(static_cast<double>(counts.triangles), counts.rays);
  return json;
}

void print(const nlohmann::ordered_json& json) {
  const auto number = [&](const char* key, int digits) {
    char text[64];
    snprintf(text, sizeof text, "%.*f", digits, json[key].get<double>());
    return std::string(text);
  };
  const auto word = [&](const char* key) { return json[key].get<std::string>(); };
  std::cout << number("rays", 0) << " rays (" << number("invalid", 0) << " invalid), " << number("hits", 0)
            << " hits, " << word("mode") << ", " << word("query") << "\n"
            << number("mrays_per_second", 3) << " Mrays/s on " << word("device") << ", load path "
            << word("load_path") << "\n"
            << "a ray: " << number("nodes_per_ray", 2) << " nodes, " << number("shafts_per_ray", 2)
            << " shafts, " << number("triangles_per_ray", 2) << " triangles\n"
            << "bytes: " << number("bytes_mapped", 0) << " mapped, " << number("bytes_paged_in", 0)
            << " paged in, " << number("bytes_imported", 0) << " imported, " << number("bytes_uploaded", 0)
            << " uploaded\n";
  if (json["retraced"] != 0) {
    std::cout << number("retraced", 0) << " rays were cut short by the device and traced on the CPU\n";
  }
}

void run(const Options& options) {
  const std::filesystem::path inputs[] = {options.file, options.rays};
  check_output(options.hits, inputs);
  const Scene scene(options.file);
  if (scene.instanced() != nullptr) {
    const auto& assets = scene.instanced()->asset_paths();
    check_output(options.hits, std::vector<std::filesystem::path>(assets.begin(), assets.end()));
  }
  const std::vector<LspRay> rays = read_rays(options.rays);
  std::vector<LspHit> hits(rays.size());
  const TraceRequest request = make_request(options, scene);
  if (!options.common.quiet) {
    const bool approximate = (request.options.flags & LSP_TRACE_APPROXIMATE) != 0;
    for (const std::string& note : unused_arguments(options.trace, approximate, scene.headers()))
      std::cerr << "lsp-trace: " << options.file << ": " << note << "\n";
    if (!request.vulkan && !options.device.empty())
      std::cerr << "lsp-trace: " << options.file << ": --device does nothing: rays are traced on the CPU\n";
    if (!request.vulkan && request.load_path != LoadPath::kAutomatic)
      std::cerr << "lsp-trace: " << options.file << ": --load does nothing: rays are traced on the CPU\n";
    if (approximate && !scene.any_has(LSP_FEATURE_LINE_SPACES | LSP_FEATURE_CELLS))
      std::cerr << "lsp-trace: " << options.file
                << ": neither Line Spaces nor cells in the file: approximate rays are exact\n";
  }
  nlohmann::ordered_json json;
  try {
    json = to_json(options, request, scene, trace_rays(scene.target(), request, rays, hits));
  } catch (const Failure& failure) {
    // The tracers do not know the file's name.
    throw Failure(failure.exit(), failure.file().empty() ? options.file : failure.file(), failure.what());
  }
  write_hits(options.hits, hits);
  if (options.common.json) {
    json_result() = json;
  } else if (!options.common.quiet) {
    print(json);
  }
}

}  // namespace
}  // namespace lsp

int main(int argc, char** argv) {
  CLI::App app(
      "Traces a file of rays against an .lsp file, or a scene of instances of several, and writes a file of "
      "hits.");
  lsp::Options options;
  lsp::define(app, options);
  return lsp::run_program("lsp-trace", app, argc, argv, [&] { lsp::run(options); });
}
