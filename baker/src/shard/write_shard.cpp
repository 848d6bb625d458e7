#include "write_shard.h"

#include <algorithm>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "figures.h"
#include "lsp/json_result.h"
#include "policy.h"
#include "provenance.h"
#include "shard/part.h"
#include "timer.h"

namespace lsp {
namespace {

using Json = nlohmann::ordered_json;

struct Done {
  Shard shard;
  const Baked& baked;
  uint64_t bytes;
  double write_seconds;
};

Json report_json(const Arguments& a, const ShardInput& input, const Done& done) {
  const LspCellGrid& g = done.baked.header.cells;
  return {{"output", a.output.string()},
          {"shard", {{"number", done.shard.number}, {"count", done.shard.count}}},
          {"notes", input.mesh.notes},
          {"cells",
           {{"grid", {g.cells_x, g.cells_y, g.cells_z}},
            {"filled", done.baked.cell_grid.cells.size()},
            {"in_part", done.baked.cell_tables.cells.size()}}},
          {"seconds",
           {{"import", input.import_seconds},
            {"base_structure", done.baked.tree_seconds},
            {"line_spaces", done.baked.line_space_seconds},
            {"write", done.write_seconds}}},
          {"peak_memory_bytes", peak_memory_bytes()},
          {"file_bytes", done.bytes}};
}

void print_report(const Arguments& a, const ShardInput& input, const Done& done) {
  for (const std::string& note : input.mesh.notes) std::printf("note        %s\n", note.c_str());
  std::printf("part        %u of %u: %zu of %zu filled cells\n", done.shard.number, done.shard.count,
              done.baked.cell_tables.cells.size(), done.baked.cell_grid.cells.size());
  std::printf("time        import %.2f s, tree %.2f s, cells %.2f s, write %.2f s; peak memory %s\n",
              input.import_seconds, done.baked.tree_seconds, done.baked.line_space_seconds,
              done.write_seconds, size_text(peak_memory_bytes()).c_str());
  std::printf("wrote       %s, %s\n", a.output.c_str(), size_text(done.bytes).c_str());
}

}  // namespace

void write_shard(const Arguments& a, const ShardInput& input, const WriteOptions& write,
                 const Progress& progress) {
  const Shard shard = parse_shard(a.shard);
  Baked baked = bake_shard(input.mesh, a, shard, progress);
  baked.header.source_hash_lo = input.source[0];
  baked.header.source_hash_hi = input.source[1];
  Timer timer;
  if (progress) progress("write", 0);
  const Json meta = provenance(a, baked, input.mesh, input.material_names, input.source, {});
  if (!a.depfile.empty()) write_depfile(a, input.mesh.sources);  // a bake that is stopped leaves none
  const uint64_t bytes = write_part(a.output, baked, shard, {meta, accuracy_of(a), !a.no_exact, write});
  const Done done = {shard, baked, bytes, timer()};
  if (a.common.json)
    json_result() = report_json(a, input, done);
  else if (!a.common.quiet)
    print_report(a, input, done);
}

}  // namespace lsp
