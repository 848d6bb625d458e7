// What all formats of meshes share: normals, welding, origins, numbers, refusals.
#include <bit>

#include "text_files.h"

namespace {

using lsp::Exit;
using lsp::Mesh;
using namespace lsp_test;

class AnyFormat : public MeshFiles {};

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
    stl += "facet normal 0 -1 0.02\nouter loop\n";
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

// Two houses a thousand kilometres apart have no origin that serves both.
TEST_F(AnyFormat, TrianglesThatSinglePrecisionBendsAreNoted) {
  const std::string near = "v 0 0 0\nv 100 0 0\nv 0 100 0\nf -3 -2 -1\n";
  const auto far = [](const char* edge) {
    const std::string x = "v 5400000.125 ", moved = "v 540000" + std::string(edge);
    return x + "0 0\n" + moved + " 0 0\n" + x + "1 0\nf -3 -2 -1\n";
  };
  const Mesh bent = import("a.obj", near + far("1.25"));
  EXPECT_EQ(bent.origin, glm::dvec3(0));
  EXPECT_EQ(bent.triangles.size(), 2u);
  ASSERT_EQ(bent.notes.size(), 1u);
  EXPECT_EQ(bent.notes[0].find("1 triangles keep little of their shape"), 0u) << bent.notes[0];
  EXPECT_TRUE(import("b.obj", near + far("5.125")).notes.empty()) << "0.125 of 5";
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

// No prefix of a file and no changed byte may do more than be refused.
std::string binary_off() {
  std::string bytes = "COFF BINARY\n";
  const auto add = [&](uint32_t word) { append(bytes, __builtin_bswap32(word)); };
  for (const uint32_t count : {3u, 1u, 0u}) add(count);
  for (const float value : {0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0, 0, 1, 0, 1, 0, 1, 0, 0, 1})
    add(std::bit_cast<uint32_t>(value));
  for (const uint32_t word : {3u, 0u, 1u, 2u, 0u}) add(word);
  return bytes;
}

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
