// Textures, masks, vertex colours: what of them becomes a triangle's colour.
#include <cmath>

#include "gltf_builder.h"
#include "import/texture.h"
#include "png_bytes.h"
#include "text_files.h"

namespace {

using lsp::Mesh;
using lsp::TriangleColor;
using namespace lsp_test;

float linear(int value) { return float(lsp::linear_of_srgb(value / 255.0)); }

// A square of two triangles, (0,0) (1,0) (1,1) and (0,0) (1,1) (0,1), its texture coordinates the same.
struct Square {
  Document document;
  json attributes;
  std::vector<float> uv;
  explicit Square(std::vector<float> coordinates = {0, 0, 1, 0, 1, 1, 0, 1}) : uv(std::move(coordinates)) {
    attributes = {{"POSITION", document.vec3({0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0})},
                  {"TEXCOORD_0", document.values(uv, kFloat, "VEC2", 2)}};
    document.root["materials"] = {json::object()};
  }
  json& material() { return document.root["materials"][0]; }
  json& base() { return material()["pbrMetallicRoughness"]; }
  // Appends a texture and returns a reference to it.
  json texture(const std::string& png, json sampler = json::object()) {
    document.root["images"].push_back({{"bufferView", document.view(png)}, {"mimeType", "image/png"}});
    document.root["samplers"].push_back(std::move(sampler));
    const size_t last = document.root["images"].size() - 1;
    document.root["textures"].push_back({{"source", last}, {"sampler", last}});
    return {{"index", last}};
  }
  const Document& finish() {
    document.node(
        {{"mesh", document.mesh({{"attributes", attributes},
                                 {"indices", document.indices<uint16_t>({0, 1, 2, 0, 2, 3}, kUshort)},
                                 {"material", 0}})}});
    return document;
  }
};

class GltfColor : public MeshFiles {
 protected:
  Mesh import(const Document& document) { return MeshFiles::import("a.gltf", document.gltf()); }
  Mesh import(Square& square) { return import(square.finish()); }
};

// The mean over all of a mesh's triangles, which are equally large; those left out count as not there.
TriangleColor mean(const Mesh& mesh) {
  TriangleColor sum{glm::vec3(0), glm::vec3(0), 0};
  for (size_t t = 0; t < mesh.triangles.size(); ++t) {
    const TriangleColor c = mesh.color(t);
    sum.base_color += c.base_color * c.coverage;
    sum.emission += c.emission * c.coverage;
    sum.coverage += c.coverage;
  }
  const auto count = float(mesh.primitive_count);
  return {sum.base_color / sum.coverage, sum.emission / count, sum.coverage / count};
}

void expect_color(const glm::vec3& color, const glm::vec3& want, float slack = 1e-5f) {
  for (int k = 0; k < 3; ++k) EXPECT_NEAR(color[k], want[k], slack) << k;
}

TEST_F(GltfColor, FactorTimesTexelInLinearLight) {
  Square square;
  square.base() = {{"baseColorFactor", {0.5, 1, 0.25, 1}},
                   {"baseColorTexture", square.texture(rgba_png(1, 1, {188, 10, 255, 0}))}};
  const Mesh mesh = import(square);
  ASSERT_EQ(mesh.colors.size(), 2u);
  for (const TriangleColor& c : mesh.colors) {
    expect_color(c.base_color, {0.5f * linear(188), linear(10), 0.25f});
    EXPECT_EQ(c.coverage, 1.0f) << "opaque, whatever the alpha";
  }
}

TEST_F(GltfColor, EachTriangleHasItsOwnTexels) {
  // Upper right half red, lower left blue, over 8 x 8 texels; the diagonal is half of each.
  std::vector<uint8_t> texels;
  for (int y = 0; y < 8; ++y) {
    for (int x = 0; x < 8; ++x) {
      const bool red = x > y, on = x == y;
      texels.insert(texels.end(), {uint8_t(red || on ? 255 : 0), 0, uint8_t(red ? 0 : 255), 255});
    }
  }
  Square square;
  square.base()["baseColorTexture"] = square.texture(rgba_png(8, 8, texels));
  const Mesh mesh = import(square);
  expect_color(mesh.colors[0].base_color, {1, 0, 4.0 / 32}, 1e-4f);
  expect_color(mesh.colors[1].base_color, {4.0 / 32, 0, 1}, 1e-4f);
}

TEST_F(GltfColor, EveryKindOfPng) {
  const std::string pictures[] = {
      png_bytes<uint8_t>(1, 1, PNG_FORMAT_RGB, {90, 90, 90}), png_bytes<uint8_t>(1, 1, PNG_FORMAT_GRAY, {90}),
      png_bytes<uint8_t>(1, 1, PNG_FORMAT_RGB_COLORMAP, {1}, {1, 2, 3, 90, 90, 90}),
      png_bytes<uint16_t>(1, 1, PNG_FORMAT_LINEAR_RGB, {90 * 257, 90 * 257, 90 * 257}),
      png_bytes<uint16_t>(1, 1, PNG_FORMAT_LINEAR_Y, {90 * 257})};
  for (size_t i = 0; i < std::size(pictures); ++i) {
    Square square;
    square.base()["baseColorTexture"] = square.texture(pictures[i]);
    const Mesh mesh = import(square);
    ASSERT_EQ(mesh.colors.size(), 2u) << i;
    expect_color(mesh.colors[0].base_color, glm::vec3(linear(90)));
  }
}

// Xcode's PNG: a chunk of its own, no header of zlib's, blue first, multiplied by alpha.
TEST_F(GltfColor, PngAsXcodeMakesIt) {
  const auto chunk = [](const std::string& type, const std::string& data) {
    std::string out;
    append_ordered(out, uint32_t(data.size()), true);
    return out + type + data + "crc?";
  };
  const auto png = [&](const std::string& bgra) {
    std::string row = std::string(1, '\0') + bgra, stored("\1", 1);
    append(stored, uint16_t(row.size()));
    append(stored, uint16_t(~row.size()));
    return "\x89PNG\r\n\x1a\n" + chunk("CgBI", std::string("P\0 \2", 4)) +
           chunk("IHDR", std::string("\0\0\0\1\0\0\0\1\x08\6\0\0\0", 13)) + chunk("IDAT", stored + row) +
           chunk("IEND", "");
  };
  Square square;
  square.base()["baseColorTexture"] = square.texture(png({25, 50, 100, char(128)}));
  square.material()["alphaMode"] = "BLEND";
  const Mesh mesh = import(square);
  expect_color(mesh.color(0).base_color, {linear(199), linear(100), linear(50)}, 0.01f);
  EXPECT_NEAR(mesh.color(0).coverage, 128 / 255.0f, 1e-5f);
}

// Eight by eight equal texels in CMYK, inks inverted as everywhere, with and without Adobe's marker.
TEST_F(GltfColor, JpegOfFourInks) {
  const std::string hex =
      "ffdb00430001010101010101010101010101010102010101010102010101020202020202020202030304030303030302020304"
      "030304040404040203050504040504040404ffc000140800080008044311004d11005911004b1100ffc4001500010100000000"
      "000000000000000000000a08ffc40014100100000000000000000000000000000000ffda000e0443004d0059004b00003f0048"
      "087c63cfe1ffd9";
  std::string body;
  for (size_t i = 0; i < hex.size(); i += 2) body += char(std::stoi(hex.substr(i, 2), nullptr, 16));
  const std::string start = "\xFF\xD8", marker(
                                            "\xFF\xEE\0\x0E"
                                            "Adobe\0\x64\0\0\0\0\0",
                                            16);
  for (const std::string& jpeg : {start + body, start + marker + body}) {
    Square square;
    square.base()["baseColorTexture"] = square.texture(jpeg);
    const Mesh mesh = import(square);
    ASSERT_EQ(mesh.colors.size(), 2u);
    expect_color(mesh.colors[0].base_color, {linear(200), linear(100), linear(50)}, 0.02f);
    EXPECT_TRUE(mesh.notes.empty());
  }
  for (const char orientation : {1, 6}) {
    std::string exif(
        "\xFF\xE1\0\x22"
        "Exif\0\0"
        "II*\0\x08\0\0\0"
        "\1\0"
        "\x12\1\3\0\1\0\0\0_\0\0\0"
        "\0\0\0\0",
        36);
    exif[exif.find('_')] = orientation;
    Square square;
    square.base()["baseColorTexture"] = square.texture(start + exif + body);
    const Mesh mesh = import(square);
    expect_color(mesh.colors[0].base_color, {linear(200), linear(100), linear(50)}, 0.02f);
    EXPECT_EQ(has_note(mesh, "the turn that its EXIF data ask for is not made"), orientation == 6);
    EXPECT_EQ(mesh.notes.empty(), orientation == 1);
  }
  // More codes than a byte can count, and a table that begins at its segment's last byte.
  std::string many = start + body, late = many;
  const size_t table = many.find("\xFF\xC4") + 4;
  many[table + 8] = many[table + 9] = late[table + 8] = late[table + 9] = '\xFF';
  late[table - 1] = 3;
  for (const std::string& jpeg : {many, late, "\xFF" + many}) {
    Square square;
    square.base()["baseColorTexture"] = square.texture(jpeg);
    EXPECT_TRUE(has_note(import(square), "is damaged"));
  }
}

TEST_F(GltfColor, PicturesInOtherFormatsAreNotedByTheirNames) {
  const std::pair<std::string, std::string> pictures[] = {{"DDS |", "DDS"},
                                                          {"GIF89a", "GIF"},
                                                          {"8BPS", "Photoshop"},
                                                          {"v/1\x01", "OpenEXR"},
                                                          {std::string("\0\0\0\x1C"
                                                                       "ftypavif",
                                                                       12),
                                                           "AVIF"},
                                                          {"<!DOCTYPE html>", "HTML"},
                                                          {"II*", "TIFF"}};
  for (const auto& [bytes, name] : pictures) {
    Square square;
    square.base()["baseColorTexture"] = square.texture(bytes + std::string(40, ' '));
    EXPECT_TRUE(has_note(import(square), "is " + std::string(name == "Photoshop" ? "a " : "") + name))
        << name;
  }
}

TEST_F(GltfColor, ATextureWithoutAPictureIsNotedAsThat) {
  Square square;
  json texture = square.texture("DDS ");
  square.document.root["textures"][0] = {{"extensions", {{"MSFT_texture_dds", {{"source", 0}}}}}};
  square.base()["baseColorTexture"] = texture;
  json& material = square.material();
  material["emissiveFactor"] = {1, 1, 1};
  material["emissiveTexture"] = {{"index", 7}};
  const Mesh mesh = import(square);
  EXPECT_TRUE(has_note(mesh, "texture 0 names no picture that is read; factors hold without it"));
  EXPECT_TRUE(has_note(mesh, "texture 7 is not there; factors hold without it"));
  EXPECT_TRUE(has_note(mesh, "MSFT_texture_dds"));
  EXPECT_EQ(mesh.notes.size(), 3u);
}

TEST_F(GltfColor, SamplersThatSayNothingAreNoted) {
  const auto notes_of = [&](json sampler, int number) {
    Square square;
    square.base()["baseColorTexture"] = square.texture(rgba_png(1, 1, {255, 0, 0, 255}), std::move(sampler));
    square.document.root["textures"][0]["sampler"] = number;
    return import(square);
  };
  EXPECT_TRUE(notes_of({{"wrapS", 10497}, {"wrapT", 33648}}, 0).notes.empty());
  EXPECT_TRUE(has_note(notes_of({{"wrapT", 10496}}, 0), "the wrap mode of a sampler, 10496, is not known"));
  EXPECT_TRUE(has_note(notes_of({}, 1), "a texture has a sampler that is not there, it is repeated"));
}

TEST_F(GltfColor, PicturesBesideTheFileAndInIt) {
  const std::string png = rgba_png(1, 1, {255, 0, 0, 255});
  write("a b.png", png);
  std::filesystem::create_directory(folder_ / "tex");
  write("tex/c.png", png);
  for (const std::string& uri :
       {std::string("a%20b.png"), std::string("tex\\c.png"), "data:image/png;base64," + base64(png)}) {
    Square square;
    square.base()["baseColorTexture"] = square.texture(png);
    square.document.root["images"][0] = {{"uri", uri}};
    const Mesh mesh = import(square);
    ASSERT_EQ(mesh.colors.size(), 2u) << uri;
    expect_color(mesh.colors[0].base_color, {1, 0, 0});
    EXPECT_EQ(mesh.sources[0].size(), uri[0] == 'd' ? 1u : 2u) << "a picture beside it is a source";
  }
}

TEST_F(GltfColor, WhatCannotBeReadIsNotedAndTheFactorHolds) {
  for (const std::string& bytes :
       {std::string("\xABKTX 20\xBB\r\n\x1A\n"), std::string("nonsense"), std::string()}) {
    Square square;
    square.base() = {{"baseColorFactor", {0.25, 0.5, 1, 1}},
                     {"baseColorTexture", square.texture(bytes + "    ")}};
    if (bytes.empty()) square.document.root["images"][0] = {{"uri", "gone.png"}};
    const Mesh mesh = import(square);
    EXPECT_TRUE(mesh.colors.empty());
    EXPECT_EQ(mesh.materials[mesh.material_ids[0]].base_color, glm::vec3(0.25, 0.5, 1));
    EXPECT_TRUE(has_note(mesh, "factors hold")) << bytes;
    EXPECT_EQ(mesh.notes.size(), 1u);
  }
}

TEST_F(GltfColor, APictureInKtx2IsNamedOnce) {
  // As exporters write it: no source but the extension's, which is required; used by two materials.
  Square square;
  const json texture = square.texture("\xABKTX 20\xBB\r\n\x1A\n and so on");
  json& root = square.document.root;
  root["images"][0]["name"] = "bark";
  root["images"][0]["mimeType"] = "image/ktx2";
  root["textures"][0] = {{"extensions", {{"KHR_texture_basisu", {{"source", 0}}}}}};
  root["extensionsRequired"] = root["extensionsUsed"] = {"KHR_texture_basisu"};
  square.base() = {{"baseColorFactor", {0.25, 0.5, 1, 1}}, {"baseColorTexture", texture}};
  root["materials"].push_back(square.material());
  root["materials"][1]["alphaMode"] = "MASK";
  square.finish();
  json second = root["meshes"][0]["primitives"][0];
  second["material"] = 1;
  root["meshes"][0]["primitives"].push_back(second);
  const Mesh mesh = import(square.document);
  EXPECT_EQ(mesh.triangles.size(), 4u);
  ASSERT_EQ(mesh.notes.size(), 1u);
  EXPECT_TRUE(has_note(mesh, "the picture bark is KTX2, which is not read; factors hold without it"));
}

TEST_F(GltfColor, WrapModes) {
  // Left texel white, right black; coordinates from 1 to 2 see the same, the last column, or both turned
  // round.
  const std::string png = rgba_png(2, 1, {255, 255, 255, 255, 0, 0, 0, 255});
  const auto white_at = [&](int wrap, float u) {
    Square square({u, 0, u + 0.5f, 0, u + 0.5f, 1, u, 1});
    square.base()["baseColorTexture"] = square.texture(png, {{"wrapS", wrap}, {"magFilter", 9728}});
    return mean(import(square)).base_color.x;
  };
  constexpr int kRepeat = 10497, kClamp = 33071, kMirror = 33648;
  for (const float u : {0.0f, 0.5f, 1.0f, 1.5f, -0.5f, -1.0f}) {
    const bool left = u - std::floor(u) < 0.5f, odd = int(std::floor(u)) % 2 != 0;
    EXPECT_NEAR(white_at(kRepeat, u), left ? 1 : 0, 1e-5f) << u;
    EXPECT_NEAR(white_at(kMirror, u), left != odd ? 1 : 0, 1e-5f) << u;
    EXPECT_NEAR(white_at(kClamp, u), u < 0.5f ? 1 : 0, 1e-5f) << u;
  }
}

TEST_F(GltfColor, TextureTransformsAndSecondCoordinates) {
  // Four texels: red, green; blue, white.
  const std::string png =
      rgba_png(2, 2, {255, 0, 0, 255, 0, 255, 0, 255, 0, 0, 255, 255, 255, 255, 255, 255});
  const auto color_with = [&](const json& transform, int set) {
    Square square;
    square.attributes["TEXCOORD_1"] = square.document.values<uint8_t>(
        {128, 0, 255, 0, 255, 127, 128, 127}, kUbyte, "VEC2", 2, true);  // the upper right texel
    json texture = square.texture(png, {{"magFilter", 9728}});
    if (set) texture["texCoord"] = set;
    if (!transform.is_null()) texture["extensions"]["KHR_texture_transform"] = transform;
    square.base()["baseColorTexture"] = texture;
    return mean(import(square)).base_color;
  };
  expect_color(color_with(nullptr, 0), {0.5, 0.5, 0.5}, 1e-4f);
  expect_color(color_with(nullptr, 1), {0, 1, 0}, 0.01f);
  expect_color(color_with({{"texCoord", 1}}, 0), {0, 1, 0}, 0.01f);
  expect_color(color_with({{"offset", {0.5, 0.5}}, {"scale", {0.5, 0.5}}}, 0), {1, 1, 1}, 1e-4f);
  // The extension's own example: the lower left quarter, turned.
  expect_color(color_with({{"offset", {0, 1}}, {"rotation", 1.57079632679}, {"scale", {0.5, 0.5}}}, 0),
               {0, 0, 1}, 1e-4f);
}

TEST_F(GltfColor, VertexColoursOfEveryTypeMultiply) {
  for (const int type : {kFloat, kUbyte, kUshort}) {
    for (const bool textured : {false, true}) {
      Square square;
      if (textured) square.base()["baseColorTexture"] = square.texture(rgba_png(1, 1, {188, 188, 188, 255}));
      square.base()["baseColorFactor"] = {1, 0.5, 1, 1};
      Document& d = square.document;
      square.attributes["COLOR_0"] =
          type == kFloat
              ? d.values<float>({0.2f, 0.2f, 0, 0.2f, 0.2f, 0, 0.2f, 0.2f, 0, 0.2f, 0.2f, 0}, type, "VEC3", 3)
          : type == kUbyte
              ? d.values<uint8_t>({51, 51, 0, 255, 51, 51, 0, 255, 51, 51, 0, 255, 51, 51, 0, 255}, type,
                                  "VEC4", 4, true)
              : d.values<uint16_t>({13107, 13107, 0, 13107, 13107, 0, 13107, 13107, 0, 13107, 13107, 0}, type,
                                   "VEC3", 3, true);
      const float texel = textured ? linear(188) : 1;
      expect_color(import(square).colors[0].base_color, {0.2f * texel, 0.1f * texel, 0});
    }
  }
}

TEST_F(GltfColor, VertexColoursBeyondOneAreCutWithANote) {
  Square square;
  square.attributes["COLOR_0"] = square.document.vec3({2, 0.5, 0, 2, 0.5, 0, 2, 0.5, 0, 2, 0.5, 0});
  const Mesh mesh = import(square);
  expect_color(mesh.color(0).base_color, {1, 0.5, 0});
  EXPECT_TRUE(has_note(mesh, "vertex colours are cut to the range from 0 to 1"));
}

TEST_F(GltfColor, VertexColoursVaryOverTheTexels) {
  // The texture is white on the left half; red grows from left to right.
  Square square;
  square.base()["baseColorTexture"] =
      square.texture(rgba_png(2, 1, {255, 255, 255, 255, 0, 0, 0, 255}), {{"magFilter", 9728}});
  square.attributes["COLOR_0"] =
      square.document.values<float>({0, 1, 1, 1, 1, 1, 1, 1, 1, 0, 1, 1}, kFloat, "VEC3", 3);
  expect_color(mean(import(square)).base_color, {0.125, 0.5, 0.5}, 1e-5f);
}

TEST_F(GltfColor, EmissionIsTheMeanOfItsTexels) {
  std::vector<uint8_t> texels(64 * 4, 0);
  for (size_t i = 3; i < texels.size(); i += 4) texels[i] = 255;
  texels[4 * 6] = texels[4 * 6 + 1] = texels[4 * 6 + 2] =
      255;  // column 6 of the first row: the first triangle's
  Square square;
  square.material() = {{"emissiveFactor", {1, 0.5, 0}},
                       {"emissiveTexture", square.texture(rgba_png(8, 8, texels))},
                       {"extensions", {{"KHR_materials_emissive_strength", {{"emissiveStrength", 64}}}}}};
  const Mesh mesh = import(square);
  expect_color(mesh.colors[0].emission, {2, 1, 0}, 1e-4f);
  expect_color(mesh.colors[1].emission, {0, 0, 0}, 1e-4f);
}

TEST_F(GltfColor, MasksAreTheShareThatIsThere) {
  // One texel of four passes the cutoff; only its colour counts.
  const std::string png = rgba_png(2, 2, {255, 0, 0, 200, 0, 255, 0, 10, 0, 255, 0, 10, 0, 255, 0, 10});
  Square square;
  square.material() = {{"alphaMode", "MASK"},
                       {"pbrMetallicRoughness", {{"baseColorTexture", square.texture(png)}}}};
  square.material()["alphaCutoff"] = 0.5;
  const TriangleColor color = mean(import(square.finish()));
  EXPECT_NEAR(color.coverage, 0.25f, 1e-5f);
  expect_color(color.base_color, {1, 0, 0});
  square.base()["baseColorFactor"] = {1, 1, 1, 0.5};  // 200/255/2 is below the cutoff
  EXPECT_EQ(MeshFiles::refusal("a.gltf", square.document.gltf()).exit, lsp::Exit::kInvalid)
      << "nothing is left";
  square.material()["alphaCutoff"] = 0.01;
  EXPECT_NEAR(mean(import(square.document)).coverage, 1.0f, 1e-5f);
}

TEST_F(GltfColor, BlendingIsTheMeanOfAlpha) {
  const std::string png = rgba_png(2, 1, {255, 0, 0, 255, 0, 0, 255, 51});
  Square square;
  square.material() = {{"alphaMode", "BLEND"},
                       {"pbrMetallicRoughness",
                        {{"baseColorFactor", {1, 1, 1, 0.5}}, {"baseColorTexture", square.texture(png)}}}};
  const TriangleColor color = mean(import(square));
  EXPECT_NEAR(color.coverage, 0.5f * 0.6f, 1e-5f);
  expect_color(color.base_color, {1 / 1.2, 0, 0.2 / 1.2}, 1e-4f);
}

TEST_F(GltfColor, GlassLetsItsShareOfLightPass) {
  const auto glass = [&](const json& transmission, double metallic, const std::string& mode = "OPAQUE") {
    Square square;
    square.base() = {{"baseColorFactor", {1, 1, 1, 0.5}}, {"metallicFactor", metallic}};
    square.material()["emissiveFactor"] = {1, 1, 1};
    square.material()["alphaMode"] = mode;
    json extension = transmission;
    if (extension.contains("transmissionTexture"))
      extension["transmissionTexture"] = square.texture(rgba_png(2, 1, {255, 0, 0, 255, 0, 255, 255, 255}));
    square.material()["extensions"]["KHR_materials_transmission"] = extension;
    return import(square);
  };
  // 9 % of light from all sides is reflected, however clear the glass.
  const Mesh clear = glass({{"transmissionFactor", 1}}, 0);
  EXPECT_NEAR(clear.color(0).coverage, 0.09f, 1e-6f);
  EXPECT_NEAR(clear.color(0).coverage * clear.color(0).emission.x, 1, 1e-6f) << "it glows as it is";
  ASSERT_EQ(clear.notes.size(), 1u);
  EXPECT_TRUE(has_note(clear, "glass (KHR_materials_transmission) passes straight on"));
  EXPECT_NEAR(glass({{"transmissionFactor", 0.5}}, 0).color(0).coverage, 1 - 0.5f * 0.91f, 1e-6f);
  EXPECT_NEAR(glass({{"transmissionFactor", 1}}, 0, "BLEND").color(0).coverage, 0.5f * 0.09f, 1e-6f);
  EXPECT_EQ(glass({{"transmissionFactor", 1}}, 1).color(0).coverage, 1) << "metals let none pass";
  EXPECT_NEAR(glass({{"transmissionFactor", 1}, {"transmissionTexture", nullptr}}, 0).color(0).coverage,
              1 - 0.5f * 0.91f, 1e-6f);
  EXPECT_TRUE(glass({{"transmissionFactor", 0}}, 0).notes.empty());
}

TEST_F(GltfColor, TransparentTrianglesAreLeftOut) {
  Square square({0, 0, 0.5, 0, 0.5, 0.5, 0, 0.5});
  square.document.root["materials"].push_back(square.material());
  square.material() = {{"alphaMode", "BLEND"}, {"pbrMetallicRoughness", {{"baseColorFactor", {1, 1, 1, 0}}}}};
  square.finish();
  square.document.root["meshes"][0]["primitives"].push_back(
      {{"attributes", square.attributes}, {"material", 1}});
  const Mesh mesh = import(square.document);
  EXPECT_EQ(mesh.triangles.size(), 1u);
  EXPECT_EQ(mesh.rejected.invisible, 2u);
  EXPECT_TRUE(has_note(mesh, "wholly transparent"));
}

TEST_F(GltfColor, VertexAlphaIsCoverageWhereTheMaterialBlends) {
  Square square;
  square.attributes["COLOR_0"] =
      square.document.values<float>({1, 1, 1, 1, 1, 1, 1, 0, 1, 1, 1, 0, 1, 1, 1, 1}, kFloat, "VEC4", 4);
  square.finish();
  EXPECT_TRUE(import(square.document).colors.empty() || mean(import(square.document)).coverage == 1.0f);
  square.material()["alphaMode"] = "BLEND";
  EXPECT_NEAR(mean(import(square.document)).coverage, 0.5f, 1e-3f);
  square.material()["alphaMode"] = "MASK";
  EXPECT_NEAR(mean(import(square.document)).coverage, 0.5f, 1e-6f);
  square.material()["alphaCutoff"] = 0.25;
  EXPECT_NEAR(mean(import(square.document)).coverage, 0.75f, 1e-6f);
}

// Alpha falls from 1 to 0 over the square; the cutoff of 0.25 is met where it is 0.5 times the texel's.
TEST_F(GltfColor, VertexAlphaTimesATexelsMeetsTheCutoffAnywhereInIt) {
  const auto coverage = [&](uint32_t size, std::vector<float> uv) {
    Square square(std::move(uv));
    square.attributes["COLOR_0"] =
        square.document.values<float>({1, 1, 1, 1, 1, 1, 1, 0, 1, 1, 1, 0, 1, 1, 1, 1}, kFloat, "VEC4", 4);
    std::vector<uint8_t> texels;
    for (uint32_t i = 0; i < size * size; ++i) texels.insert(texels.end(), {255, 255, 255, 128});
    square.base()["baseColorTexture"] = square.texture(rgba_png(size, size, texels));
    square.material()["alphaMode"] = "MASK";
    square.material()["alphaCutoff"] = 0.25 * 256 / 255;
    return mean(import(square)).coverage;
  };
  for (const uint32_t size : {1u, 2u, 3u, 5u, 128u})
    EXPECT_NEAR(coverage(size, {0, 0, 1, 0, 1, 1, 0, 1}), 0.5f, size < 128 && size > 1 ? 1e-5f : 0.01f)
        << size;
  EXPECT_NEAR(coverage(3, {0.5, 0.5, 0.5, 0.5, 0.5, 0.5, 0.5, 0.5}), 0.5f, 0.01f) << "all on one texel";
}

// Where parts are missing, what is left has its own emission, whichever of the pictures is the finer one.
TEST_F(GltfColor, EmissionWhereSomethingIsThere) {
  const std::vector<uint8_t> left_there = {255, 255, 255, 255, 255, 255, 255, 0},
                             right_glows = {0, 0, 0, 255, 255, 255, 255, 255};
  // Columns of `pattern`, each repeated.
  const auto wide = [](const std::vector<uint8_t>& pattern, uint32_t columns) {
    std::vector<uint8_t> texels;
    for (uint32_t i = 0; i < columns * columns; ++i) {
      const size_t half = i % columns < columns / 2 ? 0 : 4;
      texels.insert(texels.end(), pattern.begin() + half, pattern.begin() + half + 4);
    }
    return rgba_png(columns, columns, texels);
  };
  for (const auto& [base, glow] : {std::pair(2u, 16u), std::pair(16u, 2u), std::pair(8u, 8u)}) {
    Square square;
    square.base()["baseColorTexture"] = square.texture(wide(left_there, base));
    square.material()["emissiveTexture"] = square.texture(wide(right_glows, glow));
    square.material()["emissiveFactor"] = {1, 1, 1};
    square.material()["alphaMode"] = "MASK";
    Mesh mesh = import(square);
    EXPECT_NEAR(mean(mesh).coverage, 0.5f, 1e-5f) << base;
    EXPECT_NEAR(mean(mesh).emission.r, 0.0f, 1e-5f) << base;
    square.material()["alphaMode"] = "BLEND";
    EXPECT_NEAR(mean(import(square.document)).emission.r, 0.0f, 1e-5f) << base;
    square.material()["alphaMode"] = "OPAQUE";
    EXPECT_NEAR(mean(import(square.document)).emission.r, 0.5f, 1e-5f) << base;
  }
  Square glass;
  glass.base()["baseColorFactor"] = {1, 1, 1, 0.5};
  glass.base()["baseColorTexture"] = glass.texture(rgba_png(1, 1, {255, 255, 255, 255}));
  glass.material()["emissiveTexture"] = glass.texture(wide(right_glows, 16));
  glass.material()["emissiveFactor"] = {1, 1, 1};
  glass.material()["alphaMode"] = "BLEND";
  EXPECT_NEAR(mean(import(glass)).emission.r, 0.25f, 1e-5f) << "half of it lit, half of that there";
}

TEST_F(GltfColor, LargePicturesAndManyTilesKeepTheirMean) {
  // 1000 x 600 texels, no power of two, dark but for one row in fifty and a smooth ramp.
  const uint32_t width = 1000, height = 600;
  std::vector<uint8_t> texels;
  double sum = 0;
  for (uint32_t y = 0; y < height; ++y) {
    for (uint32_t x = 0; x < width; ++x) {
      const auto value = uint8_t(y % 50 == 0 ? 255 : x / 8);
      sum += double(linear(value));
      texels.insert(texels.end(), {value, value, value, 255});
    }
  }
  const std::string png = rgba_png(width, height, texels);
  for (const float tiles : {1.0f, 7.0f, 1e5f, 1e9f}) {
    Square square({0, 0, tiles, 0, tiles, tiles, 0, tiles});
    square.base()["baseColorTexture"] = square.texture(png);
    EXPECT_NEAR(mean(import(square)).base_color.x, sum / (width * height), 1.0 / 255) << tiles;
  }
}

TEST_F(GltfColor, SmallTrianglesTakeWhatLiesBetweenTexels) {
  const std::string png = rgba_png(2, 1, {0, 0, 0, 255, 255, 255, 255, 255});
  const auto at = [&](float u, bool point) {
    Square square(point ? std::vector<float>{u, 0, u, 0, u, 0, u, 0}
                        : std::vector<float>{u - 0.01f, 0, u + 0.01f, 0, u + 0.01f, 0.01f, u - 0.01f, 0.01f});
    square.base()["baseColorTexture"] = square.texture(png);
    return mean(import(square)).base_color.x;
  };
  for (const bool point : {false, true}) {
    EXPECT_NEAR(at(0.25f, point), 0.0f, 0.02f);
    EXPECT_NEAR(at(0.5f, point), 0.5f, 0.02f);
    EXPECT_NEAR(at(0.75f, point), 1.0f, 0.02f);
  }
}

TEST_F(GltfColor, GlossAndMetalAreMeansAndOtherTexturesAreNoted) {
  Square square;
  const json texture = square.texture(rgba_png(2, 1, {0, 255, 0, 255, 0, 51, 51, 255}));
  square.base() = {{"metallicRoughnessTexture", texture}, {"roughnessFactor", 0.5}};
  square.material()["normalTexture"] = texture;
  square.material()["occlusionTexture"] = texture;
  const Mesh mesh = import(square);
  EXPECT_NEAR(mesh.materials[mesh.material_ids[0]].roughness, 0.3f, 1e-5f);
  EXPECT_NEAR(mesh.materials[mesh.material_ids[0]].metallic, 0.1f, 1e-5f);
  for (const char* part : {"metallic-roughness", "normal", "occlusion"})
    EXPECT_TRUE(has_note(mesh, part)) << part;
}

TEST_F(GltfColor, SpecularGlossinessHasItsOwnTexture) {
  Square square;
  const json texture = square.texture(rgba_png(1, 1, {255, 0, 0, 127}));
  square.material()["extensions"]["KHR_materials_pbrSpecularGlossiness"] = {{"diffuseFactor", {0.5, 1, 1, 1}},
                                                                            {"diffuseTexture", texture}};
  square.material()["alphaMode"] = "BLEND";
  const Mesh mesh = import(square);
  expect_color(mesh.colors[0].base_color, {0.5, 0, 0});
  EXPECT_NEAR(mesh.colors[0].coverage, 127 / 255.0f, 1e-4f);
}

TEST_F(GltfColor, SpecularGlossinessHasMetals) {
  const auto read = [&](json glossy, const std::vector<uint8_t>& texel) {
    Square square;
    if (!texel.empty()) glossy["specularGlossinessTexture"] = square.texture(rgba_png(1, 1, texel));
    square.material()["extensions"]["KHR_materials_pbrSpecularGlossiness"] = glossy;
    return import(square);
  };
  const Mesh gold = read({{"diffuseFactor", {0, 0, 0, 1}}, {"specularFactor", {1, 0.75, 0.25}}}, {});
  expect_color(gold.color(0).base_color, {1, 0.75, 0.25});
  EXPECT_EQ(gold.materials[gold.material_ids[0]].metallic, 1);
  EXPECT_TRUE(gold.notes.empty());

  const Mesh textured =
      read({{"diffuseFactor", {0, 0, 0, 1}}, {"specularFactor", {1, 1, 0.5}}}, {255, 188, 255, 51});
  expect_color(textured.color(0).base_color, {1, linear(188), 0.5});
  EXPECT_NEAR(textured.materials[textured.material_ids[0]].roughness, 0.8f, 1e-5f);
  EXPECT_TRUE(has_note(textured, "specular-glossiness textures are taken as their mean"));

  const Mesh coal = read({{"diffuseFactor", {0, 0, 0, 1}}, {"specularFactor", {0.04, 0.04, 0.04}}}, {});
  EXPECT_EQ(coal.materials[coal.material_ids[0]].metallic, 0);
  expect_color(coal.color(0).base_color, {0, 0, 0});
}

TEST_F(GltfColor, DamagedPicturesAndReferencesDoNoHarm) {
  std::vector<uint8_t> texels(16 * 16 * 4);
  for (size_t i = 0; i < texels.size(); ++i) texels[i] = uint8_t(i * 37);
  const std::string png = rgba_png(16, 16, texels);
  const lsp::ImportOptions options{.memory_limit = 64 << 20};
  for (size_t i = 0; i < png.size(); i += 7) {
    std::string damaged = png;
    damaged[i] = char(damaged[i] ^ (1 << i % 8));
    Square square;
    square.base()["baseColorTexture"] = square.texture(damaged);
    const lsp::Exit exit = MeshFiles::refusal("a.gltf", square.finish().gltf(), options).exit;
    EXPECT_TRUE(exit == lsp::Exit::kDone || exit == lsp::Exit::kLimit) << i << " " << int(exit);
  }
  for (const json& index : {json(99), json(-1), json("x"), json(1e300), json(0.5)}) {
    Square square;
    square.base()["baseColorTexture"] = square.texture(png);
    square.finish();
    for (const char* list : {"textures"}) {
      for (const char* key : {"source", "sampler"}) {
        Document broken = square.document;
        broken.root[list][0][key] = index;
        EXPECT_EQ(import(broken).triangles.size(), 2u) << key << index;
      }
    }
    square.base()["baseColorTexture"]["index"] = index;
    EXPECT_EQ(import(square.document).triangles.size(), 2u) << index;
  }
}

}  // namespace
