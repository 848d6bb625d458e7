// Where glTF nodes and joints put things.
#pragma once

#include <glm/glm.hpp>
#include <map>
#include <span>
#include <vector>

#include "import/gltf_accessor.h"

namespace lsp {

glm::dmat4 gltf_matrix(const tinygltf::Node& node);
// Each part empty or complete.
glm::dmat4 gltf_matrix(const std::vector<double>& translation, const std::vector<double>& rotation,
                       const std::vector<double>& scale);

// A matrix applied to positions and normals.
struct Placement {
  explicit Placement(const glm::dmat4& matrix);
  glm::dvec3 position(const glm::vec3& p) const { return glm::dvec3(matrix * glm::dvec4(p, 1)); }
  // Scaled to its largest component, so that float32 holds the result of any matrix.
  glm::vec3 normal(const glm::vec3& n) const;

  glm::dmat4 matrix;
  glm::dmat3 cofactors;
  bool mirrored;
};

// Skins at rest (glTF 2.0, section 3.7.3.3): a joint's matrix is that of its node in the scene times its
// inverse bind matrix. The transform of the node that holds the mesh takes no part.
class GltfSkins {
 public:
  GltfSkins(const GltfDocument& document, GltfAccessors& accessors);

  // Throws Failure kInvalid where the skin, or a node it names, is not there.
  const std::vector<glm::dmat4>& joint_matrices(int skin);

  // The weighted mean of the joints' matrices. Joints that are not there must have no weight, else Failure
  // kInvalid; without any weight the first joint counts alone.
  glm::dmat4 blend(std::span<const uint32_t> joints, std::span<const float> weights,
                   const std::vector<glm::dmat4>& matrices) const;

 private:
  glm::dmat4 global_matrix(int node) const;
  [[noreturn]] void fail(const std::string& what) const;

  const GltfDocument& document_;
  GltfAccessors& accessors_;
  std::vector<int> parents_;  // of each node, -1 for none; the first where a file gives several
  std::map<int, std::vector<glm::dmat4>> skins_;
};

}  // namespace lsp
