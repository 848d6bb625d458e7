// Wide nodes are a fair baseline only while they are exact: against the binary tree to the bit, against
// Embree by the judge.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <filesystem>

#include "lsp/in_chunks.hpp"
#include "lsp/program.h"
#include "rays.h"
#include "shapes.h"
#include "shared_bake.h"
#include "verdict.h"
#include "wide_peer.h"

namespace lsp::bench {
namespace {

namespace fs = std::filesystem;

fs::path bake(const std::string& name, const Triangles& triangles) {
  const fs::path directory = LSP_BAKES_DIR;
  fs::create_directories(directory);
  const fs::path input = directory / ("wide-" + name + ".ply");
  if (!fs::exists(input)) write_ply(input, triangles);
  return shared_bake(input, {"--no-line-spaces"}, directory);
}

void expect_same_as_library(const OpenFile& file, const std::vector<LspRay>& rays) {
  const WideTree tree(file);
  std::vector<LspHit> ours(rays.size()), theirs(rays.size());
  cpu_tracer(file, 1)->trace({}, rays, theirs);
  wide_tracer(tree, machine_threads())->trace({}, rays, ours);
  for (size_t i = 0; i < rays.size(); ++i)
    ASSERT_EQ(std::memcmp(&ours[i], &theirs[i], sizeof(LspHit)), 0)
        << "ray " << i << ": " << ours[i].t << " and triangle " << ours[i].primitive << ", not "
        << theirs[i].t << " and " << theirs[i].primitive;
  wide_tracer(tree, 1)->trace({.any = true}, rays, ours);
  for (size_t i = 0; i < rays.size(); ++i)
    ASSERT_EQ(std::isinf(ours[i].t), std::isinf(theirs[i].t)) << "any hit, ray " << i;
}

TEST(WideTree, AgreesWithTheLibraryAndWithEmbree) {
  const OpenFile file(bake("room", room_of_spheres(20000)));
  const Soup soup = soup_of(file.scene());
  const std::vector<LspRay> rays = surface_rays(soup, 60000, 3);
  expect_same_as_library(file, rays);
  const EmbreeScene embree(soup);
  std::vector<LspHit> truth(rays.size()), hits(rays.size());
  embree.closest(rays, truth);
  const WideTree tree(file);
  wide_tracer(tree, 1)->trace({}, rays, hits);
  const Agreement agreement = compare_exact(soup, rays, hits, truth);
  EXPECT_EQ(agreement.ours_wrong + agreement.both_wrong, 0u);
}

TEST(WideTree, AgreesOnTheSmallestAndTheThinnest) {
  Triangles one{{glm::vec3(0), glm::vec3(1, 0, 0), glm::vec3(0, 1, 0)}};
  Triangles same(2000, {glm::vec3(0), glm::vec3(1, 0.2f, 0), glm::vec3(0.1f, 1, 0.3f)});
  Triangles flat;
  add_grid(flat, 60, glm::vec3(0), glm::vec3(1, 0, 0), glm::vec3(0, 0, 1));
  const std::pair<const char*, const Triangles*> cases[] = {{"one", &one}, {"same", &same}, {"flat", &flat}};
  for (const auto& [name, triangles] : cases) {
    SCOPED_TRACE(name);
    const OpenFile file(bake(name, *triangles));
    const Soup soup = soup_of(file.scene());
    std::vector<LspRay> rays = surface_rays(soup, 5000, 5);
    for (size_t i = 0; i < rays.size();
         ++i) {  // two thirds toward the surface, some along an axis of the boxes
      if (i % 3 == 0) continue;
      rays[i].direction = {-rays[i].direction.x, -rays[i].direction.y, -rays[i].direction.z};
      if (i % 3 == 1) rays[i].direction.x = 0;
    }
    rays[0].direction = {0, 0, 0};
    rays[1].origin.x = NAN;
    rays[2].tmin = 2, rays[2].tmax = 1;
    expect_same_as_library(file, rays);
  }
}

TEST(WideTree, RefusesWhatHasNoBinaryTree) {
  const fs::path directory = LSP_BAKES_DIR;
  const fs::path input = directory / "wide-ntree.ply";
  fs::create_directories(directory);
  if (!fs::exists(input)) write_ply(input, room_of_spheres(2000));
  const OpenFile file(shared_bake(input, {"--base", "ntree", "--resolution", "4"}, directory));
  EXPECT_THROW(WideTree{file}, Failure);
}

}  // namespace
}  // namespace lsp::bench
