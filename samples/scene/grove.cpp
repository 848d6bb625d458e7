// A grove: trees whose crowns are cards with a picture of leaves on them, most of it cut out by its mask.
#include <cmath>
#include <glm/gtc/matrix_transform.hpp>

#include "ornaments.h"
#include "scene.h"

namespace lsp::sample {
namespace {

constexpr float kPi = 3.14159265358979324f;
constexpr float kTau = 2.0f * kPi;
constexpr int kLeafTexels = 64;

// A spray of leaflets to either side of a stalk that rises from the lower edge.
Texture leaf_texture() {
  Texture texture{kLeafTexels, kLeafTexels, {}};
  for (int y = 0; y < kLeafTexels; ++y) {
    for (int x = 0; x < kLeafTexels; ++x) {
      // The stalk is u = 0; v goes up it.
      const glm::vec2 p((static_cast<float>(x) + 0.5f) / kLeafTexels - 0.5f,
                        1.0f - (static_cast<float>(y) + 0.5f) / kLeafTexels);
      bool leaf = std::abs(p.x) < 0.012f && p.y < 0.9f;
      float vein = 1.0f;
      for (int k = 0; k < 9; ++k) {
        const float side = k == 8 ? 0.0f : k % 2 == 0 ? 1.0f : -1.0f;
        const float turn = side * 0.95f;
        const glm::vec2 root(0.0f, 0.10f + 0.085f * static_cast<float>(k));
        const glm::vec2 along(std::sin(turn), std::cos(turn));
        const float length = k == 8 ? 0.19f : 0.42f - 0.024f * static_cast<float>(k);
        const float t = glm::dot(p - root, along) / length;
        const float across = glm::dot(p - root, glm::vec2(along.y, -along.x)) / length;
        if (t <= 0.0f || t >= 1.0f) continue;
        const float width = 0.20f * std::sin(kPi * std::pow(t, 0.8f));
        if (std::abs(across) >= width) continue;
        leaf = true;
        vein = std::min(1.0f, 0.6f + 8.0f * std::abs(across) * (1.0f - t));
      }
      const auto shade = [&](float value) { return static_cast<uint8_t>(255.0f * value * vein + 0.5f); };
      texture.rgba.insert(texture.rgba.end(), {shade(0.45f + 0.2f * p.y), shade(0.70f), shade(0.22f),
                                               static_cast<uint8_t>(leaf ? 255 : 0)});
    }
  }
  return texture;
}

// A square card that stands on the origin with its picture upright.
Surface leaf_card(float size) {
  Surface card;
  for (const glm::vec2 corner : {glm::vec2(0, 0), glm::vec2(1, 0), glm::vec2(1, 1), glm::vec2(0, 1)}) {
    card.positions.push_back(size * glm::vec3(corner.x - 0.5f, corner.y, 0.0f));
    card.normals.push_back({0, 0, 1});
    card.uvs.push_back({corner.x, 1.0f - corner.y});
  }
  card.indices = {0, 1, 2, 0, 2, 3};
  return card;
}

// Cards in an ellipsoid about (0, 3.1, 0), turned to the outside and drooping.
Surface crown(const Detail& detail, int seed) {
  Surface leaves;
  const int count = detail.steps(22, 6) * detail.steps(22, 6);
  for (int k = 0; k < count; ++k) {
    const float up = 2.0f * (static_cast<float>(k) + 0.5f) / static_cast<float>(count) - 1.0f;
    const float around = 2.39996323f * static_cast<float>(k) + kTau * random01(seed, 3 * k);
    const float out = std::sqrt(1.0f - up * up), shell = 0.45f + 0.55f * random01(seed, 3 * k + 1);
    const glm::vec3 at =
        shell * glm::vec3(1.35f * out * std::cos(around), 1.05f * up, 1.35f * out * std::sin(around));
    glm::mat4 place = glm::translate(glm::mat4(1.0f), at + glm::vec3(0, 3.1f, 0));
    place = glm::rotate(place, kPi / 2 - around + 1.2f * (random01(seed, 3 * k + 2) - 0.5f), {0, 1, 0});
    place = glm::rotate(place, 0.5f + 1.2f * (1.0f - up) * random01(seed + 1, k), {1, 0, 0});
    append(leaves, leaf_card(0.55f), place);
  }
  return leaves;
}

Surface trunk(const Detail& detail, int seed) {
  const float lean = 0.25f * random01(seed, 0), turn = kTau * random01(seed, 1);
  return tube(
      [=](float t) {
        return glm::vec3(lean * t * t * std::cos(turn), 3.2f * t - 0.05f, lean * t * t * std::sin(turn));
      },
      [](float t) { return 0.13f - 0.09f * t; }, detail.steps(10, 3), detail.steps(10, 4), false);
}

}  // namespace

Scene make_grove(const Detail& detail) {
  Scene scene = make_plane(detail);
  scene.materials[0].base_color = {0.42f, 0.36f, 0.28f};
  scene.materials.push_back({"bark", {0.22f, 0.15f, 0.10f}});
  Material leaves{"leaves", glm::vec3(1.0f), 0.8f};
  leaves.texture = leaf_texture();
  leaves.masked = true;
  scene.materials.push_back(leaves);
  constexpr int kKinds = 3;
  for (int seed = 0; seed < kKinds; ++seed)
    scene.meshes.push_back({"tree", {{1, trunk(detail, seed)}, {2, crown(detail, 10 * seed)}}});
  int tree = 0;
  for (const glm::vec2 at :
       {glm::vec2(-3.6f, -2.2f), glm::vec2(-1.2f, -0.6f), glm::vec2(1.3f, -2.4f), glm::vec2(3.7f, -0.9f),
        glm::vec2(-2.9f, 2.0f), glm::vec2(0.5f, 1.7f), glm::vec2(3.1f, 2.5f)}) {
    Node node;
    node.name = "tree";
    node.mesh = 1 + tree % kKinds;
    node.translation = {at.x, 0.0f, at.y};
    node.rotation = glm::angleAxis(1.1f * static_cast<float>(tree), glm::vec3(0, 1, 0));
    node.scale = glm::vec3(0.85f + 0.06f * static_cast<float>(tree % 5));
    scene.nodes.push_back(node);
    scene.roots.push_back(static_cast<int>(scene.nodes.size()) - 1);
    ++tree;
  }
  return scene;
}

}  // namespace lsp::sample
