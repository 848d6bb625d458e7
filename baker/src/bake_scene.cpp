#include "bake_scene.h"

#include <algorithm>
#include <cinttypes>
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>
#include <set>

#include "bake_file.h"
#include "figures.h"
#include "import/instances.h"
#include "import/source_file.h"
#include "lsp/instances.hpp"
#include "lsp/json_result.h"
#include "lsp/program.h"
#include "provenance.h"
#include "report.h"
#include "timer.h"

namespace lsp {
namespace {

using Json = nlohmann::ordered_json;

static_assert(kMaxInstances == LSP_MAX_INSTANCES);

// Names of files for assets: NAME.MESH.lsp. What some file system would not have in a name becomes a hyphen;
// numbers tell apart what is the same but for capital letters.
class AssetNames {
 public:
  explicit AssetNames(std::string scene) : scene_(std::move(scene)) {}

  std::string operator()(const std::string& mesh) {
    std::string name = cleaned(mesh);
    for (int number = 2; !taken_.insert(lower(name)).second; ++number)
      name = cleaned(mesh) + "-" + std::to_string(number);
    return scene_ + "." + name + ".lsp";
  }

 private:
  static constexpr size_t kLongest = 64;

  static std::string cleaned(const std::string& mesh) {
    std::string name;
    for (const char c : mesh.substr(0, kLongest)) {
      const bool plain = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
                         c == '_' || c == '.' || c == '+';
      if (plain)
        name += c;
      else if (!name.empty() && name.back() != '-')
        name += '-';
    }
    const size_t begin = name.find_first_not_of(".-"), end = name.find_last_not_of(".-");
    return begin == name.npos ? "mesh" : name.substr(begin, end - begin + 1);
  }
  static std::string lower(std::string name) {
    for (char& c : name)
      if (c >= 'A' && c <= 'Z') c = char(c - 'A' + 'a');
    return name;
  }

  std::string scene_;
  std::set<std::string> taken_;
};

// A transform as scenes have it: three rows of four.
Json rows(const glm::dmat4& matrix) {
  Json numbers = Json::array();
  for (int row = 0; row < 3; ++row)
    for (int column = 0; column < 4; ++column) numbers.push_back(matrix[column][row]);
  return numbers;
}

// Throws Failure where a program would refuse the scene: an instance beyond single precision.
void check_instances(const InstancedMeshes& scene, const Arguments& a) {
  std::vector<LspHeader> headers(scene.assets.size(), LspHeader{});
  std::vector<lsp_scene> boxes(headers.size(), lsp_scene{});
  std::vector<const lsp_scene*> assets;
  for (size_t i = 0; i < headers.size(); ++i) {
    const std::vector<glm::vec3>& positions = scene.assets[i].mesh.positions;
    glm::vec3 low = positions[0], high = low;
    for (const glm::vec3& p : positions) low = glm::min(low, p), high = glm::max(high, p);
    headers[i].bounds_min = {low.x, low.y, low.z};
    headers[i].bounds_max = {high.x, high.y, high.z};
    boxes[i].header = &headers[i];
    assets.push_back(&boxes[i]);
  }
  std::vector<lsp_instance> places;
  for (const MeshInstance& instance : scene.instances) {
    lsp_instance& place = places.emplace_back(lsp_instance{instance.asset, {}, 255, 0});
    for (int k = 0; k < 12; ++k) place.transform[k] = float(instance.transform[k % 4][k / 4]);
  }
  try {
    Instances(assets, places);
  } catch (const Error& error) {
    const bool too_many = error.status() == LSP_ERROR_LIMIT;
    throw Failure(too_many ? Exit::kLimit : Exit::kInvalid, a.inputs.front().string(), error.what());
  }
}

// What a scene's assets come to.
struct Totals {
  uint64_t stored = 0, placed = 0;  // triangles
  uint64_t bytes = 0;               // of the .lsp files
};

class SceneBake {
 public:
  SceneBake(const Arguments& a, ProgressBar& bar) : a_(a), bar_(bar) {}

  void run() {
    const std::string name = a_.output.stem().string();
    if (printable(name) != name)
      throw Failure(Exit::kUsage, a_.output.string(), "is not UTF-8, and JSON is: choose another name");
    bar_.show("import", 0);
    scene_ = import_instances(a_.inputs, import_options(a_));
    for (const auto& files : scene_.sources) check_outputs(a_, files);
    if (a_.strict) refuse_notes(scene_.notes, a_);
    check_instances(scene_, a_);
    uses_.resize(scene_.assets.size());
    for (const MeshInstance& instance : scene_.instances) ++uses_[instance.asset];
    import_seconds_ = timer_();
    AssetNames names(name);
    for (size_t i = 0; i < scene_.assets.size(); ++i) bake_asset(i, names(scene_.assets[i].name));
    bake_seconds_ = timer_();
    write();
    bar_.clear();
    print();
  }

 private:
  void bake_asset(size_t number, const std::string& file_name) {
    InstancedAsset& asset = scene_.assets[number];
    Arguments own = a_;  // a bake states in it what it chose
    own.inputs = {a_.inputs[asset.input]};
    own.output = a_.output.parent_path() / file_name;
    Json part;
    if (asset.is_part) part["name"] = asset.name;
    if (asset.origin != glm::dvec3(0)) part["origin"] = {asset.origin.x, asset.origin.y, asset.origin.z};
    if (hashes_.size() == asset.input) hashes_.push_back(hash_sources(asset.mesh));
    const std::string count = std::to_string(number + 1) + "/" + std::to_string(scene_.assets.size()) + " ";
    FileBake done;
    try {
      done = bake_file(
          asset.mesh, own, hashes_[asset.input], part,
          [&](std::string_view stage, double share) { bar_.show(count + std::string(stage), share); });
    } catch (const Failure& failure) {
      if (!asset.is_part) throw;
      throw Failure(failure.exit(), failure.file(), "mesh " + asset.name + ": " + failure.what());
    }
    files_.push_back(std::move(done.file));
    const uint64_t triangles = asset.mesh.triangles.size();
    totals_.stored += triangles;
    totals_.placed += triangles * uses_[number];
    totals_.bytes += done.written.file_bytes;
    Json report = report_json(
        {own, asset.mesh, done.chosen.baked, done.chosen.error, done.written, 0, done.write_seconds},
        done.meta);
    report["name"] = asset.name;
    report["instances"] = uses_[number];
    reports_.push_back(std::move(report));
    asset.mesh = {};
  }

  // One instance a line.
  std::string scene_text() const {
    Json assets = Json::array();
    for (const auto& file : files_) assets.push_back(file->path().filename().string());
    std::string text = "{\"lsp_scene\": 1,\n";
    if (has_origin())
      text += " \"origin\": " + Json{scene_.origin.x, scene_.origin.y, scene_.origin.z}.dump() + ",\n";
    text += " \"assets\": " + assets.dump() + ",\n \"instances\": [";
    const char* separator = "\n  ";
    for (const MeshInstance& instance : scene_.instances) {
      Json item = {{"asset", instance.asset}, {"transform", rows(instance.transform)}};
      if (!instance.name.empty()) item["name"] = instance.name;
      text += std::exchange(separator, ",\n  ") + item.dump();
    }
    return text + "]}\n";
  }

  void write() {
    bar_.show("write", 0);
    const std::string text = scene_text();
    OutputFile scene(a_.output);
    scene.write(text.data(), text.size());
    scene.finish();
    if (!a_.depfile.empty()) write_depfile(a_, scene_.sources);
    for (const auto& file : files_) file->commit();
    scene.commit();
  }

  bool has_origin() const { return scene_.origin != glm::dvec3(0); }

  void print() {
    if (a_.common.json) {
      json_result() = json();
    } else if (!a_.common.quiet) {
      print_text();
    }
  }

  Json json() const {
    return {{"output", a_.output.string()},
            {"instances", scene_.instances.size()},
            {"triangles", {{"baked", totals_.stored}, {"placed", totals_.placed}}},
            {"origin", {scene_.origin.x, scene_.origin.y, scene_.origin.z}},
            {"notes", scene_.notes},
            {"seconds", {{"import", import_seconds_}, {"assets", bake_seconds_}}},
            {"file_bytes", totals_.bytes},
            {"assets", reports_}};
  }

  void print_text() const {
    for (const std::string& note : scene_.notes) std::printf("note        %s\n", note.c_str());
    if (has_origin())
      std::printf("origin      %.17g %.17g %.17g: instances, rays and hits are relative to it\n",
                  scene_.origin.x, scene_.origin.y, scene_.origin.z);
    for (const Json& report : reports_)
      std::printf("asset       %s: %s triangles, %s, %s instances\n",
                  report["output"].get_ref<const std::string&>().c_str(),
                  with_commas(report["triangles"]["kept"]).c_str(),
                  size_text(report["file_bytes"].get<uint64_t>()).c_str(),
                  with_commas(report["instances"]).c_str());
    std::printf("time        import %.2f s, assets %.2f s\n", import_seconds_, bake_seconds_);
    std::printf("wrote       %s: %s instances of %s assets, %s triangles for %s, %s\n", a_.output.c_str(),
                with_commas(scene_.instances.size()).c_str(), with_commas(reports_.size()).c_str(),
                with_commas(totals_.stored).c_str(), with_commas(totals_.placed).c_str(),
                size_text(totals_.bytes).c_str());
    std::fflush(stdout);
  }

  const Arguments& a_;
  ProgressBar& bar_;
  Timer timer_;
  double import_seconds_ = 0, bake_seconds_ = 0;
  InstancedMeshes scene_;
  std::vector<uint64_t> uses_;                      // of each asset
  std::vector<std::array<uint64_t, 2>> hashes_;     // of each input's sources
  std::vector<std::unique_ptr<OutputFile>> files_;  // of each asset
  std::vector<Json> reports_;
  Totals totals_;
};

}  // namespace

void bake_scene(const Arguments& a, ProgressBar& bar) { SceneBake(a, bar).run(); }

}  // namespace lsp
