// Meshes made here, for the baker's tests.
#pragma once

#include <cmath>
#include <random>

#include "mesh.h"

namespace lsp::test {

inline void add_triangle(Mesh& mesh, const glm::vec3& a, const glm::vec3& b, const glm::vec3& c) {
  const uint32_t first = uint32_t(mesh.positions.size());
  mesh.positions.insert(mesh.positions.end(), {a, b, c});
  mesh.triangles.emplace_back(first, first + 1, first + 2);
  mesh.primitives.push_back(uint32_t(mesh.primitive_count++));
  const glm::vec3 n = glm::normalize(glm::cross(b - a, c - a));
  mesh.normals.push_back({n, n, n});
  mesh.material_ids.push_back(0);
  if (mesh.materials.empty()) mesh.materials.resize(1);
}

// Triangles of many sizes and directions in a unit box: they overlap, so spatial splits find work.
inline Mesh soup(uint32_t count, float size) {
  std::mt19937 random(1);
  const auto uniform = [&] { return float(random() >> 8) / 16777216.0f; };
  Mesh mesh;
  while (mesh.triangles.size() < count) {
    const glm::vec3 p(uniform(), uniform(), uniform());
    const float s = size * uniform();
    const auto corner = [&] { return p + s * (glm::vec3(uniform(), uniform(), uniform()) - 0.5f); };
    const glm::vec3 a = corner(), b = corner(), c = corner();
    if (glm::length(glm::cross(b - a, c - a)) > 1e-9f) add_triangle(mesh, a, b, c);
  }
  return mesh;
}

// A sphere of radius 1 in 2 * rings^2 quads less the poles' halves; normals point outward.
// Small triangles along x, so few that rays get far between them.
inline Mesh row_of_soup(float length) {
  Mesh mesh = soup(uint32_t(30 * length), 0.2f);
  for (glm::vec3& p : mesh.positions) p.x *= length;
  return mesh;
}

inline Mesh sphere(uint32_t rings) {
  Mesh mesh;
  const auto at = [&](uint32_t i, uint32_t j) {
    const double theta = 3.141592653589793 * i / rings, phi = 3.141592653589793 * (j % (2 * rings)) / rings;
    return glm::vec3(std::sin(theta) * std::cos(phi), std::sin(theta) * std::sin(phi), std::cos(theta));
  };
  for (uint32_t i = 0; i < rings; ++i)
    for (uint32_t j = 0; j < 2 * rings; ++j) {
      if (i > 0) add_triangle(mesh, at(i, j), at(i + 1, j), at(i, j + 1));
      if (i + 1 < rings) add_triangle(mesh, at(i, j + 1), at(i + 1, j), at(i + 1, j + 1));
    }
  return mesh;
}

}  // namespace lsp::test
