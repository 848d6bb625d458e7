// glTF scenes: nodes, instances, primitives, materials.
#include <cmath>
#include <limits>
#include <map>

#include "import/gltf_accessor.h"
#include "import/gltf_draco.h"
#include "import/readers.h"
#include "lsp/program.h"

namespace lsp {
namespace {

// Nodes a scene may visit, shared ones counted each time: seconds, and no more.
constexpr uint64_t kMaxVisits = 1 << 24;

// A primitive in its mesh's space, three indices a triangle.
struct Primitive {
  std::vector<glm::vec3> positions;
  std::vector<glm::vec3> normals;  // empty or one a position
  std::vector<uint32_t> indices;
  uint32_t material = kNoIndex;  // the document's
};

std::vector<glm::vec3> vectors_of(const std::vector<float>& values) {
  std::vector<glm::vec3> vectors(values.size() / 3);
  for (size_t i = 0; i < vectors.size(); ++i)
    vectors[i] = {values[3 * i], values[3 * i + 1], values[3 * i + 2]};
  return vectors;
}

// Three vertices a triangle out of a strip or fan (glTF 2.0, section 3.7.2.1). Lists lose what is left over.
std::vector<uint32_t> expand(std::vector<uint32_t> vertices, int mode) {
  if (mode == TINYGLTF_MODE_TRIANGLES) {
    vertices.resize(vertices.size() / 3 * 3);
    return vertices;
  }
  std::vector<uint32_t> out;
  if (vertices.size() < 3) return out;
  out.reserve((vertices.size() - 2) * 3);
  for (size_t i = 0; i + 2 < vertices.size(); ++i) {
    if (mode == TINYGLTF_MODE_TRIANGLE_STRIP) {
      out.insert(out.end(), {vertices[i], vertices[i + 1 + i % 2], vertices[i + 2 - i % 2]});
    } else {
      out.insert(out.end(), {vertices[i + 1], vertices[i + 2], vertices[0]});
    }
  }
  return out;
}

glm::dmat4 matrix_of(const std::vector<double>& translation, const std::vector<double>& rotation,
                     const std::vector<double>& scale) {
  glm::dmat4 matrix(1);
  if (rotation.size() == 4) {
    double x = rotation[0], y = rotation[1], z = rotation[2], w = rotation[3];
    // Files hold rotations rounded to a few digits, or quantised; the nearest unit one is meant.
    const double length = std::sqrt(x * x + y * y + z * z + w * w);
    if (length > 0 && std::isfinite(length)) x /= length, y /= length, z /= length, w /= length;
    matrix[0] = {1 - 2 * (y * y + z * z), 2 * (x * y + z * w), 2 * (x * z - y * w), 0};
    matrix[1] = {2 * (x * y - z * w), 1 - 2 * (x * x + z * z), 2 * (y * z + x * w), 0};
    matrix[2] = {2 * (x * z + y * w), 2 * (y * z - x * w), 1 - 2 * (x * x + y * y), 0};
  }
  if (scale.size() == 3) {
    for (int k = 0; k < 3; ++k) matrix[k] *= scale[size_t(k)];
  }
  if (translation.size() == 3) matrix[3] = {translation[0], translation[1], translation[2], 1};
  return matrix;
}

glm::dmat4 matrix_of(const tinygltf::Node& node) {
  if (node.matrix.size() != 16) return matrix_of(node.translation, node.rotation, node.scale);
  glm::dmat4 matrix;
  for (size_t i = 0; i < 16; ++i) matrix[int(i / 4)][int(i % 4)] = node.matrix[i];
  return matrix;
}

class GltfReader {
 public:
  GltfReader(const std::filesystem::path& path, MeshBuilder& builder)
      : builder_(builder),
        document_(read_gltf_document(path, builder.budget())),
        model_(document_->model),
        accessors_(*document_, builder.budget()) {}

  void read() {
    const std::vector<int> roots = find_roots();
    decode_all_draco();
    check_scene(roots);
    for (const int root : roots) walk(root);
    if (skipped_modes_) {
      builder_.note(document_->file + ": " + std::to_string(skipped_modes_) +
                    " primitives are points or lines and hold no triangle");
    }
    if (without_positions_) {
      builder_.note(document_->file + ": " + std::to_string(without_positions_) +
                    " primitives have no positions");
    }
  }

 private:
  [[noreturn]] void fail(const std::string& what) const {
    throw Failure(Exit::kInvalid, document_->file, what + ", export it again");
  }

  const tinygltf::Node& node_at(int node) const {
    if (node < 0 || size_t(node) >= model_.nodes.size())
      fail("refers to node " + std::to_string(node) + ", which is not there");
    return model_.nodes[size_t(node)];
  }

  // The default scene's nodes; without a default scene, all nodes that are no other node's child.
  std::vector<int> find_roots() const {
    if (model_.defaultScene >= 0) {
      if (size_t(model_.defaultScene) >= model_.scenes.size())
        fail("names a default scene that is not there");
      return model_.scenes[size_t(model_.defaultScene)].nodes;
    }
    std::vector<bool> is_child(model_.nodes.size(), false);
    for (const tinygltf::Node& node : model_.nodes) {
      for (const int child : node.children) {
        node_at(child);
        is_child[size_t(child)] = true;
      }
    }
    std::vector<int> roots;
    for (size_t i = 0; i < model_.nodes.size(); ++i) {
      if (!is_child[i]) roots.push_back(int(i));
    }
    return roots;
  }

  struct Extent {
    uint64_t triangles = 0, visits = 0;
  };

  // Refuses cycles and scenes too large before a single matrix is multiplied. A node may have several parents
  // (files that do so exist, against the specification), so a small file can declare a huge scene.
  void check_scene(const std::vector<int>& roots) {
    enum : uint8_t { kNew, kOpen, kDone };
    std::vector<uint8_t> state(model_.nodes.size(), kNew);
    extents_.assign(model_.nodes.size(), {});
    Extent all;
    std::vector<std::pair<int, size_t>> stack;
    for (const int root : roots) {
      node_at(root);
      if (state[size_t(root)] == kNew) stack.push_back({root, 0});
      if (!stack.empty()) state[size_t(root)] = kOpen;
      while (!stack.empty()) {
        const int node = stack.back().first;
        const auto& children = node_at(node).children;
        if (stack.back().second < children.size()) {
          const int child = children[stack.back().second++];
          node_at(child);
          if (state[size_t(child)] == kOpen) fail("has nodes that are their own ancestors");
          if (state[size_t(child)] == kNew) {
            state[size_t(child)] = kOpen;
            stack.push_back({child, 0});
          }
          continue;
        }
        Extent& extent = extents_[size_t(node)];
        extent.visits = 1 + children.size();
        extent.triangles = own_triangles(node);
        for (const int child : children) add(extent, extents_[size_t(child)]);
        state[size_t(node)] = kDone;
        stack.pop_back();
      }
      add(all, extents_[size_t(root)]);
    }
    if (all.visits > kMaxVisits) {
      throw Failure(Exit::kLimit, document_->file, "places more than 2^24 nodes, split the scene");
    }
    builder_.check_count(document_->file, all.triangles);
  }

  static void add(Extent& to, const Extent& more) {
    constexpr uint64_t kFull = uint64_t{1} << 62;
    to.triangles = std::min(kFull, to.triangles + more.triangles);
    to.visits = std::min(kFull, to.visits + (more.triangles ? more.visits : 0));
  }

  uint64_t own_triangles(int node) {
    const int mesh = model_.nodes[size_t(node)].mesh;
    if (mesh < 0) return 0;
    uint64_t triangles = 0;
    for (const Primitive& primitive : primitives(mesh)) triangles += primitive.indices.size() / 3;
    const uint64_t copies = instances(node);
    return copies && triangles > (uint64_t{1} << 62) / copies ? uint64_t{1} << 62 : triangles * copies;
  }

  // A mesh's primitives with triangles, read on first use.
  const std::vector<Primitive>& primitives(int mesh) {
    if (size_t(mesh) >= model_.meshes.size())
      fail("refers to mesh " + std::to_string(mesh) + ", which is not there");
    const auto [at, fresh] = meshes_.try_emplace(mesh);
    if (!fresh) return at->second;
    for (const tinygltf::Primitive& source : model_.meshes[size_t(mesh)].primitives) {
      const int mode = source.mode < 0 ? TINYGLTF_MODE_TRIANGLES : source.mode;
      if (mode < TINYGLTF_MODE_TRIANGLES || mode > TINYGLTF_MODE_TRIANGLE_FAN) {
        ++skipped_modes_;
      } else if (!source.attributes.contains("POSITION")) {
        ++without_positions_;
      } else {
        // One without a triangle would be placed all the same, as often as there are instances.
        Primitive primitive = read_primitive(source, mode);
        if (primitive.indices.size() >= 3) at->second.push_back(std::move(primitive));
      }
    }
    return at->second;
  }

  Primitive read_primitive(const tinygltf::Primitive& source, int mode) {
    const auto attribute = [&](const char* name) {
      const auto found = source.attributes.find(name);
      return found == source.attributes.end() ? -1 : found->second;
    };
    const int position = attribute("POSITION"), normal = attribute("NORMAL"),
              indices = attribute(kGltfIndices);
    Primitive out;
    out.material = source.material >= 0 ? uint32_t(source.material) : kNoIndex;
    if (source.extensions.contains("KHR_draco_mesh_compression")) {
      read_draco(source, position, normal, out);
    } else {
      out.positions = vectors_of(accessors_.floats(position, 3));
      if (normal >= 0) out.normals = vectors_of(accessors_.floats(normal, 3));
      std::vector<uint32_t> vertices;
      if (indices >= 0) {
        vertices = accessors_.indices(indices);
      } else {
        builder_.budget().charge(document_->file, out.positions.size(), sizeof(uint32_t));
        vertices.resize(out.positions.size());
        for (size_t i = 0; i < vertices.size(); ++i) vertices[i] = uint32_t(i);
      }
      builder_.budget().charge(document_->file, vertices.size(), 3 * sizeof(uint32_t));
      out.indices = expand(std::move(vertices), mode);
    }
    // Every element needs both; a file with fewer normals has lost them.
    if (!out.normals.empty() && out.normals.size() != out.positions.size()) {
      builder_.note(document_->file +
                    ": a primitive has fewer or more normals than positions, they are not used");
      out.normals.clear();
    }
    if (out.positions.size() > out.indices.size()) drop_unused(out);
    return out;
  }

  // Primitives often share one vertex buffer, and each is placed once an instance: leave it what it uses.
  static void drop_unused(Primitive& primitive) {
    std::vector<uint32_t> moved(primitive.positions.size(), kNoIndex);
    Primitive kept;
    for (uint32_t& index : primitive.indices) {
      if (index >= moved.size()) {
        index = kNoIndex;
        continue;
      }
      if (moved[index] == kNoIndex) {
        moved[index] = uint32_t(kept.positions.size());
        kept.positions.push_back(primitive.positions[index]);
        if (!primitive.normals.empty()) kept.normals.push_back(primitive.normals[index]);
      }
      index = moved[index];
    }
    primitive.positions = std::move(kept.positions);
    primitive.normals = std::move(kept.normals);
  }

  // Draco's primitives of all meshes that nodes place, decoded in one go.
  void decode_all_draco() {
    std::vector<bool> placed(model_.meshes.size(), false);
    for (const tinygltf::Node& node : model_.nodes) {
      if (node.mesh >= 0 && size_t(node.mesh) < placed.size()) placed[size_t(node.mesh)] = true;
    }
    std::vector<DracoJob> jobs;
    std::vector<const tinygltf::Primitive*> sources;
    for (size_t mesh = 0; mesh < placed.size(); ++mesh) {
      if (!placed[mesh]) continue;
      for (const tinygltf::Primitive& source : model_.meshes[mesh].primitives) {
        if (!source.extensions.contains("KHR_draco_mesh_compression") ||
            !source.attributes.contains("POSITION"))
          continue;
        jobs.push_back(draco_job(source));
        sources.push_back(&source);
      }
    }
    if (jobs.empty()) return;
    std::vector<DracoMesh> meshes = decode_draco_fenced(document_->file, jobs, builder_.budget());
    for (size_t i = 0; i < sources.size(); ++i) draco_.emplace(sources[i], std::move(meshes[i]));
  }

  DracoJob draco_job(const tinygltf::Primitive& source) {
    const tinygltf::Value& extension = source.extensions.at("KHR_draco_mesh_compression");
    const auto id = [&](const char* name) {
      if (!extension.IsObject() || !extension.Get("attributes").IsObject()) return -1;
      const tinygltf::Value& value = extension.Get("attributes").Get(name);
      return value.IsInt() ? value.Get<int>() : -1;
    };
    const tinygltf::Value none;
    const tinygltf::Value& view = extension.IsObject() ? extension.Get("bufferView") : none;
    if (!view.IsInt() || id("POSITION") < 0)
      fail("has KHR_draco_mesh_compression without a buffer view or positions");
    DracoJob job{accessors_.view(view.Get<int>()), id("POSITION"),
                 accessors_.at(source.attributes.at("POSITION")).normalized};
    const auto normal = source.attributes.find("NORMAL");
    if (normal != source.attributes.end() && id("NORMAL") >= 0) {
      job.normal_id = id("NORMAL");
      job.normal_normalized = accessors_.at(normal->second).normalized;
    }
    return job;
  }

  void read_draco(const tinygltf::Primitive& source, int position, int normal, Primitive& out) {
    const auto found = draco_.find(&source);
    if (found == draco_.end()) fail("has a compressed primitive that no node places");
    DracoMesh mesh = std::move(found->second);
    draco_.erase(found);
    accessors_.overlay_sparse(accessors_.at(position), 3, mesh.positions);
    if (!mesh.normals.empty()) accessors_.overlay_sparse(accessors_.at(normal), 3, mesh.normals);
    out.positions = vectors_of(mesh.positions);
    out.normals = vectors_of(mesh.normals);
    out.indices = std::move(mesh.indices);
  }

  // EXT_mesh_gpu_instancing: how often a node places its mesh.
  uint64_t instances(int node) {
    const tinygltf::Value* attributes = instancing(node);
    if (!attributes) return 1;
    uint64_t count = std::numeric_limits<uint64_t>::max();
    for (const char* name : {"TRANSLATION", "ROTATION", "SCALE"}) {
      const tinygltf::Value& accessor = attributes->Get(name);
      if (accessor.IsInt()) count = std::min<uint64_t>(count, accessors_.at(accessor.Get<int>()).count);
    }
    return count == std::numeric_limits<uint64_t>::max() ? 1 : count;
  }

  const tinygltf::Value* instancing(int node) const {
    const auto& extensions = model_.nodes[size_t(node)].extensions;
    const auto found = extensions.find("EXT_mesh_gpu_instancing");
    if (found == extensions.end() || !found->second.IsObject()) return nullptr;
    const tinygltf::Value& attributes = found->second.Get("attributes");
    return attributes.IsObject() ? &attributes : nullptr;
  }

  void walk(int root) {
    std::vector<std::pair<int, glm::dmat4>> stack{{root, glm::dmat4(1)}};
    while (!stack.empty()) {
      const auto [node, parent] = stack.back();
      stack.pop_back();
      if (extents_[size_t(node)].triangles == 0) continue;
      const tinygltf::Node& source = node_at(node);
      const glm::dmat4 world = parent * matrix_of(source);
      if (source.mesh >= 0) place_all(node, world);
      // The stack turns the order round; children are to come in theirs.
      for (size_t i = source.children.size(); i-- > 0;) stack.push_back({source.children[i], world});
    }
  }

  void place_all(int node, const glm::dmat4& world) {
    const std::vector<Primitive>& list = primitives(model_.nodes[size_t(node)].mesh);
    const tinygltf::Value* attributes = instancing(node);
    if (!attributes) {
      for (const Primitive& primitive : list) place(primitive, world);
      return;
    }
    const auto read = [&](const char* name, int components) {
      const tinygltf::Value& accessor = attributes->Get(name);
      return accessor.IsInt() ? accessors_.floats(accessor.Get<int>(), components) : std::vector<float>();
    };
    const std::vector<float> translation = read("TRANSLATION", 3), rotation = read("ROTATION", 4),
                             scale = read("SCALE", 3);
    const auto slice = [](const std::vector<float>& values, uint64_t i, size_t n) {
      if (values.empty()) return std::vector<double>();
      const auto begin = values.begin() + std::ptrdiff_t(i * n);
      return std::vector<double>(begin, begin + std::ptrdiff_t(n));
    };
    const uint64_t count = instances(node);
    for (uint64_t i = 0; i < count; ++i) {
      const glm::dmat4 own = matrix_of(slice(translation, i, 3), slice(rotation, i, 4), slice(scale, i, 3));
      for (const Primitive& primitive : list) place(primitive, world * own);
    }
  }

  void place(const Primitive& primitive, const glm::dmat4& world) {
    const glm::dmat3 linear(world);
    const double determinant = glm::dot(linear[0], glm::cross(linear[1], linear[2]));
    const bool mirrored = determinant < 0;
    // Normals go with the cofactor matrix: the inverse transpose times the determinant, which exists for
    // scales of zero too. Its sign is taken out again.
    glm::dmat3 cofactors(glm::cross(linear[1], linear[2]), glm::cross(linear[2], linear[0]),
                         glm::cross(linear[0], linear[1]));
    if (mirrored) cofactors *= -1.0;

    placed_.resize(primitive.positions.size());
    for (size_t i = 0; i < placed_.size(); ++i) {
      placed_[i] = glm::vec3(glm::dvec3(world * glm::dvec4(glm::dvec3(primitive.positions[i]), 1)));
    }
    turned_.resize(primitive.normals.size());
    for (size_t i = 0; i < turned_.size(); ++i) turned_[i] = turn(cofactors, primitive.normals[i]);

    const uint32_t material = material_of(primitive.material);
    builder_.begin(document_->file, placed_, primitive.indices.size() / 3, MissingNormals::kFlat);
    for (size_t i = 0; i + 2 < primitive.indices.size(); i += 3) {
      glm::uvec3 corners(primitive.indices[i], primitive.indices[i + 1], primitive.indices[i + 2]);
      if (mirrored) std::swap(corners.y, corners.z);
      glm::vec3 normals[3];
      const bool has_normals =
          corners.x < turned_.size() && corners.y < turned_.size() && corners.z < turned_.size();
      for (int k = 0; k < 3 && has_normals; ++k) normals[k] = turned_[corners[k]];
      builder_.add(corners, has_normals ? normals : nullptr, material);
    }
    builder_.end();
  }

  // Scaled to its largest component, so that float32 holds the result of any matrix.
  static glm::vec3 turn(const glm::dmat3& cofactors, const glm::vec3& normal) {
    const glm::dvec3 turned = cofactors * glm::dvec3(normal);
    const double largest = std::max(std::abs(turned.x), std::max(std::abs(turned.y), std::abs(turned.z)));
    return glm::vec3(largest > 0 && std::isfinite(largest) ? turned / largest : glm::dvec3(0));
  }

  uint32_t material_of(uint32_t index) {
    if (index >= model_.materials.size()) return builder_.default_material();
    const auto [at, fresh] = materials_.try_emplace(index, kNoIndex);
    if (!fresh) return at->second;
    const tinygltf::Material& source = model_.materials[index];
    const auto& pbr = source.pbrMetallicRoughness;
    Material material;
    material.name = source.name;
    material.base_color = glm::vec3(1);
    for (int k = 0; k < 3; ++k) {
      if (pbr.baseColorFactor.size() == 4) material.base_color[k] = float(pbr.baseColorFactor[size_t(k)]);
      if (source.emissiveFactor.size() == 3) material.emission[k] = float(source.emissiveFactor[size_t(k)]);
    }
    const bool blended = source.alphaMode == "BLEND" || source.alphaMode == "MASK";
    if (blended && pbr.baseColorFactor.size() == 4) material.opacity = float(pbr.baseColorFactor[3]);
    material.roughness = float(pbr.roughnessFactor);
    material.metallic = float(pbr.metallicFactor);
    const auto extension = [&](const char* name) -> const tinygltf::Value* {
      const auto found = source.extensions.find(name);
      return found != source.extensions.end() && found->second.IsObject() ? &found->second : nullptr;
    };
    if (const auto* strength = extension("KHR_materials_emissive_strength")) {
      const tinygltf::Value& factor = strength->Get("emissiveStrength");
      if (factor.IsNumber()) material.emission *= float(factor.GetNumberAsDouble());
    }
    if (const auto* glossy = extension("KHR_materials_pbrSpecularGlossiness")) {
      const tinygltf::Value& diffuse = glossy->Get("diffuseFactor");
      if (diffuse.IsArray() && diffuse.ArrayLen() >= 3) {
        for (int k = 0; k < 3; ++k) {
          if (diffuse.Get(k).IsNumber()) material.base_color[k] = float(diffuse.Get(k).GetNumberAsDouble());
        }
      }
      const tinygltf::Value& glossiness = glossy->Get("glossinessFactor");
      material.roughness = glossiness.IsNumber() ? 1.0f - float(glossiness.GetNumberAsDouble()) : 0.0f;
      material.metallic = 0;
    }
    return at->second = builder_.add_material(std::move(material));
  }

  MeshBuilder& builder_;
  const std::unique_ptr<GltfDocument> document_;
  const tinygltf::Model& model_;
  GltfAccessors accessors_;
  std::map<int, std::vector<Primitive>> meshes_;
  std::map<uint32_t, uint32_t> materials_;
  std::map<const tinygltf::Primitive*, DracoMesh> draco_;  // decoded, and not yet part of meshes_
  std::vector<Extent> extents_;                            // of each node with what hangs below it
  std::vector<glm::vec3> placed_, turned_;
  uint64_t skipped_modes_ = 0, without_positions_ = 0;
};

}  // namespace

void read_gltf(const std::filesystem::path& path, MeshBuilder& builder) { GltfReader(path, builder).read(); }

}  // namespace lsp
