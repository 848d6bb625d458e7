// Divides a node by a plane, which cuts the triangles on it in two (Stich et al. 2009, see bvh.h).
#pragma once

#include <array>
#include <vector>

#include "bvh_split.h"
#include "mesh.h"
#include "triangle_cut.h"

namespace lsp {

struct SpatialSplit {
  double cost = INFINITY;
  int axis = 0;
  float plane = 0;
  size_t left = 0, right = 0;
};

class SpatialSplitter {
 public:
  // `mesh` must outlive it.
  SpatialSplitter(const Mesh& mesh, double triangle_cost) : mesh_(mesh), triangle_cost_(triangle_cost) {}

  const glm::vec3& corner(uint32_t triangle, int c) const {
    return mesh_.positions[mesh_.triangles[triangle][c]];
  }

  // Leaves of a reference's box what is inside another one; all of it where rounding leaves nothing.
  void clip(Reference& r, const Box& within) const;

  // The best split that costs less than `limit`; where there is none, one that costs as much or infinitely
  // much.
  SpatialSplit find(const std::vector<Reference>& references, const Box& bounds, double limit) const;

  // Where both sides end up with everything, slivers lie along the plane.
  void split(const std::vector<Reference>& references, const SpatialSplit& split,
             std::vector<Reference>& left, std::vector<Reference>& right) const;

 private:
  struct SpatialBins;

  TriangleCut cut_of(uint32_t triangle, int axis) const {
    return {{&corner(triangle, 0), &corner(triangle, 1), &corner(triangle, 2)}, axis};
  }
  void cut(const Reference& r, int axis, float plane, Box& left, Box& right) const;
  void add_corners(const std::vector<Reference>& references, std::array<SpatialBins, 3>& bins) const;
  void add_cuts(const std::vector<Reference>& references, int axis, SpatialBins& bins) const;
  double least_cost(size_t count, int axis, const SpatialBins& bins) const;
  void try_planes(const std::vector<Reference>& references, int axis, const SpatialBins& bins,
                  SpatialSplit& best) const;

  const Mesh& mesh_;
  const double triangle_cost_;
};

}  // namespace lsp
