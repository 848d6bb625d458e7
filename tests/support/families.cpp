#include "families.h"

#include <cmath>
#include <cstring>
#include <limits>
#include <stdexcept>

namespace lsp::stress {
namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();
constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();
constexpr float kMax = std::numeric_limits<float>::max();

lsp_float3 to(const glm::vec3& v) { return {v.x, v.y, v.z}; }
glm::vec3 from(const lsp_float3& v) { return {v.x, v.y, v.z}; }

template <typename T, size_t n>
const T& one_of(const T (&values)[n], Random& random) {
  return values[random.below(n)];
}
double between(Random& random, double lo, double hi) { return lo + (hi - lo) * random.uniform(); }
bool coin(Random& random) { return random.below(2) == 0; }
float sign(Random& random) { return coin(random) ? 1.0f : -1.0f; }

const std::array<glm::vec3, 3>& triangle(const StressScene& scene, Random& random) {
  return scene.soup().corners[random.below(static_cast<uint32_t>(scene.soup().size()))];
}

// On a triangle, as near as single precision gets.
glm::vec3 on(const std::array<glm::vec3, 3>& t, Random& random) {
  double u = random.uniform(), v = random.uniform();
  if (u + v > 1) u = 1 - u, v = 1 - v;
  return glm::vec3((1 - u - v) * glm::dvec3(t[0]) + u * glm::dvec3(t[1]) + v * glm::dvec3(t[2]));
}

// On a triangle's corner, the middle of an edge, or anywhere on it.
glm::vec3 special_point(const std::array<glm::vec3, 3>& t, Random& random) {
  const uint32_t k = random.below(3);
  switch (random.below(3)) {
    case 0:
      return t[k];
    case 1:
      return 0.5f * (t[k] + t[(k + 1) % 3]);
    default:
      return on(t, random);
  }
}

glm::vec3 around(const StressScene& scene, Random& random, double size = 2) {
  const glm::dvec3 centre = 0.5 * (scene.soup().lo + scene.soup().hi);
  const double r = 0.5 * size * scene.diagonal();
  return glm::vec3(centre +
                   glm::dvec3(between(random, -r, r), between(random, -r, r), between(random, -r, r)));
}

glm::vec3 any_direction(Random& random) {
  glm::vec3 d;
  do {
    d = glm::vec3(between(random, -1, 1), between(random, -1, 1), between(random, -1, 1));
  } while (glm::dot(d, d) < 1e-4f);
  return d;
}

LspRay ray(const glm::vec3& origin, const glm::vec3& direction) {
  return {to(origin), 0.0f, to(direction), kInfinity};
}
LspRay aimed(const glm::vec3& origin, const glm::vec3& at) {
  const glm::vec3 d(glm::dvec3(at) - glm::dvec3(origin));
  return ray(origin, d == glm::vec3(0) ? glm::vec3(1, 0, 0) : d);
}

struct Box {
  glm::vec3 lo, hi;
};

// A box of the tree, a cell, or the whole scene.
Box box(const StressScene& scene, Random& random) {
  const lsp_scene& s = scene.scene();
  const uint32_t nodes = s.header->node_count;
  if (s.header->base_structure == LSP_BASE_BVH && nodes != 0) {
    const LspNode& node = s.nodes[random.below(nodes)];
    return coin(random) ? Box{from(node.lo0), from(node.hi0)} : Box{from(node.lo1), from(node.hi1)};
  }
  if (s.header->line_space_count != 0) {
    const LspLineSpace& ls = s.line_spaces[random.below(s.header->line_space_count)];
    return {from(ls.lo), from(ls.hi)};
  }
  return {from(s.header->bounds_min), from(s.header->bounds_max)};
}

glm::vec3 inside(const Box& b, Random& random) {
  glm::vec3 p;
  for (int k = 0; k < 3; ++k) {
    p[k] = static_cast<float>(between(random, b.lo[k], b.hi[k]));
    p[k] = std::fmin(std::fmax(p[k], b.lo[k]), b.hi[k]);
  }
  return p;
}

// In a direction of all kinds: any, along an axis, in a coordinate plane.
glm::vec3 mixed_direction(Random& random) {
  glm::vec3 d = any_direction(random);
  const uint32_t kind = random.below(3);
  const auto k = static_cast<int>(random.below(3));
  if (kind == 1) d = glm::vec3(0), d[k] = sign(random);
  if (kind == 2) d[k] = coin(random) ? 0.0f : -0.0f;
  return d;
}

// Half of the rays that start on a surface leave it out, as renderers do: then the answer is decided.
LspRay with_tmin(const StressScene& scene, LspRay r, Random& random) {
  const double length = glm::length(glm::dvec3(r.direction.x, r.direction.y, r.direction.z));
  if (coin(random)) r.tmin = static_cast<float>(1e-3 * scene.diagonal() / length);
  return r;
}

LspRay zeros(const StressScene& scene, Random& random) {
  const auto& t = triangle(scene, random);
  const glm::vec3 target = coin(random) ? on(t, random) : special_point(t, random);
  LspRay r = aimed(around(scene, random), target);
  const float small[] = {0.0f, -0.0f, 1e-45f, -1e-45f, 1e-40f, -1e-40f, 1.1754944e-38f, 1e-30f, -1e-19f};
  float* d = &r.direction.x;
  float* o = &r.origin.x;
  // One or two components vanish; the origin moves so that the ray still meets its target.
  const uint32_t keep = random.below(3), also = random.below(4);
  for (uint32_t k = 0; k < 3; ++k) {
    if (k == keep || k == also) continue;
    d[k] = one_of(small, random);
    o[k] = target[static_cast<int>(k)];
    if (random.below(8) == 0) o[k] = one_of(small, random);
  }
  if (d[keep] == 0) d[keep] = 1;
  return r;
}

LspRay huge(const StressScene& scene, Random& random) {
  LspRay r = aimed(around(scene, random), special_point(triangle(scene, random), random));
  float* o = &r.origin.x;
  float* d = &r.direction.x;
  const uint32_t k = random.below(3);
  switch (random.below(4)) {
    case 0: {  // the direction as long as can be
      const float m = std::fmax(std::fabs(d[0]), std::fmax(std::fabs(d[1]), std::fabs(d[2])));
      const float s = kMax / m;
      for (int i = 0; i < 3; ++i) d[i] = d[i] / m * (s < kMax ? kMax : s);
      break;
    }
    case 1:  // a far origin
      o[k] = sign(random) * static_cast<float>(std::pow(10.0, between(random, 8, 38.5)));
      break;
    case 2:  // one component of the direction outweighs the rest
      d[k] = sign(random) * static_cast<float>(std::pow(10.0, between(random, 8, 38.5)));
      break;
    default:  // all of the origin
      for (int i = 0; i < 3; ++i)
        o[i] = sign(random) * static_cast<float>(std::pow(10.0, between(random, 20, 38.5)));
  }
  return r;
}

LspRay lengths(const StressScene& scene, Random& random) {
  LspRay r = aimed(around(scene, random), on(triangle(scene, random), random));
  const double length = std::pow(10.0, between(random, -20, 20)) /
                        glm::length(glm::dvec3(r.direction.x, r.direction.y, r.direction.z));
  for (float* d : {&r.direction.x, &r.direction.y, &r.direction.z}) *d = static_cast<float>(*d * length);
  return r;
}

LspRay on_boxes(const StressScene& scene, Random& random) {
  const Box b = box(scene, random);
  glm::vec3 p = inside(b, random);
  const auto first = static_cast<int>(random.below(3));
  const uint32_t faces = 1 + random.below(3);  // a face, an edge, a corner
  for (uint32_t i = 0; i < faces; ++i) {
    const auto k = (first + static_cast<int>(i)) % 3;
    p[k] = coin(random) ? b.lo[k] : b.hi[k];
  }
  LspRay r = ray(p, mixed_direction(random));
  if (random.below(4) == 0) r = aimed(p, special_point(triangle(scene, random), random));
  return with_tmin(scene, r, random);
}

LspRay on_triangles(const StressScene& scene, Random& random) {
  const auto& t = triangle(scene, random);
  const glm::vec3 p = special_point(t, random);
  LspRay r = ray(p, mixed_direction(random));
  if (random.below(4) == 0) r = aimed(p, special_point(t, random));  // in its plane
  if (random.below(4) == 0) r = aimed(p, special_point(triangle(scene, random), random));
  return with_tmin(scene, r, random);
}

// A point of a face of a Line Space's box exactly on a border of patches.
glm::vec3 patch_border(const LspLineSpace& ls, Random& random) {
  const Box b{from(ls.lo), from(ls.hi)};
  const uint32_t n = ls.format & LSP_FORMAT_RESOLUTION_MASK;
  const auto axis = static_cast<int>(random.below(3));
  glm::vec3 p = inside(b, random);
  p[axis] = coin(random) ? b.lo[axis] : b.hi[axis];
  for (int i = 1; i <= 1 + static_cast<int>(random.below(2)); ++i) {
    const int k = (axis + i) % 3;
    const float step = (b.hi[k] - b.lo[k]) / static_cast<float>(n);
    p[k] = b.lo[k] + step * static_cast<float>(random.below(n + 1));
    // A step of the number to either side, too.
    if (random.below(4) == 0) p[k] = std::nextafter(p[k], coin(random) ? kMax : -kMax);
  }
  return p;
}

LspRay at_patch_borders(const StressScene& scene, Random& random) {
  const lsp_scene& s = scene.scene();
  if (s.header->line_space_count == 0) return on_boxes(scene, random);
  const LspLineSpace& ls = s.line_spaces[random.below(s.header->line_space_count)];
  const glm::vec3 p = patch_border(ls, random), q = patch_border(ls, random);
  if (coin(random)) return aimed(p, q);
  // From outside through both.
  const glm::dvec3 away = glm::dvec3(p) - glm::dvec3(q);
  return aimed(glm::vec3(glm::dvec3(p) + between(random, 0, 2) * away), q);
}

LspRay in_flat_boxes(const StressScene& scene, Random& random) {
  Box b = box(scene, random);
  for (int i = 0; i < 12 && b.lo.x != b.hi.x && b.lo.y != b.hi.y && b.lo.z != b.hi.z; ++i)
    b = box(scene, random);
  if (b.lo.x != b.hi.x && b.lo.y != b.hi.y && b.lo.z != b.hi.z) {
    // None found (an NTree has none): the box of a flat triangle.
    for (int i = 0; i < 40; ++i) {
      const auto& t = triangle(scene, random);
      b = {glm::min(t[0], glm::min(t[1], t[2])), glm::max(t[0], glm::max(t[1], t[2]))};
      if (b.lo.x == b.hi.x || b.lo.y == b.hi.y || b.lo.z == b.hi.z) break;
    }
  }
  return with_tmin(scene, ray(inside(b, random), mixed_direction(random)), random);
}

LspRay from_far(const StressScene& scene, Random& random) {
  const glm::vec3 target = on(triangle(scene, random), random);
  const glm::dvec3 d = glm::normalize(glm::dvec3(any_direction(random)));
  const double away =
      std::pow(10.0, coin(random) ? between(random, 0.5, 4) : between(random, 4, 7.3)) * scene.diagonal();
  return aimed(glm::vec3(glm::dvec3(target) + away * d), target);
}

LspRay intervals(const StressScene& scene, Random& random) {
  LspRay r = aimed(around(scene, random), on(triangle(scene, random), random));
  // The direction spans the way to the target: t = 1 there, up to rounding.
  const float ends[] = {0.0f,
                        -0.0f,
                        1.0f,
                        std::nextafter(1.0f, 2.0f),
                        std::nextafter(1.0f, 0.0f),
                        0.5f,
                        2.0f,
                        kInfinity,
                        -kInfinity,
                        kMax,
                        -kMax,
                        1e-45f,
                        -1e-40f,
                        -1.0f,
                        1e30f,
                        0.999f};
  r.tmin = one_of(ends, random);
  r.tmax = one_of(ends, random);
  if (random.below(3) == 0) r.tmin = static_cast<float>(between(random, -1, 1.5));
  if (random.below(3) == 0) r.tmax = static_cast<float>(between(random, 0, 2));
  return r;
}

LspRay invalid(const StressScene& scene, Random& random) {
  LspRay r = aimed(around(scene, random), on(triangle(scene, random), random));
  float values[8];
  std::memcpy(values, &r, sizeof values);
  const float bad[] = {kNaN, -kNaN, kInfinity, -kInfinity};
  switch (random.below(6)) {
    case 0:  // no direction
      for (int i = 4; i < 7; ++i) values[i] = coin(random) ? 0.0f : -0.0f;
      break;
    case 1:  // one of denormal length
      for (int i = 4; i < 7; ++i) values[i] = sign(random) * 1e-39f;
      break;
    case 2:  // reversed
      values[3] = 2, values[7] = static_cast<float>(between(random, -3, 2));
      break;
    default:
      for (uint32_t i = 0; i < 1 + random.below(8); ++i) values[random.below(8)] = one_of(bad, random);
  }
  std::memcpy(&r, values, sizeof values);
  return r;
}

LspRay at_edges(const StressScene& scene, Random& random) {
  const auto& t = triangle(scene, random);
  const uint32_t k = random.below(3);
  const glm::dvec3 a(t[k]), b(t[(k + 1) % 3]);
  const glm::vec3 at(coin(random) ? a : a + random.uniform() * (b - a));
  return aimed(around(scene, random, coin(random) ? 0.6 : 3), at);
}

constexpr Family kFamilies[] = {
    {"zeros", "zero, negative zero and denormal components", zeros},
    {"huge", "components up to 3e38 in origin and direction", huge},
    {"lengths", "directions of length 1e-20 to 1e20", lengths},
    {"boxes", "origins on faces, edges and corners of boxes and cells", on_boxes},
    {"triangles", "origins on triangles, their edges and corners", on_triangles},
    {"patches", "through points exactly at the borders of patches", at_patch_borders},
    {"flat", "origins inside boxes without thickness", in_flat_boxes},
    {"far", "from 3 to 2e7 diagonals away", from_far},
    {"intervals", "tmin and tmax zero, infinite, reversed, at the hit", intervals},
    {"invalid", "NaN and infinity anywhere, no direction", invalid},
    {"edges", "at edges and corners of triangles", at_edges},
};

}  // namespace

std::span<const Family> families() { return kFamilies; }

const Family& family(const char* name) {
  for (const Family& f : kFamilies) {
    if (std::strcmp(f.name, name) == 0) return f;
  }
  throw std::invalid_argument(name);
}

std::vector<LspRay> rays_of(const Family& family, const StressScene& scene, size_t count, uint64_t seed) {
  Random random(seed, static_cast<uint64_t>(&family - kFamilies) + 1);
  std::vector<LspRay> rays;
  rays.reserve(count);
  for (size_t i = 0; i < count; ++i) rays.push_back(family.make(scene, random));
  return rays;
}

}  // namespace lsp::stress
