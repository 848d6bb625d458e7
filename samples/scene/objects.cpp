// What instances are for: many things of few kinds in a room, and a small dense thing in a large place.
#include <cmath>

#include "ornaments.h"
#include "scene.h"

namespace lsp::sample {
namespace {

constexpr float kTau = 6.28318530717958648f;

int add_mesh(Scene& scene, const Material& material, Surface surface) {
  scene.materials.push_back(material);
  scene.meshes.push_back(
      {material.name, {{static_cast<int>(scene.materials.size()) - 1, std::move(surface)}}});
  return static_cast<int>(scene.meshes.size()) - 1;
}

Node& place(Scene& scene, int mesh) {
  Node node;
  node.mesh = mesh;
  node.name = scene.meshes[static_cast<size_t>(mesh)].name;
  scene.roots.push_back(static_cast<int>(scene.nodes.size()));
  return scene.nodes.emplace_back(node);
}

// The inside of a box.
Surface room(glm::vec3 lo, glm::vec3 hi) {
  Surface walls = box(lo, hi);
  for (size_t i = 0; i < walls.indices.size(); i += 3) std::swap(walls.indices[i + 1], walls.indices[i + 2]);
  for (glm::vec3& normal : walls.normals) normal = -normal;
  return walls;
}

// Body, lid, spout and handle, standing on y = 0, 0.3 high.
Surface teapot(const Detail& detail) {
  const int sides = detail.steps(72, 6), steps = detail.steps(24, 3);
  Profile belly, lid;
  for (int i = 0; i <= steps; ++i) {
    const float v = static_cast<float>(i) / static_cast<float>(steps);
    belly.emplace_back(0.1f + 0.09f * std::sin(0.5f * kTau * (0.15f + 0.75f * v)), 0.2f * v);
    lid.emplace_back(0.128f * std::cos(0.25f * kTau * v), 0.2f + 0.06f * std::sin(0.25f * kTau * v));
  }
  lid.back().x = 0.0f;
  Surface pot = lathe({{{0.0f, 0.0f}, {belly.front().x, 0.0f}}, belly, lid}, sides);
  append(pot, lathe({{{0.0f, 0.255f}, {0.02f, 0.27f}, {0.018f, 0.29f}, {0.0f, 0.3f}}}, detail.steps(32, 4)));
  const auto spout = [](float t) { return glm::vec3(0.16f + 0.16f * t, 0.06f + 0.15f * t * t, 0.0f); };
  append(pot, tube(
                  spout, [](float t) { return 0.04f - 0.022f * t; }, detail.steps(32, 3), detail.steps(24, 4),
                  false));
  const auto handle = [](float t) {
    const float angle = kTau * (0.2f + 0.6f * t);
    return glm::vec3(-0.17f + 0.09f * std::cos(angle), 0.11f + 0.075f * std::sin(angle), 0.0f);
  };
  append(pot, tube(
                  handle, [](float) { return 0.013f; }, detail.steps(48, 4), detail.steps(16, 3), false));
  return pot;
}

// Steps that rise about an oval field, 60 m long.
Surface terraces(const Detail& detail) {
  constexpr int kRows = 24;
  Profile steps = {{0.0f, 0.0f}, {20.0f, 0.0f}};
  for (int i = 0; i < kRows; ++i) {
    const float r = 20.0f + 0.8f * static_cast<float>(i), y = 0.45f * static_cast<float>(i + 1);
    steps.emplace_back(r, y);
    steps.emplace_back(r + 0.8f, y);
  }
  Surface bowl;
  append(bowl, lathe(creased(steps), detail.steps(96, 12)),
         glm::mat4(glm::vec4(1.5f, 0, 0, 0), glm::vec4(0, 1, 0, 0), glm::vec4(0, 0, 1, 0),
                   glm::vec4(0, 0, 0, 1)));
  return bowl;
}

}  // namespace

// Eight by eight by eight things of five kinds in a room, turned, scaled by axis, a fifth of them mirrored.
Scene make_objects(const Detail& detail) {
  Scene scene;
  place(scene, add_mesh(scene, {"walls", {0.7f, 0.68f, 0.64f}}, room({-10, -10, -10}, {10, 10, 10})));
  const Detail small{detail.scale * 0.6f};
  const int kinds[] = {
      add_mesh(scene, {"coral", {0.70f, 0.22f, 0.12f}}, coral(small)),
      add_mesh(scene, {"gold", {0.95f, 0.68f, 0.28f}, 0.25f, 1.0f}, torus_knot(small, 2, 3)),
      add_mesh(scene, {"marble", {0.82f, 0.80f, 0.76f}, 0.35f}, gyroid_sphere(small)),
      add_mesh(scene, {"jade", {0.25f, 0.55f, 0.38f}, 0.3f}, blob_figure(small)),
      add_mesh(scene, {"indigo", {0.12f, 0.14f, 0.55f}, 0.6f}, torus_knot(small, 3, 5)),
  };
  for (int i = 0; i < 512; ++i) {
    const auto random = [i](int what) { return random01(100 + what, i); };
    Node& node = place(scene, kinds[i % 5]);
    node.translation = 2.4f * (glm::vec3(i % 8, i / 8 % 8, i / 64) - 3.5f);
    node.rotation =
        glm::angleAxis(kTau * random(0), glm::normalize(glm::vec3(random(1), random(2), random(3)) - 0.49f));
    node.scale = 0.6f + 0.4f * glm::vec3(random(4), random(5), random(6));
    if (random(7) < 0.2f) node.scale.x = -node.scale.x;
  }
  return scene;
}

// A teapot of 0.3 m on the field of a stadium: its triangles are in a millionth of the scene.
Scene make_stadium(const Detail& detail) {
  Scene scene;
  place(scene, add_mesh(scene, {"concrete", {0.55f, 0.54f, 0.52f}}, terraces(detail)));
  place(scene, add_mesh(scene, {"porcelain", {0.85f, 0.84f, 0.80f}, 0.2f}, teapot(detail)));
  return scene;
}

}  // namespace lsp::sample
