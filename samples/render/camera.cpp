#include "camera.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <vector>

#include "lsp/program.h"

namespace lsp::sample {
namespace {

constexpr float kPi = 3.14159265358979324f;

// What is seen from `origin` along `directions`, exactly.
std::vector<LspHit> look_around(RayTracer& tracer, glm::vec3 origin,
                                const std::vector<glm::vec3>& directions) {
  std::vector<LspRay> rays;
  for (const glm::vec3& d : directions) {
    rays.push_back({from_glm(origin), 0.0f, from_glm(d), std::numeric_limits<float>::infinity()});
  }
  std::vector<LspHit> hits(rays.size());
  tracer.trace({0, 0.0f}, rays, hits);
  return hits;
}

}  // namespace

LspRay Camera::ray(glm::vec2 pixel, int width, int height) const {
  const glm::vec3 forward = glm::normalize(target - eye);
  const glm::vec3 world_up = std::abs(forward.y) > 0.999f ? glm::vec3(0, 0, 1) : glm::vec3(0, 1, 0);
  const glm::vec3 right = glm::normalize(glm::cross(forward, world_up));
  const glm::vec3 up = glm::cross(right, forward);
  const float half = std::tan(fov_degrees * kPi / 360.0f);
  const float x = (2.0f * pixel.x - static_cast<float>(width)) / static_cast<float>(height) * half;
  const float y = (1.0f - 2.0f * pixel.y / static_cast<float>(height)) * half;
  const glm::vec3 direction = glm::normalize(forward + x * right + y * up);
  return {from_glm(eye), 0.0f, from_glm(direction), std::numeric_limits<float>::infinity()};
}

Camera parse_camera(const std::string& text) {
  Camera camera;
  int used = 0;
  const int count =
      std::sscanf(text.c_str(), "%f,%f,%f:%f,%f,%f:%f%n", &camera.eye.x, &camera.eye.y, &camera.eye.z,
                  &camera.target.x, &camera.target.y, &camera.target.z, &camera.fov_degrees, &used);
  const float distance = glm::length(camera.target - camera.eye);
  if (count != 7 || static_cast<size_t>(used) != text.size() || !std::isfinite(distance) || distance <= 0 ||
      !(camera.fov_degrees > 0 && camera.fov_degrees < 179)) {
    throw Failure(Exit::kUsage, "",
                  "--camera '" + text + "' is not EYE_X,EYE_Y,EYE_Z:TARGET_X,TARGET_Y,TARGET_Z:DEGREES");
  }
  return camera;
}

std::string to_string(const Camera& c) {
  char text[256];
  std::snprintf(text, sizeof text, "%g,%g,%g:%g,%g,%g:%g", static_cast<double>(c.eye.x),
                static_cast<double>(c.eye.y), static_cast<double>(c.eye.z), static_cast<double>(c.target.x),
                static_cast<double>(c.target.y), static_cast<double>(c.target.z),
                static_cast<double>(c.fov_degrees));
  return text;
}

glm::ivec2 parse_size(const std::string& text) {
  glm::ivec2 size(0);
  int used = 0;
  const int count = std::sscanf(text.c_str(), "%dx%d%n", &size.x, &size.y, &used);
  constexpr int kLargest = 16384;
  if (count != 2 || static_cast<size_t>(used) != text.size() || size.x < 1 || size.y < 1 ||
      size.x > kLargest || size.y > kLargest) {
    throw Failure(Exit::kUsage, "", "--size '" + text + "' is not WIDTHxHEIGHT, each from 1 to 16384");
  }
  return size;
}

Camera default_camera(const RenderScene& scene, RayTracer& tracer, Lamp& lamp) {
  lamp = {};
  const glm::vec3 size = scene.hi() - scene.lo();
  const glm::vec3 centre = 0.5f * (scene.lo() + scene.hi());
  const float diagonal = scene.diagonal();
  const glm::vec3 inside(centre.x, scene.lo().y + 0.3f * size.y, centre.z);

  std::vector<glm::vec3> around;
  for (int i = 0; i < 64; ++i) {
    const float angle = 2.0f * kPi * static_cast<float>(i) / 64.0f;
    around.emplace_back(std::cos(angle), 0.0f, std::sin(angle));
  }
  const std::vector<LspHit> seen = look_around(tracer, inside, around);
  std::vector<float> free;
  size_t walls = 0;
  size_t facing = 0;
  size_t wide = 0;
  for (size_t i = 0; i < seen.size(); ++i) {
    free.push_back(seen[i].t);
    if (std::isfinite(seen[i].t)) ++walls;
    if (std::isfinite(seen[i].t) && glm::dot(to_glm(seen[i].normal), around[i]) < 0) ++facing;
    if (seen[i].t > 0.04f * diagonal) ++wide;
  }
  // A hall has walls nearly all around that face inwards, most of them some way off. The skin of a solid body
  // faces away from whoever is inside.
  if (walls >= 48 && 3 * facing > 2 * walls && wide >= 32) {
    size_t best = 0;
    float best_length = -1.0f;
    for (size_t i = 0; i < free.size(); ++i) {
      const float ahead = std::min(free[i], diagonal);
      const float behind = std::min(free[(i + 32) % 64], diagonal);
      if (ahead + behind > best_length) {
        best_length = ahead + behind;
        best = i;
      }
    }
    const size_t back = free[best] > free[(best + 32) % 64] ? (best + 32) % 64 : best;
    Camera camera;
    camera.eye = inside + around[back] * 0.6f * std::min(free[back], diagonal);
    camera.target = inside - around[back] * 0.1f * diagonal;
    camera.fov_degrees = 65.0f;
    float reach = 0.0f;
    for (const float distance : free)
      reach += std::min(distance, 0.3f * diagonal) / static_cast<float>(free.size());
    // Bright enough for surfaces as far away as the walls are on average.
    lamp = {inside, 0.01f * diagonal, 3.0f * reach * reach};
    return camera;
  }
  Camera camera;
  camera.fov_degrees = 38.0f;
  camera.target = centre;
  camera.eye = centre + glm::normalize(glm::vec3(0.6f, 0.42f, 1.0f)) *
                            (0.58f * diagonal / std::sin(19.0f * kPi / 180.0f));
  return camera;
}

bool suit(Sky& sky, const Lamp& lamp, const RenderScene& scene) {
  if (lamp.radius == 0) {
    // Out in the open nothing takes light away, as walls do: the same sky would be glaring.
    sky.brightness *= 0.4f;
    sky.sun_irradiance *= 0.4f;
    return false;
  }
  if (scene.has_emitters()) return false;
  sky.lamp_position = lamp.position;
  sky.lamp_radius = lamp.radius;
  sky.lamp_intensity = glm::vec3(1.0f, 0.9f, 0.75f) * lamp.intensity;
  return true;
}

}  // namespace lsp::sample
