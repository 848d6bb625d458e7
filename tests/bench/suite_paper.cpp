// The paper's table: each base structure without Line Spaces and with them at two depths, per scene; what
// the bake costs, how fast it traces, how wrong it is. Beyond the paper: the same on a CPU and on Vulkan, and
// the error of what is fast.
#include <fcntl.h>
#include <unistd.h>

#include <cmath>
#include <cstdio>

#include "context.h"
#include "lsp/program.h"
#include "ray_errors.h"

namespace lsp::bench {
namespace {

// What the paper's table 1 says of a structure with and without Line Spaces: seconds of initialisation
// (GeForce GTX 1080), megabytes, frames of indirect light a second, and how many times as fast its Line
// Spaces made them.
struct PaperCell {
  const char* scene;
  const char* structure;
  double pure_seconds, pure_mb, pure_frames, seconds, mb, frames, times;
};
constexpr PaperCell kPaper[] = {
    {"bunny", "BVH9", 0.3, 5.5, 76.7, 2.2, 38.7, 194.7, 2.5},
    {"bunny", "BVH12", 0.3, 5.5, 76.7, 10.4, 227.2, 131.0, 1.7},
    {"bunny", "NT6", 3.7, 1.5, 20.6, 9.6, 17.6, 89.4, 4.3},
    {"bunny", "NT10", 17.2, 23.9, 36.7, 44.3, 149.7, 63.0, 1.7},
    {"dragon", "BVH9", 1.7, 35.5, 45.9, 5.6, 74.8, 169.4, 3.7},
    {"dragon", "BVH12", 1.7, 35.5, 45.9, 17.1, 280.0, 110.2, 2.4},
    {"dragon", "NT6", 22.5, 4.1, 1.4, 50.3, 10.8, 107.9, 77},
    {"dragon", "NT10", 100.6, 13.2, 11.7, 209.7, 65.5, 62.1, 5.3},
    {"buddha", "BVH9", 2.0, 40.7, 62.4, 6.2, 80.0, 195.4, 3.1},
    {"buddha", "BVH12", 2.0, 40.7, 62.4, 17.6, 285.0, 128.0, 2.1},
    {"buddha", "NT6", 27.6, 4.5, 1.1, 61.6, 10.9, 121.4, 108},
    {"buddha", "NT10", 123.2, 11.6, 12.1, 254.2, 57.5, 69.4, 5.7},
    {"sibenik", "BVH9", 0.1, 3.0, 19.3, 1.9, 57.7, 38.3, 2.0},
    {"sibenik", "BVH12", 0.1, 3.0, 19.3, 7.4, 251.6, 28.4, 1.5},
    {"sibenik", "NT6", 2.3, 8.3, 8.8, 18.6, 286.4, 23.1, 2.6},
    {"sibenik", "NT10", 13.0, 106.9, 8.6, 102.3, 2114.3, 12.8, 1.5},
    {"sponza", "BVH9", 0.5, 10.1, 16.7, 3.0, 54.1, 48.5, 2.9},
    {"sponza", "BVH12", 0.5, 10.1, 16.7, 9.2, 231.2, 33.2, 2.0},
    {"sponza", "NT6", 7.1, 8.9, 5.8, 28.5, 347.6, 27.4, 4.7},
    {"sponza", "NT10", 36.3, 133.3, 10.1, 153.0, 2680.4, 16.2, 1.6},
    {"conference", "BVH9", 0.7, 13.4, 16.0, 3.2, 61.3, 44.6, 2.8},
    {"conference", "BVH12", 0.7, 13.4, 16.0, 9.6, 213.2, 33.6, 2.1},
    {"conference", "NT6", 7.3, 6.3, 1.4, 27.0, 170.9, 26.3, 19},
    {"conference", "NT10", 36.8, 86.3, 8.4, 115.2, 1014.9, 20.7, 2.5},
};

struct Structure {
  std::string name;
  Bake bake;
  std::string paper;   // its key in kPaper, empty: not in the paper
  std::string reason;  // not empty: not run, and why
};

std::vector<Structure> structures(const Context& context) {
  std::vector<Structure> all = {
      {context.quick ? "BVH, LS (9), N = 4" : "BVH, LS (9)", context.base_bake(), "BVH9", ""}};
  if (context.quick) {
    all.push_back({"NT (6, 3), LS (1)", ntree_bake(6, 1), "NT6", ""});
    return all;
  }
  // The large ones choose candidates by the centroid ray alone, as the paper does: five rays a shaft, the
  // default, would take half an hour for six scenes.
  const auto by_centroid = [](Bake bake) -> Bake {
    bake.name += "-S1";
    bake.options.insert(bake.options.end(), {"--samples", "1"});
    return bake;
  };
  all.push_back({"BVH, LS (12), centroid rays", by_centroid(line_space_bake(6, 12)), "BVH12", ""});
  // The paper's depth of 3 may count the root: then its cells have cells, and these hold triangles.
  all.push_back({"NT (6, 2), LS (1)", ntree_bake(6, 1, 2), "NT6", ""});
  all.push_back({"NT (6, 3), LS (1)", ntree_bake(6, 1), "NT6", ""});
  all.push_back({"NT (6, 3), LS (2), centroid rays", by_centroid(ntree_bake(6, 2)), "NT6", ""});
  all.push_back({"NT (10, 2), LS (1), centroid rays", by_centroid(ntree_bake(10, 1, 2)), "NT10", ""});
  all.push_back({"NT (10, 3), LS (1), centroid rays", by_centroid(ntree_bake(10, 1)), "NT10", ""});
  all.push_back({"NT (10, 3), LS (2), centroid rays", by_centroid(ntree_bake(10, 2)), "NT10",
                 context.large ? "" : "gigabytes a scene: --large runs it"});
  return all;
}

void add_paper(Json& row, const std::string& scene, const Structure& structure, bool line_spaces) {
  for (const PaperCell& cell : kPaper) {
    if (scene.rfind(cell.scene, 0) != 0 || structure.paper != cell.structure) continue;
    row["paper_seconds"] = line_spaces ? cell.seconds : cell.pure_seconds;
    row["paper_mb"] = line_spaces ? cell.mb : cell.pure_mb;
    row["paper_frames"] = line_spaces ? cell.frames : cell.pure_frames;
    if (line_spaces) row["paper_times"] = cell.times;
  }
}

const std::vector<Mode> kModes = {{},
                                  {.approximate = true},
                                  {.approximate = true, .near_skip = true},
                                  {.approximate = true, .near_approximate = true}};

// Every structure beside the pure BVH of its scene: what a ratio to the pure structure says depends on how
// good that is, this does not.
Table beside_the_bvh(const Table& measured) {
  Table table{
      "paper_beside_bvh",
      "Beside the pure BVH",
      "How many times as fast as the exact trace of the scene's BVH each structure is, pure and with Line "
      "Spaces in the paper's mode, in ordered rays; beside it the same of the paper's frames a second.",
      {{"scene", "scene"},
       {"structure", "structure"},
       {"pure", "pure, CPU"},
       {"pure_vulkan", "pure, Vulkan"},
       {"pure_paper", "pure, paper"},
       {"line_spaces", "Line Spaces, CPU"},
       {"line_spaces_vulkan", "Line Spaces, Vulkan"},
       {"line_spaces_paper", "Line Spaces, paper"}},
      {}};
  const auto row_of = [&](const std::string& scene, const std::string& structure,
                          const Mode& mode) -> const Json* {
    for (const Json& row : measured.rows) {
      if (row.value("scene", "") == scene && row.value("structure", "").rfind(structure, 0) == 0 &&
          row.value("mode", "") == mode.name())
        return &row;
    }
    return nullptr;
  };
  for (const Json& with : measured.rows) {
    const std::string scene = with.value("scene", ""), structure = with.value("structure", "");
    const Json* bvh = row_of(scene, "BVH, LS (9)", kModes.front());
    const Json* pure = row_of(scene, structure, kModes.front());
    if (bvh == nullptr || pure == nullptr || with.value("mode", "") != kModes.back().name()) continue;
    Json row;
    row["scene"] = scene;
    row["structure"] = structure;
    const auto add = [&](const char* key, const Json& of, const char* speed) {
      if (of.contains(speed) && bvh->contains(speed))
        row[key] = of[speed].get<double>() / (*bvh)[speed].get<double>();
    };
    add("pure", *pure, "ordered_all_mrays");
    add("pure_vulkan", *pure, "vulkan_ordered_mrays");
    add("pure_paper", *pure, "paper_frames");
    add("line_spaces", with, "ordered_all_mrays");
    add("line_spaces_vulkan", with, "vulkan_ordered_mrays");
    add("line_spaces_paper", with, "paper_frames");
    table.rows.push_back(row);
  }
  return table;
}

// Every mode against exact on the same file, on one tracer.
std::vector<Timing> race_modes(const Context& context, Tracer& tracer, std::span<const LspRay> rays) {
  std::vector<LspHit> hits(rays.size());
  std::vector<Contender> contenders;
  for (const Mode& mode : kModes) {
    contenders.push_back({mode.name(), [&, mode] { return tracer.trace(mode, rays, hits); }});
  }
  return race(contenders, 1, context.repeats());
}

// A thread alone and a software device get fewer rays: ratios are what is wanted, and minutes are short.
std::span<const LspRay> some_of(const RaySet& set) { return std::span(set.rays).first(set.rays.size() / 4); }

void add_structure(Context& context, SceneUnderTest& scene, const Structure& structure, Table& table,
                   const std::vector<RaySet>& sets) {
  if (!structure.reason.empty()) {
    Json row;
    row["scene"] = scene.name();
    row["structure"] = structure.name + ": not run, " + structure.reason;
    add_paper(row, scene.name(), structure, true);
    table.rows.push_back(row);
    return;
  }
  const Baked& baked = scene.bake(structure.bake);
  if (!baked.available) {
    Json row;
    row["scene"] = scene.name();
    row["structure"] = structure.name + ": not available, " + baked.reason;
    table.rows.push_back(row);
    return;
  }
  const OpenFile file(baked.path);
  const RaySet& surface = scene.surface(context.accuracy_rays());
  const auto one = cpu_tracer(file, 1), all = cpu_tracer(file, context.threads);
  const std::unique_ptr<Tracer> vulkan = context.vulkan_tracer(file, scene.name() + ", " + structure.name);
  std::vector<std::vector<Timing>> times;
  std::vector<std::vector<Timing>> vulkan_times;
  for (const RaySet& set : sets) {
    times.push_back(context.quick ? std::vector<Timing>() : race_modes(context, *one, some_of(set)));
    times.push_back(race_modes(context, *all, set.rays));
    if (!vulkan) continue;
    std::vector<Timing> raced =
        context.race_on_vulkan(*vulkan, kModes, some_of(set), 3, scene.name() + ", " + structure.name);
    if (!raced.empty()) vulkan_times.push_back(std::move(raced));
  }
  for (size_t m = 0; m < kModes.size(); ++m) {
    if (kModes[m].approximate && !file.has_line_spaces()) continue;
    Json row;
    row["scene"] = scene.name();
    row["triangles"] = scene.soup().size();
    row["structure"] = structure.name;
    row["mode"] = kModes[m].name();
    row["bake_seconds"] = baked.seconds;
    row["peak_mib"] = static_cast<double>(baked.peak_bytes) / (1 << 20);
    row["file_mb"] = static_cast<double>(baked.file_bytes) * 1e-6;
    const std::string what = scene.name() + ", " + structure.name + ", " + kModes[m].name();
    const char* keys[] = {"ordered_1", "ordered_all", "shuffled_1", "shuffled_all"};
    for (size_t k = 0; k < times.size() && k < 4; ++k) {
      if (times[k].empty()) continue;
      row[std::string(keys[k]) + "_mrays"] =
          mega(k % 2 == 0 ? some_of(sets[k / 2]).size() : sets[k / 2].rays.size(), times[k][m]);
      if (m > 0)
        row[std::string(keys[k]) + "_times"] =
            context.speed_up(what + ", " + keys[k], times[k][m], times[k][0]);
    }
    const char* vulkan_keys[] = {"vulkan_ordered", "vulkan_shuffled"};
    for (size_t k = 0; k < vulkan_times.size() && k < 2; ++k) {
      row[std::string(vulkan_keys[k]) + "_mrays"] = mega(some_of(sets[k]).size(), vulkan_times[k][m]);
      if (m > 0) {
        row[std::string(vulkan_keys[k]) + "_times"] =
            context.speed_up(what + ", " + vulkan_keys[k], vulkan_times[k][m], vulkan_times[k][0]);
      }
    }
    std::vector<LspHit> hits(surface.rays.size());
    all->trace(kModes[m], surface.rays, hits);
    add_errors(row, ray_errors(scene.soup(), surface.rays, surface.truth, hits));
    const Work work = count_work(file, kModes[m],
                                 std::span(surface.rays).first(std::min<size_t>(surface.rays.size(), 50000)));
    if (!kModes[m].approximate || kModes[m].near_approximate)
      add_paper(row, scene.name(), structure, kModes[m].approximate);
    row["nodes"] = work.nodes;
    row["shafts"] = work.shafts;
    row["triangle_tests"] = work.triangles;
    table.rows.push_back(row);
  }
}

// Opens the file and traces 64 rays, cold (the page cache told to forget the file) or warm; in milliseconds.
double first_ray_milliseconds(const std::filesystem::path& path, const Mode& mode,
                              std::span<const LspRay> rays, bool cold) {
  if (cold) {
    const int descriptor = open(path.c_str(), O_RDONLY | O_CLOEXEC);
    if (descriptor >= 0) {
      fdatasync(descriptor);  // dirty pages cannot be dropped
      posix_fadvise(descriptor, 0, 0, POSIX_FADV_DONTNEED);
      close(descriptor);
    }
  }
  const double start = seconds_since_start();
  const OpenFile file(path);
  std::vector<LspHit> hits(rays.size());
  cpu_tracer(file, 1)->trace(mode, rays, hits);
  return 1e3 * (seconds_since_start() - start);
}

void add_load(Context& context, SceneUnderTest& scene, Table& loads) {
  const Baked& baked = scene.base();
  const std::span<const LspRay> rays = std::span(scene.surface(context.accuracy_rays()).rays).first(64);
  Json row;
  row["scene"] = scene.name();
  row["file_mb"] = static_cast<double>(baked.file_bytes) * 1e-6;
  for (const bool cold : {true, false}) {
    for (const Mode& mode : {kModes[0], kModes[1]}) {
      std::vector<double> times;
      for (int k = 0; k < 5; ++k) times.push_back(first_ray_milliseconds(baked.path, mode, rays, cold));
      row[std::string(cold ? "cold" : "warm") + (mode.approximate ? "_approximate_ms" : "_exact_ms")] =
          timing_of(times).median;
    }
  }
  if (context.vulkan) {
    const OpenFile file(baked.path);
    for (const LoadPath path : {LoadPath::kImport, LoadPath::kUpload}) {
      try {
        context.vulkan->load(file.scene(), LSP_USE_EXACT | LSP_USE_APPROXIMATE, path);
        row[std::string("vulkan_") + name_of(path) + "_ms"] = 1e3 * context.vulkan->load_seconds();
        if (path == LoadPath::kUpload) {
          row["uploaded_mb"] = static_cast<double>(context.vulkan->bytes_uploaded()) * 1e-6;
        }
      } catch (const Failure& failure) {
        context.warnings.push_back(scene.name() + ", " + name_of(path) + ": " + failure.what());
      }
    }
  }
  loads.rows.push_back(row);
}

}  // namespace

Section paper_suite(Context& context) {
  Section section{"paper", "The paper's table", {}, {}, {}, {}};
  section.paragraphs.push_back(
      "Indirect light's rays, per scene and structure: speed in million rays a second (Mrays/s) and times "
      "the exact "
      "trace of the same file in the same run; errors over surface rays against Embree's robust mode. \"1\" "
      "and "
      "\"all\" are threads. Ordered rays come pixel by pixel, shuffled ones in no order.");
  Table table{"paper", "Bake, speed and error", "", {}, {}};
  table.columns = {{"scene", "scene"},
                   {"triangles", "triangles"},
                   {"structure", "structure"},
                   {"mode", "mode"},
                   {"bake_seconds", "bake, s", 1},
                   {"peak_mib", "bake's memory, MiB", 0},
                   {"file_mb", "file, MB", 1},
                   {"ordered_1_mrays", "ordered, 1, Mrays/s"},
                   {"ordered_1_times", "x"},
                   {"ordered_all_mrays", "ordered, all"},
                   {"ordered_all_times", "x"},
                   {"shuffled_1_mrays", "shuffled, 1"},
                   {"shuffled_1_times", "x"},
                   {"shuffled_all_mrays", "shuffled, all"},
                   {"shuffled_all_times", "x"},
                   {"vulkan_ordered_mrays", "Vulkan, ordered"},
                   {"vulkan_ordered_times", "x"},
                   {"vulkan_shuffled_mrays", "Vulkan, shuffled"},
                   {"vulkan_shuffled_times", "x"}};
  for (const Column& column : error_columns()) table.columns.push_back(column);
  for (const Column& column : {Column{"nodes", "nodes a ray", 1}, Column{"shafts", "look-ups a ray", 1},
                               Column{"triangle_tests", "triangles a ray", 1}}) {
    table.columns.push_back(column);
  }
  for (const Column& column :
       {Column{"paper_seconds", "paper: initialisation, s", 1}, Column{"paper_mb", "paper: MB", 1},
        Column{"paper_frames", "paper: frames/s", 1}, Column{"paper_times", "paper: x", 1}}) {
    table.columns.push_back(column);
  }
  section.paragraphs.push_back(
      "The last columns are the paper's own figures: beside an exact row those of the structure alone, "
      "beside the "
      "paper's mode (near field approximate) those with Line Spaces. It counts no geometry in its sizes. Its "
      "pure (6, 3) of the dragon has the size of two levels here (1.2 references a triangle), and its NTree "
      "figures for the bunny, dragon and Buddha fit Line Spaces on the cells of the root, which are at depth "
      "1 here: it may count the root as a level. Both readings are measured.");
  Table loads{
      "loading",
      "Time to the first 64 rays",
      "From opening the file to the answer; cold after telling the system to forget the file's pages (a "
      "disk in memory stays warm). Vulkan: to the end of the first dispatch.",
      {{"scene", "scene"},
       {"file_mb", "file, MB", 1},
       {"cold_exact_ms", "cold, exact, ms"},
       {"cold_approximate_ms", "cold, approximate, ms"},
       {"warm_exact_ms", "warm, exact, ms"},
       {"warm_approximate_ms", "warm, approximate, ms"},
       {"vulkan_import_ms", "Vulkan, import, ms"},
       {"vulkan_upload_ms", "Vulkan, upload, ms"},
       {"uploaded_mb", "uploaded, MB", 1}},
      {}};
  context.each_scene(section, [&](SceneUnderTest& scene) {
    const std::vector<RaySet> sets = {scene.diffuse(context.timing_rays(), false),
                                      scene.diffuse(context.timing_rays(), true)};
    for (const Structure& structure : structures(context)) {
      context.progress("paper: " + scene.name() + " " + structure.name);
      context.guarded(section, scene.name() + ", " + structure.name,
                      [&] { add_structure(context, scene, structure, table, sets); });
    }
    add_load(context, scene, loads);
  });
  Table beside = beside_the_bvh(table);
  section.tables = {std::move(table), std::move(beside), std::move(loads)};
  return section;
}

}  // namespace lsp::bench
