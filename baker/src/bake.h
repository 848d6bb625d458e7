// From a mesh to the sections of an .lsp file.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "bvh.h"
#include "cells/cell_grid.h"
#include "cells/cell_tables.h"
#include "line_space.h"
#include "lsp/layout.h"
#include "lsp/lsp.h"
#include "mesh.h"
#include "ntree.h"
#include "wide_tree.h"

namespace lsp {

// What the file is for: decides which features get a section.
enum class Purpose {
  kVisibility,  // any hit only: binary Line Spaces
  kAo,          // any hit and distance: no normals, no materials
  kDiffuse,
  kGlossy,
  kAll,
};

enum class Base { kBvh, kNTree, kCells, kWide };

struct BakeOptions {
  Purpose purpose = Purpose::kAll;
  Base base = Base::kBvh;
  bool line_spaces = true;
  BvhOptions bvh;
  NTreeOptions ntree;
  LineSpaceOptions line_space;
  uint32_t cells = 0;  // along the longest side of the grid; 0: chosen from the scene
  CellTableOptions cell_tables;
  double table_share = 0;     // bytes of tables over those of exact data that the grid is chosen for; 0: any
  bool finish = true;         // false: without what needs the tables of all cells, as the dial does
  double cells_wrong = 0.01;  // share of the rays that the quality "balanced" may answer wrongly, see dial.h
  float plane_tolerance = 0.0f;         // LspHeader.plane_tolerance
  float normal_angle_degrees = 180.0f;  // LspHeader.normal_angle_cos; 180: no hit is rejected
  uint64_t memory_limit = 0;            // bytes, 0: none
  std::filesystem::path
      folder;  // where Line Spaces that the limit has no room for go meanwhile; empty: nowhere
};

// What a quality of cells errs and gains, as the bake measured it on rays of its own: the worst of rays from
// the surfaces, of rays from what eyes in the scene see, and of twelve small pictures (dial.h).
struct QualityFigures {
  double wrong = 0;      // share of the rays that hit or miss wrongly
  double depth = 0;      // mean error of the distance where both hit, in diagonals
  double occlusion = 0;  // mean error of ambient occlusion, over its mean or 0.25
  double light = 0;      // of the light that surfaces send back, without shadows, over its mean
  // How many times as fast as exact rays, by what they count: an estimate; 0: nothing was measured.
  double vulkan = 0, cpu = 0;
};
using Qualities = std::array<QualityFigures, LSP_QUALITY_COUNT>;  // LSP_QUALITY_*

// The sections of a file, and the header but for what the writer knows (sizes, offsets, hashes).
struct Baked {
  LspHeader header{};
  std::vector<LspNode> nodes;  // of a BVH
  WideTree wide;               // of cells, for exact rays
  NTree ntree;                 // or of an NTree
  CellGrid cell_grid;          // or cells
  CellTables cell_tables;
  std::vector<LspTriangle> triangles;
  std::vector<LspCornerNormals> normals;  // empty: no section
  std::vector<LspMaterial> materials;     // empty: no section
  LineSpaces line_spaces;
  std::vector<std::string> skipped;  // what the scene did not need, in words
  Qualities qualities{};             // of cells that were baked with exact data
  double tree_seconds = 0;
  double line_space_seconds = 0;
};

// Where a bake has each section, by the names of lsp/sections.def.
struct SectionArrays {
  const Baked& baked;
  const std::vector<LspNode>& nodes = baked.nodes;
  const std::vector<LspWideNode>& wide_nodes = baked.wide.nodes;
  const std::vector<LspTriangle>& triangles = baked.triangles;
  const std::vector<LspCornerNormals>& normals = baked.normals;
  const std::vector<LspMaterial>& materials = baked.materials;
  const std::vector<LspLineSpace>& line_spaces = baked.line_spaces.records;
  const LargeArray<LspBitWord>& bit_words = baked.line_spaces.words;
  const LargeArray<uint32_t>& candidates = baked.line_spaces.candidates;
  const std::vector<LspBitWord>& grid = baked.ntree.grid;
  const std::vector<LspCell>& cells = baked.ntree.cells;
  const std::vector<uint32_t>& references = baked.ntree.references;
  const std::vector<uint32_t>& cell_words = baked.cell_grid.words;
  const std::vector<LspFilledCell>& filled_cells = baked.cell_tables.cells;
  const std::vector<uint32_t>& entries = baked.cell_tables.entries;
  const std::vector<LspPlane>& planes = baked.cell_tables.planes;
  const std::vector<uint32_t>& plane_records = baked.cell_tables.plane_records;
  const std::vector<LspSplit>& splits = baked.cell_tables.splits;
  const std::vector<LspCellNode>& cell_nodes = baked.cell_tables.nodes;
  const std::vector<uint32_t>& cell_references = baked.cell_tables.references;
};

// Called with the stage's name and the share of it done, from any thread.
using Progress = std::function<void(std::string_view stage, double done)>;

// The result is exact and approximate. Throws Failure with Exit::kLimit when the memory limit would be
// exceeded.
Baked bake(const Mesh& mesh, const BakeOptions& options, const Progress& progress = {});

// Leaves out of `baked` what only exact traces need: nodes below terminal Line Spaces and the triangles there
// that no shaft refers to.
void keep_approximate_only(Baked& baked);

// The same of cells: nodes, cells' trees, and the triangles that no plane is of.
void keep_tables_only(Baked& baked);

// The bake as a scene to trace; it points into `baked`.
lsp_scene view(const Baked& baked);

// Sets the header's counts, and what follows from them, to those of the sections, and the feature bit of
// triangles that are there in part. Throws Failure with Exit::kLimit where the header has no room for what
// follows.
void set_counts(Baked& baked);

// Leaves out the tables of cells: wide nodes remain. `reason` is for the report.
void leave_out_tables(Baked& baked, const std::string& reason);

// What weighing adds to the bytes of tables, for their padding and what is stated of them.
constexpr uint64_t kTablePadding = 8 << 12;

// Bytes of what exact rays need and hits are shaded by: triangles, normals, materials, nodes.
uint64_t exact_bytes(const Baked& baked);

// Bytes of what depends on the grid of cells.
uint64_t table_bytes(const Baked& baked);

// A number for people: 1,234,567.
std::string with_commas(uint64_t n);

// Bytes of a candidate entry; 0 in a binary Line Space.
inline uint32_t entry_bytes(const LspLineSpace& r) {
  return r.format >> LSP_FORMAT_ENTRY_SHIFT & LSP_FORMAT_ENTRY_MASK;
}

}  // namespace lsp
