#include "join.h"

#include <algorithm>
#include <bit>
#include <cstring>

#include "lsp/program.h"
#include "view.h"

namespace lsp {
namespace {

using format::Kind;
using Json = nlohmann::ordered_json;

[[noreturn]] void refuse(const Part& part, const std::string& what) {
  throw Failure(Exit::kInvalid, part.file, what + ": bake the part again");
}

// "2/5"
std::string name_of(const Shard& shard) {
  return std::to_string(shard.number) + "/" + std::to_string(shard.count);
}

// What tells two bakes apart, in words.
std::string difference(const Part& a, const Part& b) {
  const auto is = [](const std::string& what, const Json& x, const Json& y) {
    return what + " is " + x.dump() + " there and " + y.dump() + " here";
  };
  const Json &x = a.settings.meta, &y = b.settings.meta;
  for (const auto& [name, value] : x.at("options").items()) {
    const Json other = y.at("options").value(name, Json());
    if (value != other) return is(name, value, other);
  }
  for (const char* name : {"inputs", "source_hash"})
    if (x.value(name, Json()) != y.value(name, Json()))
      return is(name, x.value(name, Json()), y.value(name, Json()));
  if (a.settings_text != b.settings_text) return "their options differ";
  return "their options are the same, but not their trees: programs or machines differ";
}

// Walks through a part's cells; everything that it hands out lies in the part.
class PartCells {
 public:
  explicit PartCells(const Part& part)
      : part_(part),
        records_(part.elements<LspFilledCell>(Kind::kCelt)),
        entries_(part.elements<uint32_t>(Kind::kCent)),
        far_words_(far_words(part.header.cells.far_patches)),
        origin_words_(origin_words(part.header.cells.origin_patches)),
        origin_at_(far_words_ * records_.size()) {}

  CellPieces next() {
    const LspFilledCell& r = records_[cell_];
    CellPieces cell;
    cell.sub_mask = uint64_t{r.sub_mask_hi} << 32 | r.sub_mask_lo;
    cell.root = r.root;
    const uint64_t origin = origin_words_ * uint64_t(std::popcount(cell.sub_mask));
    cell.far = slice(entries_, far_words_ * cell_, far_words_);
    cell.origin = slice(entries_, origin_at_, origin);
    origin_at_ += origin;
    cell.planes = slice(part_.elements<LspPlane>(Kind::kCpln), r.plane_first, r.plane_count);
    cell.plane_records = slice(part_.elements<uint32_t>(Kind::kCprc), r.plane_first, r.plane_count);
    cell.splits = slice(part_.elements<LspSplit>(Kind::kCspl), r.split_first, r.split_count);
    cell.nodes = up_to_next(part_.elements<LspCellNode>(Kind::kCnod), &LspFilledCell::node_first);
    cell.references = up_to_next(part_.elements<uint32_t>(Kind::kCref), &LspFilledCell::reference_first);
    ++cell_;
    return cell;
  }

 private:
  template <class T>
  std::span<const T> slice(std::span<const T> all, uint64_t first, uint64_t count) const {
    if (first > all.size() || count > all.size() - first)
      refuse(part_, "cell " + std::to_string(cell_) + " of the part has tables beyond the part's");
    return all.subspan(first, count);
  }
  template <class T>
  std::span<const T> up_to_next(std::span<const T> all, uint32_t LspFilledCell::*first) const {
    const uint64_t begin = records_[cell_].*first;
    const uint64_t end = cell_ + 1 < records_.size() ? records_[cell_ + 1].*first : all.size();
    return slice(all, begin, std::max(begin, end) - begin);
  }

  const Part& part_;
  std::span<const LspFilledCell> records_;
  std::span<const uint32_t> entries_;
  uint64_t far_words_, origin_words_, origin_at_;
  size_t cell_ = 0;
};

// Part 1 alone has the scene, and it is the one that all parts were made of.
void check_scene(const std::vector<Part>& parts) {
  const Part& first = parts.front();
  const auto hash = bake_hash(first.settings_text, first.header, first.sections);
  if (hash != std::array{first.bake_lo, first.bake_hi})
    refuse(first, "its scene is not the one it states at byte 64");
  if (!format::cells_readable(first.header)) refuse(first, "the grid of its header is out of range");
  const std::span<const uint32_t> words = first.elements<uint32_t>(Kind::kCgrd);
  const auto filled = size_t(
      std::count_if(words.begin(), words.end(), [](uint32_t w) { return (w & LSP_CELL_FILLED) != 0; }));
  for (const Part& part : parts) {
    const size_t cells = part.elements<LspFilledCell>(Kind::kCelt).size(), owed = part.shard.share_of(filled);
    if (cells != owed)
      refuse(part, "has " + std::to_string(cells) + " cells where " + name_of(part.shard) +
                       " of the grid are " + std::to_string(owed));
    if (std::memcmp(&part.header, &first.header, sizeof first.header) != 0)
      refuse(part, "its header is not that of " + first.file);
  }
}

CellTables join_tables(const std::vector<Part>& parts) {
  std::vector<PartCells> cells;
  size_t count = 0;
  for (const Part& part : parts) {
    cells.emplace_back(part);
    count += part.elements<LspFilledCell>(Kind::kCelt).size();
  }
  CellTablesBuilder tables;
  for (size_t i = 0; i < count; ++i) tables.add(cells[i % parts.size()].next());
  return tables.finish();
}

template <class T>
void copy(const Part& part, Kind kind, std::vector<T>& to) {
  const std::span<const T> from = part.elements<T>(kind);
  to.assign(from.begin(), from.end());
}

// Refuses what tracing could not follow.
void check_bake(const Baked& baked, const Part& first) {
  format::CheckOptions options;
  options.level = format::Level::kGeometry;
  const format::Report report = format::check_contents(baked.header, contents_of(baked), options);
  if (report.verdict() == format::Verdict::kValid) return;
  refuse(first, "the parts do not make a sound bake, as the first finding says: " +
                    format::to_text(report).substr(0, format::to_text(report).find('\n')));
}

}  // namespace

void check_parts(std::vector<Part>& parts) {
  std::stable_sort(parts.begin(), parts.end(),
                   [](const Part& a, const Part& b) { return a.shard.number < b.shard.number; });
  const Part& first = parts.front();
  for (const Part& part : parts) {
    if (part.shard.count != first.shard.count)
      throw Failure(Exit::kUsage, part.file,
                    "is part " + name_of(part.shard) + ", but " + first.file + " is " + name_of(first.shard) +
                        ": give the parts of one bake, all with the same K of --shard I/K");
    if (part.bake_lo != first.bake_lo || part.bake_hi != first.bake_hi)
      throw Failure(Exit::kInvalid, part.file,
                    "is not of the same bake as " + first.file + ", " + difference(first, part) +
                        ": bake all parts with the same meshes and options");
  }
  for (size_t i = 1; i < parts.size(); ++i)
    if (parts[i].shard.number == parts[i - 1].shard.number)
      throw Failure(
          Exit::kUsage, parts[i].file,
          "is part " + name_of(parts[i].shard) + ", as is " + parts[i - 1].file + ": give each part once");
  std::string missing;
  uint32_t expected = 1, named = 0;
  const auto add_missing = [&](uint32_t end) {
    for (; expected < end; ++expected)
      if (++named <= 8) missing += (missing.empty() ? "" : ", ") + name_of({expected, first.shard.count});
    ++expected;
  };
  for (const Part& part : parts) add_missing(part.shard.number);
  add_missing(first.shard.count + 1);
  if (named > 8) missing += " and " + std::to_string(named - 8) + " more";
  if (named)
    throw Failure(Exit::kUsage, first.file,
                  "is one of " + std::to_string(first.shard.count) + " parts, of which " + missing +
                      (named == 1 ? " is" : " are") +
                      " missing: bake with --shard what is, and give all parts");
}

Baked join_parts(const std::vector<Part>& parts) {
  check_scene(parts);
  const Part& first = parts.front();
  Baked baked;
  baked.header = first.header;
  copy(first, Kind::kWnod, baked.wide.nodes);
  copy(first, Kind::kTria, baked.triangles);
  copy(first, Kind::kNrml, baked.normals);
  copy(first, Kind::kMatl, baked.materials);
  copy(first, Kind::kCgrd, baked.cell_grid.words);
  baked.cell_tables = join_tables(parts);
  baked.header.cells.origin_entry_first = baked.cell_tables.origin_entry_first;
  set_counts(baked);
  check_bake(baked, first);
  return baked;
}

}  // namespace lsp
