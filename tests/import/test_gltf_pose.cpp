// Skins at rest and morph targets.
#include <glm/gtc/type_ptr.hpp>

#include "gltf_builder.h"

namespace {

using lsp::Exit;
using lsp::Mesh;
using namespace lsp_test;

class GltfPose : public MeshFiles {
 protected:
  Mesh import(const Document& document) { return MeshFiles::import("a.gltf", document.gltf()); }
  Exit refusal(const Document& document) { return MeshFiles::refusal("a.gltf", document.gltf()).exit; }
};

std::vector<float> translation_matrix(float x, float y, float z) {
  return {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, x, y, z, 1};
}

// A triangle whose corners hang on two joints: the first on joint 0, the second on joint 1, the third on
// both.
struct Skinned {
  Document document;
  json attributes;
  explicit Skinned(const std::vector<float>& inverse_bind) {
    attributes = {
        {"POSITION", document.vec3(kTriangle)},
        {"NORMAL", document.vec3({0, 0, 1, 0, 0, 1, 0, 0, 1})},
        {"JOINTS_0", document.values<uint8_t>({0, 9, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0}, kUbyte, "VEC4", 4)},
        {"WEIGHTS_0", document.values<float>({1, 0, 0, 0, 1, 0, 0, 0, 0.5, 0.5, 0, 0}, kFloat, "VEC4", 4)}};
    document.root["skins"] = {{{"joints", {1, 2}}}};
    if (!inverse_bind.empty())
      document.root["skins"][0]["inverseBindMatrices"] = document.values(inverse_bind, kFloat, "MAT4", 16);
  }
  const Document& finish() {
    document.node({{"mesh", document.mesh({{"attributes", attributes}})},
                   {"skin", 0},
                   {"translation", {100, 200, 300}},
                   {"scale", {7, 7, 7}}});
    document.node({{"translation", {10, 0, 0}}, {"children", {2}}});
    document.node({{"translation", {0, 4, 0}}});
    return document;
  }
};

TEST_F(GltfPose, JointsMoveTheMeshAndItsNodeDoesNot) {
  std::vector<float> inverse = translation_matrix(0, 0, 1), second = translation_matrix(0, 0, 2);
  inverse.insert(inverse.end(), second.begin(), second.end());
  const Mesh mesh = import(Skinned(inverse).finish());
  ASSERT_EQ(mesh.triangles.size(), 1u);
  EXPECT_EQ(corner(mesh, 0, 0), glm::vec3(10, 0, 1));
  EXPECT_EQ(corner(mesh, 0, 1), glm::vec3(11, 4, 2)) << "the child's joint with its parent's matrix";
  EXPECT_EQ(corner(mesh, 0, 2), glm::vec3(10, 3, 1.5)) << "half of each";
}

TEST_F(GltfPose, WithoutInverseBindMatricesTheyAreOne) {
  const Mesh mesh = import(Skinned({}).finish());
  EXPECT_EQ(corner(mesh, 0, 1), glm::vec3(11, 4, 0));
}

TEST_F(GltfPose, SecondSetsOfJointsCount) {
  Skinned skinned({});
  Document& d = skinned.document;
  skinned.attributes["JOINTS_1"] =
      d.values<uint16_t>({1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0}, kUshort, "VEC4", 4);
  skinned.attributes["WEIGHTS_1"] =
      d.values<uint8_t>({255, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0}, kUbyte, "VEC4", 4, true);
  EXPECT_EQ(corner(import(skinned.finish()), 0, 0), glm::vec3(10, 2, 0))
      << "two weights of 1 are a half each";
}

TEST_F(GltfPose, NormalsTurnWithTheirJointsAndMirrorsFlip) {
  Skinned skinned({});
  skinned.finish();
  json& nodes = skinned.document.root["nodes"];
  nodes[1] = {{"rotation", {std::sqrt(0.5), 0, 0, std::sqrt(0.5)}}, {"children", {2}}};  // z to -y
  nodes[2] = json::object();
  const Mesh turned = import(skinned.document);
  EXPECT_NEAR(turned.normals[0][0].y, -1.0f, 1e-6f);
  EXPECT_GT(glm::dot(face_normal(turned, 0), turned.normals[0][0]), 0.999f);
  nodes[1]["scale"] = {-1, 1, 1};
  const Mesh mirrored = import(skinned.document);
  EXPECT_GT(glm::dot(face_normal(mirrored, 0), mirrored.normals[0][0]), 0.999f);
}

TEST_F(GltfPose, JointsWithoutWeightsAreNoted) {
  Skinned skinned({});
  skinned.finish();
  skinned.document.root["meshes"][0]["primitives"][0]["attributes"].erase("WEIGHTS_0");
  EXPECT_TRUE(has_note(import(skinned.document), "joints without weights"));
}

TEST_F(GltfPose, SkinsWithoutJointsAndSetsWithoutThoseBeforeAreNoted) {
  Skinned skinned({});
  skinned.finish();
  json& attributes = skinned.document.root["meshes"][0]["primitives"][0]["attributes"];
  attributes["JOINTS_2"] = attributes["JOINTS_0"];
  attributes["WEIGHTS_2"] = attributes["WEIGHTS_0"];
  const Mesh gap = import(skinned.document);
  EXPECT_TRUE(has_note(gap, "JOINTS_2 has no set before it"));
  EXPECT_TRUE(has_note(gap, "WEIGHTS_2 has no set before it"));
  EXPECT_EQ(corner(gap, 0, 1), glm::vec3(11, 4, 0));
  for (const char* name : {"JOINTS_0", "WEIGHTS_0", "JOINTS_2", "WEIGHTS_2"}) attributes.erase(name);
  const Mesh stiff = import(skinned.document);
  EXPECT_TRUE(has_note(stiff, "a primitive without joints"));
  EXPECT_EQ(corner(stiff, 0, 1), glm::vec3(107, 200, 300));
}

TEST_F(GltfPose, BrokenSkinsAreRefused) {
  Skinned skinned({});
  skinned.finish();
  const auto with = [&](const char* key, const json& value) {
    Document broken = skinned.document;
    broken.root["skins"][0][key] = value;
    return refusal(broken);
  };
  EXPECT_EQ(refusal(skinned.document), Exit::kDone) << "joint 9 has no weight";
  EXPECT_EQ(with("joints", {1}), Exit::kInvalid) << "joint 1 has weight and is not there";
  EXPECT_EQ(with("joints", {1, 77}), Exit::kInvalid);
  EXPECT_EQ(with("inverseBindMatrices", 0), Exit::kInvalid);
  EXPECT_EQ(with("inverseBindMatrices", 99), Exit::kInvalid);
  Document broken = skinned.document;
  broken.root["nodes"][0]["skin"] = 5;
  EXPECT_EQ(refusal(broken), Exit::kInvalid);
  broken = skinned.document;
  broken.root["nodes"][2]["children"] = {1};
  EXPECT_EQ(refusal(broken), Exit::kInvalid) << "joints that are their own ancestors";
}

TEST_F(GltfPose, MorphTargetsMoveByTheMeshsWeightsOrTheNodes) {
  Document document;
  const int up = document.vec3({0, 0, 1, 0, 0, 1, 0, 0, 1}),
            right = document.vec3({4, 0, 0, 0, 0, 0, 4, 0, 0});
  const int tilt = document.vec3({1, 0, -1, 1, 0, -1, 1, 0, -1});
  const json targets = {{{"POSITION", right}}, {{"POSITION", up}, {"NORMAL", tilt}}};
  const int mesh = document.mesh(
      {{"attributes", {{"POSITION", document.vec3(kTriangle)}, {"NORMAL", up}}}, {"targets", targets}});
  document.root["meshes"][0]["weights"] = {0.5, 1};
  document.node({{"mesh", mesh}});
  document.node({{"mesh", mesh}, {"weights", {0, 3}}});
  const Mesh posed = import(document);
  ASSERT_EQ(posed.triangles.size(), 2u);
  EXPECT_EQ(corner(posed, 0, 0), glm::vec3(2, 0, 1));
  EXPECT_EQ(corner(posed, 0, 1), glm::vec3(1, 0, 1));
  EXPECT_EQ(posed.normals[0][0], glm::vec3(1, 0, 0));
  EXPECT_EQ(corner(posed, 1, 0), glm::vec3(0, 0, 3)) << "the node's weights win";
  document.root["meshes"][0].erase("weights");
  EXPECT_EQ(corner(import(document), 0, 0), glm::vec3(0)) << "without weights nothing moves";
}

TEST_F(GltfPose, SparseAndQuantisedTargetsMove) {
  Document document;
  std::string value;
  for (const float x : {0.0f, 0.0f, 8.0f}) append(value, x);
  const int sparse = document.accessor(-1, kFloat, 3, "VEC3");
  document.root["accessors"][size_t(sparse)]["sparse"] = {
      {"count", 1},
      {"indices", {{"bufferView", document.view(std::string("\1\0", 2))}, {"componentType", kUshort}}},
      {"values", {{"bufferView", document.view(value)}}}};
  const int quantised = document.values<int8_t>({127, 0, 0, 127, 0, 0, 127, 0, 0}, kByte, "VEC3", 3, true);
  const int mesh = document.mesh({{"attributes", {{"POSITION", document.vec3(kTriangle)}}},
                                  {"targets", {{{"POSITION", sparse}}, {{"POSITION", quantised}}}}});
  document.node({{"mesh", mesh}, {"weights", {0.5, 2}}});
  const Mesh posed = import(document);
  EXPECT_EQ(corner(posed, 0, 0), glm::vec3(2, 0, 0));
  EXPECT_EQ(corner(posed, 0, 1), glm::vec3(3, 0, 4));
  document.root["meshes"][0]["primitives"][0]["targets"][0]["POSITION"] = document.vec3({1, 2, 3});
  EXPECT_EQ(refusal(document), Exit::kInvalid) << "a target of another size";
}

TEST_F(GltfPose, UnusedVerticesTakeTheirJointsAlong) {
  Document document;
  const std::vector<float> six = {9, 9, 9, 9, 9, 9, 9, 9, 9, 0, 0, 0, 1, 0, 0, 0, 1, 0};
  std::vector<uint8_t> joints(24, 0);
  std::vector<float> weights(24, 0.0f);
  for (size_t i = 0; i < 6; ++i) joints[4 * i] = i < 3 ? 0 : 1, weights[4 * i] = 1;
  const json attributes = {{"POSITION", document.vec3(six)},
                           {"JOINTS_0", document.values(joints, kUbyte, "VEC4", 4)},
                           {"WEIGHTS_0", document.values(weights, kFloat, "VEC4", 4)}};
  const int mesh = document.mesh(
      {{"attributes", attributes}, {"indices", document.indices<uint16_t>({3, 4, 5}, kUshort)}});
  document.root["skins"] = {{{"joints", {1, 2}}}};
  document.node({{"mesh", mesh}, {"skin", 0}});
  document.node({{"translation", {50, 0, 0}}});
  document.node({{"translation", {0, 0, 2}}});
  EXPECT_EQ(corner(import(document), 0, 1), glm::vec3(1, 0, 2));
}

}  // namespace
