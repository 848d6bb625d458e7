// What the rays of shafts hit, found by projecting triangles instead of tracing the rays.
#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <span>
#include <vector>

#include "lsp/layout.h"

namespace lsp {

// By patch: where a ray meets something, in shares of the way between the sides, and what.
struct RasterHits {
  std::span<float> t;
  std::span<uint32_t> records;
};

// Casts the rays from one point of a box's surface to a grid of points, one in each patch of another side.
// They share their origin, so that a triangle is projected onto that side once and only the rays whose end
// may lie in the projection are tested against it. A cast costs what the triangles of the box are, not the
// rays: with few triangles, as below deep nodes and in the cells of an NTree, a fraction of tracing them.
//
// Answers do not depend on the order of the triangles or on the instruction set: the nearest hit counts, of
// equal ones that of the smallest record. Edges are watertight in the sense that a ray through one hits one
// of its triangles: edge functions are triple products, whose sign is the same, seen from either side.
class ShaftRaster {
 public:
  // With more triangles than this, tracing the rays through a tree is faster.
  static constexpr size_t max_triangles(uint32_t resolution) { return size_t(16) * resolution * resolution; }
  static constexpr float kMiss = 1.0f;

  // The box is not flat; resolution is 1 to LSP_MAX_RESOLUTION. World space.
  ShaftRaster(const glm::vec3& lo, const glm::vec3& hi, uint32_t resolution);

  // `record` is what answers name the triangle by.
  void add(const LspTriangle& triangle, uint32_t record);
  size_t size() const { return records_.size(); }

  // Casts the rays from `origin`, a point of another side, to `ends`, the points (x, y) in [0, 1)^2 of the
  // patches of `face`. Spans have resolution^2 elements, by patch; kMiss and LSP_NONE where a ray meets
  // nothing.
  void cast(const glm::vec3& origin, uint32_t face, float x, float y, std::span<const glm::vec3> ends,
            const RasterHits& hits);

 private:
  glm::vec3 lo_, hi_;
  uint32_t n_;
  std::vector<float> corners_[9];     // by triangle: v0.x, v0.y, v0.z, v1.x, ...
  std::vector<uint32_t> records_;     // by triangle
  std::vector<uint32_t> covered_;     // by triangle: the patches that its projection may cover
  std::vector<float> directions_[3];  // by patch
};

}  // namespace lsp
