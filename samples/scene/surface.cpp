#include "surface.h"

#include <algorithm>
#include <cmath>
#include <glm/gtc/matrix_inverse.hpp>

namespace lsp::sample {
namespace {

constexpr float kPi = 3.14159265358979324f;

// Adds a triangle unless it has no area to speak of, as at the poles of a patch.
void add_triangle(Surface& surface, uint32_t a, uint32_t b, uint32_t c) {
  const auto& p = surface.positions;
  const glm::vec3 ab = p[b] - p[a];
  const glm::vec3 ac = p[c] - p[a];
  const float longest = std::max({glm::dot(ab, ab), glm::dot(ac, ac), glm::dot(ac - ab, ac - ab)});
  if (glm::length(glm::cross(ab, ac)) <= 1e-6f * longest) return;
  surface.indices.insert(surface.indices.end(), {a, b, c});
}

// Adds a flat quadrilateral a, b, c, d, counter-clockwise seen from outside.
void add_quad(Surface& surface, glm::vec3 a, glm::vec3 b, glm::vec3 c, glm::vec3 d) {
  const auto first = static_cast<uint32_t>(surface.positions.size());
  const glm::vec3 normal = glm::normalize(glm::cross(c - a, d - b));
  surface.positions.insert(surface.positions.end(), {a, b, c, d});
  surface.normals.insert(surface.normals.end(), 4, normal);
  add_triangle(surface, first, first + 1, first + 2);
  add_triangle(surface, first, first + 2, first + 3);
}

// Normal of a patch by differences. Where the patch degenerates (a pole, a folded edge) a point a little
// further inside stands in.
glm::vec3 patch_normal(const Patch& patch, float u, float v, Closing closing) {
  constexpr float kStep = 1e-3f;
  const bool wraps_u = closing != Closing::kOpen;
  const bool wraps_v = closing == Closing::kTorus;
  for (const float inside : {0.0f, 0.004f, 0.02f, 0.1f}) {
    const float uu = wraps_u ? u : u + (0.5f - u) * inside;
    const float vv = wraps_v ? v : v + (0.5f - v) * inside;
    const float u0 = wraps_u ? uu - kStep : std::max(uu - kStep, 0.0f);
    const float u1 = wraps_u ? uu + kStep : std::min(uu + kStep, 1.0f);
    const float v0 = wraps_v ? vv - kStep : std::max(vv - kStep, 0.0f);
    const float v1 = wraps_v ? vv + kStep : std::min(vv + kStep, 1.0f);
    const glm::vec3 du = (patch(u1, vv) - patch(u0, vv)) / (u1 - u0);
    const glm::vec3 dv = (patch(uu, v1) - patch(uu, v0)) / (v1 - v0);
    const glm::vec3 normal = glm::cross(du, dv);
    const float length = glm::length(normal);
    const float along_u = glm::length(du);
    const float along_v = glm::length(dv);
    const bool balanced = along_u > 1e-3f * along_v && along_v > 1e-3f * along_u;
    if (balanced && length > 1e-3f * along_u * along_v) return normal / length;
  }
  return {0.0f, 1.0f, 0.0f};
}

}  // namespace

void append(Surface& surface, const Surface& other, const glm::mat4& transform) {
  const auto first = static_cast<uint32_t>(surface.positions.size());
  const glm::mat3 normal_transform = glm::inverseTranspose(glm::mat3(transform));
  for (const glm::vec3& p : other.positions) {
    surface.positions.push_back(glm::vec3(transform * glm::vec4(p, 1.0f)));
  }
  for (const glm::vec3& n : other.normals) surface.normals.push_back(glm::normalize(normal_transform * n));
  surface.uvs.insert(surface.uvs.end(), other.uvs.begin(), other.uvs.end());
  for (const uint32_t i : other.indices) surface.indices.push_back(first + i);
}

Surface tessellate(int steps_u, int steps_v, const Patch& patch, Closing closing) {
  Surface surface;
  const bool wraps_u = closing != Closing::kOpen;
  const bool wraps_v = closing == Closing::kTorus;
  const int columns = wraps_u ? steps_u : steps_u + 1;
  const int rows = wraps_v ? steps_v : steps_v + 1;
  const auto is_pole = [&](int row) { return closing == Closing::kSphere && (row == 0 || row == steps_v); };

  std::vector<uint32_t> row_first(static_cast<size_t>(rows));
  for (int row = 0; row < rows; ++row) {
    row_first[static_cast<size_t>(row)] = static_cast<uint32_t>(surface.positions.size());
    const float v = static_cast<float>(row) / static_cast<float>(steps_v);
    for (int column = 0; column < (is_pole(row) ? 1 : columns); ++column) {
      const float u = static_cast<float>(column) / static_cast<float>(steps_u);
      surface.positions.push_back(patch(u, v));
      surface.normals.push_back(patch_normal(patch, u, v, closing));
    }
  }
  const auto vertex = [&](int column, int row) {
    const int wrapped_row = wraps_v ? row % steps_v : row;
    const uint32_t first = row_first[static_cast<size_t>(wrapped_row)];
    return is_pole(wrapped_row) ? first : first + static_cast<uint32_t>(wraps_u ? column % steps_u : column);
  };
  for (int row = 0; row < steps_v; ++row) {
    for (int column = 0; column < steps_u; ++column) {
      const uint32_t a = vertex(column, row);
      const uint32_t b = vertex(column + 1, row);
      const uint32_t c = vertex(column + 1, row + 1);
      const uint32_t d = vertex(column, row + 1);
      add_triangle(surface, a, b, c);
      add_triangle(surface, a, c, d);
    }
  }
  return surface;
}

Surface lathe(const std::vector<Profile>& profiles, int sides, float from_rad, float to_rad) {
  Surface surface;
  const bool full = to_rad - from_rad > 2.0f * kPi - 1e-4f;
  const int columns = full ? sides : sides + 1;
  for (const Profile& profile : profiles) {
    const auto first = static_cast<uint32_t>(surface.positions.size());
    for (size_t i = 0; i < profile.size(); ++i) {
      const glm::vec2 before = profile[i > 0 ? i - 1 : 0];
      const glm::vec2 after = profile[std::min(i + 1, profile.size() - 1)];
      const glm::vec2 along = glm::normalize(after - before);
      for (int column = 0; column < columns; ++column) {
        const float angle =
            from_rad + (to_rad - from_rad) * static_cast<float>(column) / static_cast<float>(sides);
        const float c = std::cos(angle);
        const float s = std::sin(angle);
        // Turning from z towards x keeps d/du x d/dv pointing away from the axis.
        surface.positions.emplace_back(profile[i].x * s, profile[i].y, profile[i].x * c);
        surface.normals.emplace_back(along.y * s, -along.x, along.y * c);
      }
    }
    for (uint32_t row = 0; row + 1 < profile.size(); ++row) {
      for (int column = 0; column < sides; ++column) {
        const auto here = static_cast<uint32_t>(column);
        const auto next = static_cast<uint32_t>((column + 1) % columns);
        const uint32_t lower = first + row * static_cast<uint32_t>(columns);
        const uint32_t upper = lower + static_cast<uint32_t>(columns);
        add_triangle(surface, lower + here, lower + next, upper + next);
        add_triangle(surface, lower + here, upper + next, upper + here);
      }
    }
  }
  return surface;
}

std::vector<Profile> creased(const Profile& points) {
  std::vector<Profile> profiles;
  for (size_t i = 0; i + 1 < points.size(); ++i) profiles.push_back({points[i], points[i + 1]});
  return profiles;
}

Surface box(glm::vec3 lo, glm::vec3 hi) {
  Surface s;
  add_quad(s, {lo.x, lo.y, hi.z}, {lo.x, hi.y, hi.z}, {lo.x, hi.y, lo.z}, {lo.x, lo.y, lo.z});
  add_quad(s, {hi.x, lo.y, lo.z}, {hi.x, hi.y, lo.z}, {hi.x, hi.y, hi.z}, {hi.x, lo.y, hi.z});
  add_quad(s, {lo.x, lo.y, lo.z}, {hi.x, lo.y, lo.z}, {hi.x, lo.y, hi.z}, {lo.x, lo.y, hi.z});
  add_quad(s, {lo.x, hi.y, hi.z}, {hi.x, hi.y, hi.z}, {hi.x, hi.y, lo.z}, {lo.x, hi.y, lo.z});
  add_quad(s, {hi.x, lo.y, lo.z}, {lo.x, lo.y, lo.z}, {lo.x, hi.y, lo.z}, {hi.x, hi.y, lo.z});
  add_quad(s, {lo.x, lo.y, hi.z}, {hi.x, lo.y, hi.z}, {hi.x, hi.y, hi.z}, {lo.x, hi.y, hi.z});
  return s;
}

Surface bevelled_slab(glm::vec3 lo, glm::vec3 hi, float bevel) {
  Surface s;
  const glm::vec3 corner[4] = {{lo.x, 0, lo.z}, {lo.x, 0, hi.z}, {hi.x, 0, hi.z}, {hi.x, 0, lo.z}};
  const glm::vec3 inward[4] = {{1, 0, 1}, {1, 0, -1}, {-1, 0, -1}, {-1, 0, 1}};
  const glm::vec3 up(0, 1, 0);
  for (int i = 0; i < 4; ++i) {
    const int j = (i + 1) % 4;
    const glm::vec3 edge_i = corner[i] + up * (hi.y - bevel);
    const glm::vec3 edge_j = corner[j] + up * (hi.y - bevel);
    const glm::vec3 top_i = corner[i] + inward[i] * bevel + up * hi.y;
    const glm::vec3 top_j = corner[j] + inward[j] * bevel + up * hi.y;
    add_quad(s, corner[i] + up * lo.y, corner[j] + up * lo.y, edge_j, edge_i);
    add_quad(s, edge_i, edge_j, top_j, top_i);
  }
  add_quad(s, corner[0] + inward[0] * bevel + up * hi.y, corner[1] + inward[1] * bevel + up * hi.y,
           corner[2] + inward[2] * bevel + up * hi.y, corner[3] + inward[3] * bevel + up * hi.y);
  return s;
}

Surface arched_wall(float width, float height, float thickness, float radius, int steps) {
  // Each angle of the arch is joined with the point of the wall's outline in the same direction; the angles
  // of the two upper corners must be among them.
  std::vector<float> angles;
  for (int i = 0; i <= steps; ++i) angles.push_back(kPi * static_cast<float>(i) / static_cast<float>(steps));
  const float corner = std::atan2(height, width / 2);
  angles.push_back(corner);
  angles.push_back(kPi - corner);
  std::sort(angles.begin(), angles.end());
  angles.erase(
      std::unique(angles.begin(), angles.end(), [](float a, float b) { return std::abs(a - b) < 1e-4f; }),
      angles.end());

  Surface s;
  for (const float side : {1.0f, -1.0f}) {
    const auto first = static_cast<uint32_t>(s.positions.size());
    for (const float angle : angles) {
      const glm::vec2 direction(std::cos(angle), std::sin(angle));
      const float to_side = std::abs(direction.x) > 1e-6f ? width / 2 / std::abs(direction.x) : 1e9f;
      const float to_top = direction.y > 1e-6f ? height / direction.y : 1e9f;
      const glm::vec2 outer = direction * std::min(to_side, to_top);
      s.positions.emplace_back(direction * radius, side * thickness / 2);
      s.positions.emplace_back(outer, side * thickness / 2);
      s.normals.insert(s.normals.end(), 2, glm::vec3(0, 0, side));
    }
    for (uint32_t i = 0; i + 1 < angles.size(); ++i) {
      const uint32_t a = first + 2 * i;
      if (side > 0) {
        add_triangle(s, a, a + 1, a + 3);
        add_triangle(s, a, a + 3, a + 2);
      } else {
        add_triangle(s, a, a + 3, a + 1);
        add_triangle(s, a, a + 2, a + 3);
      }
    }
  }
  return s;
}

Surface tube(const std::function<glm::vec3(float)>& curve, const std::function<float(float)>& radius,
             int steps_along, int steps_around, bool closed) {
  const auto patch = [&](float u, float v) {
    constexpr float kStep = 1e-3f;
    // The frame leans on the curve's second derivative: smooth on the curves used here, which never run
    // straight.
    const glm::vec3 p0 = curve(v - kStep);
    const glm::vec3 p1 = curve(v);
    const glm::vec3 p2 = curve(v + kStep);
    const glm::vec3 tangent = glm::normalize(p2 - p0);
    const glm::vec3 bend = p0 + p2 - 2.0f * p1;
    const glm::vec3 side = glm::normalize(glm::cross(tangent, bend));
    const glm::vec3 normal = glm::cross(side, tangent);
    const float angle = 2.0f * kPi * u;
    return p1 + radius(v) * (std::cos(angle) * normal + std::sin(angle) * side);
  };
  return tessellate(steps_around, steps_along, patch, closed ? Closing::kTorus : Closing::kTube);
}

}  // namespace lsp::sample
