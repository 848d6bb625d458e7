// STL and OFF: each feature and each way to go wrong, on small files.
#include "import/texture.h"
#include "text_files.h"

namespace {

using lsp::Exit;
using lsp::Mesh;
using namespace lsp_test;

class Stl : public MeshFiles {};
class Off : public MeshFiles {};

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
  const Refusal four = refusal("a.off", "nOFF\n4\n4 1 0\n");
  EXPECT_EQ(four.exit, Exit::kUnsupported);
  EXPECT_NE(four.message.find("of 4 dimensions; give one with three"), four.message.npos);
  EXPECT_EQ(import("a.off", "nOFF 3\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n").triangles.size(), 1u);
  EXPECT_EQ(import("a.off", "4nOFF\n3\n3 1 0\n0 0 0 1\n2 0 0 2\n0 1 0 1\n3 0 1 2\n").positions[1],
            glm::vec3(1, 0, 0));
  EXPECT_EQ(refusal("a.off", "OFF\n2000000000 1 0\n0 0 0\n").exit, Exit::kInvalid);
  EXPECT_EQ(refusal("a.off", "OFF\n1 1 0\n0 0 0\n2000000000 0 0 0\n").exit, Exit::kInvalid);
  EXPECT_EQ(refusal("a.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n").exit, Exit::kInvalid);
  EXPECT_EQ(refusal("a.off", "solid\n").exit, Exit::kInvalid);
  const Refusal crowded = refusal("a.off", "OFF\n3 1 0\n0 0 0 1 0 0 0 1 0\n3 0 1 2\n");
  EXPECT_NE(crowded.message.find("give each vertex a line of its own"), crowded.message.npos)
      << crowded.message;
}

}  // namespace
