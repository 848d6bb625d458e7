// lsp-merge: joins the parts of a bake into its .lsp file.
#include <tbb/global_control.h>

#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>

#include "cells/closed_ways.h"
#include "cells/dial.h"
#include "figures.h"
#include "file.h"
#include "lsp/command_line.h"
#include "lsp/json_result.h"
#include "lsp/output_file.h"
#include "shard/join.h"
#include "timer.h"

namespace {

using namespace lsp;
using Json = nlohmann::ordered_json;

struct Arguments {
  std::vector<std::filesystem::path> parts;
  std::filesystem::path output;
  uint32_t threads = 0;
  CommonOptions common;
};

struct Merged {
  Baked baked;
  MeasuredError error;
  Written written;
  size_t parts;
  double read_seconds, join_seconds, dial_seconds, write_seconds;
};

Json report_json(const Arguments& a, const Merged& done) {
  const LspHeader& h = done.baked.header;
  return {{"output", a.output.string()},
          {"parts", done.parts},
          {"triangle_records", h.triangle_count},
          {"cells",
           {{"grid", {h.cells.cells_x, h.cells.cells_y, h.cells.cells_z}},
            {"filled", h.filled_cell_count},
            {"planes", h.plane_count},
            {"splits", h.split_count}}},
          {"skipped", done.baked.skipped},
          {"error", to_json(done.error)},
          {"qualities", to_json(done.baked.qualities)},
          {"seconds",
           {{"read", done.read_seconds},
            {"join", done.join_seconds},
            {"dial", done.dial_seconds},
            {"write", done.write_seconds}}},
          {"peak_memory_bytes", peak_memory_bytes()},
          {"file_bytes", done.written.file_bytes},
          {"content_hash", hex128(h.content_hash_lo, h.content_hash_hi)},
          {"sections", to_json(done.written.sections)}};
}

void print_report(const Arguments& a, const Merged& done) {
  const LspHeader& h = done.baked.header;
  std::printf("joined      %zu parts\n", done.parts);
  std::printf("cells       %u x %u x %u, %u filled; %u splits, %u planes\n", h.cells.cells_x, h.cells.cells_y,
              h.cells.cells_z, h.filled_cell_count, h.split_count, h.plane_count);
  for (const std::string& skipped : done.baked.skipped) std::printf("skipped     %s\n", skipped.c_str());
  print_error(done.error);
  print_qualities(done.baked.qualities);
  std::printf("time        read %.2f s, join %.2f s, dial %.2f s, write %.2f s; peak memory %s\n",
              done.read_seconds, done.join_seconds, done.dial_seconds, done.write_seconds,
              size_text(peak_memory_bytes()).c_str());
  print_sections(done.written.sections);
  std::printf("wrote       %s, %s\n", a.output.c_str(), size_text(done.written.file_bytes).c_str());
}

// What bake() and lsp-bake do once the tables are there. `file` is named where they err more than they may.
MeasuredError finish(Baked& baked, PartSettings& settings, const std::string& file) {
  find_closed_ways(baked);
  choose_dial(baked, settings.accuracy.wrong);
  if (settings.accuracy.weighed && weigh_tables(baked)) {
    settings.meta["options"]["base"] = "wide";
    settings.meta["options"]["cells"] = 0;
    return {};
  }
  const MeasuredError error = settle_dial(baked, settings.accuracy);
  check_error(error, settings.accuracy.max_error, file);
  if (!settings.exact) keep_tables_only(baked);
  return error;
}

void run(const Arguments& a) {
  check_output(a.output, a.parts);
  std::unique_ptr<tbb::global_control> control;
  if (a.threads)
    control = std::make_unique<tbb::global_control>(tbb::global_control::max_allowed_parallelism, a.threads);
  ProgressBar bar(!a.common.quiet && !a.common.json);
  Timer timer;

  bar.show("read", 0);
  std::vector<std::unique_ptr<format::MappedFile>> files;
  std::vector<Part> parts;
  for (const std::filesystem::path& path : a.parts) {
    files.push_back(std::make_unique<format::MappedFile>(path));
    parts.push_back(read_part(files.back()->bytes(), path.string()));
    bar.show("read", double(parts.size()) / double(a.parts.size()));
  }
  check_parts(parts);
  Merged done{};
  done.parts = parts.size();
  done.read_seconds = timer();

  bar.show("join", 0);
  PartSettings settings = parts.front().settings;
  done.baked = join_parts(parts);
  parts.clear();
  files.clear();
  done.join_seconds = timer();

  bar.show("dial", 0);
  done.error = finish(done.baked, settings, a.parts.front().string());
  settings.meta["error"] = to_json(done.error);
  settings.meta["qualities"] = to_json(done.baked.qualities);
  done.dial_seconds = timer();

  bar.show("write", 0);
  done.written = write_lsp(a.output, done.baked, settings.meta.dump(), settings.write);
  done.write_seconds = timer();
  bar.clear();

  if (a.common.json)
    json_result() = report_json(a, done);
  else if (!a.common.quiet)
    print_report(a, done);
}

}  // namespace

int main(int argc, char** argv) {
  Arguments a;
  CLI::App app(
      "Joins the parts that lsp-bake --shard I/K wrote, in any order, into the .lsp file of the one bake, to "
      "the "
      "byte.",
      "lsp-merge");
  app.option_defaults()->always_capture_default();
  app.add_option("PART", a.parts, "All parts of a bake")->required();
  app.add_option("-o,--output", a.output, "The .lsp file to write")->required();
  add_threads(app, a.threads, "Threads");
  add_common_options(app, "lsp-merge", a.common);
  arrange_help(app, "lsp-merge room.*.part -o room.lsp",
               {{"Options", {"PART", "--output FILE", "--threads"}}});
  return run_program("lsp-merge", app, argc, argv, [&] { run(a); });
}
