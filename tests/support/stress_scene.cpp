#include "stress_scene.h"

#include <unistd.h>

#include <algorithm>

#include "pcg32.h"
#include "writer.h"

namespace lsp::stress {
namespace {

namespace fs = std::filesystem;

// As the importers make it: triangles without area keep their number and are left out.
Mesh mesh_of(const Triangles& triangles) {
  Mesh mesh;
  for (const auto& t : triangles) {
    const auto primitive = static_cast<uint32_t>(mesh.primitive_count++);
    const glm::dvec3 normal = bench::geometric_normal(t);
    double longest = 0;
    for (size_t k = 0; k < 3; ++k) {
      longest = std::max(longest, glm::distance(glm::dvec3(t[k]), glm::dvec3(t[(k + 1) % 3])));
    }
    if (!(0.5 * glm::length(normal) > 1e-14 * longest * longest)) {
      ++mesh.rejected.degenerate;
      continue;
    }
    const auto first = static_cast<uint32_t>(mesh.positions.size());
    mesh.positions.insert(mesh.positions.end(), t.begin(), t.end());
    mesh.triangles.emplace_back(first, first + 1, first + 2);
    mesh.primitives.push_back(primitive);
    const glm::vec3 n(glm::normalize(normal));
    mesh.normals.push_back({n, n, n});
    mesh.material_ids.push_back(0);
  }
  mesh.materials.emplace_back();
  return mesh;
}

}  // namespace

void bake_to(const fs::path& path, const Triangles& triangles, const SceneOptions& options) {
  BakeOptions bake_options;
  bake_options.base = options.base;
  bake_options.cells = 2;  // of few cells: what is asked of them is their exact rays
  bake_options.line_space.resolution = options.resolution;
  bake_options.line_space.depths = options.base == Base::kNTree ? std::vector<uint32_t>{1} : options.depths;
  Baked baked = bake(mesh_of(triangles), bake_options);
  write_lsp(path, baked, "{}", {});
}

StressScene::StressScene(std::string name, const Triangles& triangles, const SceneOptions& options)
    : name_(std::move(name)) {
  static int number = 0;
  const fs::path path = fs::temp_directory_path() /
                        ("lsp_stress_" + std::to_string(getpid()) + "_" + std::to_string(number++) + ".lsp");
  bake_to(path, triangles, options);
  file_ = std::make_unique<SceneFile>(path.string());
  fs::remove(path);  // the mapping keeps it
  soup_ = bench::soup_of(file_->scene());
}

Triangles room() {
  Triangles t;
  const glm::vec3 x(1, 0, 0), y(0, 1, 0), z(0, 0, 1), o(0);
  bench::add_grid(t, 1, o, y, z);  // walls that face inward
  bench::add_grid(t, 1, x, z, y);
  bench::add_grid(t, 1, o, z, x);
  bench::add_grid(t, 1, y, x, z);
  bench::add_grid(t, 1, o, x, y);
  bench::add_grid(t, 1, z, y, x);
  bench::add_grid(t, 2, glm::vec3(0.25f, 0.375f, 0.25f), 0.5f * z, 0.5f * x);  // the table
  bench::Random random(11);
  const auto real = [&](double lo, double hi) {
    return static_cast<float>(lo + (hi - lo) * random.uniform());
  };
  for (int i = 0; i < 14; ++i) {
    const glm::vec3 centre(real(0.2, 0.8), real(0.2, 0.8), real(0.2, 0.8));
    std::array<glm::vec3, 3> corners;
    for (glm::vec3& p : corners) p = centre + glm::vec3(real(-0.2, 0.2), real(-0.2, 0.2), real(-0.2, 0.2));
    t.push_back(corners);
  }
  t.push_back({glm::vec3(0.1f, 0.1f, 0.1f), glm::vec3(0.9f, 0.8f, 0.7f), glm::vec3(0.5f, 0.45001f, 0.4f)});
  const std::array<glm::vec3, 3> twin = {glm::vec3(0.6f, 0.7f, 0.1f), glm::vec3(0.9f, 0.7f, 0.2f),
                                         glm::vec3(0.7f, 0.95f, 0.15f)};
  t.push_back(twin);
  t.push_back(twin);
  return t;
}

Triangles placed(Triangles triangles, float scale, glm::vec3 offset) {
  for (auto& t : triangles) {
    for (glm::vec3& p : t) p = scale * p + offset;
  }
  return triangles;
}

std::vector<StressScene> family_scenes() {
  std::vector<StressScene> made;
  const SceneOptions ntree{Base::kNTree, 4, {}}, cells{Base::kCells, 4, {}};
  made.emplace_back("room", room());
  made.emplace_back("room_ntree", room(), ntree);
  made.emplace_back("room_cells", room(), cells);
  made.emplace_back("room_small", placed(room(), 1e-6f, glm::vec3(0)));
  made.emplace_back("room_small_ntree", placed(room(), 1e-6f, glm::vec3(0)), ntree);
  made.emplace_back("room_large", placed(room(), 1e6f, glm::vec3(0)));
  made.emplace_back("room_away", placed(room(), 3, glm::vec3(1000, -2000, 500)));
  made.emplace_back("room_away_ntree", placed(room(), 3, glm::vec3(1000, -2000, 500)), ntree);
  made.emplace_back("room_away_cells", placed(room(), 3, glm::vec3(1000, -2000, 500)), cells);
  made.emplace_back("room_moved", placed(room(), 1, glm::vec3(-0.5f)));
  return made;
}

}  // namespace lsp::stress
