// glTF and GLB: each feature and each way to go wrong, on documents built here.
#include <draco/compression/encode.h>
#include <draco/mesh/triangle_soup_mesh_builder.h>
#include <meshoptimizer.h>
#include <xxhash.h>

#include "gltf_builder.h"

namespace {

using lsp::Exit;
using lsp::Mesh;
using namespace lsp_test;

class Gltf : public MeshFiles {
 protected:
  // One triangle under one node.
  static Document triangle(const json& node = json::object()) {
    Document document;
    const int mesh = document.mesh({{"attributes", {{"POSITION", document.vec3(kTriangle)}}}});
    json with_mesh = node;
    with_mesh["mesh"] = mesh;
    document.node(with_mesh);
    return document;
  }
  Mesh import(const Document& document) { return MeshFiles::import("a.gltf", document.gltf()); }
  Refusal refusal(const Document& document, const lsp::ImportOptions& options = {}) {
    return MeshFiles::refusal("a.gltf", document.gltf(), options);
  }
};

TEST_F(Gltf, ContainersGiveTheSameMesh) {
  const Document document = triangle();
  const Mesh embedded = import(document), binary = MeshFiles::import("a.glb", document.glb());
  Document external = document;
  write("b%c.bin", external.bytes);
  external.root["buffers"][0] = {{"byteLength", external.bytes.size()}, {"uri", "b%25c.bin"}};
  external.bytes.clear();
  const Mesh beside = import(external);
  for (const Mesh* mesh : {&embedded, &binary, &beside}) {
    ASSERT_EQ(mesh->triangles.size(), 1u);
    EXPECT_EQ(corner(*mesh, 0, 1), glm::vec3(1, 0, 0));
    EXPECT_EQ(mesh->normals[0][2], glm::vec3(0, 0, 1)) << "flat without normals";
  }
}

TEST_F(Gltf, TheHeadersLengthEndsABinaryFileUnlessItIsWrong) {
  const std::string glb = triangle().glb();
  const auto with_length = [&](size_t length) {
    std::string bytes = glb.substr(0, 8);
    append(bytes, uint32_t(length));
    return bytes + glb.substr(12);
  };
  EXPECT_TRUE(MeshFiles::import("a.glb", glb).notes.empty());
  for (const std::string& tail : {std::string("   "), std::string(50, ' '), std::string(40, '\xFF')}) {
    const Mesh mesh = MeshFiles::import("a.glb", glb + tail);
    EXPECT_EQ(mesh.triangles.size(), 1u);
    EXPECT_TRUE(has_note(mesh, std::to_string(tail.size()) + " bytes after its end"));
  }
  for (const size_t length : {size_t{0}, size_t{12}, glb.size() - 40, glb.size() + 99, size_t{0xFFFFFFFF}}) {
    const Mesh mesh = MeshFiles::import("a.glb", with_length(length));
    EXPECT_EQ(mesh.triangles.size(), 1u) << length;
    EXPECT_TRUE(has_note(mesh, "wrong length")) << length;
  }
}

TEST_F(Gltf, ChunksThatAreNotReadAreNotedOnce) {
  std::string more = triangle().glb();
  for (const char* type : {"XYZ1", "XYZ1", "BIN"}) {
    append(more, uint32_t{4});
    more.append(type, 4);
    more += "abcd";
  }
  const auto length = uint32_t(more.size());
  std::memcpy(more.data() + 8, &length, sizeof length);
  const Mesh mesh = MeshFiles::import("a.glb", more);
  EXPECT_EQ(mesh.triangles.size(), 1u);
  EXPECT_EQ(mesh.notes.size(), 2u);
  EXPECT_TRUE(has_note(mesh, "chunks of the type XYZ1 are not read"));
  EXPECT_TRUE(has_note(mesh, "more chunks of a kind"));
}

TEST_F(Gltf, UrisAsExportersWriteThem) {
  Document document = triangle();
  std::filesystem::create_directory(folder_ / "sub");
  const json length = document.bytes.size();
  const auto import_with = [&](const char* name, const char* uri) {
    write(name, document.bytes);
    Document external = document;
    external.root["buffers"] = {{{"byteLength", length}, {"uri", uri}}};
    external.bytes.clear();
    return import(external);
  };
  EXPECT_TRUE(has_note(import_with("sub/a.bin", "sub\\a.bin"), "read as a path"));
  EXPECT_TRUE(has_note(import_with("50%25.bin", "50%25.bin"), "read as a path"))
      << "percent signs not encoded";
  EXPECT_TRUE(import_with("b c.bin", "b%20c.bin").notes.empty());
  EXPECT_TRUE(import_with("back\\slash.bin", "back\\slash.bin").notes.empty()) << "such a file may exist";
}

TEST_F(Gltf, ABufferShorterThanDeclaredIsReadWhereItIsWhole) {
  Document document = triangle();
  document.root["buffers"] = {{{"byteLength", document.bytes.size() + 3}, {"uri", "a.bin"}}};
  const std::string bytes = document.bytes;
  document.bytes.clear();
  write("a.bin", bytes);
  const Mesh mesh = import(document);
  EXPECT_EQ(mesh.triangles.size(), 1u);
  EXPECT_TRUE(has_note(mesh, "declared with " + std::to_string(bytes.size() + 3)));
  write("a.bin", bytes.substr(0, bytes.size() - 1));
  const Refusal cut = MeshFiles::refusal("a.gltf", document.gltf());
  EXPECT_EQ(cut.exit, Exit::kInvalid);
  EXPECT_NE(cut.message.find("cut short"), cut.message.npos) << cut.message;
}

TEST_F(Gltf, ScenesWithoutADefaultAreAllRead) {
  Document document = triangle();
  document.node({{"mesh", 0}, {"translation", {5, 0, 0}}});
  document.root["scenes"] = {{{"nodes", {0}}}, {{"nodes", {1}}}};
  document.root.erase("scene");
  const Mesh mesh = import(document);
  EXPECT_EQ(mesh.triangles.size(), 2u);
  EXPECT_TRUE(has_note(mesh, "none of its scenes is the default one"));
  EXPECT_EQ(mesh.notes.size(), 1u);
  document.root["scenes"].erase(1);
  const Mesh one = import(document);
  EXPECT_EQ(one.triangles.size(), 2u);
  EXPECT_TRUE(has_note(one, "all nodes are read: 1 of them are in no scene"));
  document.root.erase("scenes");
  EXPECT_TRUE(import(document).notes.empty());
}

TEST_F(Gltf, WhatIsNotReadIsNotedOnce) {
  Document document = triangle();
  json& attributes = document.root["meshes"][0]["primitives"][0]["attributes"];
  attributes["_HEAT"] = attributes["COLOR_1"] = attributes["POSITION"];
  document.root["meshes"][0]["primitives"].push_back({{"attributes", attributes}});
  document.root["extensionsUsed"] = {"KHR_lights_punctual", "KHR_texture_transform"};
  document.root["animations"] = {json::object()};
  document.root["cameras"] = {{{"type", "perspective"}}, {{"type", "perspective"}}};
  const Mesh mesh = import(document);
  EXPECT_EQ(mesh.notes.size(), 5u);
  for (const char* part : {"_HEAT", "COLOR_1", "KHR_lights_punctual", "animations", "cameras (2)"})
    EXPECT_TRUE(has_note(mesh, part)) << part;
  EXPECT_TRUE(import(triangle()).notes.empty());
}

TEST_F(Gltf, IndicesOfEveryWidthAndNone) {
  for (const int type : {0, kUbyte, kUshort, kUint}) {
    Document document;
    json primitive = {{"attributes", {{"POSITION", document.vec3(kTriangle)}}}};
    if (type == kUbyte) primitive["indices"] = document.indices<uint8_t>({0, 1, 2, 2}, type);
    if (type == kUshort) primitive["indices"] = document.indices<uint16_t>({0, 1, 2}, type);
    if (type == kUint) primitive["indices"] = document.indices<uint32_t>({0, 1, 2, 0, 1, 3}, type);
    document.node({{"mesh", document.mesh(primitive)}});
    const Mesh mesh = import(document);
    EXPECT_EQ(mesh.triangles.size(), 1u);
    EXPECT_EQ(mesh.rejected.out_of_range, type == kUint ? 1u : 0u);
  }
}

TEST_F(Gltf, StripsAndFansKeepTheirWinding) {
  for (const bool indexed : {false, true}) {
    Document document;
    json strip = {{"attributes", {{"POSITION", document.vec3(kStrip)}}}, {"mode", 5}};
    if (indexed) strip["indices"] = document.indices<uint16_t>({0, 1, 2, 3, 4}, kUshort);
    document.node({{"mesh", document.mesh(strip)}});
    const json fan = {{"attributes", {{"POSITION", document.vec3({0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0})}}},
                      {"mode", 6}};
    document.node({{"mesh", document.mesh(fan)}});
    const json points = {{"attributes", {{"POSITION", document.vec3(kStrip)}}}, {"mode", 0}};
    document.node({{"mesh", document.mesh(points)}});
    const Mesh mesh = import(document);
    ASSERT_EQ(mesh.triangles.size(), 5u);
    for (size_t t = 0; t < 5; ++t) EXPECT_GT(face_normal(mesh, t).z, 0.99f) << t;
    EXPECT_TRUE(has_note(mesh, "points or lines"));
  }
}

TEST_F(Gltf, InterleavedAndOffsetAccessors) {
  Document document;
  std::string data = "skip";
  for (int i = 0; i < 3; ++i) {
    for (int k = 0; k < 3; ++k) append(data, kTriangle[size_t(3 * i + k)]);
    for (const float n : {0.0f, 3.0f, 4.0f}) append(data, n);
    append(data, 0.0f);
  }
  const int view = document.view(data, 28);
  const int position = document.accessor(view, kFloat, 3, "VEC3", 4),
            normal = document.accessor(view, kFloat, 3, "VEC3", 16);
  document.node({{"mesh", document.mesh({{"attributes", {{"POSITION", position}, {"NORMAL", normal}}}})}});
  const Mesh mesh = import(document);
  EXPECT_EQ(corner(mesh, 0, 2), glm::vec3(0, 1, 0));
  EXPECT_NEAR(mesh.normals[0][1].y, 0.6f, 1e-6f);
}

TEST_F(Gltf, QuantisedPositions) {
  const auto check = [&](int accessor_type, auto values, bool normalized, float want) {
    Document document;
    document.root["extensionsRequired"] = {"KHR_mesh_quantization"};
    const int position = document.values(values, accessor_type, "VEC3", 3, normalized);
    document.node(
        {{"mesh", document.mesh({{"attributes", {{"POSITION", position}}}})}, {"scale", {2, 2, 2}}});
    const Mesh mesh = import(document);
    ASSERT_EQ(mesh.triangles.size(), 1u);
    EXPECT_FLOAT_EQ(corner(mesh, 0, 1).x, 2 * want) << accessor_type;
  };
  check(kByte, std::vector<int8_t>{0, 0, 0, -128, 0, 0, 0, 127, 0}, true, -1.0f);
  check(kUbyte, std::vector<uint8_t>{0, 0, 0, 51, 0, 0, 0, 9, 0}, true, 0.2f);
  check(kShort, std::vector<int16_t>{0, 0, 0, -300, 0, 0, 0, 9, 0}, false, -300.0f);
  check(kUshort, std::vector<uint16_t>{0, 0, 0, 65535, 0, 0, 0, 9, 0}, true, 1.0f);
}

TEST_F(Gltf, SparseAccessorsOverDataAndOverNothing) {
  Document document;
  const int indices = document.view(std::string("\1\0\2\0", 4));
  std::string data;
  for (const float value : {5.0f, 0.0f, 0.0f, 0.0f, 5.0f, 0.0f}) append(data, value);
  const json sparse = {{"count", 2},
                       {"indices", {{"bufferView", indices}, {"componentType", kUshort}}},
                       {"values", {{"bufferView", document.view(data)}}}};
  const int over_data = document.vec3(kTriangle), over_zero = document.accessor(-1, kFloat, 3, "VEC3");
  document.root["accessors"][size_t(over_data)]["sparse"] = sparse;
  document.root["accessors"][size_t(over_zero)]["sparse"] = sparse;
  for (const int position : {over_data, over_zero}) {
    document.node({{"mesh", document.mesh({{"attributes", {{"POSITION", position}}}})}});
  }
  const Mesh mesh = import(document);
  ASSERT_EQ(mesh.triangles.size(), 2u);
  for (size_t t = 0; t < 2; ++t) EXPECT_EQ(corner(mesh, t, 1), glm::vec3(5, 0, 0));
  document.root["accessors"][size_t(over_data)]["sparse"]["count"] = 4000;
  EXPECT_EQ(refusal(document).exit, Exit::kInvalid);
}

TEST_F(Gltf, NodesMultiplyFromTheRootAndMirrorsFlipTheWinding) {
  Document document;
  const std::vector<float> up = {0, 0, 1, 0, 0, 1, 0, 0, 1};
  const int mesh = document.mesh(
      {{"attributes", {{"POSITION", document.vec3(kTriangle)}, {"NORMAL", document.vec3(up)}}}});
  const double half = std::sqrt(0.5);
  document.node({{"children", {1}},
                 {"translation", {10, 0, 0}},
                 {"rotation", {0, 0, half, half}}});  // 90 degrees about z
  document.node({{"mesh", mesh}, {"scale", {-2, 3, 1}}});
  const Mesh placed = import(document);
  ASSERT_EQ(placed.triangles.size(), 1u);
  EXPECT_GT(face_normal(placed, 0).z, 0.99f) << "the winding agrees with the normals again";
  EXPECT_NEAR(placed.normals[0][0].z, 1.0f, 1e-6f);
  // (0,1,0) becomes (0,3,0), then (-3,0,0), then (7,0,0); the mirror swaps corners 1 and 2.
  EXPECT_NEAR(corner(placed, 0, 1).x, 7.0f, 1e-5f);
  EXPECT_NEAR(corner(placed, 0, 2).y, -2.0f, 1e-5f);
}

TEST_F(Gltf, NormalsGoWithTheInverseTranspose) {
  Document document;
  // A plane that falls at 45 degrees; stretched by 4 along x it falls at one in four.
  const int mesh = document.mesh({{"attributes",
                                   {{"POSITION", document.vec3({0, 0, 0, 1, 0, -1, 0, 1, 0})},
                                    {"NORMAL", document.vec3({1, 0, 1, 1, 0, 1, 1, 0, 1})}}}});
  for (const double x : {4.0, -4.0})
    document.node({{"mesh", mesh}, {"matrix", {x, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1}}});
  const Mesh placed = import(document);
  ASSERT_EQ(placed.triangles.size(), 2u);
  for (size_t t = 0; t < 2; ++t) {
    EXPECT_GT(glm::dot(placed.normals[t][0], face_normal(placed, t)), 0.99999f) << t;
  }
}

TEST_F(Gltf, TheDefaultSceneOrAllRoots) {
  Document document = triangle();
  document.node({{"mesh", 0}, {"translation", {0, 0, 1}}});
  document.node({{"mesh", 0}, {"translation", {0, 0, 2}}, {"children", {1}}});
  EXPECT_EQ(import(document).triangles.size(), 3u);
  document.root["scenes"] = {{{"nodes", {1}}}, {{"nodes", {2, 0}}}};
  EXPECT_EQ(import(document).triangles.size(), 3u) << "scenes, but no default one";
  document.root["scene"] = 1;
  const Mesh mesh = import(document);
  ASSERT_EQ(mesh.triangles.size(), 3u);
  EXPECT_EQ(corner(mesh, 0, 0).z, 2.0f) << "depth first, in the scene's order";
  EXPECT_EQ(corner(mesh, 1, 0).z, 3.0f);
  EXPECT_EQ(corner(mesh, 2, 0).z, 0.0f);
  EXPECT_FALSE(has_note(mesh, "in no scene"));
  document.root["scene"] = 0;
  const Mesh part = import(document);
  EXPECT_EQ(part.triangles.size(), 1u);
  EXPECT_TRUE(has_note(part, "2 nodes with meshes are in no scene that is read"));
  document.root["scene"] = 7;
  EXPECT_EQ(refusal(document).exit, Exit::kInvalid);
}

TEST_F(Gltf, SharedNodesAreInstancesAndCyclesAreRefused) {
  Document document = triangle();
  document.node({{"children", {0}}, {"translation", {0, 0, 1}}});
  document.node({{"children", {1, 0}}});
  EXPECT_EQ(import(document).triangles.size(), 2u);
  document.root["nodes"][0]["children"] = {2};
  document.root["scenes"] = {{{"nodes", {2}}}};
  document.root["scene"] = 0;
  const Refusal cycle = refusal(document);
  EXPECT_EQ(cycle.exit, Exit::kInvalid);
  EXPECT_NE(cycle.message.find("ancestors"), std::string::npos);
}

TEST_F(Gltf, ScenesThatGrowWithoutBoundAreRefusedAtOnce) {
  for (const bool empty : {false, true}) {
    Document document = triangle();
    if (empty) document.root["nodes"][0].erase("mesh");
    for (int i = 0; i < 60; ++i) document.node({{"children", {i, i}}});
    if (empty) document.root["nodes"][60]["mesh"] = 0;
    const Refusal refused = refusal(document);
    EXPECT_EQ(refused.exit, empty ? Exit::kDone : Exit::kLimit) << refused.message;
  }
  Document wide = triangle();
  for (int i = 0; i < 20; ++i) wide.node({{"children", {i, i}}});
  EXPECT_EQ(refusal(wide, {.memory_limit = 32 << 20}).exit, Exit::kLimit);
}

TEST_F(Gltf, DeepChainsNeedNoStack) {
  Document document = triangle();
  for (int i = 0; i < 20000; ++i) document.node({{"children", {i}}});
  EXPECT_EQ(import(document).triangles.size(), 1u);
}

TEST_F(Gltf, GpuInstancing) {
  Document document;
  document.root["extensionsRequired"] = {"EXT_mesh_gpu_instancing"};
  const int mesh = document.mesh({{"attributes", {{"POSITION", document.vec3(kTriangle)}}}});
  const int translation = document.vec3({0, 0, 1, 0, 0, 2, 0, 0, 3});
  const int scale = document.vec3({1, 1, 1, 2, 2, 2, -1, 1, 1});
  document.node(
      {{"mesh", mesh},
       {"translation", {0, 0, 10}},
       {"extensions",
        {{"EXT_mesh_gpu_instancing", {{"attributes", {{"TRANSLATION", translation}, {"SCALE", scale}}}}}}}});
  const Mesh placed = import(document);
  ASSERT_EQ(placed.triangles.size(), 3u);
  EXPECT_EQ(corner(placed, 1, 1), glm::vec3(2, 0, 12));
  EXPECT_GT(face_normal(placed, 2).z, 0.99f * -1) << "mirrored, and flipped back";
  EXPECT_NEAR(std::abs(face_normal(placed, 2).z), 1.0f, 1e-6f);
}

TEST_F(Gltf, MaterialsAndTheirExtensions) {
  Document document = triangle();
  document.root["images"] = {{{"uri", "missing.webp"}}};
  document.root["textures"] = {{{"extensions", {{"EXT_texture_webp", {{"source", 99}}}}}}};
  document.root["extensionsRequired"] = {"EXT_texture_webp", "KHR_texture_transform",
                                         "KHR_materials_clearcoat"};
  document.root["materials"] = {
      {{"name", "lamp \xC3\xA9"},
       {"pbrMetallicRoughness",
        {{"baseColorFactor", {0.1, 0.2, 0.3, 0.4}},
         {"roughnessFactor", 0.5},
         {"metallicFactor", 0.25},
         {"baseColorTexture", {{"index", 0}}}}},
       {"emissiveFactor", {1, 0.5, 0}},
       {"alphaMode", "BLEND"},
       {"extensions", {{"KHR_materials_emissive_strength", {{"emissiveStrength", 10}}}}}},
      {{"extensions",
        {{"KHR_materials_pbrSpecularGlossiness",
          {{"diffuseFactor", {0.5, 0.6, 0.7, 1}}, {"glossinessFactor", 0.75}}}}}}};
  document.root["meshes"][0]["primitives"][0]["material"] = 0;
  document.root["meshes"][0]["primitives"].push_back({{"attributes", {{"POSITION", 0}}}, {"material", 1}});
  document.root["meshes"][0]["primitives"].push_back({{"attributes", {{"POSITION", 0}}}, {"material", 77}});
  const Mesh mesh = import(document);
  ASSERT_EQ(mesh.triangles.size(), 3u);
  EXPECT_TRUE(has_note(mesh, "specular colours of KHR_materials_pbrSpecularGlossiness are not read"));
  const lsp::Material& lamp = mesh.materials[mesh.material_ids[0]];
  EXPECT_EQ(lamp.name, "lamp \xC3\xA9");
  EXPECT_FLOAT_EQ(lamp.base_color.g, 0.2f);
  EXPECT_FLOAT_EQ(lamp.opacity, 0.4f);
  EXPECT_FLOAT_EQ(lamp.roughness, 0.5f);
  EXPECT_FLOAT_EQ(lamp.metallic, 0.25f);
  EXPECT_FLOAT_EQ(lamp.emission.r, 10.0f);
  EXPECT_FLOAT_EQ(lamp.emission.g, 5.0f);
  const lsp::Material& glossy = mesh.materials[mesh.material_ids[1]];
  EXPECT_FLOAT_EQ(glossy.base_color.b, 0.7f);
  EXPECT_FLOAT_EQ(glossy.roughness, 0.25f);
}

TEST_F(Gltf, UnknownRequiredExtensionsAreRefusedByName) {
  Document document = triangle();
  document.root["extensionsUsed"] = {"VENDOR_fractal_geometry"};
  EXPECT_EQ(import(document).triangles.size(), 1u) << "used, but not required";
  document.root["extensionsRequired"] = {"VENDOR_fractal_geometry"};
  const Refusal refused = refusal(document);
  EXPECT_EQ(refused.exit, Exit::kUnsupported);
  EXPECT_NE(refused.message.find("VENDOR_fractal_geometry"), std::string::npos);
  document.root["extensionsRequired"] = json::array();
  document.root["asset"]["version"] = "3.1";
  EXPECT_EQ(refusal(document).exit, Exit::kUnsupported);
}

TEST_F(Gltf, Draco) {
  draco::TriangleSoupMeshBuilder builder;
  const int faces = 50;
  builder.Start(faces);
  const int position = builder.AddAttribute(draco::GeometryAttribute::POSITION, 3, draco::DT_FLOAT32);
  const int normal = builder.AddAttribute(draco::GeometryAttribute::NORMAL, 3, draco::DT_FLOAT32);
  for (int i = 0; i < faces; ++i) {
    const float z = float(i);
    const float p[3][3] = {{0, 0, z}, {1, 0, z}, {0, 1, z}}, up[3] = {0, 0, 1};
    builder.SetAttributeValuesForFace(position, draco::FaceIndex(uint32_t(i)), p[0], p[1], p[2]);
    builder.SetAttributeValuesForFace(normal, draco::FaceIndex(uint32_t(i)), up, up, up);
  }
  const std::unique_ptr<draco::Mesh> mesh = builder.Finalize();
  for (const bool edgebreaker : {false, true}) {
    draco::Encoder encoder;
    encoder.SetAttributeQuantization(draco::GeometryAttribute::POSITION, 16);
    encoder.SetEncodingMethod(edgebreaker ? draco::MESH_EDGEBREAKER_ENCODING
                                          : draco::MESH_SEQUENTIAL_ENCODING);
    draco::EncoderBuffer buffer;
    ASSERT_TRUE(encoder.EncodeMeshToBuffer(*mesh, &buffer).ok());
    Document document;
    document.root["extensionsRequired"] = {"KHR_draco_mesh_compression"};
    const int view = document.view(std::string(buffer.data(), buffer.size()));
    const int p = document.accessor(-1, kFloat, 3 * faces, "VEC3"),
              n = document.accessor(-1, kFloat, 3 * faces, "VEC3");
    const int indices = document.accessor(-1, kUint, 3 * faces, "SCALAR");
    const int first = int(mesh->attribute(position)->unique_id()),
              second = int(mesh->attribute(normal)->unique_id());
    document.node(
        {{"mesh", document.mesh({{"attributes", {{"POSITION", p}, {"NORMAL", n}}},
                                 {"indices", indices},
                                 {"extensions",
                                  {{"KHR_draco_mesh_compression",
                                    {{"bufferView", view},
                                     {"attributes", {{"POSITION", first}, {"NORMAL", second}}}}}}}})}});
    const Mesh decoded = import(document);
    ASSERT_EQ(decoded.triangles.size(), size_t(faces));
    EXPECT_NEAR(area(decoded), faces * 0.5, 0.05);  // 16 bits over a box of 49
    for (size_t t = 0; t < size_t(faces); ++t) EXPECT_NEAR(decoded.normals[t][0].z, 1.0f, 0.01f);
    // An accessor without bytes that Draco's data does not hold is zeros.
    Document zeros = document;
    json& attributes = zeros.root["meshes"][0]["primitives"][0]["attributes"];
    attributes["COLOR_0"] = zeros.accessor(-1, kFloat, 3 * faces, "VEC3");
    EXPECT_EQ(import(zeros).color(0).base_color, glm::vec3(0));
    // Damage in every byte: read or refused, never worse.
    for (size_t i = 0; i < document.bytes.size(); i += 11) {
      Document damaged = document;
      damaged.bytes[i] = char(damaged.bytes[i] ^ (1 << i % 8));
      const Exit exit = refusal(damaged, {.memory_limit = 64 << 20}).exit;
      EXPECT_TRUE(exit == Exit::kDone || exit == Exit::kInvalid || exit == Exit::kLimit)
          << i << " " << int(exit);
    }
  }
}

TEST_F(Gltf, Meshopt) {
  const std::vector<uint32_t> order = {0, 1, 2, 2, 1, 3, 2, 3, 4};
  std::string vertices(meshopt_encodeVertexBufferBound(5, 12), '\0'),
      faces(meshopt_encodeIndexBufferBound(9, 5), '\0');
  vertices.resize(meshopt_encodeVertexBuffer(reinterpret_cast<uint8_t*>(vertices.data()), vertices.size(),
                                             kStrip.data(), 5, 12));
  faces.resize(
      meshopt_encodeIndexBuffer(reinterpret_cast<uint8_t*>(faces.data()), faces.size(), order.data(), 9));
  Document document;
  document.root["extensionsRequired"] = {"EXT_meshopt_compression"};
  document.view(vertices);
  document.view(faces);
  document.root["buffers"] = {
      json::object(),
      {{"byteLength", 96}, {"extensions", {{"EXT_meshopt_compression", {{"fallback", true}}}}}}};
  const auto compressed = [&](int source, size_t count, size_t stride, const char* mode, size_t offset) {
    json extension = document.root["bufferViews"][size_t(source)];
    extension.update({{"byteStride", stride}, {"count", count}, {"mode", mode}});
    document.root["bufferViews"].push_back({{"buffer", 1},
                                            {"byteOffset", offset},
                                            {"byteLength", count * stride},
                                            {"extensions", {{"EXT_meshopt_compression", extension}}}});
    return int(document.root["bufferViews"].size()) - 1;
  };
  const int position = document.accessor(compressed(0, 5, 12, "ATTRIBUTES", 0), kFloat, 5, "VEC3");
  const int indices = document.accessor(compressed(1, 9, 4, "TRIANGLES", 60), kUint, 9, "SCALAR");
  document.node({{"mesh", document.mesh({{"attributes", {{"POSITION", position}}}, {"indices", indices}})}});
  const Mesh mesh = import(document);
  ASSERT_EQ(mesh.triangles.size(), 3u);
  EXPECT_NEAR(area(mesh), 1.5, 1e-6);
  document.root["bufferViews"][3]["extensions"]["EXT_meshopt_compression"]["count"] = 9e15;
  EXPECT_NE(refusal(document).exit, Exit::kDone);
  document.root["bufferViews"][3]["extensions"]["EXT_meshopt_compression"]["count"] = 9;
  document.root["bufferViews"][2]["extensions"]["EXT_meshopt_compression"]["byteStride"] = 13;
  EXPECT_EQ(refusal(document).exit, Exit::kInvalid);
}

TEST_F(Gltf, AccessorsAndViewsOutsideTheirBuffers) {
  const auto refused = [&](const char* list, const char* key, const json& value) {
    Document document;
    const int position = document.vec3(kTriangle);
    const int indices = document.indices<uint16_t>({0, 1, 2}, kUshort);
    document.node(
        {{"mesh", document.mesh({{"attributes", {{"POSITION", position}}}, {"indices", indices}})}});
    document.root[list][0][key] = value;
    const Exit exit = refusal(document, {.memory_limit = 1 << 30}).exit;
    EXPECT_TRUE(exit == Exit::kInvalid || exit == Exit::kLimit)
        << list << " " << key << " " << value << " " << int(exit);
  };
  for (const json& huge :
       {json(100), json(0xFFFFFFFFu), json(0xFFFFFFFFFFFFFFFFu), json(1e18), json(0x7FFFFFFFFFFFFFFF)}) {
    refused("accessors", "count", huge);
    refused("accessors", "byteOffset", huge);
    refused("accessors", "bufferView", huge);
    refused("bufferViews", "byteOffset", huge);
    refused("bufferViews", "byteStride", huge);
    refused("bufferViews", "buffer", huge);
  }
  refused("bufferViews", "byteLength", 8);
  refused("accessors", "componentType", 5124);
  refused("accessors", "componentType", kUint);
  refused("accessors", "type", "VEC2");
  refused("accessors", "type", "MAT4");
  refused("nodes", "mesh", 5);
  refused("nodes", "children", json::array({9}));
}

TEST_F(Gltf, RefusalsNameTheAccessor) {
  const auto message = [&](int accessor, const char* key, const json& value) {
    Document document;
    const int position = document.vec3(kTriangle);
    const int indices = document.indices<uint16_t>({0, 1, 2}, kUshort);
    document.node(
        {{"mesh", document.mesh({{"attributes", {{"POSITION", position}}}, {"indices", indices}})}});
    document.root["accessors"][size_t(accessor)][key] = value;
    const Refusal refused = refusal(document);
    EXPECT_EQ(refused.exit, Exit::kInvalid) << key << value;
    return refused.message;
  };
  EXPECT_NE(message(0, "count", 4'000'000'000).find("accessor 0 reaches beyond"), std::string::npos)
      << "and not that memory is short";
  EXPECT_NE(message(1, "count", 4'000'000'000).find("accessor 1 reaches beyond"), std::string::npos);
  EXPECT_NE(message(0, "type", "VEC2").find("accessor 0"), std::string::npos);
  EXPECT_NE(message(1, "componentType", kFloat).find("accessor 1"), std::string::npos);
  const auto sparse = [](int view, int count) {
    return json{{"count", count},
                {"indices", {{"bufferView", view}, {"componentType", kUshort}}},
                {"values", {{"bufferView", 0}}}};
  };
  EXPECT_NE(message(0, "sparse", sparse(1, 4)).find("the sparse part of accessor 0 reaches"),
            std::string::npos);
}

TEST_F(Gltf, WholeNumbersMayBeWrittenAsFloats) {
  Document document;
  const int view = document.view(std::string(36, 'x'));
  document.bytes.resize(72);
  document.vec3(kTriangle);
  document.root["accessors"][0]["bufferView"] = 1.0;
  document.root["bufferViews"][size_t(view)]["byteLength"] = 36.0;
  document.node({{"mesh", document.mesh({{"attributes", {{"POSITION", 0.0}}}})}});
  EXPECT_EQ(corner(import(document), 0, 1), glm::vec3(1, 0, 0));
  for (const json& wrong : {json(0.5), json(-1), json("0"), json(true), json(1e300)}) {
    document.root["accessors"][0]["byteOffset"] = wrong;
    EXPECT_EQ(refusal(document).exit, Exit::kInvalid) << wrong;
  }
}

TEST_F(Gltf, DocumentsThatAreNone) {
  EXPECT_EQ(MeshFiles::refusal("a.gltf", "").exit, Exit::kInvalid);
  EXPECT_EQ(MeshFiles::refusal("a.gltf", "[1, 2, 3, 4, 5, 6, 7, 8, 9]").exit, Exit::kInvalid);
  EXPECT_EQ(MeshFiles::refusal("a.gltf", std::string(1'000'000, '[')).exit, Exit::kInvalid);
  EXPECT_EQ(
      MeshFiles::refusal(
          "a.gltf", "{\"asset\":{\"version\":\"2.0\"},\"buffers\":[{\"byteLength\":9,\"uri\":\"data:,x\"}]}")
          .exit,
      Exit::kInvalid);
  EXPECT_EQ(
      MeshFiles::refusal(
          "a.gltf", "{\"asset\":{\"version\":\"2.0\"},\"buffers\":[{\"byteLength\":9,\"uri\":\"gone.bin\"}]}")
          .exit,
      Exit::kFile);
  const Refusal nan = MeshFiles::refusal("a.gltf", "{\"asset\": {\"version\": \"2.0\"}, \"min\": NaN}");
  EXPECT_NE(nan.message.find("at byte 38"), nan.message.npos) << nan.message;
  const std::string glb = triangle().glb();
  EXPECT_EQ(MeshFiles::refusal("a.glb", glb.substr(0, 4) + std::string("\1\0\0\0", 4) + glb.substr(8)).exit,
            Exit::kUnsupported);
}

TEST_F(Gltf, DamagedFilesAreReadOrRefused) {
  Document document;
  const int position = document.vec3(kStrip);
  document.node({{"mesh", document.mesh({{"attributes", {{"POSITION", position}, {"NORMAL", position}}},
                                         {"indices", document.indices<uint16_t>({0, 1, 2, 3}, kUshort)},
                                         {"mode", 5}})},
                 {"children", {1}}});
  document.node({{"mesh", 0}, {"scale", {1, 2, -3}}});
  const std::string whole = document.glb();
  uint32_t seed = 7;
  const auto random = [&](size_t below) { return (seed = seed * 1664525u + 1013904223u) % uint32_t(below); };
  const lsp::ImportOptions options{.memory_limit = 64 << 20};
  size_t read = 0, refused = 0;
  for (size_t length = 0; length < whole.size(); length += 3) {
    const Exit exit = MeshFiles::refusal("a.glb", whole.substr(0, length), options).exit;
    EXPECT_EQ(exit, Exit::kInvalid) << length;
  }
  for (int i = 0; i < 1500; ++i) {
    std::string damaged = whole;
    // Mostly digits and letters, so that the text stays a document and the numbers in it go wrong.
    for (size_t k = 0; k <= random(3); ++k)
      damaged[28 + random(damaged.size() - 28)] = "0123456789-,]}\"e"[random(16)];
    const Exit exit = MeshFiles::refusal("a.glb", damaged, options).exit;
    ++(exit == Exit::kDone ? read : refused);
  }
  EXPECT_GT(read, 50u);
  EXPECT_GT(refused, 50u);
}

TEST_F(Gltf, TheHashCoversFilesAndExternalBuffersInOrder) {
  Document document = triangle();
  const std::string data = "data:application/octet-stream;base64," + base64(document.bytes);
  write("one.bin", "first");
  write("two.bin", "second");
  document.root["buffers"] = {{{"byteLength", 36}, {"uri", data}},
                              {{"byteLength", 5}, {"uri", "one.bin"}},
                              {{"byteLength", 6}, {"uri", "two.bin"}}};
  const std::string text = document.root.dump(), off = "OFF 3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
  const std::filesystem::path paths[] = {write("a.gltf", text), write("b.off", off)};
  const Mesh mesh = lsp::import_meshes(paths, {});
  ASSERT_EQ(mesh.sources.size(), 2u);
  EXPECT_EQ(mesh.sources[0], (std::vector{paths[0], folder_ / "one.bin", folder_ / "two.bin"}));
  const std::string all = text + "first" + "second" + off;
  const XXH128_hash_t want = XXH3_128bits(all.data(), all.size());
  const auto hash = lsp::hash_sources(mesh);
  EXPECT_EQ(hash[0], want.low64);
  EXPECT_EQ(hash[1], want.high64);
}

}  // namespace
