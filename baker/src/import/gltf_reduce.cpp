#include "import/gltf_reduce.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "import/gltf_document.h"
#include "import/json_member.h"
#include "import/source_file.h"
#include "lsp/program.h"

namespace lsp {
namespace {

using nlohmann::json;

// Extensions that are read, or that state nothing about geometry or light.
constexpr std::string_view kRead[] = {"KHR_draco_mesh_compression",
                                      "KHR_mesh_quantization",
                                      "EXT_meshopt_compression",
                                      "EXT_mesh_gpu_instancing",
                                      "KHR_node_visibility",
                                      "KHR_materials_emissive_strength",
                                      "KHR_materials_pbrSpecularGlossiness",
                                      "KHR_materials_transmission",
                                      "KHR_materials_unlit",
                                      "KHR_texture_transform",
                                      "KHR_texture_basisu",
                                      "EXT_texture_webp",
                                      "KHR_xmp",
                                      "KHR_xmp_json_ld"};

void copy(const json& from, json& to, std::initializer_list<const char*> keys) {
  for (const char* key : keys) {
    if (!member(from, key).is_null()) to[key] = member(from, key);
  }
}

// Copies members that must be objects or arrays element by element through `reduce`.
template <typename Reduce>
void reduce_list(const json& from, json& to, const char* key, const Reduce& reduce) {
  const json& list = member(from, key);
  if (!list.is_array() || list.empty()) return;
  json& out = to[key] = json::array();
  for (const json& item : list) out.push_back(item.is_object() ? reduce(item) : json::object());
}

json reduce_extensions(const json& item, std::initializer_list<const char*> names) {
  json extensions = json::object();
  copy(member(item, "extensions"), extensions, names);
  return extensions;
}

bool is_read_attribute(std::string_view name) {
  return name == "POSITION" || name == "NORMAL" || name == "COLOR_0" || name.starts_with("TEXCOORD_") ||
         name.starts_with("JOINTS_") || name.starts_with("WEIGHTS_");
}

json read_attributes(const json& attributes) {
  json out = json::object();
  if (!attributes.is_object()) return out;
  for (const auto& [name, accessor] : attributes.items()) {
    if (is_read_attribute(name)) out[name] = accessor;
  }
  return out;
}

json reduce_mesh(const json& item) {
  json out = json::object();
  copy(item, out, {"name", "weights"});
  out["primitives"] = json::array();
  const json& primitives = member(item, "primitives");
  if (!primitives.is_array()) return out;
  for (const json& primitive : primitives) {
    json reduced = json::object();
    copy(primitive, reduced, {"material", "mode"});
    json attributes = read_attributes(member(primitive, "attributes"));
    // tinygltf refuses indices without a buffer view, which is what Draco's look like.
    if (!member(primitive, "indices").is_null()) attributes[kGltfIndices] = member(primitive, "indices");
    reduced["attributes"] = std::move(attributes);
    json extensions = reduce_extensions(primitive, {"KHR_draco_mesh_compression"});
    if (!extensions.empty()) reduced["extensions"] = std::move(extensions);
    const json& targets = member(primitive, "targets");
    if (targets.is_array()) {
      for (const json& target : targets) reduced["targets"].push_back(read_attributes(target));
    }
    out["primitives"].push_back(std::move(reduced));
  }
  return out;
}

json reduce_document(const json& from) {
  json to = json::object();
  json asset = json::object();
  copy(member(from, "asset"), asset, {"version", "minVersion"});
  to["asset"] = std::move(asset);
  copy(from, to, {"scene", "extensionsUsed", "extensionsRequired"});
  reduce_list(from, to, "scenes", [](const json& item) {
    json out = json::object();
    copy(item, out, {"nodes"});
    return out;
  });
  reduce_list(from, to, "nodes", [](const json& item) {
    json out = json::object();
    copy(item, out,
         {"name", "mesh", "children", "matrix", "translation", "rotation", "scale", "skin", "weights"});
    json extensions = reduce_extensions(item, {"EXT_mesh_gpu_instancing", "KHR_node_visibility"});
    if (!extensions.empty()) out["extensions"] = std::move(extensions);
    return out;
  });
  reduce_list(from, to, "meshes", reduce_mesh);
  reduce_list(from, to, "skins", [](const json& item) {
    json out = json::object();
    copy(item, out, {"joints", "inverseBindMatrices"});
    return out;
  });
  reduce_list(from, to, "accessors", [](const json& item) {
    json out = json::object();
    copy(item, out, {"bufferView", "byteOffset", "componentType", "normalized", "count", "type", "sparse"});
    return out;
  });
  reduce_list(from, to, "bufferViews", [](const json& item) {
    json out = json::object();
    copy(item, out, {"buffer", "byteOffset", "byteLength", "byteStride"});
    json extensions = reduce_extensions(item, {"EXT_meshopt_compression"});
    if (!extensions.empty()) out["extensions"] = std::move(extensions);
    return out;
  });
  return to;
}

bool is_integer_key(std::string_view key) {
  constexpr std::string_view kKeys[] = {"scene",      "nodes",       "children",
                                        "mesh",       "indices",     "material",
                                        "mode",       "_INDICES",    "buffer",
                                        "bufferView", "byteOffset",  "byteLength",
                                        "byteStride", "count",       "ROTATION",
                                        "SCALE",      "TRANSLATION", "componentType",
                                        "skin",       "joints",      "inverseBindMatrices"};
  return is_read_attribute(key) || std::find(std::begin(kKeys), std::end(kKeys), key) != std::end(kKeys);
}

// JSON has one kind of number, and 36.0 is an index too; tinygltf would take it for missing, and the default
// in its place. Whatever is not a whole number of 0 or more where one belongs is refused here by name.
void make_integers(const std::string& file, std::string_view key, json& value) {
  if (value.is_object()) {
    for (auto& [name, item] : value.items()) make_integers(file, name, item);
  } else if (value.is_array()) {
    for (json& item : value) make_integers(file, key, item);
  } else if (is_integer_key(key) &&
             !(key == "mode" && (value == "ATTRIBUTES" || value == "TRIANGLES" ||
                                 value == "INDICES"))) {  // EXT_meshopt_compression's is text
    constexpr double kLargest = 9007199254740992.0;       // 2^53: beyond, doubles skip integers
    if (value.is_number_float()) {
      const auto number = value.get<double>();
      if (number >= 0 && number <= kLargest && number == std::floor(number)) value = uint64_t(number);
    }
    if (!value.is_number_unsigned() || value.get<uint64_t>() > uint64_t(kLargest)) {
      throw Failure(Exit::kInvalid, file,
                    "has a " + std::string(key) + " that is no index or size, export it again");
    }
  }
}

// The extensions that objects have anywhere: files use some that they do not declare.
void collect_extensions(const json& value, std::set<std::string>& names) {
  if (const json& own = member(value, "extensions"); own.is_object()) {
    for (const auto& [name, item] : own.items()) names.insert(name);
  }
  if (!value.is_structured()) return;
  for (const auto& [key, item] : value.items()) {
    if (key != "extras") collect_extensions(item, names);
  }
}

// In words, what a node has that is not read.
void collect_unread(const json& node, std::set<std::string>& parts) {
  const json& instanced = member(member(member(node, "extensions"), "EXT_mesh_gpu_instancing"), "attributes");
  if (instanced.is_object()) {
    for (const auto& [name, accessor] : instanced.items()) {
      if (name != "TRANSLATION" && name != "ROTATION" && name != "SCALE")
        parts.insert("the attribute " + name + " of instances is not read");
    }
  }
  const bool has_matrix = !member(node, "matrix").is_null();
  constexpr std::pair<const char*, size_t> kSizes[] = {
      {"matrix", 16}, {"translation", 3}, {"rotation", 4}, {"scale", 3}};
  double values[16];
  for (const auto& [key, size] : kSizes) {
    values[3] = 1;  // where nothing is read
    if (!numbers_member(node, key, size, values))
      parts.insert(std::string(key) + " of a node is not " + std::to_string(size) + " numbers and not read");
    if (size == 4 && !member(node, key).is_null() && values[0] == 0 && values[1] == 0 && values[2] == 0 &&
        values[3] == 0)
      parts.insert("a rotation of a node is four zeros, which turn nothing, and not read");
    if (has_matrix && size < 16 && !member(node, key).is_null())
      parts.insert(std::string(key) + " of a node that has a matrix is not read");
  }
}

}  // namespace

json reduce_to_geometry(const std::string& file, const json& document) {
  json geometry = reduce_document(document);
  make_integers(file, "", geometry);
  return geometry;
}

std::vector<std::string> unread_parts(const json& document) {
  std::set<std::string> extensions, attributes;
  if (const json& used = member(document, "extensionsUsed"); used.is_array()) {
    for (const json& item : used) extensions.insert(item.is_string() ? item.get<std::string>() : "");
  }
  collect_extensions(document, extensions);
  for (const std::string_view read : kRead) extensions.erase(std::string(read));
  const auto collect = [&](const json& list) {
    if (!list.is_object()) return;
    for (const auto& [name, accessor] : list.items()) {
      // Tangents serve normal textures alone, which have a note of their own.
      if (!is_read_attribute(name) && name != "TANGENT") attributes.insert(name);
    }
  };
  if (const json& meshes = member(document, "meshes"); meshes.is_array()) {
    for (const json& mesh : meshes) {
      const json& primitives = member(mesh, "primitives");
      if (!primitives.is_array()) continue;
      for (const json& primitive : primitives) {
        collect(member(primitive, "attributes"));
        if (const json& targets = member(primitive, "targets"); targets.is_array()) {
          for (const json& target : targets) collect(target);
        }
      }
    }
  }
  std::vector<std::string> parts;
  for (const std::string& name : extensions) parts.push_back("the extension " + name + " is not read");
  for (const std::string& name : attributes) parts.push_back("the vertex attribute " + name + " is not read");
  if (const json& nodes = member(document, "nodes"); nodes.is_array()) {
    std::set<std::string> of_nodes;
    for (const json& node : nodes) collect_unread(node, of_nodes);
    parts.insert(parts.end(), of_nodes.begin(), of_nodes.end());
  }
  if (const size_t cameras = member(document, "cameras").size(); cameras > 0)
    parts.push_back("its cameras (" + std::to_string(cameras) + ") are not read");
  if (member(document, "scenes").size() > 1 && !member(document, "scene").is_null()) {
    parts.push_back("only the default one of its scenes is read");
  } else if (member(document, "scenes").size() > 1) {
    parts.push_back("none of its scenes is the default one, all are read at once");
  }
  return parts;
}

// Extensions that a file may require: those read here, and whole families that change no geometry.
void check_required_extensions(const std::string& file, const json& document) {
  constexpr std::string_view kWithoutGeometry[] = {"KHR_materials_", "EXT_materials_", "ADOBE_materials_",
                                                   "KHR_texture_",   "EXT_texture_",   "MSFT_texture_",
                                                   "KHR_lights_",    "EXT_lights_",    "KHR_xmp",
                                                   "KHR_audio",      "KHR_techniques_"};
  const json& required = member(document, "extensionsRequired");
  if (!required.is_array()) return;
  for (const json& item : required) {
    const std::string name = item.is_string() ? item.get<std::string>() : "";
    bool known = false;
    for (const std::string_view read : kRead) known = known || name == read;
    for (const std::string_view family : kWithoutGeometry) known = known || name.starts_with(family);
    if (!known) {
      throw Failure(Exit::kUnsupported, file,
                    "requires the extension " + printable(name) + ", export it without that extension");
    }
  }
}

}  // namespace lsp
