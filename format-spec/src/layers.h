// The layers of the check, in the order in which check_file runs them. Internal to the library.
#pragma once

#include <cmath>
#include <string>

#include "check.h"
#include "view.h"

namespace lsp::format {

// Everything before it is trusted: a layer runs only when what it relies on is usable.
void check_identification(const FileView& view, Report& report);
void check_header(const FileView& view, Report& report);
// The part of it that is of the scene, not of the file.
void check_statements(const FileView& view, Report& report);

// Checks the table and the padding, and fills view.parts with what lies soundly inside the file.
void check_sections(FileView& view, Report& report);

// Checks hashes, unpacks packed sections into view.owned, and marks the parts that are usable.
void check_hashes_and_codec(FileView& view, uint64_t memory_limit, Report& report);

void check_metadata(const FileView& view, Report& report);
void check_source(const FileView& view, Hash128 source, Report& report);

// Needs NODE and TRIA to be usable or absent.
void check_tree(const FileView& view, Report& report);
// The same of an NTree. Needs GRID, CELL, REFS and TRIA to be usable or absent, and ntree_readable.
void check_ntree(const FileView& view, Report& report);
// The same of wide nodes. Needs WNOD and TRIA to be usable or absent.
void check_wide(const FileView& view, Report& report);
// Needs LSPC; looks at BITS and CAND where they are usable.
void check_line_spaces(const FileView& view, Report& report);
// Needs a tree whose references are in range, and whole sections.
void check_geometry(const FileView& view, Report& report);
// Needs the same of an NTree, and GRID in order.
void check_ntree_geometry(const FileView& view, Report& report);

// Needs every section of cells to be usable, and a grid in range.
void check_cells(const FileView& view, Report& report);

// Whether all three components are.
inline bool finite(const lsp_float3& v) {
  return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}

// "/sections/NODE/12/child1"
inline std::string element_path(Kind kind, uint64_t index, const char* field = nullptr) {
  std::string path = std::string("/sections/") + info(kind).name + "/" + std::to_string(index);
  if (field != nullptr) path = path + "/" + field;
  return path;
}

}  // namespace lsp::format
