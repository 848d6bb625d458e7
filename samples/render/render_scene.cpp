#include "render_scene.h"

#include <algorithm>
#include <cmath>

#include "lsp/failures.hpp"
#include "lsp/instanced_scene.hpp"
#include "source_format.h"

namespace lsp::sample {
namespace {

float luminance(glm::vec3 color) { return glm::dot(color, glm::vec3(0.2126f, 0.7152f, 0.0722f)); }

// The share of a triangle that is there: it shines as a whole one of that much of its radiance.
float share_there(const LspTriangle& triangle) {
  return 1.0f - static_cast<float>(triangle.flags >> LSP_TRIANGLE_GAPS_SHIFT) / 65536.0f;
}

}  // namespace

RenderScene::RenderScene(const std::filesystem::path& path) : path_(path.string()) {
  if (is_instanced_scene(path_)) {
    instanced_ = std::make_unique<InstancedScene>(path_);
    for (size_t i = 0; i < instanced_->assets().size(); ++i)
      add_asset(*instanced_->assets()[i], instanced_->asset_paths()[i]);
  } else {
    file_.emplace(with_failures([&] { return SceneFile(path_); }));
    add_asset(*file_, path_);
  }
  find_emitters();
}

RenderScene::~RenderScene() = default;

void RenderScene::add_asset(const SceneFile& file, const std::string& path) {
  if ((file.header().required_features & LSP_FEATURE_EXACT) == 0) {
    throw Failure(Exit::kUnsupported, path,
                  "has no exact tree, which primary rays need; bake it without --no-exact");
  }
  headers_.push_back(&file.header());
  source_endings_.merge(lsp::sample::source_endings(file.scene()));
  Asset& asset = assets_.emplace_back();
  asset.scene = &file.scene();
  index_primitives(asset, path);
  find_materials(asset, path == path_ ? "" : path + ": ");
}

const lsp_instances* RenderScene::instances() const {
  return instanced_ == nullptr ? nullptr : &instanced_->instances().view();
}

bool RenderScene::has_tables() const {
  return std::ranges::any_of(headers_, [](const LspHeader* header) {
    return (header->required_features & (LSP_FEATURE_LINE_SPACES | LSP_FEATURE_CELLS)) != 0;
  });
}

glm::vec3 RenderScene::lo() const {
  if (instanced_ == nullptr) return to_glm(file_->header().bounds_min);
  if (instance_count() == 0) return glm::vec3(0.0f);
  const float* lo = instanced_->instances().view().nodes[0].lo;
  return {lo[0], lo[1], lo[2]};
}

glm::vec3 RenderScene::hi() const {
  if (instanced_ == nullptr) return to_glm(file_->header().bounds_max);
  if (instance_count() == 0) return glm::vec3(0.0f);
  const float* hi = instanced_->instances().view().nodes[0].hi;
  return {hi[0], hi[1], hi[2]};
}

void RenderScene::trace(const lsp_trace_options& options, std::span<const LspRay> rays,
                        std::span<LspHit> hits, lsp_trace_counts* counts) const {
  if (instanced_ != nullptr) {
    return with_failures([&] { instanced_->instances().trace(options, 0xFF, rays, hits, counts); });
  }
  lsp_error error{};
  check(lsp_trace(single(), &options, rays.data(), hits.data(), rays.size(), counts, &error), error);
}

void RenderScene::index_primitives(Asset& asset, const std::string& file) const {
  const lsp_scene& scene = *asset.scene;
  const LspHeader& header = *scene.header;
  // The table has an entry per primitive: a header that declares far more of them than there are triangles
  // would only ask for memory.
  if (header.primitive_count > 64ull * header.triangle_count + (1ull << 24)) {
    throw Failure(Exit::kLimit, file,
                  "declares far more primitives than it has triangles; run lsp-validate on it");
  }
  asset.triangle_of_primitive.assign(header.primitive_count, LSP_NONE);
  for (uint32_t i = 0; i < header.triangle_count; ++i) {
    const uint32_t primitive = scene.triangles[i].primitive;
    if (primitive >= header.primitive_count) {
      throw Failure(Exit::kInvalid, file, "a triangle's primitive is out of range; run lsp-validate on it");
    }
    // Spatial splits repeat a primitive; its records are the same.
    asset.triangle_of_primitive[primitive] = i;
  }
}

void RenderScene::find_materials(Asset& asset, const std::string& note_prefix) {
  const lsp_scene& scene = *asset.scene;
  if (scene.materials != nullptr && scene.header->material_count > 0) {
    asset.materials.assign(scene.materials, scene.materials + scene.header->material_count);
  } else {
    LspMaterial grey{};
    grey.base_color = {0.7f, 0.7f, 0.7f};
    grey.opacity = 1.0f;
    grey.roughness = 0.6f;
    asset.materials.push_back(grey);
    notes_.push_back(note_prefix + "no materials in the file: everything is grey");
  }
  if (scene.normals == nullptr)
    notes_.push_back(note_prefix + "no corner normals in the file: surfaces are faceted");
}

uint32_t RenderScene::instance_count() const {
  return instanced_ == nullptr ? 1 : instanced_->instances().size();
}

const RenderScene::Asset& RenderScene::asset_of(uint32_t instance) const {
  return instanced_ == nullptr ? assets_.front() : assets_[instanced_->instances()[instance].asset];
}

RenderScene::Corners RenderScene::corners(uint32_t instance, const LspTriangle& triangle) const {
  const glm::vec3 v0 = to_glm(triangle.v0);
  const glm::vec3 e1 = to_glm(triangle.v1) - v0;
  const glm::vec3 e2 = to_glm(triangle.v2) - v0;
  if (instanced_ == nullptr) return {v0, e1, e2};
  const lsp_instance_record& record = instanced_->instances().view().records[instance];
  const float* t = record.instance.transform;
  const glm::dmat3 linear(t[0], t[4], t[8], t[1], t[5], t[9], t[2], t[6], t[10]);
  const glm::dvec3 translation(record.translation[0], record.translation[1], record.translation[2]);
  return {linear * glm::dvec3(v0) + translation, linear * glm::dvec3(e1), linear * glm::dvec3(e2)};
}

std::vector<RenderScene::Corners> RenderScene::some_triangles(size_t most) const {
  size_t total = 0;
  for (uint32_t instance = 0; instance < instance_count(); ++instance)
    total += asset_of(instance).scene->header->triangle_count;
  const size_t step = total / most + 1;
  std::vector<Corners> some;
  size_t next = 0;  // to take, counted from the instance's first
  for (uint32_t instance = 0; instance < instance_count(); ++instance) {
    const lsp_scene& scene = *asset_of(instance).scene;
    for (; next < scene.header->triangle_count; next += step)
      some.push_back(corners(instance, scene.triangles[next]));
    next -= scene.header->triangle_count;
  }
  return some;
}

void RenderScene::find_emitters() {
  double total = 0;
  std::vector<double> powers;
  for (uint32_t instance = 0; instance < instance_count(); ++instance) {
    const Asset& asset = asset_of(instance);
    for (uint32_t i = 0; i < asset.scene->header->triangle_count; ++i) {
      const LspTriangle& triangle = asset.scene->triangles[i];
      if (asset.triangle_of_primitive[triangle.primitive] != i || triangle.material >= asset.materials.size())
        continue;
      const float brightness =
          share_there(triangle) * luminance(to_glm(asset.materials[triangle.material].emission));
      if (!(brightness > 0) || !std::isfinite(brightness)) continue;
      const Corners c = corners(instance, triangle);
      const float area = 0.5f * glm::length(glm::cross(c.e1, c.e2));
      if (!(area > 0)) continue;
      total += static_cast<double>(area) * static_cast<double>(brightness);
      powers.push_back(total);
      emitters_.push_back({instance, i, 0.0f, brightness});
    }
  }
  for (size_t i = 0; i < emitters_.size(); ++i) {
    emitters_[i].cumulative = static_cast<float>(powers[i] / total);
    emitters_[i].pdf = static_cast<float>(static_cast<double>(emitters_[i].pdf) / total);
  }
}

glm::vec3 lifted(const SurfacePoint& point) { return point.position + point.offset * point.geometric_normal; }

LspRay ray_from(const SurfacePoint& point, glm::vec3 direction, float tmax) {
  return {from_glm(lifted(point)), 0.0f, from_glm(direction), tmax};
}

glm::vec3 above(const SurfacePoint& point, glm::vec3 direction) {
  const float depth = glm::dot(direction, point.geometric_normal);
  return depth < 0 ? direction - 2.0f * depth * point.geometric_normal : direction;
}

std::vector<EmitterTriangle> RenderScene::emitters() const {
  std::vector<EmitterTriangle> triangles;
  for (const Emitter& emitter : emitters_) {
    const Asset& asset = asset_of(emitter.instance);
    const LspTriangle& triangle = asset.scene->triangles[emitter.triangle];
    const Corners c = corners(emitter.instance, triangle);
    const glm::vec3 radiance = share_there(triangle) * to_glm(asset.materials[triangle.material].emission);
    triangles.push_back({c.v0, c.e1, c.e2, radiance, emitter.cumulative, emitter.pdf});
  }
  return triangles;
}

EmitterPoint RenderScene::sample_emitter(float chance, glm::vec2 point) const {
  const auto found = std::lower_bound(emitters_.begin(), emitters_.end() - 1, chance,
                                      [](const Emitter& e, float value) { return e.cumulative <= value; });
  const Asset& asset = asset_of(found->instance);
  const LspTriangle& triangle = asset.scene->triangles[found->triangle];
  // Uniform over the triangle.
  const float root = std::sqrt(point.x);
  const float u = root * (1.0f - point.y);
  const float v = root * point.y;
  const Corners c = corners(found->instance, triangle);
  return {c.v0 + u * c.e1 + v * c.e2, glm::normalize(glm::cross(c.e1, c.e2)),
          share_there(triangle) * to_glm(asset.materials[triangle.material].emission), found->pdf};
}

SurfacePoint RenderScene::surface(const LspRay& ray, const LspHit& hit) const {
  const glm::vec3 direction = to_glm(ray.direction);
  const uint32_t instance = instanced_ == nullptr ? 0 : LSP_HIT_INSTANCE(hit);
  const Asset& asset = asset_of(instance);
  SurfacePoint point{};
  point.position = to_glm(ray.origin) + hit.t * direction;
  point.offset = instanced_ == nullptr ? lsp_hit_offset(asset.scene, &hit)
                                       : lsp_instance_hit_offset(&instanced_->instances().view(), &hit);
  point.shading_normal = to_glm(hit.normal);
  point.geometric_normal = point.shading_normal;
  const uint32_t index = hit.primitive < asset.triangle_of_primitive.size()
                             ? asset.triangle_of_primitive[hit.primitive]
                             : LSP_NONE;
  size_t material = 0;
  if (index != LSP_NONE) {
    const LspTriangle& triangle = asset.scene->triangles[index];
    const Corners c = corners(instance, triangle);
    const glm::vec3 cross = glm::cross(c.e1, c.e2);
    const float length = glm::length(cross);
    if (length > 0) point.geometric_normal = cross / length;
    // On a triangle that was hit exactly this is closer to it than origin + t * direction. A Line Space may
    // have moved t into its box, away from the point that the weights name.
    if ((hit.flags & LSP_HIT_LINE_SPACE) == 0) point.position = c.v0 + hit.u * c.e1 + hit.v * c.e2;
    material = triangle.material < asset.materials.size() ? triangle.material : 0;
  }
  if (glm::dot(point.geometric_normal, direction) > 0) point.geometric_normal = -point.geometric_normal;
  if (glm::dot(point.geometric_normal, point.shading_normal) < 0)
    point.shading_normal = -point.shading_normal;
  const LspMaterial& m = asset.materials[material];
  point.base_color = glm::clamp(to_glm(m.base_color), 0.0f, 1.0f);
  point.emission = to_glm(m.emission);
  point.roughness = glm::clamp(m.roughness, 0.0f, 1.0f);
  point.metallic = point.roughness < kRoughestGlossy ? glm::clamp(m.metallic, 0.0f, 1.0f) : 0.0f;
  return point;
}

glm::vec3 Sky::radiance(glm::vec3 direction) const {
  const float height = glm::dot(direction, up);
  const glm::vec3 zenith(0.28f, 0.52f, 1.0f);
  const glm::vec3 horizon(0.86f, 0.92f, 1.0f);
  const glm::vec3 ground(0.24f, 0.22f, 0.20f);
  const float haze = std::pow(1.0f - std::max(height, 0.0f), 3.0f);
  const glm::vec3 clear = glm::mix(zenith, horizon, haze) * 2.2f;
  // A soft glow about the sun.
  const float toward = std::max(glm::dot(direction, sun_direction), 0.0f);
  const glm::vec3 glow = glm::vec3(1.0f, 0.85f, 0.6f) * (0.9f * std::pow(toward, 24.0f));
  const float horizon_blend = glm::clamp(height * 12.0f + 0.5f, 0.0f, 1.0f);
  return brightness * glm::mix(ground, clear + glow, horizon_blend);
}

void make_frame(glm::vec3 n, glm::vec3& tangent, glm::vec3& bitangent) {
  const float sign = std::copysign(1.0f, n.z);
  const float a = -1.0f / (sign + n.z);
  const float b = n.x * n.y * a;
  tangent = {1.0f + sign * n.x * n.x * a, sign * b, -sign * n.x};
  bitangent = {b, sign + n.y * n.y * a, -n.y};
}

glm::vec3 cosine_direction(glm::vec3 n, glm::vec2 random) {
  glm::vec3 t;
  glm::vec3 b;
  make_frame(n, t, b);
  const float r = std::sqrt(random.x);
  const float angle = 6.28318530717958648f * random.y;
  return glm::normalize(r * std::cos(angle) * t + r * std::sin(angle) * b +
                        std::sqrt(std::max(1.0f - random.x, 0.0f)) * n);
}

}  // namespace lsp::sample
