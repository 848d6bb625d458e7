// OBJ, PLY, STL and OFF against OpenMesh's readers, an implementation that shares nothing with ours: where
// both find as many triangles in a file, these must be the same ones in the same order.
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <iostream>
#include <nlohmann/json.hpp>
#include <OpenMesh/Core/IO/importer/BaseImporter.hh>
#include <OpenMesh/Core/IO/IOManager.hh>
#include <OpenMesh/Core/IO/reader/OBJReader.hh>
#include <OpenMesh/Core/IO/reader/OFFReader.hh>
#include <OpenMesh/Core/IO/reader/PLYReader.hh>
#include <OpenMesh/Core/IO/reader/STLReader.hh>

#include "import/import.h"
#include "lsp/program.h"

namespace {

using namespace OpenMesh;

// Takes vertices and faces as they come; OpenMesh's own meshes would refuse faces at non-manifold edges.
class Collector : public IO::BaseImporter {
 public:
  std::vector<Vec3f> vertices;
  std::vector<VHandles> faces;

  VertexHandle add_vertex(const Vec3f& point) override {
    vertices.push_back(point);
    return VertexHandle(int(vertices.size()) - 1);
  }
  VertexHandle add_vertex() override { return add_vertex(Vec3f(0, 0, 0)); }
  FaceHandle add_face(const VHandles& corners) override {
    faces.push_back(corners);
    return FaceHandle(int(faces.size()) - 1);
  }
  void set_point(VertexHandle vertex, const Vec3f& point) override {
    vertices.at(size_t(vertex.idx())) = point;
  }
  size_t n_vertices() const override { return vertices.size(); }
  size_t n_faces() const override { return faces.size(); }
  size_t n_edges() const override { return 0; }

  HalfedgeHandle add_edge(VertexHandle, VertexHandle) override { return HalfedgeHandle(); }
  FaceHandle add_face(HalfedgeHandle) override { return FaceHandle(); }
  void add_face_texcoords(FaceHandle, VertexHandle, const std::vector<Vec2f>&) override {}
  void add_face_texcoords(FaceHandle, VertexHandle, const std::vector<Vec3f>&) override {}
  void set_face_texindex(FaceHandle, int) override {}
  void set_halfedge(VertexHandle, HalfedgeHandle) override {}
  void set_normal(VertexHandle, const Vec3f&) override {}
  void set_normal(VertexHandle, const Vec3d&) override {}
  void set_normal(FaceHandle, const Vec3f&) override {}
  void set_normal(FaceHandle, const Vec3d&) override {}
  void set_color(VertexHandle, const Vec3uc&) override {}
  void set_color(VertexHandle, const Vec4uc&) override {}
  void set_color(VertexHandle, const Vec3f&) override {}
  void set_color(VertexHandle, const Vec4f&) override {}
  void set_color(EdgeHandle, const Vec3uc&) override {}
  void set_color(EdgeHandle, const Vec4uc&) override {}
  void set_color(EdgeHandle, const Vec3f&) override {}
  void set_color(EdgeHandle, const Vec4f&) override {}
  void set_color(FaceHandle, const Vec3uc&) override {}
  void set_color(FaceHandle, const Vec4uc&) override {}
  void set_color(FaceHandle, const Vec3f&) override {}
  void set_color(FaceHandle, const Vec4f&) override {}
  void set_texcoord(VertexHandle, const Vec2f&) override {}
  void set_texcoord(HalfedgeHandle, const Vec2f&) override {}
  void set_texcoord(VertexHandle, const Vec3f&) override {}
  void set_texcoord(HalfedgeHandle, const Vec3f&) override {}
  void set_status(VertexHandle, const Attributes::StatusInfo&) override {}
  void set_status(HalfedgeHandle, const Attributes::StatusInfo&) override {}
  void set_status(EdgeHandle, const Attributes::StatusInfo&) override {}
  void set_status(FaceHandle, const Attributes::StatusInfo&) override {}
  void set_next(HalfedgeHandle, HalfedgeHandle) override {}
  void set_face(HalfedgeHandle, FaceHandle) override {}
  void request_face_texcoords2D() override {}
  void add_texture_information(int, std::string) override {}
};

// Equal but for the rounding of two ways to read a decimal number.
bool same(const glm::vec3& a, const Vec3f& b) {
  for (unsigned k = 0; k < 3; ++k) {
    if (std::abs(a[int(k)] - b[k]) > 1.5e-7f * std::abs(b[k])) return false;
  }
  return true;
}

TEST(Scenes, TextFormatsAgreeWithOpenMesh) {
  const std::filesystem::path scenes = LSP_SCENES_DIR;
  std::ifstream stream(scenes / "counts.json");
  if (!stream) GTEST_SKIP() << "no scenes at " << scenes;
  const nlohmann::json all = nlohmann::json::parse(stream);
  IO::OBJReader(), IO::PLYReader(), IO::STLReader(), IO::OFFReader();
  size_t files = 0, compared = 0, triangles = 0;
  for (const auto& [name, counts] : all.items()) {
    std::string extension = std::filesystem::path(name).extension().string();
    for (char& c : extension) c = char(std::tolower(c));
    // Large files add time and nothing else; two of them are read.
    const bool large = counts.value("tris", uint64_t{0}) > 100'000 && !name.starts_with("paper/");
    // Comments before an OFF file's counts make OpenMesh take them from uninitialised memory (minutes,
    // gigabytes); a PLY face with a second list shifts all faces after it.
    const bool unreadable = name.ends_with("/comments.off") || name.ends_with("/whitespace.off") ||
                            name.ends_with("/cube-shuffled.off") || name.ends_with("/fuze_ascii.ply");
    if (unreadable || extension == ".gltf" || extension == ".glb" || large) continue;
    SCOPED_TRACE(name);
    const std::filesystem::path path = scenes / name;
    lsp::Mesh mesh;
    try {
      mesh = lsp::import_meshes({&path, 1}, {});
    } catch (const lsp::Failure&) {
      continue;
    }
    ++files;
    Collector other;
    IO::Options options;
    std::cerr.setstate(std::ios::failbit);  // it complains at length about what it does not know
    const bool read = IO::IOManager().read(path.string(), other, options);
    std::cerr.clear();
    // Only lists of triangles: polygons are cut in different ways.
    bool comparable = read && other.faces.size() == mesh.primitive_count;
    for (const auto& face : other.faces) comparable = comparable && face.size() == 3;
    if (!comparable) continue;
    ++compared;
    triangles += mesh.triangles.size();
    size_t different = 0;
    for (size_t t = 0; t < mesh.triangles.size(); ++t) {
      const auto& face = other.faces[mesh.primitives[t]];
      for (size_t i = 0; i < 3; ++i) {
        const auto vertex = size_t(face[i].idx());
        const glm::vec3 position(glm::dvec3(mesh.positions[mesh.triangles[t][int(i)]]) + mesh.origin);
        different += vertex >= other.vertices.size() || !same(position, other.vertices[vertex]);
      }
    }
    EXPECT_EQ(different, 0u);
  }
  std::cout << compared << " of " << files << " files comparable, " << triangles << " triangles\n";
  EXPECT_GT(compared, 100u);
}

}  // namespace
