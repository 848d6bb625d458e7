// The mesh between import and the base structure: plain arrays in world space, about an origin.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <glm/glm.hpp>
#include <string>
#include <vector>

namespace lsp {

// What a triangle's material, textures and vertices make of it, by means over its area in linear light.
struct TriangleColor {
  glm::vec3 base_color{0.8f};  // of what is solid
  glm::vec3 emission{0.0f};    // of what is solid
  float coverage = 1.0f;       // the share of it that is solid, above 0
  bool operator==(const TriangleColor&) const = default;
};

struct Material {
  std::string name;
  glm::vec3 base_color{0.8f};  // linear, the factor without textures
  float opacity = 1.0f;
  glm::vec3 emission{0.0f};  // linear radiance
  float roughness = 1.0f;
  float metallic = 0.0f;
  TriangleColor color() const { return {base_color, emission, opacity}; }
};

// Why triangles of the input are not in the mesh. No triangle is dropped for any other reason.
struct Rejected {
  uint64_t degenerate = 0;    // two equal corners, or area below 1e-14 of the longest edge squared
  uint64_t non_finite = 0;    // a corner at infinity or NaN
  uint64_t out_of_range = 0;  // an index beyond the vertices
  uint64_t collapsed = 0;     // has an area, but none in single precision about the origin
  uint64_t invisible = 0;     // textures and factors leave nothing of it
  uint64_t total() const { return degenerate + non_finite + out_of_range + collapsed + invisible; }
};

struct Mesh {
  glm::dvec3 origin{0};               // in the input's space; not 0 only where float32 needs it
  std::vector<glm::vec3> positions;   // world space less origin, welded where the input shares them
  std::vector<glm::uvec3> triangles;  // indices into positions, all in range
  std::vector<uint32_t> primitives;   // per triangle: number in import order
  std::vector<std::array<glm::vec3, 3>> normals;  // per triangle and corner, unit length
  std::vector<uint32_t> material_ids;             // per triangle, index into materials
  std::vector<Material> materials;                // never empty
  std::vector<TriangleColor> colors;              // per triangle; empty: each has its material's
  uint64_t primitive_count = 0;                   // triangles in import order, rejected ones included
  Rejected rejected;                              // triangles.size() + rejected.total() = primitive_count
  std::vector<std::string> notes;                 // what was skipped or assumed, for the report
  // Per input: itself, then each file beside it that is in the mesh, or would be were it there.
  std::vector<std::vector<std::filesystem::path>> sources;

  TriangleColor color(size_t t) const {
    return colors.empty() ? materials[material_ids[t]].color() : colors[t];
  }
};

}  // namespace lsp
