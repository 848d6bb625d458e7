#include "cell_tables.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <atomic>

#include "../vectors.h"
#include "cell_filler.h"

namespace lsp {
namespace {

constexpr float kOffset = 1e-4f;  // of the scene's diagonal, as renderers move ray origins off the surface
constexpr size_t kBatch = 256;    // cells that are filled before they are packed

// Entries, of which there is an even number, two in a word.
std::vector<uint32_t> words_of(std::span<const uint16_t> entries) {
  std::vector<uint32_t> words(entries.size() / 2);
  for (size_t i = 0; i < words.size(); ++i) words[i] = entries[2 * i] | uint32_t{entries[2 * i + 1]} << 16;
  return words;
}

void add_to(CellTablesBuilder& tables, const FilledCell& f, float cell_size) {
  std::vector<LspPlane> planes;
  for (const Plane& p : f.planes)
    planes.push_back({{p.normal.x, p.normal.y, p.normal.z}, p.distance / cell_size});
  const std::vector<uint32_t> far = words_of(f.far), origin = words_of(f.origin);
  tables.add({f.sub_mask, f.tree.root, far, origin, planes, f.plane_records, f.splits, f.tree.nodes,
              f.tree.references});
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
                            const CellTableOptions& options, FilledCells& known, bool keep,
                            const std::function<void(double)>& progress) {
  LspHeader whole_header = header;
  whole_header.required_features = LSP_FEATURE_EXACT | LSP_FEATURE_WIDE;
  set_wide(tree, whole_header);
  whole_header.triangle_count = uint32_t(triangles.size());
  lsp_scene whole{};
  whole.header = &whole_header;
  whole.wide_nodes = tree.nodes.data();
  whole.triangles = triangles.data();
  const float diagonal = glm::length(vec(header.bounds_max) - vec(header.bounds_min));
  std::vector<glm::vec3> colors;
  for (const LspMaterial& m : materials) colors.push_back(vec(m.base_color) + vec(m.emission));
  const CellScene scene{grid, whole, triangles, colors, options, kOffset * diagonal};

  CellTablesBuilder tables;
  std::atomic<size_t> done{0};
  const size_t cells = options.shard.share_of(grid.cells.size());
  for (size_t begin = 0; begin < cells; begin += kBatch) {
    const size_t end = std::min(cells, begin + kBatch);
    std::vector<FilledCell> filled(end - begin);
    const auto fill = [&](const tbb::blocked_range<size_t>& range) {
      for (size_t i = range.begin(); i < range.end(); ++i) {
        const auto cell = uint32_t(options.shard.item(i));
        const auto found = known.find(cell);
        filled[i - begin] = found == known.end() ? fill_cell(scene, cell) : std::move(found->second);
        const size_t now = ++done;
        if (progress && now % 16 == 0) progress(double(now) / double(cells));
      }
    };
    // One at a time: cells differ much in what they take.
    tbb::parallel_for(tbb::blocked_range<size_t>(begin, end, 1), fill, tbb::simple_partitioner());
    for (const FilledCell& f : filled) add_to(tables, f, grid.size);
    for (size_t i = begin; keep && i < end; ++i)
      known[uint32_t(options.shard.item(i))] = std::move(filled[i - begin]);
  }
  return tables.finish();
}

}  // namespace lsp
