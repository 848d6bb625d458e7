#include "leaks.h"

#include <algorithm>
#include <cmath>

namespace lsp::bench {
namespace {

// Where the line from `origin` first meets the triangle's plane inside the triangle; infinity without a hit.
// For placing interior points only: what is near an edge does not matter here.
double hit_distance(const std::array<glm::vec3, 3>& c, const glm::dvec3& origin,
                    const glm::dvec3& direction) {
  const glm::dvec3 a = glm::dvec3(c[0]) - origin, b = glm::dvec3(c[1]) - origin,
                   d = glm::dvec3(c[2]) - origin;
  const glm::dvec3 normal = glm::cross(b - a, d - a);
  const double slope = glm::dot(normal, direction);
  const double wa = glm::dot(direction, glm::cross(d, b));
  const double wb = glm::dot(direction, glm::cross(a, d));
  const double wc = glm::dot(direction, glm::cross(b, a));
  const bool inside = (wa >= 0 && wb >= 0 && wc >= 0) || (wa <= 0 && wb <= 0 && wc <= 0);
  if (!inside || slope == 0) return INFINITY;
  const double t = glm::dot(normal, a) / slope;
  return t > 0 ? t : INFINITY;
}

// Sum of the triangles' signed solid angles over 4 pi (van Oosterom and Strackee 1983).
double winding_number(const Soup& soup, const glm::dvec3& point) {
  double sum = 0;
  for (const auto& corners : soup.corners) {
    const glm::dvec3 a = glm::dvec3(corners[0]) - point, b = glm::dvec3(corners[1]) - point,
                     c = glm::dvec3(corners[2]) - point;
    const double la = glm::length(a), lb = glm::length(b), lc = glm::length(c);
    sum += 2 * std::atan2(glm::dot(a, glm::cross(b, c)),
                          la * lb * lc + glm::dot(a, b) * lc + glm::dot(b, c) * la + glm::dot(c, a) * lb);
  }
  return sum / (4 * 3.14159265358979323846);
}

LspRay ray_to(const glm::dvec3& origin, const glm::dvec3& target) {
  const glm::vec3 from(origin), way(glm::dvec3(glm::vec3(target)) - glm::dvec3(from));
  return {{from.x, from.y, from.z}, 0.0f, {way.x, way.y, way.z}, INFINITY};
}

// Corners and edge middles of every step-th triangle.
template <typename Visit>
void for_targets(const Soup& soup, size_t count, Visit visit) {
  const size_t triangles = std::max<size_t>(1, count / 6);
  const size_t step = std::max<size_t>(1, (soup.size() + triangles - 1) / triangles);
  for (size_t i = 0; i < soup.size(); i += step) {
    for (size_t k = 0; k < 3; ++k) {
      const glm::dvec3 corner(soup.corners[i][k]), next(soup.corners[i][(k + 1) % 3]);
      visit(3 * i + k, false, corner);
      visit(3 * i + k, true, 0.5 * (corner + next));
    }
  }
}

}  // namespace

std::vector<glm::dvec3> interior_points(const Soup& soup, size_t count, Random& random) {
  std::vector<glm::dvec3> points;
  for (const SurfacePoint& surface : area_points(soup, 4 * count, random)) {
    if (points.size() == count) break;
    double nearest = INFINITY;
    const glm::dvec3 start = surface.position - 1e-6 * soup.diagonal * surface.normal;
    for (const auto& corners : soup.corners) {
      nearest = std::min(nearest, hit_distance(corners, start, -surface.normal));
    }
    if (!std::isfinite(nearest) || nearest < 1e-3 * soup.diagonal) continue;
    const glm::dvec3 point(glm::vec3(start - 0.5 * nearest * surface.normal));
    if (std::abs(std::abs(winding_number(soup, point)) - 1) < 1e-3) points.push_back(point);
  }
  return points;
}

std::vector<LspRay> inside_leak_rays(const Soup& soup, const std::vector<glm::dvec3>& origins, size_t count) {
  std::vector<LspRay> rays;
  if (origins.empty()) return rays;
  for_targets(soup, count, [&](size_t, bool, const glm::dvec3& target) {
    rays.push_back(ray_to(origins[rays.size() % origins.size()], target));
  });
  return rays;
}

std::vector<LspRay> outside_leak_rays(const Soup& soup, size_t count, Random& random) {
  // Triangles around each vertex, as one array with offsets.
  const std::vector<uint32_t> vertex = weld(soup);
  const uint32_t vertex_count = vertex.empty() ? 0 : *std::max_element(vertex.begin(), vertex.end()) + 1;
  std::vector<uint32_t> first(vertex_count + 1, 0), around(vertex.size());
  for (uint32_t v : vertex) ++first[v + 1];
  for (uint32_t v = 0; v < vertex_count; ++v) first[v + 1] += first[v];
  std::vector<uint32_t> next(first.begin(), first.end() - 1);
  for (size_t corner = 0; corner < vertex.size(); ++corner) {
    around[next[vertex[corner]]++] = static_cast<uint32_t>(corner / 3);
  }

  std::vector<LspRay> rays;
  const glm::dvec3 centre = 0.5 * (soup.lo + soup.hi);
  for_targets(soup, count, [&](size_t corner, bool edge, const glm::dvec3& target) {
    glm::dvec3 away(2 * random.uniform() - 1, 2 * random.uniform() - 1, 2 * random.uniform() - 1);
    if (glm::length(away) < 1e-2) away = glm::dvec3(1, 0, 0);
    const LspRay ray = ray_to(centre + 1.5 * soup.diagonal * glm::normalize(away), target);
    const glm::dvec3 direction =
        glm::normalize(glm::dvec3(ray.direction.x, ray.direction.y, ray.direction.z));
    const uint32_t v = vertex[corner];
    const uint32_t other = vertex[corner - corner % 3 + (corner % 3 + 1) % 3];
    double least = 1, greatest = -1;
    for (uint32_t k = first[v]; k < first[v + 1]; ++k) {
      const uint32_t triangle = around[k];
      if (edge) {
        const bool shares = vertex[3 * triangle] == other || vertex[3 * triangle + 1] == other ||
                            vertex[3 * triangle + 2] == other;
        if (!shares) continue;
      }
      const glm::dvec3 normal = geometric_normal(soup.corners[triangle]);
      const double facing = glm::dot(glm::normalize(normal), direction);
      least = std::min(least, facing);
      greatest = std::max(greatest, facing);
    }
    if (least > 0.05 || greatest < -0.05) rays.push_back(ray);
  });
  return rays;
}

}  // namespace lsp::bench
