#include "rays.h"

#include <algorithm>
#include <cmath>

namespace lsp::bench {
namespace {

lsp_float3 to_float3(const glm::dvec3& v) {
  return {static_cast<float>(v.x), static_cast<float>(v.y), static_cast<float>(v.z)};
}

// Uniform in the unit disc by rejection: exact arithmetic and square roots only, so that no library's sine
// decides what the rays are.
glm::dvec2 in_disc(Random& random) {
  for (;;) {
    const glm::dvec2 p(2 * random.uniform() - 1, 2 * random.uniform() - 1);
    if (glm::dot(p, p) < 1) return p;
  }
}

// Two unit vectors that complete the unit vector n (Duff et al. 2017).
std::pair<glm::dvec3, glm::dvec3> basis(const glm::dvec3& n) {
  const double sign = n.z >= 0 ? 1.0 : -1.0;
  const double a = -1 / (sign + n.z);
  const double b = n.x * n.y * a;
  return {{1 + sign * n.x * n.x * a, sign * b, -sign * n.x}, {b, sign + n.y * n.y * a, -n.y}};
}

// Malley's method: a point of the disc, lifted to the hemisphere.
glm::dvec3 cosine_direction(const glm::dvec3& n, Random& random) {
  const glm::dvec2 p = in_disc(random);
  const auto [u, v] = basis(n);
  return p.x * u + p.y * v + std::sqrt(std::max(0.0, 1 - glm::dot(p, p))) * n;
}

glm::dvec3 point_in(const std::array<glm::vec3, 3>& corners, Random& random) {
  const double root = std::sqrt(random.uniform());
  const double v = random.uniform() * root;
  const double u = root - v;  // weights 1 - root, u, v
  return (1 - root) * glm::dvec3(corners[0]) + u * glm::dvec3(corners[1]) + v * glm::dvec3(corners[2]);
}

LspRay ray(const glm::dvec3& origin, const glm::dvec3& direction, double tmax) {
  return {to_float3(origin), 0.0f, to_float3(direction), static_cast<float>(tmax)};
}

// Does a viewer there stand in a room? Surfaces in two thirds of all directions, and a quarter of them at
// least with their front: a closed object seen from within shows none, a room of careless winding some.
bool encloses(const Soup& soup, const TraceFunction& trace, const glm::dvec3& eye) {
  Random random(11);
  std::vector<LspRay> rays;
  while (rays.size() < 128) {
    const glm::dvec3 p(2 * random.uniform() - 1, 2 * random.uniform() - 1, 2 * random.uniform() - 1);
    const double square = glm::dot(p, p);
    if (square < 1 && square > 1e-6) rays.push_back(ray(eye, p, INFINITY));
  }
  std::vector<LspHit> hits(rays.size());
  trace(rays, hits);
  size_t seen = 0, fronts = 0;
  for (size_t i = 0; i < rays.size(); ++i) {
    if (hits[i].primitive == LSP_NONE) continue;
    ++seen;
    const glm::dvec3 normal = geometric_normal(soup.corners[soup.triangle_of[hits[i].primitive]]);
    const lsp_float3& d = rays[i].direction;
    fronts += glm::dot(normal, glm::dvec3(d.x, d.y, d.z)) < 0;
  }
  return 3 * seen >= 2 * rays.size() && 4 * fronts >= seen;
}

}  // namespace

std::vector<SurfacePoint> area_points(const Soup& soup, size_t count, Random& random) {
  std::vector<double> cumulative(soup.size());
  double area = 0;
  for (size_t i = 0; i < soup.size(); ++i) {
    area += glm::length(geometric_normal(soup.corners[i]));
    cumulative[i] = area;
  }
  std::vector<SurfacePoint> points;
  if (!(area > 0)) return points;
  points.reserve(count);
  for (size_t i = 0; i < count; ++i) {
    const double wanted = area * (static_cast<double>(i) + random.uniform()) / static_cast<double>(count);
    auto triangle = static_cast<size_t>(std::upper_bound(cumulative.begin(), cumulative.end(), wanted) -
                                        cumulative.begin());
    triangle = std::min(triangle, soup.size() - 1);
    const glm::dvec3 normal = geometric_normal(soup.corners[triangle]);
    points.push_back({point_in(soup.corners[triangle], random), glm::normalize(normal)});
  }
  return points;
}

std::vector<LspRay> camera_rays(const Camera& camera, Random& random) {
  const glm::dvec3 forward = glm::normalize(camera.target - camera.eye);
  const glm::dvec3 up = std::abs(forward.y) < 0.999 ? glm::dvec3(0, 1, 0) : glm::dvec3(0, 0, 1);
  const glm::dvec3 right = glm::normalize(glm::cross(forward, up));
  const glm::dvec3 above = glm::cross(right, forward);
  const double half_height = std::tan(camera.fov_degrees * (3.14159265358979323846 / 360));
  const double half_width = half_height * camera.width / camera.height;
  std::vector<LspRay> rays;
  rays.reserve(size_t{camera.width} * camera.height);
  for (uint32_t y = 0; y < camera.height; ++y) {
    for (uint32_t x = 0; x < camera.width; ++x) {
      const double sx = (2 * (x + random.uniform()) / camera.width - 1) * half_width;
      const double sy = (1 - 2 * (y + random.uniform()) / camera.height) * half_height;
      rays.push_back(ray(camera.eye, glm::normalize(forward + sx * right + sy * above), INFINITY));
    }
  }
  return rays;
}

std::vector<SurfacePoint> visible_points(const Soup& soup, std::span<const LspRay> rays,
                                         std::span<const LspHit> hits) {
  std::vector<SurfacePoint> points;
  points.reserve(rays.size());
  for (size_t i = 0; i < rays.size(); ++i) {
    if (hits[i].primitive == LSP_NONE) continue;
    const glm::dvec3 origin(rays[i].origin.x, rays[i].origin.y, rays[i].origin.z);
    const glm::dvec3 direction(rays[i].direction.x, rays[i].direction.y, rays[i].direction.z);
    glm::dvec3 normal = glm::normalize(geometric_normal(soup.corners[soup.triangle_of[hits[i].primitive]]));
    if (glm::dot(normal, direction) > 0) normal = -normal;
    points.push_back({origin + double{hits[i].t} * direction, normal});
  }
  return points;
}

std::vector<LspRay> cosine_rays(const Soup& soup, std::span<const SurfacePoint> points, size_t per_point,
                                Random& random, double tmax) {
  std::vector<LspRay> rays;
  rays.reserve(points.size() * per_point);
  for (const SurfacePoint& point : points) {
    const glm::dvec3 origin = point.position + kOriginOffset * soup.diagonal * point.normal;
    for (size_t k = 0; k < per_point; ++k) {
      rays.push_back(ray(origin, cosine_direction(point.normal, random), tmax));
    }
  }
  return rays;
}

std::vector<LspRay> shadow_rays(const Soup& soup, std::span<const SurfacePoint> points, size_t per_point,
                                const glm::dvec3& light, double light_radius, Random& random) {
  std::vector<LspRay> rays;
  rays.reserve(points.size() * per_point);
  for (const SurfacePoint& point : points) {
    const glm::dvec3 origin = point.position + kOriginOffset * soup.diagonal * point.normal;
    for (size_t k = 0; k < per_point; ++k) {
      const auto [u, v] = basis(glm::normalize(light - origin));
      const glm::dvec2 p = light_radius * in_disc(random);
      const glm::dvec3 way = light + p.x * u + p.y * v - origin;
      if (glm::dot(way, point.normal) <= 0) continue;
      rays.push_back(ray(origin, way, 1));
    }
  }
  return rays;
}

std::vector<LspRay> surface_rays(const Soup& soup, size_t count, uint64_t seed) {
  Random random(seed);
  const std::vector<SurfacePoint> points = area_points(soup, count, random);
  std::vector<LspRay> rays = cosine_rays(soup, points, 1, random);
  shuffle(rays, random);
  return rays;
}

Camera choose_camera(const Soup& soup, const TraceFunction& trace, uint32_t width, uint32_t height) {
  // How a picture from each candidate would look, at thumbnail size: of those that see surfaces almost
  // everywhere (a room from the inside), the one with the widest view wins.
  const glm::dvec3 extent = soup.hi - soup.lo;
  const glm::dvec3 centre = 0.5 * (soup.lo + soup.hi);
  Random random(7);
  Camera best;
  double best_score = 0;
  for (int candidate = 0; candidate < 48; ++candidate) {
    const glm::dvec3 at(0.12 + 0.76 * random.uniform(), 0.15 + 0.4 * random.uniform(),
                        0.12 + 0.76 * random.uniform());
    Camera camera{soup.lo + at * extent, centre, 65, 16, 16};
    camera.target.y = camera.eye.y + 0.3 * (centre.y - camera.eye.y);
    if (glm::length(camera.target - camera.eye) < 0.02 * soup.diagonal) continue;
    const std::vector<LspRay> rays = camera_rays(camera, random);
    std::vector<LspHit> hits(rays.size());
    trace(rays, hits);
    if (!encloses(soup, trace, camera.eye)) continue;
    std::vector<double> distances;
    for (size_t i = 0; i < rays.size(); ++i) {
      if (hits[i].primitive == LSP_NONE) continue;
      distances.push_back(hits[i].t);
    }
    if (distances.size() < rays.size() * 97 / 100) continue;
    std::sort(distances.begin(), distances.end());
    const double score = distances[distances.size() / 10] + 0.3 * distances[distances.size() / 2];
    if (score > best_score) {
      best_score = score;
      best = camera;
    }
  }
  if (best_score < 0.04 * soup.diagonal) {
    // Nothing encloses a viewer: look at the whole from in front, a little from the right and above.
    best.fov_degrees = 40;
    best.target = centre;
    best.eye = centre + 1.25 * soup.diagonal * glm::normalize(glm::dvec3(0.45, 0.35, 1));
  }
  best.width = width;
  best.height = height;
  return best;
}

}  // namespace lsp::bench
