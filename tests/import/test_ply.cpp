// PLY: each feature and each way to go wrong, on small files.
#include "import/texture.h"
#include "png_bytes.h"
#include "text_files.h"

namespace {

using lsp::Exit;
using lsp::Mesh;
using namespace lsp_test;

class Ply : public MeshFiles {};

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
  const Mesh unsigned_strips =
      import("a.ply",
             "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
             "element tristrips 1\nproperty list uchar uint vertex_indices\nend_header\n"
             "0 0 0\n1 0 0\n0 1 0\n1 1 0\n7 0 1 2 4294967295 1 3 2\n");
  EXPECT_EQ(unsigned_strips.triangles.size(), 2u);
  EXPECT_EQ(unsigned_strips.primitive_count, 2u);
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

}  // namespace
