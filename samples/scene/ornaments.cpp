#include "ornaments.h"

#include <cmath>
#include <glm/gtc/matrix_transform.hpp>

namespace lsp::sample {
namespace {

constexpr float kPi = 3.14159265358979324f;
constexpr float kTau = 2.0f * kPi;

float smooth(float from, float to, float x) {
  const float t = glm::clamp((x - from) / (to - from), 0.0f, 1.0f);
  return t * t * (3.0f - 2.0f * t);
}

float smooth_min(float a, float b, float k) {
  const float h = std::max(k - std::abs(a - b), 0.0f) / k;
  return std::min(a, b) - h * h * h * k / 6.0f;
}

// Gielis' superformula.
float superformula(float angle, float m, float n1, float n2, float n3) {
  const float a = std::pow(std::abs(std::cos(m * angle / 4)), n2);
  const float b = std::pow(std::abs(std::sin(m * angle / 4)), n3);
  return std::pow(a + b, -1.0f / n1);
}

glm::mat4 move(glm::vec3 by) { return glm::translate(glm::mat4(1.0f), by); }

}  // namespace

float random01(int seed, int index) {
  uint32_t x = static_cast<uint32_t>(seed) * 0x9E3779B9u + static_cast<uint32_t>(index) * 0x85EBCA6Bu + 1u;
  x ^= x >> 16;
  x *= 0x7FEB352Du;
  x ^= x >> 15;
  x *= 0x846CA68Bu;
  x ^= x >> 16;
  return static_cast<float>(x >> 8) * (1.0f / 16777216.0f);
}

Surface banner(const Detail& detail, float width, float length, int seed) {
  const float phase = kTau * random01(seed, 0);
  return tessellate(detail.steps(20, 4), detail.steps(32, 4), [=](float u, float v) {
    const float x = (u - 0.5f) * width * (1.0f - 0.06f * std::sin(kPi * v));
    const float free = smooth(0.0f, 0.25f, v);
    const float fold = 0.055f * std::sin(kTau * 2.5f * u + phase + 1.3f * v) * (0.35f + 0.65f * free);
    const float billow = 0.16f * free * std::sin(2.2f * v * kPi + phase) * std::sin(kPi * u);
    const float point = 0.22f * (1.0f - std::abs(2.0f * u - 1.0f)) * smooth(0.8f, 1.0f, v);
    return glm::vec3(x, -length * v - point, fold + billow);
  });
}

Surface tied_curtain(const Detail& detail, float width, float length, int seed) {
  const float phase = kTau * random01(seed, 1);
  return tessellate(detail.steps(36, 5), detail.steps(26, 4), [=](float u, float v) {
    // The cloth spans `width` at the top and is drawn together towards the tie, then falls straight.
    const float tie = 0.60f;
    const float open = v < tie ? 1.0f - smooth(0.0f, 1.0f, std::pow(v / tie, 1.6f)) : 0.0f;
    const float flare = v > tie ? smooth(tie, 1.0f, v) : 0.0f;
    const float spread = width * (0.22f + 0.78f * open) + 0.16f * width * flare;
    const float gather = 1.0f - open;
    const float fold =
        (0.05f - 0.015f * gather) * std::sin(kTau * 5.0f * u + phase + 0.8f * std::sin(3.0f * v));
    const float droop =
        0.22f * length * u * gather * (1.0f - flare) * smooth(0.1f, tie, v) * (1.0f - u * 0.4f);
    const float x = 0.04f + u * spread;
    return glm::vec3(x, -length * v - droop * 0.35f,
                     fold + 0.10f * gather * std::cos(kPi * u) * (1.0f - flare));
  });
}

Surface awning(const Detail& detail, float width, float span, float sag, int seed) {
  const float phase = kTau * random01(seed, 2);
  return tessellate(detail.steps(56, 6), detail.steps(16, 3), [=](float u, float v) {
    const float z = (u - 0.5f) * span;
    const float hang = 1.0f - std::pow(2.0f * u - 1.0f, 2.0f);
    const float x = (v - 0.5f) * width * (1.0f - 0.16f * hang);
    const float ripple = 0.05f * std::sin(kTau * 3.0f * v + phase + 2.0f * u) * (0.3f + hang);
    const float swags = 0.05f * hang * std::sin(kTau * 7.0f * u + phase);
    const float trough = 0.28f * hang * std::pow(2.0f * v - 1.0f, 2.0f);
    return glm::vec3(x, -sag * hang + ripple + swags + trough, z);
  });
}

Surface torus_knot(const Detail& detail, int p, int q) {
  const auto curve = [=](float t) {
    const float angle = kTau * t;
    const float r = 0.62f + 0.26f * std::cos(static_cast<float>(q) * angle);
    return glm::vec3(r * std::cos(static_cast<float>(p) * angle),
                     0.26f * std::sin(static_cast<float>(q) * angle) * 1.5f,
                     r * std::sin(static_cast<float>(p) * angle));
  };
  return tube(
      curve, [](float) { return 0.125f; }, detail.steps(200, 18), detail.steps(18, 3), true);
}

Surface gyroid_sphere(const Detail& detail) {
  const auto field = [](glm::vec3 p) {
    const glm::vec3 q = p * 4.6f;
    const float gyroid =
        std::sin(q.x) * std::cos(q.y) + std::sin(q.y) * std::cos(q.z) + std::sin(q.z) * std::cos(q.x);
    const float sheet = (std::abs(gyroid) - 0.55f) / 4.6f;
    const float ball = glm::length(p) - 1.0f;
    const float hollow = 0.42f - glm::length(p);
    // Smooth intersections, so that rims are rounded.
    return -smooth_min(smooth_min(-sheet, -ball, 0.12f), -hollow, 0.12f);
  };
  return implicit(field, -1.13f, 1.13f, detail.steps(29, 5));
}

Surface coral(const Detail& detail) {
  return tessellate(
      detail.steps(80, 6), detail.steps(44, 4),
      [](float u, float v) {
        const float around = kTau * u;
        const float up = kPi * (v - 0.5f);
        const glm::vec3 d(std::cos(up) * std::sin(around), std::sin(up), std::cos(up) * std::cos(around));
        const float waves = std::sin(7.0f * d.x + 3.0f * std::sin(4.0f * d.y)) *
                            std::sin(7.0f * d.y + 3.0f * std::sin(4.0f * d.z)) *
                            std::sin(7.0f * d.z + 3.0f * std::sin(4.0f * d.x));
        return d * (0.82f + 0.18f * waves);
      },
      Closing::kSphere);
}

Surface twisted_vase(const Detail& detail) {
  return tessellate(
      detail.steps(52, 8), detail.steps(26, 6),
      [](float u, float v) {
        // Outside from the foot to the lip, over the lip in a half circle, then down the inside to the
        // bottom.
        const float lip = glm::clamp((v - 0.50f) / 0.10f, 0.0f, 1.0f);
        const float height = v < 0.50f   ? v / 0.50f
                             : v < 0.60f ? 1.0f + 0.02f * std::sin(kPi * lip)
                                         : 0.08f + 0.92f * (1.0f - (v - 0.60f) / 0.40f);
        const float foot = smooth(0.0f, 0.05f, v) * smooth(0.0f, 0.06f, 1.0f - v);
        const float inset = 0.02f * (1.0f - std::cos(kPi * lip));
        const float level = std::min(height, 1.0f);
        const float body =
            0.17f + 0.23f * std::sin(kPi * std::pow(level, 0.75f)) + 0.10f * smooth(0.80f, 1.0f, level);
        const float angle = kTau * u;
        const float turn = angle + 1.6f * level;
        const float ribs = superformula(turn, 8.0f, 5.5f, 3.0f, 3.0f);
        const float r = foot * (body * glm::mix(1.0f, ribs, 0.55f) - inset);
        return glm::vec3(r * std::sin(angle), height * 1.15f, r * std::cos(angle));
      },
      Closing::kSphere);
}

Surface blob_figure(const Detail& detail) {
  struct Ball {
    glm::vec3 centre;
    float radius;
  };
  static const Ball kBalls[] = {{{0.00f, -0.62f, 0.00f}, 0.34f},  {{0.18f, -0.25f, 0.10f}, 0.26f},
                                {{-0.16f, 0.02f, -0.08f}, 0.24f}, {{0.06f, 0.36f, 0.05f}, 0.19f},
                                {{0.30f, 0.18f, -0.14f}, 0.12f},  {{0.02f, 0.72f, 0.02f}, 0.16f},
                                {{-0.36f, -0.40f, 0.20f}, 0.15f}};
  const auto field = [](glm::vec3 p) {
    float d = 10.0f;
    for (const Ball& ball : kBalls) d = smooth_min(d, glm::length(p - ball.centre) - ball.radius, 0.34f);
    // Two holes through the body, after Moore and Hepworth.
    const float hole = glm::length(glm::vec2(p.x - 0.03f, p.y + 0.14f)) - 0.12f;
    return -smooth_min(-d, hole, 0.12f);
  };
  return implicit(field, -1.1f, 1.1f, detail.steps(32, 6));
}

Surface pedestal(const Detail& detail, float radius, float height) {
  const float h = height;
  Profile body;
  const int steps = detail.steps(6, 1);
  for (int i = 0; i <= steps; ++i) {
    const float t = static_cast<float>(i) / static_cast<float>(steps);
    body.emplace_back(radius * (0.72f + 0.10f * std::pow(2.0f * t - 1.0f, 2.0f)), h * (0.16f + 0.68f * t));
  }
  std::vector<Profile> profiles = creased(
      {{radius, 0.0f}, {radius, 0.10f * h}, {radius * 0.86f, 0.13f * h}, {radius * 0.82f, 0.16f * h}});
  profiles.push_back(body);
  for (const Profile& piece :
       creased({{radius * 0.82f, 0.84f * h}, {radius * 0.95f, 0.90f * h}, {radius * 0.95f, h}, {0.0f, h}})) {
    profiles.push_back(piece);
  }
  return lathe(profiles, detail.steps(32, 6));
}

Surface fountain_stone(const Detail& detail) {
  const int sides = detail.steps(48, 8);
  std::vector<Profile> basin = creased({{1.42f, 0.0f}, {1.42f, 0.07f}, {1.34f, 0.10f}});
  basin.push_back({{1.34f, 0.10f}, {1.26f, 0.22f}, {1.30f, 0.34f}});
  for (const Profile& piece : creased(
           {{1.30f, 0.34f}, {1.38f, 0.37f}, {1.38f, 0.45f}, {1.20f, 0.45f}, {1.17f, 0.12f}, {0.0f, 0.12f}})) {
    basin.push_back(piece);
  }
  Surface s = lathe(basin, sides);
  Profile stem;
  Profile bowl_under;
  Profile bowl_inside;
  const int steps = detail.steps(14, 3);
  for (int i = 0; i <= steps; ++i) {
    const float t = static_cast<float>(i) / static_cast<float>(steps);
    stem.emplace_back(
        0.13f + 0.10f * std::pow(1.0f - t, 3.0f) + 0.06f * std::exp(-std::pow((t - 0.45f) / 0.1f, 2.0f)),
        0.12f + 0.88f * t);
    bowl_under.emplace_back(0.13f + 0.62f * std::pow(t, 0.8f), 1.0f + 0.26f * t * t);
    bowl_inside.emplace_back(0.72f * (1.0f - t), 1.26f - 0.17f * (1.0f - std::pow(1.0f - t, 2.0f)));
  }
  append(s, lathe({stem, bowl_under, {{0.75f, 1.26f}, {0.72f, 1.26f}}, bowl_inside}, sides));
  return s;
}

Surface fountain_water(const Detail& detail) {
  Surface s;
  const auto disc = [&](float radius, float height) {
    append(s, tessellate(
                  detail.steps(44, 8), detail.steps(12, 2),
                  [=](float u, float v) {
                    const float r = radius * (1.0f - v);
                    const float y = height + 0.006f * std::sin(38.0f * r) * (0.4f + 0.6f * v) +
                                    0.003f * std::sin(9.0f * kTau * u + 12.0f * r);
                    return glm::vec3(r * std::sin(kTau * u), y, r * std::cos(kTau * u));
                  },
                  Closing::kTube));
  };
  disc(1.185f, 0.36f);
  disc(0.66f, 1.225f);
  return s;
}

Surface pot(const Detail& detail) {
  Profile belly;
  const int steps = detail.steps(8, 2);
  for (int i = 0; i <= steps; ++i) {
    const float t = static_cast<float>(i) / static_cast<float>(steps);
    belly.emplace_back(0.19f + 0.14f * std::sin(0.15f * kPi + 0.60f * kPi * t), 0.46f * t);
  }
  std::vector<Profile> profiles = {belly};
  const float rim = belly.back().x;
  for (const Profile& piece : creased({{rim, 0.46f},
                                       {rim + 0.04f, 0.48f},
                                       {rim + 0.04f, 0.54f},
                                       {rim - 0.02f, 0.54f},
                                       {rim - 0.03f, 0.48f},
                                       {0.0f, 0.49f}})) {
    profiles.push_back(piece);
  }
  return lathe(profiles, detail.steps(22, 5));
}

Surface palm_leaves(const Detail& detail, int seed) {
  Surface leaves;
  const int count = detail.shows(0.5f) ? 30 : 14;
  for (int k = 0; k < count; ++k) {
    const float t = static_cast<float>(k) / static_cast<float>(count);
    // Golden-angle phyllotaxis: inner leaves stand, outer ones arch over.
    const float around = 2.39996323f * static_cast<float>(k) + 0.4f * random01(seed, 3 * k);
    const float lean = 0.10f + 1.05f * t + 0.15f * random01(seed, 3 * k + 1);
    const float length = 1.35f - 0.35f * t + 0.25f * random01(seed, 3 * k + 2);
    const Surface leaf = tessellate(detail.steps(3, 2), detail.steps(9, 2), [=](float u, float v) {
      const float across = 2.0f * u - 1.0f;
      const float width = 0.085f * std::sin(kPi * std::pow(0.03f + 0.95f * v, 0.7f));
      // Along the leaf: leaves the pot upwards and bends over more and more.
      const float bend = lean * (0.25f + 1.15f * v);
      const float out = length * v * std::sin(bend);
      const float up = length * v * std::cos(bend);
      const float keel = 0.35f * width * across * across;
      return glm::vec3(out - keel * std::cos(bend) * 0.3f, 0.46f + up + keel, -across * width);
    });
    append(leaves, leaf, glm::rotate(glm::mat4(1.0f), around, {0, 1, 0}));
  }
  return leaves;
}

Surface lantern_frame(const Detail& detail, float drop) {
  Surface s = lathe({{{0.008f, -drop + 0.24f}, {0.008f, 0.0f}}}, detail.steps(6, 3));
  append(s, lathe(creased({{0.125f, -drop + 0.10f},
                           {0.125f, -drop + 0.13f},
                           {0.03f, -drop + 0.24f},
                           {0.0f, -drop + 0.25f}}),
                  detail.steps(12, 4)));
  append(s, lathe(creased({{0.0f, -drop - 0.20f},
                           {0.05f, -drop - 0.17f},
                           {0.125f, -drop - 0.13f},
                           {0.125f, -drop - 0.10f},
                           {0.0f, -drop - 0.10f}}),
                  detail.steps(12, 4)));
  for (int k = 0; k < 6; ++k) {
    const Surface bar = box({-0.006f, -drop - 0.12f, 0.104f}, {0.006f, -drop + 0.12f, 0.116f});
    append(s, bar, glm::rotate(glm::mat4(1.0f), kPi / 3 * static_cast<float>(k), {0, 1, 0}));
  }
  return s;
}

Surface lantern_glass(float drop) {
  // Few triangles: renderers that sample emitters walk them.
  const Surface ball = tessellate(
      8, 5,
      [](float u, float v) {
        const float up = kPi * (v - 0.5f);
        return 0.085f *
               glm::vec3(std::cos(up) * std::sin(kTau * u), std::sin(up), std::cos(up) * std::cos(kTau * u));
      },
      Closing::kSphere);
  Surface s;
  append(s, ball, move({0, -drop, 0}));
  return s;
}

}  // namespace lsp::sample
