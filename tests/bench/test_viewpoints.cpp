// Cameras that are chosen by what they see.
#include <gtest/gtest.h>

#include <cmath>

#include "embree_scene.h"
#include "shapes.h"
#include "viewpoints.h"

namespace lsp::bench {
namespace {

// A plain floor with a heap of small spheres in one corner.
const glm::vec3 kHeap(8, 0.4f, 8);
Soup floor_with_a_heap() {
  Triangles triangles;
  add_grid(triangles, 4, {0, 0, 0}, {0, 0, 20}, {20, 0, 0});
  for (int i = 0; i < 5; ++i) {
    for (int j = 0; j < 5; ++j) {
      add_sphere(triangles, 8,
                 kHeap + glm::vec3(0.8f * static_cast<float>(i), 0, 0.8f * static_cast<float>(j)), 0.35f);
    }
  }
  return soup_of(triangles);
}

TEST(Viewpoints, TheCloseCameraLooksAtDetail) {
  const Soup soup = floor_with_a_heap();
  const EmbreeScene embree(soup);
  const TraceFunction trace = [&](auto rays, auto hits) { embree.closest(rays, hits); };
  const Camera wide = choose_camera(soup, trace, 320, 180);
  const Camera close = choose_close_camera(soup, trace, wide);
  EXPECT_GT(detail_of(soup, trace, close), 1.5 * detail_of(soup, trace, wide));
  EXPECT_LT(glm::length(close.target - (glm::dvec3(kHeap) + glm::dvec3(1.6, 0, 1.6))), 4);
  EXPECT_LT(glm::length(close.eye - close.target), 0.13 * soup.diagonal);
  EXPECT_GT(close.eye.y, 0) << "not from below the floor";
  EXPECT_EQ(close.width, 320u);
  EXPECT_EQ(close.height, 180u);
  // The same once more.
  EXPECT_EQ(choose_close_camera(soup, trace, wide).eye, close.eye);
}

TEST(Viewpoints, WhereNothingCanBeSeenTheOtherCameraStays) {
  Triangles one;
  one.push_back({glm::vec3(0), glm::vec3(1, 0, 0), glm::vec3(0, 1, 0)});
  const Soup soup = soup_of(one);
  const EmbreeScene embree(soup);
  const TraceFunction trace = [&](auto rays, auto hits) { embree.closest(rays, hits); };
  Camera wide;
  wide.eye = {0, 0, 5};
  const TraceFunction blind = [](auto rays, auto hits) {
    for (size_t i = 0; i < rays.size(); ++i) hits[i] = {INFINITY, LSP_NONE, 0, 0, {0, 0, 0}, 0};
  };
  const Camera close = choose_close_camera(soup, blind, wide);
  EXPECT_EQ(close.eye, wide.eye);
  EXPECT_EQ(detail_of(soup, trace, {{0, 0, 5}, {20, 20, 5}, 60, 8, 8}), 0);
}

}  // namespace
}  // namespace lsp::bench
