// A two-storey atrium in metres: an open court of 18 x 9 under the sky, aisles of 3 about it with groin
// vaults below and coffered galleries above, an apse at the far end (+x), cloth, fountain, sculptures and
// plants.
//
//        z ^   +--------------------------------------------+
//     +7.5 |   | aisle                                      |
//     +4.5 |   |   o----o----o----o----o----o----o  columns |___
//          |   |   |  steps down to the court     |         |   \ apse
//        0 |   |   o          fountain            o         |    )
//          |   |   |                              |         |___/
//     -4.5 |   |   o----o----o----o----o----o----o          |
//     -7.5 |   +--------------------------------------------+
//             -12 -9                              9        12   > x
#include <array>
#include <cmath>
#include <glm/gtc/constants.hpp>

#include "architecture.h"
#include "ornaments.h"

namespace lsp::sample {
namespace {

constexpr float kPi = 3.14159265358979324f;
constexpr float kBay = 3.0f;
constexpr int kBaysX = 6;
constexpr int kBaysZ = 3;
constexpr float kCourtX = kBay * kBaysX / 2;  // column axes
constexpr float kCourtZ = kBay * kBaysZ / 2;
constexpr float kWallX = kCourtX + kBay;  // inner faces of the outer walls
constexpr float kWallZ = kCourtZ + kBay;
constexpr float kArcade = 0.5f;      // thickness of the arcade walls
constexpr float kSpring = 3.2f;      // lower arches spring here
constexpr float kArchRadius = 1.2f;  // both storeys
constexpr float kGallery = 5.2f;     // floor of the upper storey
constexpr float kUpperSpring = 7.75f;
constexpr float kCeiling = 9.35f;  // underside of the gallery's coffered ceiling
constexpr float kTop = 10.0f;
constexpr float kCourtFloor = -0.45f;
constexpr float kApseZ = 1.9f;  // half the apse's opening

struct Palette {
  int limestone, marble, plaster, terracotta, ochre, tile_light, tile_dark, relief, gold, bronze, crimson,
      teal, saffron, indigo, linen, leaf, water, jade, coffer_blue, iron, lamp, red_wall, dado;
};

class AtriumBuilder {
 public:
  explicit AtriumBuilder(const Detail& detail) : detail_(detail) { make_palette(); }

  Scene build() {
    make_floor();
    make_steps();
    make_lower_storey();
    make_upper_storey();
    make_outer_walls();
    make_apse();
    make_cloth();
    make_ornaments();
    make_lanterns();
    return std::move(scene_);
  }

 private:
  int material(const char* name, glm::vec3 color, float roughness, float metallic = 0.0f,
               glm::vec3 emission = glm::vec3(0.0f)) {
    scene_.materials.push_back({name, color, roughness, metallic, emission});
    return static_cast<int>(scene_.materials.size()) - 1;
  }

  void make_palette() {
    m_.limestone = material("limestone", {0.72f, 0.66f, 0.56f}, 0.85f);
    m_.marble = material("marble", {0.82f, 0.80f, 0.76f}, 0.35f);
    m_.plaster = material("plaster", {0.78f, 0.72f, 0.62f}, 0.95f);
    m_.terracotta = material("terracotta", {0.62f, 0.27f, 0.15f}, 0.9f);
    m_.ochre = material("ochre", {0.75f, 0.50f, 0.20f}, 0.95f);
    m_.tile_light = material("tile light", {0.70f, 0.64f, 0.55f}, 0.22f);
    m_.tile_dark = material("tile dark", {0.24f, 0.16f, 0.13f}, 0.18f);
    m_.relief = material("relief tile", {0.66f, 0.60f, 0.52f}, 0.30f);
    m_.gold = material("gold", {0.95f, 0.68f, 0.28f}, 0.25f, 1.0f);
    m_.bronze = material("bronze", {0.60f, 0.38f, 0.22f}, 0.35f, 1.0f);
    m_.crimson = material("crimson cloth", {0.62f, 0.045f, 0.06f}, 0.9f);
    m_.teal = material("teal cloth", {0.04f, 0.36f, 0.38f}, 0.9f);
    m_.saffron = material("saffron cloth", {0.85f, 0.47f, 0.06f}, 0.9f);
    m_.indigo = material("indigo cloth", {0.10f, 0.11f, 0.44f}, 0.9f);
    m_.linen = material("linen", {0.84f, 0.78f, 0.66f}, 0.95f);
    m_.leaf = material("leaf", {0.13f, 0.36f, 0.07f}, 0.6f);
    m_.water = material("water", {0.05f, 0.16f, 0.18f}, 0.05f);
    m_.jade = material("jade", {0.25f, 0.55f, 0.38f}, 0.25f);
    m_.coffer_blue = material("coffer blue", {0.10f, 0.20f, 0.42f}, 0.8f);
    m_.iron = material("iron", {0.10f, 0.09f, 0.08f}, 0.5f, 1.0f);
    m_.lamp = material("lamp", {0.9f, 0.8f, 0.6f}, 1.0f, 0.0f, glm::vec3(1.0f, 0.58f, 0.24f) * 60.0f);
    m_.red_wall = material("red wall", {0.48f, 0.12f, 0.08f}, 0.95f);
    m_.dado = material("dado", {0.16f, 0.28f, 0.26f}, 0.6f);
  }

  int mesh(const char* name, std::vector<Part> parts) {
    scene_.meshes.push_back({name, std::move(parts)});
    return static_cast<int>(scene_.meshes.size()) - 1;
  }

  // Places a mesh; `turn_rad` is about the vertical.
  void place(int mesh_id, glm::vec3 at, float turn_rad = 0.0f, glm::vec3 scale = glm::vec3(1.0f)) {
    Node node;
    node.name = scene_.meshes[static_cast<size_t>(mesh_id)].name;
    node.mesh = mesh_id;
    node.translation = at;
    node.rotation = glm::angleAxis(turn_rad, glm::vec3(0, 1, 0));
    node.scale = scale;
    scene_.nodes.push_back(std::move(node));
    scene_.roots.push_back(static_cast<int>(scene_.nodes.size()) - 1);
  }

  // Centres of the court's 18 bays, each with the turn that makes +z of the bay face the court.
  template <typename Visit>
  void for_each_bay(const Visit& visit) const {
    for (int i = 0; i < kBaysX; ++i) {
      const float x = (static_cast<float>(i) + 0.5f) * kBay - kCourtX;
      visit(glm::vec3(x, 0, -kCourtZ), 0.0f);
      visit(glm::vec3(x, 0, kCourtZ), kPi);
    }
    for (int i = 0; i < kBaysZ; ++i) {
      const float z = (static_cast<float>(i) + 0.5f) * kBay - kCourtZ;
      visit(glm::vec3(-kCourtX, 0, z), kPi / 2);
      visit(glm::vec3(kCourtX, 0, z), -kPi / 2);
    }
  }

  // Axes of the 14 columns between the bays; the four corners carry piers.
  template <typename Visit>
  void for_each_column(const Visit& visit) const {
    for (int i = 1; i < kBaysX; ++i) {
      const float x = static_cast<float>(i) * kBay - kCourtX;
      visit(glm::vec3(x, 0, -kCourtZ));
      visit(glm::vec3(x, 0, kCourtZ));
    }
    for (int i = 1; i < kBaysZ; ++i) {
      const float z = static_cast<float>(i) * kBay - kCourtZ;
      visit(glm::vec3(-kCourtX, 0, z));
      visit(glm::vec3(kCourtX, 0, z));
    }
  }

  template <typename Visit>
  void for_each_corner(const Visit& visit) const {
    for (const float x : {-kCourtX, kCourtX}) {
      for (const float z : {-kCourtZ, kCourtZ}) visit(glm::vec3(x, 0, z));
    }
  }

  // Centres of the 22 square bays of the aisles.
  template <typename Visit>
  void for_each_aisle_bay(const Visit& visit) const {
    for (int i = 0; i < kBaysX + 2; ++i) {
      for (int k = 0; k < kBaysZ + 2; ++k) {
        if (i > 0 && i <= kBaysX && k > 0 && k <= kBaysZ) continue;
        visit(glm::vec3((static_cast<float>(i) + 0.5f) * kBay - kWallX, 0,
                        (static_cast<float>(k) + 0.5f) * kBay - kWallZ));
      }
    }
  }

  void make_floor() {
    // A bed under everything, so that no ray leaves through a joint between tiles.
    place(mesh("bed", {{m_.tile_dark, box({-kWallX - 0.4f, -0.9f, -kWallZ - 0.4f},
                                          {kWallX + 0.4f, kCourtFloor - 0.035f, kWallZ + 0.4f})}}),
          {0, 0, 0});
    const float edge_x = kCourtX - 0.45f;
    const float edge_z = kCourtZ - 0.45f;
    Surface aisle_bed;
    const float top = -0.03f;
    append(aisle_bed, box({-kWallX, -0.5f, -kWallZ}, {kWallX, top, -edge_z}));
    append(aisle_bed, box({-kWallX, -0.5f, edge_z}, {kWallX, top, kWallZ}));
    append(aisle_bed, box({-kWallX, -0.5f, -edge_z}, {-edge_x, top, edge_z}));
    append(aisle_bed, box({edge_x, -0.5f, -edge_z}, {kWallX, top, edge_z}));
    place(mesh("aisle bed", {{m_.tile_dark, std::move(aisle_bed)}}), {0, 0, 0});

    const int light = mesh("tile light", {{m_.tile_light, plain_tile(0.75f)}});
    const int dark = mesh("tile dark", {{m_.tile_dark, plain_tile(0.75f)}});
    const int relief = mesh("relief tile", {{m_.relief, relief_tile(detail_, 0.75f)}});
    const int relief_dark = mesh("relief tile dark", {{m_.terracotta, relief_tile(detail_, 0.75f)}});
    if (!detail_.shows(0.3f)) {
      place(mesh("aisle floor", {{m_.tile_light, aisle_floor_quads()}}), {0, 0, 0});
      place(mesh("court floor", {{m_.relief, box({-7.5f, -0.6f, -3.0f}, {7.5f, kCourtFloor, 3.0f})}}),
            {0, 0, 0});
      return;
    }
    for (int i = 0; i < 32; ++i) {
      for (int k = 0; k < 20; ++k) {
        const float x = (static_cast<float>(i) + 0.5f) * 0.75f - kWallX;
        const float z = (static_cast<float>(k) + 0.5f) * 0.75f - kWallZ;
        const bool in_court = std::abs(x) < 7.5f && std::abs(z) < 3.0f;
        const bool in_aisle = std::abs(x) > edge_x - 0.2f || std::abs(z) > edge_z - 0.2f;
        if (in_court) {
          const bool border = std::abs(x) > 6.75f || std::abs(z) > 2.25f;
          place(border ? relief_dark : relief, {x, kCourtFloor, z});
        } else if (in_aisle) {
          place((i + k) % 2 == 0 ? light : dark, {x, 0, z});
        }
      }
    }
  }

  static Surface aisle_floor_quads() {
    Surface s;
    const float edge_x = kCourtX - 0.45f;
    const float edge_z = kCourtZ - 0.45f;
    append(s, box({-kWallX, -0.05f, -kWallZ}, {kWallX, 0, -edge_z}));
    append(s, box({-kWallX, -0.05f, edge_z}, {kWallX, 0, kWallZ}));
    append(s, box({-kWallX, -0.05f, -edge_z}, {-edge_x, 0, edge_z}));
    append(s, box({edge_x, -0.05f, -edge_z}, {kWallX, 0, edge_z}));
    return s;
  }

  // Three steps down into the court, all around: frames of boxes.
  void make_steps() {
    Surface s;
    for (int i = 0; i < 3; ++i) {
      const float top = -0.15f * static_cast<float>(i);
      const float inset = 0.45f + 0.35f * static_cast<float>(i);
      const float x = kCourtX - inset;
      const float z = kCourtZ - inset;
      const float depth = 0.35f;
      append(s, box({-x - depth, -0.6f, z}, {x + depth, top, z + depth}));
      append(s, box({-x - depth, -0.6f, -z - depth}, {x + depth, top, -z}));
      append(s, box({x, -0.6f, -z}, {x + depth, top, z}));
      append(s, box({-x - depth, -0.6f, -z}, {-x, top, z}));
    }
    place(mesh("court steps", {{m_.marble, std::move(s)}}), {0, 0, 0});
  }

  int column_mesh(const char* name, float radius, float height, bool fluted) {
    const float base = 1.1f * radius;
    const float head = 2.3f * radius;
    Surface stone = attic_base(detail_, radius, base);
    append(stone, fluted ? fluted_shaft(detail_, radius, base, height - head)
                         : smooth_shaft(detail_, radius, base, height - head));
    const float neck = radius * 0.83f;
    Surface top;
    append(top, capital(detail_, neck, head), raised(height - head));
    std::vector<Part> parts = {{fluted ? m_.limestone : m_.marble, std::move(stone)},
                               {m_.limestone, std::move(top)}};
    if (detail_.shows(0.4f)) {
      Surface leaves;
      append(leaves, capital_leaves(detail_, neck, head), raised(height - head));
      parts.push_back({m_.limestone, std::move(leaves)});
    }
    return mesh(name, std::move(parts));
  }

  static glm::mat4 raised(float y) {
    glm::mat4 m(1.0f);
    m[3] = glm::vec4(0, y, 0, 1);
    return m;
  }

  void make_lower_storey() {
    const int column = column_mesh("column", 0.25f, kSpring, true);
    for_each_column([&](glm::vec3 at) { place(column, at); });
    Surface pier_stone = box({-0.30f, 0, -0.30f}, {0.30f, kSpring, 0.30f});
    append(pier_stone, box({-0.36f, 0, -0.36f}, {0.36f, 0.4f, 0.36f}));
    append(pier_stone, box({-0.37f, kSpring - 0.22f, -0.37f}, {0.37f, kSpring, 0.37f}));
    const int pier = mesh("pier", {{m_.limestone, std::move(pier_stone)}});
    for_each_corner([&](glm::vec3 at) { place(pier, at); });

    const int wall = mesh("arcade", {{m_.plaster, arched_wall(kBay, kGallery - 0.3f - kSpring, kArcade,
                                                              kArchRadius, detail_.steps(22, 4))},
                                     {m_.limestone, archivolt(detail_, kArchRadius, kArcade)}});
    for_each_bay([&](glm::vec3 at, float turn) { place(wall, at + glm::vec3(0, kSpring, 0), turn); });

    // Undersides of the arcade walls beside the arches' feet.
    const int foot = mesh(
        "arch foot",
        {{m_.limestone, box({-0.31f, -0.02f, -kArcade / 2 - 0.02f}, {0.31f, 0.12f, kArcade / 2 + 0.02f})}});
    for_each_column([&](glm::vec3 at) {
      const bool along_x = std::abs(at.z) > kCourtZ - 0.1f;
      place(foot, at + glm::vec3(0, kSpring, 0), along_x ? 0.0f : kPi / 2);
    });

    const int vault = mesh("groin vault", {{m_.plaster, groin_vault(detail_, kBay)}});
    for_each_aisle_bay([&](glm::vec3 at) { place(vault, at + glm::vec3(0, kSpring, 0)); });
    const int rib = mesh("vault rib", {{m_.ochre, vault_rib(detail_, kBay / 2, 0.26f, 0.10f)}});
    for (int i = 0; i <= kBaysX; ++i) {
      const float x = static_cast<float>(i) * kBay - kCourtX;
      for (const float z : {-kCourtZ - kBay / 2, kCourtZ + kBay / 2}) place(rib, {x, kSpring, z}, kPi / 2);
    }
    for (int i = 0; i <= kBaysZ; ++i) {
      const float z = static_cast<float>(i) * kBay - kCourtZ;
      for (const float x : {-kCourtX - kBay / 2, kCourtX + kBay / 2}) place(rib, {x, kSpring, z});
    }

    // The floor of the gallery over the vaults, and the cornice between the storeys.
    Surface slab;
    const float inner_x = kCourtX - kArcade / 2;
    const float inner_z = kCourtZ - kArcade / 2;
    append(slab,
           box({-kWallX - 0.2f, kGallery - 0.32f, -kWallZ - 0.2f}, {kWallX + 0.2f, kGallery, -inner_z}));
    append(slab, box({-kWallX - 0.2f, kGallery - 0.32f, inner_z}, {kWallX + 0.2f, kGallery, kWallZ + 0.2f}));
    append(slab, box({-kWallX - 0.2f, kGallery - 0.32f, -inner_z}, {-inner_x, kGallery, inner_z}));
    append(slab, box({inner_x, kGallery - 0.32f, -inner_z}, {kWallX + 0.2f, kGallery, inner_z}));
    place(mesh("gallery floor", {{m_.limestone, std::move(slab)}}), {0, 0, 0});
    make_cornice("lower cornice", kGallery - 0.34f,
                 {{0.0f, 0.0f},
                  {0.05f, 0.04f},
                  {0.05f, 0.12f},
                  {0.14f, 0.20f},
                  {0.14f, 0.26f},
                  {0.22f, 0.30f},
                  {0.22f, 0.38f},
                  {0.0f, 0.38f}});
  }

  // A moulding around the court on the court's side of the arcade walls.
  void make_cornice(const char* name, float y, const std::vector<glm::vec2>& profile) {
    const int along_x = mesh(name, {{m_.limestone, moulding(profile, 2 * kCourtX)}});
    const int along_z = mesh(name, {{m_.limestone, moulding(profile, 2 * kCourtZ)}});
    place(along_x, {0, y, -kCourtZ + kArcade / 2});
    place(along_x, {0, y, kCourtZ - kArcade / 2}, kPi);
    place(along_z, {-kCourtX + kArcade / 2, y, 0}, kPi / 2);
    place(along_z, {kCourtX - kArcade / 2, y, 0}, -kPi / 2);
  }

  void make_upper_storey() {
    const float sill = kGallery + 0.04f;
    const float rail = 1.05f;
    const int column = column_mesh("upper column", 0.19f, kUpperSpring - sill - rail, false);
    const int pedestal_block =
        mesh("column pedestal", {{m_.limestone, [&] {
                                    Surface s = box({-0.27f, 0, -0.27f}, {0.27f, rail, 0.27f});
                                    append(s, box({-0.31f, 0, -0.31f}, {0.31f, 0.16f, 0.31f}));
                                    append(s, box({-0.31f, rail - 0.12f, -0.31f}, {0.31f, rail, 0.31f}));
                                    return s;
                                  }()}});
    for_each_column([&](glm::vec3 at) {
      place(pedestal_block, at + glm::vec3(0, sill, 0));
      place(column, at + glm::vec3(0, sill + rail, 0));
    });
    const int pier =
        mesh("upper pier", {{m_.limestone, box({-0.27f, 0, -0.27f}, {0.27f, kUpperSpring - sill, 0.27f})}});
    for_each_corner([&](glm::vec3 at) { place(pier, at + glm::vec3(0, sill, 0)); });

    const int wall = mesh("upper arcade", {{m_.plaster, arched_wall(kBay, kTop - 0.3f - kUpperSpring, kArcade,
                                                                    kArchRadius, detail_.steps(22, 4))},
                                           {m_.limestone, archivolt(detail_, kArchRadius, kArcade)}});
    const int foot = mesh(
        "upper arch foot",
        {{m_.limestone, box({-0.31f, -0.02f, -kArcade / 2 - 0.02f}, {0.31f, 0.10f, kArcade / 2 + 0.02f})}});
    for_each_bay([&](glm::vec3 at, float turn) { place(wall, at + glm::vec3(0, kUpperSpring, 0), turn); });
    for_each_column([&](glm::vec3 at) {
      const bool along_x = std::abs(at.z) > kCourtZ - 0.1f;
      place(foot, at + glm::vec3(0, kUpperSpring, 0), along_x ? 0.0f : kPi / 2);
    });

    // Balustrades.
    const int plinth =
        mesh("balustrade", {{m_.limestone, [&] {
                               Surface s = box({-1.25f, 0, -0.12f}, {1.25f, 0.14f, 0.12f});
                               append(s, box({-1.25f, rail - 0.14f, -0.13f}, {1.25f, rail - 0.02f, 0.13f}));
                               return s;
                             }()}});
    Surface row;
    const Surface one = baluster(detail_, rail - 0.28f);
    const int balusters = detail_.shows(0.3f) ? 9 : 4;
    for (int i = 0; i < balusters; ++i) {
      const float x = 2.4f * ((static_cast<float>(i) + 0.5f) / static_cast<float>(balusters) - 0.5f);
      glm::mat4 at(1.0f);
      at[3] = glm::vec4(x, 0.14f, 0, 1);
      append(row, one, at);
    }
    const int baluster_row = mesh("balusters", {{m_.marble, std::move(row)}});
    for_each_bay([&](glm::vec3 at, float turn) {
      place(plinth, at + glm::vec3(0, sill, 0), turn);
      if (detail_.shows(0.15f)) place(baluster_row, at + glm::vec3(0, sill, 0), turn);
    });

    // Coffered ceilings, roof, and the cornice against the sky.
    const bool fine = detail_.shows(0.4f);
    const int per_side = fine ? 3 : 1;
    const int ceiling = mesh("coffers", {{m_.ochre, coffers(kBay, per_side)},
                                         {m_.coffer_blue, coffer_rosettes(detail_, kBay, per_side)}});
    for_each_aisle_bay([&](glm::vec3 at) { place(ceiling, at + glm::vec3(0, kCeiling, 0)); });
    Surface roof;
    const float inner_x = kCourtX - kArcade / 2;
    const float inner_z = kCourtZ - kArcade / 2;
    const float under = kCeiling + 0.31f;
    append(roof, box({-kWallX - 0.4f, under, -kWallZ - 0.4f}, {kWallX + 0.4f, kTop, -inner_z}));
    append(roof, box({-kWallX - 0.4f, under, inner_z}, {kWallX + 0.4f, kTop, kWallZ + 0.4f}));
    append(roof, box({-kWallX - 0.4f, under, -inner_z}, {-inner_x, kTop, inner_z}));
    append(roof, box({inner_x, under, -inner_z}, {kWallX + 0.4f, kTop, inner_z}));
    place(mesh("roof", {{m_.terracotta, std::move(roof)}}), {0, 0, 0});
    make_cornice("upper cornice", kTop - 0.42f,
                 {{0.0f, 0.0f},
                  {0.06f, 0.05f},
                  {0.06f, 0.14f},
                  {0.18f, 0.24f},
                  {0.18f, 0.32f},
                  {0.30f, 0.40f},
                  {0.30f, 0.50f},
                  {0.0f, 0.50f}});
  }

  void make_outer_walls() {
    const float x = kWallX;
    const float z = kWallZ;
    const float thick = 0.4f;
    Surface lower;
    Surface upper;
    // Two colours: cream below, Pompeian red above. The wall at +x opens for the apse.
    for (Surface* s : {&lower, &upper}) {
      const float y0 = s == &lower ? -0.6f : kGallery;
      const float y1 = s == &lower ? kGallery : kTop;
      append(*s, box({-x - thick, y0, -z - thick}, {x + thick, y1, -z}));
      append(*s, box({-x - thick, y0, z}, {x + thick, y1, z + thick}));
      append(*s, box({-x - thick, y0, -z}, {-x, y1, z}));
      if (s == &upper) append(*s, box({x, y0, -z}, {x + thick, y1, z}));
    }
    append(lower, box({x, -0.6f, -z}, {x + thick, kSpring, -kApseZ}));
    append(lower, box({x, -0.6f, kApseZ}, {x + thick, kSpring, z}));
    append(lower, box({x, kSpring, -z}, {x + thick, kGallery, -3.0f}));
    append(lower, box({x, kSpring, 3.0f}, {x + thick, kGallery, z}));
    place(mesh("walls", {{m_.plaster, std::move(lower)}, {m_.red_wall, std::move(upper)}}), {0, 0, 0});
    const int apse_arch =
        mesh("apse arch",
             {{m_.plaster, arched_wall(6.0f, kGallery - kSpring, thick, kApseZ, detail_.steps(32, 6))},
              {m_.limestone, archivolt(detail_, kApseZ, thick)}});
    place(apse_arch, {x + thick / 2, kSpring, 0}, -kPi / 2);

    // Pilasters at each bay, and a dado between them.
    const int pilaster =
        mesh("pilaster", {{m_.limestone, [&] {
                             Surface s = box({-0.19f, 0, 0}, {0.19f, kSpring, 0.14f});
                             append(s, box({-0.25f, 0, 0}, {0.25f, 0.35f, 0.19f}));
                             append(s, box({-0.26f, kSpring - 0.2f, 0}, {0.26f, kSpring, 0.20f}));
                             return s;
                           }()}});
    const int dado = mesh("dado", {{m_.dado, [&] {
                                      Surface s = box({-1.31f, 0, 0}, {1.31f, 0.95f, 0.04f});
                                      append(s, box({-1.31f, 0.95f, 0}, {1.31f, 1.03f, 0.07f}));
                                      append(s, box({-1.31f, 0, 0.04f}, {1.31f, 0.15f, 0.07f}));
                                      return s;
                                    }()}});
    for (int i = 0; i <= kBaysX; ++i) {
      const float at = static_cast<float>(i) * kBay - kCourtX;
      place(pilaster, {at, 0, -z});
      place(pilaster, {at, 0, z}, kPi);
    }
    for (int i = 0; i <= kBaysZ; ++i) {
      const float at = static_cast<float>(i) * kBay - kCourtZ;
      place(pilaster, {-x, 0, at}, kPi / 2);
      if (std::abs(at) > kApseZ) place(pilaster, {x, 0, at}, -kPi / 2);
    }
    for (int i = 0; i < kBaysX + 2; ++i) {
      const float at = (static_cast<float>(i) + 0.5f) * kBay - kWallX;
      place(dado, {at, 0, -z});
      place(dado, {at, 0, z}, kPi);
    }
    for (int i = 0; i < kBaysZ + 2; ++i) {
      const float at = (static_cast<float>(i) + 0.5f) * kBay - kWallZ;
      place(dado, {-x, 0, at}, kPi / 2);
      if (std::abs(at) > 3.5f) place(dado, {x, 0, at}, -kPi / 2);
    }
  }

  void make_apse() {
    const float x = kWallX + 0.35f;
    // A floor of semicircular steps up to the statue.
    Surface steps;
    for (int i = 0; i < 4; ++i) {
      const float r = 2.6f - 0.38f * static_cast<float>(i);
      const float y = 0.14f * static_cast<float>(i + 1);
      append(steps,
             lathe(creased({{r, -0.1f}, {r, y - 0.02f}, {r + 0.03f, y}, {0.0f, y}}), detail_.steps(40, 8)));
    }
    place(mesh("apse steps", {{m_.marble, std::move(steps)}}), {x + 0.2f, 0, 0});
    const int niche = mesh("apse", {{m_.indigo, niche_wall(detail_, kApseZ + 0.15f, kSpring + 0.1f)},
                                    {m_.gold, [&] {
                                       Surface s;
                                       append(s, half_dome(detail_, kApseZ + 0.15f), raised(kSpring));
                                       return s;
                                     }()}});
    place(niche, {x, 0, 0});
    // Behind the niche, so that no light leaks in from outside.
    place(mesh("apse shell",
               {{m_.plaster,
                 [&] {
                   Surface s = box({x + kApseZ + 0.4f, -0.6f, -3.0f}, {x + kApseZ + 0.6f, 6.0f, 3.0f});
                   append(s, box({x, -0.6f, -3.2f}, {x + kApseZ + 0.6f, 6.0f, -3.0f}));
                   append(s, box({x, -0.6f, 3.0f}, {x + kApseZ + 0.6f, 6.0f, 3.2f}));
                   append(s, box({x, 5.9f, -3.2f}, {x + kApseZ + 0.6f, 6.1f, 3.2f}));
                   append(s, box({x, -0.7f, -3.2f}, {x + kApseZ + 0.6f, -0.05f, 3.2f}));
                   return s;
                 }()}}),
          {0, 0, 0});
    const int stand = mesh("statue stand", {{m_.marble, pedestal(detail_, 0.5f, 0.75f)}});
    place(stand, {x + 0.35f, 0.56f, 0});
    const int statue = mesh("gyroid", {{m_.marble, gyroid_sphere(detail_)}});
    place(statue, {x + 0.35f, 0.56f + 0.75f + 0.80f, 0}, 0.4f, glm::vec3(0.85f));
    // A row of lamps at the foot of the half dome.
    const int lamp = mesh("apse lamp", {{m_.lamp, lantern_glass(0.0f)}});
    for (int i = 1; i < 6; ++i) {
      const float angle = kPi * (static_cast<float>(i) / 6.0f - 0.5f);
      place(lamp, {x + 1.85f * std::cos(angle), kSpring + 0.05f, 1.85f * std::sin(angle)}, 0,
            glm::vec3(0.8f));
    }
  }

  void make_cloth() {
    const std::array<int, 4> colors = {m_.crimson, m_.teal, m_.saffron, m_.indigo};
    const Surface rod = lathe(creased({{0.0f, -1.25f}, {0.025f, -1.25f}, {0.025f, 1.25f}, {0.0f, 1.25f}}),
                              detail_.steps(10, 3));
    Surface rod_along_x;
    glm::mat4 lay(0.0f);
    lay[0] = glm::vec4(0, -1, 0, 0);
    lay[1] = glm::vec4(1, 0, 0, 0);
    lay[2] = glm::vec4(0, 0, 1, 0);
    lay[3] = glm::vec4(0, 0, 0, 1);
    append(rod_along_x, rod, lay);
    const int rod_mesh = mesh("rod", {{m_.bronze, std::move(rod_along_x)}});

    // Banners over the balustrades of the long sides.
    std::array<int, 4> banners{};
    for (size_t i = 0; i < 4; ++i) {
      banners[i] = mesh("banner", {{colors[i], banner(detail_, 1.25f, 3.0f, static_cast<int>(i))}});
    }
    const float face = kCourtZ - kArcade / 2 - 0.52f;
    for (int i = 0; i < kBaysX; ++i) {
      const float x = (static_cast<float>(i) + 0.5f) * kBay - kCourtX;
      const bool north = i % 2 == 1;
      const glm::vec3 at(x, kGallery + 1.0f, north ? -face : face);
      place(banners[static_cast<size_t>((i / 2 + (north ? 0 : 2)) % 4)], at, north ? 0.0f : kPi);
      place(rod_mesh, at, 0.0f, glm::vec3(0.62f, 1.0f, 1.0f));
    }

    // Tied curtains in some of the lower arches, one mirrored by turning it about.
    struct Curtain {
      int bay;
      float side;
      size_t color;
    };
    for (const Curtain& curtain :
         {Curtain{1, -1.0f, 0}, Curtain{4, -1.0f, 2}, Curtain{2, 1.0f, 1}, Curtain{5, 1.0f, 0}}) {
      const float x = (static_cast<float>(curtain.bay) + 0.5f) * kBay - kCourtX;
      const glm::vec3 at(x, kSpring - 0.05f, curtain.side * kCourtZ);
      const int cloth =
          mesh("curtain", {{colors[curtain.color], tied_curtain(detail_, 1.15f, 3.0f, curtain.bay)}});
      place(cloth, at + glm::vec3(-1.2f, 0, 0));
      place(cloth, at + glm::vec3(1.2f, 0, 0), kPi);
      place(rod_mesh, at);
    }

    // Cloths slung across the court under the sky.
    const float span = 2 * kCourtZ - kArcade;
    const int cream = mesh("awning", {{m_.linen, awning(detail_, 1.9f, span, 1.15f, 1)}});
    const int red = mesh("awning", {{m_.crimson, awning(detail_, 1.5f, span, 1.35f, 2)}});
    const int gold = mesh("awning", {{m_.saffron, awning(detail_, 1.5f, span, 1.25f, 3)}});
    place(red, {2.0f, kTop - 0.75f, 0});
    place(cream, {4.6f, kTop - 0.65f, 0});
    place(gold, {7.2f, kTop - 0.75f, 0});
  }

  void make_ornaments() {
    const int fountain =
        mesh("fountain", {{m_.marble, fountain_stone(detail_)}, {m_.water, fountain_water(detail_)}});
    place(fountain, {0.8f, kCourtFloor, 0}, 0, glm::vec3(1.15f));
    const int knot = mesh("torus knot", {{m_.gold, torus_knot(detail_, 2, 3)}});
    place(knot, {0.8f, kCourtFloor + 1.26f * 1.15f + 0.42f, 0}, 0.3f, glm::vec3(0.62f));

    // Vases on stands along the court, taken from a few designs.
    const int stand = mesh("stand", {{m_.marble, pedestal(detail_, 0.30f, 0.85f)}});
    const Surface vase = twisted_vase(detail_);
    const std::array<int, 3> vases = {mesh("vase", {{m_.jade, vase}}), mesh("vase", {{m_.indigo, vase}}),
                                      mesh("vase", {{m_.terracotta, vase}})};
    int k = 0;
    for (const float x : {-6.0f, 3.0f, 6.0f}) {
      for (const float z : {-2.45f, 2.45f}) {
        place(stand, {x, kCourtFloor, z});
        place(vases[static_cast<size_t>(k % 3)], {x, kCourtFloor + 0.85f, z}, 0.7f * static_cast<float>(k),
              glm::vec3(0.72f));
        ++k;
      }
    }
    const int block =
        mesh("block", {{m_.limestone, bevelled_slab({-0.42f, 0, -0.42f}, {0.42f, 0.8f, 0.42f}, 0.03f)}});
    const int figure = mesh("figure", {{m_.bronze, blob_figure(detail_)}});
    const int reef = mesh("coral", {{m_.terracotta, coral(detail_)}});
    place(block, {-3.0f, kCourtFloor, -2.4f});
    place(figure, {-3.0f, kCourtFloor + 0.8f + 0.88f, -2.4f}, 0.9f, glm::vec3(0.92f));
    place(block, {-3.2f, kCourtFloor, 2.4f});
    place(reef, {-3.2f, kCourtFloor + 0.8f + 0.52f, 2.4f}, 0.0f, glm::vec3(0.62f));

    const int pot_mesh = mesh("pot", {{m_.terracotta, pot(detail_)}});
    std::array<int, 3> palms{};
    for (size_t i = 0; i < palms.size(); ++i) {
      palms[i] = mesh("palm", {{m_.leaf, palm_leaves(detail_, static_cast<int>(i))}});
    }
    if (!detail_.shows(0.15f)) return;
    const std::array<glm::vec3, 10> spots = {{{-7.0f, kCourtFloor, -2.6f},
                                              {-7.0f, kCourtFloor, 2.6f},
                                              {7.05f, kCourtFloor, -2.6f},
                                              {7.05f, kCourtFloor, 2.6f},
                                              {11.3f, 0, -2.9f},
                                              {11.3f, 0, 2.9f},
                                              {1.5f, 0, -6.9f},
                                              {-4.5f, 0, 6.9f},
                                              {4.5f, kGallery, -5.6f},
                                              {-1.5f, kGallery, 5.6f}}};
    for (size_t i = 0; i < spots.size(); ++i) {
      const float turn = 1.3f * static_cast<float>(i);
      place(pot_mesh, spots[i], turn);
      place(palms[i % palms.size()], spots[i], turn);
    }
  }

  void make_lanterns() {
    if (!detail_.shows(0.1f)) return;
    const float drop = 1.35f;
    const int lantern =
        mesh("lantern", {{m_.iron, lantern_frame(detail_, drop)}, {m_.lamp, lantern_glass(drop)}});
    int i = 0;
    for_each_aisle_bay([&](glm::vec3 at) {
      // Every second bay, chequerwise.
      if (i++ % 2 == 0) place(lantern, at + glm::vec3(0, kSpring + kBay / 2, 0));
    });
  }

  Detail detail_;
  Scene scene_;
  Palette m_{};
};

}  // namespace

Scene make_atrium(const Detail& detail) { return AtriumBuilder(detail).build(); }

}  // namespace lsp::sample
