#include "soup.h"

#include <algorithm>
#include <bit>
#include <numeric>
#include <tuple>

#include "mesh.h"

namespace lsp::bench {
namespace {

glm::vec3 to_glm(const lsp_float3& v) { return {v.x, v.y, v.z}; }

// Octahedral, two 16-bit snorm (Cigolle et al. 2014), as the specification states it.
glm::vec3 decode_normal(uint32_t packed) {
  const auto snorm = [](uint32_t bits) {
    return std::max(-1.0f, static_cast<float>(static_cast<int16_t>(bits & 0xFFFFu)) / 32767.0f);
  };
  glm::vec3 n(snorm(packed), snorm(packed >> 16), 0);
  n.z = 1.0f - std::abs(n.x) - std::abs(n.y);
  if (n.z < 0) {
    const float x = n.x;
    n.x = (1.0f - std::abs(n.y)) * (x >= 0 ? 1.0f : -1.0f);
    n.y = (1.0f - std::abs(x)) * (n.y >= 0 ? 1.0f : -1.0f);
  }
  return glm::normalize(n);
}

void finish(Soup& soup, uint64_t primitive_count) {
  soup.triangle_of.assign(primitive_count, LSP_NONE);
  soup.lo = glm::dvec3(INFINITY);
  soup.hi = glm::dvec3(-INFINITY);
  for (uint32_t i = 0; i < soup.size(); ++i) {
    soup.triangle_of.at(soup.primitives[i]) = i;
    for (const glm::vec3& corner : soup.corners[i]) {
      soup.lo = glm::min(soup.lo, glm::dvec3(corner));
      soup.hi = glm::max(soup.hi, glm::dvec3(corner));
    }
  }
  if (soup.size() == 0) soup.lo = soup.hi = glm::dvec3(0);
  soup.diagonal = glm::length(soup.hi - soup.lo);
}

}  // namespace

Soup soup_of(const lsp_scene& scene) {
  Soup soup;
  const uint64_t count = scene.header->triangle_count;
  std::vector<uint32_t> order(count);
  std::iota(order.begin(), order.end(), 0u);
  const LspTriangle* triangles = scene.triangles;
  std::stable_sort(order.begin(), order.end(),
                   [&](uint32_t a, uint32_t b) { return triangles[a].primitive < triangles[b].primitive; });
  for (uint32_t i : order) {
    const LspTriangle& t = triangles[i];
    if (!soup.primitives.empty() && soup.primitives.back() == t.primitive) continue;
    soup.primitives.push_back(t.primitive);
    soup.corners.push_back({to_glm(t.v0), to_glm(t.v1), to_glm(t.v2)});
    if ((scene.header->required_features & LSP_FEATURE_COVERAGE) != 0) soup.gaps.push_back(t.flags >> 16);
    if (scene.normals) {
      const LspCornerNormals& n = scene.normals[i];
      soup.normals.push_back({decode_normal(n.n0), decode_normal(n.n1), decode_normal(n.n2)});
    }
  }
  finish(soup, scene.header->primitive_count);
  return soup;
}

Soup soup_of(const Mesh& mesh) {
  Soup soup;
  soup.primitives = mesh.primitives;
  soup.normals = mesh.normals;
  soup.corners.reserve(mesh.triangles.size());
  for (const glm::uvec3& t : mesh.triangles) {
    soup.corners.push_back({mesh.positions[t.x], mesh.positions[t.y], mesh.positions[t.z]});
  }
  finish(soup, mesh.primitive_count);
  return soup;
}

bool passes(const Soup& soup, uint32_t triangle, const LspRay& ray) {
  if (soup.gaps.empty() || soup.gaps[triangle] == 0) return false;
  const auto bits = [](float x) { return std::bit_cast<uint32_t>(x); };
  uint32_t h = 0;
  for (const uint32_t w : {bits(ray.origin.x), bits(ray.origin.y), bits(ray.origin.z), bits(ray.direction.x),
                           bits(ray.direction.y), bits(ray.direction.z), soup.primitives[triangle]})
    h = std::rotl(h ^ (std::rotl(w * 0xCC9E2D51u, 15) * 0x1B873593u), 13) * 5 + 0xE6546B64u;
  h = (h ^ h >> 16) * 0x85EBCA6Bu;
  h = (h ^ h >> 13) * 0xC2B2AE35u;
  h ^= h >> 16;
  return h >> 16 < soup.gaps[triangle];
}

glm::dvec3 geometric_normal(const std::array<glm::vec3, 3>& corners) {
  const glm::dvec3 origin(corners[0]);
  return glm::cross(glm::dvec3(corners[1]) - origin, glm::dvec3(corners[2]) - origin);
}

glm::dvec3 shading_normal(const Soup& soup, uint32_t triangle, double u, double v) {
  if (soup.normals.empty()) return glm::normalize(geometric_normal(soup.corners[triangle]));
  const auto& n = soup.normals[triangle];
  const glm::dvec3 sum = (1 - u - v) * glm::dvec3(n[0]) + u * glm::dvec3(n[1]) + v * glm::dvec3(n[2]);
  const double length = glm::length(sum);
  return length > 0 ? sum / length : glm::normalize(geometric_normal(soup.corners[triangle]));
}

std::vector<uint32_t> weld(const Soup& soup) {
  const size_t corner_count = soup.size() * 3;
  const auto at = [&](uint32_t corner) { return soup.corners[corner / 3][corner % 3] + 0.0f; };
  const auto less = [&](uint32_t a, uint32_t b) {
    const glm::vec3 p = at(a), q = at(b);
    return std::tie(p.x, p.y, p.z) < std::tie(q.x, q.y, q.z);
  };
  std::vector<uint32_t> order(corner_count), vertex(corner_count);
  std::iota(order.begin(), order.end(), 0u);
  std::sort(order.begin(), order.end(), less);
  uint32_t id = 0;
  for (size_t i = 0; i < corner_count; ++i) {
    if (i > 0 && less(order[i - 1], order[i])) ++id;
    vertex[order[i]] = id;
  }
  return vertex;
}

size_t open_edges(const Soup& soup) {
  const std::vector<uint32_t> vertex = weld(soup);
  std::vector<std::pair<uint32_t, uint32_t>> edges;
  edges.reserve(vertex.size());
  for (size_t t = 0; t < soup.size(); ++t) {
    for (size_t k = 0; k < 3; ++k) {
      edges.push_back(std::minmax({vertex[3 * t + k], vertex[3 * t + (k + 1) % 3]}));
    }
  }
  std::sort(edges.begin(), edges.end());
  size_t open = 0;
  for (size_t i = 0; i < edges.size();) {
    size_t end = i;
    while (end < edges.size() && edges[end] == edges[i]) ++end;
    if (end - i != 2) ++open;
    i = end;
  }
  return open;
}

}  // namespace lsp::bench
