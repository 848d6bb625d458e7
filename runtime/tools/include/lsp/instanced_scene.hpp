// A scene as JSON: assets and their instances, for the programs that take one where they take an .lsp file.
// Links nlohmann-json; not installed.
//
//   {"lsp_scene": 1, "assets": ["duck.lsp", ...],
//    "instances": [{"asset": 0, "transform": [12 numbers: three rows of four], "mask": 255, "user": 7}, ...]}
//
// It may have a "name", instances too, and an "origin" [x, y, z]: what it was made from, rays and hits are
// relative to it, as with an .lsp file that has one.
#pragma once

#include <algorithm>
#include <array>
#include <filesystem>
#include <fstream>
#include <initializer_list>
#include <limits>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "lsp/failures.hpp"
#include "lsp/file_ending.h"
#include "lsp/instances.hpp"
#include "lsp/scene_file.hpp"

namespace lsp {

// Whether a program that is given `path` takes it for a scene as JSON: by its ending.
inline bool is_instanced_scene(const std::string& path) { return file_ending(path) == ".json"; }

// The scene with its assets opened and its instances ready for rays. Errors are thrown as lsp::Failure with
// the file's name and the place in it: kFile, kInvalid, kUnsupported for another version of the scene or of
// an asset. The file may be hostile.
class InstancedScene {
 public:
  // Assets that are packed may need `memory_limit` bytes each (Exit::kLimit).
  explicit InstancedScene(const std::string& path, uint64_t memory_limit = UINT64_MAX) : path_(path) {
    const nlohmann::json json = parse();
    const nlohmann::json& version = member(json, "", "lsp_scene");
    if (!version.is_number_integer()) fail("/lsp_scene", "is not a whole number; write 1");
    if (version != 1)
      throw Failure(Exit::kUnsupported, path_,
                    "/lsp_scene: is " + version.dump() + ", this program reads 1; use a newer one");
    only(json, "", {"lsp_scene", "assets", "instances", "name", "origin"});
    read_origin(json);
    open_assets(json, memory_limit);
    read_instances(json);
    build();
  }

  const std::vector<std::unique_ptr<SceneFile>>& assets() const { return assets_; }
  const std::vector<std::string>& asset_paths() const { return asset_paths_; }
  const Instances& instances() const { return instances_; }
  // What the scene's space, its rays and hits are relative to, in the space of what it was made from.
  const std::array<double, 3>& origin() const { return origin_; }

 private:
  using Json = nlohmann::json;

  [[noreturn]] void fail(const std::string& place, const std::string& what) const {
    throw Failure(Exit::kInvalid, path_, (place.empty() ? "" : place + ": ") + what);
  }

  Json parse() const {
    std::ifstream in(path_, std::ios::binary);
    if (!in || std::filesystem::is_directory(path_))
      throw Failure(Exit::kFile, path_, "cannot be opened; check the path and its permissions");
    Json json;
    try {
      json = Json::parse(in);
    } catch (const Json::parse_error& error) {
      fail("", "is not JSON, byte " + std::to_string(error.byte) + "; a scene is {\"lsp_scene\": 1, ...}");
    }
    if (!json.is_object()) fail("", "is no JSON object; a scene is {\"lsp_scene\": 1, ...}");
    return json;
  }

  const Json& member(const Json& object, const std::string& place, const char* name) const {
    const auto found = object.find(name);
    if (found == object.end()) fail(place + "/" + name, "is missing; add it");
    return *found;
  }

  // Refuses members by other names: most likely one is misspelt.
  void only(const Json& object, const std::string& place, std::initializer_list<const char*> names) const {
    for (const auto& item : object.items())
      if (std::find(names.begin(), names.end(), item.key()) == names.end())
        fail(place + "/" + item.key(), "is not known here; check its spelling or leave it out");
  }

  const Json& array(const Json& object, const char* name) const {
    const Json& value = member(object, "", name);
    if (!value.is_array()) fail(std::string("/") + name, "is not an array; write [...]");
    return value;
  }

  // A whole number of an instance; `otherwise` where there is none.
  uint32_t number(const Json& object, const std::string& place, const char* name, uint64_t most,
                  uint32_t otherwise) const {
    const auto found = object.find(name);
    if (found == object.end()) return otherwise;
    if (!found->is_number_unsigned() || found->get<uint64_t>() > most)
      fail(place + "/" + name, "is not a whole number from 0 to " + std::to_string(most) + "; write one");
    return found->get<uint32_t>();
  }

  void open_assets(const Json& json, uint64_t memory_limit) {
    const Json& names = array(json, "assets");
    for (size_t i = 0; i < names.size(); ++i) {
      const std::string place = "/assets/" + std::to_string(i);
      if (!names[i].is_string()) fail(place, "is not a string; write the path of an .lsp file");
      const std::string asset =
          (std::filesystem::path(path_).parent_path() / names[i].get<std::string>()).string();
      try {
        assets_.push_back(std::make_unique<SceneFile>(asset, memory_limit));
      } catch (const Error& error) {
        throw Failure(exit_of(error.status()), path_, place + ": " + asset + ": " + error.what());
      }
      asset_paths_.push_back(asset);
    }
  }

  void read_instances(const Json& json) {
    const Json& list = array(json, "instances");
    if (list.size() > LSP_MAX_INSTANCES)
      throw Failure(Exit::kLimit, path_,
                    "/instances: more than " + std::to_string(LSP_MAX_INSTANCES) + "; make several scenes");
    for (size_t i = 0; i < list.size(); ++i) {
      const std::string place = "/instances/" + std::to_string(i);
      if (!list[i].is_object()) fail(place, "is no object; write {\"asset\": 0, \"transform\": [...]}");
      only(list[i], place, {"asset", "transform", "mask", "user", "name"});
      lsp_instance instance{};
      member(list[i], place, "asset");
      instance.asset = number(list[i], place, "asset", UINT32_MAX, 0);
      if (instance.asset >= assets_.size())
        fail(place + "/asset", "is " + std::to_string(instance.asset) + ", there are " +
                                   std::to_string(assets_.size()) + " assets, counted from 0");
      instance.mask = number(list[i], place, "mask", 255, 255);
      instance.user = number(list[i], place, "user", UINT32_MAX, 0);
      read_transform(member(list[i], place, "transform"), place + "/transform", instance);
      places_.push_back(instance);
    }
  }

  void read_origin(const Json& json) {
    const auto found = json.find("origin");
    if (found == json.end()) return;
    const auto number = [](const Json& value) { return value.is_number(); };
    if (!found->is_array() || found->size() != 3 || !std::all_of(found->begin(), found->end(), number))
      fail("/origin", "is not an array of three numbers; write x, y and z or leave it out");
    for (size_t i = 0; i < 3; ++i) origin_[i] = (*found)[i].get<double>();
  }

  void read_transform(const Json& numbers, const std::string& place, lsp_instance& instance) const {
    if (!numbers.is_array() || numbers.size() != 12)
      fail(place, "is not an array of 12 numbers; write three rows of four");
    for (size_t i = 0; i < 12; ++i) {
      const std::string at = place + "/" + std::to_string(i);
      if (!numbers[i].is_number()) fail(at, "is not a number; write one");
      const double value = numbers[i].get<double>();
      if (!(std::abs(value) <= std::numeric_limits<float>::max())) fail(at, "is beyond single precision");
      instance.transform[i] = static_cast<float>(value);
    }
  }

  void build() {
    std::vector<const lsp_scene*> scenes;
    for (const auto& asset : assets_) scenes.push_back(&asset->scene());
    try {
      instances_ = Instances(scenes, places_);
      return;
    } catch (const Error& error) {
      if (error.status() != LSP_ERROR_INVALID) throw Failure(exit_of(error.status()), path_, error.what());
    }
    // Which one it is.
    for (size_t i = 0; i < places_.size(); ++i) {
      try {
        Instances(scenes, {&places_[i], 1});
      } catch (const Error& error) {
        const std::string what = error.what(), before = "instance 0: its transform ";
        fail("/instances/" + std::to_string(i) + "/transform",
             what.rfind(before, 0) == 0 ? what.substr(before.size()) : what);
      }
    }
  }

  std::string path_;
  std::array<double, 3> origin_{};
  std::vector<std::unique_ptr<SceneFile>> assets_;
  std::vector<std::string> asset_paths_;
  std::vector<lsp_instance> places_;
  Instances instances_;
};

}  // namespace lsp
