#include "glossy.h"

#include <algorithm>
#include <cmath>
#include <glm/gtc/constants.hpp>

namespace lsp::sample {

GlossyDirection glossy_direction(const SurfacePoint& point, glm::vec3 to_eye, glm::vec2 u) {
  const glm::vec3 n = point.shading_normal;
  glm::vec3 t;
  glm::vec3 b;
  make_frame(n, t, b);
  const float alpha = std::max(point.roughness * point.roughness, 1e-3f);
  const glm::vec3 v(glm::dot(to_eye, t), glm::dot(to_eye, b), std::max(glm::dot(to_eye, n), 1e-3f));
  const glm::vec3 stretched = glm::normalize(glm::vec3(alpha * v.x, alpha * v.y, v.z));
  glm::vec3 t1;
  glm::vec3 t2;
  make_frame(stretched, t1, t2);
  const float r = std::sqrt(u.x);
  const float p1 = r * std::cos(2.0f * glm::pi<float>() * u.y);
  const float q = r * std::sin(2.0f * glm::pi<float>() * u.y);
  // t1, t2 are any frame here; the half that is seen is chosen along the horizontal direction of the frame.
  const float blend = 0.5f * (1.0f + stretched.z);
  const glm::vec3 h1 = stretched.z < 0.9999f ? glm::normalize(glm::cross(glm::vec3(0, 0, 1), stretched)) : t1;
  const glm::vec3 h2 = glm::cross(stretched, h1);
  const float p2 = (1.0f - blend) * std::sqrt(std::max(1.0f - p1 * p1, 0.0f)) + blend * q;
  const glm::vec3 micro = p1 * h1 + p2 * h2 + std::sqrt(std::max(1.0f - p1 * p1 - p2 * p2, 0.0f)) * stretched;
  const glm::vec3 half =
      glm::normalize(glm::vec3(alpha * micro.x, alpha * micro.y, std::max(micro.z, 1e-6f)));
  const glm::vec3 l = 2.0f * glm::dot(v, half) * half - v;
  const glm::vec3 f0 = glm::mix(glm::vec3(0.04f), point.base_color, point.metallic);
  const float grazing = std::pow(1.0f - glm::clamp(glm::dot(v, half), 0.0f, 1.0f), 5.0f);
  const auto lambda = [&](glm::vec3 w) {
    const float tan2 = (w.x * w.x + w.y * w.y) / std::max(w.z * w.z, 1e-9f);
    return 0.5f * (std::sqrt(1.0f + alpha * alpha * tan2) - 1.0f);
  };
  const float shadowing = l.z > 0 ? (1.0f + lambda(v)) / (1.0f + lambda(v) + lambda(l)) : 0.0f;
  return {glm::normalize(l.x * t + l.y * b + l.z * n), (f0 + (1.0f - f0) * grazing) * shadowing};
}

}  // namespace lsp::sample
