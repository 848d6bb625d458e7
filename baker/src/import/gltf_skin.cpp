#include "import/gltf_skin.h"

#include <cmath>

#include "lsp/program.h"

namespace lsp {

glm::dmat4 gltf_matrix(const std::vector<double>& translation, const std::vector<double>& rotation,
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

glm::dmat4 gltf_matrix(const tinygltf::Node& node) {
  if (node.matrix.size() != 16) return gltf_matrix(node.translation, node.rotation, node.scale);
  glm::dmat4 matrix;
  for (size_t i = 0; i < 16; ++i) matrix[int(i / 4)][int(i % 4)] = node.matrix[i];
  return matrix;
}

Placement::Placement(const glm::dmat4& placed) : matrix(placed) {
  const glm::dmat3 linear(matrix);
  mirrored = glm::dot(linear[0], glm::cross(linear[1], linear[2])) < 0;
  // Normals go with the cofactor matrix: the inverse transpose times the determinant, which exists for scales
  // of zero too. Its sign is taken out again.
  cofactors = glm::dmat3(glm::cross(linear[1], linear[2]), glm::cross(linear[2], linear[0]),
                         glm::cross(linear[0], linear[1]));
  if (mirrored) cofactors *= -1.0;
}

glm::vec3 Placement::normal(const glm::vec3& n) const {
  const glm::dvec3 turned = cofactors * glm::dvec3(n);
  const double largest = std::max(std::abs(turned.x), std::max(std::abs(turned.y), std::abs(turned.z)));
  return glm::vec3(largest > 0 && std::isfinite(largest) ? turned / largest : glm::dvec3(0));
}

GltfSkins::GltfSkins(const GltfDocument& document, GltfAccessors& accessors)
    : document_(document), accessors_(accessors), parents_(document.model.nodes.size(), -1) {
  for (size_t node = 0; node < parents_.size(); ++node) {
    for (const int child : document.model.nodes[node].children) {
      if (child >= 0 && size_t(child) < parents_.size() && parents_[size_t(child)] < 0)
        parents_[size_t(child)] = int(node);
    }
  }
}

void GltfSkins::fail(const std::string& what) const {
  throw Failure(Exit::kInvalid, document_.file, what + ", export it again");
}

glm::dmat4 GltfSkins::global_matrix(int node) const {
  glm::dmat4 matrix(1);
  size_t steps = 0;
  for (int at = node; at >= 0; at = parents_[size_t(at)]) {
    if (++steps > parents_.size()) fail("has nodes that are their own ancestors");
    matrix = gltf_matrix(document_.model.nodes[size_t(at)]) * matrix;
  }
  return matrix;
}

const std::vector<glm::dmat4>& GltfSkins::joint_matrices(int skin) {
  if (size_t(skin) >= document_.model.skins.size())
    fail("refers to skin " + std::to_string(skin) + ", which is not there");
  const auto [at, fresh] = skins_.try_emplace(skin);
  if (!fresh) return at->second;
  const tinygltf::Skin& source = document_.model.skins[size_t(skin)];
  std::vector<float> inverse;
  if (source.inverseBindMatrices >= 0) inverse = accessors_.floats(source.inverseBindMatrices, 16);
  if (!inverse.empty() && inverse.size() / 16 < source.joints.size())
    fail("has a skin with fewer inverse bind matrices than joints");
  for (size_t joint = 0; joint < source.joints.size(); ++joint) {
    const int node = source.joints[joint];
    if (node < 0 || size_t(node) >= parents_.size()) fail("has a skin with a joint that is not there");
    glm::dmat4 bind(1);
    for (size_t k = 0; k < 16 && !inverse.empty(); ++k)
      bind[int(k / 4)][int(k % 4)] = inverse[16 * joint + k];
    at->second.push_back(global_matrix(node) * bind);
  }
  return at->second;
}

glm::dmat4 GltfSkins::blend(std::span<const uint32_t> joints, std::span<const float> weights,
                            const std::vector<glm::dmat4>& matrices) const {
  double total = 0;
  for (const float weight : weights) total += double(weight);
  glm::dmat4 sum(0);
  for (size_t k = 0; k < joints.size(); ++k) {
    const double weight = total > 0 ? double(weights[k]) / total : k == 0 ? 1.0 : 0.0;
    if (weight == 0) continue;
    if (joints[k] >= matrices.size()) fail("has a vertex that moves with a joint that is not there");
    sum += weight * matrices[joints[k]];
  }
  return sum;
}

}  // namespace lsp
