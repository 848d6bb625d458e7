#include "ray_errors.h"

#include <algorithm>
#include <cmath>

namespace lsp::bench {

Spread spread_of(std::span<float> values) {
  Spread spread;
  if (values.empty()) return spread;
  for (float value : values) spread.mean += value;
  spread.mean /= static_cast<double>(values.size());
  const auto rank = [&](double share) {
    const auto n = static_cast<double>(values.size());
    const auto at = static_cast<size_t>(std::max(0.0, std::ceil(share * n) - 1));
    std::nth_element(values.begin(), values.begin() + static_cast<ptrdiff_t>(at), values.end());
    return double{values[at]};
  };
  spread.p95 = rank(0.95);
  spread.p99 = rank(0.99);
  return spread;
}

RayErrors ray_errors(const Soup& soup, std::span<const LspRay> rays, std::span<const LspHit> truth,
                     std::span<const LspHit> answers) {
  RayErrors errors;
  errors.rays = rays.size();
  std::vector<float> by_diagonal, by_distance, angles;
  for (size_t i = 0; i < rays.size(); ++i) {
    const bool true_hit = truth[i].primitive != LSP_NONE, hit = answers[i].primitive != LSP_NONE;
    errors.true_hits += true_hit;
    errors.wrong_hits += hit && !true_hit;
    errors.wrong_misses += true_hit && !hit;
    if (!hit || !true_hit) continue;
    ++errors.both_hit;
    errors.wrong_primitive += truth[i].primitive != answers[i].primitive;
    const LspRay& ray = rays[i];
    const double length = glm::length(glm::dvec3(ray.direction.x, ray.direction.y, ray.direction.z));
    const double off = std::abs(double{answers[i].t} - double{truth[i].t});
    by_diagonal.push_back(static_cast<float>(off * length / soup.diagonal));
    by_distance.push_back(static_cast<float>(off / std::max(double{truth[i].t}, 1e-30)));
    const glm::dvec3 expected =
        shading_normal(soup, soup.triangle_of[truth[i].primitive], truth[i].u, truth[i].v);
    const lsp_float3& n = answers[i].normal;
    // By sine and cosine: the arc cosine alone has no precision near zero degrees.
    const glm::dvec3 normal(n.x, n.y, n.z);
    const double angle = std::atan2(glm::length(glm::cross(normal, expected)), glm::dot(normal, expected));
    angles.push_back(static_cast<float>(angle * (180 / 3.14159265358979323846)));
  }
  errors.depth_diagonal = spread_of(by_diagonal);
  errors.depth_distance = spread_of(by_distance);
  errors.normal_degrees = spread_of(angles);
  return errors;
}

RayErrors occlusion_errors(std::span<const LspHit> truth, std::span<const LspHit> answers) {
  RayErrors errors;
  errors.rays = truth.size();
  for (size_t i = 0; i < truth.size(); ++i) {
    const bool true_hit = std::isfinite(truth[i].t), hit = std::isfinite(answers[i].t);
    errors.true_hits += true_hit;
    errors.both_hit += hit && true_hit;
    errors.wrong_hits += hit && !true_hit;
    errors.wrong_misses += true_hit && !hit;
  }
  return errors;
}

}  // namespace lsp::bench
