// Fills the tables of one cell.
#pragma once

#include <map>

#include "answer_fit.h"
#include "cell_tables.h"
#include "cell_tree.h"
#include "lsp/lsp.h"

namespace lsp {

// What all cells share.
struct CellScene {
  const CellGrid& grid;
  const lsp_scene& whole;
  std::span<const LspTriangle> triangles;
  std::span<const glm::vec3> colors;  // of materials, see Plane; empty: looks do not matter
  const CellTableOptions& options;
  float offset;  // of ray origins from the surface, world space
};

// One cell's tables before they find their place in the file.
struct FilledCell {
  uint64_t sub_mask = 0;
  std::vector<uint16_t> far, origin;  // entries
  std::vector<Plane> planes;
  std::vector<uint32_t> plane_records;
  std::vector<LspSplit> splits;
  CellTree tree;  // its references are LspTriangle
  bool overflow = false;
};
FilledCell fill_cell(const CellScene& scene, uint32_t cell);

// Cells of a grid that were filled to know how long tables become, by their number.
using FilledCells = std::map<uint32_t, FilledCell>;

// Fills the tables of the shard's cells of the grid on all threads of the current oneTBB arena; the result
// does not depend on their number, nor that of a cell on the other cells. `tree` is of the triangles. What is
// in `known` already is taken from there; with `keep` what is filled is added to it.
CellTables fill_cell_tables(const CellGrid& grid, const WideTree& tree, const LspHeader& header,
                            std::span<const LspTriangle> triangles, std::span<const LspMaterial> materials,
                            const CellTableOptions& options, FilledCells& known, bool keep,
                            const std::function<void(double)>& progress = {});

// Boxes and triangles that a ray through a cell tests in the cell's own tree, on average: what filling it
// costs grows with them.
double tests_of_ray(const CellGrid& grid, std::span<const LspTriangle> triangles, uint32_t cell);

}  // namespace lsp
