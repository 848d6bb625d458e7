// Collects triangles of all inputs into one Mesh: counts, rejects, welds, and completes normals.
#pragma once

#include <filesystem>
#include <glm/glm.hpp>
#include <limits>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "import/budget.h"
#include "mesh.h"

namespace lsp {

// An index that refers to nothing.
inline constexpr uint32_t kNoIndex = 0xFFFFFFFFu;

// What to do at corners for which a file holds no normal.
enum class MissingNormals {
  kFlat,    // the triangle's own
  kSmooth,  // angle-weighted over the faces around an equal position, up to the crease angle
};

// Triangles of different smoothing groups share no normals; these are all of one, and those of kFlatGroup
// each of its own.
inline constexpr uint32_t kNoGroup = 0, kFlatGroup = 0xFFFFFFFFu;

class MeshBuilder {
 public:
  MeshBuilder(Budget& budget, float crease_angle_degrees);

  // Starts an input file; `add_source` names a further one that it led to, `add_missing` one that it would
  // have led to were it there.
  void begin_input(const std::filesystem::path& path) { mesh_.sources.push_back({path}); }
  void add_source(const std::filesystem::path& path);
  void add_missing(const std::filesystem::path& path);

  // Starts a group of triangles that index `positions` (which must outlive the group); `file` names it in
  // errors and notes, `triangle_count` is what it will add (charged to the budget at once).
  void begin(const std::string& file, std::span<const glm::dvec3> positions, uint64_t triangle_count,
             MissingNormals missing);

  // Counts one triangle, and keeps it unless it is to be rejected. `normals` are the file's at the corners:
  // any length, NaN where the file has none; null where it has none for all three. `color` is its own; null:
  // the material's.
  void add(const glm::uvec3& corners, const glm::vec3* normals, uint32_t material,
           const TriangleColor* color = nullptr, uint32_t smoothing = kNoGroup);

  // Ends the group; corners still without a normal get one.
  void end();

  // What is beyond a value's range is cut, with a note that begins with `file`.
  uint32_t add_material(const std::string& file, Material material);
  // The material of triangles to which no file gives one; made on first use.
  uint32_t default_material();
  bool is_default(uint32_t material) const { return material == default_material_; }
  void note(const std::string& text);
  Budget& budget() { return budget_; }
  // What the mesh so far and its welding keep allocated.
  uint64_t allocated_bytes() const;

  // Throws Failure kLimit where `more` triangles would not fit the 32-bit primitive numbers.
  void check_count(const std::string& file, uint64_t more) const;

  // What was counted and noted so far. Positions and origin are there only in what take() returns.
  const Mesh& mesh() const { return mesh_; }
  // The mesh in single precision, about an origin where that is needed.
  Mesh take();

 private:
  uint32_t weld(const glm::dvec3& position);
  void grow_slots();
  void start_colors();
  void smooth_missing();

  Budget& budget_;
  float crease_cosine_;
  Mesh mesh_;
  std::set<std::string> noted_;
  uint32_t default_material_ = kNoIndex;

  std::string file_;
  std::span<const glm::dvec3> positions_;
  std::vector<glm::dvec3> exact_;  // mesh_.positions before they are rounded
  MissingNormals missing_ = MissingNormals::kFlat;
  std::vector<uint32_t> welded_;     // per position of the group: its index in the mesh, or kNoIndex
  std::vector<uint32_t> slots_;      // open addressing over exact_
  size_t group_begin_ = 0;           // first kept triangle of the group
  std::vector<uint32_t> unsmooth_;   // kept triangles of the group with a corner without a normal
  std::vector<uint32_t> smoothing_;  // groups of the kept triangles of the group; empty: all kNoGroup
  uint64_t unusable_normals_ = 0;    // of the group: present but zero or not finite
};

}  // namespace lsp
