// Scenes made to break things: flat, needle-thin, coincident, tiny, huge, far away.
#include <cmath>
#include <functional>

#include "checks.h"
#include "context.h"
#include "lsp/program.h"
#include "pcg32.h"
#include "process.h"
#include "shapes.h"
#include "verdict.h"

namespace lsp::bench {
namespace {

glm::vec3 random_point(Random& random, float scale) {
  return {static_cast<float>(random.uniform()) * scale, static_cast<float>(random.uniform()) * scale,
          static_cast<float>(random.uniform()) * scale};
}

struct StressCase {
  std::string name;
  std::function<Triangles()> make;
};

// A table. NOLINTNEXTLINE(readability-function-size)
const std::vector<StressCase>& stress_cases() {
  static const std::vector<StressCase> cases = {
      {"one triangle",
       [] {
         return Triangles{{glm::vec3(0), glm::vec3(1, 0, 0), glm::vec3(0, 1, 0)}};
       }},
      {"a plane along two axes",
       [] {
         Triangles t;
         add_grid(t, 60, glm::vec3(0), glm::vec3(1, 0, 0), glm::vec3(0, 0, 1));
         return t;
       }},
      {"40 planes, 1e-5 apart",
       [] {
         Triangles t;
         for (int k = 0; k < 40; ++k) {
           add_grid(t, 10, glm::vec3(0, 1e-5f * static_cast<float>(k), 0), glm::vec3(1, 0, 0),
                    glm::vec3(0, 0, 1));
         }
         return t;
       }},
      {"5,000 needles",
       [] {
         Triangles t;
         Random random(1);
         for (int i = 0; i < 5000; ++i) {
           const glm::vec3 a = random_point(random, 1), b = random_point(random, 1);
           t.push_back({a, b, a + 0.0005f * random_point(random, 1)});
         }
         return t;
       }},
      {"5,000 random triangles, any size",
       [] {
         Triangles t;
         Random random(2);
         for (int i = 0; i < 5000; ++i) {
           const glm::vec3 a = random_point(random, 1);
           const float size = std::pow(10.0f, static_cast<float>(-3 * random.uniform()));
           t.push_back({a, a + random_point(random, size), a + random_point(random, size)});
         }
         return t;
       }},
      {"2,000 times the same triangle",
       [] {
         return Triangles(2000, {glm::vec3(0), glm::vec3(1, 0.2f, 0), glm::vec3(0.1f, 1, 0.3f)});
       }},
      {"a sphere a hundred thousand radii away",
       [] {
         Triangles t;
         add_sphere(t, 40, glm::vec3(1e5f, 0, -1e5f), 1);
         return t;
       }},
      {"a sphere of 1e-6",
       [] {
         Triangles t;
         add_sphere(t, 40, glm::vec3(0), 1e-6f);
         return t;
       }},
      {"a sphere of 1e6",
       [] {
         Triangles t;
         add_sphere(t, 40, glm::vec3(0), 1e6f);
         return t;
       }},
      {"a fine sphere on a coarse plane a million times its size",
       [] {
         Triangles t;
         add_grid(t, 2, glm::vec3(-5000, 0, -5000), glm::vec3(10000, 0, 0), glm::vec3(0, 0, 10000));
         add_sphere(t, 60, glm::vec3(0.3f, 0.01f, 0.7f), 0.01f);
         return t;
       }},
      {"a thousand cubes",
       [] {
         Triangles t;
         for (int i = 0; i < 1000; ++i) {
           const glm::vec3 at(static_cast<float>(i % 10), static_cast<float>(i / 10 % 10),
                              static_cast<float>(i / 100));
           for (int axis = 0; axis < 3; ++axis) {
             glm::vec3 u(0), v(0), w(0);
             u[(axis + 1) % 3] = v[(axis + 2) % 3] = w[axis] = 0.5f;
             add_grid(t, 1, at, u, v);
             add_grid(t, 1, at + w, v, u);
           }
         }
         return t;
       }},
  };
  return cases;
}

// Families of rays over rooms of every scale, each answer judged in double precision (tests/stress).
Table family_table(Context& context) {
  Table table{"families", "Rays made to break things", "", {}, {}};
  table.columns = {{"family", "family"},       {"what", "rays"},
                   {"cases", "cases"},         {"failures", "failures"},
                   {"undecided", "undecided"}, {"worst", "worst depth error, of its bound", 3},
                   {"scene", "where"}};
  const std::vector<stress::StressScene> scenes = stress::family_scenes();
  for (const stress::Family& family : stress::families()) {
    context.progress(std::string("stress: rays: ") + family.name);
    stress::Outcome sum;
    for (const stress::StressScene& scene : scenes) {
      sum += stress::check_family(family, scene, stress::trace_ours,
                                  context.accuracy_rays() / (context.quick ? 6 : 1) / scenes.size(), 1);
    }
    Json row;
    row["family"] = family.name;
    row["what"] = family.what;
    row["cases"] = sum.cases;
    row["failures"] = sum.failures;
    row["undecided"] = sum.undecided;
    row["worst"] = sum.worst;
    row["scene"] = sum.worst_where.substr(0, sum.worst_where.find(' '));
    row["ray"] = sum.worst_where;
    table.rows.push_back(row);
    if (sum.failures != 0) {
      context.warnings.push_back(std::string("stress, rays, ") + family.name + ": " + sum.first_failure);
    }
  }
  return table;
}

// What a baked file answers against Embree, and its tables' errors.
void add_answers(const Context& context, const std::filesystem::path& baked, Json& row) {
  const OpenFile file(baked);
  const Soup soup = soup_of(file.scene());
  const EmbreeScene embree(soup);
  const std::vector<LspRay> rays = surface_rays(soup, context.accuracy_rays() / 5, 1);
  std::vector<LspHit> truth(rays.size()), exact(rays.size()), approximate(rays.size());
  embree_tracer(embree, EmbreeCall::kSingle, "", context.threads)->trace({}, rays, truth);
  const auto ours = cpu_tracer(file, context.threads);
  ours->trace({}, rays, exact);
  const Agreement agreement = compare_exact(soup, rays, exact, truth);
  row["ties"] = agreement.ties;
  row["grazes"] = agreement.grazes;
  row["unresolved"] = agreement.unresolved;
  row["ours_wrong"] = agreement.ours_wrong + agreement.both_wrong;
  row["embree_wrong"] = agreement.reference_wrong;
  if (file.has_line_spaces()) {
    ours->trace({.approximate = true}, rays, approximate);
    const RayErrors errors = ray_errors(soup, rays, exact, approximate);
    row["true_hits_percent"] = 100 * static_cast<double>(errors.true_hits) / static_cast<double>(rays.size());
    add_errors(row, errors);
  }
}

}  // namespace

Section stress_suite(Context& context) {
  Section section{"stress", "Scenes made to break things", {}, {}, {}, {}};
  section.paragraphs.push_back(
      "Each is baked, validated, and traced: the exact trace against Embree with extended precision as the "
      "judge, "
      "the approximate trace (N = 4, D = 9, near field exact) for its error. A plane or a lone triangle lets "
      "most "
      "of its rays go, so there the share of wrong answers is what a single surface costs.");
  section.paragraphs.push_back(
      "Before that, families of rays over rooms of every scale and both base structures: undecided is what "
      "the error "
      "bounds of a trace in single precision leave open, a ray at an edge for one.");
  Table table{"stress", "Stress scenes", "", {}, {}};
  table.columns = {{"scene", "scene"},
                   {"triangles", "triangles"},
                   {"bake_seconds", "bake, s"},
                   {"file_mb", "file, MB"},
                   {"valid", "valid"},
                   {"ties", "ties"},
                   {"grazes", "grazes"},
                   {"unresolved", "unresolved"},
                   {"ours_wrong", "exact wrong"},
                   {"embree_wrong", "Embree wrong"},
                   {"true_hits_percent", "rays that hit, %", 1}};
  for (const Column& column : error_columns()) table.columns.push_back(column);
  std::filesystem::create_directories(context.cache);
  size_t number = 0;
  for (const StressCase& stress : stress_cases()) {
    context.progress("stress: " + stress.name);
    context.guarded(section, stress.name, [&] {
      const auto input = context.cache / ("stress-" + std::to_string(++number) + ".ply");
      const Triangles triangles = stress.make();
      write_ply(input, triangles);
      Json row;
      row["scene"] = stress.name;
      row["triangles"] = triangles.size();
      const auto baked_path = context.cache / ("stress-" + std::to_string(number) + ".lsp");
      const ProcessResult bake =
          run_process({program_path("lsp-bake").string(), input.string(), "-o", baked_path.string(),
                       "--resolution", "4", "--depth", "9", "--quiet"});
      row["bake_seconds"] = bake.seconds;
      if (bake.exit_code != 0) {
        row["valid"] = "bake failed: " + bake.errors.substr(0, bake.errors.find('\n'));
        table.rows.push_back(row);
        context.warnings.push_back("stress, " + stress.name + ": the bake failed");
        return;
      }
      const ProcessResult check =
          run_process({program_path("lsp-validate").string(), baked_path.string(), "--level", "geometry"});
      row["valid"] = check.exit_code == 0;
      if (check.exit_code != 0)
        context.warnings.push_back("stress, " + stress.name + ": the file is not valid");
      row["file_mb"] = static_cast<double>(std::filesystem::file_size(baked_path)) * 1e-6;
      add_answers(context, baked_path, row);
      table.rows.push_back(row);
    });
  }
  context.guarded(section, "families of rays", [&] { section.tables.push_back(family_table(context)); });
  section.tables.push_back(std::move(table));
  return section;
}

}  // namespace lsp::bench
