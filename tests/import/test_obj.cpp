// OBJ and its .mtl: each feature and each way to go wrong, on small files.
#include "import/texture.h"
#include "png_bytes.h"
#include "text_files.h"

namespace {

using lsp::Exit;
using lsp::Mesh;
using namespace lsp_test;

class Obj : public MeshFiles {};

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

TEST_F(Obj, ReferencesToNothingAreNoted) {
  const Mesh normals = import("a.obj", kSquare + "vn 0 0 1\nf 1//1 2//1 3//9\n");
  EXPECT_TRUE(has_note(normals, "faces refer to normals that are not there"));
  EXPECT_TRUE(
      has_note(import("a.obj", kSquare + "vt 0 0\nf 1/1 2/0 3/1\n"), "texture coordinates that are not"));
  EXPECT_TRUE(import("a.obj", "f 1/1/1 2/1/1 3/1/1\n" + kSquare + "vt 0 0\nvn 0 0 1\n").notes.empty());
  EXPECT_TRUE(import("a.obj", kSquare + "f 1/ 2/ 3/\nf 1// 3// 4//\n").notes.empty());
}

// Two faces that bend by 22 degrees.
TEST_F(Obj, SmoothingGroupsShareNoNormals) {
  const std::string bent = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 1 2 0.4\nv 0 2 0.4\n";
  const auto is_smooth = [&](const std::string& before, const std::string& between) {
    const Mesh mesh = import("a.obj", bent + before + "f 1 2 3 4\n" + between + "f 4 3 5 6\n");
    EXPECT_TRUE(mesh.notes.empty());
    EXPECT_EQ(mesh.normals[0][0], glm::vec3(0, 0, 1)) << "no other face is there";
    return mesh.normals[0][2] == mesh.normals[2][1] && mesh.normals[0][2] != glm::vec3(0, 0, 1);
  };
  EXPECT_TRUE(is_smooth("", ""));
  EXPECT_TRUE(is_smooth("s 1\n", ""));
  EXPECT_TRUE(is_smooth("s 2\n", "s 2 # c\n"));
  EXPECT_FALSE(is_smooth("s 1\n", "s 2\n"));
  EXPECT_FALSE(is_smooth("", "s 2\n"));
  EXPECT_FALSE(is_smooth("s off\n", ""));
  EXPECT_FALSE(is_smooth("s 0\n", "s 1\n"));
  EXPECT_TRUE(has_note(import("a.obj", bent + "s on\nf 1 2 3 4\n"), "smoothing groups that are no number"));
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
  const Mesh noted = color_with("map_Bump -bm 2 x.png\nmap_Kd -boost 2 gone.png\n", all);
  for (const char* part : {"map_Bump", "-boost", "gone.png"}) EXPECT_TRUE(has_note(noted, part)) << part;
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

}  // namespace
