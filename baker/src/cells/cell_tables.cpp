#include "cell_tables.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <atomic>
#include <bit>

#include "../vectors.h"
#include "cell_filler.h"

namespace lsp {
namespace {

constexpr float kOffset = 1e-4f;  // of the scene's diagonal, as renderers move ray origins off the surface
constexpr size_t kBatch = 256;    // cells that are filled before they are packed

// Appends entries to words that hold `count` so far.
void append(std::span<const uint16_t> entries, std::vector<uint32_t>& words, uint64_t& count) {
  for (uint16_t e : entries) {
    if (count % 2 == 0) words.push_back(0);
    words.back() |= uint32_t(e) << (count % 2 ? 16 : 0);
    ++count;
  }
}

}  // namespace

void set_cells(const CellGrid& grid, const CellTables& tables, const CellTableOptions& options,
               LspHeader& header) {
  LspCellGrid& g = header.cells;
  g.lo = {grid.lo.x, grid.lo.y, grid.lo.z};
  g.size = grid.size;
  g.per_size = 1 / grid.size;
  g.cells_x = uint32_t(grid.dims.x);
  g.cells_y = uint32_t(grid.dims.y);
  g.cells_z = uint32_t(grid.dims.z);
  g.margin = grid.margin;
  g.box_step = (grid.size + 2 * grid.margin) / 255;
  g.far_patches = options.far_patches;
  g.origin_patches = options.origin_patches;
  g.sub_cells = options.sub_cells;
  g.origin_entry_first = tables.origin_entry_first;
  header.filled_cell_count = uint32_t(tables.cells.size());
  header.entry_word_count = uint32_t(tables.entries.size());
  header.plane_count = uint32_t(tables.planes.size());
  header.split_count = uint32_t(tables.splits.size());
  header.cell_node_count = uint32_t(tables.nodes.size());
  header.cell_reference_count = uint32_t(tables.references.size());
}

uint32_t loss_class(float loss) {
  constexpr int kLimits[LSP_LOSS_UNKNOWN] = LSP_LOSS_LIMITS;
  uint32_t c = 0;
  while (c + 1 < LSP_LOSS_UNKNOWN && loss > float(kLimits[c]) / 100) ++c;
  return c;
}

CellTables fill_cell_tables(const CellGrid& grid, const WideTree& tree, const LspHeader& header,
                            std::span<const LspTriangle> triangles, std::span<const LspMaterial> materials,
                            const CellTableOptions& options, const std::function<void(double)>& progress) {
  std::vector<LspTriangle> numbered(triangles.begin(), triangles.end());
  for (size_t i = 0; i < numbered.size(); ++i) numbered[i].primitive = uint32_t(i);
  LspHeader whole_header = header;
  whole_header.required_features = LSP_FEATURE_EXACT | LSP_FEATURE_WIDE;
  set_wide(tree, whole_header);
  whole_header.triangle_count = uint32_t(triangles.size());
  lsp_scene whole{};
  whole.header = &whole_header;
  whole.wide_nodes = tree.nodes.data();
  whole.triangles = numbered.data();
  const float diagonal = glm::length(vec(header.bounds_max) - vec(header.bounds_min));
  std::vector<glm::vec3> colors;
  for (const LspMaterial& m : materials) colors.push_back(vec(m.base_color) + vec(m.emission));
  const CellScene scene{grid, whole, numbered, colors, options, kOffset * diagonal};

  CellTables out;
  uint64_t entries = 0;
  uint32_t subs = 0;
  std::vector<uint16_t> origins;
  std::atomic<size_t> done{0};
  for (size_t begin = 0; begin < grid.cells.size(); begin += kBatch) {
    const size_t end = std::min(grid.cells.size(), begin + kBatch);
    std::vector<FilledCell> filled(end - begin);
    tbb::parallel_for(begin, end, [&](size_t i) {
      filled[i - begin] = fill_cell(scene, uint32_t(i));
      const size_t now = ++done;
      if (progress && now % 16 == 0) progress(double(now) / double(grid.cells.size()));
    });
    for (size_t i = begin; i < end; ++i) {
      const FilledCell& f = filled[i - begin];
      LspFilledCell record{};
      record.sub_mask_lo = uint32_t(f.sub_mask);
      record.sub_mask_hi = uint32_t(f.sub_mask >> 32);
      record.sub_first = subs;
      subs += uint32_t(std::popcount(f.sub_mask));
      record.plane_first = uint32_t(out.planes.size());
      record.plane_count = uint32_t(f.planes.size());
      record.split_first = uint32_t(out.splits.size());
      record.split_count = uint32_t(f.splits.size());
      record.root = f.tree.root;
      record.node_first = uint32_t(out.nodes.size());
      record.reference_first = uint32_t(out.references.size());
      record.max_steps = uint32_t(f.tree.nodes.size());
      out.cells.push_back(record);
      for (const Plane& p : f.planes)
        out.planes.push_back({{p.normal.x, p.normal.y, p.normal.z}, p.distance / grid.size});
      out.plane_records.insert(out.plane_records.end(), f.plane_records.begin(), f.plane_records.end());
      out.splits.insert(out.splits.end(), f.splits.begin(), f.splits.end());
      out.nodes.insert(out.nodes.end(), f.tree.nodes.begin(), f.tree.nodes.end());
      out.references.insert(out.references.end(), f.tree.references.begin(), f.tree.references.end());
      out.overflowed += f.overflow;
      append(f.far, out.entries, entries);
      origins.insert(origins.end(), f.origin.begin(), f.origin.end());
    }
  }
  out.far_entries = entries;
  out.origin_entry_first = uint32_t(entries);
  append(origins, out.entries, entries);
  out.origin_entries = origins.size();
  return out;
}

}  // namespace lsp
