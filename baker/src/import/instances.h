// A scene as its distinct meshes and the places where they are.
#pragma once

#include <filesystem>
#include <glm/glm.hpp>
#include <span>
#include <string>
#include <vector>

#include "import/import.h"
#include "import/mesh_builder.h"

namespace lsp {

// A mesh that is baked once. Its positions are relative to `origin` of its own space, which is not zero only
// where single precision would move them; mesh.origin is zero, the instances' transforms have that in them.
struct InstancedAsset {
  std::string name;      // of the mesh in its file, else of the file; printable, may be there twice
  size_t input = 0;      // which of the inputs it is of
  bool is_part = false;  // a mesh of a glTF file, whatever else is there; else all of the file
  Mesh mesh;
  glm::dvec3 origin{0};
};

struct MeshInstance {
  uint32_t asset = 0;
  glm::dmat4 transform{1};  // from the asset's positions to the scene less its origin; affine
  std::string name;         // of the node
};

struct InstancedMeshes {
  std::vector<InstancedAsset> assets;  // each with triangles, in the order of their first instances
  std::vector<MeshInstance> instances;
  glm::dvec3 origin{0};                                     // of the scene, as Mesh.origin
  std::vector<std::vector<std::filesystem::path>> sources;  // as Mesh.sources
  std::vector<std::string> notes;                           // all, those of the assets too
  // Of all assets, those too that have nothing to bake and are not here.
  uint64_t primitive_count = 0;
  Rejected rejected;
  uint64_t allocated_bytes = 0;  // that the assets hold, estimated from above
};

// As many as hits have numbers for.
constexpr size_t kMaxInstances = 0xFFFFFF;

// Reads the files as import_meshes does, but every mesh of a glTF file once, in its own space. In the order
// in which import_meshes would add its triangles each place of a mesh is an instance; a mesh in a pose of its
// own (morph weights, a skin) is an asset of its own. What joints move, and what a node flattens so that no
// transform leads back, is an asset in scene space. A file of another format is one asset and one instance.
// Instances of meshes without a triangle to bake are left out with a note. Throws Failure as import_meshes
// does, kLimit for more than kMaxInstances.
InstancedMeshes import_instances(std::span<const std::filesystem::path> inputs, const ImportOptions& options);

// For readers: takes the mesh out of the builder, as an asset of the input that is being read. Returns its
// number, kNoIndex where nothing of it can be baked.
uint32_t add_asset(InstancedMeshes& to, MeshBuilder& builder, const std::string& name, bool is_part);

}  // namespace lsp
