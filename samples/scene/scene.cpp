#include "scene.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "lsp/program.h"
#include "ornaments.h"

namespace lsp::sample {

uint64_t triangle_count(const Scene& scene) {
  std::vector<uint64_t> of_mesh;
  for (const Mesh& mesh : scene.meshes) {
    uint64_t count = 0;
    for (const Part& part : mesh.parts) count += part.surface.triangle_count();
    of_mesh.push_back(count);
  }
  uint64_t total = 0;
  for (const Node& node : scene.nodes) {
    if (node.mesh >= 0) total += of_mesh[static_cast<size_t>(node.mesh)];
  }
  return total;
}

// Nine different closed bodies on a plane: the smallest scene with curved things and shadows.
Scene make_spheres(const Detail& detail) {
  Scene scene = make_plane(detail);
  const std::vector<std::pair<Surface, Material>> bodies = {
      {coral(detail), {"coral", {0.70f, 0.22f, 0.12f}}},
      {torus_knot(detail, 2, 3), {"gold", {0.95f, 0.68f, 0.28f}, 0.25f, 1.0f}},
      {gyroid_sphere(detail), {"marble", {0.82f, 0.80f, 0.76f}, 0.35f}},
      {blob_figure(detail), {"jade", {0.25f, 0.55f, 0.38f}, 0.3f}},
      {torus_knot(detail, 3, 5), {"indigo", {0.12f, 0.14f, 0.55f}, 0.6f}},
  };
  for (size_t i = 0; i < bodies.size(); ++i) {
    scene.materials.push_back(bodies[i].second);
    const int material = static_cast<int>(scene.materials.size()) - 1;
    scene.meshes.push_back({bodies[i].second.name, {{material, bodies[i].first}}});
  }
  for (int i = 0; i < 9; ++i) {
    Node node;
    node.mesh = 1 + i % static_cast<int>(bodies.size());
    node.name = scene.meshes[static_cast<size_t>(node.mesh)].name;
    node.translation = {2.6f * static_cast<float>(i % 3 - 1), 1.15f, 2.6f * static_cast<float>(i / 3 - 1)};
    node.rotation = glm::angleAxis(0.8f * static_cast<float>(i), glm::vec3(0, 1, 0));
    scene.nodes.push_back(node);
    scene.roots.push_back(static_cast<int>(scene.nodes.size()) - 1);
  }
  return scene;
}

// A gently rolling plane: the easy end of a benchmark.
Scene make_plane(const Detail& detail) {
  Scene scene;
  scene.materials.push_back({"ground", {0.6f, 0.58f, 0.55f}, 0.7f});
  const int steps = detail.steps(64, 2);
  scene.meshes.push_back({"ground", {{0, tessellate(steps, steps, [](float u, float v) {
                                        const glm::vec2 p = (glm::vec2(v, u) - 0.5f) * 16.0f;
                                        return glm::vec3(p.x, 0.08f * std::sin(p.x) * std::sin(1.3f * p.y),
                                                         p.y);
                                      })}}});
  Node node;
  node.name = "ground";
  node.mesh = 0;
  scene.nodes.push_back(node);
  scene.roots.push_back(0);
  return scene;
}

Scene make_scene(const std::string& name, const Detail& detail) {
  if (name == "atrium") return make_atrium(detail);
  if (name == "grove") return make_grove(detail);
  if (name == "spheres") return make_spheres(detail);
  if (name == "plane") return make_plane(detail);
  if (name == "objects") return make_objects(detail);
  if (name == "stadium") return make_stadium(detail);
  throw Failure(Exit::kUsage, "",
                "there is no scene '" + name + "'; choose atrium, grove, spheres, plane, objects or stadium");
}

bool take_masks_off(Scene& scene) {
  bool any = false;
  for (Material& material : scene.materials) any |= std::exchange(material.masked, false);
  return any;
}

Detail detail_for(const std::string& name, uint64_t triangles) {
  // Steps are whole numbers, so the count is a staircase in the scale: bisection in the scale's logarithm
  // finds the step nearest to the wish. Most probes are cheap, since the scale soon comes close.
  const auto count = [&](float scale) {
    return static_cast<double>(triangle_count(make_scene(name, {scale})));
  };
  const double wish = static_cast<double>(triangles);
  float scale = static_cast<float>(std::sqrt(wish / count(1.0f)));
  float best = scale;
  double best_error = 1e30;
  float lo = 0.02f;
  float hi = 60.0f;
  for (int i = 0; i < 12; ++i) {
    const double have = count(scale);
    const double error = std::abs(std::log(have / wish));
    if (error < best_error) {
      best_error = error;
      best = scale;
    }
    if (error < 0.02) break;
    (have < wish ? lo : hi) = scale;
    const float guess = scale * static_cast<float>(std::sqrt(wish / have));
    scale = guess > lo && guess < hi ? guess : std::sqrt(lo * hi);
  }
  if (best_error > 0.25) {
    throw Failure(Exit::kUsage, "",
                  "the scene '" + name + "' cannot be made of about " + std::to_string(triangles) +
                      " triangles; the nearest is " + std::to_string(static_cast<uint64_t>(count(best))));
  }
  return {best};
}

}  // namespace lsp::sample
