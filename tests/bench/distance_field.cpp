#include "distance_field.h"

#include <algorithm>
#include <cmath>

#include "lsp/in_chunks.hpp"

namespace lsp::bench {
namespace {

constexpr float kReach = 64;     // steps of the grid: what is further off is stored as that far
constexpr float kMargin = 1.5f;  // steps of the grid about the bounds
// No step of a ray is shorter, in steps of the grid: along a surface it would never end. 512 bound a ray.
constexpr float kLeastStep = 0.35f;
constexpr int kMostSteps = 512;
// How much further than the threshold a ray has to have been from what it began on.
constexpr float kAway = 1.2f;

class FieldTracer : public Tracer {
 public:
  FieldTracer(const DistanceField& field, float threshold, unsigned threads)
      : field_(field), threshold_(threshold), threads_(threads) {}
  std::string name() const override { return "distance field"; }
  double trace(const Mode&, std::span<const LspRay> rays, std::span<LspHit> hits) override {
    return run_in_chunks(rays.size(), threads_, [&](size_t first, size_t count) {
      uint64_t steps = 0;
      for (size_t i = first; i < first + count; ++i) hits[i] = field_.trace(rays[i], threshold_, &steps);
    });
  }

 private:
  const DistanceField& field_;
  float threshold_;
  unsigned threads_;
};

glm::vec3 vec_of(const lsp_float3& v) { return {v.x, v.y, v.z}; }

}  // namespace

DistanceField::DistanceField(const Soup& soup, const EmbreeScene& embree, unsigned samples,
                             unsigned threads) {
  const glm::vec3 lo(soup.lo), extent(soup.hi - soup.lo);
  step_ = std::max({extent.x, extent.y, extent.z}) / static_cast<float>(samples - 1 - 2 * kMargin);
  lo_ = lo - kMargin * step_;
  for (int axis = 0; axis < 3; ++axis)
    size_[axis] = static_cast<uint32_t>(std::ceil(extent[axis] / step_ - 1e-3f + 2 * kMargin)) + 1;
  hi_ = lo_ + step_ * glm::vec3(size_ - 1u);
  const float reach = kReach * step_;
  for (size_t i = 0; i < distance_of_.size(); ++i) {
    const float share = static_cast<float>(i) / 255;
    distance_of_[i] = share * share * reach;
  }
  samples_.resize(size_t{size_.x} * size_.y * size_.z);
  const size_t rows = size_t{size_.y} * size_.z;
  bake_seconds_ = run_in_chunks(rows, threads, [&](size_t first, size_t count) {
    for (size_t row = first; row < first + count; ++row) {
      float nearby = reach;  // a neighbour's distance bounds this one's, and with it the search
      for (uint32_t x = 0; x < size_.x; ++x) {
        const glm::vec3 at(static_cast<float>(x), static_cast<float>(row % size_.y),
                           static_cast<float>(row / size_.y));
        nearby = embree.distance(lo_ + step_ * at, std::min(reach, nearby + 1.01f * step_));
        samples_[row * size_.x + x] = static_cast<uint8_t>(std::lround(255 * std::sqrt(nearby / reach)));
      }
    }
  });
}

float DistanceField::distance(const glm::vec3& point) const {
  const glm::vec3 at = (point - lo_) / step_;
  const glm::uvec3 cell = glm::min(glm::uvec3(glm::max(at, glm::vec3(0))), size_ - 2u);
  const glm::vec3 share = at - glm::vec3(cell);
  const uint8_t* corner = &samples_[(size_t{cell.z} * size_.y + cell.y) * size_.x + cell.x];
  const auto along_x = [&](const uint8_t* pair) {
    return glm::mix(distance_of_[pair[0]], distance_of_[pair[1]], share.x);
  };
  const size_t row = size_.x, slice = size_t{size_.x} * size_.y;
  const float front = glm::mix(along_x(corner), along_x(corner + row), share.y);
  const float back = glm::mix(along_x(corner + slice), along_x(corner + slice + row), share.y);
  return glm::mix(front, back, share.z);
}

LspHit DistanceField::trace(const LspRay& ray, float threshold, uint64_t* steps) const {
  const glm::vec3 origin = vec_of(ray.origin), direction = vec_of(ray.direction);
  const LspHit miss{INFINITY, LSP_NONE, 0, 0, {0, 0, 0}, 0};
  // Where the ray is inside the grid.
  const glm::vec3 near = (lo_ - origin) / direction, far = (hi_ - origin) / direction;
  float t = ray.tmin, end = ray.tmax;
  for (int axis = 0; axis < 3; ++axis) {
    if (direction[axis] == 0 && (origin[axis] < lo_[axis] || origin[axis] > hi_[axis])) return miss;
    if (direction[axis] == 0) continue;
    t = std::max(t, std::min(near[axis], far[axis]));
    end = std::min(end, std::max(near[axis], far[axis]));
  }
  const float per_length = 1 / glm::length(direction), within = threshold * step_;
  bool away = false;
  for (int k = 0; k < kMostSteps && t < end; ++k) {
    ++*steps;
    const float here = distance(origin + t * direction);
    away = away || here > kAway * within;
    // The surface is about half the threshold on from where the ray came within it.
    if (away && here < within) return {std::min(t + 0.5f * within * per_length, end), 0, 0, 0, {0, 0, 0}, 0};
    t += std::max(here, kLeastStep * step_) * per_length;
  }
  return miss;
}

std::unique_ptr<Tracer> field_tracer(const DistanceField& field, float threshold, unsigned threads) {
  return std::make_unique<FieldTracer>(field, threshold, threads);
}

}  // namespace lsp::bench
