// Every file of the scenes folder against counts found by an independent checker.
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <iostream>
#include <map>
#include <nlohmann/json.hpp>
#include <set>

#include "import/import.h"
#include "lsp/program.h"

namespace {

using lsp::Exit;
const std::filesystem::path kScenes = LSP_SCENES_DIR;

struct Expected {
  uint64_t triangles = 0;
  uint64_t degenerate = 0;
  uint64_t out_of_range = 0;
  const char* why = "";
};

#include "counts_exceptions.inc"

// What an import must always keep, whatever it read.
void expect_sound(const lsp::Mesh& mesh) {
  const size_t count = mesh.triangles.size();
  EXPECT_EQ(count + mesh.rejected.total(), mesh.primitive_count);
  ASSERT_EQ(mesh.primitives.size(), count);
  ASSERT_EQ(mesh.normals.size(), count);
  ASSERT_EQ(mesh.material_ids.size(), count);
  ASSERT_FALSE(mesh.materials.empty());
  size_t bad_index = 0, bad_normal = 0, bad_order = 0, bad_material = 0;
  for (size_t t = 0; t < count; ++t) {
    for (int i = 0; i < 3; ++i) {
      bad_index += mesh.triangles[t][i] >= mesh.positions.size();
      bad_normal += !(std::abs(glm::length(mesh.normals[t][i]) - 1.0f) < 1e-5f);
    }
    bad_order +=
        mesh.primitives[t] >= mesh.primitive_count || (t > 0 && mesh.primitives[t] <= mesh.primitives[t - 1]);
    bad_material += mesh.material_ids[t] >= mesh.materials.size();
  }
  EXPECT_EQ(bad_index, 0u);
  EXPECT_EQ(bad_normal, 0u);
  EXPECT_EQ(bad_order, 0u);
  EXPECT_EQ(bad_material, 0u);
}

void expect_bounds(const lsp::Mesh& mesh, const nlohmann::json& counts, bool exact) {
  if (!counts.contains("min") || mesh.positions.empty()) return;
  glm::dvec3 low(mesh.positions[0]), high = low;
  for (const glm::vec3& p : mesh.positions) {
    low = glm::min(low, glm::dvec3(p));
    high = glm::max(high, glm::dvec3(p));
  }
  low += mesh.origin;
  high += mesh.origin;
  double size = 0;
  for (int k = 0; k < 3; ++k)
    size = std::max(size, counts["max"][k].get<double>() - counts["min"][k].get<double>());
  for (int k = 0; k < 3; ++k) {
    const double want_low = counts["min"][k], want_high = counts["max"][k];
    const double slack = 1e-5 * size;
    if (exact) {
      EXPECT_NEAR(low[k], want_low, slack) << "axis " << k;
      EXPECT_NEAR(high[k], want_high, slack) << "axis " << k;
    } else {  // the checker's bounds hold corners that no kept triangle uses
      EXPECT_GE(low[k], want_low - slack) << "axis " << k;
      EXPECT_LE(high[k], want_high + slack) << "axis " << k;
    }
  }
}

TEST(Scenes, EveryFileAgreesWithItsCounts) {
  std::ifstream stream(kScenes / "counts.json");
  if (!stream) GTEST_SKIP() << "no scenes at " << kScenes;
  const nlohmann::json all = nlohmann::json::parse(stream);
  size_t files = 0, refused = 0, by_exception = 0;
  for (const auto& [name, counts] : all.items()) {
    SCOPED_TRACE(name);
    ++files;
    const auto exception = kExceptions.find(name);
    by_exception += exception != kExceptions.end();
    Expected expected;
    if (exception != kExceptions.end()) {
      expected = exception->second;
    } else if (!counts.contains("err")) {
      expected = {counts["tris"], counts.value("deg", uint64_t{0}), counts["oob"], ""};
    }
    const std::filesystem::path path = kScenes / name;
    lsp::Mesh mesh;
    try {
      mesh = lsp::import_meshes({&path, 1}, {});
    } catch (const lsp::Failure& failure) {
      // Refused: no triangle in it, or none that can be used, and then the message says how many.
      const std::string none = "none of its " + std::to_string(expected.triangles) + " triangles can be used";
      EXPECT_TRUE(expected.triangles == 0 || std::string(failure.what()).starts_with(none)) << failure.what();
      EXPECT_TRUE(failure.exit() == Exit::kInvalid || failure.exit() == Exit::kUnsupported ||
                  failure.exit() == Exit::kFile)
          << int(failure.exit()) << failure.what();
      EXPECT_FALSE(std::string(failure.what()).empty());
      ++refused;
      continue;
    }
    expect_sound(mesh);
    EXPECT_EQ(mesh.primitive_count, expected.triangles);
    EXPECT_EQ(mesh.rejected.degenerate, expected.degenerate);
    EXPECT_EQ(mesh.rejected.out_of_range, expected.out_of_range);
    if (counts.contains("err") || kPosed.contains(name)) continue;
    const bool exact = mesh.rejected.total() == 0 && counts["unused"] == 0;
    expect_bounds(mesh, counts, exact);
    if (exact && counts.contains("uniq")) {
      EXPECT_EQ(mesh.positions.size(), counts["uniq"].get<size_t>());
    }
  }
  std::cout << files << " files, " << refused << " refused with a reason, " << by_exception
            << " by the table of exceptions\n";
}

TEST(Scenes, ThePapersScenes) {
  const std::map<std::string, uint64_t> kTriangles = {{"bunny.ply", 69451},
                                                      {"dragon.ply", 871414},
                                                      {"sibenik.obj", 73564},
                                                      {"sponza.gltf", 262267},
                                                      {"sponza_draco_webp.glb", 262267},
                                                      {"conference.obj", 330584}};
  for (const auto& [name, count] : kTriangles) {
    SCOPED_TRACE(name);
    const std::filesystem::path path = kScenes / "paper" / name;
    if (!std::filesystem::exists(path)) GTEST_SKIP() << "no scene at " << path;
    const lsp::Mesh mesh = lsp::import_meshes({&path, 1}, {});
    EXPECT_EQ(mesh.primitive_count, count);
    expect_sound(mesh);
  }
}

}  // namespace
