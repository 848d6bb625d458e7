#include "line_space_tables.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "line_space.h"
#include "octahedral.h"
#include "vec.h"

namespace lsp::corpus {
namespace {

using format::to_vec;
using format::Vec;

lsp_float3 to_float3(const Vec& v) {
  return {static_cast<float>(v.x), static_cast<float>(v.y), static_cast<float>(v.z)};
}

// Where a ray meets a triangle, in lengths of its direction; infinity: nowhere (Moeller and Trumbore 1997).
double intersect(const Vec& origin, const Vec& direction, const LspTriangle& t) {
  const Vec v0 = to_vec(t.v0), e1 = to_vec(t.v1) - v0, e2 = to_vec(t.v2) - v0;
  const Vec p = cross(direction, e2);
  const double det = dot(e1, p);
  if (det == 0) return INFINITY;
  const Vec s = origin - v0;
  const double u = dot(s, p) / det;
  const Vec q = cross(s, e1);
  const double v = dot(direction, q) / det;
  const double distance = dot(e2, q) / det;
  return u >= 0 && v >= 0 && u + v <= 1 && distance >= 0 && distance <= 1 ? distance : INFINITY;
}

Vec patch_centre(const LspLineSpace& space, uint32_t n, uint32_t face, uint32_t patch) {
  const Vec lo = to_vec(space.lo), hi = to_vec(space.hi);
  const int axis = static_cast<int>(face / 2);
  double point[3] = {};
  const int u = axis == 0 ? 1 : 0, v = axis == 2 ? 1 : 2;
  point[axis] = face % 2 == 0 ? lo[axis] : hi[axis];
  point[u] = lo[u] + (hi[u] - lo[u]) * (patch % n + 0.5) / n;
  point[v] = lo[v] + (hi[v] - lo[v]) * (patch / n + 0.5) / n;
  return {point[0], point[1], point[2]};
}

uint32_t nearest(const Image& image, const LspLineSpace& space, const Vec& from, const Vec& to) {
  uint32_t best = LSP_NONE;
  double distance = INFINITY;
  for (uint32_t i = 0; i < space.triangle_count; ++i) {
    const double d = intersect(from, to - from, image.triangles[space.triangle_first + i]);
    if (d < distance) {
      distance = d;
      best = i;
    }
  }
  return best;
}

}  // namespace

Box Box::nothing() { return {{INFINITY, INFINITY, INFINITY}, {-INFINITY, -INFINITY, -INFINITY}}; }

void Box::add(const lsp_float3& p) {
  lo = {std::min(lo.x, p.x), std::min(lo.y, p.y), std::min(lo.z, p.z)};
  hi = {std::max(hi.x, p.x), std::max(hi.y, p.y), std::max(hi.z, p.z)};
}

void LineSpaceTables::fill(Image& image, uint32_t index, uint32_t child, const Box& box,
                           uint32_t triangle_first, uint32_t triangle_count) {
  LspLineSpace& space = image.line_spaces[index];
  const uint32_t n = options_.resolution;
  const float margin = 0.015625f;
  space.lo = {box.lo.x - margin, box.lo.y - margin, box.lo.z - margin};
  space.hi = {box.hi.x + margin, box.hi.y + margin, box.hi.z + margin};
  space.scale = {static_cast<float>(n) / (space.hi.x - space.lo.x),
                 static_cast<float>(n) / (space.hi.y - space.lo.y),
                 static_cast<float>(n) / (space.hi.z - space.lo.z)};
  space.triangle_first = triangle_first;
  space.triangle_count = triangle_count;
  space.child = child;
  const bool symmetric = options_.entry_bytes == 0 && !options_.directed;
  space.format = n | options_.entry_bytes << LSP_FORMAT_ENTRY_SHIFT |
                 (options_.dense ? LSP_FORMAT_DENSE : 0) | (symmetric ? LSP_FORMAT_SYMMETRIC : 0);

  std::vector<uint32_t> shafts(format::shape_of(space.format).shafts, LSP_NONE);
  for (uint32_t in = 0; in < 6; ++in)
    for (uint32_t out = symmetric ? in + 1 : 0; out < 6; ++out) {
      if (in == out) continue;
      for (uint32_t p = 0; p < n * n; ++p)
        for (uint32_t q = 0; q < n * n; ++q) {
          const uint32_t shaft =
              symmetric ? LSP_SHAFT_INDEX_SYMMETRIC(in, out, p, q, n) : LSP_SHAFT_INDEX(in, out, p, q, n);
          shafts[shaft] =
              nearest(image, space, patch_centre(space, n, in, p), patch_centre(space, n, out, q));
        }
    }
  for (uint32_t entry : shafts) space.filled += entry != LSP_NONE;
  if (tables_.size() <= index) tables_.resize(index + 1);
  tables_[index] = std::move(shafts);
}

void LineSpaceTables::pack(Image& image) const {
  for (size_t i = 0; i < image.line_spaces.size(); ++i) {
    LspLineSpace& space = image.line_spaces[i];
    const format::LineSpaceShape shape = format::shape_of(space.format);
    const std::vector<uint32_t>& shafts = tables_[i];
    space.word_first = shape.words == 0 ? 0 : static_cast<uint32_t>(image.bit_words.size());
    const uint64_t candidate_words = shape.candidate_words(space.filled);
    space.candidate_first = candidate_words == 0 ? 0 : static_cast<uint32_t>(image.candidates.size());
    image.candidates.resize(image.candidates.size() + candidate_words);
    uint32_t filled = 0;
    for (uint64_t first = 0; first < shape.words * 32; first += 32) {
      LspBitWord word{0, filled};
      for (uint64_t bit = 0; bit < 32 && first + bit < shafts.size(); ++bit)
        if (shafts[first + bit] != LSP_NONE) word.bits |= 1u << bit;
      filled += static_cast<uint32_t>(std::popcount(word.bits));
      image.bit_words.push_back(word);
    }
    if (shape.entry_bytes == 0) continue;
    auto* entries = reinterpret_cast<unsigned char*>(image.candidates.data() + space.candidate_first);
    for (uint32_t entry : shafts) {
      if (entry == LSP_NONE && !shape.dense) continue;
      for (uint32_t byte = 0; byte < shape.entry_bytes; ++byte)
        *entries++ = static_cast<unsigned char>(entry >> 8 * byte);
    }
  }
}

void add_normals(Image& image) {
  for (LspTriangle& t : image.triangles) {
    const Vec n = cross(to_vec(t.v1) - to_vec(t.v0), to_vec(t.v2) - to_vec(t.v0));
    const uint32_t flat = format::encode_normal(to_float3(n));
    const bool smooth = t.primitive % 2 == 1;
    const uint32_t bent = format::encode_normal(to_float3({n.x + 0.1, n.y, n.z}));
    image.normals.push_back({flat, flat, smooth ? bent : flat});
    t.flags = smooth && bent != flat ? LSP_TRIANGLE_SMOOTH : 0;
  }
}

void add_materials(Image& image) {
  image.materials = {{{0.8f, 0.8f, 0.8f}, 1.0f, {0, 0, 0}, 1.0f, 0.0f, {}},
                     {{0.5f, 0.25f, 0.125f}, 0.5f, {2, 2, 1}, 0.25f, 1.0f, {}}};
}

}  // namespace lsp::corpus
