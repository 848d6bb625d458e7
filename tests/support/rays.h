// The rays that judge: deterministic sets as indirect light asks for them.
#pragma once

#include <functional>
#include <glm/glm.hpp>
#include <span>
#include <vector>

#include "pcg32.h"
#include "soup.h"

namespace lsp::bench {

// Answers closest hits exactly; what the generators that need to see a scene are given.
using TraceFunction = std::function<void(std::span<const LspRay>, std::span<LspHit>)>;

// How far above a surface its rays start, in diagonals of the scene.
inline constexpr double kOriginOffset = 1e-4;

struct SurfacePoint {
  glm::dvec3 position;
  glm::dvec3 normal;  // unit, geometric, on the side the rays leave from
};

struct Camera {
  glm::dvec3 eye, target;
  double fov_degrees = 60;  // vertical
  uint32_t width = 512, height = 512;
};

// Points spread evenly over the area, in import order (stratified by cumulative area). Normals as the winding
// says.
std::vector<SurfacePoint> area_points(const Soup& soup, size_t count, Random& random);

// One ray through each pixel at a random place in it, row by row.
std::vector<LspRay> camera_rays(const Camera& camera, Random& random);

// Where camera rays hit, in the rays' order, misses left out; normals face the camera.
std::vector<SurfacePoint> visible_points(const Soup& soup, std::span<const LspRay> rays,
                                         std::span<const LspHit> hits);

// `per_point` rays from each point in turn, cosine-distributed about its normal, unit directions, from
// kOriginOffset above the surface. tmax as given, in scene units.
std::vector<LspRay> cosine_rays(const Soup& soup, std::span<const SurfacePoint> points, size_t per_point,
                                Random& random, double tmax = INFINITY);

// From each point in turn toward a random point of a small disc-like light at `light`; the direction spans
// the whole way, so tmax is 1 and any hit is a shadow. Points that face away are left out.
std::vector<LspRay> shadow_rays(const Soup& soup, std::span<const SurfacePoint> points, size_t per_point,
                                const glm::dvec3& light, double light_radius, Random& random);

// The indirect rays' test set: area-weighted points in double, cosine directions about the geometric normal,
// origin kOriginOffset above it, shuffled. The same for the same soup, count and seed.
std::vector<LspRay> surface_rays(const Soup& soup, size_t count, uint64_t seed);

// A camera that sees the scene well without anyone saying where: inside where the scene encloses a viewer as
// a room does, else in front of it; never within an object. Deterministic.
Camera choose_camera(const Soup& soup, const TraceFunction& trace, uint32_t width, uint32_t height);

}  // namespace lsp::bench
