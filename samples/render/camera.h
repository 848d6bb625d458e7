// A pinhole camera, and one that suits a scene nobody has seen yet.
#pragma once

#include <glm/glm.hpp>
#include <string>

#include "ray_tracer.h"

namespace lsp::sample {

struct Camera {
  glm::vec3 eye{0.0f};
  glm::vec3 target{0.0f, 0.0f, -1.0f};
  float fov_degrees = 55.0f;  // vertical

  // The ray through a point of the picture: x in [0, width], y in [0, height] from the top. Its direction has
  // unit length.
  LspRay ray(glm::vec2 pixel, int width, int height) const;

  bool operator==(const Camera&) const = default;
};

// Parses "X,Y,Z:X,Y,Z:FOV" (eye, target, vertical angle in degrees). Throws lsp::Failure (kUsage).
Camera parse_camera(const std::string& text);
std::string to_string(const Camera& camera);
// Parses "WIDTHxHEIGHT", in pixels. Throws lsp::Failure (kUsage).
glm::ivec2 parse_size(const std::string& text);

// Inside a hall it stands where it sees far, at three tenths of the height; otherwise it looks at the whole
// from the front, right and above. y is up.
//
// Where it is a hall, `lamp` is set to a light in its middle; the radius is 0 otherwise.
struct Lamp {
  glm::vec3 position{0.0f};
  float radius = 0.0f;
  float intensity = 0.0f;  // radiant
};
Camera default_camera(const RenderScene& scene, RayTracer& tracer, Lamp& lamp);

// Makes the sky's light suit a scene that default_camera has looked at: out in the open everything is darker,
// and in a hall without light of its own hangs the lamp; then true.
bool suit(Sky& sky, const Lamp& lamp, const RenderScene& scene);

}  // namespace lsp::sample
