// Marching tetrahedra (Doi and Koide 1991) on the Kuhn subdivision of a grid: six tetrahedra a cube that
// share faces with their neighbours, so that the surface closes without a table of special cases.
#include <array>
#include <cmath>
#include <unordered_map>

#include "surface.h"

namespace lsp::sample {
namespace {

// Corners of a cube by the bits x, y, z of their number; every tetrahedron runs along the diagonal 0-7.
constexpr int kTetrahedra[6][4] = {{0, 1, 3, 7}, {0, 3, 2, 7}, {0, 2, 6, 7},
                                   {0, 6, 4, 7}, {0, 4, 5, 7}, {0, 5, 1, 7}};

class Marcher {
 public:
  Marcher(const Field& field, float lo, float hi, int cells)
      : field_(field), lo_(lo), step_((hi - lo) / static_cast<float>(cells)), points_(cells + 1) {
    const auto n = static_cast<size_t>(points_);
    values_.resize(n * n * n);
    for (size_t i = 0; i < values_.size(); ++i) {
      values_[i] = field(position(i));
      // A value of zero would put vertices of several edges on one point.
      if (std::abs(values_[i]) < 1e-5f) values_[i] = 1e-5f;
    }
  }

  Surface march() {
    for (int z = 0; z + 1 < points_; ++z) {
      for (int y = 0; y + 1 < points_; ++y) {
        for (int x = 0; x + 1 < points_; ++x) {
          for (const auto& corners : kTetrahedra) {
            std::array<size_t, 4> ids{};
            for (size_t i = 0; i < 4; ++i) {
              const int c = corners[i];
              ids[i] = index(x + (c & 1), y + (c >> 1 & 1), z + (c >> 2 & 1));
            }
            tetrahedron(ids);
          }
        }
      }
    }
    return std::move(surface_);
  }

 private:
  size_t index(int x, int y, int z) const {
    const auto n = static_cast<size_t>(points_);
    return static_cast<size_t>(x) + n * (static_cast<size_t>(y) + n * static_cast<size_t>(z));
  }
  glm::vec3 position(size_t id) const {
    const auto n = static_cast<size_t>(points_);
    return glm::vec3(lo_) + step_ * glm::vec3(id % n, id / n % n, id / n / n);
  }

  // The vertex on the edge between the grid points a (inside) and b (outside).
  uint32_t vertex(size_t a, size_t b) {
    const uint64_t key = static_cast<uint64_t>(std::min(a, b)) << 32 | std::max(a, b);
    const auto [found, added] = vertices_.try_emplace(key, static_cast<uint32_t>(surface_.positions.size()));
    if (added) {
      const size_t first = std::min(a, b);
      const size_t second = std::max(a, b);
      // Kept off the grid points: slivers there would have no area in 32-bit floats.
      const float t = std::min(std::max(values_[first] / (values_[first] - values_[second]), 0.04f), 0.96f);
      const glm::vec3 p = position(first) + t * (position(second) - position(first));
      const float h = step_ * 0.1f;
      const glm::vec3 gradient(field_(p + glm::vec3(h, 0, 0)) - field_(p - glm::vec3(h, 0, 0)),
                               field_(p + glm::vec3(0, h, 0)) - field_(p - glm::vec3(0, h, 0)),
                               field_(p + glm::vec3(0, 0, h)) - field_(p - glm::vec3(0, 0, h)));
      surface_.positions.push_back(p);
      surface_.normals.push_back(glm::normalize(gradient));
    }
    return found->second;
  }

  // `outward` points from the inside to the outside of the tetrahedron's part.
  void triangle(uint32_t a, uint32_t b, uint32_t c, glm::vec3 outward) {
    const auto& p = surface_.positions;
    if (glm::dot(glm::cross(p[b] - p[a], p[c] - p[a]), outward) < 0) std::swap(b, c);
    surface_.indices.insert(surface_.indices.end(), {a, b, c});
  }

  void tetrahedron(const std::array<size_t, 4>& ids) {
    std::array<size_t, 4> in{};
    std::array<size_t, 4> out{};
    size_t in_count = 0;
    size_t out_count = 0;
    glm::vec3 in_sum(0);
    glm::vec3 out_sum(0);
    for (const size_t id : ids) {
      if (values_[id] < 0) {
        in[in_count++] = id;
        in_sum += position(id);
      } else {
        out[out_count++] = id;
        out_sum += position(id);
      }
    }
    if (in_count == 0 || out_count == 0) return;
    const glm::vec3 outward = out_sum / static_cast<float>(out_count) - in_sum / static_cast<float>(in_count);
    if (in_count == 1) {
      triangle(vertex(in[0], out[0]), vertex(in[0], out[1]), vertex(in[0], out[2]), outward);
    } else if (in_count == 3) {
      triangle(vertex(in[0], out[0]), vertex(in[1], out[0]), vertex(in[2], out[0]), outward);
    } else {
      const uint32_t a = vertex(in[0], out[0]);
      const uint32_t b = vertex(in[0], out[1]);
      const uint32_t c = vertex(in[1], out[1]);
      const uint32_t d = vertex(in[1], out[0]);
      triangle(a, b, c, outward);
      triangle(a, c, d, outward);
    }
  }

  const Field& field_;
  float lo_;
  float step_;
  int points_;
  std::vector<float> values_;
  std::unordered_map<uint64_t, uint32_t> vertices_;
  Surface surface_;
};

}  // namespace

Surface implicit(const Field& field, float lo, float hi, int cells) {
  return Marcher(field, lo, hi, cells).march();
}

}  // namespace lsp::sample
