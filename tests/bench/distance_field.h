// The peer that engines know where there is no ray tracing hardware: an unsigned distance field of the scene
// on a regular grid, 8 bits a sample, sphere traced (Hart, "Sphere Tracing", 1996) with trilinear look-ups.
//
//   sample = 255 sqrt(distance / (64 steps of the grid)): fine near surfaces, where hits are decided, coarse
//   far
#pragma once

#include <array>
#include <memory>
#include <vector>

#include "embree_scene.h"
#include "tracer.h"

namespace lsp::bench {

class DistanceField {
 public:
  // `samples` on the scene's longest side, at least 8, with a margin of one step and a half about its bounds.
  // Distances are Embree's point queries, on `threads`.
  DistanceField(const Soup& soup, const EmbreeScene& embree, unsigned samples, unsigned threads);

  // The first place on the ray that is within `threshold` steps of the grid of a surface, once the ray has
  // been further than that from one: it begins on one. Primitive 0, since a field knows none, and no normal.
  // Adds to *steps the look-ups that took.
  LspHit trace(const LspRay& ray, float threshold, uint64_t* steps) const;

  float distance(const glm::vec3& point) const;  // interpolated; `point` lies inside the grid
  float step() const { return step_; }           // of the grid
  glm::uvec3 size() const { return size_; }      // samples along each axis
  size_t bytes() const { return samples_.size(); }
  double bake_seconds() const { return bake_seconds_; }

 private:
  glm::vec3 lo_, hi_;  // of what is interpolated
  float step_ = 0;
  glm::uvec3 size_{0};
  std::array<float, 256> distance_of_{};  // by sample
  std::vector<uint8_t> samples_;          // x fastest
  double bake_seconds_ = 0;
};

// Rays of `field`, which outlives the tracer, at a threshold.
std::unique_ptr<Tracer> field_tracer(const DistanceField& field, float threshold, unsigned threads);

}  // namespace lsp::bench
