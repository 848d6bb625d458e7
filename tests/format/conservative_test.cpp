// The rule about clear bits of conservative Line Spaces (917), against a slow test of another kind: two
// convex sets are apart if and only if an axis separates them, and those that may are few (Gottschalk,
// "Separating axis theorem", 1996). Every shaft of every Line Space of a file is compared with every triangle
// of its node.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdio>
#include <set>
#include <vector>

#include "check.h"
#include "image.h"
#include "line_space.h"
#include "mutator.h"
#include "ntree_scenes.h"
#include "scenes.h"

namespace {

using namespace lsp;
using namespace lsp::corpus;
using namespace lsp::format;

using Vec = std::array<double, 3>;
Vec to_vec(const lsp_float3& v) { return {v.x, v.y, v.z}; }
Vec operator-(const Vec& a, const Vec& b) { return {a[0] - b[0], a[1] - b[1], a[2] - b[2]}; }
double dot(const Vec& a, const Vec& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
Vec cross(const Vec& a, const Vec& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

// Points that span a hull, with every axis that may separate it from a triangle but for those of the
// triangle.
struct Hull {
  std::vector<Vec> points;
  std::vector<Vec> normals, edges;

  explicit Hull(std::vector<Vec> spanning) : points(std::move(spanning)) {
    for (size_t i = 0; i < points.size(); ++i)
      for (size_t j = i + 1; j < points.size(); ++j) {
        edges.push_back(points[j] - points[i]);
        for (size_t k = j + 1; k < points.size(); ++k)
          normals.push_back(cross(points[j] - points[i], points[k] - points[i]));
      }
  }

  bool separates(const Vec& axis, const std::array<Vec, 3>& t) const {
    const double a = dot(axis, t[0]), b = dot(axis, t[1]), c = dot(axis, t[2]);
    const double least = std::min({a, b, c}), most = std::max({a, b, c});
    bool above = true, below = true;
    for (const Vec& p : points) {
      const double at = dot(axis, p);
      above = above && at > most;
      below = below && at < least;
    }
    return above || below;
  }

  bool meets(const LspTriangle& triangle) const {
    const std::array<Vec, 3> t = {to_vec(triangle.v0), to_vec(triangle.v1), to_vec(triangle.v2)};
    for (const Vec& normal : normals)
      if (separates(normal, t)) return false;
    const std::array<Vec, 3> sides = {t[1] - t[0], t[2] - t[1], t[0] - t[2]};
    if (separates(cross(sides[0], sides[1]), t)) return false;
    for (const Vec& side : sides)
      for (const Vec& edge : edges)
        if (separates(cross(side, edge), t)) return false;
    return true;
  }
};

// The corners of a patch, each moved by `grow` along every axis either way: 32 points, half of them twice.
void add_patch(const LspLineSpace& space, uint32_t face, uint32_t patch, double grow,
               std::vector<Vec>& points) {
  const uint32_t n = space.format & LSP_FORMAT_RESOLUTION_MASK;
  const Vec lo = to_vec(space.lo), hi = to_vec(space.hi);
  const size_t axis = face / 2, u = axis == 0 ? 1 : 0, v = axis == 2 ? 1 : 2;
  for (uint32_t corner = 0; corner < 8; ++corner) {
    const auto sign = [&](size_t k) { return corner >> k & 1 ? 1.0 : -1.0; };
    Vec p;
    p[axis] = (face % 2 ? hi : lo)[axis] + grow * sign(axis);
    p[u] = lo[u] + (hi[u] - lo[u]) * (patch % n + (sign(u) > 0)) / n + grow * sign(u);
    p[v] = lo[v] + (hi[v] - lo[v]) * (patch / n + (sign(v) > 0)) / n + grow * sign(v);
    points.push_back(p);
  }
}

// The records below a child reference.
void collect(const Image& image, uint32_t child, std::set<uint32_t>& triangles) {
  if (child == LSP_NONE) return;
  if (child & LSP_LEAF_BIT) {
    const uint32_t first = child & LSP_LEAF_FIRST_MASK;
    for (uint32_t i = 0; i <= (child >> LSP_LEAF_COUNT_SHIFT & LSP_LEAF_COUNT_MASK); ++i)
      triangles.insert(first + i);
    return;
  }
  collect(image, image.nodes[child].child0, triangles);
  collect(image, image.nodes[child].child1, triangles);
}
void collect_cells(const Image& image, uint32_t node, std::set<uint32_t>& triangles);
void collect_cell(const Image& image, const LspCell& cell, std::set<uint32_t>& triangles) {
  if (!(cell.child & LSP_LEAF_BIT)) {
    collect_cells(image, cell.child, triangles);
  } else if (cell.child != LSP_NONE) {
    for (uint32_t i = 0; i < cell.count; ++i)
      triangles.insert(image.references[(cell.child & ~LSP_LEAF_BIT) + i]);
  }
}
void collect_cells(const Image& image, uint32_t node, std::set<uint32_t>& triangles) {
  const uint32_t words = LSP_GRID_WORDS(image.header.ntree_branching);
  for (uint32_t w = node * words; w < (node + 1) * words; ++w)
    for (uint32_t i = 0; i < static_cast<uint32_t>(__builtin_popcount(image.grid[w].bits)); ++i)
      collect_cell(image, image.cells[image.grid[w].offset + i], triangles);
}

std::set<uint32_t> triangles_of(const Image& image, uint32_t space) {
  std::set<uint32_t> triangles;
  const auto is_it = [&](uint32_t reference) {
    return reference != LSP_NONE && (reference & LSP_LINE_SPACE_MASK) == space;
  };
  if (image.grid.empty()) {
    collect(image, image.line_spaces[space].child, triangles);
  } else if (is_it(image.header.root_line_space)) {
    collect_cells(image, 0, triangles);
  } else {
    for (const LspCell& cell : image.cells)
      if (is_it(cell.line_space)) collect_cell(image, cell, triangles);
  }
  return triangles;
}

double margin_of(const Image& image) {
  const Vec lo = to_vec(image.header.bounds_min), hi = to_vec(image.header.bounds_max);
  double extent = 0, reach = 0;
  for (int k = 0; k < 3; ++k) {
    extent = std::max(extent, hi[k] - lo[k]);
    reach = std::max({reach, std::abs(lo[k]), std::abs(hi[k])});
  }
  return 2 * (std::ldexp(extent, -18) + std::ldexp(reach, -21));
}

void clear_all(Image& image) {
  for (LspBitWord& word : image.bit_words) word = {0, 0};
  for (LspLineSpace& space : image.line_spaces) space.filled = 0;
}

using Shaft = std::pair<uint64_t, uint64_t>;  // Line Space, shaft

// The shafts that the check finds not to be empty.
std::set<Shaft> found(const Image& image) {
  const Bytes bytes = encode(image);
  const Report report = check_file(bytes, {.level = Level::kGeometry, .examples_per_rule = 1u << 30});
  std::set<Shaft> shafts;
  if (!report.has(RuleId::kShaftNotEmpty)) return shafts;
  for (const Example& example : report.findings().at(RuleId::kShaftNotEmpty).examples) {
    unsigned long long shaft = 0, space = 0;
    EXPECT_EQ(std::sscanf(example.message.c_str(), "shaft %llu of Line Space %llu", &shaft, &space), 2)
        << example.message;
    EXPECT_TRUE(shafts.insert({space, shaft}).second) << example.message;
  }
  return shafts;
}

// The shafts that a triangle meets, grown by `margins` times the margin.
std::set<Shaft> touched(const Image& image, double margins) {
  const double grow = margins * margin_of(image);
  std::set<Shaft> shafts;
  for (uint32_t i = 0; i < image.line_spaces.size(); ++i) {
    const LspLineSpace& space = image.line_spaces[i];
    const std::set<uint32_t> triangles = triangles_of(image, i);
    const LineSpaceShape shape = shape_of(space.format);
    const uint32_t n = shape.resolution;
    for (uint32_t in = 0; in < 6; ++in)
      for (uint32_t out = in + 1; out < 6; ++out)
        for (uint32_t p = 0; p < n * n; ++p)
          for (uint32_t q = 0; q < n * n; ++q) {
            std::vector<Vec> points;
            add_patch(space, in, p, grow, points);
            add_patch(space, out, q, grow, points);
            const Hull hull(std::move(points));
            bool any = false;
            for (uint32_t t : triangles) any = any || hull.meets(image.triangles[t]);
            if (!any) continue;
            if (shape.symmetric) {
              shafts.insert({i, LSP_SHAFT_INDEX_SYMMETRIC(in, out, p, q, n)});
            } else {
              shafts.insert({i, LSP_SHAFT_INDEX(in, out, p, q, n)});
              shafts.insert({i, LSP_SHAFT_INDEX(out, in, q, p, n)});
            }
          }
  }
  return shafts;
}

// With every bit clear, all the shafts are found that triangles meet, and no other. Returns how many.
size_t expect_exact(Image image, const std::string& what) {
  clear_all(image);
  const std::set<Shaft> shafts = found(image);
  for (const Shaft& shaft : touched(image, 0.499))
    EXPECT_TRUE(shafts.contains(shaft)) << what << ": shaft " << shaft.second << " of " << shaft.first;
  const std::set<Shaft> most = touched(image, 0.501);
  for (const Shaft& shaft : shafts)
    EXPECT_TRUE(most.contains(shaft)) << what << ": shaft " << shaft.second << " of " << shaft.first;
  return shafts.size();
}

TEST(Conservative, FindsTheShaftsOfNodes) {
  expect_exact(box_on_floor({.resolution = 2, .depths = {0, 1, 2}, .entry_bytes = 0, .conservative = true}),
               "BVH");
  expect_exact(box_on_floor({.resolution = 2, .entry_bytes = 0, .directed = true, .conservative = true}),
               "directed");
}

TEST(Conservative, FindsTheShaftsOfCells) {
  expect_exact(ntree_scene({.resolution = 2, .depths = {0, 1, 2}, .entry_bytes = 0, .conservative = true}),
               "NTree");
}

// One leaf with a Line Space, in a box of which its triangles reach out on all sides.
Image random_scene(uint64_t seed, uint32_t resolution, uint32_t count) {
  Random random(seed);
  Image image = box_on_floor({.leaf_triangles = 16,
                              .resolution = resolution,
                              .depths = {0},
                              .entry_bytes = 0,
                              .conservative = true});
  // Boxes long and flat, and far from the origin.
  Vec at, size;
  for (int k = 0; k < 3; ++k) {
    size[static_cast<size_t>(k)] = std::exp2(8.0 * random.unit() - 4);
    at[static_cast<size_t>(k)] = random.below(2) ? 0 : 100 * (random.unit() - 0.5);
  }
  const auto place = [&](const Vec& p) {
    return lsp_float3{static_cast<float>(at[0] + size[0] * p[0]), static_cast<float>(at[1] + size[1] * p[1]),
                      static_cast<float>(at[2] + size[2] * p[2])};
  };
  const auto point = [&](double width) {
    Vec p;
    for (double& x : p) x = width * (random.unit() - 0.5);
    return p;
  };
  image.triangles.resize(count);
  LspHeader& h = image.header;
  h.bounds_min = {1e9f, 1e9f, 1e9f};
  h.bounds_max = {-1e9f, -1e9f, -1e9f};
  const double reach[] = {0.02, 0.3, 3};
  for (LspTriangle& t : image.triangles) {
    Vec middle = point(1.2);
    for (double& x : middle) x += 0.5;
    const double width = reach[random.below(3)];
    for (lsp_float3* v : {&t.v0, &t.v1, &t.v2}) {
      const Vec off = point(width);
      *v = place({middle[0] + off[0], middle[1] + off[1], middle[2] + off[2]});
    }
    if (random.below(4) == 0) t.v2 = t.v1;  // a line
    for (const lsp_float3* v : {&t.v0, &t.v1, &t.v2}) {
      h.bounds_min = {std::min(h.bounds_min.x, v->x), std::min(h.bounds_min.y, v->y),
                      std::min(h.bounds_min.z, v->z)};
      h.bounds_max = {std::max(h.bounds_max.x, v->x), std::max(h.bounds_max.y, v->y),
                      std::max(h.bounds_max.z, v->z)};
    }
  }
  h.root = LSP_LEAF_BIT | (count - 1) << LSP_LEAF_COUNT_SHIFT;
  LspLineSpace& space = image.line_spaces[0];
  space.child = h.root;
  space.triangle_count = count;
  space.lo = place({0, 0, 0});
  space.hi = place({1, 1, 1});
  return image;
}

TEST(Conservative, FindsTheShaftsOfRandomTriangles) {
  size_t shafts = 0;
  for (uint64_t seed = 0; seed < 16; ++seed)
    shafts += expect_exact(random_scene(seed, 3, 3), std::to_string(seed));
  EXPECT_GT(shafts, 3000u);
}

// A single bit that is wrong is found, whichever it is and of either direction; the file is valid before.
TEST(Conservative, FindsASingleBit) {
  const Image good =
      box_on_floor({.resolution = 4, .entry_bytes = 0, .directed = true, .conservative = true});
  EXPECT_TRUE(found(good).empty());
  Image image = good;
  clear_all(image);
  const std::set<Shaft> shafts = found(image);
  uint64_t tried = 0;
  for (const auto& [space, shaft] : shafts) {
    if (shaft % 37 != 0) continue;
    image = good;
    image.bit_words[image.line_spaces[space].word_first + shaft / 32].bits &= ~(1u << shaft % 32);
    EXPECT_EQ(found(image), (std::set<Shaft>{{space, shaft}}));
    ++tried;
  }
  EXPECT_GT(tried, 50u);
}

// What can't be traced exactly has no use for the bits, and may lack the triangles to check them.
TEST(Conservative, AsksExactFilesOnly) {
  Image image =
      box_on_floor({.resolution = 2, .depths = {2}, .entry_bytes = 0, .conservative = true, .exact = false});
  clear_all(image);
  EXPECT_TRUE(found(image).empty());
}

// A million shafts with every bit clear, and triangles that come near most and meet few.
TEST(Conservative, EndsOnALargeTableOfWrongBits) {
  Image image = random_scene(7, 16, 16);
  clear_all(image);
  for (size_t i = 0; i < image.triangles.size(); ++i) {
    LspTriangle& t = image.triangles[i];
    const lsp_float3 &lo = image.line_spaces[0].lo, &hi = image.line_spaces[0].hi;
    const float s = static_cast<float>(i) / 16;
    t.v0 = {lo.x + s * (hi.x - lo.x), lo.y, lo.z};
    t.v1 = {lo.x, hi.y, lo.z + s * (hi.z - lo.z)};
    t.v2 = {hi.x, hi.y, hi.z};
  }
  const Report report = check_file(encode(image), {.level = Level::kGeometry});
  EXPECT_TRUE(report.has(RuleId::kShaftNotEmpty));
}

}  // namespace
