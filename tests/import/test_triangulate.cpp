// Polygons cut into triangles.
#include <gtest/gtest.h>

#include <algorithm>

#include "import/polygons.h"

namespace {

TEST(Triangulate, CombsInEveryPlaneKeepTheirArea) {
  for (int axis = 0; axis < 3; ++axis) {
    std::vector<glm::dvec3> comb;
    const auto add = [&](double u, double v) {
      glm::dvec3 p(0.25);
      p[(axis + 1) % 3] = u;
      p[(axis + 2) % 3] = v;
      comb.push_back(p);
    };
    const int teeth = 20;
    add(0, 0);
    add(teeth, 0);
    for (int i = teeth; i-- > 0;) {
      add(float(i) + 1.0f, 5);
      add(float(i) + 0.5f, 1);
    }
    std::vector<glm::uvec3> cut;
    uint64_t work = 1'000'000;
    lsp::triangulate(comb, cut, work);
    EXPECT_EQ(cut.size(), comb.size() - 2);
    double sum = 0;
    for (const glm::uvec3& t : cut) {
      sum += 0.5 * glm::cross(comb[t.y] - comb[t.x], comb[t.z] - comb[t.x])[axis];
    }
    double outline = 0;  // the shoelace formula
    for (size_t i = 0; i < comb.size(); ++i) {
      const glm::dvec3 a = comb[i], b = comb[(i + 1) % comb.size()];
      outline += 0.5 * double(glm::cross(a, b)[axis]);
    }
    EXPECT_NEAR(sum, outline, 1e-3);
    double absolute = 0;
    for (const glm::uvec3& t : cut) {
      absolute += 0.5 * double(glm::length(glm::cross(comb[t.y] - comb[t.x], comb[t.z] - comb[t.x])));
    }
    EXPECT_NEAR(absolute, std::abs(outline), 1e-3) << "no triangle lies outside or twice";
  }
}

using Outline = std::vector<glm::dvec2>;

double shoelace(const Outline& outline) {
  double sum = 0;
  for (size_t i = 0; i < outline.size(); ++i) {
    const glm::dvec2 a = outline[i], b = outline[(i + 1) % outline.size()];
    sum += 0.5 * (a.x * b.y - a.y * b.x);
  }
  return sum;
}

// Cuts the outline, either way round, and compares areas: the triangles' as they are turned, and their sizes.
void expect_filled(const Outline& outline, const char* what, double tolerance = 1e-9) {
  for (const bool backwards : {false, true}) {
    std::vector<glm::dvec3> corners;
    for (const glm::dvec2& p : outline) corners.push_back({0.25, p});
    if (backwards) std::reverse(corners.begin(), corners.end());
    std::vector<glm::uvec3> cut;
    uint64_t work = 1'000'000'000;
    EXPECT_EQ(lsp::triangulate(corners, cut, work), lsp::EarCut::kRight) << what;
    ASSERT_EQ(cut.size(), corners.size() - 2) << what;
    double sum = 0, sizes = 0;
    for (const glm::uvec3& t : cut) {
      const double area = 0.5 * glm::cross(corners[t.y] - corners[t.x], corners[t.z] - corners[t.x]).x;
      sum += area;
      sizes += std::abs(area);
    }
    const double want = std::abs(shoelace(outline));
    EXPECT_NEAR(std::abs(sum), want, tolerance * want) << what;
    EXPECT_NEAR(sizes, want, tolerance * want) << what << ": a triangle lies outside or twice";
  }
}

// Zigzags around circles, spirals, combs: n corners of which half are in the others' way.
Outline star(size_t n) {
  Outline outline;
  for (size_t i = 0; i < n; ++i) {
    const double angle = 2 * 3.14159265358979 * double(i) / double(n),
                 radius = i % 2 ? 1 : 0.3 + 0.6 * double(i % 7) / 7;
    outline.push_back({radius * std::cos(angle), radius * std::sin(angle)});
  }
  return outline;
}

Outline spiral(size_t n) {
  Outline outline;
  for (size_t i = 0; i < n; ++i) {
    const bool inner = i >= n / 2;
    const double turn = 40.0 * double(inner ? n - 1 - i : i) / double(n);
    const double radius = 1 + turn + (inner ? 0.4 * 6.28 : 0);
    outline.push_back({radius * std::cos(turn), radius * std::sin(turn)});
  }
  return outline;
}

// Every second corner close about the middle.
Outline thin_star(size_t n) {
  Outline outline;
  for (size_t i = 0; i < n; ++i) {
    const double angle = 2 * 3.14159265358979 * double(i) / double(n), radius = i % 2 ? 1 : 0.001;
    outline.push_back({radius * std::cos(angle), radius * std::sin(angle)});
  }
  return outline;
}

// Teeth whose valleys lie at the height `low` over their base; at 0 they touch it.
Outline comb(size_t n, double low, double high) {
  const size_t teeth = n / 2;
  Outline outline = {{0, 0}, {double(teeth), 0}};
  for (size_t i = teeth; i-- > 0;) {
    outline.push_back({double(i) + 1, high});
    outline.push_back({double(i) + 0.5, low});
  }
  return outline;
}

// Steps, not time: a hundred times the corners may take a little more of them each.
TEST(Triangulate, ManyCornersTakeFewStepsEach) {
  const auto steps_each = [](const Outline& outline) {
    std::vector<glm::dvec3> corners;
    for (const glm::dvec2& p : outline) corners.push_back({p, 0});
    std::vector<glm::uvec3> cut;
    const uint64_t most = 1'000'000'000;
    uint64_t work = most;
    EXPECT_EQ(lsp::triangulate(corners, cut, work), lsp::EarCut::kRight);
    return double(most - work) / double(outline.size());
  };
  for (const size_t n : {size_t{1'000}, size_t{100'000}}) {
    const std::pair<Outline, const char*> outlines[] = {{star(n), "star"},
                                                        {thin_star(n), "thin star"},
                                                        {spiral(n), "spiral"},
                                                        {comb(n, 1, 5), "comb"},
                                                        {comb(n, 1, 5 * double(n)), "comb of long teeth"},
                                                        {comb(n, 0, 5), "a comb that touches its base"}};
    for (const auto& [outline, name] : outlines) {
      expect_filled(outline, name);
      EXPECT_LT(steps_each(outline), n == 1'000 ? 60 : 130) << name << n;
    }
  }
}

TEST(Triangulate, OutlinesThatTouchThemselves) {
  const Outline touching_squares = {{0, 0}, {1, 0}, {1, 1}, {0, 1}, {0, 0}, {-1, 0}, {-1, -1}, {0, -1}};
  expect_filled(touching_squares, "two squares that share a corner");
  const Outline bridged = {{0, 0}, {4, 0}, {4, 4}, {0, 4}, {0, 0}, {1, 1}, {1, 3}, {3, 3}, {3, 1}, {1, 1}};
  expect_filled(bridged, "a square with a square hole, over a bridge");
  const Outline hole_at_corner = {{0, 0}, {4, 0}, {4, 4}, {0, 4}, {0, 0}, {1, 2}, {2, 1}};
  expect_filled(hole_at_corner, "a hole that touches a corner");
  const Outline hole_at_edge = {{0, 0}, {2, 0}, {1, 1}, {3, 1}, {2, 0}, {4, 0}, {4, 4}, {0, 4}};
  expect_filled(hole_at_edge, "a hole that hangs on an edge");
  const Outline corner_on_edge = {{0, 0}, {4, 0}, {4, 4}, {2, 0}, {0, 4}};
  expect_filled(corner_on_edge, "a corner that touches the opposite edge");
  const Outline runs = {{0, 0}, {1, 0}, {2, 0}, {3, 0}, {3, 1}, {3, 2},
                        {2, 2}, {2, 1}, {1, 1}, {1, 2}, {0, 2}, {0, 1}};
  expect_filled(runs, "runs of corners on a line");
  const Outline repeated = {{0, 0}, {0, 0}, {4, 0}, {4, 4}, {4, 4}, {2, 1}, {0, 4}, {0, 4}};
  expect_filled(repeated, "corners twice");
  const Outline hair = {{0, 0}, {2, 0}, {2, -3}, {2, 0}, {4, 0}, {4, 4}, {2, 1}, {0, 4}};
  expect_filled(hair, "a line there and back");
}

// Corners that lay on lines lie beside them by what rounds, on one side as seen from some and on the other as
// seen from others.
TEST(Triangulate, OutlinesOfCellsTurned) {
  const Outline cells[] = {
      {{0, 0}, {1, 0}, {1, 1}, {1, 2}, {1, 3}, {0, 3}, {-1, 3}, {-1, 2}, {0, 2}, {0, 1}},
      {{0, 0}, {1, 0}, {2, 0}, {3, 0}, {3, 1}, {2, 1}, {2, 2}, {2, 3}, {1, 3}, {1, 2}, {1, 1}, {0, 1}},
      {{0, 0}, {1, 0}, {1, 1}, {2, 1}, {2, 2}, {3, 2}, {3, 3}, {2, 3}, {1, 3}, {0, 3}, {0, 2}, {0, 1}},
      {{0, 0}, {1, 0}, {2, 0}, {2, 1}, {1, 1}, {1, 2}, {2, 2}, {2, 3}, {1, 3}, {0, 3}, {0, 2}, {0, 1}}};
  for (const Outline& outline : cells) {
    for (int i = 0; i < 1000; ++i) {
      const double c = std::cos(0.37 * i), s = std::sin(0.37 * i);
      Outline turned;
      for (const glm::dvec2& p : outline) turned.push_back({c * p.x - s * p.y, s * p.x + c * p.y});
      expect_filled(turned, "cells");
    }
  }
}

// Corners on edges, which turned lie beyond them by what rounds.
TEST(Triangulate, OutlinesThatTouchThemselvesTurned) {
  const Outline outlines[] = {
      {{0, 0}, {4, 0}, {4, 4}, {2, 0}, {0, 4}},
      {{0, 0}, {6, 0}, {6, 4}, {5.5, 0}, {5, 4}, {4, 4}, {3.5, 0}, {3, 4}, {2, 4}, {1.5, 0}, {1, 4}, {0, 4}},
      {{0, 0}, {3, 0}, {3, 1}, {1, 2}, {3, 2}, {3, 3}, {0, 3}, {0, 2}, {2, 1.5}, {0, 1}}};
  for (const Outline& outline : outlines) {
    for (int i = 0; i < 500; ++i) {
      const double c = std::cos(0.37 * i), s = std::sin(0.37 * i);
      Outline turned, single;
      for (const glm::dvec2& p : outline) turned.push_back({c * p.x - s * p.y, s * p.x + c * p.y});
      for (const glm::dvec2& p : turned) single.push_back(glm::dvec2(glm::vec2(p)));
      expect_filled(turned, "corners on edges");
      expect_filled(single, "corners on edges, in single precision", 1e-6);
    }
  }
}

// Rows of square holes in one outline, each over a bridge from the left.
TEST(Triangulate, ManyHoles) {
  Outline outline = {{0, 0}, {40, 0}, {40, 40}, {0, 40}};
  for (double y = 39; y > 0; y -= 2) {
    outline.push_back({0, y});
    for (double x = 1; x < 39; x += 2) {
      outline.push_back({x, y});
      outline.insert(outline.end(), {{x + 0.5, y + 0.5}, {x + 1, y}});
    }
    for (double x = 37; x > 0; x -= 2)
      outline.insert(outline.end(), {{x + 1, y}, {x + 0.5, y - 0.5}, {x, y}});
    outline.push_back({0, y});
  }
  expect_filled(outline, "holes");
}

TEST(Triangulate, CrossedOutlinesAreSaidToBe) {
  std::vector<glm::dvec3> corners;
  for (const glm::dvec2& p : Outline{{0, 0}, {4, 0}, {0, 3}, {4, 4}, {0, 1}}) corners.push_back({p, 0});
  std::vector<glm::uvec3> cut;
  uint64_t work = 1'000'000;
  EXPECT_EQ(lsp::triangulate(corners, cut, work), lsp::EarCut::kCrossed);
  EXPECT_EQ(cut.size(), corners.size() - 2);
}

TEST(Triangulate, AlwaysGivesCornersMinusTwoAndEnds) {
  uint32_t seed = 1;
  const auto random = [&] { return float((seed = seed * 1664525u + 1013904223u) >> 8) * 0x1p-24f; };
  for (size_t n = 3; n < 200; ++n) {
    std::vector<glm::dvec3> tangle(n);
    for (glm::dvec3& p : tangle)
      p = {std::floor(random() * 4), std::floor(random() * 4), n % 3 ? 0.0f : random()};
    std::vector<glm::uvec3> cut;
    uint64_t work = n % 5 ? 1'000'000 : 500;
    lsp::triangulate(tangle, cut, work);
    ASSERT_EQ(cut.size(), n - 2);
    for (const glm::uvec3& t : cut) ASSERT_TRUE(t.x < n && t.y < n && t.z < n);
  }
}

}  // namespace
