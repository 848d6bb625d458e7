// glTF documents built piece by piece for the tests.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "mesh_files.h"

// Of the importer's tinygltf (import/tinygltf.h), which does not declare it.
namespace lsp_tinygltf {
std::string base64_encode(const unsigned char* bytes, unsigned int count);
}

namespace lsp_test {

using nlohmann::json;

inline constexpr int kByte = 5120, kUbyte = 5121, kShort = 5122, kUshort = 5123, kUint = 5125, kFloat = 5126;

inline std::string base64(const std::string& bytes) {
  return lsp_tinygltf::base64_encode(reinterpret_cast<const unsigned char*>(bytes.data()),
                                     unsigned(bytes.size()));
}

// A document with one buffer that grows as accessors are added.
struct Document {
  json root = {{"asset", {{"version", "2.0"}}}};
  std::string bytes;

  int view(const std::string& data, int stride = 0) {
    bytes.resize((bytes.size() + 3) / 4 * 4);
    json view = {{"buffer", 0}, {"byteOffset", bytes.size()}, {"byteLength", data.size()}};
    if (stride) view["byteStride"] = stride;
    bytes += data;
    root["bufferViews"].push_back(view);
    return int(root["bufferViews"].size()) - 1;
  }
  int accessor(int view, int type, size_t count, const char* shape, size_t offset = 0,
               bool normalized = false) {
    json accessor = {{"componentType", type}, {"count", count}, {"type", shape}};
    if (view >= 0) accessor["bufferView"] = view;
    if (offset) accessor["byteOffset"] = offset;
    if (normalized) accessor["normalized"] = true;
    root["accessors"].push_back(accessor);
    return int(root["accessors"].size()) - 1;
  }
  template <typename T>
  int values(const std::vector<T>& list, int type, const char* shape, size_t components,
             bool normalized = false) {
    std::string data;
    for (const T& value : list) append(data, value);
    return accessor(view(data), type, list.size() / components, shape, 0, normalized);
  }
  int vec3(const std::vector<float>& list) { return values(list, kFloat, "VEC3", 3); }
  template <typename T>
  int indices(const std::vector<T>& list, int type) {
    return values(list, type, "SCALAR", 1);
  }
  // Appends a mesh of one primitive and returns its number.
  int mesh(const json& primitive) {
    root["meshes"].push_back({{"primitives", {primitive}}});
    return int(root["meshes"].size()) - 1;
  }
  int node(const json& node) {
    root["nodes"].push_back(node);
    return int(root["nodes"].size()) - 1;
  }

  std::string gltf() const {
    json copy = root;
    if (!bytes.empty()) {
      copy["buffers"][0]["byteLength"] = bytes.size();
      copy["buffers"][0]["uri"] = "data:application/gltf-buffer;base64," + base64(bytes);
    }
    return copy.dump();
  }
  std::string glb() const {
    json copy = root;
    copy["buffers"][0]["byteLength"] = bytes.size();
    std::string text = copy.dump(), binary = bytes;
    text.resize((text.size() + 3) / 4 * 4, ' ');
    binary.resize((binary.size() + 3) / 4 * 4);
    std::string out = "glTF";
    for (const size_t word : {size_t{2}, 28 + text.size() + binary.size(), text.size(), size_t{0x4E4F534A}}) {
      append(out, uint32_t(word));
    }
    out += text;
    append(out, uint32_t(binary.size()));
    append(out, uint32_t{0x004E4942});
    return out + binary;
  }
};

inline const std::vector<float> kTriangle = {0, 0, 0, 1, 0, 0, 0, 1, 0};
inline const std::vector<float> kStrip = {0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 0, 0, 2, 0};

}  // namespace lsp_test
