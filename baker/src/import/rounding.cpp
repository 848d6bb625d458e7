#include "import/rounding.h"

#include <sys/random.h>
#include <xxhash.h>

#include <algorithm>
#include <chrono>
#include <cmath>

namespace lsp {
namespace {

// A triangle's area below this part of its longest edge squared is no area.
constexpr double kDegenerateArea = 1e-14;

// Of the scene's longest side: no vertex may be moved further.
constexpr double kTolerance = 1e-6;

// Of a triangle's longest edge: what it loses of its shape before it is said.
constexpr double kBent = 0.1;

double largest(const glm::dvec3& v) {
  return std::max(std::abs(v.x), std::max(std::abs(v.y), std::abs(v.z)));
}

// Leaves each position once.
void weld(Mesh& mesh) {
  constexpr uint32_t kFree = 0xFFFFFFFFu;
  size_t size = 1024;
  while (size < 2 * mesh.positions.size()) size *= 2;
  std::vector<uint32_t> slots(size, kFree), place(mesh.positions.size());
  uint32_t kept = 0;
  for (size_t i = 0; i < place.size(); ++i) {
    const glm::vec3 p = mesh.positions[i];
    size_t slot = XXH3_64bits_withSeed(&p, sizeof p, hash_key()) & (size - 1);
    while (slots[slot] != kFree && mesh.positions[slots[slot]] != p) slot = (slot + 1) & (size - 1);
    if (slots[slot] == kFree) {
      slots[slot] = kept;
      mesh.positions[kept++] = p;
    }
    place[i] = slots[slot];
  }
  if (kept == place.size()) return;
  mesh.positions.resize(kept);
  for (glm::uvec3& triangle : mesh.triangles)
    triangle = {place[triangle.x], place[triangle.y], place[triangle.z]};
}

// Takes out the triangles that `gone` says, and every position that no triangle needs any more.
void remove_triangles(Mesh& mesh, const std::vector<bool>& gone) {
  const auto compact = [&](auto& list) {
    if (list.empty()) return;
    size_t kept = 0;
    for (size_t t = 0; t < gone.size(); ++t) {
      if (!gone[t]) list[kept++] = list[t];
    }
    list.resize(kept);
  };
  compact(mesh.triangles);
  compact(mesh.primitives);
  compact(mesh.normals);
  compact(mesh.material_ids);
  compact(mesh.colors);
  std::vector<uint32_t> place(mesh.positions.size(), 0);
  for (const glm::uvec3& triangle : mesh.triangles)
    place[triangle.x] = place[triangle.y] = place[triangle.z] = 1;
  uint32_t kept = 0;
  for (uint32_t i = 0; i < place.size(); ++i) {
    if (!place[i]) continue;
    place[i] = kept;
    mesh.positions[kept++] = mesh.positions[i];
  }
  mesh.positions.resize(kept);
  for (glm::uvec3& triangle : mesh.triangles)
    triangle = {place[triangle.x], place[triangle.y], place[triangle.z]};
}

}  // namespace

bool is_degenerate(const glm::dvec3& a, const glm::dvec3& b, const glm::dvec3& c) {
  if (a == b || b == c || a == c) return true;
  const auto flat = [](const glm::dvec3& ab, const glm::dvec3& ac) {
    const glm::dvec3 bc = ac - ab, cross = glm::cross(ab, ac);
    const double longest = std::max(glm::dot(ab, ab), std::max(glm::dot(ac, ac), glm::dot(bc, bc)));
    return 0.5 * std::sqrt(glm::dot(cross, cross)) < kDegenerateArea * longest;
  };
  const double scale = std::max(largest(b - a), largest(c - a));
  // Where a fourth power would over- or underflow.
  constexpr double kSmall = 1e-60, kLarge = 1e60;
  if (scale < kSmall || scale > kLarge) return flat((b - a) / scale, (c - a) / scale);
  return flat(b - a, c - a);
}

// A key of this process: whoever writes a mesh cannot know which positions collide, and make welding take a
// time that grows with the square of their number. What is welded does not depend on it.
uint64_t hash_key() {
  static const uint64_t key = [] {
    uint64_t random = 0;
    if (getrandom(&random, sizeof random, GRND_NONBLOCK) != sizeof random) {
      random = uint64_t(std::chrono::steady_clock::now().time_since_epoch().count());
    }
    return random;
  }();
  return key;
}

[[gnu::noinline]] glm::vec3 rounded(const glm::dvec3& p) { return glm::vec3(p); }

void OriginChooser::add(const glm::dvec3& position) {
  low_ = any_ ? glm::min(low_, position) : position;
  high_ = any_ ? glm::max(high_, position) : position;
  moved_ = std::max(moved_, largest(position - glm::dvec3(rounded(position))));
  any_ = true;
}

glm::dvec3 OriginChooser::origin() const {
  const double size = largest(high_ - low_);
  if (moved_ <= kTolerance * size) return glm::dvec3(0);
  // A step of a 16th of the size or so: differences to such an origin are exact, and it is a short number.
  const double step = std::exp2(std::floor(std::log2(size)) - 4);
  return glm::round((low_ + (high_ - low_) * 0.5) / step) * step;
}

uint64_t round_positions(const std::vector<glm::dvec3>& exact, Mesh& mesh) {
  mesh.positions.clear();
  mesh.positions.reserve(exact.size());
  bool inexact = false;
  for (const glm::dvec3& p : exact) {
    mesh.positions.push_back(rounded(p - mesh.origin) + 0.0f);
    inexact = inexact || glm::dvec3(mesh.positions.back()) != p - mesh.origin;
  }
  if (!inexact) return 0;  // then what was welded and has an area still is and has
  const auto is_bent = [&](const glm::uvec3& triangle) {
    double moved = 0, longest = 0;
    for (int k = 0; k < 3; ++k) {
      const glm::dvec3 &p = exact[triangle[k]], &next = exact[triangle[(k + 1) % 3]];
      moved = std::max(moved, largest(p - mesh.origin - glm::dvec3(mesh.positions[triangle[k]])));
      longest = std::max(longest, largest(next - p));
    }
    return moved > kBent * longest;
  };
  bool any = false;
  uint64_t bent = 0;
  std::vector<bool> gone(mesh.triangles.size(), false);
  for (size_t t = 0; t < gone.size(); ++t) {
    const glm::uvec3& i = mesh.triangles[t];
    gone[t] = is_degenerate(mesh.positions[i.x], mesh.positions[i.y], mesh.positions[i.z]);
    if (!gone[t]) {
      bent += is_bent(i);
      continue;
    }
    ++(is_degenerate(exact[i.x], exact[i.y], exact[i.z]) ? mesh.rejected.degenerate
                                                         : mesh.rejected.collapsed);
    any = true;
  }
  if (any) remove_triangles(mesh, gone);
  weld(mesh);
  return bent;
}

}  // namespace lsp
