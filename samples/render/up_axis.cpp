#include "up_axis.h"

#include <algorithm>
#include <cmath>

namespace lsp::sample {
namespace {

const UpAxis kYUp{{0, 1, 0}, nullptr};

bool all_end_in(const RenderScene& scene, const std::set<std::string>& endings) {
  const std::set<std::string>& of_scene = scene.source_endings();
  return !of_scene.empty() && std::ranges::includes(endings, of_scene);
}

// Of a scene's triangles, or of a part of them.
struct Faces {
  glm::dvec3 area{0.0};     // by what faces x, y and z, either way
  glm::dvec3 resting{0.0};  // of it what faces straight down along an axis, at its lowest end
};

Faces measure(const RenderScene& scene) {
  constexpr float kStraight = 0.95f;  // cosine
  constexpr float kLowest = 0.02f;    // of the extent
  const glm::vec3 size = scene.hi() - scene.lo();
  Faces faces;
  for (const RenderScene::Corners& c : scene.some_triangles(1u << 20)) {
    const glm::vec3 twice = glm::cross(c.e1, c.e2);
    const float length = glm::length(twice);
    const glm::vec3 height = c.v0 + (c.e1 + c.e2) / 3.0f - scene.lo();
    faces.area += 0.5 * glm::dvec3(glm::abs(twice));
    for (int axis = 0; axis < 3; ++axis) {
      // Floors and walls of a room face inwards: nothing rests on them.
      if (twice[axis] < -kStraight * length && height[axis] < kLowest * size[axis])
        faces.resting[axis] -= 0.5 * static_cast<double>(twice[axis]);
    }
  }
  return faces;
}

// Thin along `axis`, and more of it faces that way than the others. What has no height at all may as well
// stand, as a picture does; and who stands is thin from front to back, too, but does not face that way alone.
bool lies_flat(const Faces& faces, glm::vec3 size, int axis) {
  const int other = axis == 1 ? 2 : 1;
  const float across = std::min(size.x, size[other]);
  return size[axis] < 0.4f * across && size[axis] > 0.005f * across &&
         faces.area[axis] > 1.5 * (faces.area.x + faces.area[other]);
}

}  // namespace

glm::vec3 named_up(const std::string& axis) { return axis == "z" ? glm::vec3(0, 0, 1) : glm::vec3(0, 1, 0); }

glm::mat3 axes(glm::vec3 up) {
  const glm::vec3 right(1, 0, 0);
  return {right, up, glm::cross(right, up)};
}

UpAxis likely_up(const RenderScene& scene) {
  const glm::vec3 size = scene.hi() - scene.lo();
  if (all_end_in(scene, {".glb", ".gltf"}) || !(size.z > 0.005f * std::min(size.x, size.y))) return kYUp;
  const Faces faces = measure(scene);
  if (lies_flat(faces, size, 2)) return {{0, 0, 1}, "lies flat in x and y"};
  if (lies_flat(faces, size, 1)) return kYUp;
  // Shares of the box's side below. A tenth is a foot that something can stand on.
  constexpr double kFoot = 0.1;
  const double foot_y = faces.resting.y / static_cast<double>(size.x * size.z);
  const double foot_z = faces.resting.z / static_cast<double>(size.x * size.y);
  const bool tall = size.z > std::max(size.x, size.y);
  if (tall && foot_z > kFoot && foot_z > 4 * foot_y) return {{0, 0, 1}, "stands on what is flat along z"};
  if (foot_y > kFoot && foot_y > 4 * foot_z) return kYUp;
  if (all_end_in(scene, {".stl"})) return {{0, 0, 1}, "comes from .stl"};
  return kYUp;
}

}  // namespace lsp::sample
