// Scenes posed at a time of an animation.
#include <meshoptimizer.h>

#include <cmath>

#include "gltf_builder.h"

namespace {

using lsp::Exit;
using lsp::ImportOptions;
using lsp::Mesh;
using namespace lsp_test;

// A triangle on a node, number 0, that animations move.
class GltfAnimation : public MeshFiles {
 protected:
  GltfAnimation() {
    document_.node({{"mesh", document_.mesh({{"attributes", {{"POSITION", document_.vec3(kTriangle)}}}})}});
  }

  // A channel of the last animation: its keys' times, `shape` values and interpolation (none: the default).
  void channel(int node, const char* path, const std::vector<float>& times, int output,
               const char* interpolation = "") {
    json& list = document_.root["animations"];
    if (list.empty()) list.push_back({{"name", "Walk"}});
    json sampler = {{"input", document_.values(times, kFloat, "SCALAR", 1)}, {"output", output}};
    if (*interpolation) sampler["interpolation"] = interpolation;
    list.back()["samplers"].push_back(sampler);
    list.back()["channels"].push_back(
        {{"sampler", list.back()["samplers"].size() - 1}, {"target", {{"node", node}, {"path", path}}}});
  }
  int quaternions(const std::vector<float>& list) { return document_.values(list, kFloat, "VEC4", 4); }
  int scalars(const std::vector<float>& list) { return document_.values(list, kFloat, "SCALAR", 1); }

  Mesh at(double time, const std::string& animation = {}) {
    return import("a.gltf", document_.gltf(), {.time = time, .animation = animation});
  }
  Refusal refused(double time, const std::string& animation = {}) {
    return refusal("a.gltf", document_.gltf(), {.time = time, .animation = animation});
  }
  void expect_corner(const Mesh& mesh, int i, const glm::vec3& right) {
    for (int k = 0; k < 3; ++k) EXPECT_NEAR(corner(mesh, 0, i)[k], right[k], 1e-6f) << k;
  }

  Document document_;
};

TEST_F(GltfAnimation, LinearKeysAreBetween) {
  channel(0, "translation", {1, 3}, document_.vec3({0, 0, 0, 8, 4, -2}));
  channel(0, "scale", {1, 2, 3}, document_.vec3({1, 1, 1, 2, 1, 1, 2, 5, 1}));
  expect_corner(at(1.5), 0, {2, 1, -0.5f});
  expect_corner(at(1.5), 1, {3.5f, 1, -0.5f});
  expect_corner(at(2.5), 2, {6, 3 + 3, -1.5f});
  expect_corner(import("a.gltf", document_.gltf()), 0, {0, 0, 0});
}

TEST_F(GltfAnimation, OutsideTheirKeysChannelsHold) {
  channel(0, "translation", {1, 3}, document_.vec3({5, 0, 0, 8, 0, 0}));
  channel(0, "scale", {2, 10}, document_.vec3({2, 2, 2, 4, 4, 4}));
  for (const double early : {-7.0, 0.0, 1.0}) expect_corner(at(early), 1, {7, 0, 0});
  expect_corner(at(6), 1, {11, 0, 0});
  expect_corner(at(1e9), 1, {12, 0, 0});
}

TEST_F(GltfAnimation, StepsHoldUntilTheNextKey) {
  channel(0, "translation", {0, 0.1f, 0.7f}, document_.vec3({1, 0, 0, 2, 0, 0, 3, 0, 0}), "STEP");
  expect_corner(at(0.0999), 0, {1, 0, 0});
  expect_corner(at(0.1), 0, {2, 0, 0});
  expect_corner(at(0.6999), 0, {2, 0, 0});
  expect_corner(at(0.7), 0, {3, 0, 0});
}

// From no turn to 90 degrees about z, once with the second key's sign turned round.
TEST_F(GltfAnimation, RotationsTakeTheShorterWay) {
  const float h = std::sqrt(0.5f), c = std::cos(0.5235987756f), s = std::sin(0.5235987756f);
  channel(0, "rotation", {0, 3}, quaternions({0, 0, 0, 1, 0, 0, h, h}));
  expect_corner(at(1), 1, {c, s, 0});
  expect_corner(at(3), 1, {0, 1, 0});
  document_.root["animations"].clear();
  channel(0, "rotation", {0, 3}, quaternions({0, 0, 0, 1, 0, 0, -h, -h}));
  expect_corner(at(1), 1, {c, s, 0});
}

TEST_F(GltfAnimation, QuantisedRotationsAreRead) {
  const int output = document_.values<int16_t>({0, 0, 0, 32767, 0, 0, 32767, 0}, kShort, "VEC4", 4, true);
  channel(0, "rotation", {0, 2}, output, "LINEAR");
  expect_corner(at(1), 1, {0, 1, 0});
  expect_corner(at(2), 1, {-1, 0, 0});
}

// Bytes of which the second four are of length 0.71: half way is half the angle all the same.
TEST_F(GltfAnimation, QuantisedRotationsCountByTheirDirection) {
  const int output = document_.values<int8_t>({0, 0, 0, 127, 0, 0, 64, 64}, kByte, "VEC4", 4, true);
  channel(0, "rotation", {0, 2}, output, "LINEAR");
  const float h = std::sqrt(0.5f);
  expect_corner(at(1), 1, {h, h, 0});
}

// Two seconds between the keys: 2 * 1/8 * 3 + 1/2 * 1 - 2 * 1/8 * -1 in the middle.
TEST_F(GltfAnimation, CubicSplinesFollowTheirTangents) {
  channel(0, "translation", {1, 3}, document_.vec3({9, 9, 9, 0, 0, 0, 3, 0, 6, -1, 0, 0, 1, 0, 4, 9, 9, 9}),
          "CUBICSPLINE");
  expect_corner(at(2), 0, {1.5f, 0, 1.5f + 2});
  expect_corner(at(0), 0, {0, 0, 0});
  expect_corner(at(3), 0, {1, 0, 4});
}

TEST_F(GltfAnimation, CubicRotationsBecomeOfUnitLength) {
  const float h = std::sqrt(0.5f);
  channel(0, "rotation", {0, 1},
          quaternions({0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, h, h, 0, 0, 0, 0}),
          "CUBICSPLINE");
  expect_corner(at(0.5), 1, {h, h, 0});  // half way by symmetry
  // At a quarter the weights are 27/32 and 5/32: an angle of 2 atan(5 h / (27 + 5 h)).
  const double angle = 2 * std::atan2(5 * double(h), 27 + 5 * double(h));
  expect_corner(at(0.25), 1, {std::cos(angle), std::sin(angle), 0});
}

TEST_F(GltfAnimation, WeightsMoveMorphTargets) {
  json& mesh = document_.root["meshes"][0];
  mesh["weights"] = {1, 1};
  mesh["primitives"][0]["targets"] = {{{"POSITION", document_.vec3({4, 0, 0, 4, 0, 0, 4, 0, 0})}},
                                      {{"POSITION", document_.vec3({0, 0, 2, 0, 0, 2, 0, 0, 2})}}};
  channel(0, "weights", {0, 1}, scalars({0, 0, 1, 0.5}));
  expect_corner(at(0.5), 0, {2, 0, 0.5f});
  expect_corner(at(1), 0, {4, 0, 1});
  // Keys of a cubic one: all tangents in, all values, all tangents out.
  document_.root["animations"].clear();
  channel(0, "weights", {0, 1}, scalars({9, 9, 0, 1, 2, 0, 0, -4, 1, 1, 9, 9}), "CUBICSPLINE");
  expect_corner(at(0.5), 0, {4 * (0.25f + 0.5f), 0, 2 * (0.5f + 0.5f + 0.5f)});
  document_.root["animations"].clear();
  channel(0, "weights", {0, 1}, scalars({0, 0, 0}));
  EXPECT_EQ(refused(0).exit, Exit::kInvalid) << "three weights for twice two";
}

TEST_F(GltfAnimation, SkinsFollowTheirJoints) {
  json& primitive = document_.root["meshes"][0]["primitives"][0];
  primitive["attributes"]["JOINTS_0"] =
      document_.values<uint8_t>({0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0}, kUbyte, "VEC4", 4);
  primitive["attributes"]["WEIGHTS_0"] =
      document_.values<float>({1, 0, 0, 0, 1, 0, 0, 0, 0.5, 0.5, 0, 0}, kFloat, "VEC4", 4);
  document_.root["skins"] = {{{"joints", {1, 2}}}};
  document_.root["nodes"][0]["skin"] = 0;
  document_.node({{"children", {2}}});
  document_.node({{"translation", {0, 1, 0}}});
  channel(1, "translation", {0, 1}, document_.vec3({0, 0, 0, 10, 0, 0}));
  channel(2, "translation", {0, 1}, document_.vec3({0, 1, 0, 0, 5, 0}));
  const Mesh posed = at(0.5);
  expect_corner(posed, 0, {5, 0, 0});
  expect_corner(posed, 1, {6, 3, 0});
  expect_corner(posed, 2, {5, 1 + 1.5f, 0});
}

TEST_F(GltfAnimation, SparseKeysAreRead) {
  std::string value;
  for (const float x : {6.0f, 0.0f, 0.0f}) append(value, x);
  const int sparse = document_.accessor(-1, kFloat, 2, "VEC3");
  document_.root["accessors"][size_t(sparse)]["sparse"] = {
      {"count", 1},
      {"indices", {{"bufferView", document_.view(std::string("\1\0", 2))}, {"componentType", kUshort}}},
      {"values", {{"bufferView", document_.view(value)}}}};
  channel(0, "translation", {0, 1}, sparse);
  expect_corner(at(0.5), 0, {3, 0, 0});
}

TEST_F(GltfAnimation, CompressedKeysAreRead) {
  const std::vector<float> keys = {0, 0, 0, 8, 0, 0};
  std::string packed(meshopt_encodeVertexBufferBound(2, 12), '\0');
  packed.resize(meshopt_encodeVertexBuffer(reinterpret_cast<uint8_t*>(packed.data()), packed.size(),
                                           keys.data(), 2, 12));
  const int view = document_.view(packed);
  json& source = document_.root["bufferViews"][size_t(view)];
  json extension = source;
  extension.update({{"byteStride", 12}, {"count", 2}, {"mode", "ATTRIBUTES"}});
  source["extensions"]["EXT_meshopt_compression"] = extension;
  channel(0, "translation", {0, 1}, document_.accessor(view, kFloat, 2, "VEC3"));
  expect_corner(at(0.25), 0, {2, 0, 0});
}

TEST_F(GltfAnimation, TheAnimationIsChosenByNameOrNumber) {
  channel(0, "translation", {0}, document_.vec3({1, 0, 0}));
  EXPECT_TRUE(at(0).notes.empty()) << "the only one is played, nothing is left out";
  document_.root["animations"].push_back({{"name", "Run"}});
  channel(0, "translation", {0}, document_.vec3({2, 0, 0}));
  document_.root["animations"].push_back({{"name", "1"}});
  channel(0, "translation", {0}, document_.vec3({3, 0, 0}));
  expect_corner(at(0), 0, {1, 0, 0});
  EXPECT_TRUE(has_note(at(0), "of its 3 animations the first, 0 (Walk), is played"));
  expect_corner(at(0, "Run"), 0, {2, 0, 0});
  EXPECT_TRUE(at(0, "Run").notes.empty());
  expect_corner(at(0, "0"), 0, {1, 0, 0});
  expect_corner(at(0, "1"), 0, {3, 0, 0});  // a name comes before a number
  const Refusal unknown = refused(0, "Fly");
  EXPECT_EQ(unknown.exit, Exit::kUsage);
  EXPECT_NE(unknown.message.find("0 (Walk), 1 (Run), 2 (1)"), std::string::npos) << unknown.message;
  EXPECT_EQ(refused(0, "3").exit, Exit::kUsage);
  EXPECT_EQ(refused(0, "-1").exit, Exit::kUsage);
}

TEST_F(GltfAnimation, SomeInputMustHaveIt) {
  EXPECT_EQ(refused(0).exit, Exit::kUsage);
  const std::filesystem::path still = write("still.gltf", document_.gltf());
  channel(0, "translation", {0}, document_.vec3({0, 0, 7}));
  const std::filesystem::path paths[] = {still, write("moved.gltf", document_.gltf())};
  const Mesh both = lsp::import_meshes(paths, {.time = 2});
  EXPECT_EQ(corner(both, 0, 0), glm::vec3(0, 0, 0));
  EXPECT_EQ(corner(both, 1, 0), glm::vec3(0, 0, 7));
}

TEST_F(GltfAnimation, WhatIsNotPlayedIsNoted) {
  document_.root["nodes"][0]["matrix"] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 3, 1};
  channel(0, "translation", {0}, document_.vec3({0, 0, 7}));
  channel(0, "pointer", {0}, document_.vec3({0, 0, 7}));
  document_.root["animations"][0]["channels"][1]["target"].erase("node");
  channel(0, "visible", {0}, document_.vec3({0, 0, 7}));
  const Mesh mesh = at(0);
  EXPECT_EQ(corner(mesh, 0, 0), glm::vec3(0, 0, 3));
  EXPECT_TRUE(has_note(mesh, "a node with a matrix is animated"));
  EXPECT_TRUE(has_note(mesh, "of the path visible are not played"));
  EXPECT_TRUE(has_note(import("a.gltf", document_.gltf()),
                       "its animations are not played, the mesh is taken at rest; --time"));
}

TEST_F(GltfAnimation, DamagedAnimationsAreRefused) {
  channel(0, "translation", {0, 1}, document_.vec3({0, 0, 0, 1, 1, 1}));
  const Document good = document_;
  EXPECT_EQ(refused(0.5).exit, Exit::kDone);
  const int descending = scalars({1, 0}), nan = scalars({0, NAN}),
            none = document_.accessor(-1, kFloat, 0, "SCALAR");
  const int three = document_.vec3({0, 0, 0, 1, 1, 1, 2, 2, 2}), four = quaternions({0, 0, 0, 1, 0, 0, 0, 1});
  const int beyond = document_.accessor(0, kFloat, 1000000, "VEC3");
  const Document more = document_;
  const auto with = [&](const char* pointer, const json& value) {
    document_ = more;
    document_.root[json::json_pointer(std::string("/animations/0") + pointer)] = value;
    return refused(0.5).exit;
  };
  for (const json& input :
       {json(descending), json(nan), json(none), json(99), json(-1), json("x"), json(three)})
    EXPECT_EQ(with("/samplers/0/input", input), Exit::kInvalid) << input;
  for (const json& output : {json(three), json(four), json(beyond), json(99), json(nullptr)})
    EXPECT_EQ(with("/samplers/0/output", output), Exit::kInvalid) << output;
  EXPECT_EQ(with("/samplers/0/interpolation", "CUBICSPLINE"), Exit::kInvalid);
  EXPECT_EQ(with("/samplers/0/interpolation", "BEZIER"), Exit::kInvalid);
  EXPECT_EQ(with("/channels/0/sampler", 1), Exit::kInvalid);
  EXPECT_EQ(with("/channels/0/target/node", 9), Exit::kInvalid);
  EXPECT_EQ(with("/samplers", 3), Exit::kInvalid);
  EXPECT_EQ(with("/samplers", json::array({7})), Exit::kInvalid);
  EXPECT_EQ(with("/channels", json::array({7})), Exit::kDone) << "it has no target";
  document_.root["animations"] = json::object({{"a", 1}});
  EXPECT_EQ(refused(0.5).exit, Exit::kUsage) << "no list, none";
}

}  // namespace
