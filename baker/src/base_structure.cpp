#include "base_structure.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "cells/cell_filler.h"
#include "cells/closed_ways.h"
#include "cells/dial.h"
#include "lsp/program.h"
#include "sites.h"

namespace lsp {
namespace {

uint64_t bvh_nodes_at(const BakeOptions&, uint32_t depth) { return 1ull << std::min(depth, 40u); }

uint64_t ntree_nodes_at(const BakeOptions& options, uint32_t depth) {
  const uint64_t b = options.ntree.branching;
  return depth == 0 ? 1 : depth == 1 ? b * b * b : 1ull << 40;
}

// Line Spaces on `sites`, which are nodes of `tree`.
template <class Tree>
void fill_sites(BakeJob& job, Tree& tree, const std::vector<LineSpaceSite>& sites) {
  const LineSpaceOptions& options = job.options.line_space;
  Baked& baked = job.baked;
  LspHeader& h = baked.header;
  std::vector<uint32_t> references;
  baked.line_spaces =
      fill_line_spaces(job.bvh, h, baked.triangles, sites, options, references, job.stage("Line Spaces"));
  h.root_line_space = attach(tree, sites, references);
  h.resolution = options.resolution;
  h.line_space_depth = options.depths.back();
  h.line_space_triangles = options.triangles;
  const LineSpaces& ls = baked.line_spaces;
  baked.skipped.push_back("empty shafts: " + with_commas(ls.shafts - ls.filled) + " of " +
                          with_commas(ls.shafts));
  if (ls.dropped) baked.skipped.push_back("Line Spaces without a filled shaft: " + with_commas(ls.dropped));
}

void note_no_line_spaces(Baked& baked) { baked.skipped.push_back("Line Spaces: not asked for"); }

void build_bvh_base(BakeJob& job) { job.baked.header.base_structure = LSP_BASE_BVH; }

void fill_bvh(BakeJob& job) {
  if (job.options.line_spaces)
    fill_sites(job, job.bvh, choose_sites(job.bvh, job.baked.header, job.options.line_space));
  else
    note_no_line_spaces(job.baked);
  job.baked.nodes = std::move(job.bvh.nodes);
}

void build_ntree_base(BakeJob& job) {
  NTreeOptions options = job.options.ntree;
  if (job.options.memory_limit) options.max_bytes = job.options.memory_limit / 4;
  const NTree& ntree = job.baked.ntree = build_ntree(job.baked.triangles, options, job.stage("NTree"));
  LspHeader& h = job.baked.header;
  h.base_structure = LSP_BASE_NTREE;
  h.root = ntree.node_count ? 0 : LSP_NONE;
  h.max_depth = h.max_stack = h.ntree_depth = std::max(1u, ntree.levels);
  h.max_leaf_triangles = ntree.max_leaf_triangles;
  h.ntree_branching = ntree.branching;
  h.ntree_lo = ntree.lo;
  h.ntree_size = ntree.size;
  h.ntree_margin = ntree.margin;
}

void fill_ntree(BakeJob& job) {
  NTree& ntree = job.baked.ntree;
  if (job.options.line_spaces)
    fill_sites(job, ntree, choose_sites(ntree, job.bvh, job.baked.header, job.options.line_space));
  else
    note_no_line_spaces(job.baked);
}

CellTables fill_tables(BakeJob& job, const CellTableOptions& options, bool keep) {
  const Baked& baked = job.baked;
  return fill_cell_tables(baked.cell_grid, baked.wide, baked.header, baked.triangles, baked.materials,
                          options, job.known_cells, keep, job.stage("cells"));
}

// Bytes that the tables will take, about: as those of some cells from all over the scene do, which are the
// bake's meanwhile and need not be filled again.
double estimate_tables(BakeJob& job) {
  constexpr size_t kSample = 64;
  Baked& baked = job.baked;
  const size_t cells = baked.cell_grid.cells.size();
  CellTableOptions options = job.options.cell_tables;
  options.shard = {1, uint32_t(std::max<size_t>(1, cells / kSample))};
  baked.cell_tables = fill_tables(job, options, true);
  const double words = double(baked.cell_grid.words.size() * sizeof(uint32_t));
  const double filled = double(std::max<size_t>(1, baked.cell_tables.cells.size()));
  return words + (double(table_bytes(baked)) - words) * (double(cells) / filled);
}

// A grid so coarse that its tables take no more than they may, or nearly: they grow with the square of the
// cells on the longest side. Where there is none the tables of the last one tried are too long.
void coarsen(BakeJob& job) {
  constexpr double kSafe = 0.93;  // an estimate is off by a few per cent
  const double most = job.options.table_share * double(exact_bytes(job.baked)) - double(kTablePadding);
  CellGrid& grid = job.baked.cell_grid;
  for (;;) {
    const double longest = std::max({grid.dims.x, grid.dims.y, grid.dims.z});
    if (most <= 0 || longest == 1 || grid.crowded) return;
    const double tables = estimate_tables(job);
    if (tables <= kSafe * most) return;
    const double part = std::min(std::sqrt(0.97 * kSafe * most / tables), 1 - 1 / longest);
    try {
      grid = build_cell_grid(job.baked.triangles, job.bounds, std::max(1u, uint32_t(longest * part)));
      job.known_cells.clear();
    } catch (const Failure& failure) {
      if (failure.exit() != Exit::kLimit) throw;
      return;  // a cell of that grid would hold too many triangles
    }
  }
}

// Boxes and triangles that a ray tests in a cell, on average over some cells from all over the grid.
double tests_of_rays(const BakeJob& job) {
  constexpr size_t kSample = 64;
  const CellGrid& grid = job.baked.cell_grid;
  const Shard sample{1, uint32_t(std::max<size_t>(1, grid.cells.size() / kSample))};
  const size_t count = sample.share_of(grid.cells.size());
  std::vector<double> tests(count);
  tbb::parallel_for(size_t(0), count, [&](size_t i) {
    tests[i] = tests_of_ray(grid, job.baked.triangles, uint32_t(sample.item(i)));
  });
  return std::accumulate(tests.begin(), tests.end(), 0.0) / double(std::max<size_t>(1, count));
}

// Where triangles overlap everywhere, as in a heap of needles, a ray tests hundreds of them in a cell, and a
// cell is filled by some hundred thousand rays: fewer cells then, and none where that does not help.
void spare_cells(BakeJob& job, size_t most) {
  constexpr double kHeap = 30;  // tests of a ray in a cell: 4 to 7 in rooms and objects, 100 to 500 in heaps
  constexpr double kMostTests = 2000;  // in all cells of a heap: what filling 300 ordinary cells takes
  Baked& baked = job.baked;
  double tests = tests_of_rays(job);
  if (tests < kHeap || tests * double(baked.cell_grid.cells.size()) < kMostTests) return;
  const auto few = size_t(std::max(1.0, kMostTests / tests));
  baked.cell_grid = choose_cell_grid(baked.triangles, job.bounds, std::min(most, few));
  tests = tests_of_rays(job);
  if (tests * double(baked.cell_grid.cells.size()) > 2 * kMostTests)
    throw Failure(Exit::kLimit, "",
                  "a ray would test " + with_commas(uint64_t(tests)) +
                      " boxes and triangles in a cell, on average, and filling " +
                      with_commas(baked.cell_grid.cells.size()) +
                      " of them take too long (--base cells asks for them)");
}

// Throws where a grid that is so fine for the sake of its fullest cell has more cells than tables may fill.
void check_crowded(const BakeJob& job, size_t most) {
  const CellGrid& grid = job.baked.cell_grid;
  if (!grid.crowded || grid.cells.size() <= most) return;
  throw Failure(Exit::kLimit, "",
                "a grid of which no cell is too full has " + with_commas(grid.cells.size()) +
                    " filled cells, and their tables would be more than three times its exact data (--base "
                    "cells asks for them)");
}

void build_cells_base(BakeJob& job) {
  const BakeOptions& options = job.options;
  Baked& baked = job.baked;
  baked.header.base_structure = LSP_BASE_CELLS;
  if (options.cells) {
    baked.cell_grid = build_cell_grid(baked.triangles, job.bounds, options.cells);
    return;
  }
  // What a filled cell takes at least: 12 kB to 15 kB of objects, 20 kB of rooms.
  constexpr double kCellBytes = 12000;
  const bool any = options.table_share == 0;
  const size_t most = any ? SIZE_MAX : size_t(options.table_share * double(exact_bytes(baked)) / kCellBytes);
  baked.cell_grid = choose_cell_grid(baked.triangles, job.bounds, most);
  if (any) return;
  check_crowded(job, most);
  spare_cells(job, most);
  coarsen(job);
}

void fill_cells(BakeJob& job) {
  const CellTableOptions& options = job.options.cell_tables;
  Baked& baked = job.baked;
  baked.cell_tables = fill_tables(job, options, false);
  set_cells(baked.cell_grid, baked.cell_tables, options, baked.header);
  const size_t cells = baked.cell_grid.words.size();
  baked.skipped.push_back("empty cells: " + with_commas(cells - baked.cell_grid.cells.size()) + " of " +
                          with_commas(cells));
}

void finish_cells(BakeJob& job) {
  find_closed_ways(job.baked);
  choose_dial(job.baked, job.options.cells_wrong);
}

void build_wide_base(BakeJob& job) { job.baked.header.base_structure = LSP_BASE_WIDE; }

void fill_wide(BakeJob& job) { job.baked.skipped.push_back("tables: not asked for"); }

constexpr BaseStructure kBvh = {0, true, false, bvh_nodes_at, build_bvh_base, fill_bvh, nullptr};
// It refers to triangles, so that none is repeated; the BVH orders them and fills the Line Spaces.
constexpr BaseStructure kNTree = {LSP_FEATURE_NTREE, false,      false,  ntree_nodes_at,
                                  build_ntree_base,  fill_ntree, nullptr};
constexpr BaseStructure kCells = {LSP_FEATURE_CELLS, true,       true,        bvh_nodes_at,
                                  build_cells_base,  fill_cells, finish_cells};
constexpr BaseStructure kWide = {
    LSP_FEATURE_WIDE_BASE | LSP_FEATURE_WIDE, true, true, bvh_nodes_at, build_wide_base, fill_wide, nullptr};

}  // namespace

const BaseStructure& base_structure(Base base) {
  switch (base) {
    case Base::kNTree:
      return kNTree;
    case Base::kCells:
      return kCells;
    case Base::kWide:
      return kWide;
    case Base::kBvh:
      break;
  }
  return kBvh;
}

}  // namespace lsp
