#include "architecture.h"

#include <cmath>
#include <glm/gtc/matrix_transform.hpp>

namespace lsp::sample {
namespace {

constexpr float kPi = 3.14159265358979324f;

float smooth(float from, float to, float x) {
  const float t = glm::clamp((x - from) / (to - from), 0.0f, 1.0f);
  return t * t * (3.0f - 2.0f * t);
}

// Radius of a shaft at v in [0, 1]: it swells a little and then narrows by a sixth.
float entasis(float radius, float v) { return radius * (1.0f + 0.06f * std::sin(kPi * v) - 0.17f * v * v); }

// Appends an arc of a circle (centre, radius, from angle to angle) to a profile.
void arc(Profile& profile, glm::vec2 centre, float radius, float from, float to, int steps) {
  for (int i = 0; i <= steps; ++i) {
    const float angle = from + (to - from) * static_cast<float>(i) / static_cast<float>(steps);
    profile.push_back(centre + radius * glm::vec2(std::cos(angle), std::sin(angle)));
  }
}

// Turns a lathe about the y axis into one about the z axis, angle 0 on +x.
glm::mat4 y_axis_to_z() { return glm::rotate(glm::mat4(1.0f), kPi / 2, glm::vec3(1, 0, 0)); }

}  // namespace

Surface fluted_shaft(const Detail& detail, float radius, float from, float to) {
  constexpr int kFlutes = 20;
  const int around = kFlutes * detail.steps(4, 1);
  return tessellate(
      around, detail.steps(8, 2),
      [=](float u, float v) {
        const float angle = 2.0f * kPi * u;
        const float ends = smooth(0.0f, 0.06f, v) * smooth(0.0f, 0.06f, 1.0f - v);
        const float flute = std::abs(std::sin(0.5f * static_cast<float>(kFlutes) * angle));
        const float r = entasis(radius, v) * (1.0f - 0.075f * ends * std::sqrt(flute));
        return glm::vec3(r * std::sin(angle), from + (to - from) * v, r * std::cos(angle));
      },
      Closing::kTube);
}

Surface smooth_shaft(const Detail& detail, float radius, float from, float to) {
  return tessellate(
      detail.steps(20, 4), detail.steps(10, 2),
      [=](float u, float v) {
        const float angle = 2.0f * kPi * u;
        const float r = entasis(radius, v);
        return glm::vec3(r * std::sin(angle), from + (to - from) * v, r * std::cos(angle));
      },
      Closing::kTube);
}

Surface attic_base(const Detail& detail, float radius, float height) {
  const float h = height;
  const float plinth = 0.36f * h;
  Surface base = bevelled_slab({-radius * 1.42f, 0, -radius * 1.42f},
                               {radius * 1.42f, plinth, radius * 1.42f}, 0.03f * h);
  const int steps = detail.steps(4, 1);
  Profile torus_low;
  arc(torus_low, {radius * 1.24f, plinth + 0.13f * h}, 0.13f * h, -kPi / 2, kPi / 2, steps);
  Profile scotia;
  scotia.emplace_back(radius * 1.24f, plinth + 0.26f * h);
  arc(scotia, {radius * 1.25f, plinth + 0.38f * h}, 0.10f * h, -kPi / 2, -3 * kPi / 2, steps);
  Profile torus_high;
  arc(torus_high, {radius * 1.09f, plinth + 0.55f * h}, 0.08f * h, -kPi / 2, kPi / 2, steps);
  torus_high.emplace_back(radius, plinth + 0.64f * h);
  append(base, lathe({torus_low, scotia, torus_high}, detail.steps(20, 4)));
  return base;
}

Surface capital(const Detail& detail, float radius, float height) {
  const float h = height;
  Profile astragal;
  arc(astragal, {radius * 1.0f, 0.04f * h}, 0.04f * h, -kPi / 2, kPi / 2, detail.steps(4, 1));
  Profile bell;
  const int steps = detail.steps(8, 2);
  for (int i = 0; i <= steps; ++i) {
    const float t = static_cast<float>(i) / static_cast<float>(steps);
    bell.emplace_back(radius * (0.98f + 0.42f * t * t * t), h * (0.08f + 0.72f * t));
  }
  Surface s = lathe({astragal, bell}, detail.steps(20, 4));
  const float half = radius * 1.45f;
  append(s, box({-half, 0.80f * h, -half}, {half, h, half}));
  append(s, box({-half * 1.08f, 0.92f * h, -half * 1.08f}, {half * 1.08f, h, half * 1.08f}));
  return s;
}

Surface capital_leaves(const Detail& detail, float radius, float height) {
  Surface leaves;
  for (int tier = 0; tier < 2; ++tier) {
    const float top = tier == 0 ? 0.42f : 0.72f;
    const float reach = tier == 0 ? 0.30f : 0.42f;
    for (int k = 0; k < 8; ++k) {
      const float centre = 2.0f * kPi * (static_cast<float>(k) + 0.5f * static_cast<float>(tier)) / 8.0f;
      append(leaves, tessellate(detail.steps(2, 2), detail.steps(6, 2), [=](float u, float v) {
               // Up along the bell, then over in a curl; a groove along the middle.
               const float across = 2.0f * u - 1.0f;
               const float curl = smooth(0.55f, 1.0f, v);
               const float width = 0.40f * std::sqrt(std::max(1.0f - v * v * 0.93f, 0.0f));
               const float rise = top * (v < 0.8f ? v / 0.8f : 1.0f - 0.9f * (v - 0.8f));
               const float r = radius * (1.03f + 0.25f * v * v * v + reach * curl +
                                         0.06f * std::cos(across * kPi) * (1.0f - v));
               const float angle = centre + across * width;
               return glm::vec3(r * std::sin(angle), height * (0.08f + rise), r * std::cos(angle));
             }));
    }
  }
  return leaves;
}

Surface archivolt(const Detail& detail, float radius, float thickness) {
  Surface s;
  if (!detail.shows(0.25f)) {
    append(s,
           lathe({{{radius, thickness / 2}, {radius, -thickness / 2}}}, detail.steps(22, 3), kPi / 2,
                 3 * kPi / 2),
           y_axis_to_z());
    return s;
  }
  // Profile across the wall in (radius, along the axis): front band with two fasciae, soffit, back band.
  const float r = radius;
  const float f = thickness / 2;
  const Profile points = {{r + 0.24f, f},          {r + 0.24f, f + 0.05f}, {r + 0.17f, f + 0.05f},
                          {r + 0.15f, f + 0.03f},  {r + 0.06f, f + 0.03f}, {r + 0.04f, f + 0.015f},
                          {r, f + 0.015f},         {r, -f - 0.015f},       {r + 0.06f, -f - 0.03f},
                          {r + 0.20f, -f - 0.03f}, {r + 0.20f, -f}};
  // A lathe turns from z towards x; with its axis laid along z those become -y and x, so the upper half of
  // the circle runs over [pi / 2, 3 pi / 2].
  append(s, lathe(creased(points), detail.steps(22, 4), kPi / 2, 3 * kPi / 2), y_axis_to_z());
  return s;
}

Surface groin_vault(const Detail& detail, float side) {
  const float r = side / 2;
  Surface vault;
  const int steps = detail.steps(8, 2);
  for (int quarter = 0; quarter < 4; ++quarter) {
    Surface severy = tessellate(steps, steps, [=](float u, float v) {
      const float x = r * v;
      const float z = x * (1.0f - 2.0f * u);
      return glm::vec3(x, std::sqrt(std::max(r * r - z * z, 0.0f)), z);
    });
    append(vault, severy, glm::rotate(glm::mat4(1.0f), kPi / 2 * static_cast<float>(quarter), {0, 1, 0}));
  }
  return vault;
}

Surface vault_rib(const Detail& detail, float radius, float width, float depth) {
  const Profile points = {{radius, width / 2},
                          {radius - depth, width / 2 - 0.03f},
                          {radius - depth, -width / 2 + 0.03f},
                          {radius, -width / 2}};
  Surface s;
  append(s, lathe(creased(points), detail.steps(18, 3), kPi / 2, 3 * kPi / 2), y_axis_to_z());
  return s;
}

Surface coffers(float side, int per_side) {
  Surface s;
  const float cell = side / static_cast<float>(per_side);
  // Rings of a cell from its edge inwards: (half size, height). Flat rib, riser, flat step, riser.
  const Profile rings = {{cell * 0.5f, 0.0f},
                         {cell * 0.42f, 0.0f},
                         {cell * 0.42f, 0.16f},
                         {cell * 0.32f, 0.16f},
                         {cell * 0.32f, 0.30f}};
  Surface one;
  // A lathe of four sides is a square ring; facing the axis and down means walking the profile backwards.
  const Profile backwards(rings.rbegin(), rings.rend());
  for (size_t i = 0; i + 1 < backwards.size(); ++i) {
    for (int k = 0; k < 4; ++k) {
      const glm::vec2 a = backwards[i];
      const glm::vec2 b = backwards[i + 1];
      const Surface quad = tessellate(1, 1, [=](float u, float v) {
        const glm::vec2 p = a + (b - a) * v;
        return glm::vec3(p.x * (2.0f * u - 1.0f), p.y, p.x);
      });
      append(one, quad, glm::rotate(glm::mat4(1.0f), kPi / 2 * static_cast<float>(k), {0, 1, 0}));
    }
  }
  for (int i = 0; i < per_side; ++i) {
    for (int k = 0; k < per_side; ++k) {
      const glm::vec3 centre((static_cast<float>(i) + 0.5f) * cell - side / 2, 0,
                             (static_cast<float>(k) + 0.5f) * cell - side / 2);
      append(s, one, glm::translate(glm::mat4(1.0f), centre));
    }
  }
  return s;
}

Surface coffer_rosettes(const Detail& detail, float side, int per_side) {
  Surface s;
  const float cell = side / static_cast<float>(per_side);
  const float half = cell * 0.32f;
  Surface one = tessellate(detail.steps(5, 1), detail.steps(5, 1), [=](float u, float v) {
    const glm::vec2 p((2.0f * u - 1.0f), (2.0f * v - 1.0f));
    const float r = glm::length(p);
    const float petals = 0.75f + 0.25f * std::cos(8.0f * std::atan2(p.y, p.x));
    const float relief = 0.10f * smooth(0.85f, 0.1f, r) * (r < 0.2f ? 1.0f : petals);
    return glm::vec3(p.x * half, 0.30f - relief, p.y * half);
  });
  for (int i = 0; i < per_side; ++i) {
    for (int k = 0; k < per_side; ++k) {
      const glm::vec3 centre((static_cast<float>(i) + 0.5f) * cell - side / 2, 0,
                             (static_cast<float>(k) + 0.5f) * cell - side / 2);
      append(s, one, glm::translate(glm::mat4(1.0f), centre));
    }
  }
  return s;
}

Surface baluster(const Detail& detail, float height) {
  const float h = height;
  Surface s = box({-0.065f, 0, -0.065f}, {0.065f, 0.07f * h, 0.065f});
  Profile body;
  const int steps = detail.steps(9, 2);
  for (int i = 0; i <= steps; ++i) {
    const float t = static_cast<float>(i) / static_cast<float>(steps);
    // A vase: narrow foot, belly at a third, slender neck, flared top.
    const float belly = std::exp(-std::pow((t - 0.30f) / 0.20f, 2.0f));
    const float flare = std::exp(-std::pow((t - 1.0f) / 0.08f, 2.0f));
    const float foot = std::exp(-std::pow(t / 0.06f, 2.0f));
    body.emplace_back(0.030f + 0.042f * belly + 0.022f * flare + 0.022f * foot, h * (0.07f + 0.86f * t));
  }
  append(s, lathe({body}, detail.steps(8, 3)));
  append(s, box({-0.065f, 0.93f * h, -0.065f}, {0.065f, h, 0.065f}));
  return s;
}

Surface moulding(const std::vector<glm::vec2>& profile, float length) {
  Surface s;
  for (size_t i = 0; i + 1 < profile.size(); ++i) {
    const glm::vec2 a = profile[i];
    const glm::vec2 b = profile[i + 1];
    append(s, tessellate(1, 1, [=](float u, float v) {
             const glm::vec2 p = a + (b - a) * v;
             return glm::vec3(length * (u - 0.5f), p.y, p.x);
           }));
  }
  return s;
}

Surface plain_tile(float side) {
  const float half = side / 2 - 0.004f;
  return bevelled_slab({-half, -0.05f, -half}, {half, 0, half}, 0.012f);
}

Surface relief_tile(const Detail& detail, float side) {
  const float half = side / 2 - 0.004f;
  const int steps = detail.steps(7, 1);
  return tessellate(steps, steps, [=](float u, float v) {
    const glm::vec2 p(2.0f * v - 1.0f, 2.0f * u - 1.0f);
    const float edge = std::max(std::abs(p.x), std::abs(p.y));
    const float r = glm::length(p);
    const float star = r * (1.0f + 0.28f * std::cos(8.0f * std::atan2(p.y, p.x)));
    const float y = -0.03f * smooth(0.93f, 1.0f, edge) + 0.016f * smooth(0.62f, 0.42f, star) -
                    0.012f * smooth(0.25f, 0.12f, r);
    return glm::vec3(p.x * half, y, p.y * half);
  });
}

Surface half_dome(const Detail& detail, float radius) {
  // Scalloped like a shell; d/du x d/dv points to the centre.
  return tessellate(detail.steps(64, 8), detail.steps(16, 3), [=](float u, float v) {
    const float around = kPi * (u - 0.5f);
    const float up = kPi / 2 * v;
    const float flute = std::abs(std::sin(11.0f * kPi * u));
    const float r =
        radius * (1.0f + 0.06f * std::sqrt(flute) * smooth(0.0f, 0.08f, v) * (1.0f - smooth(0.55f, 1.0f, v)));
    return r * glm::vec3(std::cos(up) * std::cos(around), std::sin(up), std::cos(up) * std::sin(around));
  });
}

Surface niche_wall(const Detail& detail, float radius, float height) {
  return tessellate(detail.steps(32, 6), detail.steps(4, 1), [=](float u, float v) {
    const float around = kPi * (u - 0.5f);
    return glm::vec3(radius * std::cos(around), height * v, radius * std::sin(around));
  });
}

}  // namespace lsp::sample
