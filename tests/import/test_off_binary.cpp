// Binary OFF: Geomview's words, highest byte first, and what OpenMesh writes.
// OpenMesh's vectors have no value at first, which is no fault of what follows.
#pragma GCC diagnostic ignored "-Wmaybe-uninitialized"
#include <bit>
#include <OpenMesh/Core/IO/MeshIO.hh>
#include <OpenMesh/Core/Mesh/PolyMesh_ArrayKernelT.hh>

#include "import/texture.h"
#include "mesh_files.h"

namespace {

using lsp::Exit;
using lsp::Mesh;
using namespace lsp_test;

class BinaryOff : public MeshFiles {};

// Words of 32 bits behind a line of text.
struct Words {
  std::string bytes;
  bool big_endian = true;

  Words& operator<<(uint32_t word) {
    append(bytes, big_endian ? __builtin_bswap32(word) : word);
    return *this;
  }
  Words& operator<<(int word) { return *this << uint32_t(word); }
  Words& operator<<(float word) { return *this << std::bit_cast<uint32_t>(word); }
  Words& floats(std::initializer_list<float> list) {
    for (const float value : list) *this << value;
    return *this;
  }
};

constexpr float kSquare[4][2] = {{0, 0}, {1, 0}, {1, 1}, {0, 1}};

// A square and a triangle, without anything but positions and corners.
std::string plain(const std::string& line, bool big_endian = true) {
  Words words{line, big_endian};
  words << 4 << 2 << 0;
  for (const auto& at : kSquare) words.floats({at[0], at[1], 3});
  words << 4 << 0 << 1 << 2 << 3 << 0;
  words << 3 << 0 << 1 << 3 << 0;
  return words.bytes;
}

TEST_F(BinaryOff, FacesOfAnySize) {
  for (const char* line :
       {"OFF BINARY\n", "OFF BINARY\r\n", "# made by hand\nOFF BINARY # now\n", "OFF binary\n"}) {
    const Mesh mesh = import("a.off", plain(line));
    ASSERT_EQ(mesh.triangles.size(), 3u) << line;
    EXPECT_NEAR(area(mesh), 1.5, 1e-6);
    EXPECT_EQ(corner(mesh, 1, 1), glm::vec3(1, 1, 3));
    EXPECT_TRUE(mesh.notes.empty());
    EXPECT_EQ(mesh.color(0).base_color, glm::vec3(0.8f));
  }
}

TEST_F(BinaryOff, TheOtherOrderOfBytesIsNoted) {
  const Mesh mesh = import("a.off", plain("OFF BINARY\n", false));
  ASSERT_EQ(mesh.triangles.size(), 3u);
  EXPECT_EQ(corner(mesh, 1, 1), glm::vec3(1, 1, 3));
  EXPECT_EQ(mesh.notes.size(), 1u);
  EXPECT_TRUE(has_note(mesh, "lowest byte first, and colours with their number of values"));
}

TEST_F(BinaryOff, EverythingThatAVertexMayHave) {
  Words words{"STCN4OFF BINARY\n"};
  words << 4 << 1 << 4;
  for (const auto& at : kSquare)
    words.floats({2 * at[0], 2 * at[1], 0, 2}).floats({0, 0, -1}).floats({1, 0.5f, 0, 1}).floats({9, 9});
  words << 4 << 0 << 1 << 2 << 3 << 0;
  const Mesh mesh = import("a.off", words.bytes);
  ASSERT_EQ(mesh.triangles.size(), 2u);
  EXPECT_EQ(corner(mesh, 0, 1), glm::vec3(1, 0, 0)) << "by the fourth coordinate";
  EXPECT_EQ(mesh.normals[0][0], glm::vec3(0, 0, -1));
  EXPECT_NEAR(mesh.color(0).base_color.g, lsp::linear_of_srgb(0.5), 1e-5);
  EXPECT_EQ(mesh.notes.size(), 1u);
  EXPECT_TRUE(has_note(mesh, "texture coordinates"));
}

TEST_F(BinaryOff, ColoursOfFaces) {
  Words words{"OFF BINARY\n"};
  words << 4 << 4 << 0;
  for (const auto& at : kSquare) words.floats({at[0], at[1], 0});
  words << 3 << 0 << 1 << 2 << 3, words.floats({1, 0, 0});
  words << 3 << 0 << 2 << 3 << 4, words.floats({0, 1, 0, 0.5f});
  words << 3 << 1 << 2 << 3 << 0;
  words << 3 << 0 << 1 << 3 << 1, words.floats({7});
  const Mesh mesh = import("a.off", words.bytes);
  ASSERT_EQ(mesh.triangles.size(), 4u);
  EXPECT_EQ(mesh.color(0).base_color, glm::vec3(1, 0, 0));
  EXPECT_EQ(mesh.color(1).base_color, glm::vec3(0, 1, 0));
  EXPECT_EQ(mesh.color(2).base_color, glm::vec3(1)) << "has none";
  EXPECT_EQ(mesh.notes.size(), 2u);
  EXPECT_TRUE(has_note(mesh, "by their number in a table"));
  EXPECT_TRUE(has_note(mesh, "alpha"));
}

TEST_F(BinaryOff, WhatOpenMeshWrites) {
  struct Traits : OpenMesh::DefaultTraits {
    VertexAttributes(OpenMesh::Attributes::Normal | OpenMesh::Attributes::Color);
    FaceAttributes(OpenMesh::Attributes::Color);
  };
  using Poly = OpenMesh::PolyMesh_ArrayKernelT<Traits>;
  using Options = OpenMesh::IO::Options;
  Poly poly;
  std::vector<Poly::VertexHandle> corners;
  for (const auto& at : kSquare) {
    corners.push_back(poly.add_vertex({at[0], at[1], 3}));
    poly.set_normal(corners.back(), {0, 0, -1});
    poly.set_color(corners.back(), {255, 0, 128});
  }
  poly.set_color(poly.add_face(corners), {255, 0, 128});
  const auto written = [&](Options options) {
    EXPECT_TRUE(OpenMesh::IO::write_mesh(poly, (folder_ / "m.off").string(), options + Options::Binary));
    const std::filesystem::path path = folder_ / "m.off";
    return lsp::import_meshes({&path, 1}, {});
  };
  const glm::vec3 right(1, 0, lsp::linear_of_srgb(128 / 255.0));
  for (const auto& [options, colored] :
       {std::pair{Options(), false},
        {Options(Options::VertexNormal), false},
        {Options(Options::VertexColor), true},
        {Options(Options::FaceColor), true},
        {Options(Options::VertexColor) + Options::ColorFloat, true},
        {Options(Options::VertexNormal) + Options::VertexColor + Options::ColorAlpha, true}}) {
    const Mesh mesh = written(options);
    SCOPED_TRACE(int(Options::value_type(options)));
    ASSERT_EQ(mesh.triangles.size(), 2u);
    EXPECT_EQ(corner(mesh, 0, 1), glm::vec3(1, 0, 3));
    EXPECT_TRUE(has_note(mesh, "as OpenMesh writes them, lowest byte first"));
    for (int k = 0; k < 3; ++k)
      EXPECT_NEAR(mesh.color(0).base_color[k], colored ? right[k] : 0.8f, 1e-3f) << k;
    const glm::vec3 normal(0, 0, options.vertex_has_normal() ? -1 : 1);
    EXPECT_EQ(mesh.normals[0][0], normal);
  }
}

TEST_F(BinaryOff, Refusals) {
  const auto refused = [&](const std::string& bytes, const char* why) {
    const Refusal refusal = MeshFiles::refusal("a.off", bytes, {.memory_limit = 64 << 20});
    EXPECT_EQ(refusal.exit, Exit::kInvalid) << refusal.message;
    EXPECT_NE(refusal.message.find(why), std::string::npos) << refusal.message;
  };
  const std::string good = plain("OFF BINARY\n");
  refused("OFF BINARY\n", "in either order of bytes");
  refused("OFF BINARY\n1 2 3\n", "in either order of bytes");
  refused((Words{"OFF BINARY\n"} << ~0u << ~0u << 0).bytes, "in either order of bytes");
  refused((Words{"OFF BINARY\n"} << 0 << 1 << 0 << ~0u).bytes, "ends inside a face");
  for (size_t cut = 1; cut < 36; ++cut) refused(good.substr(0, good.size() - cut), "ends inside a face");
  EXPECT_EQ(MeshFiles::refusal("a.off", "nOFF BINARY\n").exit, Exit::kUnsupported);
  // What is whole is read, and the rest is said.
  const Mesh tail = import("a.off", good + "tail");
  EXPECT_EQ(tail.triangles.size(), 3u);
  EXPECT_TRUE(has_note(tail, "4 bytes after the last face are not read"));
  std::string wrong = good;
  wrong[wrong.size() - 5] = 99;  // a corner
  EXPECT_EQ(import("a.off", wrong).rejected.out_of_range, 1u);
}

}  // namespace
