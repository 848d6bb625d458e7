#include "viewpoints.h"

#include <algorithm>
#include <cmath>

namespace lsp::bench {
namespace {

constexpr uint32_t kThumbnail = 24;  // pixels on a side
constexpr double kNear = 0.25;       // of the diagonal: what is further off counts less
constexpr size_t kPlaces = 192;

struct Pixel {
  double depth = INFINITY;
  glm::dvec3 normal{0};  // towards the eye
  bool front = false;
};

std::vector<Pixel> thumbnail(const Soup& soup, const TraceFunction& trace, const Camera& camera) {
  Camera small = camera;
  small.width = small.height = kThumbnail;
  Random random(23);
  const std::vector<LspRay> rays = camera_rays(small, random);
  std::vector<LspHit> hits(rays.size());
  trace(rays, hits);
  std::vector<Pixel> pixels(rays.size());
  for (size_t i = 0; i < rays.size(); ++i) {
    if (hits[i].primitive == LSP_NONE) continue;
    const glm::dvec3 direction(rays[i].direction.x, rays[i].direction.y, rays[i].direction.z);
    glm::dvec3 normal = glm::normalize(geometric_normal(soup.corners[soup.triangle_of[hits[i].primitive]]));
    const bool front = glm::dot(normal, direction) < 0;
    pixels[i] = {hits[i].t, front ? normal : -normal, front};
  }
  return pixels;
}

// How different two neighbours look, in [0, 1], less where both are far.
double contrast(const Pixel& a, const Pixel& b, double diagonal) {
  const double nearest = std::min(a.depth, b.depth);
  if (!std::isfinite(nearest)) return 0;
  const double weight = std::min(1.0, kNear * diagonal / nearest);
  if (!std::isfinite(std::max(a.depth, b.depth))) return weight;  // an outline before the sky
  const double turned = 1 - glm::dot(a.normal, b.normal);
  const double stepped = std::abs(std::log(a.depth / b.depth)) / std::log(1.25);
  return weight * std::min(1.0, std::max(turned, stepped * stepped));
}

double detail_in(const std::vector<Pixel>& pixels, double diagonal) {
  double sum = 0;
  for (uint32_t y = 0; y + 1 < kThumbnail; ++y) {
    for (uint32_t x = 0; x + 1 < kThumbnail; ++x) {
      const Pixel& here = pixels[y * kThumbnail + x];
      sum += contrast(here, pixels[y * kThumbnail + x + 1], diagonal);
      sum += contrast(here, pixels[(y + 1) * kThumbnail + x], diagonal);
    }
  }
  return sum / (2.0 * (kThumbnail - 1) * (kThumbnail - 1));
}

// Is there something to look at, seen from without, and nothing right before the eye?
bool is_a_view(const std::vector<Pixel>& pixels, double distance) {
  size_t seen = 0, fronts = 0, blocked = 0;
  for (const Pixel& pixel : pixels) {
    seen += std::isfinite(pixel.depth);
    fronts += pixel.front;
    blocked += pixel.depth < 0.25 * distance;
  }
  return 3 * seen >= 2 * pixels.size() && 4 * fronts >= 3 * seen && 20 * blocked <= pixels.size();
}

// In front of the point at that distance, a little aside of its normal so that surfaces are seen at an angle.
Camera in_front_of(const SurfacePoint& point, double distance, Random& random) {
  const glm::dvec3 aside(random.uniform() - 0.5, random.uniform() - 0.5, random.uniform() - 0.5);
  Camera camera;
  camera.eye = point.position + distance * glm::normalize(point.normal + 1.2 * aside);
  camera.target = point.position;
  return camera;
}

bool sees(const TraceFunction& trace, const Camera& camera) {
  const glm::dvec3 way = camera.target - camera.eye;
  LspRay ray{};
  ray.origin = {static_cast<float>(camera.eye.x), static_cast<float>(camera.eye.y),
                static_cast<float>(camera.eye.z)};
  ray.direction = {static_cast<float>(way.x), static_cast<float>(way.y), static_cast<float>(way.z)};
  ray.tmax = 0.98f;
  LspHit hit{};
  trace({&ray, 1}, {&hit, 1});
  return hit.primitive == LSP_NONE;
}

}  // namespace

double detail_of(const Soup& soup, const TraceFunction& trace, const Camera& camera) {
  return detail_in(thumbnail(soup, trace, camera), soup.diagonal);
}

Camera choose_close_camera(const Soup& soup, const TraceFunction& trace, const Camera& otherwise) {
  Random random(29);
  std::vector<SurfacePoint> points = area_points(soup, kPlaces, random);
  Camera best = otherwise;
  double most = 0;
  for (const SurfacePoint& point : points) {
    for (const double share : {0.06, 0.12}) {
      Camera camera = in_front_of(point, share * soup.diagonal, random);
      camera.width = otherwise.width;
      camera.height = otherwise.height;
      if (!sees(trace, camera)) continue;
      const std::vector<Pixel> pixels = thumbnail(soup, trace, camera);
      if (!is_a_view(pixels, share * soup.diagonal)) continue;
      const double detail = detail_in(pixels, soup.diagonal);
      if (detail > most) {
        most = detail;
        best = camera;
      }
    }
  }
  return best;
}

}  // namespace lsp::bench
