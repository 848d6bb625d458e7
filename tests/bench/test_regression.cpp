// The gate: noise-free counts and errors of two small scenes against stored figures. A change that makes one
// worse by more than its tolerance fails here until it stores new figures and says why in its commit:
//
//   LSP_UPDATE_EXPECTED=1 build/release/bin/test_regression
//
// Better figures pass and are pointed out.
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iostream>

#include "context.h"
#include "lsp/in_chunks.hpp"
#include "lsp/program.h"
#include "process.h"
#include "shapes.h"
#include "shared_bake.h"
#include "verdict.h"

namespace lsp::bench {
namespace {

namespace fs = std::filesystem;

constexpr size_t kRays = 60000;

struct Scene {
  const char* name;
  fs::path (*make)(const fs::path& directory);
};

fs::path make_room(const fs::path& directory) {
  const fs::path path = directory / "regression-room.ply";
  if (!fs::exists(path)) write_ply(path, room_of_spheres(20000));
  return path;
}

fs::path make_atrium(const fs::path& directory) {
  const fs::path path = directory / "regression-atrium.glb";
  const fs::path program = program_path("lsp-sample-scene");
  if (!fs::exists(path) || fs::last_write_time(path) < fs::last_write_time(program)) {
    const ProcessResult made =
        run_process({program.string(), path.string(), "--triangles", "30000", "--quiet"});
    if (made.exit_code != 0) throw std::runtime_error(made.errors);
  }
  return path;
}

// How much worse a figure may get: a share of the stored one, and an amount for those near zero.
struct Tolerance {
  double share, amount;
};
Tolerance tolerance_of(const std::string& key) {
  if (key.ends_with("_percent") || key.ends_with("_degrees")) return {0.05, 0.01};
  if (key == "file_bytes") return {0.02, 4096};
  if (key == "exact_wrong") return {0, 0};
  return {0.02, 0.005};
}

Json measure(const fs::path& bake) {
  const OpenFile file(bake);
  const Soup soup = soup_of(file.scene());
  const EmbreeScene embree(soup);
  const std::vector<LspRay> rays = surface_rays(soup, kRays, 3);
  std::vector<LspHit> truth(kRays), hits(kRays);
  embree_tracer(embree, EmbreeCall::kSingle, "", machine_threads())->trace({}, rays, truth);
  const auto tracer = cpu_tracer(file, machine_threads());
  Json figures;
  figures["file_bytes"] = fs::file_size(bake);
  for (const Mode& mode :
       {Mode{}, Mode{.any = true}, Mode{.approximate = true}, Mode{.approximate = true, .near_skip = true},
        Mode{.approximate = true, .near_approximate = true}, Mode{.approximate = true, .lod = 0.5f}}) {
    const std::string name = mode.name() + (mode.any ? ", any hit" : "");
    const Work work = count_work(file, mode, rays);
    Json& out = figures[name];
    out["nodes"] = work.nodes;
    out["shafts"] = work.shafts;
    out["triangles"] = work.triangles;
    tracer->trace(mode, rays, hits);
    if (!mode.approximate) {
      if (mode.any) continue;
      const Agreement agreement = compare_exact(soup, rays, hits, truth);
      out["exact_wrong"] = agreement.ours_wrong + agreement.both_wrong;
    } else {
      const RayErrors errors = ray_errors(soup, rays, truth, hits);
      out["wrong_percent"] = 100 * errors.wrong_share();
      out["depth_mean_percent"] = 100 * errors.depth_diagonal.mean;
      out["depth_p99_percent"] = 100 * errors.depth_diagonal.p99;
      out["normal_degrees"] = errors.normal_degrees.mean;
    }
  }
  return figures;
}

void compare(const Json& stored, const Json& now, const std::string& path) {
  for (const auto& [key, value] : stored.items()) {
    ASSERT_TRUE(now.contains(key)) << path << key << " is not measured any more";
    if (value.is_object()) {
      compare(value, now[key], path + key + ": ");
      continue;
    }
    const double before = value.get<double>(), after = now[key].get<double>();
    const Tolerance tolerance = tolerance_of(key);
    const double allowed = before * tolerance.share + tolerance.amount;
    EXPECT_LE(after, before + allowed) << path << key << " was " << before << ", is " << after;
    if (after < before - 2 * allowed) {
      std::cout << "better: " << path << key << " was " << before << ", is " << after << "\n";
    }
  }
}

class Regression : public testing::TestWithParam<Scene> {};

TEST_P(Regression, NothingGotWorse) {
  const fs::path directory = LSP_BAKES_DIR;
  fs::create_directories(directory);
  const fs::path bake =
      shared_bake(GetParam().make(directory), {"--resolution", "4", "--depth", "6,9"}, directory);
  const Json now = measure(bake);
  const fs::path stored = fs::path(LSP_EXPECTED_DIR) / (std::string(GetParam().name) + ".json");
  if (std::getenv("LSP_UPDATE_EXPECTED")) {
    std::ofstream(stored) << now.dump(1) << "\n";
    GTEST_SKIP() << "stored " << stored;
  }
  std::ifstream file(stored);
  ASSERT_TRUE(file) << stored << " is missing";
  compare(Json::parse(file), now, "");
}

INSTANTIATE_TEST_SUITE_P(Bench, Regression,
                         testing::Values(Scene{"room", make_room}, Scene{"atrium", make_atrium}),
                         [](const auto& info) { return std::string(info.param.name); });

}  // namespace
}  // namespace lsp::bench
