// Divides a node's references by their centres: binned surface area heuristic (Wald 2007, see bvh.h).
#pragma once

#include <vector>

#include "bvh_split.h"

namespace lsp {

struct ObjectSplit {
  double cost = INFINITY;  // of the children; infinite: all centres are one
  int axis = 0;
  int bin = 0;  // references of bins below it go left
  Box4 overlap;
};

ObjectSplit find_object_split(const std::vector<Reference>& references, double triangle_cost);

// Leaves those on the left where they are, so that `references` is moved from.
void split_objects(std::vector<Reference>& references, const ObjectSplit& split, std::vector<Reference>& left,
                   std::vector<Reference>& right);

}  // namespace lsp
