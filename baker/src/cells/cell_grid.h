// The grid of the base structure "cells": equal cubes over the scene, those that hold surface and how far the
// others are from them.
//
// In the paper's terms an NTree of one level (section 3.2); the jump over empty cells is Cohen, Sheffer,
// "Proximity Clouds: An Acceleration Technique for 3D Grid Traversal", 1994, with Chebyshev distances.
#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <span>
#include <vector>

#include "box.h"
#include "lsp/layout.h"

namespace lsp {

struct Cell {
  glm::ivec3 at;          // coordinates in the grid
  uint32_t first, count;  // its triangles: CellGrid::records
};

struct CellGrid {
  glm::vec3 lo{0};  // lower corner of cell (0, 0, 0), world space
  float size = 1;   // edge of a cell
  glm::ivec3 dims{0};
  bool crowded = false;         // finer than the scene wants, for the sake of its fullest cell
  float margin = 0;             // a cell also holds what comes within this distance of it
  std::vector<uint32_t> words;  // of every cell, see LspCell: LSP_CELL_FILLED | index, or its jump
  std::vector<Cell> cells;      // filled ones, in the order of the grid
  std::vector<uint32_t>
      records;  // indices of LspTriangle, of each cell ascending; no primitive twice in a cell

  size_t index(const glm::ivec3& c) const {
    return (size_t(c.z) * size_t(dims.y) + size_t(c.y)) * size_t(dims.x) + size_t(c.x);
  }
  glm::vec3 corner(const glm::ivec3& c) const { return lo + glm::vec3(c) * size; }
};

// As many triangles as the tree of a cell can name: the last reference is not among them, for a leaf of four
// there is LSP_CELL_NO_CHILD.
constexpr size_t kMostInCell = LSP_CELL_MAX_REFERENCES - 1;

// `longest` cells lie along the longest side of `bounds`, which holds all triangles. Runs on all threads of
// the current oneTBB arena; the result does not depend on their number. Throws Failure with Exit::kLimit
// where a cell holds more than kMostInCell triangles.
CellGrid build_cell_grid(std::span<const LspTriangle> triangles, const Box& bounds, uint32_t longest);

// With as many cells as the scene wants: about kWantedCells of them filled, or as many as it has triangles
// for, no more than `most`, and more only where a cell would be too full, up to some kMostCells: throws as
// above where that does not help.
CellGrid choose_cell_grid(std::span<const LspTriangle> triangles, const Box& bounds, size_t most);

}  // namespace lsp
