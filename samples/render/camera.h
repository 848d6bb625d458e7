// A pinhole camera, and a view that suits a scene nobody has seen yet.
#pragma once

#include <glm/glm.hpp>
#include <optional>
#include <string>
#include <vector>

#include "ray_tracer.h"
#include "up_axis.h"

namespace lsp::sample {

struct Camera {
  glm::vec3 eye{0.0f};
  glm::vec3 target{0.0f, 0.0f, -1.0f};
  float fov_degrees = 55.0f;       // vertical
  glm::vec3 up{0.0f, 1.0f, 0.0f};  // unit

  // The ray through a point of the picture: x in [0, width], y in [0, height] from the top. Its direction has
  // unit length.
  LspRay ray(glm::vec2 pixel, int width, int height) const;

  bool operator==(const Camera&) const = default;
};

// Parses "X,Y,Z:X,Y,Z:FOV" (eye, target, vertical angle in degrees). Throws lsp::Failure (kUsage).
Camera parse_camera(const std::string& text);
std::string to_string(const Camera& camera);
// What is said behind it where z is up: " --up z", else nothing.
const char* up_option(const Camera& camera);
// Parses "WIDTHxHEIGHT", in pixels. Throws lsp::Failure (kUsage).
glm::ivec2 parse_size(const std::string& text);

// What is looked at, and in which light.
struct Shot {
  Camera camera;
  Sky sky;
  std::vector<std::string> notes;  // what the user should know of the choice
};

// `camera` and `up` as the options say them; empty: chosen, with a camera y is up. Only light of a chosen
// camera is made to suit the scene. `sun`: towards it, unit; nothing: the sky's own. Throws lsp::Failure
// (kUsage).
Shot choose_shot(const RenderScene& scene, RayTracer& tracer, const std::string& camera,
                 const std::string& up, std::optional<glm::vec3> sun, float aspect);

}  // namespace lsp::sample
