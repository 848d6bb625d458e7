// Files that meshes name in other ways than the standards say.
#include "gltf_builder.h"
#include "png_bytes.h"

namespace {

using lsp::Exit;
using lsp::Mesh;
using namespace lsp_test;

// A triangle whose colour is the picture by that URI.
Document textured(const std::string& uri) {
  Document document;
  document.node(
      {{"mesh", document.mesh({{"attributes", {{"POSITION", document.vec3(kTriangle)}}}, {"material", 0}})}});
  document.root["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_0"] =
      document.values<float>({0, 0, 1, 0, 0, 1}, kFloat, "VEC2", 2);
  document.root["images"] = {{{"uri", uri}}};
  document.root["textures"] = {{{"source", 0}}};
  document.root["materials"] = {{{"pbrMetallicRoughness", {{"baseColorTexture", {{"index", 0}}}}}}};
  return document;
}

const glm::vec3 kRed(1, 0, 0);

class FileNames : public MeshFiles {
 protected:
  void SetUp() override { write("Red Wall.PNG", rgba_png(1, 1, {255, 0, 0, 255})); }
  Mesh with_picture(const std::string& uri) { return import("a.gltf", textured(uri).gltf()); }
  Mesh with_library(const std::string& mtl, const std::string& line = "mtllib a.mtl") {
    write("a.mtl", "newmtl m\n" + mtl);
    return import("a.obj", line + "\nusemtl m\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nf 1/1 2/1 3/1\n");
  }
};

TEST_F(FileNames, GltfPicturesAreFoundBesideTheMeshAndInAnyCase) {
  for (const char* uri : {"Red%20Wall.PNG", "./Red%20Wall.PNG"}) {
    EXPECT_EQ(with_picture(uri).color(0).base_color, kRed) << uri;
    EXPECT_TRUE(with_picture(uri).notes.empty()) << uri;
  }
  for (const char* uri : {"red%20wall.png", "Textures/Red%20Wall.PNG", "textures/RED%20WALL.png",
                          "C:\\Users\\me\\red wall.png"}) {
    EXPECT_EQ(with_picture(uri).color(0).base_color, kRed) << uri;
    EXPECT_TRUE(has_note(with_picture(uri), "is not there, Red Wall.PNG is read in its place")) << uri;
  }
  EXPECT_EQ(with_picture("file://" + (folder_ / "Red%20Wall.PNG").string()).color(0).base_color, kRed);
  EXPECT_TRUE(has_note(with_picture("blue.png"), "factors hold without it"));
}

TEST_F(FileNames, AFileOfTheRightCaseWins) {
  write("red wall.png", rgba_png(1, 1, {0, 255, 0, 255}));
  EXPECT_EQ(with_picture("red%20wall.png").color(0).base_color, glm::vec3(0, 1, 0));
  EXPECT_EQ(with_picture("RED%20WALL.PNG").color(0).base_color, kRed) << "the first in order";
}

TEST_F(FileNames, FoldersToo) {
  std::filesystem::create_directory(folder_ / "Maps");
  write("Maps/Green.png", rgba_png(1, 1, {0, 255, 0, 255}));
  EXPECT_EQ(with_picture("maps/green.PNG").color(0).base_color, glm::vec3(0, 1, 0));
  EXPECT_EQ(with_library("map_Kd maps\\green.png\n").color(0).base_color, glm::vec3(0, 1, 0));
}

TEST_F(FileNames, DataUrisAsPeopleWriteThem) {
  const std::string body = base64(rgba_png(1, 1, {255, 0, 0, 255}));
  std::string broken, encoded;
  for (const char c : body) {
    broken += c;
    if (broken.size() % 20 == 0) broken += "\r\n ";
    encoded += c == '+' ? "%2B" : c == '/' ? "%2f" : c == '=' ? "%3D" : std::string(1, c);
  }
  const std::string bare = body.substr(0, body.find('='));
  for (const std::string& uri :
       {"data:image/png;base64," + bare, "DATA:image/png;BASE64," + body, "data:;base64," + broken,
        "data:image/png;charset=utf-8;base64," + encoded}) {
    const Mesh mesh = with_picture(uri);
    EXPECT_EQ(mesh.color(0).base_color, kRed) << uri;
    EXPECT_TRUE(mesh.notes.empty()) << uri;
  }
  EXPECT_TRUE(has_note(with_picture("data:image/png;base64,!!"), "not base64"));
  EXPECT_TRUE(has_note(with_picture("data:image/png"), "without a comma"));
  EXPECT_TRUE(has_note(with_picture("data:image/png,abc"), "is of no format known here"));
}

TEST_F(FileNames, DataUrisInPercentCodes) {
  std::string uri = "data:image/png,";
  constexpr char kDigits[] = "0123456789abcdef";
  for (const char c : rgba_png(1, 1, {255, 0, 0, 255})) {
    const bool plain = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z');
    uri += plain ? std::string(1, c) : std::string{'%', kDigits[uint8_t(c) >> 4], kDigits[uint8_t(c) & 15]};
  }
  const Mesh mesh = with_picture(uri);
  EXPECT_EQ(mesh.color(0).base_color, kRed);
  EXPECT_TRUE(mesh.notes.empty());
}

TEST_F(FileNames, UrisWithSchemesMachinesQueriesAndFragments) {
  const std::string path = (folder_ / "Red%20Wall.PNG").string();
  for (const char* start : {"file://", "FILE://", "file:", "file://localhost"}) {
    const Mesh mesh = with_picture(start + path);
    EXPECT_EQ(mesh.color(0).base_color, kRed) << start;
    EXPECT_TRUE(mesh.notes.empty()) << start;
  }
  for (const char* uri : {"Red%20Wall.PNG?v=1", "Red%20Wall.PNG#part"}) {
    EXPECT_EQ(with_picture(uri).color(0).base_color, kRed) << uri;
    EXPECT_TRUE(has_note(with_picture(uri), "is no valid one")) << uri;
  }
  write("a?v=1", rgba_png(1, 1, {0, 255, 0, 255}));
  EXPECT_EQ(with_picture("a?v=1").color(0).base_color, glm::vec3(0, 1, 0)) << "a file by the whole name";
}

TEST_F(FileNames, MaterialLibrariesAndTheirPicturesInAnyCaseAndInQuotes) {
  for (const char* map : {"map_Kd Red Wall.PNG\n", "map_Kd \"Red Wall.PNG\"\n",
                          "map_Kd D:\\art\\Red Wall.PNG \r\n", "MAP_KD -clamp on Red Wall.PNG\n"}) {
    EXPECT_EQ(with_library(map).color(0).base_color, kRed) << map;
    const bool elsewhere = std::string_view(map).find("art") != std::string_view::npos;
    EXPECT_EQ(has_note(with_library(map), "the picture D:\\art\\Red Wall.PNG is read from"), elsewhere)
        << map;
    EXPECT_EQ(with_library(map).notes.size(), elsewhere ? 1u : 0u) << map;
  }
  EXPECT_EQ(with_library("map_Kd RED WALL.png\n").color(0).base_color, kRed);
  EXPECT_TRUE(has_note(with_library("map_Kd RED WALL.png\n"), "the picture RED WALL.png is read from"));
  EXPECT_EQ(with_library("KD 1 0 0\n", "mtllib \"a.mtl\"").color(0).base_color, kRed);
  const Mesh any_case = with_library("Kd 1 0 0\n", "mtllib A.MTL");
  EXPECT_EQ(any_case.color(0).base_color, kRed);
  EXPECT_TRUE(has_note(any_case, "the material library A.MTL is read from"));
  EXPECT_EQ(any_case.sources[0].size(), 2u) << "it is a source";
}

TEST_F(FileNames, PicturesBesideTheMeshWhereTheLibraryIsElsewhere) {
  std::filesystem::create_directory(folder_ / "mats");
  std::filesystem::create_directory(folder_ / "tex");
  write("tex/red.png", rgba_png(1, 1, {255, 0, 0, 255}));
  write("mats/a.mtl", "newmtl m\nKd 1 1 1\nmap_Kd tex/red.png\n");
  const Mesh mesh =
      import("a.obj", "mtllib mats/a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nusemtl m\nf 1/1 2/1 3/1\n");
  EXPECT_EQ(mesh.color(0).base_color, kRed);
  EXPECT_TRUE(has_note(mesh, "the picture tex/red.png is read from"));
  EXPECT_EQ(mesh.sources[0].size(), 3u);
}

TEST_F(FileNames, NamesInACodePageAreNoReasonToRefuseADocument) {
  Document document;
  document.node({{"mesh", document.mesh({{"attributes", {{"POSITION", document.vec3(kTriangle)}}}})},
                 {"name", "Tuer"}});
  std::string text = document.gltf();
  text.replace(text.find("Tuer"), 4, "T\xFCr");
  const Mesh mesh = import("a.gltf", text);
  EXPECT_EQ(mesh.triangles.size(), 1u);
  EXPECT_TRUE(has_note(mesh, "no valid UTF-8"));
}

}  // namespace
