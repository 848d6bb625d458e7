// glTF as exporters write it beside its letter: what is missing, left over, malformed or one of several.
#include <limits>

#include "gltf_builder.h"
#include "png_bytes.h"

namespace {

using lsp::Exit;
using lsp::Material;
using lsp::Mesh;
using namespace lsp_test;

// A square of two triangles over indices, without a material.
struct Square : Document {
  Square() {
    mesh({{"attributes", {{"POSITION", vec3({0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0})}}},
          {"indices", indices<uint16_t>({0, 1, 2, 0, 2, 3}, kUshort)}});
    node({{"mesh", 0}});
  }
  json& primitive() { return root["meshes"][0]["primitives"][0]; }
  json& material() {
    primitive()["material"] = 0;
    if (!root.contains("materials")) root["materials"].push_back(json::object());
    return root["materials"][0];
  }
};

class GltfVariants : public MeshFiles {
 protected:
  Mesh import(const Document& document) { return MeshFiles::import("a.gltf", document.gltf()); }
  // That the document gives one note and no other, which has the words `part`.
  void expect_note(const Document& document, const std::string& part) {
    const Mesh mesh = import(document);
    EXPECT_EQ(mesh.notes.size(), 1u) << part;
    EXPECT_TRUE(has_note(mesh, part)) << (mesh.notes.empty() ? part : mesh.notes[0]);
  }
};

TEST_F(GltfVariants, WithoutAMaterialTheSpecificationsDefaultHolds) {
  Square none, empty, missing;
  empty.material();
  missing.primitive()["material"] = 7;
  for (const Square& square : {none, empty, missing}) {
    const Mesh mesh = import(square);
    const Material& material = mesh.materials[mesh.material_ids[0]];
    EXPECT_EQ(mesh.color(0).base_color, glm::vec3(1));
    EXPECT_EQ(material.metallic, 1.0f);
    EXPECT_EQ(material.roughness, 1.0f);
    EXPECT_EQ(material.opacity, 1.0f);
    EXPECT_EQ(material.emission, glm::vec3(0));
  }
  EXPECT_TRUE(import(none).notes.empty() && import(empty).notes.empty());
  expect_note(missing, "name materials that are not there");
  none.primitive()["attributes"]["COLOR_0"] = none.vec3({1, 0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0});
  EXPECT_EQ(import(none).color(0).base_color, glm::vec3(1, 0, 0));
}

TEST_F(GltfVariants, ColoursInWholeNumbersThatDoNotSaySo) {
  Square square;
  square.primitive()["attributes"]["COLOR_0"] = square.values<uint8_t>(
      {255, 0, 0, 255, 255, 0, 0, 255, 255, 0, 0, 255, 255, 0, 0, 255}, kUbyte, "VEC4", 4);
  EXPECT_EQ(import(square).color(0).base_color, glm::vec3(1, 0, 0));
  expect_note(square, "taken as normalized");
  square.root["accessors"][2]["normalized"] = true;
  EXPECT_TRUE(import(square).notes.empty());
}

TEST_F(GltfVariants, AttributesShorterThanPositionsAreNoted) {
  Square square;
  square.primitive()["attributes"]["COLOR_0"] = square.vec3({1, 0, 0});
  expect_note(square, "fewer or more of COLOR_0 than positions");
  Square textured;
  textured.root["images"] = {{{"bufferView", textured.view(rgba_png(1, 1, {255, 0, 0, 255}))}}};
  textured.root["textures"] = {{{"source", 0}}};
  textured.material()["pbrMetallicRoughness"]["baseColorTexture"]["index"] = 0;
  textured.primitive()["attributes"]["TEXCOORD_0"] = textured.values<float>({0, 0, 1, 0}, kFloat, "VEC2", 2);
  expect_note(textured, "fewer or more of TEXCOORD_0 than positions");
}

TEST_F(GltfVariants, TextureCoordinatesThatAreNotFiniteAreNoted) {
  Square square;
  square.root["images"] = {{{"bufferView", square.view(rgba_png(1, 1, {255, 0, 0, 255}))}}};
  square.root["textures"] = {{{"source", 0}}};
  square.material()["pbrMetallicRoughness"]["baseColorTexture"]["index"] = 0;
  const float none = std::numeric_limits<float>::quiet_NaN();
  square.primitive()["attributes"]["TEXCOORD_0"] =
      square.values<float>({none, none, 1, 0, 1, 1, 0, 1}, kFloat, "VEC2", 2);
  EXPECT_EQ(import(square).color(0).base_color, glm::vec3(1, 0, 0));
  expect_note(square, "TEXCOORD_0 is not finite at some vertices");
}

TEST_F(GltfVariants, VerticesLeftOverAreNoted) {
  Square square;
  square.primitive()["indices"] = square.indices<uint16_t>({0, 1, 2, 0, 2}, kUshort);
  EXPECT_EQ(import(square).primitive_count, 1u);
  expect_note(square, "no multiple of three");
}

TEST_F(GltfVariants, MaterialsBeyondTheirRangeOrOfAnotherShape) {
  const std::pair<json, const char*> cases[] = {
      {{{"baseColorFactor", {2, 1, 0.5, 1}}}, "cut to what their range permits"},
      {{{"roughnessFactor", -1}}, "cut to what their range permits"},
      {{{"baseColorFactor", {1, 0, 0}}}, "baseColorFactor of a material is not 4 numbers"},
      {{{"baseColorFactor", {1, 0, "0", 1}}}, "baseColorFactor of a material is not 4 numbers"},
      {{{"metallicFactor", "0"}}, "metallicFactor of a material is no number"}};
  for (const auto& [pbr, part] : cases) {
    Square square;
    square.material()["pbrMetallicRoughness"] = pbr;
    expect_note(square, part);
  }
}

TEST_F(GltfVariants, MasksAtTheEndsOfTheirRange) {
  const auto kept = [&](double cutoff, uint8_t alpha) {
    Square square;
    square.root["images"] = {{{"bufferView", square.view(rgba_png(1, 1, {255, 255, 255, alpha}))}}};
    square.root["textures"] = {{{"source", 0}}};
    json& material = square.material();
    material["pbrMetallicRoughness"]["baseColorTexture"]["index"] = 0;
    material["alphaMode"] = "MASK";
    material["alphaCutoff"] = cutoff;
    square.primitive()["attributes"]["TEXCOORD_0"] =
        square.values<float>({0, 0, 1, 0, 1, 1, 0, 1}, kFloat, "VEC2", 2);
    return refusal("a.gltf", square.gltf()).exit == Exit::kDone;
  };
  EXPECT_TRUE(kept(0, 0)) << "an alpha not below the cutoff is opaque";
  EXPECT_TRUE(kept(1, 255));
  EXPECT_FALSE(kept(1, 254));
  EXPECT_FALSE(kept(1.5, 255)) << "above 1 nothing is left";
  EXPECT_TRUE(kept(0.5, 128));
  EXPECT_FALSE(kept(0.5, 127));
}

TEST_F(GltfVariants, AFallbackBesideWhatIsNotReadIsUsed) {
  const std::tuple<const char*, std::string, const char*> cases[] = {
      {"KHR_texture_basisu", "\xABKTX 20\xBB\r\n\x1A\n", nullptr},
      {"EXT_texture_avif",
       std::string("\0\0\0\x1C"
                   "ftypavif",
                   12),
       "the extension EXT_texture_avif is not read"},
      {"MSFT_texture_dds", "DDS |", "the extension MSFT_texture_dds is not read"}};
  for (const auto& [extension, bytes, note] : cases) {
    Square square;
    square.root["images"] = {{{"bufferView", square.view(rgba_png(1, 1, {255, 0, 0, 255}))}},
                             {{"bufferView", square.view(bytes)}}};
    square.root["textures"] = {{{"source", 0}, {"extensions", {{extension, {{"source", 1}}}}}}};
    square.material()["pbrMetallicRoughness"]["baseColorTexture"]["index"] = 0;
    square.primitive()["attributes"]["TEXCOORD_0"] =
        square.values<float>({0, 0, 1, 0, 1, 1, 0, 1}, kFloat, "VEC2", 2);
    const Mesh mesh = import(square);
    EXPECT_EQ(mesh.color(0).base_color, glm::vec3(1, 0, 0)) << extension;
    EXPECT_EQ(mesh.notes.size(), note ? 1u : 0u) << extension;
    EXPECT_TRUE(!note || has_note(mesh, note));
  }
}

TEST_F(GltfVariants, ADamagedPictureLeavesTheOneBesideIt) {
  const std::string red = rgba_png(1, 1, {255, 0, 0, 255}), bad = std::string("RIFF\x10\0\0\0WEBPVP8 xx", 18);
  const auto with = [&](const std::string& plain, const std::string& webp) {
    Square square;
    square.root["images"] = {{{"bufferView", square.view(plain)}},
                             {{"bufferView", square.view(webp)}, {"name", "wall"}}};
    square.root["textures"] = {{{"source", 0}, {"extensions", {{"EXT_texture_webp", {{"source", 1}}}}}}};
    square.material()["pbrMetallicRoughness"]["baseColorTexture"]["index"] = 0;
    square.primitive()["attributes"]["TEXCOORD_0"] =
        square.values<float>({0, 0, 1, 0, 1, 1, 0, 1}, kFloat, "VEC2", 2);
    return import(square);
  };
  const Mesh mesh = with(red, bad);
  EXPECT_EQ(mesh.color(0).base_color, glm::vec3(1, 0, 0));
  EXPECT_TRUE(has_note(mesh, "wall is damaged WebP; the next that its texture names is tried"));
  EXPECT_EQ(mesh.notes.size(), 1u);

  const Mesh neither = with("no picture", bad);
  EXPECT_EQ(neither.color(0).base_color, glm::vec3(1));
  EXPECT_TRUE(has_note(neither, "the picture 0 is of no format known here, or damaged; factors hold"));
}

TEST_F(GltfVariants, NodesThatAreNotVisibleAreLeftOut) {
  Square square;
  square.root["extensionsUsed"] = square.root["extensionsRequired"] = {"KHR_node_visibility"};
  square.node({{"children", {2}}, {"extensions", {{"KHR_node_visibility", {{"visible", false}}}}}});
  square.node({{"mesh", 0}, {"translation", {5, 0, 0}}});
  square.node({{"mesh", 0},
               {"translation", {9, 0, 0}},
               {"extensions", {{"KHR_node_visibility", {{"visible", true}}}}}});
  const Mesh mesh = import(square);
  EXPECT_EQ(mesh.primitive_count, 4u);
  EXPECT_EQ(corner(mesh, 2, 0).x, 9);
  expect_note(square, "1 nodes are not visible");
}

TEST_F(GltfVariants, NodesMalformedOrWithTwoPlaces) {
  const std::pair<json, const char*> cases[] = {
      {{{"matrix", {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0}}}, "matrix of a node is not 16 numbers"},
      {{{"translation", {1, 2}}}, "translation of a node is not 3 numbers"},
      {{{"rotation", {0, 0, 0}}}, "rotation of a node is not 4 numbers"},
      {{{"rotation", {0, 0, 0, 0}}}, "rotation of a node is four zeros"},
      {{{"matrix", {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1}}, {"scale", {2, 2, 2}}},
       "scale of a node that has a matrix is not read"}};
  for (const auto& [members, part] : cases) {
    Square square;
    square.root["nodes"][0].update(members);
    EXPECT_EQ(corner(import(square), 0, 1), glm::vec3(1, 0, 0)) << part;
    expect_note(square, part);
  }
}

TEST_F(GltfVariants, InstancesAndWeightsOfDifferentLengths) {
  Square square;
  square.root["nodes"][0]["extensions"]["EXT_mesh_gpu_instancing"]["attributes"] = {
      {"TRANSLATION", square.vec3({0, 0, 0, 2, 0, 0})}, {"SCALE", square.vec3({1, 1, 1})}};
  expect_note(square, "attributes of different lengths, the shortest counts");
  Square morphed;
  morphed.primitive()["targets"] = {{{"POSITION", morphed.vec3({0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 1})}}};
  morphed.root["meshes"][0]["weights"] = {0.5, 1};
  EXPECT_EQ(corner(import(morphed), 0, 0).z, 0.5f);
  expect_note(morphed, "1 morph targets has 2 weights");
}

TEST_F(GltfVariants, AReaderThatTheDocumentAsksForIsNotThisOne) {
  Square square;
  square.root["asset"] = {{"version", "2.1"}, {"minVersion", "2.1"}};
  const Refusal refused = refusal("a.gltf", square.gltf());
  EXPECT_EQ(refused.exit, Exit::kUnsupported);
  EXPECT_NE(refused.message.find("asks for a reader of glTF 2.1"), std::string::npos);
  square.root["asset"]["minVersion"] = "2.0";
  EXPECT_EQ(import(square).triangles.size(), 2u);
}

TEST_F(GltfVariants, FilesOnTheNetworkAreNotAskedFor) {
  Square square;
  square.root["images"] = {{{"uri", "https://example.com/a.png"}}};
  square.root["textures"] = {{{"source", 0}}};
  square.material()["pbrMetallicRoughness"]["baseColorTexture"]["index"] = 0;
  expect_note(square, "on the network, which is not asked");
  Square far;
  json root = json::parse(far.gltf());
  root["buffers"][0]["uri"] = "http://example.com/a.bin";
  const Refusal refused = refusal("a.gltf", root.dump());
  EXPECT_EQ(refused.exit, Exit::kFile);
  EXPECT_NE(refused.message.find("on the network"), std::string::npos);
}

}  // namespace
