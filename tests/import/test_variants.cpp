// What programs write beside the letter of a format, and what is not read of it.
#include <cmath>

#include "gltf_builder.h"
#include "import/texture.h"
#include "png_bytes.h"

namespace {

using lsp::Exit;
using lsp::Mesh;
using namespace lsp_test;

class Variants : public MeshFiles {
 protected:
  void expect_color(const Mesh& mesh, const glm::vec3& right) {
    for (int k = 0; k < 3; ++k) EXPECT_NEAR(mesh.color(0).base_color[k], right[k], 1e-4f) << k;
  }
};

constexpr float kGrey128 = 0.21586f;  // 128 of 255 on the sRGB curve

std::string ply(const std::string& properties, const std::string& values, const std::string& more = "",
                const std::string& tail = "") {
  std::string text =
      "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n" +
      properties + "element face 1\nproperty list uchar int vertex_indices\n" + more + "end_header\n";
  for (const char* at : {"0 0 0 ", "1 0 0 ", "0 1 0 "}) text += at + values + "\n";
  return text + "3 0 1 2" + tail + "\n";
}

std::string rgb(const std::string& type, const char* r = "red", const char* g = "green",
                const char* b = "blue") {
  std::string out;
  for (const char* name : {r, g, b}) out += "property " + type + " " + name + "\n";
  return out;
}

TEST_F(Variants, PlyColoursOfEveryType) {
  const glm::vec3 right(1, 0, kGrey128);
  expect_color(import("a.ply", ply(rgb("uchar"), "255 0 128")), right);
  expect_color(import("a.ply", ply(rgb("ushort"), "65535 0 32896")), right);
  expect_color(import("a.ply", ply(rgb("int"), "255 0 128")), right);
  expect_color(import("a.ply", ply(rgb("uint"), "65535 0 32896")), right);
  expect_color(import("a.ply", ply(rgb("uint"), "4294967295 0 2155905152")), right);
  expect_color(import("a.ply", ply(rgb("char"), "-1 0 -128")), right);
  const Mesh bytes = import("a.ply", ply(rgb("ushort"), "255 0 128"));
  expect_color(bytes, right);
  EXPECT_TRUE(has_note(bytes, "no colour of 16 bits is above 255, they are taken as bytes"));
  expect_color(import("a.ply", ply(rgb("float"), "255 0 128")), right);
  expect_color(import("a.ply", ply(rgb("float"), "1 0 0.50196")), right);
  expect_color(import("a.ply", ply(rgb("uchar", "r", "g", "b"), "255 0 128")), right);
  expect_color(import("a.ply", ply(rgb("uchar", "Red", "Green", "Blue"), "255 0 128")), right);
  expect_color(import("a.ply", ply("", "", rgb("float"), " 255 0 128")), right);
}

TEST_F(Variants, ObjVerticesWithoutAColourAreWhite) {
  const Mesh mesh =
      import("a.obj",
             "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1 255 0 128\nv 1 0 1 255 0 128\nv 0 1 1 255 0 128\n"
             "f 4 5 6\nf 1 2 3\n");
  expect_color(mesh, {1, 0, kGrey128});
  EXPECT_EQ(mesh.color(1).base_color, glm::vec3(1));
}

TEST_F(Variants, ObjCommentsNeverGoOnAndBlanksMayFollowABackslash) {
  const char* square = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";
  const Mesh comment = import("a.obj", std::string("# from C:\\out\\\n") + square + "f 1 2 3 4\n");
  EXPECT_EQ(comment.triangles.size(), 2u);
  const Mesh blanks = import("a.obj", std::string(square) + "f 1 2 \\ \t\r\n3 \\\n4\n");
  EXPECT_EQ(blanks.triangles.size(), 2u);
  EXPECT_TRUE(comment.notes.empty() && blanks.notes.empty());
}

TEST_F(Variants, ObjNamesWhatItDoesNotRead) {
  const std::string square = "v 0 0 0 1\nv 1 0 0\nv 1 1 0 # c\nv 0 1 0\n";
  EXPECT_TRUE(import("a.obj", "o x\ng a b\ns off\n" + square + "f 1 2 3 4\n").notes.empty());
  const Mesh unknown = import("a.obj", square + "f 1 2 3 4\nusemap x\nF 1 2 3\nusemap y\n");
  EXPECT_TRUE(has_note(unknown, "lines that begin with F, usemap are not read"));
  EXPECT_EQ(unknown.notes.size(), 1u);
  const Mesh alpha = import("a.obj", "v 0 0 0 1 0 0 0.5\nv 1 0 0 1 0 0 0.5\nv 1 1 0 1 0 0 0.5\nf 1 2 3\n");
  EXPECT_TRUE(has_note(alpha, "alpha of vertices"));
  EXPECT_EQ(alpha.color(0).base_color, glm::vec3(1, 0, 0));
  EXPECT_TRUE(has_note(import("a.obj", square + "usemtl moss\nf 1 2 3\n"), "taken as grey: moss"));
  const Refusal points = refusal("a.obj", square + "p 1 2\n");
  EXPECT_EQ(points.exit, lsp::Exit::kInvalid);
  EXPECT_NE(points.message.find("noted: 1 lines, points"), points.message.npos) << points.message;
}

TEST_F(Variants, MtlNamesWhatItDoesNotRead) {
  const auto notes_of = [&](const std::string& mtl) {
    write("a.mtl", "newmtl m\nKd 1 0 0\n" + mtl);
    const Mesh mesh = import("a.obj", "mtllib a.mtl # c\nv 0 0 0\nv 1 0 0\nv 1 1 0\nusemtl m # c\nf 1 2 3\n");
    EXPECT_EQ(mesh.color(0).base_color, glm::vec3(1, 0, 0)) << mtl;
    std::string notes;
    for (const std::string& note : mesh.notes) notes += note + "\n";
    return notes;
  };
  // What exporters write of a plain material.
  EXPECT_EQ(notes_of("# c\nNs 250\nKa 1 1 1\nKs 0.5 0.5 0.5\nNi 1.45\nd 1\nTr 0\nillum 2\nTf 1 1 1\nPs 0\n"),
            "");
  for (const char* line : {"Ks 1 0.8 0.3", "Tf 0 1 0", "Pc 1", "aniso 0.5", "gloss 3"})
    EXPECT_NE(notes_of(std::string(line) + "\n").find(std::string(line, 2)), std::string::npos) << line;
  EXPECT_NE(notes_of("d -halo 1\n").find("-halo"), std::string::npos);
  EXPECT_NE(notes_of("newmtl m\nKd 0 1 0\n").find("m is defined more than once"), std::string::npos);
}

TEST_F(Variants, WhatFollowsTheEndIsNoted) {
  const std::string header =
      "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
      "element face 1\nproperty list uchar int vertex_indices\nend_header\n";
  const std::string body = "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
  EXPECT_TRUE(import("a.ply", header + body + "\n \n").notes.empty());
  EXPECT_TRUE(
      has_note(import("a.ply", header + body + "3 2 1 0\n"), "7 bytes after what the header declares"));
  EXPECT_TRUE(has_note(import("a.ply", header + "0 0 0 9\n1 0 0 9\n0 1 0 9\n3 0 1 2\n"),
                       "more values than the header declares"));
  const std::string off = "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
  EXPECT_TRUE(import("a.off", off + "# the end\n").notes.empty());
  EXPECT_TRUE(has_note(import("a.off", off + "3 2 1 0\n"), "what follows the last face"));
  EXPECT_TRUE(has_note(import("a.off", "STOFF\n3 1 0\n0 0 0 0 0\n1 0 0 1 0\n0 1 0 0 1\n3 0 1 2\n"),
                       "texture coordinates"));
  const std::string stl =
      "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\n"
      "endsolid a\n";
  EXPECT_TRUE(import("a.stl", stl).notes.empty());
  EXPECT_TRUE(has_note(import("a.stl", stl + "color 1 0 0\n"), "lines that begin with color"));
}

TEST_F(Variants, APlyCloudIsRefusedAsOne) {
  const Refusal cloud =
      refusal("a.ply",
              "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\n"
              "property float z\nend_header\n0 0 0\n1 0 0\n");
  EXPECT_EQ(cloud.exit, lsp::Exit::kInvalid);
  EXPECT_NE(cloud.message.find("2 vertices have no faces"), cloud.message.npos) << cloud.message;
}

TEST_F(Variants, PlyTexturesOfFacesBeforeTheirVertices) {
  write("red.png", rgba_png(1, 1, {255, 0, 0, 255}));
  const Mesh mesh = import("a.ply",
                           "ply\nformat ascii 1.0\ncomment TextureFile red.png\nelement face 1\nproperty "
                           "list uchar int vertex_indices\n"
                           "element vertex 3\nproperty float x\nproperty float y\nproperty float z\nproperty "
                           "float s\nproperty float t\n"
                           "end_header\n3 0 1 2\n0 0 0 0 0\n1 0 0 1 0\n0 1 0 0 1\n");
  EXPECT_EQ(mesh.color(0).base_color, glm::vec3(1, 0, 0));
  EXPECT_TRUE(mesh.notes.empty());
}

TEST_F(Variants, StlColoursOfMagicsAndVisCam) {
  const auto stl = [](const std::string& header, const std::vector<uint16_t>& attributes) {
    std::string bytes = header;
    bytes.resize(80, ' ');
    append(bytes, uint32_t(attributes.size()));
    for (const uint16_t attribute : attributes) {
      for (const float value : {0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0}) append(bytes, float(value));
      append(bytes, attribute);
    }
    return bytes;
  };
  const std::string green("COLOR=\0\xFF\0\xFF", 10);
  const Mesh magics = import("a.stl", stl(green, {31, 0x8000}));
  EXPECT_EQ(magics.color(0).base_color, glm::vec3(1, 0, 0));
  EXPECT_EQ(magics.color(1).base_color, glm::vec3(0, 1, 0));
  EXPECT_TRUE(magics.notes.empty());
  const Mesh viscam = import("a.stl", stl("", {0x8000 | 31, 0x8000 | 31 << 10, 5}));
  EXPECT_EQ(viscam.color(0).base_color, glm::vec3(0, 0, 1));
  EXPECT_EQ(viscam.color(1).base_color, glm::vec3(1, 0, 0));
  EXPECT_EQ(viscam.color(2).base_color, glm::vec3(1)) << "has none";
  EXPECT_TRUE(has_note(viscam, "taken as colours"));
  const Mesh other = import("a.stl", stl("", {7, 9}));
  EXPECT_TRUE(other.colors.empty());
  EXPECT_TRUE(has_note(other, "no colours known here"));
}

TEST_F(Variants, PlyNamesWhatItDoesNotRead) {
  const Mesh mesh =
      import("a.ply", ply("property float s\nproperty float t\n", "0 0",
                          "property int flags\nproperty list uchar float texcoord\n", " 7 2 0 0"));
  EXPECT_TRUE(has_note(mesh, "of each vertex s, t is not read"));
  EXPECT_TRUE(has_note(mesh, "of each face flags, texcoord is not read"));
  EXPECT_TRUE(has_note(import("a.ply", ply("", "", "element edge 1\nproperty int a\n", "\n7")),
                       "the element edge is not read"));
  EXPECT_TRUE(import("a.ply", ply("", "")).notes.empty());
}

TEST_F(Variants, PlyInCapitalsOrWithAByteOrderMark) {
  std::string text = ply("", "");
  for (const char* name : {" x\n", " y\n", " z\n"}) text[text.find(name) + 1] -= 'a' - 'A';
  EXPECT_EQ(import("a.ply", text).triangles.size(), 1u);
  EXPECT_EQ(import("a.ply", "\xEF\xBB\xBF" + ply("", "")).triangles.size(), 1u);
}

std::string off(const std::string& keyword, const std::string& values, const std::string& face = "") {
  std::string text = keyword + "\n3 1 0\n";
  for (const char* at : {"0 0 0 ", "1 0 0 ", "0 1 0 "}) text += at + values + "\n";
  return text + "3 0 1 2" + face + "\n";
}

TEST_F(Variants, OffColoursByTheirLargest) {
  expect_color(import("a.off", off("COFF", "255 0 128 255")), {1, 0, kGrey128});
  expect_color(import("a.off", off("COFF", "1 0 0.50196 1")), {1, 0, kGrey128});
  expect_color(import("a.off", off("COFF", "1 0 0 1")), {1, 0, 0});
  expect_color(import("a.off", off("OFF", "", " 1 0 0")), {1, 0, 0});
  expect_color(import("a.off", off("OFF", "", " 255 0 128")), {1, 0, kGrey128});
  EXPECT_TRUE(import("a.off", off("COFF", "1 0 0 1")).notes.empty());
  EXPECT_TRUE(has_note(import("a.off", off("COFF", "255 0 0 128")), "alpha"));
  // Faces without a colour beside one with: white.
  std::string two = off("OFF", "", " 255 0 0") + "3 0 2 1\n";
  two.replace(two.find("3 1 0"), 5, "3 2 0");
  EXPECT_EQ(import("a.off", two).color(1).base_color, glm::vec3(1));
}

TEST_F(Variants, FacesWithoutAColourHaveTheirVertices) {
  std::string two = off("COFF", "255 0 0 255", " 0 255 0") + "3 0 2 1\n";
  two.replace(two.find("3 1 0"), 5, "3 2 0");
  const Mesh mesh = import("a.off", two);
  EXPECT_EQ(mesh.color(0).base_color, glm::vec3(0, 1, 0));
  EXPECT_EQ(mesh.color(1).base_color, glm::vec3(1, 0, 0));
  ASSERT_EQ(mesh.notes.size(), 1u);
  EXPECT_TRUE(has_note(mesh, "colours of vertices are not read where faces have their own"));
  EXPECT_TRUE(has_note(import("a.ply", ply(rgb("uchar"), "255 0 0", rgb("uchar"), " 0 0 255")),
                       "colours of vertices are not read where faces have their own"));
}

TEST_F(Variants, OffKeywords) {
  for (const char* keyword : {"CNOFF", "NCOFF"}) {
    const Mesh mesh = import("a.off", off(keyword, "0 0 -1 255 0 0 255"));
    expect_color(mesh, {1, 0, 0});
    EXPECT_EQ(mesh.normals[0][0], glm::vec3(0, 0, -1)) << keyword;
  }
  EXPECT_EQ(import("a.off", off("off", "")).triangles.size(), 1u);
}

TEST_F(Variants, StlTextInAnyEncoding) {
  const std::string text =
      "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\n"
      "endsolid a\n";
  std::string wide = "\xFF\xFE";
  for (const char c : text) (wide += c) += '\0';
  for (const std::string& bytes : {text, "\xEF\xBB\xBF" + text, wide}) {
    const Mesh mesh = import("a.stl", bytes);
    ASSERT_EQ(mesh.triangles.size(), 1u);
    EXPECT_EQ(corner(mesh, 0, 1), glm::vec3(1, 0, 0));
  }
}

// Triangles without an area are triangles, where a count of 0 says nothing of how many there are.
TEST_F(Variants, StlWithoutACountAndWithEmptyTriangles) {
  std::string bytes(84, ' ');
  std::memset(bytes.data() + 80, 0, 4);
  const std::string none(50, '\0');
  std::string one;
  for (const float x : {0.f, 0.f, 1.f, 0.f, 0.f, 0.f, 1.f, 0.f, 0.f, 0.f, 1.f, 0.f}) append(one, x);
  one += std::string(2, '\0');
  const Mesh mesh = import("a.stl", bytes + one + none + one);
  EXPECT_EQ(mesh.primitive_count, 3u);
  EXPECT_EQ(mesh.triangles.size(), 2u);
  EXPECT_TRUE(has_note(mesh, "declares 0 triangles and holds 3"));
  const Refusal noise = refusal("a.stl", bytes + std::string(100, '\xFF'));
  EXPECT_EQ(noise.exit, Exit::kInvalid);
  EXPECT_NE(noise.message.find("declares no triangle, and the bytes after its header are none"),
            std::string::npos);
  bytes[80] = 1;
  EXPECT_EQ(import("a.stl", bytes + one + none).primitive_count, 1u) << "zeros behind are padding";
}

TEST_F(Variants, APolygonWhosePartsCancelOutIsNoted) {
  const std::string four = "v 0 0 0\nv 1 1 0\nv 1 0 0\nv 0 1 0\n";
  EXPECT_TRUE(has_note(import("a.obj", four + "f 1 2 3 4\n"), "1 polygons cross themselves"));
  EXPECT_TRUE(import("a.obj", four + "f 1 3 2 4\n").notes.empty());
  const Mesh line = import("a.obj", four + "v 2 2 0\nv 3 3 0\nf 1 2 5 6\nf 1 3 2\n");
  EXPECT_FALSE(has_note(line, "cross themselves"));
  EXPECT_EQ(line.rejected.degenerate, 2u);
}

TEST_F(Variants, MtlColoursThatAreNoneAndFacesWithoutCoordinatesAreNoted) {
  const std::string obj = "mtllib a.mtl\nusemtl m\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\n";
  write("a.mtl", "newmtl m\nKd spectral sun.rfl\n");
  EXPECT_TRUE(has_note(import("a.obj", obj + "f 1 2 3\n"), "a Kd that is no three numbers is not read"));
  write("red.png", rgba_png(1, 1, {255, 0, 0, 255}));
  write("a.mtl", "NEWMTL m\nmap_kd red.png\n");
  EXPECT_TRUE(import("a.obj", obj + "f 1/1 2/1 3/1\n").notes.empty());
  EXPECT_TRUE(has_note(import("a.obj", obj + "f 1 2 3\n"), "have a texture and no texture coordinates"));
  EXPECT_TRUE(
      has_note(import("a.obj", obj + "f 1/9 2/9 3/9\n"), "have a texture and no texture coordinates"));
}

TEST_F(Variants, AMapOfOpacityPlacedOtherwiseIsNoted) {
  write("red.png", rgba_png(1, 1, {255, 0, 0, 255}));
  const std::string obj = "mtllib a.mtl\nusemtl m\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nf 1/1 2/1 3/1\n";
  write("a.mtl", "newmtl m\nmap_Kd red.png\nmap_d -imfchan r red.png\n");
  EXPECT_TRUE(import("a.obj", obj).notes.empty());
  write("a.mtl", "newmtl m\nmap_Kd red.png\nmap_d -s 2 2 2 -imfchan r red.png\n");
  EXPECT_TRUE(has_note(import("a.obj", obj), "a map_d is placed as the map_Kd beside it"));
}

TEST_F(Variants, GltfExtensionsThatNoListDeclaresAreNoted) {
  Document document;
  document.node(
      {{"mesh", document.mesh({{"attributes", {{"POSITION", document.vec3(kTriangle)}}}, {"material", 0}})}});
  document.root["materials"] = {{{"extensions",
                                  {{"KHR_materials_sheen", {{"sheenRoughnessFactor", 1}}},
                                   {"KHR_materials_emissive_strength", json::object()}}},
                                 {"extras", {{"extensions", {{"MY_tool", 1}}}}}}};
  const Mesh mesh = import("a.gltf", document.gltf());
  EXPECT_EQ(mesh.notes.size(), 1u);
  EXPECT_TRUE(has_note(mesh, "the extension KHR_materials_sheen is not read"));
  document.root["materials"][0] = {{"alphaMode", "GLASS"}};
  document.root["nodes"][0]["extensions"]["EXT_mesh_gpu_instancing"]["attributes"] = {
      {"TRANSLATION", document.vec3({0, 0, 1})}, {"_COLOR", document.vec3({1, 0, 0})}};
  const Mesh odd = import("a.gltf", document.gltf());
  EXPECT_EQ(odd.notes.size(), 2u);
  EXPECT_TRUE(has_note(odd, "the attribute _COLOR of instances is not read"));
  EXPECT_TRUE(has_note(odd, "the alphaMode GLASS is not known, OPAQUE is taken for it"));
}

// A decimal comma, or Fortran's exponent, loses vertices; the reason is named where nothing or little is
// left.
TEST_F(Variants, WordsThatAreNoNumbersAreNamed) {
  const std::string facet =
      "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1,5 0 0\nvertex 0 1 "
      "0\nendloop\nendfacet\n";
  const std::pair<const char*, std::string> files[] = {
      {"a.obj", "v 0 0 0\nv 1,5 0 0\nv 0 1 0\nf 1 2 3\n"},
      {"a.off", "OFF\n3 1 0\n0 0 0\n1,5 0 0\n0 1 0\n3 0 1 2\n"},
      {"a.ply",
       [] {
         std::string text = ply("", "");
         return text.replace(text.find("1 0 0"), 5, "1,5 0 0");
       }()},
      {"a.stl", facet + "endsolid\n"}};
  for (const auto& [name, bytes] : files) {
    const Refusal refused = refusal(name, bytes);
    EXPECT_EQ(refused.exit, Exit::kInvalid);
    EXPECT_NE(refused.message.find("1,5 and the like stand where numbers belong"), std::string::npos) << name;
  }
  const std::string corners = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0.5 # half\n";
  EXPECT_TRUE(import("a.obj", corners + "v nan nan nan\nv -1.#IND 0 -nan(ind)\nf 1 2 3\n").notes.empty());
  EXPECT_TRUE(has_note(import("a.obj", corners + "v 1.0D+00 0 0\nf 1 2 3\n"), "1.0D+00 and the like"));
}

TEST_F(Variants, NumbersTooSmallAreZeroAndTooLargeOnesAreRefused) {
  const std::string small = "0." + std::string(400, '0') + "1", large = "1" + std::string(400, '0') + ".5";
  for (const std::string& zero : {small, "-" + small, std::string("1e-400"), std::string("5.0E-999")}) {
    const Mesh mesh = import("a.obj", "v 0 0 " + zero + "\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    EXPECT_EQ(mesh.triangles.size(), 1u) << zero;
    EXPECT_EQ(corner(mesh, 0, 0), glm::vec3(0)) << zero;
  }
  for (const std::string& infinite : {large, std::string("1e400"), std::string("0.1E+999")})
    EXPECT_EQ(refusal("a.obj", "v 0 0 " + infinite + "\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").exit, Exit::kInvalid);
}

TEST_F(Variants, CloudsOfPointsAreRefusedAsSuch) {
  for (const auto& [name, bytes] :
       {std::pair{"a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\n"}, {"a.off", "OFF\n3 0 0\n0 0 0\n1 0 0\n0 1 0\n"}}) {
    const Refusal refused = refusal(name, bytes);
    EXPECT_EQ(refused.exit, Exit::kInvalid);
    EXPECT_NE(refused.message.find("3 vertices have no faces, they are a cloud of points"),
              std::string::npos);
  }
}

TEST_F(Variants, APointerOfGitLfsIsRefusedAsOne) {
  const std::string pointer = "version https://git-lfs.github.com/spec/v1\noid sha256:ab\nsize 12345\n";
  for (const char* name : {"a.obj", "a.glb", "a.ply", "a.stl", "a.off"}) {
    const Refusal refused = refusal(name, pointer);
    EXPECT_EQ(refused.exit, Exit::kInvalid);
    EXPECT_NE(refused.message.find("run git lfs pull"), std::string::npos) << name;
  }
}

TEST_F(Variants, StlNormalsOfZeroAskForTheTrianglesOwn) {
  std::string bytes(80, ' ');
  append(bytes, uint32_t{1});
  for (const float x : {0.f, 0.f, 0.f, 0.f, 0.f, 0.f, 0.f, 1.f, 0.f, 1.f, 0.f, 0.f}) append(bytes, x);
  bytes += std::string(2, '\0');
  const std::string text =
      "solid a\nfacet normal 0 0 0\nouter loop\nvertex 0 0 0\nvertex 0 1 0\nvertex 1 0 "
      "0\nendloop\nendfacet\n";
  for (const std::string& stl : {bytes, text}) {
    const Mesh mesh = import("a.stl", stl);
    EXPECT_EQ(mesh.normals[0][2], glm::vec3(0, 0, -1));
    EXPECT_TRUE(mesh.notes.empty());
  }
}

TEST_F(Variants, StlNormalsThatDoNotStandOnTheirFacets) {
  const auto facet = [&](const std::string& normal) {
    return import("a.stl", "solid a\nfacet normal " + normal +
                               "\nouter loop\nvertex 0 0 0\nvertex 0 1 0\nvertex 1 0 0\nendloop\nendfacet\n");
  };
  const Mesh along = facet("1 0 0");
  EXPECT_EQ(along.normals[0][0], glm::vec3(0, 0, -1));
  EXPECT_TRUE(has_note(along, "the normals of 1 facets do not stand on them"));
  for (const char* near : {"0 0 -3", "0.1 0 -1", "nan nan nan"})
    EXPECT_TRUE(facet(near).notes.empty()) << near;
  EXPECT_EQ(facet("0 0 1").normals[0][0], glm::vec3(0, 0, 1)) << "which side is out, the file says";
}

TEST_F(Variants, StlWithItsBytesInTheOtherOrder) {
  std::string bytes(80, ' ');
  append(bytes, __builtin_bswap32(2));
  const Refusal refused = refusal("a.stl", bytes + std::string(100, '\x3F'));
  EXPECT_EQ(refused.exit, Exit::kInvalid);
  EXPECT_NE(refused.message.find("bytes in the wrong order"), std::string::npos);
}

// Old programs end lines in CR; then an LF behind the header is data.
TEST_F(Variants, PlyBodiesThatBeginWithALineFeed) {
  std::string bytes = ply("", "");
  bytes.resize(bytes.find("end_header") + 11);
  bytes.replace(bytes.find("ascii"), 5, "binary_little_endian");
  for (char& c : bytes) c = c == '\n' ? '\r' : c;
  append(bytes, 0x3F80000Au);  // a float of 1 and its lowest byte an LF
  for (const float x : {0.f, 0.f, 2.f, 0.f, 0.f, 1.f, 1.f, 0.f}) append(bytes, x);
  bytes += '\3';
  for (const int i : {0, 1, 2}) append(bytes, i);
  const Mesh mesh = import("a.ply", bytes);
  ASSERT_EQ(mesh.triangles.size(), 1u);
  EXPECT_NEAR(corner(mesh, 0, 0).x, 1.0f, 1e-5f);
  EXPECT_TRUE(mesh.notes.empty());
}

TEST_F(Variants, PlyTypesThatItDoesNotKnowAreNamed) {
  EXPECT_NE(refusal("a.ply", ply("property int64 id\n", "7")).message.find("of type int64"),
            std::string::npos);
}

TEST_F(Variants, MapOptionsThatChangeNothingAreNoNotes) {
  write("red.png", rgba_png(1, 1, {255, 0, 0, 255}));
  const std::string obj = "mtllib a.mtl\nusemtl m\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nf 1/1 2/1 3/1\n";
  write("a.mtl", "newmtl m\nmap_Kd -s 1 1 1 -o 0 0 0 -t 0 0 0 -mm 0 1 -bm 1 -boost 0 -texres 512 red.png\n");
  const Mesh mesh = import("a.obj", obj);
  EXPECT_EQ(mesh.color(0).base_color, glm::vec3(1, 0, 0));
  EXPECT_TRUE(mesh.notes.empty());
  write("a.mtl", "newmtl m\nmap_Kd -boost 2 red.png\n");
  EXPECT_TRUE(has_note(import("a.obj", obj), "the option -boost of a map is not read"));
}

// -mm BASE GAIN is of the values that the picture stores; the same picture may be there without it.
TEST_F(Variants, MapRangesAreRead) {
  write("grey.png", rgba_png(1, 1, {100, 50, 200, 255}));
  const std::string square = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\n", f = "f 1/1 2/1 3/1\n";
  const auto linear = [](int stored) { return float(lsp::linear_of_srgb(stored / 255.0)); };
  write(
      "a.mtl",
      "newmtl m\nmap_Kd -mm 0.2 0.5 grey.png\nnewmtl n\nmap_Kd grey.png\nnewmtl o\nmap_d -mm 0.2 grey.png\n");
  const Mesh mesh =
      import("a.obj", "mtllib a.mtl\n" + square + "usemtl m\n" + f + "usemtl n\n" + f + "usemtl o\n" + f);
  EXPECT_TRUE(mesh.notes.empty()) << mesh.notes[0];
  ASSERT_EQ(mesh.triangles.size(), 3u);
  const glm::vec3 changed = mesh.color(0).base_color, plain = mesh.color(1).base_color;
  EXPECT_NEAR(changed.r, linear(101), 1e-5f);
  EXPECT_NEAR(changed.g, linear(76), 1e-5f);
  EXPECT_NEAR(changed.b, linear(151), 1e-5f);
  EXPECT_NEAR(plain.b, linear(200), 1e-5f);
  const float luma = (0.2126f * 151 + 0.7152f * 101 + 0.0722f * 251) / 255;
  EXPECT_NEAR(mesh.color(2).coverage, luma, 0.003f);
  write("a.mtl", "newmtl m\nmap_Kd -mm 0.5 1 grey.png\n");
  const Mesh clipped = import("a.obj", "mtllib a.mtl\n" + square + "usemtl m\n" + f);
  EXPECT_EQ(clipped.color(0).base_color.b, 1.0f);
  EXPECT_TRUE(has_note(clipped, "-mm takes values of the picture grey.png out of 0 to 1"));
}

TEST_F(Variants, MapOptionsInAnyCaseUnknownOnesAndNamesLikeThem) {
  write("red.png", rgba_png(1, 1, {255, 0, 0, 255}));
  write("-o.png", rgba_png(1, 1, {255, 0, 0, 255}));
  const auto notes_of = [&](const std::string& map) {
    write("a.mtl", "newmtl m\n" + map + "\n");
    const Mesh mesh =
        import("a.obj", "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nvt 0 0\nusemtl m\nf 1/1 2/1 3/1\n");
    EXPECT_EQ(mesh.color(0).base_color, glm::vec3(1, 0, 0)) << map;
    std::string notes;
    for (const std::string& note : mesh.notes) notes += note + "\n";
    return notes;
  };
  EXPECT_EQ(notes_of("map_Kd -S 2 2 1 -O 0.5 0 0 -CLAMP off red.png"), "");
  EXPECT_EQ(notes_of("map_Kd -o.png"), "");
  EXPECT_EQ(notes_of("map_Kd red.png # a comment"), "");
  EXPECT_EQ(notes_of("map_Kd \\\nred.png"), "");
  EXPECT_NE(notes_of("map_Kd -colorspace linear red.png").find("the option -colorspace of a map is not read"),
            std::string::npos);
}

TEST_F(Variants, MtlStatementsBeforeTheFirstMaterialAreNoted) {
  write("a.mtl", "# a comment\nKd 1 0 0\nnewmtl m\nKd 0 1 0\n");
  const Mesh mesh = import("a.obj", "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nusemtl m\nf 1 2 3\n");
  EXPECT_EQ(mesh.color(0).base_color, glm::vec3(0, 1, 0));
  ASSERT_EQ(mesh.notes.size(), 1u);
  EXPECT_TRUE(has_note(mesh, "statements before the first newmtl"));
}

TEST_F(Variants, MtlColoursBeyondTheirRangeAreCutWithANote) {
  write("a.mtl", "newmtl m\nKd 255 128 0\n");
  const Mesh mesh = import("a.obj", "mtllib a.mtl\nusemtl m\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
  EXPECT_EQ(mesh.color(0).base_color, glm::vec3(1, 1, 0));
  EXPECT_TRUE(has_note(mesh, "cut to what their range permits"));
}

// Exporters write the colour of a socket that a texture feeds, which is black.
TEST_F(Variants, MtlFactorsOfZeroBesideAMapAreOne) {
  write("red.png", rgba_png(1, 1, {255, 0, 0, 255}));
  write("a.mtl", "newmtl m\nKd 0 0 0\nmap_Kd red.png\nKe 0 0 0\nmap_Ke red.png\n");
  const Mesh mesh =
      import("a.obj", "mtllib a.mtl\nusemtl m\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nf 1/1 2/1 3/1\n");
  EXPECT_EQ(mesh.color(0).base_color, glm::vec3(1, 0, 0));
  EXPECT_EQ(mesh.color(0).emission, glm::vec3(1, 0, 0));
  EXPECT_EQ(mesh.notes.size(), 2u);
  EXPECT_TRUE(has_note(mesh, "Ke of 0 beside its map is taken as 1"));
}

TEST_F(Variants, ColoursALittleAboveOneAreNotBytes) {
  const Mesh mesh = import("a.ply", ply(rgb("float"), "1.2 0.50196 0"));
  expect_color(mesh, {1, kGrey128, 0});
  EXPECT_TRUE(has_note(mesh, "colours above 1 are cut to it"));
  EXPECT_TRUE(import("a.ply", ply(rgb("float"), "3 2 0")).notes.empty()) << "dark, of 255";
}

TEST_F(Variants, TextureCoordinatesThatAreNotFinite) {
  write("red.png", rgba_png(2, 1, {255, 0, 0, 255, 0, 0, 255, 255}));
  write("a.mtl", "newmtl m\nmap_Kd red.png\n");
  const Mesh mesh =
      import("a.obj", "mtllib a.mtl\nusemtl m\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt nan nan\nf 1/1 2/1 3/1\n");
  EXPECT_EQ(mesh.notes.size(), 1u);
  EXPECT_TRUE(has_note(mesh, "or no finite ones, its corner texel holds"));
  const Mesh far = import("a.obj",
                          "mtllib a.mtl\nusemtl m\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1e20 0\nvt 0 1\n"
                          "f 1/1 2/2 3/3\nf 1/1 2/2 3/1\n");
  for (size_t t = 0; t < 2; ++t)
    EXPECT_EQ(far.color(t).base_color, glm::vec3(0.5f, 0, 0.5f)) << "the mean of what it runs over so often";
}

TEST_F(Variants, OffTexturesBehindAColourAreNoAlpha) {
  const Mesh mesh = import("a.off", off("STCOFF", "255 0 0 0.5 0.5"));
  expect_color(mesh, {1, 0, 0});
  EXPECT_EQ(mesh.notes.size(), 1u);
  EXPECT_TRUE(has_note(mesh, "texture coordinates"));
}

}  // namespace
