#include "hard_shapes.h"

#include <cmath>

namespace lsp::stress {
namespace {

using bench::Triangles;

// On the circle of radius 1 about the y axis.
glm::vec3 on_circle(double turn) {
  const double angle = 2 * M_PI * turn;
  return {static_cast<float>(std::cos(angle)), 0, static_cast<float>(std::sin(angle))};
}

void add_box(Triangles& out, glm::vec3 lo, glm::vec3 size) {
  const glm::vec3 x(size.x, 0, 0), y(0, size.y, 0), z(0, 0, size.z);
  bench::add_grid(out, 1, lo, z, y);
  bench::add_grid(out, 1, lo + x, y, z);
  bench::add_grid(out, 1, lo, x, z);
  bench::add_grid(out, 1, lo + y, z, x);
  bench::add_grid(out, 1, lo, y, x);
  bench::add_grid(out, 1, lo + z, x, y);
}

}  // namespace

Triangles fan(int count) {
  Triangles t;
  for (int i = 0; i < count; ++i)
    t.push_back({glm::vec3(0, 1, 0), on_circle(double(i + 1) / count), on_circle(double(i) / count)});
  return t;
}

Triangles book(int count) {
  Triangles t;
  for (int i = 0; i < count; ++i)
    t.push_back({glm::vec3(0), glm::vec3(0, 1, 0), on_circle(double(i) / count) + glm::vec3(0, 0.5f, 0)});
  return t;
}

Triangles hedgehog(int needles, float width, float inner) {
  Triangles t;
  for (int i = 0; i < needles; ++i) {
    // Evenly over the sphere, by the golden angle.
    const double y = 1 - 2 * (i + 0.5) / needles, r = std::sqrt(1 - y * y);
    const glm::vec3 axis =
        static_cast<float>(r) * on_circle(i * 0.38196601125) + glm::vec3(0, static_cast<float>(y), 0);
    const glm::vec3 u = glm::normalize(glm::cross(axis, glm::vec3(0.3f, 0.5f, 0.8f))),
                    v = glm::cross(axis, u);
    const auto foot = [&](int k) {
      const glm::vec3 place = on_circle(k / 3.0);
      return inner * axis + width * (place.x * u + place.z * v);
    };
    for (int k = 0; k < 3; ++k) t.push_back({foot(k), foot(k + 1), axis});
  }
  return t;
}

Triangles spiral(int turns, int strips) {
  Triangles t;
  const glm::vec3 up(0, 1, 0);
  const auto at = [&](int i) {
    const double share = double(i) / strips;
    return static_cast<float>(0.1 + 0.9 * share) * on_circle(share * turns);
  };
  for (int i = 0; i < strips; ++i) {
    t.push_back({at(i), at(i + 1), at(i + 1) + up});
    t.push_back({at(i), at(i + 1) + up, at(i) + up});
  }
  return t;
}

Triangles city(int blocks, float scale) {
  Triangles t;
  for (int i = 0; i < blocks; ++i)
    for (int j = 0; j < blocks; ++j)
      add_box(t, glm::vec3(i, 0, j), glm::vec3(0.6f, 1 + 0.3f * float((7 * i + 3 * j) % 5), 0.6f));
  const float far = scale * float(blocks);
  t.push_back({glm::vec3(-far, 0, -far), glm::vec3(0, 0, far), glm::vec3(far, 0, -far)});
  return t;
}

Triangles long_corner(float length, int pieces) {
  Triangles t;
  const float step = length / float(pieces);
  for (int i = 0; i < pieces; ++i)
    for (const bool turned : {false, true}) {
      const glm::vec3 along = turned ? glm::vec3(0, 0, step) : glm::vec3(step, 0, 0),
                      across = turned ? glm::vec3(1, 0, 0) : glm::vec3(0, 0, 1), up(0, 1, 0);
      const glm::vec3 at = float(i) * along;
      bench::add_grid(t, 1, at, along, across);
      bench::add_grid(t, 1, at + up, along, across);
      bench::add_grid(t, 1, at, along, up);
      bench::add_grid(t, 1, at + across, along, up);
    }
  return t;
}

}  // namespace lsp::stress
