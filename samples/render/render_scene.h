// An open .lsp file, or a scene of instances of several, with what shading needs beside it: triangles by
// primitive, materials, emitters, a sky.
#pragma once

#include <filesystem>
#include <glm/glm.hpp>
#include <memory>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "lsp/lsp_instances.h"
#include "lsp/scene_file.hpp"

namespace lsp {
class InstancedScene;
}

namespace lsp::sample {

// Surfaces at least as rough have no glossy ray: their lobe is diffuse to the eye, a metal's, too.
inline constexpr float kRoughestGlossy = 0.7f;

// A point of the scene seen along a ray.
struct SurfacePoint {
  glm::vec3 position;
  glm::vec3 geometric_normal;  // unit, on the side the ray came from
  glm::vec3 shading_normal;    // unit, on the same side
  float offset;                // of rays that leave it, along geometric_normal (lsp_hit_offset)
  glm::vec3 base_color;
  glm::vec3 emission;
  float roughness = 1.0f;
  float metallic = 0.0f;  // 0 for a metal that is seen as diffuse
};

// A point on a light-emitting triangle, chosen in proportion to area times luminance.
struct EmitterPoint {
  glm::vec3 position;
  glm::vec3 normal;  // unit; emitters shine to both sides
  glm::vec3 radiance;
  float pdf = 0.0f;  // per area
};

// A light-emitting triangle and how often it is chosen.
struct EmitterTriangle {
  glm::vec3 corner;
  glm::vec3 edge1;
  glm::vec3 edge2;
  glm::vec3 radiance;
  float cumulative;  // of area times luminance, up to and with this one, over the total
  float pdf;         // per area
};

// Owns the files.
class RenderScene {
 public:
  // Maps and opens `path`, an .lsp file or, by its ending .json, a scene of instances; packed files are
  // unpacked into memory. Throws lsp::Failure: kFile, kInvalid, or kUnsupported for a file without an exact
  // tree, which primary rays need.
  explicit RenderScene(const std::filesystem::path& path);
  ~RenderScene();
  RenderScene(const RenderScene&) = delete;
  RenderScene& operator=(const RenderScene&) = delete;

  const std::string& path() const { return path_; }
  // The one file's scene; nullptr: there are instances.
  const lsp_scene* single() const { return file_ ? &file_->scene() : nullptr; }
  // Of every file.
  const std::vector<const LspHeader*>& headers() const { return headers_; }
  // Whether any file has tables, without which approximate rays are exact.
  bool has_tables() const;
  // The instances; nullptr: there is one file.
  const lsp_instances* instances() const;
  glm::vec3 lo() const;
  glm::vec3 hi() const;
  float diagonal() const { return glm::length(hi() - lo()); }
  // A triangle in scene space.
  struct Corners {
    glm::vec3 v0;
    glm::vec3 e1;  // from v0 to the others
    glm::vec3 e2;
  };
  // About `most` triangles, spread over all instances; all where there are fewer.
  std::vector<Corners> some_triangles(size_t most) const;
  // Of the files that the meshes were read from, as source_endings of source_format.h.
  const std::set<std::string>& source_endings() const { return source_endings_; }
  // What the file does not have and what stands in for it; empty if nothing is missing.
  const std::vector<std::string>& notes() const { return notes_; }

  // Traces rays into hits, of the same size, on the CPU, in this thread; adds to *counts unless it is null.
  // Throws lsp::Failure.
  void trace(const lsp_trace_options& options, std::span<const LspRay> rays, std::span<LspHit> hits,
             lsp_trace_counts* counts) const;

  // The point that `ray` hits; `hit` must be a hit of this scene.
  SurfacePoint surface(const LspRay& ray, const LspHit& hit) const;

  // Of every file, in the order of headers(), what a device needs for the same: the LspTriangle of each
  // primitive (LSP_NONE: it was dropped), and at least one material.
  std::span<const uint32_t> triangles_of_primitives(size_t file) const {
    return assets_[file].triangle_of_primitive;
  }
  std::span<const LspMaterial> materials(size_t file) const { return assets_[file].materials; }
  // The light-emitting triangles, in the order in which sample_emitter looks for them.
  std::vector<EmitterTriangle> emitters() const;

  bool has_emitters() const { return !emitters_.empty(); }
  // `chance` picks the triangle, `point` the place on it; all in [0, 1).
  EmitterPoint sample_emitter(float chance, glm::vec2 point) const;

 private:
  // What shading needs of a file.
  struct Asset {
    const lsp_scene* scene;
    std::vector<uint32_t> triangle_of_primitive;
    std::vector<LspMaterial> materials;
  };
  struct Emitter {
    uint32_t instance;  // 0 where there are none
    uint32_t triangle;
    float cumulative;  // of area times luminance, up to and with this one, over the total
    float pdf;         // per area
  };
  void add_asset(const SceneFile& file, const std::string& path);
  void index_primitives(Asset& asset, const std::string& file) const;
  void find_materials(Asset& asset, const std::string& note_prefix);
  void find_emitters();
  uint32_t instance_count() const;
  const Asset& asset_of(uint32_t instance) const;
  Corners corners(uint32_t instance, const LspTriangle& triangle) const;

  std::string path_;
  std::optional<SceneFile> file_;
  std::unique_ptr<InstancedScene> instanced_;
  std::vector<Asset> assets_;
  std::vector<const LspHeader*> headers_;
  std::set<std::string> source_endings_;
  std::vector<Emitter> emitters_;
  std::vector<std::string> notes_;
};

// The light that is no part of the scene: a clear sky with a sun in it, and perhaps a lamp.
struct Sky {
  glm::vec3 up = glm::vec3(0.0f, 1.0f, 0.0f);  // unit
  glm::vec3 sun_direction = glm::normalize(glm::vec3(-0.28f, 0.80f, 0.53f));
  glm::vec3 sun_irradiance = glm::vec3(1.0f, 0.87f, 0.70f) * 9.0f;
  float sun_radius_rad = 0.012f;
  float brightness = 1.0f;
  // A small ball that shines evenly, for halls without light of their own. Radiant intensity; black: none.
  glm::vec3 lamp_position = glm::vec3(0.0f);
  float lamp_radius = 0.0f;
  glm::vec3 lamp_intensity = glm::vec3(0.0f);
  // Radiance of the sky without the sun's disc.
  glm::vec3 radiance(glm::vec3 direction) const;
};

// Unit vectors that make a right-handed frame with unit `n` (Duff et al. 2017).
void make_frame(glm::vec3 n, glm::vec3& tangent, glm::vec3& bitangent);
// A cosine-distributed direction about unit `n`.
glm::vec3 cosine_direction(glm::vec3 n, glm::vec2 random);

// A direction that the shading normal allows but that runs into the surface is mirrored out of it.
glm::vec3 above(const SurfacePoint& point, glm::vec3 direction);

// A little above the surface, on the side that it was seen from, and a ray that leaves from there.
glm::vec3 lifted(const SurfacePoint& point);
LspRay ray_from(const SurfacePoint& point, glm::vec3 direction, float tmax);

inline glm::vec3 to_glm(lsp_float3 v) { return {v.x, v.y, v.z}; }
inline lsp_float3 from_glm(glm::vec3 v) { return {v.x, v.y, v.z}; }

}  // namespace lsp::sample
