#include "hard_rays.h"

#include <cmath>
#include <limits>

namespace lsp::test {
namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();
constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();

class Rays {
 public:
  Rays(std::span<const LspTriangle> triangles, uint64_t seed, float scale)
      : triangles_(triangles), random_(seed), scale_(scale) {}

  LspRay make(uint32_t kind) {
    LspRay ray{point(2), 0, direction(), kInfinity};
    switch (kind) {
      case 0:
        break;  // from around the scene
      case 1:   // from inside it, at any length of the direction
        ray.origin = point(0.9f);
        scale(ray.direction, std::ldexp(1.0f, static_cast<int>(random_.below(80)) - 40));
        break;
      case 2:  // at a corner
        aim(ray, corner());
        break;
      case 3: {  // at the middle of an edge
        const LspTriangle& t = triangle();
        aim(ray, {(t.v0.x + t.v1.x) * 0.5f, (t.v0.y + t.v1.y) * 0.5f, (t.v0.z + t.v1.z) * 0.5f});
        break;
      }
      case 4: {  // along an axis, with zeros of either sign
        float d[3] = {zero(), zero(), zero()};
        d[random_.below(3)] = random_.below(2) == 0 ? 1.0f : -1.0f;
        ray.direction = {d[0], d[1], d[2]};
        break;
      }
      case 5: {  // along an axis through a corner: in the planes of boxes
        float d[3] = {zero(), zero(), zero()};
        const uint32_t axis = random_.below(3);
        d[axis] = random_.below(2) == 0 ? 1.0f : -1.0f;
        ray.direction = {d[0], d[1], d[2]};
        const lsp_float3 c = corner();
        ray.origin = {axis == 0 ? -3 * d[0] : c.x, axis == 1 ? -3 * d[1] : c.y, axis == 2 ? -3 * d[2] : c.z};
        break;
      }
      case 6:  // from a surface
        ray.origin = corner();
        ray.tmin = random_.below(2) == 0 ? 0.0f : 1e-4f;
        break;
      case 7:  // in the plane of a triangle
        ray.origin = triangle().v0;
        aim(ray, triangle().v1);
        break;
      case 8:  // a short interval
        ray.tmin = random_.between(0, 1);
        ray.tmax = ray.tmin + random_.between(0, 1);
        break;
      case 9:  // backward: a negative interval
        ray.tmin = -3;
        ray.tmax = random_.below(2) == 0 ? 0.0f : 3.0f;
        break;
      case 10:  // far away
        scale(ray.origin, 1e4f);
        aim(ray, point(1));
        break;
      case 11:  // one component all but zero
        (random_.below(2) == 0 ? ray.direction.x : ray.direction.y) *= 1e-20f;
        break;
      default:
        invalidate(ray, random_.below(9));
        break;
    }
    return ray;
  }
  static constexpr uint32_t kKinds = 14;

 private:
  void invalidate(LspRay& ray, uint32_t how) {
    switch (how) {
      case 0:
        ray.origin.x = kNaN;
        break;
      case 1:
        ray.direction.z = kNaN;
        break;
      case 2:
        ray.origin.y = kInfinity;
        break;
      case 3:
        ray.direction.x = -kInfinity;
        break;
      case 4:
        ray.direction = {0.0f, -0.0f, 0.0f};
        break;
      case 5:
        ray.tmin = 2, ray.tmax = 1;
        break;
      case 6:
        ray.tmin = kNaN;
        break;
      case 7:
        ray.tmax = kNaN;
        break;
      default:
        ray.tmin = ray.tmax = 1;
        break;
    }
  }

  float zero() { return random_.below(2) == 0 ? 0.0f : -0.0f; }
  lsp_float3 point(float size) {
    const float s = size * scale_;
    return {random_.between(-s, s), random_.between(-s, s), random_.between(-s, s)};
  }
  lsp_float3 direction() {
    lsp_float3 d{random_.between(-1, 1), random_.between(-1, 1), random_.between(-1, 1)};
    if (d.x == 0 && d.y == 0 && d.z == 0) d.x = 1;
    return d;
  }
  const LspTriangle& triangle() {
    static constexpr LspTriangle kNone{};
    if (triangles_.empty()) return kNone;
    return triangles_[random_.below(static_cast<uint32_t>(triangles_.size()))];
  }
  lsp_float3 corner() {
    const LspTriangle& t = triangle();
    const uint32_t which = random_.below(3);
    return which == 0 ? t.v0 : which == 1 ? t.v1 : t.v2;
  }
  static void scale(lsp_float3& v, float s) { v = {v.x * s, v.y * s, v.z * s}; }
  static void aim(LspRay& ray, const lsp_float3& at) {
    ray.direction = {at.x - ray.origin.x, at.y - ray.origin.y, at.z - ray.origin.z};
  }

  std::span<const LspTriangle> triangles_;
  Random random_;
  float scale_;
};

}  // namespace

std::vector<LspRay> hard_rays(std::span<const LspTriangle> triangles, uint32_t count, uint64_t seed,
                              float scale) {
  Rays rays(triangles, seed, scale);
  std::vector<LspRay> result;
  result.reserve(count);
  for (uint32_t i = 0; i < count; ++i) result.push_back(rays.make(i % Rays::kKinds));
  return result;
}

}  // namespace lsp::test
