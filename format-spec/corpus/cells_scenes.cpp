#include "cells_scenes.h"

#include <algorithm>

#include "scenes.h"

namespace lsp::corpus {

Image full_cells_scene(bool exact) {
  Image image = box_on_floor({.leaf_triangles = 2, .normals = true, .materials = true});
  LspHeader& h = image.header;
  h.base_structure = LSP_BASE_CELLS;
  h.required_features |= LSP_FEATURE_CELLS;
  LspCellGrid& g = h.cells;
  const float size = 16, margin = 0.0625f;  // exact in binary, as is what follows from them
  g.lo = {h.bounds_min.x - 1, h.bounds_min.y - 1, h.bounds_min.z - 1};
  g.size = size;
  g.per_size = 1 / size;
  g.margin = margin;
  g.box_step = (size + 2 * margin) / 255;
  g.cells_x = 2;
  g.cells_y = g.cells_z = 1;
  g.far_patches = g.origin_patches = g.sub_cells = 1;
  g.origin_entry_first = 30;
  image.cell_words = {LSP_CELL_FILLED, 0};
  image.planes = {{{0, 1, 0}, -0.25f}};
  image.plane_records = {0};
  image.splits = {{0 | LSP_SPLIT_EMPTY << 12 | 5u << 24, 31}};
  LspFilledCell cell{};
  cell.sub_mask_lo = 1;
  cell.plane_count = 1;
  cell.split_count = 1;
  cell.root = LSP_CELL_NO_CHILD;
  h.quality[LSP_QUALITY_BALANCED] = h.quality[LSP_QUALITY_FAST] = h.quality[LSP_QUALITY_ACCURATE] =
      LSP_HEEDS_TABLES;
  // 30 shafts and 6 of the origin table: empty, planes and a split, of several losses; the last is the sky.
  image.entries.assign(18, LSP_ANSWER_EMPTY | LSP_ANSWER_EMPTY << 16);
  image.entries[0] = 0 | (1u | 2u << LSP_LOSS_SHIFT) << 16;
  image.entries[17] = (LSP_ANSWER_EMPTY | LSP_LOSS_UNKNOWN << LSP_LOSS_SHIFT) | LSP_ANSWER_SKY << 16;
  if (exact) {
    h.quality[LSP_QUALITY_BALANCED] = LSP_HEEDS(0u, 3u);
    h.quality_part[LSP_QUALITY_BALANCED] = LSP_HEEDS(2u, 8u);
    h.quality[LSP_QUALITY_ACCURATE] = LSP_HEEDS(0u, 0u);
    const auto leaf = [](uint32_t first, uint32_t count) {
      return LSP_CELL_LEAF_BIT | (count - 1) << LSP_CELL_LEAF_COUNT_SHIFT | first;
    };
    constexpr uint32_t kAll = 255u << 24, kRest = 255u | 255u << 8;  // the whole cell, for both children
    const auto node = [&](uint32_t a, uint32_t b) {
      return LspCellNode{kAll, kRest, 255u << 8 | 255u << 16 | 255u << 24, a | b << 16};
    };
    image.cell_nodes = {node(leaf(0, 4), 1), node(leaf(4, 4), 2), node(leaf(8, 4), leaf(12, 2))};
    for (uint32_t i = 0; i < 14; ++i) image.cell_references.push_back(i);
    cell.root = 0;
    cell.max_steps = 3;
  } else {
    image.nodes.clear();
    image.triangles.resize(1);
    image.normals.resize(1);
    h.required_features &= ~LSP_FEATURE_EXACT;
    h.root = LSP_NONE;
    h.max_depth = h.max_steps = h.max_leaf_triangles = 0;
    h.max_stack = 1;
  }
  image.filled_cells = {cell};
  return image;
}

Image closed_cells_scene() {
  Image image = full_cells_scene();
  image.filled_cells[0].closed = (1u << LSP_WAYS) - 1 - (1u << LSP_WAY(3u, 0u));  // but for a hole upwards
  return image;
}

}  // namespace lsp::corpus
