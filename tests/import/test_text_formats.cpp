// OBJ, PLY, STL and OFF: each feature and each way to go wrong, on small files.
#include "mesh_files.h"

#include <algorithm>
#include <bit>

#include "import/polygons.h"
#include "import/texture.h"
#include "png_bytes.h"

namespace {

using lsp::Exit;
using lsp::Mesh;
using namespace lsp_test;

class Obj : public MeshFiles {};
class Ply : public MeshFiles {};
class Stl : public MeshFiles {};
class Off : public MeshFiles {};
class AnyFormat : public MeshFiles {};

const std::string kSquare = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";

TEST_F(Obj, QuadsBecomeTwoTrianglesInOrder) {
  const Mesh mesh = import("a.obj", kSquare + "f 1 2 3 4\nf 1 2 3\n");
  ASSERT_EQ(mesh.primitive_count, 3u);
  EXPECT_EQ(mesh.primitives, (std::vector<uint32_t>{0, 1, 2}));
  EXPECT_EQ(corner(mesh, 1, 0), glm::vec3(0, 0, 0));
  EXPECT_EQ(corner(mesh, 1, 1), glm::vec3(1, 1, 0));
  EXPECT_EQ(corner(mesh, 1, 2), glm::vec3(0, 1, 0));
  EXPECT_EQ(mesh.positions.size(), 4u);
}

TEST_F(Obj, NegativeIndicesCountFromTheEndAtThatLine) {
  const Mesh mesh = import("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf -3 -2 -1\nv 5 5 5\n");
  ASSERT_EQ(mesh.triangles.size(), 1u);
  EXPECT_EQ(corner(mesh, 0, 2), glm::vec3(0, 1, 0));
}

TEST_F(Obj, LineEndsTabsContinuationsAndEncodings) {
  const std::string text = kSquare + "f\t1 2 \\\n 3 4\n";
  std::string bare_cr = text, crlf, utf16 = "\xFF\xFE";
  std::replace(bare_cr.begin(), bare_cr.end(), '\n', '\r');
  for (const char c : text) crlf += c == '\n' ? "\r\n" : std::string(1, c);
  for (const char c : text) utf16 += {c, '\0'};
  std::string utf16be_unmarked;
  for (const char c : text) utf16be_unmarked += {'\0', c};
  for (const std::string& form : {text, bare_cr, crlf, utf16, utf16be_unmarked, "\xEF\xBB\xBF" + text}) {
    const Mesh mesh = import("a.obj", form);
    EXPECT_EQ(mesh.triangles.size(), 2u);
    EXPECT_FLOAT_EQ(float(area(mesh)), 1.0f);
  }
}

TEST_F(Obj, RejectsByNamedReasonAndNothingElse) {
  const Mesh mesh =
      import("a.obj", kSquare +
                          "v nan 0 0\nv 1e400 0 0\nv 2 0 0\nv 3.1+e2 0 0\n"
                          "f 1 2 3\n"           // good
                          "f 1 1 2\nf 1 2 7\n"  // two equal corners; a line
                          "f 1 2 5\nf 1 2 6\nf 1 2 8\n"
                          "f 0 1 2\nf 1 2 99\nf 1 2 -99\nf 1 2 x\nf 1 2 99999999999999999999\n");
  EXPECT_EQ(mesh.primitive_count, 11u);
  EXPECT_EQ(mesh.triangles.size(), 1u);
  EXPECT_EQ(mesh.rejected.degenerate, 2u);
  EXPECT_EQ(mesh.rejected.non_finite, 3u);
  EXPECT_EQ(mesh.rejected.out_of_range, 5u);
}

TEST_F(Obj, RejectedTrianglesKeepTheirNumbers) {
  const Mesh mesh = import("a.obj", kSquare + "f 1 1 1\nf 1 2 3\nf 9 9 9\nf 1 3 4\n");
  EXPECT_EQ(mesh.primitives, (std::vector<uint32_t>{1, 3}));
}

TEST_F(Obj, FacesWithTooFewCornersAndLinesHoldNoTriangle) {
  const Mesh mesh = import("a.obj", kSquare + "f 1 2\nf 1\nf\nl 1 2 3\np 1\nf 1 2 3\n");
  EXPECT_EQ(mesh.primitive_count, 1u);
  EXPECT_TRUE(has_note(mesh, "3 faces with fewer than three corners"));
  EXPECT_TRUE(has_note(mesh, "2 lines, points"));
}

TEST_F(Obj, EdgesOfManyFacesAndDuplicatesSurvive) {
  std::string text = "v 0 0 0\nv 1 0 0\n";
  for (int i = 0; i < 7; ++i) text += "v 0.5 " + std::to_string(i + 1) + " " + std::to_string(i * i) + "\n";
  for (int i = 0; i < 7; ++i) text += "f 1 2 " + std::to_string(i + 3) + "\n";
  text += "f 1 2 3\nf 2 1 3\n";
  EXPECT_EQ(import("a.obj", text).triangles.size(), 9u);
}

TEST_F(Obj, CornersHaveTheirOwnNormals) {
  const Mesh mesh = import("a.obj", kSquare +
                                        "vn 0 0 2\nvn 1 0 0\nvn 0 0 0\nvn nan 0 1\n"
                                        "f 1//1 2//2 3//1\nf 1//2 3/7/1 4//-4\nf 1//3 2//4 3//9\n");
  ASSERT_EQ(mesh.triangles.size(), 3u);
  EXPECT_EQ(mesh.normals[0][0], glm::vec3(0, 0, 1));
  EXPECT_EQ(mesh.normals[0][1], glm::vec3(1, 0, 0));
  EXPECT_EQ(mesh.normals[1][0], glm::vec3(1, 0, 0)) << "the same vertex with another normal";
  EXPECT_EQ(mesh.normals[1][2], glm::vec3(0, 0, 1));
  for (const glm::vec3& normal : mesh.normals[2])
    EXPECT_EQ(normal, glm::vec3(0, 0, 1)) << "geometric in their place";
  EXPECT_TRUE(has_note(mesh, "2 corner normals"));
}

TEST_F(Obj, MaterialsWithSpacesEmissionAndWindowsPaths) {
  write("my stuff.mtl",
        "newmtl  a red \nKd 1 0 0\n newmtl lamp\nKe 3 4 5\nd 0.5\nPr 0.25\nnewmtl lamp\nKd 0 0 0\n");
  const Mesh mesh = import("a.obj", "mtllib C:\\models\\my stuff.mtl\n" + kSquare +
                                        "f 1 2 3\nusemtl a red\nf 1 3 4\nusemtl lamp\n"
                                        "f 1 2 4\nusemtl nowhere\nf 2 3 4\n");
  ASSERT_EQ(mesh.materials.size(), 4u);
  const auto material = [&](size_t t) { return mesh.materials[mesh.material_ids[t]]; };
  EXPECT_EQ(material(0).name, "");
  EXPECT_EQ(material(1).name, "a red");
  EXPECT_EQ(material(1).base_color, glm::vec3(1, 0, 0));
  EXPECT_EQ(material(2).emission, glm::vec3(3, 4, 5));
  EXPECT_EQ(material(2).base_color, glm::vec3(0.8f)) << "the first definition counts";
  EXPECT_FLOAT_EQ(material(2).opacity, 0.5f);
  EXPECT_FLOAT_EQ(material(2).roughness, 0.25f);
  EXPECT_EQ(material(3).name, "nowhere");
  EXPECT_TRUE(has_note(mesh, "named but not defined"));
}

TEST_F(Obj, TexturesWithTheirOptions) {
  // Upper row red, green; lower row blue, white; half of the mask's alpha is there.
  write("a picture.png",
        rgba_png(2, 2, {255, 0, 0, 255, 0, 255, 0, 255, 0, 0, 255, 255, 255, 255, 255, 255}));
  write("mask.png", rgba_png(2, 1, {0, 0, 0, 255, 0, 0, 0, 0}));
  write("grey.png", png_bytes<uint8_t>(1, 1, PNG_FORMAT_GRAY, {51}));
  const auto color_with = [&](const std::string& material, const std::string& uv) {
    write("a.mtl", "newmtl m\n" + material);
    return import("a.obj", "mtllib a.mtl\nusemtl m\n" + kSquare + uv + "f 1/1 2/2 3/3\nf 1/1 3/3 4/4\n");
  };
  // In the middle of the lower left texel of four.
  const std::string lower_left = "vt 0.2 0.2\nvt 0.3 0.2\nvt 0.3 0.3\nvt 0.2 0.3\n",
                    all = "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n";
  const std::string in_other = "map_Kd -o 0.5 0.5 0 -s 1 1 1 a picture.png\n";
  EXPECT_NEAR(color_with("map_Kd a picture.png\n", lower_left).color(0).base_color.b, 1.0f, 0.1f);
  EXPECT_LT(color_with("map_Kd a picture.png\n", lower_left).color(0).base_color.r, 0.1f);
  EXPECT_NEAR(color_with(in_other, lower_left).color(0).base_color.g, 1.0f, 0.1f);
  const Mesh scaled = color_with("Kd 0.5 1 1\nmap_Kd -s 0.5 0.5 C:\\art\\a picture.png\n", all);
  EXPECT_GT(scaled.color(0).base_color.b, 0.7f) << "the lower left quarter, and what blends into it";
  EXPECT_EQ(scaled.sources[0].size(), 3u);
  const Mesh masked = color_with("d 0.5\nmap_Kd a picture.png\nmap_d mask.png\n", all);
  EXPECT_NEAR(masked.color(0).coverage + masked.color(1).coverage, 0.5f, 1e-4f);
  EXPECT_NEAR(masked.color(0).base_color.g, 0.0f, 1e-4f) << "what is masked has no colour";
  EXPECT_NEAR(color_with("map_d grey.png\n", all).color(0).coverage, 0.2f, 1e-4f) << "grey is what is solid";
  EXPECT_NEAR(color_with("map_d -imfchan r a picture.png\n", all).color(0).coverage, 0.5f, 0.3f);
  EXPECT_NEAR(color_with("map_Ke a picture.png\nKe 4 4 4\n", lower_left).color(0).emission.b, 4.0f, 0.4f);
  const Mesh noted = color_with("map_Bump -bm 2 x.png\nmap_Kd -mm 0 2 gone.png\n", all);
  for (const char* part : {"map_Bump", "-mm", "gone.png"}) EXPECT_TRUE(has_note(noted, part)) << part;
}

TEST_F(Obj, OpacityInEitherForm) {
  const auto opacity = [&](const std::string& lines) {
    write("a.mtl", "newmtl m\n" + lines);
    const Mesh mesh = import("a.obj", "mtllib a.mtl\n" + kSquare + "f 1 2 3\nusemtl m\nf 1 2 3\n");
    return mesh.triangles.size() == 2 ? mesh.color(1).coverage : 0;
  };
  EXPECT_FLOAT_EQ(opacity("d 0.25\n"), 0.25f);
  EXPECT_FLOAT_EQ(opacity("Tr 0.25\n"), 0.75f);
  EXPECT_FLOAT_EQ(opacity("Tr 1\nd 1\n"), 1.0f) << "d wins";
  EXPECT_FLOAT_EQ(opacity("d 1\nTr 1\n"), 1.0f) << "in either order";
  EXPECT_EQ(opacity("d 0\n"), 0.0f) << "left out";
}

TEST_F(Obj, ZBrushColours) {
  const std::string corners = "v 0 0 0\nv 1 0 0\nv 0 1 0\n", faces = "f 1 2 3\n";
  const std::string about = "#MRGB block: The following ZBrush Vertex Color (Polypaint)\n";
  const Mesh mesh =
      import("a.obj", "# File exported by ZBrush\n" + corners + "#MRGB ffff0000ffFF0000\n#MRGB 0000bC01\n" +
                          "# End of MRGB block\n" + faces);
  EXPECT_NEAR(mesh.color(0).base_color.r, 2 / 3.0f, 1e-5f);
  EXPECT_NEAR(mesh.color(0).base_color.g, lsp::linear_of_srgb(0xBC / 255.0) / 3, 1e-5);
  EXPECT_NEAR(mesh.color(0).base_color.b, lsp::linear_of_srgb(1 / 255.0) / 3, 1e-5);
  EXPECT_TRUE(mesh.notes.empty());
  const Mesh dark = import("a.obj", corners + "#MRGB ff010101ff010101ff010101\n" + faces);
  EXPECT_NEAR(dark.color(0).base_color.r, lsp::linear_of_srgb(1 / 255.0), 1e-6)
      << "of 255, whatever is largest";
  const Mesh few = import("a.obj", corners + "#MRGB ff000000\n" + faces);
  EXPECT_NEAR(few.color(0).base_color.r, 2 / 3.0f, 1e-5f);
  EXPECT_TRUE(has_note(few, "colour 1 vertices of 3"));
  EXPECT_TRUE(import("a.obj", corners + about + faces).notes.size() == 1u) << "words in place of digits";
  EXPECT_TRUE(has_note(import("a.obj", corners + "#MRGB ff0000\n" + faces), "#MRGB"));
  EXPECT_TRUE(
      has_note(import("a.obj", "v 0 0 0 1 0 0\n" + corners.substr(8) + "#MRGB ff000000\n" + faces), "#MRGB"));
}

TEST_F(Obj, VertexColours) {
  const std::string faces = "f 1 2 3\n";
  const Mesh mesh = import("a.obj", "v 0 0 0 1 0 0\nv 1 0 0 1 0 0\nv 0 1 0 0 0.7372549 0\n" + faces);
  EXPECT_NEAR(mesh.color(0).base_color.r, 2 / 3.0f, 1e-5f);
  EXPECT_NEAR(mesh.color(0).base_color.g, lsp::linear_of_srgb(0.7372549) / 3, 1e-5);
  EXPECT_NEAR(
      import("a.obj", "v 0 0 0 255 0 0\nv 1 0 0 255 0 0\nv 0 1 0 255 0 0\n" + faces).color(0).base_color.r, 1,
      1e-5f);
  EXPECT_TRUE(import("a.obj", "v 0 0 0 1\nv 1 0 0 1\nv 0 1 0 1\n" + faces).colors.empty()) << "a weight";
}

TEST_F(Obj, AMissingLibraryIsANote) {
  EXPECT_TRUE(
      has_note(import("a.obj", "mtllib none.mtl\n" + kSquare + "f 1 2 3\n"), "none.mtl is not there"));
}

TEST_F(Obj, ConcavePolygonsAreCutInsideTheirOutline) {
  // An arrow head whose fan from the first corner would lie partly outside.
  const Mesh mesh = import("a.obj", "v 0 0 0\nv 4 4 0\nv 0 1 0\nv -4 4 0\nf 2 3 4 1\nf 1 2 3 4\nf 4 3 2 1\n");
  ASSERT_EQ(mesh.triangles.size(), 6u);
  EXPECT_NEAR(area(mesh), 3 * 4.0, 1e-6);
  for (size_t t = 0; t < 4; ++t) EXPECT_GT(face_normal(mesh, t).z, 0.99f);
  for (size_t t = 4; t < 6; ++t) EXPECT_LT(face_normal(mesh, t).z, -0.99f);
}

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
void expect_filled(const Outline& outline, const char* what) {
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
    EXPECT_NEAR(std::abs(sum), want, 1e-9 * want) << what;
    EXPECT_NEAR(sizes, want, 1e-9 * want) << what << ": a triangle lies outside or twice";
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

// A cube's faces meet at 90 degrees, a fine sphere's at far less.
TEST_F(AnyFormat, SmoothNormalsStopAtCreases) {
  const std::string cube =
      "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nv 1 0 1\nv 1 1 1\nv 0 1 1\n"
      "f 4 3 2 1\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n";
  const Mesh flat = import("cube.obj", cube);
  for (size_t t = 0; t < flat.triangles.size(); ++t) {
    for (const glm::vec3& normal : flat.normals[t])
      EXPECT_GT(glm::dot(normal, face_normal(flat, t)), 0.9999f);
  }
  const Mesh smooth = import("cube.obj", cube, {.crease_angle_degrees = 120});
  for (size_t t = 0; t < smooth.triangles.size(); ++t) {
    for (int i = 0; i < 3; ++i) {
      const glm::vec3 outward = glm::normalize(corner(smooth, t, i) - glm::vec3(0.5f));
      EXPECT_GT(glm::dot(smooth.normals[t][i], outward), 0.9999f)
          << "angle weights make a cube's corner normal its diagonal however its faces are cut";
    }
  }
}

TEST_F(AnyFormat, EqualPositionsAreWeldedExactly) {
  const Mesh mesh = import(
      "a.obj",
      "v 0 0 0\nv 1 0 0\nv 0 1 0\nv -0 0 -0\nv 0 1 0\nv -1 0 0\nv 1e-45 0 0\nf 1 2 3\nf 4 5 6\nf 7 2 3\n");
  EXPECT_EQ(mesh.positions.size(), 5u) << "0, x, y, -x and the smallest number that is not 0";
  EXPECT_EQ(mesh.triangles[0].x, mesh.triangles[1].x);
  EXPECT_FALSE(std::signbit(mesh.positions[mesh.triangles[1].x].x));
}

// A thousand small triangles far away: every one is kept, and where it was.
TEST_F(AnyFormat, FarFromTheOriginTheMeshHasOneOfItsOwn) {
  std::string obj, ply =
                       "ply\nformat ascii 1.0\nelement vertex 3000\nproperty double x\nproperty double "
                       "y\nproperty double z\n"
                       "element face 1000\nproperty list uchar int vertex_indices\nend_header\n";
  std::vector<glm::dvec3> exact;
  std::string faces, off = "OFF 3000 1000 0\n", stl = "solid a\n", indices;
  for (int i = 0; i < 1000; ++i) {
    const double x = 471234.5625 + 0.01 * i, y = 5412345.125;
    char line[200];
    stl += "facet normal 0 0 1\nouter loop\n";
    for (const glm::dvec3& p :
         {glm::dvec3(x, y, 0), glm::dvec3(x + 0.01, y, 0), glm::dvec3(x, y + 0.01, 0.5)}) {
      exact.push_back(p);
      std::snprintf(line, sizeof line, "%.17g %.17g %.17g\n", p.x, p.y, p.z);
      obj += std::string("v ") + line;
      ply += line;
      off += line;
      stl += std::string("vertex ") + line;
    }
    stl += "endloop\nendfacet\n";
    faces += "f -3 -2 -1\n";
    obj += "f -3 -2 -1\n";
    indices += "3 " + std::to_string(3 * i) + " " + std::to_string(3 * i + 1) + " " +
               std::to_string(3 * i + 2) + "\n";
  }
  for (const auto& [name, text] : {std::pair<std::string, std::string>{"a.obj", obj},
                                   {"a.ply", ply + indices},
                                   {"a.off", off + indices},
                                   {"a.stl", stl + "endsolid\n"}}) {
    const Mesh mesh = import(name, text);
    ASSERT_EQ(mesh.triangles.size(), 1000u) << name;
    EXPECT_EQ(mesh.rejected.total(), 0u);
    EXPECT_NE(mesh.origin, glm::dvec3(0));
    EXPECT_TRUE(mesh.notes.empty()) << "nothing is lost";
    for (size_t k = 0; k < 3000; ++k) {
      const glm::dvec3 p = mesh.origin + glm::dvec3(corner(mesh, k / 3, int(k % 3)));
      ASSERT_LT(glm::length(p - exact[k]), 1e-6 * 10) << name << k;
    }
  }
}

TEST_F(AnyFormat, AnOriginOnlyWhereItIsNeeded) {
  const auto triangle_at = [&](const std::string& x, const std::string& x1) {
    return import("a.obj", "v " + x + " 0 0\nv " + x1 + " 0 0\nv " + x + " 1 0\nf 1 2 3\n");
  };
  EXPECT_EQ(triangle_at("10.1", "11.1").origin, glm::dvec3(0)) << "moved by less than 1e-6 of its size";
  EXPECT_EQ(triangle_at("1048576", "1048577").origin, glm::dvec3(0)) << "whole in single precision";
  EXPECT_NE(triangle_at("1000.1", "1001.1").origin, glm::dvec3(0));
}

TEST_F(AnyFormat, InputsAreNumberedInTheOrderGiven) {
  const std::filesystem::path paths[] = {write("b.obj", kSquare + "f 1 2 3\nf 1 1 1\n"),
                                         write("a.off", "OFF 3 1 0\n0 0 5\n1 0 5\n0 1 5\n3 0 1 2\n")};
  const Mesh mesh = lsp::import_meshes(paths, {});
  EXPECT_EQ(mesh.primitive_count, 3u);
  EXPECT_EQ(mesh.primitives, (std::vector<uint32_t>{0, 2}));
  EXPECT_EQ(corner(mesh, 1, 0).z, 5.0f);
}

TEST_F(AnyFormat, RefusalsHaveTheirExitCodes) {
  EXPECT_EQ(refusal("a.obj", "").exit, Exit::kInvalid);
  EXPECT_EQ(refusal("a.obj", kSquare).exit, Exit::kInvalid);
  EXPECT_EQ(refusal("a.obj", kSquare + "f 1 1 1\n").exit, Exit::kInvalid);
  EXPECT_EQ(refusal("a.fbx", "x").exit, Exit::kUnsupported);
  const std::filesystem::path missing = folder_ / "none.ply", pipe = folder_ / "pipe.obj";
  std::filesystem::create_directory(folder_ / "folder.stl");
  const std::filesystem::path folder = folder_ / "folder.stl";
  ASSERT_EQ(mkfifo(pipe.c_str(), 0600), 0);
  for (const auto& path : {missing, folder, pipe}) {
    try {
      lsp::import_meshes({&path, 1}, {});
      ADD_FAILURE() << path;
    } catch (const lsp::Failure& failure) {
      EXPECT_EQ(failure.exit(), Exit::kFile);
      EXPECT_EQ(failure.file(), path.string());
    }
  }
}

TEST_F(AnyFormat, TheMemoryLimitHolds) {
  std::string text = kSquare;
  for (int i = 0; i < 20000; ++i) text += "f 1 2 3\n";
  EXPECT_EQ(refusal("a.obj", text, {.memory_limit = 1 << 20}).exit, Exit::kLimit);
  EXPECT_EQ(refusal("a.obj", text, {.memory_limit = 64 << 20}).exit, Exit::kDone);
}

// The same mesh in each of PLY's three encodings, with properties before, between and behind the used ones.
std::string ply(const std::string& format, const std::string& body) {
  return "ply\nformat " + format +
         " 1.0\ncomment x\nelement vertex 4\nproperty uchar red\nproperty double x\nproperty float y\n"
         "property short z\nproperty list uchar float weights\nelement other 1\nproperty int k\n"
         "element face 2\nproperty uchar flag\nproperty list uchar int vertex_indices\nproperty float "
         "quality\nend_header\n" +
         body;
}

template <typename T>
void append_ordered(std::string& out, T value, bool big) {
  std::string raw;
  append(raw, value);
  if (big) std::reverse(raw.begin(), raw.end());
  out += raw;
}

std::string binary_ply(bool big) {
  std::string body;
  for (const glm::ivec3 p :
       {glm::ivec3(0, 0, 3), glm::ivec3(1, 0, 3), glm::ivec3(1, 1, 3), glm::ivec3(0, 1, 3)}) {
    append_ordered(body, uint8_t{9}, big);
    append_ordered(body, double(p.x), big);
    append_ordered(body, float(p.y), big);
    append_ordered(body, int16_t(p.z), big);
    append_ordered(body, uint8_t{2}, big);
    append_ordered(body, 0.5f, big);
    append_ordered(body, 0.5f, big);
  }
  append_ordered(body, int32_t{7}, big);
  for (const std::vector<int>& face : {std::vector<int>{0, 1, 2, 3}, {0, 1, 2}}) {
    append_ordered(body, uint8_t{1}, big);
    append_ordered(body, uint8_t(face.size()), big);
    for (const int index : face) append_ordered(body, int32_t(index), big);
    append_ordered(body, 0.25f, big);
  }
  return ply(big ? "binary_big_endian" : "binary_little_endian", body);
}

TEST_F(Ply, AllEncodingsGiveTheSameMesh) {
  const std::string ascii =
      ply("ascii",
          "9 0 0 3 2 .5 .5\n9 1 0 3 2 .5 .5\n\n9 1 1\n 3 2 .5 .5\n9 0 1 3 2 .5 .5 undeclared values\n7\n"
          "1 4 0 1 2 3 .25\n1 3 0 1 2 .25\n");
  std::string bare_cr = ascii;
  std::replace(bare_cr.begin(), bare_cr.end(), '\n', '\r');
  for (const std::string& file : {ascii, bare_cr, binary_ply(false), binary_ply(true)}) {
    const Mesh mesh = import("a.ply", file);
    ASSERT_EQ(mesh.triangles.size(), 3u);
    EXPECT_EQ(mesh.positions.size(), 4u);
    EXPECT_NEAR(area(mesh), 1.5, 1e-6);
    EXPECT_EQ(corner(mesh, 0, 2), glm::vec3(1, 1, 3));
    EXPECT_TRUE(mesh.colors.empty()) << "red alone is no colour";
  }
}

TEST_F(Ply, NormalsAndStrips) {
  const Mesh mesh =
      import("a.ply",
             "ply\nformat ascii 1.0\nelement vertex 5\nproperty float x\nproperty float y\nproperty float z\n"
             "property float nx\nproperty float ny\nproperty float nz\nelement tristrips 1\n"
             "property list int int vertex_indices\nend_header\n"
             "0 0 0 0 0 2\n1 0 0 0 0 2\n0 1 0 0 0 2\n1 1 0 0 0 2\n2 2 0 0 3 0\n8 0 1 2 3 -1 1 4 3\n");
  ASSERT_EQ(mesh.triangles.size(), 3u);
  for (size_t t = 0; t < 3; ++t) EXPECT_GT(face_normal(mesh, t).z, 0.99f);
  EXPECT_EQ(mesh.normals[0][0], glm::vec3(0, 0, 1));
  EXPECT_EQ(mesh.normals[2][1], glm::vec3(0, 1, 0));
}

TEST_F(Ply, ColoursOfVerticesAndFaces) {
  const auto colored = [&](const std::string& type, const std::string& a, const std::string& b) {
    const std::string rgb =
        "property " + type + " red\nproperty " + type + " green\nproperty " + type + " blue\n";
    return import(
        "a.ply",
        "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n" +
            rgb + "element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0 " + a +
            "\n1 0 0 " + b + "\n0 1 0 " + b + "\n3 0 1 2\n");
  };
  for (const Mesh& mesh :
       {colored("uchar", "255 0 188", "0 0 188"), colored("float", "1 0 0.7372549", "0 0 0.7372549"),
        colored("ushort", "65535 0 48316", "0 0 48316")}) {
    EXPECT_NEAR(mesh.color(0).base_color.r, 1 / 3.0f, 1e-5f);
    EXPECT_EQ(mesh.color(0).base_color.g, 0.0f);
    EXPECT_NEAR(mesh.color(0).base_color.b, lsp::linear_of_srgb(188 / 255.0), 1e-5);
    EXPECT_TRUE(mesh.notes.empty());
  }
  const Mesh faces = import("a.ply",
                            "ply\nformat ascii 1.0\ncomment TextureFile a.png\nelement vertex 3\nproperty "
                            "float x\nproperty float y\nproperty float z\n"
                            "element face 3\nproperty list uchar int vertex_indices\nproperty uchar "
                            "red\nproperty uchar green\nproperty uchar blue\n"
                            "property uchar alpha\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2 255 0 0 255\n2 0 "
                            "1 1 2 3 255\n3 0 1 2 0 0 255 9\n");
  ASSERT_EQ(faces.triangles.size(), 2u);
  EXPECT_EQ(faces.color(0).base_color, glm::vec3(1, 0, 0));
  EXPECT_EQ(faces.color(1).base_color, glm::vec3(0, 0, 1));
  EXPECT_TRUE(has_note(faces, "a.png"));
  EXPECT_TRUE(has_note(faces, "alpha"));
}

// Upper row red, green; lower row blue, white.
std::string four_colors() {
  return rgba_png(2, 2, {255, 0, 0, 255, 0, 255, 0, 255, 0, 0, 255, 255, 255, 255, 255, 255});
}

TEST_F(Ply, TexturesByCoordinatesOfVertices) {
  write("x.png", four_colors());
  const auto textured = [&](const std::string& names, const std::string& uv) {
    return import(
        "a.ply",
        "ply\nformat ascii 1.0\ncomment TextureFile x.png\nelement vertex 3\nproperty float x\nproperty "
        "float y\nproperty float z\nproperty float " +
            names.substr(0, names.find(' ')) + "\nproperty float " + names.substr(names.find(' ') + 1) +
            "\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0 " + uv + "\n1 0 0 " +
            uv + "\n0 1 0 " + uv + "\n3 0 1 2\n");
  };
  for (const std::string names : {"s t", "u v", "texture_u texture_v"}) {
    const Mesh lower_left = textured(names, "0.25 0.25");
    EXPECT_EQ(lower_left.color(0).base_color, glm::vec3(0, 0, 1)) << names << ": v grows upwards";
    EXPECT_TRUE(lower_left.notes.empty()) << lower_left.notes.front();
    EXPECT_EQ(lower_left.sources[0].size(), 2u) << "the picture is a file that the mesh depends on";
    EXPECT_EQ(textured(names, "0.75 0.75").color(0).base_color, glm::vec3(0, 1, 0)) << names;
  }
  EXPECT_TRUE(has_note(textured("s other", "0.25 0.25"), "the texture x.png is not read"));
  std::filesystem::remove(folder_ / "x.png");
  const Mesh without = textured("s t", "0.25 0.25");
  EXPECT_TRUE(has_note(without, "the picture x.png is not there"));
  EXPECT_EQ(without.color(0).base_color, glm::vec3(0.8f));
}

// As MeshLab writes them: several textures, a number and six coordinates a face, here of either encoding.
TEST_F(Ply, TexturesByCoordinatesOfFaces) {
  write("x.png", four_colors());
  write("a grey.png", png_bytes<uint8_t>(1, 1, PNG_FORMAT_GRAY, {255}));
  const std::string header =
      "comment TextureFile x.png\ncomment TextureFile a grey.png\nelement vertex 3\nproperty float "
      "x\nproperty float "
      "y\nproperty float z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\nelement face "
      "4\nproperty "
      "list uchar float texcoord\nproperty list uchar int vertex_indices\nproperty int "
      "texnumber\nend_header\n";
  const float corners[9] = {0, 0, 0, 1, 0, 0, 0, 1, 0};
  std::string text = "ply\nformat ascii 1.0\n" + header + "0 0 0 9 9 9\n1 0 0 9 9 9\n0 1 0 9 9 9\n";
  std::string binary = "ply\nformat binary_little_endian 1.0\n" + header;
  for (int i = 0; i < 3; ++i) {
    for (int k = 0; k < 3; ++k) append(binary, corners[3 * i + k]);
    binary += "\t\t\t";
  }
  const auto face = [&](int texture, int coordinates, float u, float v) {
    text += std::to_string(2 * coordinates);
    binary += char(2 * coordinates);
    for (int i = 0; i < coordinates; ++i) {
      for (const float value : {u, v}) text.append(1, ' ').append(std::to_string(value));
      append(binary, u);
      append(binary, v);
    }
    text.append(" 3 0 1 2 ").append(std::to_string(texture)).append(1, '\n');
    binary += '\3';
    for (const int32_t number : {0, 1, 2, texture}) append(binary, number);
  };
  face(0, 3, 0.25f, 0.75f);
  face(0, 3, 1.75f, 0.25f);  // repeats
  face(1, 3, 0.5f, 0.5f);
  face(7, 3, 0.5f, 0.5f);
  for (const std::string& bytes : {text, binary}) {
    const Mesh mesh = import("a.ply", bytes);
    ASSERT_EQ(mesh.triangles.size(), 4u);
    EXPECT_EQ(mesh.color(0).base_color, glm::vec3(1, 0, 0));
    EXPECT_EQ(mesh.color(1).base_color, glm::vec3(1, 1, 1));
    EXPECT_EQ(mesh.color(2).base_color, glm::vec3(1, 1, 1));
    EXPECT_EQ(mesh.color(3).base_color, glm::vec3(0.8f)) << "no such texture";
    EXPECT_EQ(mesh.materials[mesh.material_ids[2]].name, "a grey.png");
    EXPECT_TRUE(has_note(mesh, "that no comment names"));
    EXPECT_TRUE(has_note(mesh, "textures say them")) << "the colours of vertices";
  }
}

TEST_F(Ply, HeadersThatPromiseTooMuchAreRefusedAtOnce) {
  const std::string start = "ply\nformat binary_little_endian 1.0\nelement vertex ";
  const std::string xyz = "\nproperty float x\nproperty float y\nproperty float z\n";
  EXPECT_EQ(refusal("a.ply", start + "4000000000" + xyz + "end_header\n" + std::string(100, 'x')).exit,
            Exit::kInvalid);
  EXPECT_EQ(refusal("a.ply", start + "18446744073709551615" + xyz + "end_header\n").exit, Exit::kInvalid);
  EXPECT_EQ(refusal("a.ply", start + "-1" + xyz + "end_header\n").exit, Exit::kInvalid);
  EXPECT_EQ(refusal("a.ply", start + "1" + xyz +
                                 "element face 1\nproperty list uint int vertex_indices\nend_header\n" +
                                 std::string(12, '\0') + "\xFF\xFF\xFF\xFF" + std::string(50, '\0'))
                .exit,
            Exit::kInvalid);
  EXPECT_EQ(refusal("a.ply", "ply\nformat ascii 1.0\nelement nothing 9000000000000000000\nend_header\n").exit,
            Exit::kInvalid);
  EXPECT_EQ(
      refusal("a.ply", "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nend_header\n1\n").exit,
      Exit::kInvalid);
  EXPECT_EQ(refusal("a.ply", "ply\nformat ascii 1.0\nelement v 1\nproperty color x\nend_header\n1\n").exit,
            Exit::kInvalid);
  EXPECT_EQ(refusal("a.ply", "ply\nformat utf9 1.0\n").exit, Exit::kUnsupported);
}

std::string binary_stl(const std::string& header, uint32_t declared, int triangles) {
  std::string out = header;
  out.resize(80, ' ');
  append(out, declared);
  for (int i = 0; i < triangles; ++i) {
    const float values[12] = {0, 0, 2, 0, 0, float(i), 1, 0, float(i), 0, 1, float(i)};
    append(out, values);
    append(out, uint16_t{0});
  }
  return out;
}

TEST_F(Stl, BinaryEvenWhereItsHeaderSaysSolid) {
  const Mesh mesh = import("a.STL", binary_stl("solid exported", 3, 3));
  ASSERT_EQ(mesh.triangles.size(), 3u);
  EXPECT_EQ(corner(mesh, 2, 1), glm::vec3(1, 0, 2));
  EXPECT_EQ(mesh.normals[0][0], glm::vec3(0, 0, 1));
  EXPECT_EQ(refusal("c.stl", binary_stl("", 4, 3) + "x").exit, Exit::kInvalid) << "cut short";
  EXPECT_EQ(refusal("c.stl", "short").exit, Exit::kInvalid);
}

TEST_F(Stl, WrongCountsOverWholeTriangles) {
  for (const char* header : {"", "solid streamed\nfacet", "SOLID x\n"}) {
    for (const uint32_t declared : {0u, 2u, 4u, 0xFFFFFFFFu}) {
      const Mesh mesh = import("a.stl", binary_stl(header, declared, 3));
      EXPECT_EQ(mesh.triangles.size(), 3u) << header << declared;
      EXPECT_TRUE(has_note(mesh, "and holds 3"));
    }
    EXPECT_TRUE(import("a.stl", binary_stl(header, 3, 3)).notes.empty());
    EXPECT_EQ(import("a.stl", binary_stl(header, 0, 3) + "xyz").triangles.size(), 3u);
    const Mesh tail = import("a.stl", binary_stl(header, 3, 3) + std::string(100, '\0'));
    EXPECT_EQ(tail.primitive_count, 3u) << "zeros are no triangles";
    EXPECT_TRUE(has_note(tail, "after the last triangle"));
  }
  EXPECT_EQ(refusal("a.stl", binary_stl("", 0, 0)).exit, Exit::kInvalid);
}

TEST_F(Stl, TextWithSeveralSolidsInAnyCase) {
  const std::string facet =
      " facet normal 0 0 1\n  outer loop\n   vertex 0 0 0\n   VERTEX 1 0 0\n   vertex 0 1 0\n  endloop\n "
      "endfacet\n";
  const Mesh mesh = import("a.stl", "\n SOLID vertex facet\n" + facet +
                                        "endsolid\nsolid empty\nendsolid\nsolid b\n" + facet +
                                        " facet normal 0 0 0\n outer loop\n vertex 0 0 0\n vertex 0 0 0\n "
                                        "vertex 0 1 0\n endloop\n endfacet\nendsolid\n");
  EXPECT_EQ(mesh.primitive_count, 3u);
  EXPECT_EQ(mesh.rejected.degenerate, 1u);
  EXPECT_EQ(mesh.positions.size(), 3u);
  EXPECT_EQ(refusal("b.stl", "solid a\n" + facet.substr(0, facet.size() - 11)).exit, Exit::kInvalid);
}

TEST_F(Stl, TextOnOneLine) {
  const std::string facet =
      " facet normal 0 0 1 outer loop vertex 0 0 0 vertex 1 0 0 vertex 0 1 0 endloop endfacet";
  const std::string upside_down =
      " FACET NORMAL 0 0 -1 outer loop vertex 0 0 1 vertex 0 1 1 vertex 1 0 1 endloop endfacet";
  const Mesh mesh = import("a.stl", "solid a facet for the normal user" + facet + upside_down +
                                        " endsolid a facet solid b" + facet + " endsolid b");
  ASSERT_EQ(mesh.triangles.size(), 3u);
  EXPECT_EQ(corner(mesh, 1, 2), glm::vec3(1, 0, 1));
  EXPECT_EQ(mesh.normals[0][0], glm::vec3(0, 0, 1));
  EXPECT_EQ(mesh.normals[1][0], glm::vec3(0, 0, -1));
  EXPECT_EQ(mesh.primitive_count, 3u);
  EXPECT_EQ(import("a.stl", "solid" + facet).triangles.size(), 1u) << "short, and without an end";
  EXPECT_EQ(refusal("b.stl", "solid a" + facet + facet.substr(0, facet.size() - 9)).exit, Exit::kInvalid);
}

TEST_F(Stl, TextBehindCommentsAndBlankLines) {
  const std::string facet =
      "facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0 # here\nvertex 0 1 0\nendloop\nendfacet\n";
  for (const std::string start : {"# exported by something\n", "\n \n\t\n",
                                  "\r\n\r\n; a facet normal 1 0 0\r\n", "// vertex 1 2 3\n!x\n"}) {
    EXPECT_EQ(import("a.stl", start + "solid a\n" + facet + "# between\n" + facet + "endsolid a\n")
                  .triangles.size(),
              2u)
        << start;
  }
  EXPECT_EQ(import("a.stl", binary_stl("# no text", 3, 3)).triangles.size(), 3u);
  EXPECT_EQ(import("a.stl", binary_stl("solid facet normal 0 0 1", 3, 3) + "x").triangles.size(), 3u);
}

TEST_F(Off, CommentsColoursBrokenLinesAndKeywords) {
  const std::string body =
      "# eight\n0 0 0 # here\n\n1 0 0 255 0 0\n1 1 0\n0 1 0\n4 0 1\n 2 3\n3 0 1 2 .5 0 0 1\n3 0\n1\n3\n";
  for (const std::string start :
       {"OFF\n4 3 0\n", "OFF 4 3 0\n", "# a\nOFF4 3 0 # x\n", "4 3\n", "COFF\n4\n3 0\n"}) {
    const Mesh mesh = import("a.off", start + body);
    EXPECT_EQ(mesh.triangles.size(), 4u) << start;
    EXPECT_NEAR(area(mesh), 2.0, 1e-6);
    EXPECT_EQ(mesh.color(2).base_color, glm::vec3(lsp::linear_of_srgb(0.5), 0, 0)) << start;
  }
  const Mesh with_normals = import("a.off", "NOFF\n3 1 0\n0 0 0 0 0 1\n1 0 0 0 1 0\n0 1 0 0 0 1\n3 0 1 2\n");
  EXPECT_EQ(with_normals.normals[0][1], glm::vec3(0, 1, 0));
}

TEST_F(Off, ColoursOfVerticesAndFaces) {
  const Mesh mesh =
      import("a.off",
             "COFF\n4 2 0\n0 0 0 255 0 0 255\n1 0 0 255 0 0 255\n1 1 0 255 0 0 255\n0 1 0 0 255 0 128\n"
             "3 0 1 2\n3 0 2 3\n");
  EXPECT_EQ(mesh.color(0).base_color, glm::vec3(1, 0, 0));
  EXPECT_NEAR(mesh.color(1).base_color.g, 1 / 3.0f, 1e-5f);
  EXPECT_TRUE(has_note(mesh, "alpha"));
  const Mesh faces =
      import("a.off", "OFF\n4 2 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2 0 128 255\n3 0 2 3 7\n");
  EXPECT_NEAR(faces.color(0).base_color.g, lsp::linear_of_srgb(128 / 255.0), 1e-6);
  EXPECT_TRUE(has_note(faces, "colours of faces by their number"));
}

TEST_F(Off, Refusals) {
  EXPECT_EQ(refusal("a.off", "nOFF\n4\n").exit, Exit::kUnsupported);
  EXPECT_EQ(refusal("a.off", "OFF\n2000000000 1 0\n0 0 0\n").exit, Exit::kInvalid);
  EXPECT_EQ(refusal("a.off", "OFF\n1 1 0\n0 0 0\n2000000000 0 0 0\n").exit, Exit::kInvalid);
  EXPECT_EQ(refusal("a.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n").exit, Exit::kInvalid);
  EXPECT_EQ(refusal("a.off", "solid\n").exit, Exit::kInvalid);
}

std::string binary_off() {
  std::string bytes = "COFF BINARY\n";
  const auto add = [&](uint32_t word) { append(bytes, __builtin_bswap32(word)); };
  for (const uint32_t count : {3u, 1u, 0u}) add(count);
  for (const float value : {0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0, 0, 1, 0, 1, 0, 1, 0, 0, 1})
    add(std::bit_cast<uint32_t>(value));
  for (const uint32_t word : {3u, 0u, 1u, 2u, 0u}) add(word);
  return bytes;
}

// No prefix of a file and no changed byte may do more than be refused.
TEST_F(AnyFormat, DamagedFilesAreReadOrRefused) {
  const std::pair<std::string, std::string> files[] = {
      {"a.obj", "mtllib a.mtl\n" + kSquare + "vn 0 0 1\nusemtl x\nf 1/1/1 2//1 3 -1\n"},
      {"b.ply", binary_ply(false)},
      {"c.ply",
       ply("ascii", "9 0 0 3 1 1\n9 1 0 3 0\n9 1 1 3 0\n9 0 1 3 0\n7\n1 4 0 1 2 3 .25\n1 3 0 1 2 .25\n")},
      {"d.stl", binary_stl("", 2, 2)},
      {"e.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"},
      {"f.off", binary_off()}};
  uint32_t seed = 7;
  const auto random = [&](size_t below) { return (seed = seed * 1664525u + 1013904223u) % uint32_t(below); };
  const lsp::ImportOptions options{.memory_limit = 64 << 20};
  size_t read = 0, refused = 0;
  for (const auto& [name, bytes] : files) {
    for (size_t length = 0; length < bytes.size(); ++length) {
      const Exit exit = refusal(name, bytes.substr(0, length), options).exit;
      ++(exit == Exit::kDone ? read : refused);
    }
    for (int i = 0; i < 400; ++i) {
      std::string damaged = bytes;
      for (size_t k = 0; k <= random(4); ++k) damaged[random(damaged.size())] = char(random(256));
      const Exit exit = refusal(name, damaged, options).exit;
      ++(exit == Exit::kDone ? read : refused);
      EXPECT_NE(exit, Exit::kInternal);
    }
  }
  EXPECT_GT(read, 100u);
  EXPECT_GT(refused, 100u);
}

}  // namespace
