#include "camera.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <optional>
#include <set>
#include <vector>

#include "lsp/program.h"

namespace lsp::sample {
namespace {

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

constexpr float kPi = 3.14159265358979324f;
constexpr float kInfinity = std::numeric_limits<float>::infinity();

// What is seen from `origin` along `directions`, exactly.
std::vector<LspHit> look_around(RayTracer& tracer, glm::vec3 origin,
                                const std::vector<glm::vec3>& directions) {
  std::vector<LspRay> rays;
  for (const glm::vec3& d : directions) {
    rays.push_back({from_glm(origin), 0.0f, from_glm(d), kInfinity});
  }
  std::vector<LspHit> hits(rays.size());
  tracer.trace({0, 0.0f}, rays, hits);
  return hits;
}

// How much of a scene rays see.
struct Seen {
  size_t front = 0;  // rays that hit the front of a surface
  size_t back = 0;
  size_t primitives = 0;  // that were hit, each once
};

Seen look(const std::vector<glm::vec3>& directions, const std::vector<LspHit>& hits) {
  Seen seen;
  std::set<std::pair<uint32_t, uint32_t>> primitives;
  for (size_t i = 0; i < hits.size(); ++i) {
    if (!std::isfinite(hits[i].t)) continue;
    ++(glm::dot(to_glm(hits[i].normal), directions[i]) < 0 ? seen.front : seen.back);
    primitives.emplace(LSP_HIT_INSTANCE(hits[i]), hits[i].primitive);
  }
  seen.primitives = primitives.size();
  return seen;
}

// Of a small picture.
std::vector<glm::vec3> pixel_directions(const Camera& camera, float aspect) {
  constexpr int kHeight = 32;
  const int width = std::max(1, static_cast<int>(kHeight * std::min(aspect, 8.0f)));
  std::vector<glm::vec3> directions;
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < width; ++x)
      directions.push_back(to_glm(camera.ray(glm::vec2(x, y) + 0.5f, width, kHeight).direction));
  }
  return directions;
}

Seen look_through(const Camera& camera, float aspect, RayTracer& tracer) {
  const std::vector<glm::vec3> directions = pixel_directions(camera, aspect);
  return look(directions, look_around(tracer, camera.eye, directions));
}

// Of what the camera sees the share whose front it sees and `other`, too.
float also_seen(const Camera& camera, float aspect, RayTracer& tracer, glm::vec3 other) {
  const std::vector<glm::vec3> directions = pixel_directions(camera, aspect);
  const std::vector<LspHit> hits = look_around(tracer, camera.eye, directions);
  std::vector<LspRay> rays;
  for (size_t i = 0; i < hits.size(); ++i) {
    if (!std::isfinite(hits[i].t) || glm::dot(to_glm(hits[i].normal), directions[i]) >= 0) continue;
    const glm::vec3 way = camera.eye + hits[i].t * directions[i] - other;
    // Up to just before the surface: from behind, its other side would be in the way.
    if (glm::dot(to_glm(hits[i].normal), way) < 0)
      rays.push_back({from_glm(other), 0.0f, from_glm(way), 0.999f});
  }
  const Seen seen = look(directions, hits);
  std::vector<LspHit> between(rays.size());
  tracer.trace({LSP_TRACE_OCCLUSION, 0.0f}, rays, between);
  const auto free = std::ranges::count_if(between, [](const LspHit& hit) { return !std::isfinite(hit.t); });
  const size_t all = seen.front + seen.back;
  return all > 0 ? static_cast<float>(free) / static_cast<float>(all) : 0.0f;
}

// Looks along -`back` at all `points`, as near as shows them with a little room around.
Camera fit(const std::vector<glm::vec3>& points, glm::vec3 back, glm::vec3 up, float aspect,
           float fov_degrees) {
  constexpr float kRoom = 1.08f;
  const glm::vec3 right = glm::normalize(glm::cross(up, back));
  const glm::mat3 view(right, glm::cross(back, right), back);
  const float tan_y = std::tan(fov_degrees * kPi / 360.0f);
  const glm::vec2 tangent(tan_y * aspect, tan_y);
  // Each side of the picture is a plane that the points must lie behind: the eye is where the two planes of
  // left and right meet, or, further back, those of top and bottom.
  glm::vec2 high(-kInfinity);
  glm::vec2 low(-kInfinity);
  float nearest = -kInfinity;
  float farthest = kInfinity;
  for (const glm::vec3& point : points) {
    const glm::vec3 p = point * view;
    const glm::vec2 across(p.x, p.y);
    high = glm::max(high, across / tangent + p.z);
    low = glm::max(low, -across / tangent + p.z);
    nearest = std::max(nearest, p.z);
    farthest = std::min(farthest, p.z);
  }
  const glm::vec2 centre = 0.5f * (high - low) * tangent;
  const glm::vec2 reach = 0.5f * (high + low);
  const float distance = std::max({reach.x, reach.y, nearest});
  const float middle = 0.5f * (nearest + farthest);
  Camera camera;
  camera.up = up;
  camera.fov_degrees = fov_degrees;
  camera.target = view * glm::vec3(centre, middle);
  // One point alone has no size to stand off by.
  const float away = distance > middle ? distance - middle : 1.0f;
  camera.eye = camera.target + kRoom * away * back;
  return camera;
}

constexpr float kObjectFovDegrees = 38.0f;

std::vector<glm::vec3> some_corners(const RenderScene& scene) {
  std::vector<glm::vec3> points;
  for (const RenderScene::Corners& c : scene.some_triangles(1u << 16))
    points.insert(points.end(), {c.v0, c.v0 + c.e1, c.v0 + c.e2});
  if (points.empty()) points = {scene.lo(), scene.hi()};
  return points;
}

Camera view_of_object(const RenderScene& scene, RayTracer& tracer, glm::vec3 up, float aspect) {
  const glm::mat3 frame = axes(up);
  const std::vector<glm::vec3> points = some_corners(scene);
  // What lies flat is seen from higher up.
  const glm::vec3 size = glm::abs((scene.hi() - scene.lo()) * frame);
  const float rise = size.y < 0.3f * std::min(size.x, size.z) ? 0.75f : 0.36f;
  Camera best;
  float best_score = -1.0f;
  for (int i = 0; i < 8; ++i) {
    const float azimuth = 0.54f + 0.25f * kPi * static_cast<float>(i);
    const glm::vec3 back = frame * glm::normalize(glm::vec3(std::sin(azimuth), rise, std::cos(azimuth)));
    const Camera camera = fit(points, back, up, aspect, kObjectFovDegrees);
    const Seen seen = look_through(camera, aspect, tracer);
    // Fronts of surfaces and many of them: into an open box, not at its back.
    float score = static_cast<float>(seen.front) + static_cast<float>(seen.primitives);
    if (i == 0) score *= 1.3f;
    if (score <= best_score) continue;
    best_score = score;
    best = camera;
  }
  return best;
}

// How far it is from `origin`, inside, to the side of the scene's box.
float to_side(const RenderScene& scene, glm::vec3 origin, glm::vec3 direction) {
  const glm::vec3 sides =
      (glm::mix(scene.lo(), scene.hi(), glm::greaterThan(direction, glm::vec3(0))) - origin) / direction;
  float nearest = kInfinity;
  for (int axis = 0; axis < 3; ++axis) {
    if (direction[axis] != 0) nearest = std::min(nearest, sides[axis]);
  }
  return nearest;
}

// The share of the scene's box that can be seen from `origin`, if it reaches everywhere as far as in 256
// directions.
float visible_share(const RenderScene& scene, RayTracer& tracer, glm::vec3 origin) {
  constexpr int kDirections = 256;
  std::vector<glm::vec3> directions;  // on a spiral that covers the sphere evenly
  for (int i = 0; i < kDirections; ++i) {
    const float z = 1.0f - 2.0f * (static_cast<float>(i) + 0.5f) / kDirections;
    const float angle = 2.39996323f * (static_cast<float>(i) + 0.5f);
    const float r = std::sqrt(1.0f - z * z);
    directions.emplace_back(r * std::cos(angle), r * std::sin(angle), z);
  }
  const std::vector<LspHit> hits = look_around(tracer, origin, directions);
  const glm::vec3 size = scene.hi() - scene.lo();
  float volume = 0.0f;
  for (size_t i = 0; i < hits.size(); ++i) {
    const float t = std::min(hits[i].t, to_side(scene, origin, directions[i]));
    volume += t * t * t;
  }
  return volume * 4.0f * kPi / (3.0f * kDirections) / (size.x * size.y * size.z);
}

// Straight into a box that is open to a side, of which `inside` is the middle; nothing where there is none.
std::optional<Camera> view_into_open_side(const RenderScene& scene, RayTracer& tracer, glm::vec3 inside,
                                          glm::vec3 up, float aspect) {
  const std::vector<glm::vec3> points = some_corners(scene);
  for (const glm::vec3& side :
       {glm::vec3(0, 0, 1), glm::vec3(1, 0, 0), glm::vec3(0, 0, -1), glm::vec3(-1, 0, 0)}) {
    const Camera camera = fit(points, axes(up) * side, up, aspect, kObjectFovDegrees);
    if (also_seen(camera, aspect, tracer, inside) > 0.3f) return camera;
  }
  return std::nullopt;
}

// Nothing where the scene is no hall.
std::optional<View> view_of_hall(const RenderScene& scene, RayTracer& tracer, const Camera& outside,
                                 float aspect) {
  const glm::mat3 frame = axes(outside.up);
  const float diagonal = scene.diagonal();
  const glm::vec3 lo = scene.lo();
  const glm::vec3 size = scene.hi() - lo;
  const glm::vec3 inside = 0.5f * (lo + scene.hi()) - 0.2f * outside.up * glm::dot(size, outside.up);

  constexpr size_t kAround = 64;
  std::vector<glm::vec3> around;
  for (size_t i = 0; i < kAround; ++i) {
    const float angle = 2.0f * kPi * static_cast<float>(i) / static_cast<float>(kAround);
    around.push_back(frame * glm::vec3(std::cos(angle), 0.0f, std::sin(angle)));
  }
  const std::vector<LspHit> hits = look_around(tracer, inside, around);
  const Seen walls = look(around, hits);
  const auto wide = std::ranges::count_if(hits, [&](const LspHit& hit) { return hit.t > 0.04f * diagonal; });
  // A hall has walls nearly all around that face inwards, most of them some way off. The skin of a solid body
  // faces away from whoever is inside; a hole in one is a small part of it.
  if (walls.front + walls.back < 52 || walls.front <= 2 * walls.back || wide < 32) return std::nullopt;
  // And something to stand on, which the hole of a ring has not.
  std::vector<glm::vec3> below;
  for (size_t i = 0; i < kAround; i += 4) below.push_back(glm::normalize(around[i] - 1.5f * outside.up));
  const Seen floor = look(below, look_around(tracer, inside, below));
  if (floor.front + floor.back < below.size() * 3 / 4) return std::nullopt;
  if (visible_share(scene, tracer, inside) < 0.1f) return std::nullopt;

  const auto free = [&](size_t i) {
    return std::min(hits[i % kAround].t, to_side(scene, inside, around[i % kAround]));
  };
  View view;
  float reach = 0.0f;
  for (size_t i = 0; i < kAround; ++i)
    reach += std::min(free(i), 0.3f * diagonal) / static_cast<float>(kAround);
  // Bright enough for surfaces as far away as the walls are on average.
  view.lamp = {inside, 0.01f * diagonal, 3.0f * reach * reach};
  if (const auto open = view_into_open_side(scene, tracer, inside, outside.up, aspect)) {
    view.camera = *open;
    // Above what stands in the box.
    const float headroom =
        std::min(look_around(tracer, inside, {outside.up})[0].t, to_side(scene, inside, outside.up));
    view.lamp.position += 0.8f * headroom * outside.up;
    return view;
  }

  size_t ahead = 0;
  for (size_t i = 1; i < kAround; ++i) {
    if (free(i) + free(i + kAround / 2) > free(ahead) + free(ahead + kAround / 2)) ahead = i;
  }
  if (free(ahead) < free(ahead + kAround / 2)) ahead = (ahead + kAround / 2) % kAround;
  const size_t back = (ahead + kAround / 2) % kAround;
  view.camera.up = outside.up;
  view.camera.eye = inside + around[back] * 0.6f * free(back);
  view.camera.target = inside - around[back] * 0.1f * diagonal;
  view.camera.fov_degrees = 65.0f;
  // One skin that faces inwards is either a room without an outside or a body turned inside out: a room holds
  // more than its walls.
  const Seen from_outside = look_through(outside, aspect, tracer);
  const Seen from_inside = look_through(view.camera, aspect, tracer);
  if (from_outside.back > from_outside.front && 2 * from_inside.primitives < 5 * from_outside.primitives)
    return std::nullopt;
  return view;
}

// Inside a hall it stands where it sees far, at three tenths of the height; otherwise it looks at the whole
// from outside and a little above, from in front and to the right unless much more is seen from elsewhere, so
// near that it fills a picture of `aspect` (width over height). `up`: y or z.
View default_view(const RenderScene& scene, RayTracer& tracer, glm::vec3 up, float aspect) {
  const Camera outside = view_of_object(scene, tracer, up, aspect);
  if (const std::optional<View> hall = view_of_hall(scene, tracer, outside, aspect)) return *hall;
  return {outside, {}};
}

// Makes the sky's light suit a scene that default_view has looked at: out in the open everything is darker,
// and in a hall without light of its own hangs the lamp; then true.
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

}  // namespace

LspRay Camera::ray(glm::vec2 pixel, int width, int height) const {
  const glm::vec3 forward = glm::normalize(target - eye);
  const glm::vec3 elsewhere = up.y > 0.5f ? glm::vec3(0, 0, 1) : glm::vec3(0, 1, 0);
  const glm::vec3 above = std::abs(glm::dot(forward, up)) > 0.999f ? elsewhere : up;
  const glm::vec3 right = glm::normalize(glm::cross(forward, above));
  const glm::vec3 upward = glm::cross(right, forward);
  const float half = std::tan(fov_degrees * kPi / 360.0f);
  const float x = (2.0f * pixel.x - static_cast<float>(width)) / static_cast<float>(height) * half;
  const float y = (1.0f - 2.0f * pixel.y / static_cast<float>(height)) * half;
  const glm::vec3 direction = glm::normalize(forward + x * right + y * upward);
  return {from_glm(eye), 0.0f, from_glm(direction), kInfinity};
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

const char* up_option(const Camera& camera) { return camera.up.z > 0 ? " --up z" : ""; }

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

Shot choose_shot(const RenderScene& scene, RayTracer& tracer, const std::string& camera,
                 const std::string& up, std::optional<glm::vec3> sun, float aspect) {
  const bool given = !camera.empty();
  const UpAxis likely = !up.empty() || given ? UpAxis{named_up(up), nullptr} : likely_up(scene);
  const glm::vec3 axis = likely.direction;
  Shot shot;
  shot.sky.up = axis;
  shot.sky.sun_direction = sun ? *sun : axes(axis) * shot.sky.sun_direction;
  if (given) {
    shot.camera = parse_camera(camera);
    shot.camera.up = axis;
    return shot;
  }
  if (likely.reason != nullptr) {
    shot.notes.push_back(std::string(likely.reason) + ": z is taken to be up; --up y where that is wrong");
  }
  const View view = default_view(scene, tracer, axis, aspect);
  shot.camera = view.camera;
  if (suit(shot.sky, view.lamp, scene))
    shot.notes.emplace_back("a hall without lights: a lamp hangs in its middle");
  return shot;
}

}  // namespace lsp::sample
