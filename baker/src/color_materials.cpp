#include "color_materials.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>

namespace lsp {
namespace {

constexpr size_t kMostMaterials = 65536;
constexpr int kFinestBits = 8;

// The material and what is left of a colour in so many bits: seven numbers.
using Key = std::array<int32_t, 8>;

Key key_of(uint32_t material, const TriangleColor& color, int bits) {
  const double steps = std::exp2(bits) - 1;
  Key key{int32_t(material)};
  for (int k = 0; k < 3; ++k) {
    key[size_t(1 + k)] = int32_t(std::lround(std::pow(double(color.base_color[k]), 1 / 2.2) * steps));
    // Emission has no largest value: steps of its logarithm, 32 an octave at the finest.
    const double emission = double(color.emission[k]);
    key[size_t(4 + k)] =
        emission > 0 ? int32_t(std::lround(std::log2(emission) * std::exp2(bits - 3))) + 100000 : 0;
  }
  key[7] = int32_t(std::lround(double(color.coverage) * steps));
  return key;
}

struct Sum {
  glm::dvec3 base_color{0}, emission{0};
  double coverage = 0, count = 0;
  uint32_t id = 0;
};

}  // namespace

void make_color_materials(Mesh& mesh) {
  if (mesh.colors.empty()) return;
  std::map<Key, Sum> sums;
  int bits = kFinestBits;
  for (bool fits = false; !fits; bits -= fits ? 0 : 1) {
    sums.clear();
    fits = true;
    for (size_t t = 0; t < mesh.triangles.size() && fits; ++t) {
      const TriangleColor& color = mesh.colors[t];
      Sum& sum = sums[key_of(mesh.material_ids[t], color, bits)];
      sum.base_color += color.base_color;
      sum.emission += color.emission;
      sum.coverage += double(color.coverage);
      sum.count += 1;
      fits = sums.size() <= kMostMaterials || bits == 1;
    }
  }
  std::vector<Material> materials;
  for (auto& [key, sum] : sums) {
    sum.id = uint32_t(materials.size());
    Material material = mesh.materials[size_t(key[0])];
    material.base_color = glm::vec3(sum.base_color / sum.count);
    material.emission = glm::vec3(sum.emission / sum.count);
    material.opacity = float(sum.coverage / sum.count);
    materials.push_back(std::move(material));
  }
  for (size_t t = 0; t < mesh.triangles.size(); ++t)
    mesh.material_ids[t] = sums.at(key_of(mesh.material_ids[t], mesh.colors[t], bits)).id;
  mesh.materials = std::move(materials);
}

}  // namespace lsp
