// Scenes made to break things, each with both base structures: baked, validated, traced against Embree with
// extended precision as the judge, traced approximately. And every mesh file of the scenes' folder through
// lsp-bake.
//
// LSP_STRESS_SCENES=long: the large sizes, more rays, and all files of the folder instead of every tenth.
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iostream>
#include <map>
#include <nlohmann/json.hpp>

#include "check.h"
#include "checks.h"
#include "embree_scene.h"
#include "hard_shapes.h"
#include "process.h"
#include "rays.h"
#include "verdict.h"

namespace lsp {
const char* name_of(Base base) {
  return base == Base::kBvh ? "BVH" : base == Base::kNTree ? "NTree" : "Cells";
}
void PrintTo(Base base, std::ostream* out) { *out << name_of(base); }
}  // namespace lsp

namespace lsp::stress {
namespace {

namespace fs = std::filesystem;

bool long_run() { return std::getenv("LSP_STRESS_SCENES") != nullptr; }

glm::vec3 point(Random& random, double size) {
  const auto real = [&] { return static_cast<float>((2 * random.uniform() - 1) * size); };
  const float x = real(), y = real(), z = real();
  return {x, y, z};
}

Triangles spheres(int n, std::initializer_list<std::pair<glm::vec3, float>> list) {
  Triangles t;
  for (const auto& [centre, radius] : list) bench::add_sphere(t, n, centre, radius);
  std::erase_if(t, [](const auto& c) { return c[0] == c[1] || c[1] == c[2] || c[2] == c[0]; });
  return t;
}

// Needles of length about one and height 10^-decades times that.
Triangles needles(int count, double decades) {
  Triangles t;
  Random random(static_cast<uint64_t>(decades));
  while (static_cast<int>(t.size()) < count) {
    const glm::vec3 a = point(random, 1), b = point(random, 1);
    const glm::vec3 c = 0.5f * (a + b) + point(random, std::pow(10.0, -decades));
    if (a == b || b == c || c == a) continue;
    t.push_back({a, b, c});
  }
  return t;
}

Triangles rotated(Triangles triangles) {
  const double a = 0.7, b = 1.1;
  for (auto& t : triangles) {
    for (glm::vec3& p : t) {
      const glm::dvec3 q(std::cos(a) * p.x - std::sin(a) * p.y, std::sin(a) * p.x + std::cos(a) * p.y, p.z);
      p = glm::vec3(q.x, std::cos(b) * q.y - std::sin(b) * q.z, std::sin(b) * q.y + std::cos(b) * q.z);
    }
  }
  return triangles;
}

Triangles in_one_point(int count) {
  Triangles t;
  Random random(5);
  for (int i = 0; i < count; ++i) {
    const glm::vec3 a(1, 2, 3);
    t.push_back({a + point(random, 1e-5), a + point(random, 1e-5), a});
  }
  std::erase_if(t, [](const auto& c) { return c[0] == c[1] || c[1] == c[2] || c[2] == c[0]; });
  return t;
}

Triangles teapot_in_stadium() {
  Triangles t;
  bench::add_grid(t, 4, glm::vec3(-130, 0, -100), glm::vec3(0, 0, 200), glm::vec3(260, 0, 0));
  for (int row = 0; row < 30; ++row) {  // steps, each long and thin
    const auto y = static_cast<float>(row);
    bench::add_grid(t, 1, glm::vec3(-130, y, -70 - y), glm::vec3(260, 0, 0), glm::vec3(0, 1, 0));
    bench::add_grid(t, 1, glm::vec3(-130, y, 70 + y), glm::vec3(0, 1, 0), glm::vec3(260, 0, 0));
  }
  const Triangles pot = spheres(20, {{glm::vec3(0, 0.15f, 0), 0.15f}, {glm::vec3(0.13f, 0.2f, 0), 0.06f}});
  t.insert(t.end(), pot.begin(), pot.end());
  return t;
}

struct Case {
  const char* name;
  std::function<Triangles(Base)> make;
};

void PrintTo(const Case& made, std::ostream* out) { *out << made.name; }

const std::vector<Case>& cases() {
  static const std::vector<Case> all = {
      {"a_room", [](Base) { return room(); }},
      {"scaled_by_1e_minus_6", [](Base) { return placed(room(), 1e-6f, glm::vec3(0)); }},
      {"scaled_by_1e6", [](Base) { return placed(room(), 1e6f, glm::vec3(0)); }},
      {"moved_by_1e7", [](Base) { return placed(room(), 1e4f, glm::vec3(1e7f, -1e7f, 1e7f)); }},
      {"moved_by_1e7_small", [](Base) { return placed(room(), 64, glm::vec3(1e7f, 0, 0)); }},
      {"rotated", [](Base) { return rotated(room()); }},
      {"flat",
       [](Base) {
         Triangles t;
         bench::add_grid(t, 20, glm::vec3(0), glm::vec3(1, 0, 0), glm::vec3(0, 0, 1));
         return t;
       }},
      {"one_triangle",
       [](Base) {
         return Triangles{{glm::vec3(0), glm::vec3(1, 0.1f, 0), glm::vec3(0.2f, 1, 0.3f)}};
       }},
      {"two_coincident",
       [](Base) {
         return Triangles(2, {glm::vec3(0), glm::vec3(1, 0.1f, 0), glm::vec3(0.2f, 1, 0.3f)});
       }},
      {"needles_1e4", [](Base) { return needles(300, 4); }},
      {"needles_1e8", [](Base) { return needles(300, 8); }},
      {"in_one_point",  // Smaller than the rounding at that distance from the origin: an NTree's cells all
                        // hold all triangles.
       [](Base base) {
         if (base == Base::kNTree) return in_one_point(long_run() ? 3000 : 16);
         if (base == Base::kCells) return in_one_point(1000);  // a cell has room for 8192
         return in_one_point(long_run() ? 1000000 : 3000);
       }},
      {"huge_triangles",
       [](Base) {
         Triangles t = room();
         Random random(6);
         for (int i = 0; i < 40; ++i)
           t.push_back({point(random, 1e3), point(random, 1e3), point(random, 1e3)});
         return t;
       }},
      {"teapot_in_stadium", [](Base) { return teapot_in_stadium(); }},
      {"nested_shells",
       [](Base) {
         Triangles t;
         for (int k = 0; k < 12; ++k)
           bench::add_sphere(t, 12, glm::vec3(0), 1 + 1e-4f * static_cast<float>(k));
         std::erase_if(t, [](const auto& c) { return c[0] == c[1] || c[1] == c[2] || c[2] == c[0]; });
         return t;
       }},
      {"fan", [](Base) { return fan(500); }},
      {"book", [](Base) { return book(300); }},
      {"hedgehog", [](Base) { return hedgehog(150, 0.01f, 0.3f); }},
      {"hedgehog_of_one_point", [](Base) { return hedgehog(150, 0.002f, 0); }},
      {"spiral", [](Base) { return spiral(40, 600); }},
      {"city_on_a_plain", [](Base) { return city(8, 1e4f); }},
      {"long_corner", [](Base) { return long_corner(1e4f, 100); }},
      {"twice_the_same",
       [](Base) {
         return spheres(12, {{glm::vec3(0), 1.0f}, {glm::vec3(0), 1.0f}});
       }},
      {"coincident",
       [](Base) {
         return Triangles(200, {glm::vec3(0), glm::vec3(1, 0.1f, 0), glm::vec3(0.2f, 1, 0.3f)});
       }},
      {"interpenetrating",
       [](Base) {
         return spheres(
             16, {{glm::vec3(0), 1.0f}, {glm::vec3(0.5f, 0, 0), 1.0f}, {glm::vec3(0, 0.5f, 0.3f), 1.0f}});
       }},
  };
  return all;
}

class Scenes : public testing::TestWithParam<std::tuple<Case, Base>> {};

TEST_P(Scenes, BakeValidateAndTraceRight) {
  const auto& [made, base] = GetParam();
  const Triangles triangles = made.make(base);
  const StressScene scene(made.name, triangles, {base, 3, {2, 5}});
  const lsp_scene& s = scene.scene();
  const format::Report report = format::check_file(
      {static_cast<const std::byte*>(s.bytes), s.header->file_bytes}, {.level = format::Level::kGeometry});
  for (const auto& [rule, finding] : report.findings()) {
    if (!finding.examples.empty())
      ADD_FAILURE() << finding.examples[0].path << ": " << finding.examples[0].message;
  }

  // In a heap of a million that all overlap a ray tests most of them.
  const size_t count = triangles.size() >= 100000 ? 400 : long_run() ? 200000 : 4000;
  const bench::EmbreeScene embree(scene.soup());
  std::vector<LspRay> rays = bench::surface_rays(scene.soup(), count, 1);
  for (const char* name : {"edges", "boxes"}) {
    for (LspRay ray : rays_of(family(name), scene, count / 4, 2)) {
      ReferenceRay reference;
      if (!reference_ray(ray, &reference)) continue;
      if (std::string(name) != "edges" && ray.tmin < 1e-3f)
        continue;  // starts on a surface: which is undecided
      rays.push_back(ray);
    }
  }
  std::vector<LspHit> ours(rays.size()), theirs(rays.size()), approximate(rays.size());
  trace_ours(s, 0, rays.data(), ours.data(), rays.size());
  embree.closest(rays, theirs);
  const bench::Agreement agreement = bench::compare_exact(scene.soup(), rays, ours, theirs);
  std::cout << triangles.size() << " triangles, " << agreement.rays << " rays: " << agreement.ties
            << " ties, " << agreement.unresolved << " unresolved, " << agreement.grazes << " grazes, "
            << agreement.ours_wrong << " ours wrong, " << agreement.reference_wrong << " Embree wrong, "
            << agreement.both_wrong << " both wrong\n";
  for (const std::string& fault : agreement.faults) std::cout << fault << "\n";
  EXPECT_EQ(agreement.ours_wrong, 0u);
  EXPECT_EQ(agreement.both_wrong, 0u);
  // Cells that heed no table are exact.
  if (base == Base::kCells) {
    trace_ours(s, LSP_TRACE_APPROXIMATE | LSP_TRACE_MAX_LOSS, rays.data(), approximate.data(), rays.size());
    const bench::Agreement cells = bench::compare_exact(scene.soup(), rays, approximate, theirs);
    EXPECT_EQ(cells.ours_wrong + cells.both_wrong, 0u);
    for (const std::string& fault : cells.faults) std::cout << fault << "\n";
  }
  for (const uint32_t flags : {LSP_TRACE_APPROXIMATE, LSP_TRACE_APPROXIMATE | LSP_TRACE_NEAR_APPROXIMATE,
                               LSP_TRACE_APPROXIMATE | LSP_TRACE_NEAR_SKIP}) {
    trace_ours(s, flags, rays.data(), approximate.data(), rays.size());
    size_t bad = 0;
    for (size_t i = 0; i < rays.size(); ++i) {
      const char* why = malformed(scene.soup(), rays[i], approximate[i]);
      if (why && bad++ == 0) {
        ADD_FAILURE() << "flags " << flags << " ray " << i << ": " << why << ": u " << approximate[i].u
                      << " v " << approximate[i].v << " normal " << approximate[i].normal.x << " "
                      << approximate[i].normal.y << " " << approximate[i].normal.z;
      }
    }
    EXPECT_EQ(bad, 0u);
  }
}

INSTANTIATE_TEST_SUITE_P(Stress, Scenes,
                         testing::Combine(testing::ValuesIn(cases()),
                                          testing::Values(Base::kBvh, Base::kNTree, Base::kCells)),
                         [](const auto& info) {
                           return std::string(std::get<0>(info.param).name) +
                                  (std::get<1>(info.param) == Base::kBvh     ? ""
                                   : std::get<1>(info.param) == Base::kNTree ? "_ntree"
                                                                             : "_cells");
                         });

// Every file ends in a file that lsp-validate passes, or in one of the exit codes for input that is not good;
// never in a crash, a hang or an internal error. Those in a folder named `invalid` are refused, or, where a
// checker says how many good triangles they hold, baked.
TEST(Files, OfTheScenesFolderBakeOrAreRefused) {
  const fs::path root = LSP_SCENES_DIR;
  if (!fs::exists(root / "counts.json")) GTEST_SKIP() << root << " is not here";
  const auto counts = nlohmann::json::parse(std::ifstream(root / "counts.json"));
  std::vector<fs::path> files;
  for (const char* folder : {"hard", "gltf"}) {
    for (const auto& entry : fs::recursive_directory_iterator(root / folder)) {
      const std::string extension = entry.path().extension().string();
      for (const char* known : {".gltf", ".glb", ".obj", ".ply", ".stl", ".off"}) {
        if (extension == known) files.push_back(entry.path());
      }
    }
  }
  std::sort(files.begin(), files.end());
  const fs::path out = fs::temp_directory_path() / ("lsp_stress_files_" + std::to_string(getpid()) + ".lsp");
  std::map<int, size_t> codes;
  size_t tried = 0, refused_invalid = 0;
  for (size_t i = 0; i < files.size(); ++i) {
    const std::string name = fs::relative(files[i], root).string();
    const bool invalid = name.find("/invalid/") != std::string::npos;
    if (!long_run() && !(invalid ? i % 3 == 0 : i % 25 == 0 && fs::file_size(files[i]) < 1000000)) continue;
    SCOPED_TRACE(name);
    ++tried;
    fs::remove(out);
    const bench::ProcessResult baked = bench::run_process(
        {bench::program_path("lsp-bake").string(), files[i].string(), "-o", out.string(), "--quiet",
         "--resolution", "3", "--depth", "5", "--memory-limit", "2G", "--threads", "1"});
    ++codes[baked.exit_code];
    const bool held = baked.exit_code == 0 || baked.exit_code == 2 || baked.exit_code == 3 ||
                      baked.exit_code == 5 || baked.exit_code == 6;
    EXPECT_TRUE(held) << "exit " << baked.exit_code << ": " << baked.errors;
    EXPECT_LT(baked.seconds, 120);
    if (baked.exit_code == 0) {
      const bench::ProcessResult checked = bench::run_process(
          {bench::program_path("lsp-validate").string(), out.string(), "--level", "geometry"});
      EXPECT_EQ(checked.exit_code, 0) << checked.output << checked.errors;
    } else {
      EXPECT_FALSE(fs::exists(out));
      EXPECT_FALSE(baked.errors.empty());
    }
    if (invalid && counts.contains(name)) {
      const bool readable = counts[name].contains("tris");
      if (!readable) {
        EXPECT_NE(baked.exit_code, 0);
        ++refused_invalid;
      }
    }
  }
  fs::remove(out);
  std::cout << tried << " of " << files.size() << " files:";
  for (const auto& [code, number] : codes) std::cout << " exit " << code << ": " << number;
  std::cout << "; " << refused_invalid << " invalid ones refused\n";
  EXPECT_GT(tried, 0u);
}

}  // namespace
}  // namespace lsp::stress
