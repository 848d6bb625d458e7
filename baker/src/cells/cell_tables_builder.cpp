#include <bit>

#include "cell_tables.h"

namespace lsp {

void CellTablesBuilder::add(const CellPieces& cell) {
  const auto append = [](auto& all, const auto& own) { all.insert(all.end(), own.begin(), own.end()); };
  LspFilledCell record{};
  record.sub_mask_lo = uint32_t(cell.sub_mask);
  record.sub_mask_hi = uint32_t(cell.sub_mask >> 32);
  record.sub_first = subs_;
  subs_ += uint32_t(std::popcount(cell.sub_mask));
  record.plane_first = uint32_t(tables_.planes.size());
  record.plane_count = uint32_t(cell.planes.size());
  record.split_first = uint32_t(tables_.splits.size());
  record.split_count = uint32_t(cell.splits.size());
  record.root = cell.root;
  record.node_first = uint32_t(tables_.nodes.size());
  record.reference_first = uint32_t(tables_.references.size());
  record.max_steps = uint32_t(cell.nodes.size());
  tables_.cells.push_back(record);
  append(tables_.planes, cell.planes);
  append(tables_.plane_records, cell.plane_records);
  append(tables_.splits, cell.splits);
  append(tables_.nodes, cell.nodes);
  append(tables_.references, cell.references);
  append(tables_.entries, cell.far);
  append(origins_, cell.origin);
}

CellTables CellTablesBuilder::finish() {
  tables_.origin_entry_first = uint32_t(2 * tables_.entries.size());
  tables_.entries.insert(tables_.entries.end(), origins_.begin(), origins_.end());
  return std::move(tables_);
}

}  // namespace lsp
