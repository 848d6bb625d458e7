// A scene of the stress tests: triangles made here, baked in this process, opened as any program opens it.
#pragma once

#include <filesystem>
#include <memory>
#include <string>

#include "bake.h"
#include "lsp/scene_file.hpp"
#include "shapes.h"
#include "soup.h"

namespace lsp::stress {

using bench::Triangles;

struct SceneOptions {
  Base base = Base::kBvh;
  uint32_t resolution = 4;
  std::vector<uint32_t> depths = {1, 3};  // of the Line Spaces; of an NTree 1
};

// Bakes `triangles`, in import order, into the file. Throws Failure.
void bake_to(const std::filesystem::path& path, const Triangles& triangles, const SceneOptions& options = {});

class StressScene {
 public:
  StressScene(std::string name, const Triangles& triangles, const SceneOptions& options = {});

  const std::string& name() const { return name_; }
  const lsp_scene& scene() const { return file_->scene(); }
  const bench::Soup& soup() const { return soup_; }
  double diagonal() const { return soup_.diagonal; }

 private:
  std::string name_;
  std::unique_ptr<SceneFile> file_;
  bench::Soup soup_;
};

// Some forty triangles with everything in them that is hard for boxes: a closed room of walls without
// thickness, a table in the air, tilted triangles through one another, a needle, two coincident triangles.
Triangles room();

// Rooms of every scale, near and away from the origin, on both base structures.
std::vector<StressScene> family_scenes();

// Scales, then moves.
Triangles placed(Triangles triangles, float scale, glm::vec3 offset);

}  // namespace lsp::stress
