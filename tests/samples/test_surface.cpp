// The formulas' surfaces: closed where they say so, normals and winding that agree, no triangle without area.
#include "surface.h"

#include <gtest/gtest.h>

#include <map>

#include "architecture.h"
#include "ornaments.h"

namespace lsp::sample {
namespace {

struct Named {
  const char* name;
  Surface surface;
};

std::vector<Named> closed_surfaces(const Detail& detail) {
  return {{"torus knot", torus_knot(detail, 2, 3)},
          {"gyroid sphere", gyroid_sphere(detail)},
          {"coral", coral(detail)},
          {"twisted vase", twisted_vase(detail)},
          {"blob figure", blob_figure(detail)},
          {"box", box({-1, -2, -3}, {1, 2, 3})}};
}

// Edges by position, so that creases (vertices with several normals) still count as joined.
uint64_t unmatched_edges(const Surface& s) {
  struct Less {
    bool operator()(const glm::vec3& a, const glm::vec3& b) const {
      return std::tie(a.x, a.y, a.z) < std::tie(b.x, b.y, b.z);
    }
  };
  std::map<glm::vec3, uint32_t, Less> ids;
  const auto id = [&](uint32_t i) {
    return ids.try_emplace(s.positions[i], static_cast<uint32_t>(ids.size())).first->second;
  };
  std::map<std::pair<uint32_t, uint32_t>, int> edges;
  for (size_t t = 0; t < s.indices.size(); t += 3) {
    for (size_t k = 0; k < 3; ++k) ++edges[{id(s.indices[t + k]), id(s.indices[t + (k + 1) % 3])}];
  }
  uint64_t unmatched = 0;
  for (const auto& [edge, count] : edges) {
    const auto back = edges.find({edge.second, edge.first});
    if (back == edges.end() || back->second != count) ++unmatched;
  }
  return unmatched;
}

TEST(Surface, SculpturesAreClosed) {
  for (const float scale : {0.1f, 0.5f, 1.0f}) {
    for (const Named& body : closed_surfaces({scale})) {
      EXPECT_EQ(unmatched_edges(body.surface), 0u) << body.name << " at scale " << scale;
    }
  }
}

TEST(Surface, OpenSheetsAreNotClosed) { EXPECT_GT(unmatched_edges(banner({}, 1, 2, 0)), 0u); }

TEST(Surface, ClosedBodiesHavePositiveVolume) {
  for (const Named& body : closed_surfaces({})) {
    double volume = 0;
    const Surface& s = body.surface;
    for (size_t t = 0; t < s.indices.size(); t += 3) {
      const glm::dvec3 a = s.positions[s.indices[t]];
      const glm::dvec3 b = s.positions[s.indices[t + 1]];
      const glm::dvec3 c = s.positions[s.indices[t + 2]];
      volume += glm::dot(a, glm::cross(b, c)) / 6.0;
    }
    EXPECT_GT(volume, 0.05) << body.name << " is inside out";
  }
}

TEST(Surface, NormalsAreUnitAndAgreeWithTheWinding) {
  const Detail detail;
  std::vector<Named> surfaces = closed_surfaces(detail);
  surfaces.push_back({"fluted shaft", fluted_shaft(detail, 0.3f, 0, 3)});
  surfaces.push_back({"attic base", attic_base(detail, 0.3f, 0.4f)});
  surfaces.push_back({"capital", capital(detail, 0.3f, 0.6f)});
  surfaces.push_back({"archivolt", archivolt(detail, 1.2f, 0.5f)});
  surfaces.push_back({"arched wall", arched_wall(3, 2, 0.5f, 1.2f, 20)});
  surfaces.push_back({"groin vault", groin_vault(detail, 3)});
  surfaces.push_back({"coffers", coffers(3, 3)});
  surfaces.push_back({"baluster", baluster(detail, 0.8f)});
  surfaces.push_back({"relief tile", relief_tile(detail, 0.75f)});
  surfaces.push_back({"half dome", half_dome(detail, 2)});
  surfaces.push_back({"curtain", tied_curtain(detail, 1.2f, 3, 1)});
  surfaces.push_back({"awning", awning(detail, 2, 8, 1, 1)});
  surfaces.push_back({"fountain", fountain_stone(detail)});
  surfaces.push_back({"water", fountain_water(detail)});
  surfaces.push_back({"pot", pot(detail)});
  surfaces.push_back({"palm", palm_leaves(detail, 1)});
  surfaces.push_back({"lantern", lantern_frame(detail, 1)});
  for (const auto& [name, s] : surfaces) {
    ASSERT_EQ(s.positions.size(), s.normals.size()) << name;
    for (const glm::vec3& n : s.normals) ASSERT_NEAR(glm::length(n), 1.0f, 1e-4f) << name;
    uint64_t against = 0;
    for (size_t t = 0; t < s.indices.size(); t += 3) {
      const glm::vec3 a = s.positions[s.indices[t]];
      const glm::vec3 cross =
          glm::cross(s.positions[s.indices[t + 1]] - a, s.positions[s.indices[t + 2]] - a);
      ASSERT_GT(glm::length(cross), 0.0f) << name << ", triangle " << t / 3;
      const glm::vec3 mean =
          s.normals[s.indices[t]] + s.normals[s.indices[t + 1]] + s.normals[s.indices[t + 2]];
      if (glm::dot(cross, mean) < 0) ++against;
    }
    // Sharp folds and coarse grids leave a few triangles whose smooth normals lean over.
    EXPECT_LE(against, s.triangle_count() / 100) << name;
  }
}

TEST(Surface, GroinVaultAndCoffersFaceDown) {
  for (const Surface& s : {groin_vault({}, 3), coffers(3, 2)}) {
    double up = 0;
    for (const glm::vec3& n : s.normals) up += static_cast<double>(n.y);
    EXPECT_LT(up, 0);
  }
}

TEST(Surface, LatheFacesAway) {
  const Surface s = lathe({{{1.0f, 0.0f}, {1.0f, 2.0f}}}, 8);
  EXPECT_EQ(s.triangle_count(), 16u);
  for (size_t i = 0; i < s.positions.size(); ++i) {
    EXPECT_NEAR(glm::dot(s.normals[i], glm::vec3(s.positions[i].x, 0, s.positions[i].z)), 1.0f, 1e-5f);
  }
}

}  // namespace
}  // namespace lsp::sample
