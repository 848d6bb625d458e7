// One file for every rule that only cells can break.
#include <cmath>

#include "cells_scenes.h"
#include "collector.h"

namespace lsp::corpus {
namespace {

using format::RuleId;

void cells(Collector& c, RuleId rule, const char* mutation, const std::function<void(Image&)>& change) {
  Image image = full_cells_scene();
  change(image);
  c.add(rule, mutation, encode(image));
}

}  // namespace

void break_cells(Collector& c) {
  cells(c, RuleId::kCellsGrid, "size is NaN", [](Image& i) { i.header.cells.size = std::nanf(""); });
  cells(c, RuleId::kOriginNotFinite, "origin_y is infinite",
        [](Image& i) { i.header.origin_y = 0x7FF0000000000000u; });
  cells(c, RuleId::kQualityRange, "balanced heeds 9 classes of loss",
        [](Image& i) { i.header.quality[LSP_QUALITY_BALANCED] = LSP_HEEDS(9u, 0u); });
  c.add(
      RuleId::kQualityRange, "accurate heeds sixteen sixteenths of a class",
      [] {
        Image image = full_cells_scene(true);
        image.header.quality_part[LSP_QUALITY_ACCURATE] = LSP_HEEDS(0u, 16u);
        return encode(image);
      }(),
      {}, "-part");
  Image tables = full_cells_scene(false);
  tables.header.quality[LSP_QUALITY_ACCURATE] = LSP_HEEDS(8u, 3u);
  c.add(RuleId::kQualityRange, "accurate traces cells of a file without EXACT exactly", encode(tables), {},
        "-tables");
  cells(c, RuleId::kCellNumber, "the filled cell names record 1", [](Image& i) { i.cell_words[0] |= 1; });
  cells(c, RuleId::kCellJump, "the empty cell jumps over its neighbour, which is filled",
        [](Image& i) { i.cell_words[1] = 1; });
  cells(c, RuleId::kCellOwned, "the mask names sub-cell 1 of 1",
        [](Image& i) { i.filled_cells[0].sub_mask_lo = 2; });
  cells(c, RuleId::kCellTree, "node 1 names itself",
        [](Image& i) { i.cell_nodes[1].children = 1u << 16 | 1; });
  cells(c, RuleId::kCellEntry, "an entry of the far table names the sky",
        [](Image& i) { i.entries[3] = LSP_ANSWER_SKY | LSP_ANSWER_EMPTY << 16; });
  cells(c, RuleId::kCellSplit, "a side is plane 1 of 1", [](Image& i) { i.splits[0].answers |= 1; });
  cells(c, RuleId::kCellRecord, "a plane is of triangle 14 of 14", [](Image& i) { i.plane_records[0] = 14; });
  cells(c, RuleId::kCellPlane, "a normal of length 2", [](Image& i) { i.planes[0].normal.y = 2; });
  cells(c, RuleId::kCellClosed, "way 24 of 24 is closed",
        [](Image& i) { i.filled_cells[0].closed |= 1u << LSP_WAYS; });
}

}  // namespace lsp::corpus
