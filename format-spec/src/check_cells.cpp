// Cells: the grid's words, what each filled cell owns, its tree, and the entries of its tables. Needs every
// section of cells to be usable, and a grid in range.
#include <algorithm>
#include <bit>
#include <cmath>
#include <vector>

#include "layers.h"

namespace lsp::format {
namespace {

class CellCheck {
 public:
  CellCheck(const FileView& view, Report& report)
      : view_(view),
        report_(report),
        header_(view.header),
        grid_(view.header.cells),
        words_(view.elements<uint32_t>(Kind::kCgrd)),
        cells_(view.elements<LspFilledCell>(Kind::kCelt)),
        entries_(view.elements<uint32_t>(Kind::kCent)),
        nodes_(view.elements<LspCellNode>(Kind::kCnod)) {}

  void run() {
    check_words();
    check_owned();
    for (uint64_t i = 0; i < cells_.size() && owned_; ++i) check_tree(i);
    if (owned_) check_entries();
    if (owned_) check_splits();
    check_records(Kind::kCprc);
    check_records(Kind::kCref);
    check_planes();
  }

 private:
  void find(RuleId rule, Kind kind, uint64_t element, uint64_t bytes, std::string message) {
    report_.add(rule, view_.offset_of(kind, element * bytes), view_.length_of(kind, bytes),
                element_path(kind, element), std::move(message));
  }

  // Filled cells are numbered in the order of the grid; within a jump there is none.
  void check_words() {
    sum_filled();
    uint32_t filled = 0;
    for (uint64_t i = 0; i < words_.size(); ++i) {
      const uint32_t word = words_[i];
      if (word & LSP_CELL_FILLED) {
        if ((word & ~LSP_CELL_FILLED) != filled++)
          find(RuleId::kCellNumber, Kind::kCgrd, i, 4,
               "names record " + std::to_string(word & ~LSP_CELL_FILLED) + ", the cell is filled cell " +
                   std::to_string(filled - 1));
      } else if (word > LSP_CELL_MAX_JUMP) {
        find(RuleId::kCellJump, Kind::kCgrd, i, 4, "jumps over " + std::to_string(word) + " cells");
      } else if (word != 0 && !jump_is_true(i, word)) {
        find(RuleId::kCellJump, Kind::kCgrd, i, 4, "jumps over a filled cell");
      }
    }
    if (filled != cells_.size())
      find(RuleId::kCellNumber, Kind::kCgrd, 0, 4,
           std::to_string(filled) + " cells are filled, " + std::to_string(cells_.size()) + " have a record");
  }

  // Filled cells below (x, y, z) along every axis, for all corners of cells, so that a box of any size is
  // counted by eight look-ups (Crow, "Summed-area tables for texture mapping", 1984): a jump may be as long
  // as the grid.
  void sum_filled() {
    const uint64_t row = uint64_t{grid_.cells_x} + 1, slice = row * (uint64_t{grid_.cells_y} + 1);
    sums_.assign(slice * (uint64_t{grid_.cells_z} + 1), 0);
    uint64_t i = 0;
    for (uint64_t z = 1; z <= grid_.cells_z; ++z)
      for (uint64_t y = 1; y <= grid_.cells_y; ++y) {
        uint32_t in_row = 0;
        for (uint64_t x = 1; x <= grid_.cells_x; ++x) {
          in_row += words_[i++] >> 31;
          const uint64_t at = z * slice + y * row + x;
          sums_[at] = in_row + sums_[at - row] + sums_[at - slice] - sums_[at - slice - row];
        }
      }
  }

  bool jump_is_true(uint64_t i, uint64_t jump) const {
    const uint64_t row = uint64_t{grid_.cells_x} + 1, slice = row * (uint64_t{grid_.cells_y} + 1);
    const auto first = [&](uint64_t at) { return at > jump ? at - jump : 0; };
    const auto end = [&](uint64_t at, uint64_t cells) { return std::min(at + jump + 1, cells); };
    const uint64_t x = i % grid_.cells_x, y = i / grid_.cells_x % grid_.cells_y,
                   z = i / grid_.cells_x / grid_.cells_y;
    const uint64_t x0 = first(x), x1 = end(x, grid_.cells_x);
    const uint64_t y0 = first(y) * row, y1 = end(y, grid_.cells_y) * row;
    const uint64_t z0 = first(z) * slice, z1 = end(z, grid_.cells_z) * slice;
    const auto line = [&](uint64_t at) { return sums_[at + x1] - sums_[at + x0]; };
    return line(z1 + y1) - line(z1 + y0) - line(z0 + y1) + line(z0 + y0) == 0;
  }

  // What the cells own follows one another without gaps.
  void check_owned() {
    uint64_t subs = 0, planes = 0, splits = 0;
    const uint64_t sub_cells = uint64_t{grid_.sub_cells} * grid_.sub_cells * grid_.sub_cells;
    const uint64_t known = sub_cells >= 64 ? ~uint64_t{0} : (uint64_t{1} << sub_cells) - 1;
    for (uint64_t i = 0; i < cells_.size(); ++i) {
      const LspFilledCell& c = cells_[i];
      const uint64_t mask = uint64_t{c.sub_mask_hi} << 32 | c.sub_mask_lo;
      const bool good = c.sub_first == subs && c.plane_first == planes && c.split_first == splits &&
                        (mask & ~known) == 0 && uint64_t{c.plane_count} + c.split_count <= LSP_ANSWER_LIMIT;
      if (!good) {
        owned_ = false;
        find(RuleId::kCellOwned, Kind::kCelt, i, sizeof c,
             "its sub-cells, planes or splits do not follow those of the cell before, or are too many");
      }
      if (c.closed >> LSP_WAYS != 0)
        find(RuleId::kCellClosed, Kind::kCelt, i, sizeof c,
             "closed is " + std::to_string(c.closed) + ", of " + std::to_string(LSP_WAYS) + " ways");
      subs += uint64_t(std::popcount(mask));
      planes += c.plane_count;
      splits += c.split_count;
    }
    const uint64_t far = far_entries() * cells_.size(), all = far + subs * origin_entries();
    if (planes != header_.plane_count || splits != header_.split_count || far != grid_.origin_entry_first ||
        (all + 1) / 2 != entries_.size()) {
      owned_ = false;
      find(RuleId::kCellOwned, Kind::kCelt, 0, sizeof(LspFilledCell),
           "the cells' planes, splits or entries are not as many as the file has");
    }
  }

  uint64_t far_entries() const {
    const uint64_t patches = uint64_t{grid_.far_patches} * grid_.far_patches;
    return 30 * patches * patches;
  }
  uint64_t origin_entries() const { return 6ull * grid_.origin_patches * grid_.origin_patches; }

  // Where the elements of a cell that `first` counts from end.
  uint64_t end(uint64_t i, uint32_t LspFilledCell::*first, uint64_t all) const {
    return i + 1 < cells_.size() ? cells_[i + 1].*first : all;
  }

  // Nodes in depth-first order, each named once, and never more children waiting than a tree of the greatest
  // depth has.
  void check_tree(uint64_t i) {
    const LspFilledCell& c = cells_[i];
    const uint64_t nodes = end(i, &LspFilledCell::node_first, header_.cell_node_count);
    const uint64_t references = end(i, &LspFilledCell::reference_first, header_.cell_reference_count);
    if (c.node_first > nodes || nodes > nodes_.size() || c.reference_first > references ||
        references > header_.cell_reference_count || c.max_steps < nodes - c.node_first) {
      find(RuleId::kCellTree, Kind::kCelt, i, sizeof c,
           "its nodes or references lie outside, or are more than max_steps");
      return;
    }
    uint64_t next = 0;
    std::vector<uint32_t> stack = {c.root};
    bool good = true;
    while (!stack.empty() && good) {
      const uint32_t child = stack.back();
      stack.pop_back();
      if (child == LSP_CELL_NO_CHILD) continue;
      if (child & LSP_CELL_LEAF_BIT) {
        const uint64_t count = (child >> LSP_CELL_LEAF_COUNT_SHIFT & 3) + 1;
        good = child <= 0xFFFF &&
               (child & (LSP_CELL_MAX_REFERENCES - 1)) + count <= references - c.reference_first;
      } else {
        good = child == next && c.node_first + next < nodes && stack.size() < LSP_MAX_CELL_DEPTH;
        if (!good) break;
        const uint32_t children = nodes_[c.node_first + next++].children;
        stack.push_back(children >> 16);
        stack.push_back(children & 0xFFFF);
      }
    }
    if (!good || next != nodes - c.node_first)
      find(RuleId::kCellTree, Kind::kCelt, i, sizeof c,
           "its tree is not in depth-first order, or names what the cell does not have");
  }

  uint32_t entry(uint64_t i) const { return entries_[i / 2] >> (i % 2 ? 16 : 0) & 0xFFFF; }

  void check_entries() {
    const uint64_t far = far_entries(), origin = origin_entries();
    uint64_t table = grid_.origin_entry_first;
    for (uint64_t i = 0; i < cells_.size(); ++i) {
      const LspFilledCell& c = cells_[i];
      const uint64_t answers = uint64_t{c.plane_count} + c.split_count;
      const auto check = [&](uint64_t first, uint64_t count, bool of_origin) {
        for (uint64_t k = first; k < first + count; ++k) {
          const uint32_t answer = entry(k) & LSP_ANSWER_MASK;
          if (answer < answers || answer == LSP_ANSWER_EMPTY || (of_origin && answer == LSP_ANSWER_SKY))
            continue;
          find(RuleId::kCellEntry, Kind::kCent, k / 2, 4,
               "entry " + std::to_string(k) + " names answer " + std::to_string(answer) + " of " +
                   std::to_string(answers));
        }
      };
      check(i * far, far, false);
      const uint64_t tables = uint64_t(std::popcount(c.sub_mask_lo) + std::popcount(c.sub_mask_hi));
      check(table, tables * origin, true);
      table += tables * origin;
    }
  }

  void check_splits() {
    const auto splits = view_.elements<LspSplit>(Kind::kCspl);
    for (const LspFilledCell& c : cells_)
      for (uint64_t k = c.split_first; k < uint64_t{c.split_first} + c.split_count; ++k) {
        const LspSplit& s = splits[k];
        const auto good = [&](uint32_t side) { return side < c.plane_count || side == LSP_SPLIT_EMPTY; };
        if (!good(s.answers & LSP_SPLIT_MASK) || !good(s.answers >> 12 & LSP_SPLIT_MASK) ||
            s.answers >> 30 != 0 || s.weights >> 30 != 0)
          find(RuleId::kCellSplit, Kind::kCspl, k, sizeof s,
               "a side is no plane of the cell, or an unused bit is set");
      }
  }

  void check_records(Kind kind) {
    const auto records = view_.elements<uint32_t>(kind);
    for (uint64_t i = 0; i < records.size(); ++i)
      if (records[i] >= header_.triangle_count)
        find(
            RuleId::kCellRecord, kind, i, 4,
            "names triangle " + std::to_string(records[i]) + " of " + std::to_string(header_.triangle_count));
  }

  void check_planes() {
    const auto planes = view_.elements<LspPlane>(Kind::kCpln);
    for (uint64_t i = 0; i < planes.size(); ++i) {
      const lsp_float3& n = planes[i].normal;
      const double length = std::sqrt(double(n.x) * n.x + double(n.y) * n.y + double(n.z) * n.z);
      if (!(std::fabs(length - 1) < 1e-4) || !std::isfinite(planes[i].distance))
        find(RuleId::kCellPlane, Kind::kCpln, i, sizeof(LspPlane),
             "its normal is not of unit length, or a number not finite");
    }
  }

  const FileView& view_;
  Report& report_;
  const LspHeader& header_;
  const LspCellGrid& grid_;
  std::span<const uint32_t> words_;
  std::span<const LspFilledCell> cells_;
  std::span<const uint32_t> entries_;
  std::span<const LspCellNode> nodes_;
  std::vector<uint32_t> sums_;  // see sum_filled
  bool owned_ = true;
};

}  // namespace

void check_cells(const FileView& view, Report& report) { CellCheck(view, report).run(); }

}  // namespace lsp::format
