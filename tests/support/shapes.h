// Plain shapes for scenes made by the benchmark itself.
#pragma once

#include <array>
#include <filesystem>
#include <glm/glm.hpp>
#include <vector>

#include "soup.h"

namespace lsp::bench {

using Triangles = std::vector<std::array<glm::vec3, 3>>;

// 2 n^2 triangles over the parallelogram corner + a u + b v, facing u x v.
void add_grid(Triangles& out, int n, glm::vec3 corner, glm::vec3 u, glm::vec3 v);

// A sphere of 4 n (n - 1) triangles, facing outward.
void add_sphere(Triangles& out, int n, glm::vec3 centre, float radius);

// A room seen from inside with 27 spheres in it, of about `triangles` triangles (at least some 700).
Triangles room_of_spheres(size_t triangles);

// The triangles as an importer would number them.
Soup soup_of(const Triangles& triangles);

// A binary PLY of unshared corners. Throws Failure(kFile).
void write_ply(const std::filesystem::path& path, const Triangles& triangles);

}  // namespace lsp::bench
