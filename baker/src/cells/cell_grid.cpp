#include "cell_grid.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "../bake.h"
#include "../vectors.h"
#include "lsp/program.h"
#include "triangle_box.h"

namespace lsp {
namespace {

constexpr float kPad = 1e-3f;     // of the longest side: no surface lies on the grid's own border
constexpr float kMargin = 1e-4f;  // of a cell's edge
constexpr size_t kWantedCells = 1200;
constexpr size_t kTrianglesPerCell = 8;
constexpr uint32_t kMostLongest = 96;
constexpr size_t kMostCells = size_t(1) << 24;  // about: of a grid refined for the fullest cell
constexpr size_t kPart = 4096;                  // triangles that one task sorts into cells

struct Reference {
  uint32_t cell, record;
};

// Cells from `first` to `last`, in each direction.
struct CellRange {
  glm::ivec3 first, last;
};

// Those that the box of a triangle reaches into, or might.
CellRange cells_about(const CellGrid& grid, const LspTriangle& triangle) {
  Box box;
  for (const lsp_float3& v : {triangle.v0, triangle.v1, triangle.v2}) box.grow(vec(v));
  const auto cell_of = [&](const glm::vec3& p) {
    return glm::clamp(glm::ivec3(glm::floor((p - grid.lo) / grid.size)), glm::ivec3(0), grid.dims - 1);
  };
  return {cell_of(box.lo - 2 * grid.margin), cell_of(box.hi + 2 * grid.margin)};
}

// Whether a triangle comes within the margin of the box of these cells.
bool reaches(const CellGrid& grid, const LspTriangle& triangle, const CellRange& cells) {
  return reaches_into(triangle, glm::dvec3(grid.corner(cells.first)) - double(grid.margin),
                      glm::dvec3(grid.corner(cells.last + 1)) + double(grid.margin));
}

// The cells that a triangle reaches into.
void add_references(const CellGrid& grid, const LspTriangle& triangle, uint32_t record,
                    std::vector<Reference>& out) {
  const auto [first, last] = cells_about(grid, triangle);
  glm::ivec3 c;
  for (c.z = first.z; c.z <= last.z; ++c.z)
    for (c.y = first.y; c.y <= last.y; ++c.y)
      for (c.x = first.x; c.x <= last.x; ++c.x)
        if (first == last || reaches(grid, triangle, {c, c}))
          out.push_back({uint32_t(grid.index(c)), record});
}

// How far every empty cell is from the nearest filled one, in cells along the longest axis: a box blur of the
// filled ones, a cell further with every pass.
void add_jumps(CellGrid& grid) {
  const glm::ivec3 n = grid.dims;
  std::vector<uint8_t> reached(grid.words.size()), next;
  for (size_t i = 0; i < reached.size(); ++i) reached[i] = (grid.words[i] & LSP_CELL_FILLED) != 0;
  const size_t strides[] = {1, size_t(n.x), size_t(n.x) * size_t(n.y)};
  const auto spread = [&](int axis) {
    next = reached;
    const size_t stride = strides[axis], length = size_t(n[axis]);
    for (size_t i = 0; i < reached.size(); ++i) {
      const size_t at = i / stride % length;
      if (at > 0) next[i] |= reached[i - stride];
      if (at + 1 < length) next[i] |= reached[i + stride];
    }
    std::swap(reached, next);
  };
  std::vector<uint8_t> before;
  for (uint32_t jump = 0; jump < LSP_CELL_MAX_JUMP; ++jump) {
    before = reached;
    for (int axis = 0; axis < 3; ++axis) spread(axis);
    bool any = false;
    for (size_t i = 0; i < reached.size(); ++i)
      if (reached[i] != 0 && before[i] == 0) {
        grid.words[i] = jump;
        any = true;
      }
    if (!any) break;
  }
}

// A grid of which it is not known what lies in its cells.
CellGrid lay_out(const Box& bounds, uint32_t longest) {
  CellGrid grid;
  const glm::vec3 extent = bounds.extent();
  const float side = std::max({extent.x, extent.y, extent.z});
  const glm::vec3 reach = glm::max(glm::abs(bounds.lo), glm::abs(bounds.hi));
  const float rounding = std::max({reach.x, reach.y, reach.z, side}) * 3.8146973e-6f;  // 64 u
  const float pad = side * kPad + 2 * rounding;
  grid.lo = bounds.lo - pad;
  grid.size = (side + 2 * pad) / float(longest);
  for (int k = 0; k < 3; ++k)
    grid.dims[k] = std::clamp(int(std::ceil((extent[k] + 2 * pad) / grid.size - 1e-4f)), 1, int(longest));
  grid.margin = grid.size * kMargin + rounding;
  return grid;
}

size_t cells_of(const CellGrid& grid) {
  return size_t(grid.dims.x) * size_t(grid.dims.y) * size_t(grid.dims.z);
}

// The grid but for its jumps.
CellGrid sort_into_cells(std::span<const LspTriangle> triangles, const Box& bounds, uint32_t longest) {
  CellGrid grid = lay_out(bounds, longest);
  grid.words.assign(cells_of(grid), LSP_CELL_MAX_JUMP);
  std::vector<std::vector<Reference>> parts((triangles.size() + kPart - 1) / kPart);
  tbb::parallel_for(size_t(0), parts.size(), [&](size_t p) {
    for (size_t i = p * kPart; i < std::min(triangles.size(), (p + 1) * kPart); ++i)
      add_references(grid, triangles[i], uint32_t(i), parts[p]);
  });
  // Sorted by cell, in each cell by record.
  std::vector<uint32_t> counts(grid.words.size());
  size_t total = 0;
  for (const auto& part : parts) {
    for (const Reference& r : part) ++counts[r.cell];
    total += part.size();
  }
  std::vector<uint32_t> begin(counts.size());
  uint32_t at = 0;
  for (size_t i = 0; i < counts.size(); ++i) {
    begin[i] = at;
    at += counts[i];
  }
  std::vector<uint32_t> sorted(total), cursor = begin;
  for (const auto& part : parts)
    for (const Reference& r : part) sorted[cursor[r.cell]++] = r.record;
  // A primitive that spatial splits repeat counts once.
  uint32_t primitives = 0;
  for (const LspTriangle& t : triangles) primitives = std::max(primitives, t.primitive + 1);
  std::vector<uint32_t> last_cell(primitives, UINT32_MAX);  // that a primitive was found in
  for (size_t i = 0; i < counts.size(); ++i) {
    if (counts[i] == 0) continue;
    const size_t first = grid.records.size();
    for (uint32_t k = begin[i]; k < begin[i] + counts[i]; ++k) {
      uint32_t& cell = last_cell[triangles[sorted[k]].primitive];
      if (cell != i) grid.records.push_back(sorted[k]);
      cell = uint32_t(i);
    }
    const auto coordinate = int(i);
    grid.words[i] = LSP_CELL_FILLED | uint32_t(grid.cells.size());
    grid.cells.push_back({{coordinate % grid.dims.x, coordinate / grid.dims.x % grid.dims.y,
                           coordinate / grid.dims.x / grid.dims.y},
                          uint32_t(first),
                          uint32_t(grid.records.size() - first)});
  }
  return grid;
}

size_t fullest(const CellGrid& grid) {
  size_t most = 0;
  for (const Cell& cell : grid.cells) most = std::max<size_t>(most, cell.count);
  return most;
}

// How full a grid's cells would be, without the grid: its fullest part is halved again and again, and only
// what holds too much for a cell is looked into.
class Crowd {
 public:
  Crowd(std::span<const LspTriangle> triangles, const Box& bounds) : triangles_(triangles), bounds_(bounds) {
    std::vector<bool> seen;
    for (uint32_t i = 0; i < triangles.size(); ++i) {
      const uint32_t primitive = triangles[i].primitive;
      if (primitive >= seen.size()) seen.resize(primitive + 1);
      if (!seen[primitive]) all_.push_back(i);  // those that spatial splits repeat count once
      seen[primitive] = true;
    }
  }

  // The triangles of a cell that cannot hold them, 0 where there is none.
  size_t in_cell_of(uint32_t longest) const {
    const CellGrid grid = lay_out(bounds_, longest);
    return all_.size() > kMostInCell ? in(grid, {glm::ivec3(0), grid.dims - 1}, all_) : 0;
  }

 private:
  size_t in(const CellGrid& grid, const CellRange& cells, const std::vector<uint32_t>& records) const {
    const glm::ivec3 longer = cells.last - cells.first;
    const int axis = longer.x >= longer.y ? (longer.x >= longer.z ? 0 : 2) : (longer.y >= longer.z ? 1 : 2);
    if (longer[axis] == 0) return records.size();
    CellRange halves[2] = {cells, cells};
    halves[0].last[axis] = cells.first[axis] + longer[axis] / 2;
    halves[1].first[axis] = halves[0].last[axis] + 1;
    std::vector<uint32_t> held[2];
    for (const uint32_t record : records) {
      const CellRange about = cells_about(grid, triangles_[record]);
      for (size_t h = 0; h < 2; ++h)
        if (about.first[axis] <= halves[h].last[axis] && about.last[axis] >= halves[h].first[axis] &&
            (about.first == about.last || reaches(grid, triangles_[record], halves[h])))
          held[h].push_back(record);
    }
    const size_t fuller = held[0].size() < held[1].size() ? 1 : 0;
    for (const size_t h : {fuller, 1 - fuller}) {
      if (held[h].size() <= kMostInCell) return 0;
      if (const size_t most = in(grid, halves[h], held[h])) return most;
    }
    return 0;
  }

  std::span<const LspTriangle> triangles_;
  const Box& bounds_;
  std::vector<uint32_t> all_;
};

// The most cells along the longest side of a grid of about kMostCells.
uint32_t finest(const Box& bounds) {
  uint32_t longest = LSP_MAX_CELLS;
  while (longest > 1 && cells_of(lay_out(bounds, longest)) > kMostCells) --longest;
  return longest;
}

// Few more cells on the longest side than the fewest of which none is too full. Throws where not even the
// finest grid will do.
uint32_t refine(const Crowd& crowd, uint32_t too_full, uint32_t fine) {
  if (const size_t most = crowd.in_cell_of(fine))
    throw Failure(Exit::kLimit, "",
                  "a cell of the finest grid would hold " + with_commas(most) +
                      " triangles, and it can hold " + with_commas(kMostInCell) +
                      ": give --base wide for exact rays alone, or --base bvh for tables of another kind");
  // Often a little finer will do, which halving may pass by: the fullest cell of a finer grid can be fuller.
  for (int k = 0; k < 4; ++k) {
    const uint32_t next = too_full + too_full / 16 + 1;
    if (next >= fine) return fine;
    if (!crowd.in_cell_of(next)) return next;
    too_full = next;
  }
  while (fine > too_full + too_full / 16 + 1) {
    const uint32_t between = std::max(too_full + 1, uint32_t(std::sqrt(double(too_full) * double(fine))));
    (crowd.in_cell_of(between) ? too_full : fine) = between;
  }
  return fine;
}

}  // namespace

CellGrid build_cell_grid(std::span<const LspTriangle> triangles, const Box& bounds, uint32_t longest) {
  CellGrid grid = sort_into_cells(triangles, bounds, longest);
  if (const size_t most = fullest(grid); most > kMostInCell) {
    const uint32_t enough = refine(Crowd(triangles, bounds), longest, std::max(longest, finest(bounds)));
    throw Failure(Exit::kLimit, "",
                  "a cell would hold " + with_commas(most) + " triangles, and it can hold " +
                      with_commas(kMostInCell) + ": give --cells " + std::to_string(enough) +
                      " or more, or --base bvh");
  }
  add_jumps(grid);
  return grid;
}

CellGrid choose_cell_grid(std::span<const LspTriangle> triangles, const Box& bounds, size_t most) {
  // Filled cells grow with the square of the cells on the longest side, or a little faster.
  const size_t wanted = std::min(std::clamp(triangles.size() / kTrianglesPerCell, size_t(8), kWantedCells),
                                 std::max<size_t>(most, 1));
  uint32_t longest = 8;
  CellGrid grid = sort_into_cells(triangles, bounds, longest);
  for (int attempt = 0; attempt < 4; ++attempt) {
    const double more = double(wanted) / double(std::max<size_t>(1, grid.cells.size()));
    if (more > 0.8 && more < 1.25) break;
    const auto next = uint32_t(std::clamp(std::lround(longest * std::sqrt(more)), 1l, long(kMostLongest)));
    if (next == longest) break;
    longest = next;
    grid = sort_into_cells(triangles, bounds, longest);
  }
  if (fullest(grid) <= kMostInCell) {
    add_jumps(grid);
    return grid;
  }
  grid = build_cell_grid(triangles, bounds, refine(Crowd(triangles, bounds), longest, finest(bounds)));
  grid.crowded = true;
  return grid;
}

}  // namespace lsp
