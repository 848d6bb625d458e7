#include "heat.h"

#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "sampler.h"

namespace lsp::sample {
namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();
enum Dimension : uint32_t { kPixelPoint, kDirection };

LspHit trace(const RenderScene& scene, const lsp_trace_options& options, const LspRay& ray,
             lsp_trace_counts* counts) {
  LspHit hit{};
  scene.trace(options, {&ray, 1}, {&hit, 1}, counts);
  return hit;
}

float loss(const LspHit& answer, const LspHit& truth) {
  const bool hits = std::isfinite(answer.t), should = std::isfinite(truth.t);
  if (hits != should) return 1.0f;
  const float longer = std::max(answer.t, truth.t);
  return hits && longer > 0 ? std::fabs(answer.t - truth.t) / longer : 0.0f;
}

float heat_of(const RenderScene& scene, const HeatOptions& options, const LspRay& ray) {
  lsp_trace_counts counts{};
  const LspHit hit = trace(scene, options.trace, ray, &counts);
  const bool cells = std::ranges::any_of(scene.headers(), [](const LspHeader* header) {
    return (header->required_features & LSP_FEATURE_CELLS) != 0;
  });
  switch (options.heat) {
    case Heat::kLoss:
      return loss(hit, trace(scene, {}, ray, nullptr));
    case Heat::kSteps:
      return static_cast<float>(counts.nodes + counts.exact_nodes + counts.shafts + counts.triangles);
    case Heat::kExact:
      break;
  }
  return static_cast<float>(cells ? counts.exact : counts.triangles);
}

}  // namespace

HeatMap heat_map(const RenderScene& scene, const Camera& camera, const HeatOptions& options,
                 const std::function<void(double)>& progress) {
  HeatMap map;
  map.values = Picture(options.width, options.height);
  std::vector<uint8_t> seen(map.values.pixels.size());
  const auto pixel_heat = [&](uint32_t pixel) {
    const auto width = static_cast<uint32_t>(options.width);
    const glm::vec2 corner(static_cast<float>(pixel % width), static_cast<float>(pixel / width));
    const uint32_t seed = hash_mix(pixel + 0x68BC21EBu);
    float sum = 0;
    uint32_t surfaces = 0;
    for (uint32_t sample = 0; sample < options.samples; ++sample) {
      const auto random = [&](Dimension d) { return sobol_point(sample, hash_combine(seed, d)); };
      const LspRay eye = camera.ray(corner + random(kPixelPoint), options.width, options.height);
      const LspHit hit = trace(scene, {}, eye, nullptr);
      if (!std::isfinite(hit.t)) continue;
      const SurfacePoint point = scene.surface(eye, hit);
      const glm::vec3 direction = cosine_direction(point.shading_normal, random(kDirection));
      sum += heat_of(scene, options, ray_from(point, above(point, direction), kInfinity));
      ++surfaces;
    }
    seen[pixel] = surfaces > 0;
    return surfaces > 0 ? sum / static_cast<float>(surfaces) : 0.0f;
  };
  tbb::task_arena arena(options.threads > 0 ? options.threads : tbb::task_arena::automatic);
  const auto height = static_cast<uint32_t>(options.height), width = static_cast<uint32_t>(options.width);
  constexpr uint32_t kRows = 8;  // between two reports of progress
  for (uint32_t first = 0; first < height; first += kRows) {
    const uint32_t last = std::min(first + kRows, height);
    arena.execute([&] {
      tbb::parallel_for(first * width, last * width,
                        [&](uint32_t pixel) { map.values.pixels[pixel] = glm::vec3(pixel_heat(pixel)); });
    });
    if (progress) progress(static_cast<double>(last) / height);
  }
  std::vector<float> hot;
  for (size_t i = 0; i < seen.size(); ++i) {
    if (!seen[i]) continue;
    hot.push_back(map.values.pixels[i].x);
    map.mean += static_cast<double>(hot.back());
  }
  if (hot.empty()) return map;
  map.mean /= static_cast<double>(hot.size());
  const auto top = hot.begin() + static_cast<std::ptrdiff_t>((hot.size() - 1) * 99 / 100);
  std::nth_element(hot.begin(), top, hot.end());
  map.top = *top;
  return map;
}

Picture in_colors(const HeatMap& map) {
  Picture picture = map.values;
  for (glm::vec3& pixel : picture.pixels) {
    const float heat = map.top > 0 ? std::min(pixel.x / map.top, 1.0f) : 0.0f;
    pixel = glm::clamp(3.0f * heat - glm::vec3(0.0f, 1.0f, 2.0f), 0.0f, 1.0f);
  }
  return picture;
}

}  // namespace lsp::sample
