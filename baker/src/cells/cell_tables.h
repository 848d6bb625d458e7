// The tables of filled cells: a far table (Line Space) for rays that pass through, an origin table for each
// part of the cell that holds surface, for rays that begin there.
#pragma once

#include <algorithm>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "cell_grid.h"
#include "lsp/layout.h"
#include "wide_tree.h"

namespace lsp {

struct CellTableOptions {
  uint32_t far_patches = 3;      // N: patches along an edge of a cell, of far tables
  uint32_t origin_patches = 3;   // M: of origin tables
  uint32_t sub_cells = 4;        // along an edge of a cell, 1 to 4
  uint32_t far_samples = 64;     // rays of a mixed shaft
  uint32_t origin_samples = 24;  // rays of an entry of an origin table, on average, as none is settled
  bool splits = true;
};

struct CellTables {
  std::vector<LspFilledCell> cells;
  std::vector<uint32_t> entries;  // two in a word
  std::vector<LspPlane> planes;
  std::vector<uint32_t> plane_records;  // by plane: its LspTriangle
  std::vector<LspSplit> splits;
  std::vector<LspCellNode> nodes;
  std::vector<uint32_t> references;  // of leaves: LspTriangle
  uint32_t origin_entry_first = 0;
  // For the report.
  uint64_t far_entries = 0, origin_entries = 0, overflowed = 0;
};

// Fills the tables of all cells of the grid on all threads of the current oneTBB arena; the result does not
// depend on their number. `tree` is of the triangles.
CellTables fill_cell_tables(const CellGrid& grid, const WideTree& tree, const LspHeader& header,
                            std::span<const LspTriangle> triangles, std::span<const LspMaterial> materials,
                            const CellTableOptions& options,
                            const std::function<void(double)>& progress = {});

// Writes what the header states of grid and tables, but for the dial.
void set_cells(const CellGrid& grid, const CellTables& tables, const CellTableOptions& options,
               LspHeader& header);

// The number of cells on the longest side; 0 where there are none.
inline uint32_t longest_side(const LspCellGrid& grid) {
  return std::max({grid.cells_x, grid.cells_y, grid.cells_z});
}

// The class of loss that an entry states for a share of wrong answers, see LSP_LOSS_*.
uint32_t loss_class(float loss);

}  // namespace lsp
