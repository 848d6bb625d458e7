// Triangles' own colours as materials.
#include "color_materials.h"

#include <gtest/gtest.h>

#include "meshes.h"

namespace lsp::test {
namespace {

// `count` triangles of one material, a colour each.
Mesh coloured(size_t count) {
  Mesh mesh;
  mesh.materials = {{"paint", glm::vec3(0.5f), 1.0f, glm::vec3(0), 0.25f, 0.0f}};
  for (size_t t = 0; t < count; ++t) {
    mesh.triangles.push_back({0, 1, 2});
    mesh.material_ids.push_back(0);
    mesh.colors.push_back(
        {glm::vec3(float(t % 100) / 100, float(t / 100 % 100) / 100, float(t / 10000) / 100),
         glm::vec3(0, float(t % 7), 0), t % 2 ? 1.0f : 0.5f});
  }
  return mesh;
}

float largest_error(const Mesh& mesh) {
  float error = 0;
  for (size_t t = 0; t < mesh.triangles.size(); ++t) {
    const TriangleColor got = mesh.materials[mesh.material_ids[t]].color(), want = mesh.colors[t];
    for (int k = 0; k < 3; ++k) error = std::max(error, std::abs(got.base_color[k] - want.base_color[k]));
    error = std::max(error, std::abs(got.coverage - want.coverage));
  }
  return error;
}

TEST(ColorMaterials, AMeshWithoutColoursKeepsItsMaterials) {
  Mesh mesh = coloured(3);
  mesh.colors.clear();
  make_color_materials(mesh);
  EXPECT_EQ(mesh.materials.size(), 1u);
}

TEST(ColorMaterials, EqualColoursShareOneAndOthersHaveTheirOwn) {
  Mesh mesh = coloured(50);
  mesh.colors[7] = mesh.colors[9];
  make_color_materials(mesh);
  EXPECT_EQ(mesh.materials.size(), 49u);
  EXPECT_EQ(mesh.material_ids[7], mesh.material_ids[9]);
  EXPECT_LT(largest_error(mesh), 1e-6f);
  for (const Material& material : mesh.materials) {
    EXPECT_EQ(material.name, "paint");
    EXPECT_EQ(material.roughness, 0.25f);
  }
}

TEST(ColorMaterials, AreBoundedInNumberAndNearTheirColours) {
  Mesh mesh = coloured(300'000);
  make_color_materials(mesh);
  EXPECT_LE(mesh.materials.size(), 65'536u);
  EXPECT_GT(mesh.materials.size(), 10'000u);
  EXPECT_LT(largest_error(mesh), 0.08f) << "four bits at the coarsest";
}

}  // namespace
}  // namespace lsp::test
