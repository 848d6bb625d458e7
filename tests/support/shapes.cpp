#include "shapes.h"

#include <algorithm>
#include <cmath>
#include <fstream>

#include "lsp/program.h"

namespace lsp::bench {

void add_grid(Triangles& out, int n, glm::vec3 corner, glm::vec3 u, glm::vec3 v) {
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < n; ++j) {
      const auto at = [&](int a, int b) {
        return corner + u * (static_cast<float>(a) / static_cast<float>(n)) +
               v * (static_cast<float>(b) / static_cast<float>(n));
      };
      out.push_back({at(i, j), at(i + 1, j), at(i + 1, j + 1)});
      out.push_back({at(i, j), at(i + 1, j + 1), at(i, j + 1)});
    }
  }
}

void add_sphere(Triangles& out, int n, glm::vec3 centre, float radius) {
  const auto at = [&](int b, int s) {
    const double theta = M_PI * b / n, phi = M_PI * s / n;
    return centre + radius * glm::vec3(std::sin(theta) * std::cos(phi), std::cos(theta),
                                       std::sin(theta) * std::sin(phi));
  };
  for (int b = 0; b < n; ++b) {
    for (int s = 0; s < 2 * n; ++s) {
      if (b > 0) out.push_back({at(b, s), at(b, s + 1), at(b + 1, s)});
      if (b + 1 < n) out.push_back({at(b, s + 1), at(b + 1, s + 1), at(b + 1, s)});
    }
  }
}

Triangles room_of_spheres(size_t triangles) {
  // A sixth of the triangles in the walls, the rest in the spheres.
  const auto wall = static_cast<int>(std::lround(std::sqrt(static_cast<double>(triangles) / 6 / 12)));
  const auto round =
      static_cast<int>(std::lround(0.5 + std::sqrt(static_cast<double>(triangles) * 5 / 6 / 27 / 4)));
  Triangles out;
  for (int axis = 0; axis < 3; ++axis) {
    glm::vec3 u(0), v(0), w(0);
    u[(axis + 1) % 3] = v[(axis + 2) % 3] = w[axis] = 8;
    add_grid(out, std::max(1, wall), glm::vec3(0), u, v);  // the walls face inward
    add_grid(out, std::max(1, wall), w, v, u);
  }
  for (int i = 0; i < 27; ++i) {
    const glm::vec3 cell(i % 3, i / 3 % 3, i / 9);
    add_sphere(out, std::max(3, round), 1.2f + 2.8f * cell + 0.3f * glm::vec3(i % 2, i / 2 % 2, i / 4 % 2),
               0.45f + 0.05f * static_cast<float>(i % 7));
  }
  return out;
}

Soup soup_of(const Triangles& triangles) {
  Soup soup;
  soup.corners = triangles;
  soup.lo = glm::dvec3(INFINITY);
  soup.hi = glm::dvec3(-INFINITY);
  for (uint32_t i = 0; i < triangles.size(); ++i) {
    soup.primitives.push_back(i);
    soup.triangle_of.push_back(i);
    for (const glm::vec3& corner : triangles[i]) {
      soup.lo = glm::min(soup.lo, glm::dvec3(corner));
      soup.hi = glm::max(soup.hi, glm::dvec3(corner));
    }
  }
  soup.diagonal = glm::length(soup.hi - soup.lo);
  return soup;
}

void write_ply(const std::filesystem::path& path, const Triangles& triangles) {
  std::ofstream out(path, std::ios::binary);
  out << "ply\nformat binary_little_endian 1.0\nelement vertex " << 3 * triangles.size()
      << "\nproperty float x\nproperty float y\nproperty float z\nelement face " << triangles.size()
      << "\nproperty list uchar int vertex_indices\nend_header\n";
  out.write(reinterpret_cast<const char*>(triangles.data()),
            static_cast<std::streamsize>(triangles.size() * 36));
  for (int32_t i = 0; i < static_cast<int32_t>(triangles.size()); ++i) {
    const int32_t corners[3] = {3 * i, 3 * i + 1, 3 * i + 2};
    out.put(3);
    out.write(reinterpret_cast<const char*>(corners), sizeof corners);
  }
  out.close();
  if (!out) throw Failure(Exit::kFile, path.string(), "cannot be written");
}

}  // namespace lsp::bench
