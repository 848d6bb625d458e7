#include "import/mesh_builder.h"

#include <tbb/parallel_for.h>
#include <xxhash.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstring>

#include "import/rounding.h"
#include "import/source_file.h"
#include "lsp/program.h"

namespace lsp {
namespace {

// Corners that share one position and are looked at when smoothing; beyond, normals stay flat. A bound on the
// time a mesh with a million triangles in one point may take.
constexpr size_t kMaxSmoothValence = 512;

// Whether single precision has room for every component.
bool is_finite(const glm::dvec3& v) {
  return std::isfinite(float(v.x)) && std::isfinite(float(v.y)) && std::isfinite(float(v.z));
}

// Unit vector along `v`, or zero where it has no direction; safe from over- and underflow.
glm::dvec3 direction_of(const glm::dvec3& v) {
  const double largest = std::max(std::abs(v.x), std::max(std::abs(v.y), std::abs(v.z)));
  if (!(largest > 0) || !std::isfinite(largest)) return glm::dvec3(0);
  const glm::dvec3 scaled = v / largest;
  return scaled / std::sqrt(glm::dot(scaled, scaled));
}

glm::dvec3 geometric_normal(const glm::dvec3& a, const glm::dvec3& b, const glm::dvec3& c) {
  return direction_of(glm::cross(b - a, c - a));
}

uint64_t hash_of(const glm::dvec3& p) { return XXH3_64bits_withSeed(&p, sizeof p, hash_key()); }

}  // namespace

MeshBuilder::MeshBuilder(Budget& budget, float crease_angle_degrees)
    : budget_(budget), crease_cosine_(std::cos(crease_angle_degrees * 3.14159265358979f / 180.0f)) {}

void MeshBuilder::check_count(const std::string& file, uint64_t more) const {
  if (more > uint64_t{0xFFFFFFFE} - mesh_.primitive_count) {
    throw Failure(Exit::kLimit, file, "holds more than 2^32 - 2 triangles, split the mesh");
  }
}

uint64_t MeshBuilder::allocated_bytes() const {
  const auto bytes = [](const auto& vector) { return vector.capacity() * sizeof(vector[0]); };
  return bytes(exact_) + bytes(mesh_.triangles) + bytes(mesh_.primitives) + bytes(mesh_.normals) +
         bytes(mesh_.material_ids) + bytes(mesh_.colors) + 2 * bytes(mesh_.materials) + bytes(slots_) +
         bytes(welded_) + bytes(unsmooth_);
}

void MeshBuilder::add_source(const std::filesystem::path& path) {
  std::vector<std::filesystem::path>& list = mesh_.sources.back();
  if (std::find(list.begin(), list.end(), path) != list.end()) return;
  budget_.charge(path.string(), 256 + path.native().size());
  list.push_back(path);
}

// A file can name as many as it has lines.
void MeshBuilder::add_missing(const std::filesystem::path& path) {
  constexpr size_t kMost = 100, kLongest = 1000;
  if (mesh_.sources.back().size() < kMost && path.native().size() < kLongest) add_source(path);
}

void MeshBuilder::begin(const std::string& file, std::span<const glm::dvec3> positions,
                        uint64_t triangle_count, MissingNormals missing) {
  check_count(file, triangle_count);
  // Kept for good: indices, number, normals, material. For a while: the welding, and a vector's old half
  // while it grows.
  constexpr uint64_t kTriangleBytes =
      sizeof(glm::uvec3) + sizeof(uint32_t) + 3 * sizeof(glm::vec3) + sizeof(uint32_t);
  budget_.charge(file, triangle_count,
                 (kTriangleBytes + (mesh_.colors.empty() ? 0 : sizeof(TriangleColor))) * 3 / 2);
  budget_.charge(file, positions.size(), sizeof(uint32_t) + sizeof(glm::dvec3) * 3 / 2);
  file_ = file;
  positions_ = positions;
  missing_ = missing;
  group_begin_ = mesh_.triangles.size();
  unsmooth_.clear();
  smoothing_.clear();
  unusable_normals_ = 0;
  welded_.assign(positions.size(), kNoIndex);
  // Many small groups must not each move the whole mesh.
  const auto reserve = [&](auto& vector) {
    const size_t wanted = vector.size() + triangle_count;
    if (wanted > vector.capacity()) vector.reserve(std::max(wanted, vector.capacity() * 3 / 2));
  };
  reserve(mesh_.triangles);
  reserve(mesh_.primitives);
  reserve(mesh_.normals);
  reserve(mesh_.material_ids);
  if (!mesh_.colors.empty()) reserve(mesh_.colors);
}

void MeshBuilder::add(const glm::uvec3& corners, const glm::vec3* normals, uint32_t material,
                      const TriangleColor* color, uint32_t smoothing) {
  const auto primitive = uint32_t(mesh_.primitive_count++);
  const size_t count = positions_.size();
  if (corners.x >= count || corners.y >= count || corners.z >= count) {
    ++mesh_.rejected.out_of_range;
    return;
  }
  const glm::dvec3 a = positions_[corners.x], b = positions_[corners.y], c = positions_[corners.z];
  if (!is_finite(a) || !is_finite(b) || !is_finite(c)) {
    ++mesh_.rejected.non_finite;
    return;
  }
  // Not where rounding makes it a triangle: many a mesh has such slivers, and neighbours that meet in them.
  if (is_degenerate(a, b, c) && is_degenerate(rounded(a), rounded(b), rounded(c))) {
    ++mesh_.rejected.degenerate;
    return;
  }

  const TriangleColor own = color ? *color : mesh_.materials[material].color();
  if (!(own.coverage > 0)) {
    ++mesh_.rejected.invisible;
    return;
  }

  glm::uvec3 indices;
  for (int i = 0; i < 3; ++i) {
    uint32_t& known = welded_[corners[i]];
    if (known == kNoIndex) known = weld(positions_[corners[i]]);
    indices[i] = known;
  }

  std::array<glm::vec3, 3> unit;
  bool complete = true;
  for (int i = 0; i < 3; ++i) {
    // A NaN in all components says "none"; the sentinel survives to smooth_missing().
    const bool present =
        normals && !(std::isnan(normals[i].x) && std::isnan(normals[i].y) && std::isnan(normals[i].z));
    if (present) {
      glm::dvec3 direction = is_finite(normals[i]) ? direction_of(glm::dvec3(normals[i])) : glm::dvec3(0);
      if (direction == glm::dvec3(0)) {
        ++unusable_normals_;
        direction = geometric_normal(a, b, c);
      }
      unit[i] = glm::vec3(direction);
    } else if (missing_ == MissingNormals::kFlat || smoothing == kFlatGroup) {
      unit[i] = glm::vec3(geometric_normal(a, b, c));
    } else {
      unit[i] = glm::vec3(std::numeric_limits<float>::quiet_NaN());
      complete = false;
    }
  }
  if (smoothing != kNoGroup || !smoothing_.empty()) {
    while (smoothing_.size() < mesh_.triangles.size() - group_begin_)
      budget_.push_back(file_, smoothing_, kNoGroup);
    budget_.push_back(file_, smoothing_, smoothing);
  }
  if (!complete) unsmooth_.push_back(uint32_t(mesh_.triangles.size()));
  mesh_.triangles.push_back(indices);
  mesh_.primitives.push_back(primitive);
  mesh_.normals.push_back(unit);
  mesh_.material_ids.push_back(material);
  if (mesh_.colors.empty()) {
    if (!color || own == mesh_.materials[material].color()) return;
    start_colors();
  }
  mesh_.colors.push_back(own);
}

// From the first triangle on that is not as its material says, each has a colour.
void MeshBuilder::start_colors() {
  budget_.charge(file_, mesh_.triangles.capacity(), sizeof(TriangleColor));
  mesh_.colors.reserve(mesh_.triangles.capacity());
  for (size_t t = 0; t + 1 < mesh_.triangles.size(); ++t)
    mesh_.colors.push_back(mesh_.materials[mesh_.material_ids[t]].color());
}

void MeshBuilder::end() {
  if (!unsmooth_.empty()) smooth_missing();
  if (unusable_normals_) {
    note(file_ + ": " + std::to_string(unusable_normals_) +
         " corner normals are zero or not finite, the triangle's own takes their place");
  }
  budget_.release(positions_.size() * sizeof(uint32_t) + smoothing_.capacity() * sizeof(uint32_t));
  smoothing_ = {};
  positions_ = {};
}

uint32_t MeshBuilder::weld(const glm::dvec3& position) {
  if (2 * (exact_.size() + 1) > slots_.size()) grow_slots();
  const glm::dvec3 p = position + 0.0;  // -0 becomes +0
  const size_t mask = slots_.size() - 1;
  for (size_t slot = hash_of(p) & mask;; slot = (slot + 1) & mask) {
    if (slots_[slot] == kNoIndex) {
      slots_[slot] = uint32_t(exact_.size());
      exact_.push_back(p);
      return slots_[slot];
    }
    if (exact_[slots_[slot]] == p) return slots_[slot];
  }
}

void MeshBuilder::grow_slots() {
  const size_t size = slots_.empty() ? 1024 : slots_.size() * 2;
  budget_.charge(file_, size, sizeof(uint32_t));
  budget_.release(slots_.size() * sizeof(uint32_t));
  slots_.assign(size, kNoIndex);
  for (uint32_t i = 0; i < exact_.size(); ++i) {
    size_t slot = hash_of(exact_[i]) & (size - 1);
    while (slots_[slot] != kNoIndex) slot = (slot + 1) & (size - 1);
    slots_[slot] = i;
  }
}

// Angle-weighted normals (Thuermer and Wuethrich 1998): a corner's normal is the sum of the normals of the
// faces around its position, each by its angle there, over those of its smoothing group within the crease
// angle of its own face.
void MeshBuilder::smooth_missing() {
  struct Corner {
    glm::vec3 face_normal;
    float angle;
  };
  const size_t first = group_begin_, count = mesh_.triangles.size() - first;
  const uint64_t temporary = count * 3 * (sizeof(Corner) + (smoothing_.empty() ? 1 : 2) * sizeof(uint32_t)) +
                             (exact_.size() + 1) * sizeof(uint32_t);
  budget_.charge(file_, temporary);

  // Corners sorted by position: those of position p are by_position[begins[p] .. begins[p + 1]).
  std::vector<uint32_t> begins(exact_.size() + 1, 0);
  for (size_t t = first; t < first + count; ++t) {
    for (int i = 0; i < 3; ++i) ++begins[mesh_.triangles[t][i] + 1];
  }
  for (size_t p = 1; p < begins.size(); ++p) begins[p] += begins[p - 1];
  std::vector<Corner> by_position(count * 3);
  std::vector<uint32_t> groups(smoothing_.empty() ? 0 : count * 3);  // of the corners by position
  std::vector<uint32_t> place(count * 3);
  {
    std::vector<uint32_t> next(begins.begin(), begins.end() - 1);
    for (size_t t = 0; t < count; ++t)
      for (int i = 0; i < 3; ++i) place[3 * t + i] = next[mesh_.triangles[first + t][i]]++;
  }
  tbb::parallel_for(size_t(0), count, [&](size_t t) {
    const glm::uvec3& triangle = mesh_.triangles[first + t];
    const glm::dvec3 p[3] = {exact_[triangle.x], exact_[triangle.y], exact_[triangle.z]};
    const glm::vec3 normal(geometric_normal(p[0], p[1], p[2]));
    for (int i = 0; i < 3; ++i) {
      const glm::dvec3 u = direction_of(p[(i + 1) % 3] - p[i]);
      const glm::dvec3 v = direction_of(p[(i + 2) % 3] - p[i]);
      const double sine = std::sqrt(glm::dot(glm::cross(u, v), glm::cross(u, v)));
      by_position[place[3 * t + i]] = {normal, float(std::atan2(sine, glm::dot(u, v)))};
      if (!groups.empty()) groups[place[3 * t + i]] = smoothing_[t];
    }
  });

  std::atomic<uint64_t> too_many = 0;
  tbb::parallel_for(size_t(0), unsmooth_.size(), [&](size_t k) {
    const uint32_t t = unsmooth_[k];
    for (int i = 0; i < 3; ++i) {
      glm::vec3& normal = mesh_.normals[t][i];
      if (!std::isnan(normal.x)) continue;
      const uint32_t p = mesh_.triangles[t][i];
      const uint32_t own_place = place[3 * (t - first) + i];
      const glm::vec3 own = by_position[own_place].face_normal;
      normal = own;
      if (begins[p + 1] - begins[p] > kMaxSmoothValence) {
        ++too_many;
        continue;
      }
      glm::dvec3 sum(0);
      for (uint32_t c = begins[p]; c < begins[p + 1]; ++c) {
        const Corner& corner = by_position[c];
        if (!groups.empty() && groups[c] != groups[own_place]) continue;
        if (glm::dot(corner.face_normal, own) >= crease_cosine_)
          sum += glm::dvec3(corner.face_normal) * double(corner.angle);
      }
      const glm::dvec3 smooth = direction_of(sum);
      if (smooth != glm::dvec3(0)) normal = glm::vec3(smooth);
    }
  });
  if (too_many > 0) {
    note(file_ + ": " + std::to_string(too_many.load()) + " corners lie where more than " +
         std::to_string(kMaxSmoothValence) + " triangles meet, their normals stay flat");
  }
  budget_.release(temporary);
}

uint32_t MeshBuilder::add_material(const std::string& file, Material material) {
  material.name = printable(material.name);
  bool cut = false;
  const auto bounded = [&](float value, float fallback, float high) {
    const float bound = std::isfinite(value) ? std::min(std::max(value, 0.0f), high) : fallback;
    cut = cut || !(bound == value);
    return bound;
  };
  constexpr float kLargest = std::numeric_limits<float>::max();
  for (int i = 0; i < 3; ++i) {
    material.base_color[i] = bounded(material.base_color[i], 0.8f, 1.0f);
    material.emission[i] = bounded(material.emission[i], 0.0f, kLargest);
  }
  material.opacity = bounded(material.opacity, 1.0f, 1.0f);
  material.roughness = bounded(material.roughness, 1.0f, 1.0f);
  material.metallic = bounded(material.metallic, 0.0f, 1.0f);
  if (cut) note(file + ": colours and factors of materials are cut to what their range permits");
  budget_.charge(file, sizeof(Material) * 2 + material.name.size());
  mesh_.materials.push_back(std::move(material));
  return uint32_t(mesh_.materials.size() - 1);
}

uint32_t MeshBuilder::default_material() {
  if (default_material_ == kNoIndex) default_material_ = add_material(file_, {});
  return default_material_;
}

void MeshBuilder::note(const std::string& text) {
  // A file can give as many reasons for a note as it has lines.
  constexpr size_t kMaxNotes = 1000;
  if (noted_.size() < kMaxNotes && noted_.insert(text).second) mesh_.notes.push_back(printable(text));
}

Mesh MeshBuilder::take() {
  if (mesh_.materials.empty()) default_material();
  OriginChooser chooser;
  for (const glm::dvec3& position : exact_) chooser.add(position);
  mesh_.origin = chooser.origin();
  if (const uint64_t bent = round_positions(exact_, mesh_))
    note(std::to_string(bent) +
         " triangles keep little of their shape: in a scene of this size single precision moves corners by "
         "more than a tenth of their edges; bake what lies far apart by itself");
  const Rejected& rejected = mesh_.rejected;
  const std::pair<uint64_t, const char*> left_out[] = {
      {rejected.degenerate, "have no area"},
      {rejected.non_finite, "have a corner that is not finite"},
      {rejected.out_of_range, "refer to vertices that are not there"},
      {rejected.invisible, "are wholly transparent"},
      {rejected.collapsed, "are too small for single precision in a scene of this size"}};
  for (const auto& [count, why] : left_out) {
    if (count) note(std::to_string(count) + " triangles " + why + ", they are left out");
  }
  return std::move(mesh_);
}

}  // namespace lsp
