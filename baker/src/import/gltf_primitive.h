// The triangles of a glTF mesh in its own space, morphed.
#pragma once

#include <glm/glm.hpp>
#include <map>
#include <vector>

#include "import/gltf_accessor.h"
#include "import/gltf_draco_primitives.h"
#include "import/gltf_materials.h"
#include "import/mesh_builder.h"

namespace lsp {

struct GltfPrimitive {
  std::vector<glm::vec3> positions;
  std::vector<glm::vec3> normals;     // empty or one a position
  std::vector<uint32_t> indices;      // three a triangle; those that refer to nothing may be any number
  uint32_t material = 0;              // the builder's
  std::vector<TriangleColor> colors;  // one a triangle, or none: each has its material's

  // Which joints move a position and how much: `joints_each` of both for every position, or none.
  size_t joints_each = 0;
  std::vector<uint32_t> joints;
  std::vector<float> weights;
};

class GltfPrimitives {
 public:
  // `nodes` decide which compressed primitives are decoded: those of meshes that some node places.
  GltfPrimitives(const GltfDocument& document, GltfAccessors& accessors, GltfMaterials& materials,
                 MeshBuilder& builder);

  // A mesh's primitives with triangles, read on first use. `weights` are those of a node; without any the
  // mesh's own hold. Throws Failure.
  const std::vector<GltfPrimitive>& of(int mesh, const std::vector<double>& weights);

  // Notes what was left out of the meshes read.
  void note_skipped();

 private:
  using Attributes = std::map<std::string, int>;
  // A vertex attribute's values and how many make one.
  struct Values {
    int components = 0;
    std::vector<float> floats;
  };

  GltfPrimitive read(const tinygltf::Primitive& source, int mode, const std::vector<double>& weights);
  Values read_values(const tinygltf::Primitive& source, const std::string& name, int components);
  void read_colors(const tinygltf::Primitive& source, const std::vector<double>& weights, GltfPrimitive& out);
  void normalize_color(const tinygltf::Accessor& accessor, Values& values);
  void note_missing(const std::string& name, const Values& values, const GltfPrimitive& out);
  void read_joints(const tinygltf::Primitive& source, GltfPrimitive& out);
  void morph(const tinygltf::Primitive& source, const std::string& name, const std::vector<double>& weights,
             Values& values);
  [[noreturn]] void fail(const std::string& what) const;

  const GltfDocument& document_;
  GltfAccessors& accessors_;
  GltfMaterials& materials_;
  MeshBuilder& builder_;
  std::map<std::pair<int, std::vector<double>>, std::vector<GltfPrimitive>> meshes_;
  GltfDraco draco_;
  uint64_t skipped_modes_ = 0, without_positions_ = 0;
};

}  // namespace lsp
