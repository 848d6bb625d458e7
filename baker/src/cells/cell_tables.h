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
#include "shard/shard.h"
#include "wide_tree.h"

namespace lsp {

struct CellTableOptions {
  uint32_t far_patches = 3;      // N: patches along an edge of a cell, of far tables
  uint32_t origin_patches = 3;   // M: of origin tables
  uint32_t sub_cells = 4;        // along an edge of a cell, 1 to 4
  uint32_t far_samples = 64;     // rays of a mixed shaft
  uint32_t origin_samples = 24;  // rays of an entry of an origin table, on average, as none is settled
  bool splits = true;
  Shard shard;  // the cells that are filled
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
};

// What one cell owns of them.
struct CellPieces {
  uint64_t sub_mask = 0;
  uint32_t root = LSP_CELL_NO_CHILD;
  std::span<const uint32_t> far, origin;  // entries, two in a word
  std::span<const LspPlane> planes;
  std::span<const uint32_t> plane_records;
  std::span<const LspSplit> splits;
  std::span<const LspCellNode> nodes;
  std::span<const uint32_t> references;
};

// Puts tables together, cell after cell.
class CellTablesBuilder {
 public:
  void add(const CellPieces& cell);
  CellTables finish();  // once

 private:
  CellTables tables_;
  std::vector<uint32_t> origins_;  // words of origin tables, which follow all far ones
  uint32_t subs_ = 0;
};

// Words of a cell's far table, and of each of its origin tables.
inline uint64_t far_words(uint64_t patches) { return 15 * patches * patches * patches * patches; }
inline uint64_t origin_words(uint64_t patches) { return 3 * patches * patches; }

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
