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

// A light for a hall; radius 0: none.
struct Lamp {
  glm::vec3 position{0.0f};
  float radius = 0.0f;
  float intensity = 0.0f;  // radiant
};

struct View {
  Camera camera;
  Lamp lamp;  // in the middle of a hall
};

// Inside a hall it stands where it sees far, at three tenths of the height; otherwise it looks at the whole
// from outside and a little above, from in front and to the right unless much more is seen from elsewhere, so
// near that it fills a picture of `aspect` (width over height). `up`: y or z.
View default_view(const RenderScene& scene, RayTracer& tracer, glm::vec3 up, float aspect);

// Makes the sky's light suit a scene that default_view has looked at: out in the open everything is darker,
// and in a hall without light of its own hangs the lamp; then true.
bool suit(Sky& sky, const Lamp& lamp, const RenderScene& scene);

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
