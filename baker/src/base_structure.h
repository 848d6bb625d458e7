// The base structures that a bake may have: of each, how it is built, what it fills and what it states.
#pragma once

#include <cstdint>
#include <functional>

#include "bake.h"
#include "box.h"
#include "cells/cell_filler.h"

namespace lsp {

// What a base structure is built from, and where to: triangles, bounds and what the header says of the BVH
// are there.
struct BakeJob {
  const BakeOptions& options;
  const Progress& progress;
  Bvh bvh;
  Box bounds;
  Baked& baked;
  FilledCells known_cells = {};  // of its grid

  std::function<void(double)> stage(const char* name) const {
    return [&progress = progress, name](double done) {
      if (progress) progress(name, done);
    };
  }
};

struct BaseStructure {
  uint32_t feature;        // LSP_FEATURE_*, 0: none of its own
  bool repeats_triangles;  // spatial splits may make several records of a triangle
  bool has_wide_nodes;     // exact rays walk them, not the BVH
  // How many nodes may carry a Line Space at a depth, for an estimate of memory.
  uint64_t (*nodes_at)(const BakeOptions& options, uint32_t depth);
  void (*build)(BakeJob& job);   // the structure, and what the header states of it
  void (*fill)(BakeJob& job);    // its tables, then the BVH's nodes where they are a section
  void (*finish)(BakeJob& job);  // what needs a bake that can be traced; null: nothing
};

const BaseStructure& base_structure(Base base);

}  // namespace lsp
