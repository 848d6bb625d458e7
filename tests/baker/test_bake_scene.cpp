// lsp-bake --instances: scenes whose rays are to hit what those of one bake of everything hit.

#include <cmath>
#include <cstdlib>
#include <iterator>
#include <map>
#include <random>
#include <sstream>

#include "../import/gltf_builder.h"
#include "lsp/instanced_scene.hpp"
#include "shell.h"

namespace lsp_test {
namespace {

namespace fs = std::filesystem;
using namespace lsp;

class BakeScene : public MeshFiles {
 protected:
  int run(const std::string& program, const std::string& arguments) {
    return lsp::test::shell(program + " " + arguments + " >out 2>err", folder_);
  }
  std::string read(const std::string& name) const { return lsp::test::read_bytes(folder_ / name); }
  std::string path(const std::string& name) const { return (folder_ / name).string(); }
  // Exact trees alone: what the rays hit is the question here.
  json bake_scene(const std::string& inputs, const std::string& options = "") {
    EXPECT_EQ(run("lsp-bake", inputs + " --instances -o scene.json --json --no-line-spaces " + options), 0)
        << read("err");
    return json::parse(read("out"));
  }
  std::vector<std::string> files() const {
    std::vector<std::string> names;
    for (const auto& entry : fs::directory_iterator(folder_)) {
      const std::string name = entry.path().filename().string();
      if (name != "out" && name != "err") names.push_back(name);
    }
    std::sort(names.begin(), names.end());
    return names;
  }
  void expect_the_hits_of_one_bake(const std::string& inputs, double reach, size_t hits_at_least);
};

// A pyramid that no symmetry maps to itself, of two primitives: four sides, and two triangles below.
int add_pyramid(Document& d, const std::string& name) {
  const std::vector<float> sides = {-1, 0, -1, 1, 0, -1, 1, 0, 1, -1, 0, 1, 0.4f, 2, 0.2f};
  const int positions = d.vec3(sides);
  const int up = d.indices<uint16_t>({0, 4, 1, 1, 4, 2, 2, 4, 3, 3, 4, 0}, kUshort);
  const int down = d.indices<uint16_t>({0, 1, 2, 0, 2, 3}, kUshort);
  const int mesh = d.mesh({{"attributes", {{"POSITION", positions}}}, {"indices", up}});
  d.root["meshes"][size_t(mesh)]["primitives"].push_back(
      {{"attributes", {{"POSITION", positions}}}, {"indices", down}});
  d.root["meshes"][size_t(mesh)]["name"] = name;
  return mesh;
}

int add_strip(Document& d, const std::string& name) {
  const int mesh = d.mesh({{"attributes", {{"POSITION", d.vec3(kStrip)}}}, {"mode", 5}});
  d.root["meshes"][size_t(mesh)]["name"] = name;
  return mesh;
}

// Nested, mirrored, sheared, scaled by axis, and instances by the extension: no two of them touch.
Document many_places() {
  Document d;
  const int pyramid = add_pyramid(d, "Pyramid"), strip = add_strip(d, "Strip");
  const double half = std::sqrt(0.5);
  const int leaf = d.node({{"mesh", strip}, {"name", "leaf"}, {"translation", {0, 3, 0}}});
  const int branch = d.node({{"mesh", pyramid},
                             {"children", {leaf}},
                             {"rotation", {half, 0, 0, half}},
                             {"scale", {1, 2, 0.5}},
                             {"translation", {4, 0, 0}}});
  const int tree = d.node({{"children", {branch}}, {"rotation", {0, 0.6, 0, 0.8}}, {"name", "tree"}});
  const int mirrored = d.node({{"mesh", pyramid}, {"scale", {-1, 1, 1}}, {"translation", {-5, 0, 0}}});
  const int sheared =
      d.node({{"mesh", pyramid}, {"matrix", {1, 0, 0, 0, 0.7, 1, 0, 0, 0, 0.3, 2, 0, 0, -6, 0, 1}}});
  const int offsets = d.vec3({0, 6, -2, 3, 6, 0, -3, 6, 1, 0, 9, 4}),
            scales = d.vec3({1, 1, 1, 0.5f, 0.5f, -0.5f, 1, 0.2f, 1, 2, 1, 1});
  const int turns =
      d.values<float>({0, 0, 0, 1, 0, 1, 0, 0, 0.5f, 0.5f, 0.5f, 0.5f, 0, 0, 0.6f, 0.8f}, kFloat, "VEC4", 4);
  const int copies =
      d.node({{"mesh", pyramid},
              {"name", "copies"},
              {"rotation", {0, 0, 0.1, 0.99498743710662}},
              {"extensions",
               {{"EXT_mesh_gpu_instancing",
                 {{"attributes", {{"TRANSLATION", offsets}, {"ROTATION", turns}, {"SCALE", scales}}}}}}}});
  d.root["extensionsUsed"] = {"EXT_mesh_gpu_instancing"};
  d.root["scenes"] = {{{"nodes", {tree, mirrored, sheared, copies}}}};
  d.root["scene"] = 0;
  return d;
}

// Rays from outside through the middle, and what they hit in the scene and in one bake of it all.
void BakeScene::expect_the_hits_of_one_bake(const std::string& inputs, double reach, size_t hits_at_least) {
  ASSERT_EQ(run("lsp-bake", inputs + " -o one.lsp --no-line-spaces --quiet"), 0) << read("err");
  const json report = bake_scene(inputs);
  const SceneFile one(path("one.lsp"));
  const InstancedScene scene(path("scene.json"));
  double origin[3];
  lsp_scene_origin(&one.scene(), origin);
  std::vector<uint64_t> first;  // of each instance: what its first triangle is in import order
  uint64_t triangles = 0;
  for (uint32_t i = 0; i < scene.instances().size(); ++i) {
    first.push_back(triangles);
    triangles += report["assets"][scene.instances()[i].asset]["triangles"]["read"].get<uint64_t>();
  }
  EXPECT_EQ(triangles, one.header().primitive_count);

  std::mt19937 random(5);
  const auto number = [&] { return float((random() / 4294967296.0 * 2 - 1) * reach); };
  std::vector<LspRay> rays(20000), moved;
  for (LspRay& ray : rays) {
    ray.origin = {number(), number(), number()};
    ray.direction = {number() - ray.origin.x, number() - ray.origin.y, number() - ray.origin.z};
    ray.tmin = 0;
    ray.tmax = INFINITY;
    moved.push_back(ray);
    moved.back().origin.x += float(origin[0] - scene.origin()[0]);
    moved.back().origin.y += float(origin[1] - scene.origin()[1]);
    moved.back().origin.z += float(origin[2] - scene.origin()[2]);
  }
  std::vector<LspHit> expected(rays.size()), hits(rays.size());
  const lsp_trace_options exact = {0, 0, 0, 0};
  ASSERT_EQ(lsp_trace(&one.scene(), &exact, rays.data(), expected.data(), rays.size(), nullptr, nullptr),
            LSP_OK);
  scene.instances().trace({0, 0}, 255, moved, hits);
  size_t both = 0, different = 0;
  for (size_t i = 0; i < rays.size(); ++i) {
    if (hits[i].primitive == LSP_NONE || expected[i].primitive == LSP_NONE) {
      different += hits[i].primitive != expected[i].primitive;
      continue;
    }
    ++both;
    different += first[LSP_HIT_INSTANCE(hits[i])] + hits[i].primitive != expected[i].primitive ||
                 !(std::abs(hits[i].t - expected[i].t) <= 2e-5f * (1 + expected[i].t));
    const lsp_float3 n = hits[i].normal, m = expected[i].normal;
    if (!(n.x * m.x + n.y * m.y + n.z * m.z > 0.9999f)) ++different;
  }
  EXPECT_GT(both, hits_at_least);
  EXPECT_LE(different, both / 500) << "more than rays through an edge";
}

TEST_F(BakeScene, RaysHitWhatTheyHitInOneBake) {
  write("places.gltf", many_places().gltf());
  expect_the_hits_of_one_bake("places.gltf", 12, 200);
  const json scene = json::parse(read("scene.json"));
  EXPECT_EQ(scene["assets"], json({"scene.Pyramid.lsp", "scene.Strip.lsp"}));
  ASSERT_EQ(scene["instances"].size(), 8u);
  EXPECT_EQ(scene["instances"][1]["name"], "leaf");
  EXPECT_EQ(scene["instances"][1]["asset"], 1);
  EXPECT_EQ(scene["instances"][7]["name"], "copies");
}

TEST_F(BakeScene, PlacesFarAwayAreAboutAnOrigin) {
  Document d = many_places();
  d.root["nodes"].push_back(
      {{"children", d.root["scenes"][0]["nodes"]}, {"translation", {5e6 + 0.123, -3e7, 0.37}}});
  d.root["scenes"][0]["nodes"] = {d.root["nodes"].size() - 1};
  write("far.gltf", d.gltf());
  expect_the_hits_of_one_bake("far.gltf", 12, 200);
  // A mesh whose own positions are far away as well.
  const std::string tail = " 1 0\nv 40000001.25 3 0\nv 40000000.5 1 2.5\nf 1 2 3\n";
  write("map.obj", "v 40000000.25" + tail);
  write("moved.obj", "v 40000000.75" + tail);
  expect_the_hits_of_one_bake("map.obj moved.obj", 3, 100);
  EXPECT_EQ(json::parse(read("scene.json")).count("origin"), 1u);
}

// A room of 512 things of three shapes.
TEST_F(BakeScene, EachMeshIsBakedOnce) {
  Document d;
  const int meshes[] = {add_pyramid(d, "../Cone no. 1"), add_pyramid(d, "cone/no 1"), add_strip(d, "")};
  for (int i = 0; i < 512; ++i)
    d.node({{"mesh", meshes[i % 3]}, {"translation", {4 * (i % 8), 4 * (i / 8 % 8), 4 * (i / 64)}}});
  write("room.gltf", d.gltf());
  ASSERT_EQ(
      run("lsp-bake", "room.gltf --instances -o room.json --json --preset fast --strict --depfile room.d"), 0)
      << read("err");
  const json report = json::parse(read("out"));
  EXPECT_EQ(report["instances"], 512);
  ASSERT_EQ(report["assets"].size(), 3u);
  EXPECT_EQ(report["assets"][0]["instances"], 171);
  EXPECT_EQ(report["triangles"], json({{"baked", 15}, {"placed", 171 * 6 + 171 * 6 + 170 * 3}}));
  EXPECT_EQ(read("room.d"), "room.json: \\\n  room.gltf\n");
  const std::vector<std::string> names = {"room.Cone-no.-1.lsp", "room.cone-no-1.lsp", "room.mesh2.lsp"};
  EXPECT_EQ(json::parse(read("room.json"))["assets"], json(names));
  uint64_t bytes = 0;
  std::string before = read("room.json");
  for (const std::string& name : names) {
    EXPECT_EQ(run("lsp-validate", name + " --mesh room.gltf"), 0) << read("err");
    bytes += fs::file_size(folder_ / name);
    before += read(name);
  }
  EXPECT_EQ(report["file_bytes"], bytes);
  EXPECT_EQ(InstancedScene(path("room.json")).instances().size(), 512u);
  EXPECT_EQ(files(), (std::vector<std::string>{"room.Cone-no.-1.lsp", "room.cone-no-1.lsp", "room.d",
                                               "room.gltf", "room.json", "room.mesh2.lsp"}));

  ASSERT_EQ(run("lsp-bake", "room.gltf --instances -o room.json --preset fast --threads 1"), 0);
  EXPECT_NE(read("out").find("512 instances of 3 assets, 15 triangles for 2,562"), std::string::npos)
      << read("out");
  std::string after = read("room.json");
  for (const std::string& name : names) after += read(name);
  EXPECT_TRUE(before == after) << "the same bytes on any number of threads";
  write("room.gltf", d.gltf() + "\n");
  EXPECT_EQ(run("lsp-validate", names[0] + " --mesh room.gltf"), 7);
}

TEST_F(BakeScene, PosesAreMeshesOfTheirOwn) {
  Document d;
  const int up = d.vec3({0, 0, 1, 0, 0, 1, 0, 0, 1});
  const int leaf =
      d.mesh({{"attributes", {{"POSITION", d.vec3(kTriangle)}}}, {"targets", {{{"POSITION", up}}}}});
  const int snake =
      d.mesh({{"attributes",
               {{"POSITION", d.vec3(kTriangle)},
                {"JOINTS_0", d.values<uint8_t>(std::vector<uint8_t>(12, 0), kUbyte, "VEC4", 4)},
                {"WEIGHTS_0", d.values<float>({1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0}, kFloat, "VEC4", 4)}}}});
  d.node({{"mesh", leaf}, {"translation", {0, 0, 10}}});
  d.node({{"mesh", leaf}, {"weights", {2}}, {"translation", {3, 0, 0}}});
  d.node({{"mesh", leaf}, {"weights", {2}}, {"translation", {6, 0, 0}}});
  const int joint = d.node({{"translation", {0, 9, 0}}});
  for (int i = 0; i < 2; ++i) d.node({{"mesh", snake}, {"skin", 0}, {"translation", {100 + i, 0, 0}}});
  d.node({{"mesh", snake}, {"translation", {0, 0, -4}}});
  d.root["skins"] = {{{"joints", {joint}}}};
  write("poses.gltf", d.gltf());
  expect_the_hits_of_one_bake("poses.gltf", 10, 5);
  const json scene = json::parse(read("scene.json"));
  EXPECT_EQ(scene["assets"],
            json({"scene.mesh0.lsp", "scene.mesh0-2.lsp", "scene.mesh1.lsp", "scene.mesh1-2.lsp"}));
  std::vector<int> assets;
  for (const json& instance : scene["instances"]) assets.push_back(instance["asset"]);
  EXPECT_EQ(assets, (std::vector<int>{0, 1, 1, 2, 2, 3}));
  EXPECT_EQ(scene["instances"][3]["transform"], json({1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0}))
      << "its node does not move what joints move";
}

TEST_F(BakeScene, WhatIsFlattenedIsAMeshOfItsOwn) {
  Document d;
  const int pyramid = add_pyramid(d, "p");
  d.node({{"mesh", pyramid}});
  d.node({{"mesh", pyramid}, {"name", "shadow"}, {"scale", {1, 1, 0}}, {"translation", {5, 0, 0}}});
  write("flat.gltf", d.gltf());
  expect_the_hits_of_one_bake("flat.gltf", 6, 100);
  EXPECT_EQ(json::parse(read("scene.json"))["assets"], json({"scene.p.lsp", "scene.p-2.lsp"}));

  d.node({{"mesh", pyramid}, {"name", "nothing"}, {"scale", {0, 0, 0}}});
  write("flat.gltf", d.gltf());
  const json report = bake_scene("flat.gltf");
  EXPECT_EQ(report["instances"], 2);
  EXPECT_NE(
      report["notes"].dump().find("instances of the mesh p are left out, none of its triangles can be used "
                                  "where the node nothing puts it"),
      std::string::npos)
      << report["notes"];
  EXPECT_EQ(run("lsp-bake", "flat.gltf --instances -o strict.json --strict"), 3);
  d.root["nodes"] = {d.root["nodes"][2]};
  write("nothing.gltf", d.gltf());
  EXPECT_EQ(run("lsp-bake", "nothing.gltf --instances -o strict.json"), 3);
  d.root["nodes"].clear();
  for (const double x : {-3e38, 3e38})
    d.node({{"mesh", pyramid}, {"scale", {1e38, 1e38, 1e38}}, {"translation", {x, 0, 0}}});
  write("beyond.gltf", d.gltf());
  EXPECT_EQ(run("lsp-bake", "beyond.gltf --instances -o strict.json"), 3);
  EXPECT_NE(read("err").find("its transform puts it beyond single precision"), std::string::npos)
      << read("err");
  EXPECT_FALSE(fs::exists(folder_ / "strict.json"));
}

TEST_F(BakeScene, FilesOfOtherFormatsAreAnAssetEach) {
  const std::string triangle = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
  write("a.obj", triangle);
  fs::create_directory(folder_ / "b");
  write("b/a.obj", "mtllib a.mtl\nusemtl x\n" + triangle);
  write("b/a.mtl", "newmtl x\nKd 1 0 0\n");
  const json report = bake_scene("a.obj b/a.obj", "--depfile scene.d");
  EXPECT_EQ(report["instances"], 2);
  EXPECT_EQ(report["assets"][1]["output"], "scene.a-2.lsp");
  EXPECT_EQ(read("scene.d"), "scene.json: \\\n  a.obj \\\n  b/a.obj \\\n  b/a.mtl\n");
  EXPECT_EQ(run("lsp-validate", "scene.a.lsp --mesh a.obj"), 0);
  EXPECT_EQ(run("lsp-validate", "scene.a-2.lsp --mesh b/a.obj"), 0);
  EXPECT_EQ(run("lsp-validate", "scene.a-2.lsp --mesh a.obj"), 7);
}

TEST_F(BakeScene, AFailedBakeChangesNothing) {
  write("small.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
  std::ostringstream large;
  for (int i = 0; i < 3000; ++i)
    large << "v " << i << " 0 0\nv " << i << " 1 0\nv " << i << " 0 1\nf -1 -2 -3\n";
  write("large.obj", large.str());
  bake_scene("small.obj small.obj");
  const auto before = files();
  const std::string scene = read("scene.json"), asset = read("scene.small.lsp");
  EXPECT_EQ(run("lsp-bake",
                "small.obj large.obj --instances -o scene.json --no-line-spaces --no-splits "
                "--max-size 60KB"),
            6);
  EXPECT_NE(read("err").find("large.obj: needs a file of"), std::string::npos) << read("err");
  EXPECT_EQ(files(), before);
  EXPECT_EQ(read("scene.json"), scene);
  EXPECT_EQ(read("scene.small.lsp"), asset);
  EXPECT_EQ(run("lsp-bake", "small.obj missing.obj --instances -o scene.json"), 2);
  EXPECT_EQ(run("lsp-bake", "small.obj --instances -o scene.lsp"), 1);
  EXPECT_NE(read("err").find("lsp-bake: scene.lsp: is no scene"), std::string::npos) << read("err");
  EXPECT_EQ(run("lsp-bake", "small.obj --instances --shard 1/2 -o scene.json"), 1);
  EXPECT_NE(read("err").find("--shard divides one bake"), std::string::npos) << read("err");
  EXPECT_EQ(run("lsp-bake", "small.obj -o scene.json"), 1);
  EXPECT_NE(read("err").find("add --instances"), std::string::npos) << read("err");
  EXPECT_EQ(files(), before);
  EXPECT_EQ(read("scene.json"), scene);
}

}  // namespace
}  // namespace lsp_test
