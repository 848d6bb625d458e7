#include "report.h"

#include <algorithm>
#include <cinttypes>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "figures.h"

namespace lsp {
namespace {

// Of the tree for exact rays: wide ones, or those of a BVH or NTree.
uint32_t nodes_of(const LspHeader& header) { return header.node_count + header.wide_node_count; }

using Json = nlohmann::ordered_json;

// Triangle records that are there in part.
uint64_t partial_records(const Baked& baked) {
  return uint64_t(std::count_if(baked.triangles.begin(), baked.triangles.end(), has_gaps));
}

// Null without cells.
Json cells_json(const LspHeader& h) {
  if (h.cells.cells_x == 0) return nullptr;
  return {{"grid", {h.cells.cells_x, h.cells.cells_y, h.cells.cells_z}},
          {"filled", h.filled_cell_count},
          {"planes", h.plane_count},
          {"splits", h.split_count}};
}

}  // namespace

Json report_json(const BakeReport& done, const Json& meta) {
  const Baked& baked = done.baked;
  const LineSpaces& ls = baked.line_spaces;
  return {{"output", done.arguments.output.string()},
          {"triangles", meta["triangles"]},
          {"origin", meta["origin"]},
          {"notes", done.mesh.notes},
          {"skipped", baked.skipped},
          {"error", meta["error"]},
          {"qualities", meta["qualities"]},
          {"nodes", nodes_of(baked.header)},
          {"triangle_records", baked.header.triangle_count},
          {"partial_records", partial_records(baked)},
          {"depth", baked.header.max_depth},
          {"line_spaces", baked.header.line_space_count},
          {"shafts", ls.shafts},
          {"filled_shafts", ls.filled},
          {"dense_line_spaces", ls.dense},
          {"cells", cells_json(baked.header)},
          {"seconds",
           {{"import", done.import_seconds},
            {"base_structure", baked.tree_seconds},
            {"line_spaces", baked.line_space_seconds},
            {"write", done.write_seconds}}},
          {"peak_memory_bytes", peak_memory_bytes()},
          {"file_bytes", done.written.file_bytes},
          {"content_hash", hex128(baked.header.content_hash_lo, baked.header.content_hash_hi)},
          {"sections", to_json(done.written.sections)}};
}

void print_report(const BakeReport& done) {
  const Mesh& mesh = done.mesh;
  const Baked& baked = done.baked;
  const LineSpaces& ls = baked.line_spaces;
  std::printf("read        %" PRIu64 " triangles, kept %zu\n", mesh.primitive_count, mesh.triangles.size());
  if (mesh.rejected.total())
    std::printf("dropped     %" PRIu64 " degenerate, %" PRIu64 " non-finite, %" PRIu64
                " with an index out of range, %" PRIu64 " too small, %" PRIu64 " wholly transparent\n",
                mesh.rejected.degenerate, mesh.rejected.non_finite, mesh.rejected.out_of_range,
                mesh.rejected.collapsed, mesh.rejected.invisible);
  if (mesh.origin != glm::dvec3(0))
    std::printf("origin      %.17g %.17g %.17g: positions, rays and hits are relative to it\n", mesh.origin.x,
                mesh.origin.y, mesh.origin.z);
  for (const std::string& note : mesh.notes) std::printf("note        %s\n", note.c_str());
  if (const uint64_t partial = partial_records(baked))
    std::printf("partial     %" PRIu64 " triangle records are there in part\n", partial);
  std::printf("tree        %u nodes, %u triangle records, depth %u\n", nodes_of(baked.header),
              baked.header.triangle_count, baked.header.max_depth);
  if (const LspCellGrid& g = baked.header.cells; g.cells_x)
    std::printf("cells       %u x %u x %u, %u filled; %u splits, %u planes\n", g.cells_x, g.cells_y,
                g.cells_z, baked.header.filled_cell_count, baked.header.split_count,
                baked.header.plane_count);
  if (baked.header.line_space_count)
    std::printf("Line Spaces %u, %.1f %% of the shafts filled\n", baked.header.line_space_count,
                100.0 * double(ls.filled) / double(std::max<uint64_t>(1, ls.shafts)));
  print_error(done.error);
  print_qualities(baked.qualities);
  for (const std::string& s : baked.skipped) std::printf("skipped     %s\n", s.c_str());
  std::printf("time        import %.2f s, tree %.2f s, Line Spaces %.2f s, write %.2f s; peak memory %s\n",
              done.import_seconds, baked.tree_seconds, baked.line_space_seconds, done.write_seconds,
              size_text(peak_memory_bytes()).c_str());
  print_sections(done.written.sections);
  std::printf("wrote       %s, %s\n", done.arguments.output.c_str(),
              size_text(done.written.file_bytes).c_str());
  std::fflush(stdout);
}

}  // namespace lsp
