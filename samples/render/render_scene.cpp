#include "render_scene.h"

#include <algorithm>
#include <cmath>

#include "lsp/program.h"

namespace lsp::sample {
namespace {

[[noreturn]] void fail(const lsp_error& error, const std::string& file) {
  throw Failure(static_cast<Exit>(error.status), file, error.message);
}

float luminance(glm::vec3 color) { return glm::dot(color, glm::vec3(0.2126f, 0.7152f, 0.0722f)); }

// The share of a triangle that is there: it shines as a whole one of that much of its radiance.
float share_there(const LspTriangle& triangle) {
  return 1.0f - static_cast<float>(triangle.flags >> LSP_TRIANGLE_GAPS_SHIFT) / 65536.0f;
}

}  // namespace

RenderScene::RenderScene(const std::filesystem::path& path) {
  const std::string file = path.string();
  lsp_error error{};
  if (lsp_map_file(file.c_str(), &mapping_, &error) != LSP_OK) fail(error, file);
  try {
    lsp_status status = lsp_open(mapping_.bytes, mapping_.size, &scene_, &error);
    if (status == LSP_ERROR_UNSUPPORTED) {
      // Perhaps a packed file: try to unpack it, and report the first error if that does not help.
      uint64_t bytes = 0;
      lsp_error ignored{};
      if (lsp_unpacked_size(mapping_.bytes, mapping_.size, &bytes, &ignored) == LSP_OK &&
          bytes > mapping_.size / 2) {
        unpacked_.resize((bytes + sizeof(LspHeader) - 1) / sizeof(LspHeader));
        status = lsp_unpack(mapping_.bytes, mapping_.size, unpacked_.data(), bytes, &error);
        if (status == LSP_OK) status = lsp_open(unpacked_.data(), bytes, &scene_, &error);
      }
    }
    if (status != LSP_OK) fail(error, file);
    if ((scene_.header->required_features & LSP_FEATURE_EXACT) == 0) {
      throw Failure(Exit::kUnsupported, file,
                    "has no exact tree, which primary rays need; bake it without --no-exact");
    }
    index_primitives(file);
    find_emitters();
  } catch (...) {
    lsp_unmap_file(&mapping_);
    throw;
  }
}

RenderScene::~RenderScene() { lsp_unmap_file(&mapping_); }

glm::vec3 RenderScene::lo() const { return to_glm(scene_.header->bounds_min); }
glm::vec3 RenderScene::hi() const { return to_glm(scene_.header->bounds_max); }
void RenderScene::index_primitives(const std::string& file) {
  const LspHeader& header = *scene_.header;
  // The table has an entry per primitive: a header that declares far more of them than there are triangles
  // would only ask for memory.
  if (header.primitive_count > 64ull * header.triangle_count + (1ull << 24)) {
    throw Failure(Exit::kLimit, file,
                  "declares far more primitives than it has triangles; run lsp-validate on it");
  }
  triangle_of_primitive_.assign(header.primitive_count, LSP_NONE);
  for (uint32_t i = 0; i < header.triangle_count; ++i) {
    const uint32_t primitive = scene_.triangles[i].primitive;
    if (primitive >= header.primitive_count) {
      throw Failure(Exit::kInvalid, file, "a triangle's primitive is out of range; run lsp-validate on it");
    }
    // Spatial splits repeat a primitive; its records are the same.
    triangle_of_primitive_[primitive] = i;
  }
  if (scene_.materials != nullptr && header.material_count > 0) {
    materials_.assign(scene_.materials, scene_.materials + header.material_count);
  } else {
    LspMaterial grey{};
    grey.base_color = {0.7f, 0.7f, 0.7f};
    grey.opacity = 1.0f;
    grey.roughness = 0.6f;
    materials_.push_back(grey);
    notes_.emplace_back("no materials in the file: everything is grey");
  }
  if (scene_.normals == nullptr) notes_.emplace_back("no corner normals in the file: surfaces are faceted");
}

void RenderScene::find_emitters() {
  double total = 0;
  std::vector<double> powers;
  for (uint32_t i = 0; i < scene_.header->triangle_count; ++i) {
    const LspTriangle& triangle = scene_.triangles[i];
    if (triangle_of_primitive_[triangle.primitive] != i || triangle.material >= materials_.size()) continue;
    const float brightness =
        share_there(triangle) * luminance(to_glm(materials_[triangle.material].emission));
    if (!(brightness > 0) || !std::isfinite(brightness)) continue;
    const glm::vec3 v0 = to_glm(triangle.v0);
    const float area = 0.5f * glm::length(glm::cross(to_glm(triangle.v1) - v0, to_glm(triangle.v2) - v0));
    if (!(area > 0)) continue;
    total += static_cast<double>(area) * static_cast<double>(brightness);
    powers.push_back(total);
    emitters_.push_back({i, 0.0f, brightness});
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

EmitterPoint RenderScene::sample_emitter(float chance, glm::vec2 point) const {
  const auto found = std::lower_bound(emitters_.begin(), emitters_.end() - 1, chance,
                                      [](const Emitter& e, float value) { return e.cumulative <= value; });
  const LspTriangle& triangle = scene_.triangles[found->triangle];
  // Uniform over the triangle.
  const float root = std::sqrt(point.x);
  const float u = root * (1.0f - point.y);
  const float v = root * point.y;
  const glm::vec3 v0 = to_glm(triangle.v0);
  const glm::vec3 e1 = to_glm(triangle.v1) - v0;
  const glm::vec3 e2 = to_glm(triangle.v2) - v0;
  return {v0 + u * e1 + v * e2, glm::normalize(glm::cross(e1, e2)),
          share_there(triangle) * to_glm(materials_[triangle.material].emission), found->pdf};
}

SurfacePoint RenderScene::surface(const LspRay& ray, const LspHit& hit) const {
  const glm::vec3 direction = to_glm(ray.direction);
  SurfacePoint point{};
  point.position = to_glm(ray.origin) + hit.t * direction;
  point.offset = lsp_hit_offset(&scene_, &hit);
  point.shading_normal = to_glm(hit.normal);
  point.geometric_normal = point.shading_normal;
  const uint32_t index =
      hit.primitive < triangle_of_primitive_.size() ? triangle_of_primitive_[hit.primitive] : LSP_NONE;
  size_t material = 0;
  if (index != LSP_NONE) {
    const LspTriangle& triangle = scene_.triangles[index];
    const glm::vec3 v0 = to_glm(triangle.v0);
    const glm::vec3 e1 = to_glm(triangle.v1) - v0;
    const glm::vec3 e2 = to_glm(triangle.v2) - v0;
    const glm::vec3 cross = glm::cross(e1, e2);
    const float length = glm::length(cross);
    if (length > 0) point.geometric_normal = cross / length;
    // On a triangle that was hit exactly this is closer to it than origin + t * direction. A Line Space may
    // have moved t into its box, away from the point that the weights name.
    if ((hit.flags & LSP_HIT_LINE_SPACE) == 0) point.position = v0 + hit.u * e1 + hit.v * e2;
    material = triangle.material < materials_.size() ? triangle.material : 0;
  }
  if (glm::dot(point.geometric_normal, direction) > 0) point.geometric_normal = -point.geometric_normal;
  if (glm::dot(point.geometric_normal, point.shading_normal) < 0)
    point.shading_normal = -point.shading_normal;
  const LspMaterial& m = materials_[material];
  point.base_color = glm::clamp(to_glm(m.base_color), 0.0f, 1.0f);
  point.emission = to_glm(m.emission);
  point.roughness = glm::clamp(m.roughness, 0.0f, 1.0f);
  point.metallic = glm::clamp(m.metallic, 0.0f, 1.0f);
  return point;
}

glm::vec3 Sky::radiance(glm::vec3 direction) const {
  const float up = direction.y;
  const glm::vec3 zenith(0.28f, 0.52f, 1.0f);
  const glm::vec3 horizon(0.86f, 0.92f, 1.0f);
  const glm::vec3 ground(0.24f, 0.22f, 0.20f);
  const float haze = std::pow(1.0f - std::max(up, 0.0f), 3.0f);
  const glm::vec3 clear = glm::mix(zenith, horizon, haze) * 2.2f;
  // A soft glow about the sun.
  const float toward = std::max(glm::dot(direction, sun_direction), 0.0f);
  const glm::vec3 glow = glm::vec3(1.0f, 0.85f, 0.6f) * (0.9f * std::pow(toward, 24.0f));
  const float horizon_blend = glm::clamp(up * 12.0f + 0.5f, 0.0f, 1.0f);
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
