#include "check.h"

#include "layers.h"

namespace lsp::format {
namespace {

// Whether the references of the tree can be followed: everything later layers index with was in range.
bool tree_sound(const Report& report) {
  for (RuleId id : {RuleId::kChildOutOfRange, RuleId::kChildNotAfterParent, RuleId::kTwoParents})
    if (report.has(id)) return false;
  return true;
}

// And the cells of an NTree be found, and their references, which no two leaves share: looking into each leaf
// then costs no more than the file's size.
bool cells_sound(const Report& report) {
  for (RuleId id : {RuleId::kGridOffset, RuleId::kGridTail, RuleId::kCellCountWrong, RuleId::kNtreeTooDeep,
                    RuleId::kNtreeCube, RuleId::kRootReference, RuleId::kLeafOutOfRange,
                    RuleId::kReferencesNotCumulative})
    if (report.has(id)) return false;
  return true;
}

bool usable_or_absent(const FileView& view, Kind kind) {
  const Part& part = view.part(kind);
  return part.usable || (!part.present && declared_count(view.header, kind).value_or(0) == 0);
}

// Whether the triangles and every section of the base structure are.
bool tree_usable(const FileView& view) {
  bool usable = usable_or_absent(view, Kind::kTria);
  for (int kind = 0; kind < kKinds; ++kind) {
    const uint32_t base = info(static_cast<Kind>(kind)).base;
    if (base != 0 && holds_base(view.header, base))
      usable = usable && usable_or_absent(view, static_cast<Kind>(kind));
  }
  return usable;
}

void check_structure(const FileView& view, Level level, Report& report) {
  const bool ntree = is_ntree(view.header);
  // Without EXACT a file of cells has no tree.
  const bool none = has_cells(view.header) && (view.header.required_features & LSP_FEATURE_EXACT) == 0;
  const bool tree = !none && (!ntree || ntree_readable(view.header)) && tree_usable(view);
  if (tree)
    ntree                     ? check_ntree(view, report)
    : walks_wide(view.header) ? check_wide(view, report)
                              : check_tree(view, report);
  if (has_cells(view.header) && cells_readable(view.header) && tree_usable(view)) check_cells(view, report);
  if (view.part(Kind::kLspc).usable) check_line_spaces(view, report);
  if (level < Level::kGeometry) return;

  if (tree && tree_sound(report)) {
    check_geometry(view, report);
    if (ntree && cells_sound(report)) check_ntree_geometry(view, report);
  }
}

// Fills view.parts with the contents that are as long as the header says.
void view_contents(const Contents& contents, FileView& view, Report& report) {
  for (int k = 0; k < kKinds; ++k) {
    const Kind kind = static_cast<Kind>(k);
    const std::span<const std::byte> data = contents[static_cast<size_t>(k)];
    if (!data.empty()) {
      LspSection section{};
      section.type = info(kind).type;
      view.table.push_back(section);
    }
    const uint64_t bytes = declared_count(view.header, kind).value_or(0) * info(kind).element_bytes;
    // As in a file, normals are of all triangles or not there.
    const bool left_out = kind == Kind::kNrml && data.empty();
    if (data.size() == bytes || left_out)
      view.parts[static_cast<size_t>(k)] = {!data.empty(), false, 0, data.size(), data, !data.empty()};
    else
      report.add(RuleId::kCountDiffers, 0, 0, std::string("/sections/") + info(kind).name,
                 "has " + std::to_string(data.size()) + " bytes, the header states " + std::to_string(bytes));
  }
}

}  // namespace

Report check_file(std::span<const std::byte> bytes, const CheckOptions& options) {
  Report report(options.examples_per_rule);
  FileView view = view_file(bytes);
  check_identification(view, report);
  if (report.fatal()) return report;
  check_header(view, report);
  if (report.fatal()) return report;
  check_sections(view, report);
  check_hashes_and_codec(view, options.memory_limit, report);
  if (options.source) check_source(view, *options.source, report);
  if (report.fatal()) return report;
  check_metadata(view, report);
  if (options.level < Level::kStructure) return report;
  check_structure(view, options.level, report);
  return report;
}

Report check_contents(const LspHeader& header, const Contents& contents, const CheckOptions& options) {
  Report report(options.examples_per_rule);
  FileView view;
  view.header = header;
  view_contents(contents, view, report);
  check_statements(view, report);
  if (report.verdict() == Verdict::kValid) check_structure(view, options.level, report);
  return report;
}

}  // namespace lsp::format
