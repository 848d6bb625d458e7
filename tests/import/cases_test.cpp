// Small files as people have them; what is right of each stands in the folder's INDEX.md.
#include <algorithm>

#include "mesh_files.h"

namespace {

using lsp::Mesh;
using namespace lsp_test;

class Cases : public ::testing::Test {
 protected:
  static Mesh import(const std::string& name) {
    const std::filesystem::path path = std::filesystem::path(LSP_CASES_DIR) / name;
    return lsp::import_meshes({&path, 1}, {});
  }
  void SetUp() override {
    if (!std::filesystem::exists(LSP_CASES_DIR)) GTEST_SKIP() << "no cases at " << LSP_CASES_DIR;
  }
};

glm::vec3 extent(const Mesh& mesh) {
  glm::vec3 low = mesh.positions[0], high = low;
  for (const glm::vec3& p : mesh.positions) low = glm::min(low, p), high = glm::max(high, p);
  return high - low;
}

TEST_F(Cases, TheRiggedMeshStandsAsTallAsItIs) {
  const glm::vec3 size = extent(import("skinned_cm_rig.glb"));
  EXPECT_NEAR(size.y, 1.8f, 1e-4f);
  EXPECT_LT(size.x, 4.5f);
  EXPECT_LT(size.z, 4.5f);
}

TEST_F(Cases, AMorphedMeshHasItsDefaultWeights) {
  EXPECT_EQ(extent(import("morph_mesh_weights.glb")), glm::vec3(1, 3, 0));
}

TEST_F(Cases, ATailAfterTheChunksIsNoDamage) {
  const Mesh mesh = import("glb_tail_spaces.glb");
  EXPECT_EQ(mesh.triangles.size(), 12u);
  EXPECT_TRUE(has_note(mesh, "bytes after its end"));
}

TEST_F(Cases, ABackslashInAUriIsAPath) {
  EXPECT_TRUE(has_note(import("uri/backslash.gltf"), "is no valid one"));
}

TEST_F(Cases, AnStlHoldsWhatItHolds) {
  for (const char* name : {"stl_count0.stl", "stl_solid_count0.stl"}) {
    const Mesh mesh = import(name);
    EXPECT_EQ(mesh.triangles.size(), 12u) << name;
    EXPECT_TRUE(has_note(mesh, "declares 0 triangles and holds 12")) << name;
  }
}

// The colour of the first triangle of a material by that name.
lsp::TriangleColor color_of_material(const Mesh& mesh, const std::string& material) {
  for (size_t t = 0; t < mesh.triangles.size(); ++t) {
    if (mesh.materials[mesh.material_ids[t]].name == material) return mesh.color(t);
  }
  ADD_FAILURE() << "no triangle of " << material;
  return {};
}

TEST_F(Cases, ATexturedWallHasTheColourOfItsTexels) {
  const lsp::TriangleColor wall = color_of_material(import("basecolor_texture_red_wall.glb"), "painted");
  EXPECT_NEAR(wall.base_color.r, 0.515f, 0.003f);
  EXPECT_NEAR(wall.base_color.g, 0.003f, 0.002f);
  EXPECT_NEAR(wall.base_color.b, 0.003f, 0.002f);
}

TEST_F(Cases, ALanternGlowsByTheMeanOfItsTexels) {
  const Mesh mesh = import("emissive_texture_mostly_black.glb");
  double sum = 0, area_sum = 0;
  for (size_t t = 0; t < mesh.triangles.size(); ++t) {
    if (mesh.materials[mesh.material_ids[t]].name != "lantern") continue;
    const double area = 0.5 * double(glm::length(glm::cross(corner(mesh, t, 1) - corner(mesh, t, 0),
                                                            corner(mesh, t, 2) - corner(mesh, t, 0))));
    sum += area * double(mesh.color(t).emission.r);
    area_sum += area;
  }
  EXPECT_NEAR(sum / area_sum, 1.0 / 64, 1e-4);
}

TEST_F(Cases, MaskedAndBlendedTrianglesAreThereInPart) {
  const Mesh card = import("alpha_mask_card.glb"), glass = import("alpha_blend_glass.glb");
  double sum = 0, count = 0;
  for (size_t t = 0; t < card.triangles.size(); ++t) {
    if (card.materials[card.material_ids[t]].name != "leaf") continue;
    sum += double(card.color(t).coverage);
    ++count;
  }
  EXPECT_NEAR(sum / count, 0.25, 1e-3);
  EXPECT_NEAR(color_of_material(glass, "leaf").coverage, 0.1f, 1e-6f);
}

TEST_F(Cases, AGeoreferencedHouseKeepsAllItsTriangles) {
  for (const char* name : {"utm_house.obj", "utm_house_double.ply"}) {
    const Mesh mesh = import(name);
    EXPECT_EQ(mesh.triangles.size(), 252u) << name;
    EXPECT_EQ(mesh.rejected.total(), 0u) << name;
    EXPECT_GT(glm::length(mesh.origin), 1e5) << name;
    EXPECT_LT(glm::length(extent(mesh)), 1e3f) << name;
  }
}

}  // namespace
