#include "policy.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <optional>

#include "accuracy.h"
#include "box.h"
#include "import/import.h"
#include "lsp/file_ending.h"
#include "lsp/program.h"

namespace lsp {
namespace {

// What decides between speed and accuracy, in one step each.
struct Quality {
  uint32_t resolution, depth, samples;
};
struct Preset {
  Quality line_spaces;
  uint32_t far_samples, origin_samples;  // of cells
};
const std::map<std::string, Preset> kPresets = {
    {"fast", {{4, 8, 3}, 24, 8}}, {"balanced", {{6, 9, 5}, 64, 24}}, {"accurate", {{6, 11, 9}, 128, 72}}};
// From cheap to dear, for --max-error.
const std::vector<Quality> kLadder = {{4, 7, 5}, {4, 9, 5}, {6, 9, 5}, {6, 11, 9}, {8, 11, 9}, {8, 13, 9}};
const std::map<std::string, Base> kBases = {
    {"bvh", Base::kBvh}, {"ntree", Base::kNTree}, {"cells", Base::kCells}, {"wide", Base::kWide}};

// What only Line Spaces have.
bool asks_for_line_spaces(const Arguments& a) {
  return a.resolution_given || a.depth_given || a.samples_given || a.triangles != 0 || a.no_line_spaces ||
         a.purpose == Purpose::kVisibility || a.normal_angle != 180 || a.plane_tolerance != 0;
}

std::string base_of(const Arguments& a) {
  if (!a.base.empty()) return a.base;
  if (a.cells != 0) return "cells";
  return asks_for_line_spaces(a) ? "bvh" : "cells";
}

// Throws where options contradict each other.
void check(const Arguments& a) {
  const bool scene = file_ending(a.output) == ".json";
  if (a.instances && !scene)
    throw Failure(Exit::kUsage, a.output.string(),
                  "is no scene, which --instances writes: give -o NAME.json");
  if (scene && !a.instances)
    throw Failure(Exit::kUsage, a.output.string(),
                  "is the name of a scene: add --instances to write one, or give -o NAME.lsp");
  if (is_mesh_name(a.output))
    throw Failure(Exit::kUsage, a.output.string(),
                  "is the name of a mesh, which would be lost: give -o NAME.lsp");
  if (a.exact && a.no_exact) throw Failure(Exit::kUsage, "", "--exact and --no-exact exclude each other");
  if (a.max_error > 0 && (a.resolution_given || a.depth_given || a.samples_given))
    throw Failure(Exit::kUsage, "",
                  "--max-error chooses --resolution, --depth and --samples itself, leave them out");
  if (a.max_error > 0 && (a.no_line_spaces || a.purpose == Purpose::kVisibility))
    throw Failure(Exit::kUsage, "", "--max-error needs Line Spaces with candidates");
  const bool ntree = a.base == "ntree";
  if (!ntree && (a.branching || a.levels != kNTreeLevels))
    throw Failure(Exit::kUsage, "", "--branching and --levels need --base ntree");
  const bool cells = a.base == "cells";
  if (a.cells && !cells) throw Failure(Exit::kUsage, "", "--cells needs --base cells");
  if (a.base == "wide" && (asks_for_line_spaces(a) || a.max_error > 0 || a.no_exact))
    throw Failure(Exit::kUsage, "",
                  "--base wide has no tables: leave it out, or --no-exact, --max-error and what is of Line "
                  "Spaces");
  if (cells && asks_for_line_spaces(a))
    throw Failure(Exit::kUsage, "",
                  "cells have tables of their own: leave out --base cells and --cells, or what is of Line "
                  "Spaces: --resolution, --depth, --samples, --triangles, --no-line-spaces, --normal-angle, "
                  "--plane-tolerance, --for visibility");
  if (a.time && !std::isfinite(*a.time))
    throw Failure(Exit::kUsage, "", "--time is no number of seconds, give one");
  if (ntree && a.max_error > 0)
    throw Failure(Exit::kUsage, "", "--max-error chooses among cells or BVHs: leave out --base ntree");
  if (!a.shard.empty() && !cells)
    throw Failure(Exit::kUsage, "",
                  "--shard divides the cells of --base cells: leave out --base " + a.base +
                      " and what is of Line Spaces, or bake in one, without --shard");
  if (!a.shard.empty() && a.instances)
    throw Failure(Exit::kUsage, "",
                  "--shard divides one bake, and --instances makes one of each mesh: leave out either");
  if (!a.shard.empty() && a.max_size)
    throw Failure(Exit::kUsage, "",
                  "--max-size needs the whole bake, which no --shard has: choose the grid by --cells");
  if (a.no_line_spaces && (a.depth_given || a.samples_given || a.triangles || a.normal_angle != 180 ||
                           a.plane_tolerance != 0 || (a.resolution_given && !ntree)))
    throw Failure(Exit::kUsage, "",
                  "--no-line-spaces has no use for what is of Line Spaces: leave out --resolution, --depth, "
                  "--samples, --triangles, --normal-angle and --plane-tolerance, or it");
  if (a.no_line_spaces && a.no_exact)
    throw Failure(Exit::kUsage, "", "--no-line-spaces with --no-exact leaves nothing to trace");
}

BakeOptions bake_options(const Arguments& a) {
  BakeOptions options;
  options.purpose = a.purpose;
  options.line_spaces = !a.no_line_spaces;
  options.base = kBases.at(a.base);
  options.cells = a.cells;
  options.cells_wrong = accuracy_of(a).wrong;
  if (a.weigh_tables) options.table_share = kTableShare;
  const Preset& preset = kPresets.at(a.preset);
  options.cell_tables.far_samples = preset.far_samples;
  options.cell_tables.origin_samples = preset.origin_samples;
  options.ntree.branching = a.branching;
  options.ntree.levels = a.levels;
  options.bvh.spatial_splits = !a.no_splits;
  options.line_space.triangles = a.triangles;
  options.line_space.kind =
      a.purpose == Purpose::kVisibility ? LineSpaceKind::kBinary : LineSpaceKind::kCandidates;
  options.line_space.exact = !a.no_exact;
  options.normal_angle_degrees = a.normal_angle;
  options.plane_tolerance = a.plane_tolerance;
  options.memory_limit = a.memory_limit;
  options.folder = a.output.has_parent_path() ? a.output.parent_path() : ".";
  options.line_space.resolution = a.resolution;
  options.line_space.depths = a.depths;
  options.line_space.samples = a.samples;
  return options;
}

// The cheapest rung of the ladder that errs no more than asked, or the last; its settings become those of
// `a`.
Chosen climb(const Mesh& mesh, Arguments& a, const Progress& progress) {
  Chosen chosen;
  for (const Quality& q : kLadder) {
    a.resolution = q.resolution;
    a.depths = {q.depth};
    a.samples = q.samples;
    chosen.baked = bake(mesh, bake_options(a), progress);
    chosen.error = measure_error(chosen.baked, kErrorRays);
    if (100 * chosen.error.wrong_share() <= a.max_error) break;
  }
  return chosen;
}

// Throws where products of coordinates would leave the range of floats: rays would miss, and nothing say why.
void check_range(const Mesh& mesh, const Arguments& a) {
  constexpr float kMostReach = 1e18f, kLeastSize = 1e-15f;  // see runtime/NUMERICS.md, "Triangles"
  const auto largest = [](const glm::vec3& v) { return std::max({v.x, v.y, v.z}); };
  const std::string file = a.inputs.size() == 1 ? a.inputs[0].string() : "";
  Box box;
  char text[200];
  for (const glm::vec3& p : mesh.positions) {
    box.grow(p);
    if (largest(glm::abs(p)) <= kMostReach) continue;
    std::snprintf(
        text, sizeof text,
        "has a corner at (%g, %g, %g), and rays are traced up to %g units from the origin: scale the "
        "mesh, or mend the corner",
        double(p.x), double(p.y), double(p.z), double(kMostReach));
    throw Failure(Exit::kInvalid, file, text);
  }
  if (mesh.positions.empty() || largest(box.extent()) >= kLeastSize) return;
  std::snprintf(text, sizeof text,
                "is %g units long, and rays are traced in scenes of %g units or more: scale the mesh",
                double(largest(box.extent())), double(kLeastSize));
  throw Failure(Exit::kInvalid, file, text);
}

// Where tables are weighed, exact rays alone do for a scene of which no grid can be made: a detail so small
// or so crowded that one cell would hold too much of it.
Baked bake_cells_or_wide(const Mesh& mesh, Arguments& a, const Progress& progress) {
  std::string why;
  try {
    return bake(mesh, bake_options(a), progress);
  } catch (const Failure& failure) {
    if (failure.exit() != Exit::kLimit || !a.weigh_tables) throw;
    why = failure.what();
  }
  a.base = "wide";
  Baked baked = bake(mesh, bake_options(a), progress);
  baked.skipped.back() = "tables: " + why;
  return baked;
}

// Cells whose dial keeps the error where one was asked for, if any point of it does; wide nodes alone where
// tables are weighed, and not worth it.
Chosen bake_cells(const Mesh& mesh, Arguments& a, const Progress& progress) {
  Chosen chosen;
  chosen.baked = bake_cells_or_wide(mesh, a, progress);
  if (a.base == "wide") return chosen;
  if (a.weigh_tables && weigh_tables(chosen.baked)) {
    a.base = "wide";
    return chosen;
  }
  chosen.error = settle_dial(chosen.baked, accuracy_of(a));
  return chosen;
}

void leave_out_exact(Baked& baked, bool cells) {
  if (cells)
    keep_tables_only(baked);
  else if (baked.line_spaces.records.empty())
    baked.skipped.push_back(
        "leaving out the exact tree: the scene is too small for Line Spaces at this depth");
  else
    keep_approximate_only(baked);
}

// As bake_as_asked, whatever its size.
Chosen bake_accurately(const Mesh& mesh, Arguments& a, const Progress& progress) {
  const bool cells = a.base == "cells";
  Chosen chosen;
  if (cells) {
    chosen = bake_cells(mesh, a, progress);
  } else if (a.max_error > 0) {
    chosen = climb(mesh, a, progress);
  } else {
    chosen.baked = bake(mesh, bake_options(a), progress);
    if (!a.no_line_spaces && a.purpose != Purpose::kVisibility)
      chosen.error = measure_error(chosen.baked, kErrorRays);
  }
  check_error(chosen.error, a.max_error, a.inputs[0].string());
  if (a.no_exact) leave_out_exact(chosen.baked, cells);
  return chosen;
}

[[noreturn]] void refuse_size(const Arguments& a, uint64_t bytes, const char* remedy) {
  char text[200];
  std::snprintf(text, sizeof text,
                "needs a file of %.2f MB at least, over the %.2f MB of --max-size: allow more%s",
                double(bytes) * 1e-6, double(a.max_size) * 1e-6, remedy);
  throw Failure(Exit::kLimit, a.inputs[0].string(), text);
}

// The bake as it is asked for if its file is small enough, else that with the most cells on the longest side
// of which this is so, or nearly: tables grow about with the square of it.
Chosen bake_within(const Mesh& mesh, Arguments& a, const Progress& progress, const FileSize& file_size) {
  constexpr int kBakes = 6;
  constexpr double kFull = 0.9;  // of the size: no more is looked for
  Chosen tried = bake_accurately(mesh, a, progress);
  uint64_t bytes = file_size(tried);
  if (bytes <= a.max_size) return tried;
  if (a.base != "cells") refuse_size(a, bytes, ", or choose a smaller --depth or --resolution");
  if (a.cells) refuse_size(a, bytes, ", or choose fewer --cells");
  std::optional<Chosen> best;
  uint32_t fits = 0, too_fine = longest_side(tried.baked.header.cells), cells = too_fine;
  double tables = double(table_bytes(tried.baked));
  for (int bake = 1; bake < kBakes && too_fine - fits > 1; ++bake) {
    const double left = double(a.max_size) - double(bytes) + tables;
    if (left <= 0) {
      bytes -= uint64_t(tables);  // no grid helps
      break;
    }
    const auto next = uint32_t(double(cells) * std::sqrt(left / tables));
    a.cells = cells = std::clamp(next, fits + 1, too_fine - 1);
    tried = bake_accurately(mesh, a, progress);
    bytes = file_size(tried);
    tables = double(table_bytes(tried.baked));
    if (bytes > a.max_size) {
      too_fine = cells;
      continue;
    }
    fits = cells;
    best = std::move(tried);
    if (double(bytes) > kFull * double(a.max_size)) break;
  }
  if (!best)
    refuse_size(a, bytes,
                a.no_exact ? ", or use --compress zstd"
                           : ", leave out exact rays by --no-exact, or use --compress zstd");
  a.cells = fits;
  return std::move(*best);
}

}  // namespace

void settle(Arguments& a) {
  const bool asked = !a.base.empty() || a.cells != 0 || a.no_exact || a.max_error > 0 || a.max_size != 0 ||
                     a.preset == "accurate";
  a.base = base_of(a);
  a.weigh_tables = !asked && a.base == "cells";
  check(a);
  if (!a.shard.empty()) parse_shard(a.shard);
  const Preset& preset = kPresets.at(a.preset);
  const bool ntree = a.base == "ntree";
  if (!a.resolution_given) a.resolution = preset.line_spaces.resolution;
  if (ntree && !a.branching) a.branching = std::clamp(a.resolution, 2u, LSP_MAX_BRANCHING);
  // At depth 1 an NTree's error costs the fewest bytes: bunny, N = 6, 1.2 % wrong and 13 MB against 0.3 % and
  // 142 MB.
  if (!a.depth_given) a.depths = {ntree ? std::min(a.levels - 1, 1u) : preset.line_spaces.depth};
  if (!a.samples_given) a.samples = preset.line_spaces.samples;
}

Accuracy accuracy_of(const Arguments& a) {
  Accuracy accuracy;
  accuracy.max_error = a.max_error;
  accuracy.weighed = a.weigh_tables;
  if (a.max_error > 0) accuracy.wrong = a.max_error / 100;
  return accuracy;
}

namespace {

// What `bake` returns. A bake does not know what it is of: its errors get the name of the first input.
template <typename Bake>
auto with_name(const Arguments& a, Bake&& bake) {
  try {
    return bake();
  } catch (const Failure& failure) {
    throw Failure(failure.exit(), failure.file().empty() ? a.inputs[0].string() : failure.file(),
                  failure.what());
  }
}

}  // namespace

Baked bake_shard(const Mesh& mesh, const Arguments& a, const Shard& shard, const Progress& progress) {
  BakeOptions options = bake_options(a);
  options.cell_tables.shard = shard;
  options.finish = false;
  check_range(mesh, a);
  return with_name(a, [&] { return bake(mesh, options, progress); });
}

Chosen bake_as_asked(const Mesh& mesh, Arguments& a, const Progress& progress, const FileSize& file_size) {
  check_range(mesh, a);
  return with_name(a, [&] {
    return a.max_size ? bake_within(mesh, a, progress, file_size) : bake_accurately(mesh, a, progress);
  });
}

}  // namespace lsp
