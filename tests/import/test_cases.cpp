// Small files as people have them; what is right of each stands in the folder's INDEX.md.
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <fstream>

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

TEST_F(Cases, TheLibraryOfMaterialsIsASource) {
  const Mesh mesh = import("stale_mtl/room.obj");
  ASSERT_EQ(mesh.sources.size(), 1u);
  ASSERT_EQ(mesh.sources[0].size(), 2u);
  EXPECT_EQ(mesh.sources[0][1].filename(), "room.mtl");
  // Its bytes are in the hash: a copy of the scene with other paint has another.
  const std::filesystem::path folder =
      std::filesystem::temp_directory_path() / ("lsp_stale_" + std::to_string(getpid()));
  std::filesystem::copy(std::filesystem::path(LSP_CASES_DIR) / "stale_mtl", folder);
  const std::filesystem::path copy = folder / "room.obj";
  EXPECT_EQ(lsp::hash_sources(lsp::import_meshes({&copy, 1}, {})), lsp::hash_sources(mesh));
  std::ofstream(folder / "room.mtl", std::ios::app) << "Ke 1 1 1\n";
  EXPECT_NE(lsp::hash_sources(lsp::import_meshes({&copy, 1}, {})), lsp::hash_sources(mesh));
  std::filesystem::remove_all(folder);
}

// A face of 15,000 corners, a star of as many points, has the area of its outline.
TEST_F(Cases, AFaceOfVeryManyCornersKeepsItsArea) {
  constexpr int kCorners = 15000;
  std::string obj, face = "f";
  double shoelace = 0, before_x = 0, before_y = 0, first_x = 0, first_y = 0;
  for (int i = 0; i < kCorners; ++i) {
    const double angle = 6.283185307179586 * i / kCorners, r = i % 2 ? 1.0 : 1.7;
    const double x = r * std::cos(angle), y = r * std::sin(angle);
    char line[64];
    std::snprintf(line, sizeof line, "v %.9f %.9f 0\n", x, y);
    obj += line;
    std::snprintf(line, sizeof line, " %d", i + 1);
    face += line;
    if (i == 0) first_x = x, first_y = y;
    if (i > 0) shoelace += before_x * y - before_y * x;
    before_x = x, before_y = y;
  }
  shoelace = 0.5 * (shoelace + before_x * first_y - before_y * first_x);
  const std::filesystem::path path =
      std::filesystem::temp_directory_path() / ("lsp_star_" + std::to_string(getpid()) + ".obj");
  std::ofstream(path) << obj << face << "\n";
  const Mesh mesh = lsp::import_meshes({&path, 1}, {});
  std::filesystem::remove(path);
  EXPECT_EQ(mesh.primitive_count, uint64_t{kCorners - 2});
  EXPECT_NEAR(area(mesh), shoelace, 1e-4 * shoelace);
  for (const std::string& note : mesh.notes) EXPECT_NE(note.find("normals stay flat"), note.npos) << note;
}

}  // namespace
