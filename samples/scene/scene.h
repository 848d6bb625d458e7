// A scene before it becomes a file: materials, meshes of several surfaces, and a tree of nodes that place
// the meshes. Mirrors what glTF can say.
#pragma once

#include <cstdint>
#include <filesystem>
#include <glm/glm.hpp>
#include <glm/gtc/quaternion.hpp>
#include <string>
#include <vector>

#include "surface.h"

namespace lsp::sample {

// Colours as textures have them: rows from the top, sRGB and alpha.
struct Texture {
  int width = 0;
  int height = 0;
  std::vector<uint8_t> rgba;
};

struct Material {
  std::string name;
  glm::vec3 base_color{0.8f};  // linear
  float roughness = 0.9f;
  float metallic = 0.0f;
  glm::vec3 emission{0.0f};  // linear radiance
  Texture texture{};         // multiplies base_color; none where it is empty
  bool masked = false;       // what has an alpha below a half is not there
};

struct Part {
  int material = 0;
  Surface surface;
};

struct Mesh {
  std::string name;
  std::vector<Part> parts;
};

struct Node {
  std::string name;
  int mesh = -1;  // -1: only a place for children
  glm::vec3 translation{0.0f};
  glm::quat rotation{1.0f, 0.0f, 0.0f, 0.0f};
  glm::vec3 scale{1.0f};
  std::vector<int> children;
};

struct Scene {
  std::vector<Material> materials;
  std::vector<Mesh> meshes;
  std::vector<Node> nodes;
  std::vector<int> roots;
};

// Triangles once every instance is expanded.
uint64_t triangle_count(const Scene& scene);

// How finely curves are cut. `scale` 1 is the default; steps grow in proportion to it, so triangles grow with
// its square.
struct Detail {
  float scale = 1.0f;
  // Steps for a curve that has `steps` at scale 1 and must keep at least `least`.
  int steps(int count, int least) const {
    const int scaled = static_cast<int>(static_cast<float>(count) * scale + 0.5f);
    return scaled > least ? scaled : least;
  }
  // Whether small things that only show from scale `from` on are made at all.
  bool shows(float from) const { return scale >= from; }
};

// The scenes, by name: "atrium", "grove", "spheres", "plane", "objects", "stadium". An unknown name throws
// lsp::Failure.
Scene make_scene(const std::string& name, const Detail& detail);
Scene make_atrium(const Detail& detail);
Scene make_grove(const Detail& detail);
Scene make_spheres(const Detail& detail);
Scene make_plane(const Detail& detail);
Scene make_objects(const Detail& detail);
Scene make_stadium(const Detail& detail);

// Leaves and whatever else has a mask become solid. False: nothing has one.
bool take_masks_off(Scene& scene);

// The detail at which the scene has about `triangles` triangles (as near as whole steps allow). Throws
// lsp::Failure (Exit::kUsage) where that misses the wish by more than a quarter.
Detail detail_for(const std::string& name, uint64_t triangles);

// The bytes of a binary glTF 2.0 file. Emission above 1 uses KHR_materials_emissive_strength.
std::string to_glb(const Scene& scene);

}  // namespace lsp::sample
