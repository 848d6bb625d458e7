#include <cstring>
#include <limits>
#include <nlohmann/json.hpp>

#include "picture.h"
#include "scene.h"

namespace lsp::sample {
namespace {

using Json = nlohmann::ordered_json;

// glTF's numbers for component types and buffer targets.
constexpr int kUnsignedShort = 5123;
constexpr int kUnsignedInt = 5125;
constexpr int kFloat = 5126;
constexpr int kArrayBuffer = 34962;
constexpr int kElementArrayBuffer = 34963;

// Rounded to what a reader can tell apart, so that the text stays short.
Json array3(glm::vec3 v) { return Json::array({v.x, v.y, v.z}); }

class Writer {
 public:
  std::string write(const Scene& scene) {
    root_["asset"] = {{"version", "2.0"}, {"generator", "lsp-sample-scene"}};
    root_["scene"] = 0;
    root_["scenes"] = Json::array({{{"nodes", scene.roots}}});
    write_nodes(scene);
    write_meshes(scene);
    write_materials(scene);
    root_["accessors"] = accessors_;
    root_["bufferViews"] = views_;
    root_["buffers"] = Json::array({{{"byteLength", bytes_.size()}}});
    return container();
  }

 private:
  void write_nodes(const Scene& scene) {
    Json nodes = Json::array();
    for (const Node& node : scene.nodes) {
      Json out = {{"name", node.name}};
      if (node.mesh >= 0) out["mesh"] = node.mesh;
      if (!node.children.empty()) out["children"] = node.children;
      if (node.translation != glm::vec3(0)) out["translation"] = array3(node.translation);
      const glm::quat& q = node.rotation;
      if (q != glm::quat(1, 0, 0, 0)) out["rotation"] = Json::array({q.x, q.y, q.z, q.w});
      if (node.scale != glm::vec3(1)) out["scale"] = array3(node.scale);
      nodes.push_back(std::move(out));
    }
    root_["nodes"] = std::move(nodes);
  }

  void write_meshes(const Scene& scene) {
    Json meshes = Json::array();
    for (const Mesh& mesh : scene.meshes) {
      Json primitives = Json::array();
      for (const Part& part : mesh.parts) {
        Json primitive;
        primitive["attributes"]["POSITION"] = positions(part.surface.positions);
        primitive["attributes"]["NORMAL"] = vectors(part.surface.normals);
        if (!part.surface.uvs.empty()) primitive["attributes"]["TEXCOORD_0"] = vectors(part.surface.uvs);
        primitive["indices"] = indices(part.surface);
        primitive["material"] = part.material;
        primitives.push_back(std::move(primitive));
      }
      meshes.push_back({{"name", mesh.name}, {"primitives", std::move(primitives)}});
    }
    root_["meshes"] = std::move(meshes);
  }

  void write_materials(const Scene& scene) {
    Json materials = Json::array();
    bool strong = false;
    for (const Material& material : scene.materials) {
      Json out = {{"name", material.name}};
      const glm::vec3 c = material.base_color;
      out["pbrMetallicRoughness"] = {{"baseColorFactor", Json::array({c.x, c.y, c.z, 1.0f})},
                                     {"metallicFactor", material.metallic},
                                     {"roughnessFactor", material.roughness}};
      const float strength = std::max({material.emission.x, material.emission.y, material.emission.z});
      if (strength > 0) {
        const float scale = std::max(strength, 1.0f);
        out["emissiveFactor"] = array3(material.emission / scale);
        if (scale > 1) {
          out["extensions"]["KHR_materials_emissive_strength"]["emissiveStrength"] = scale;
          strong = true;
        }
      }
      if (!material.texture.rgba.empty())
        out["pbrMetallicRoughness"]["baseColorTexture"] = {{"index", texture(material.texture)}};
      if (material.masked) out["alphaMode"] = "MASK";
      out["doubleSided"] = true;
      materials.push_back(std::move(out));
    }
    root_["materials"] = std::move(materials);
    if (strong) root_["extensionsUsed"] = Json::array({"KHR_materials_emissive_strength"});
  }

  // Appends a texture, its picture among the file's bytes, and returns its number.
  int texture(const Texture& texture) {
    constexpr int kClampToEdge = 33071;
    const std::string png = rgba_png(texture.width, texture.height, texture.rgba);
    Json& images = root_["images"];
    images.push_back({{"bufferView", view(png.data(), png.size())}, {"mimeType", "image/png"}});
    root_["samplers"] = Json::array({{{"wrapS", kClampToEdge}, {"wrapT", kClampToEdge}}});
    root_["textures"].push_back({{"source", images.size() - 1}, {"sampler", 0}});
    return static_cast<int>(images.size()) - 1;
  }

  // Appends `size` bytes as a buffer view and returns its number. `target`: 0 where none is to be named.
  int view(const void* data, size_t size, int target = 0) {
    while (bytes_.size() % 4 != 0) bytes_.push_back('\0');
    views_.push_back({{"buffer", 0}, {"byteOffset", bytes_.size()}, {"byteLength", size}});
    if (target != 0) views_.back()["target"] = target;
    bytes_.append(static_cast<const char*>(data), size);
    return static_cast<int>(views_.size()) - 1;
  }

  template <class Vector>
  int vectors(const std::vector<Vector>& values) {
    accessors_.push_back({{"bufferView", view(values.data(), values.size() * sizeof(Vector), kArrayBuffer)},
                          {"componentType", kFloat},
                          {"count", values.size()},
                          {"type", Vector::length() == 2 ? "VEC2" : "VEC3"}});
    return static_cast<int>(accessors_.size()) - 1;
  }

  // Vectors with their bounds, which glTF wants of positions.
  int positions(const std::vector<glm::vec3>& values) {
    const int accessor = vectors(values);
    glm::vec3 lo(std::numeric_limits<float>::max());
    glm::vec3 hi(-std::numeric_limits<float>::max());
    for (const glm::vec3& v : values) {
      lo = glm::min(lo, v);
      hi = glm::max(hi, v);
    }
    accessors_.back()["min"] = array3(lo);
    accessors_.back()["max"] = array3(hi);
    return accessor;
  }

  int indices(const Surface& surface) {
    Json accessor = {{"count", surface.indices.size()}, {"type", "SCALAR"}};
    // 65535 is the strip restart value and may not be used as an index.
    if (surface.positions.size() <= 65535) {
      const std::vector<uint16_t> narrow(surface.indices.begin(), surface.indices.end());
      accessor["bufferView"] = view(narrow.data(), narrow.size() * sizeof(uint16_t), kElementArrayBuffer);
      accessor["componentType"] = kUnsignedShort;
    } else {
      accessor["bufferView"] =
          view(surface.indices.data(), surface.indices.size() * sizeof(uint32_t), kElementArrayBuffer);
      accessor["componentType"] = kUnsignedInt;
    }
    accessors_.push_back(std::move(accessor));
    return static_cast<int>(accessors_.size()) - 1;
  }

  // Header, JSON chunk and binary chunk; see the glTF 2.0 specification, "GLB File Format".
  std::string container() {
    std::string json = root_.dump();
    while (json.size() % 4 != 0) json.push_back(' ');
    while (bytes_.size() % 4 != 0) bytes_.push_back('\0');
    std::string out;
    const auto word = [&](uint64_t value) {
      const auto narrow = static_cast<uint32_t>(value);
      char bytes[4];
      std::memcpy(bytes, &narrow, sizeof bytes);
      out.append(bytes, sizeof bytes);
    };
    word(0x46546C67u);  // "glTF"
    word(2);
    word(12 + 8 + json.size() + 8 + bytes_.size());
    word(json.size());
    word(0x4E4F534Au);  // "JSON"
    out += json;
    word(bytes_.size());
    word(0x004E4942u);  // "BIN"
    out += bytes_;
    return out;
  }

  Json root_;
  Json accessors_ = Json::array();
  Json views_ = Json::array();
  std::string bytes_;
};

}  // namespace

std::string to_glb(const Scene& scene) { return Writer().write(scene); }

}  // namespace lsp::sample
