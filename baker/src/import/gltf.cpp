// glTF scenes: meshes as nodes, instances and skins place them.
#include <algorithm>
#include <bit>
#include <limits>
#include <map>

#include "import/gltf_materials.h"
#include "import/gltf_primitive.h"
#include "import/gltf_scene.h"
#include "import/gltf_skin.h"
#include "import/readers.h"
#include "import/source_file.h"
#include "lsp/program.h"

namespace lsp {
namespace {

// Whether an instance may have the matrix. Harder to please than the runtime (lsp_instances_build), which has
// it in single precision: another factor of two.
bool has_inverse(const glm::dmat4& matrix) {
  double columns = 1;
  glm::dmat3 linear(matrix);
  for (int i = 0; i < 4; ++i) {
    for (int k = 0; k < 3; ++k) {
      if (!std::isfinite(float(matrix[i][k]))) return false;
      if (i < 3) linear[i][k] = double(float(matrix[i][k]));
    }
    if (i < 3) columns *= glm::length(linear[i]);
  }
  const double determinant = glm::determinant(linear);
  return std::abs(determinant) > columns * 0x1p-39 && std::isfinite(1 / determinant);
}

// Reads into one mesh or, where `instances` is not null, into the assets and instances there.
class GltfReader {
 public:
  GltfReader(const std::filesystem::path& path, MeshBuilder& builder, InstancedMeshes* instances)
      : builder_(builder),
        instances_(instances),
        document_(read_gltf_document(path, builder.budget())),
        model_(document_->model),
        accessors_(*document_, builder.budget()),
        path_(path),
        materials_(path_, *document_, accessors_, builder),
        primitives_(*document_, accessors_, materials_, builder),
        skins_(*document_, accessors_),
        scene_(*document_, builder) {}

  void read(PoseRequest& pose) {
    for (const std::string& note : document_->notes) builder_.note(document_->file + ": " + note);
    for (const std::filesystem::path& source : document_->sources) builder_.add_source(source);
    pose_document(*document_, accessors_, pose, builder_);
    const uint64_t triangles = scene_.check([this](int node) { return own_triangles(node); });
    if (!instances_) builder_.check_count(document_->file, triangles);
    for (const int root : scene_.roots()) walk(root);
    primitives_.note_skipped();
  }

 private:
  const std::vector<GltfPrimitive>& primitives(int node) {
    const tinygltf::Node& source = model_.nodes[size_t(node)];
    return primitives_.of(source.mesh, source.weights);
  }

  uint64_t own_triangles(int node) {
    if (model_.nodes[size_t(node)].mesh < 0) return 0;
    uint64_t triangles = 0;
    for (const GltfPrimitive& primitive : primitives(node)) triangles += primitive.indices.size() / 3;
    const uint64_t copies = instances(node);
    return copies && triangles > (uint64_t{1} << 62) / copies ? uint64_t{1} << 62 : triangles * copies;
  }

  // EXT_mesh_gpu_instancing: how often a node places its mesh.
  uint64_t instances(int node) {
    const tinygltf::Value* attributes = instancing(node);
    if (!attributes) return 1;
    uint64_t count = std::numeric_limits<uint64_t>::max(), most = 0;
    for (const char* name : {"TRANSLATION", "ROTATION", "SCALE"}) {
      const tinygltf::Value& accessor = attributes->Get(name);
      if (!accessor.IsInt()) continue;
      const uint64_t own = accessors_.at(accessor.Get<int>()).count;
      count = std::min(count, own);
      most = std::max(most, own);
    }
    if (count < most)
      builder_.note(document_->file +
                    ": instances have attributes of different lengths, the shortest counts");
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
      if (scene_.triangles(node) == 0) continue;
      const tinygltf::Node& source = model_.nodes[size_t(node)];
      const glm::dmat4 world = parent * gltf_matrix(source);
      if (source.mesh >= 0) place_all(node, world);
      // The stack turns the order round; children are to come in theirs.
      for (size_t i = source.children.size(); i-- > 0;) stack.push_back({source.children[i], world});
    }
  }

  void place_all(int node, const glm::dmat4& world) {
    const std::vector<GltfPrimitive>& list = primitives(node);
    const tinygltf::Value* attributes = instancing(node);
    if (!attributes) return place_mesh(node, list, world);
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
      const glm::dmat4 own = gltf_matrix(slice(translation, i, 3), slice(rotation, i, 4), slice(scale, i, 3));
      place_mesh(node, list, world * own);
    }
  }

  void place_mesh(int node, const std::vector<GltfPrimitive>& list, const glm::dmat4& world) {
    if (instances_) return add_instance(node, list, world);
    for (const GltfPrimitive& primitive : list)
      place(primitive, world, model_.nodes[size_t(node)].skin, builder_, primitive.material);
  }

  // What makes meshes distinct: the mesh as its weights have it, and, where an asset is in scene space, the
  // skin that moves it and the matrix, by its bits.
  struct AssetKey {
    const std::vector<GltfPrimitive>* primitives;
    int skin = -1;
    std::array<uint64_t, 16> matrix{};
    auto operator<=>(const AssetKey&) const = default;
  };

  void add_instance(int node, const std::vector<GltfPrimitive>& list, const glm::dmat4& world) {
    if (list.empty()) return;
    const int skin = model_.nodes[size_t(node)].skin;
    const auto posed = std::count_if(list.begin(), list.end(),
                                     [&](const GltfPrimitive& p) { return skin >= 0 && p.joints_each; });
    const bool in_scene_space = posed > 0 || !has_inverse(world);
    AssetKey key{&list, posed > 0 ? skin : -1, {}};
    if (in_scene_space && posed < std::ptrdiff_t(list.size()))
      key.matrix = std::bit_cast<std::array<uint64_t, 16>>(world);
    const auto [at, fresh] = assets_.try_emplace(key, kNoIndex);
    const glm::dmat4 none(1);
    if (fresh) at->second = make_asset(node, in_scene_space ? world : none);
    const std::string& name = model_.nodes[size_t(node)].name;
    if (at->second == kNoIndex)
      return builder_.note(document_->file + ": instances of the mesh " + mesh_name(node) +
                           " are left out, none of its triangles can be used" +
                           (in_scene_space ? " where the node " + name + " puts it" : ""));
    if (instances_->instances.size() == kMaxInstances)
      throw Failure(Exit::kLimit, document_->file, "places more than 2^24 - 1 meshes, split the scene");
    builder_.budget().charge(document_->file, name.size());
    builder_.budget().push_back(document_->file, instances_->instances,
                                {at->second, in_scene_space ? none : world, printable(name)});
  }

  std::string mesh_name(int node) const {
    const int mesh = model_.nodes[size_t(node)].mesh;
    const std::string& name = model_.meshes[size_t(mesh)].name;
    return name.empty() ? "mesh" + std::to_string(mesh) : name;
  }

  uint32_t make_asset(int node, const glm::dmat4& matrix) {
    MeshBuilder asset(builder_.budget(), 0);
    std::map<uint32_t, uint32_t> materials;  // from the builder's to those of the asset
    for (const GltfPrimitive& primitive : primitives(node)) {
      const auto [at, fresh] = materials.try_emplace(primitive.material, 0);
      if (fresh)
        at->second = asset.add_material(document_->file, builder_.mesh().materials[primitive.material]);
      place(primitive, matrix, model_.nodes[size_t(node)].skin, asset, at->second);
    }
    return add_asset(*instances_, asset, mesh_name(node), true);
  }

  // A primitive as its node places it, or, where it has joints, as these do.
  void place(const GltfPrimitive& primitive, const glm::dmat4& world, int skin, MeshBuilder& to,
             uint32_t material) {
    placed_.resize(primitive.positions.size());
    turned_.resize(primitive.normals.size());
    mirrored_.clear();
    bool mirrored = false;
    if (skin >= 0 && !primitive.joints_each)
      builder_.note(document_->file +
                    ": a skin has a primitive without joints, which stands where its node puts it");
    if (skin >= 0 && primitive.joints_each) {
      place_by_joints(primitive, skins_.joint_matrices(skin));
    } else {
      const Placement placement(world);
      mirrored = placement.mirrored;
      for (size_t i = 0; i < placed_.size(); ++i) placed_[i] = placement.position(primitive.positions[i]);
      for (size_t i = 0; i < turned_.size(); ++i) turned_[i] = placement.normal(primitive.normals[i]);
    }

    to.begin(document_->file, placed_, primitive.indices.size() / 3, MissingNormals::kFlat);
    for (size_t i = 0; i + 2 < primitive.indices.size(); i += 3) {
      glm::uvec3 corners(primitive.indices[i], primitive.indices[i + 1], primitive.indices[i + 2]);
      const size_t first = corners.x;
      if (first < mirrored_.size() ? mirrored_[first] : mirrored) std::swap(corners.y, corners.z);
      glm::vec3 normals[3];
      const bool has_normals =
          corners.x < turned_.size() && corners.y < turned_.size() && corners.z < turned_.size();
      for (int k = 0; k < 3 && has_normals; ++k) normals[k] = turned_[corners[k]];
      to.add(corners, has_normals ? normals : nullptr, material,
             primitive.colors.empty() ? nullptr : &primitive.colors[i / 3]);
    }
    to.end();
  }

  void place_by_joints(const GltfPrimitive& primitive, const std::vector<glm::dmat4>& joints) {
    mirrored_.resize(placed_.size());
    for (size_t i = 0; i < placed_.size(); ++i) {
      const size_t first = i * primitive.joints_each;
      const Placement placement(skins_.blend({&primitive.joints[first], primitive.joints_each},
                                             {&primitive.weights[first], primitive.joints_each}, joints));
      placed_[i] = placement.position(primitive.positions[i]);
      if (i < turned_.size()) turned_[i] = placement.normal(primitive.normals[i]);
      mirrored_[i] = placement.mirrored;
    }
  }

  MeshBuilder& builder_;
  InstancedMeshes* const instances_;
  std::map<AssetKey, uint32_t> assets_;  // their numbers; kNoIndex: nothing of it can be baked
  const std::unique_ptr<GltfDocument> document_;
  const tinygltf::Model& model_;
  GltfAccessors accessors_;
  const std::filesystem::path path_;
  GltfMaterials materials_;
  GltfPrimitives primitives_;
  GltfSkins skins_;
  GltfScene scene_;
  std::vector<glm::dvec3> placed_;
  std::vector<glm::vec3> turned_;
  std::vector<bool> mirrored_;  // per position of a skinned primitive
};

}  // namespace

void read_gltf(const std::filesystem::path& path, MeshBuilder& builder, PoseRequest& pose) {
  GltfReader(path, builder, nullptr).read(pose);
}

void read_gltf_instances(const std::filesystem::path& path, MeshBuilder& builder, PoseRequest& pose,
                         InstancedMeshes& to) {
  GltfReader(path, builder, &to).read(pose);
  to.sources.back() = builder.mesh().sources.back();
  to.notes.insert(to.notes.end(), builder.mesh().notes.begin(), builder.mesh().notes.end());
}

}  // namespace lsp
