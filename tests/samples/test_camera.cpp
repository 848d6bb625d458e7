// The view that lsp-render chooses for a scene that nobody has seen yet.
#include <gtest/gtest.h>

#include <array>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <nlohmann/json.hpp>

#include "camera.h"
#include "exposure.h"
#include "shell.h"

namespace lsp::sample {
namespace {

// An .obj file in the making.
class Mesh {
 public:
  // Corners of a quad, counter-clockwise from its front.
  void add_quad(const std::array<glm::vec3, 4>& corners) {
    for (const glm::vec3& p : corners) text_ += "v " + words(p) + "\n";
    text_ += "f -4 -3 -2 -1\n";
    corners_.insert(corners_.end(), corners.begin(), corners.end());
  }
  // Without the face towards -z if `open`; `inward`: its faces look inside.
  void add_box(glm::vec3 lo, glm::vec3 hi, bool inward, bool open = false) {
    for (int axis = 0; axis < 3; ++axis) {
      for (int side = 0; side < 2; ++side) {
        if (open && axis == 2 && side == 0) continue;
        const int u = (axis + 1) % 3;
        const int v = (axis + 2) % 3;
        std::array<glm::vec3, 4> corners;
        for (int i = 0; i < 4; ++i) {
          glm::vec3& p = corners[static_cast<size_t>(i)];
          p[axis] = side == 1 ? hi[axis] : lo[axis];
          p[u] = i == 1 || i == 2 ? hi[u] : lo[u];
          p[v] = i >= 2 ? hi[v] : lo[v];
        }
        if ((side == 0) != inward) std::swap(corners[1], corners[3]);
        add_quad(corners);
      }
    }
  }
  // Hills of height `up` along y, or along z.
  void add_terrain(float height, bool z_up) {
    const auto at = [&](int i, int j) {
      const auto x = static_cast<float>(i);
      const auto y = static_cast<float>(j);
      const float rise = height * std::sin(x) * std::sin(0.7f * y);
      return z_up ? glm::vec3(x, y, rise) : glm::vec3(x, rise, -y);
    };
    for (int i = 0; i < 20; ++i) {
      for (int j = 0; j < 20; ++j) add_quad({at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)});
    }
  }
  // A wall of `lo` to `hi` across x, with a window from a quarter to half of either side.
  void add_window_wall(float x, glm::vec2 lo, glm::vec2 hi, bool towards_x) {
    const auto add = [&](glm::vec2 a, glm::vec2 b) {
      std::array<glm::vec3, 4> corners = {glm::vec3(x, a.x, a.y), glm::vec3(x, b.x, a.y),
                                          glm::vec3(x, b.x, b.y), glm::vec3(x, a.x, b.y)};
      if (!towards_x) std::swap(corners[1], corners[3]);
      add_quad(corners);
    };
    const glm::vec2 a = glm::mix(lo, hi, 0.25f), b = glm::mix(lo, hi, 0.52f);
    add(lo, {a.x, hi.y});
    add({b.x, lo.y}, hi);
    add({a.x, lo.y}, {b.x, a.y});
    add({a.x, b.y}, {b.x, hi.y});
  }
  // Tapers from a square of 2 at -2 to one of 1 at 2 along z, or along y.
  void add_bust(bool z_up) {
    const auto at = [&](int corner, bool top) {
      const float half = top ? 0.5f : 1.0f;
      const glm::vec2 p(corner == 0 || corner == 3 ? -half : half, corner < 2 ? -half : half);
      const float height = top ? 2.0f : -2.0f;
      return z_up ? glm::vec3(p, height) : glm::vec3(p.x, height, -p.y);
    };
    for (int i = 0; i < 4; ++i) {
      const int next = (i + 1) % 4;
      add_quad({at(i, false), at(next, false), at(next, true), at(i, true)});
    }
    add_quad({at(3, false), at(2, false), at(1, false), at(0, false)});
    const glm::vec3 tip = z_up ? glm::vec3(0, 0, 3) : glm::vec3(0, 3, 0);
    for (int i = 0; i < 4; ++i) add_quad({at(i, true), at((i + 1) % 4, true), tip, tip});
  }
  // A pipe along y, of radii 1.8 and 2.
  void add_pipe() {
    const auto at = [](int i, float radius, float y) {
      const float angle = 0.3926991f * static_cast<float>(i);
      return glm::vec3(radius * std::cos(angle), y, radius * std::sin(angle));
    };
    for (int i = 0; i < 16; ++i) {
      add_quad({at(i, 2, -1), at(i, 2, 1), at(i + 1, 2, 1), at(i + 1, 2, -1)});
      add_quad({at(i + 1, 1.8f, -1), at(i + 1, 1.8f, 1), at(i, 1.8f, 1), at(i, 1.8f, -1)});
      add_quad({at(i, 2, 1), at(i, 1.8f, 1), at(i + 1, 1.8f, 1), at(i + 1, 2, 1)});
      add_quad({at(i + 1, 2, -1), at(i + 1, 1.8f, -1), at(i, 1.8f, -1), at(i, 2, -1)});
    }
  }
  const std::string& text() const { return text_; }  // as .obj
  std::string stl() const {
    std::string stl = "solid s\n";
    const std::vector<glm::vec3> corners = soup();
    for (size_t i = 0; i < corners.size(); i += 3) {
      stl += "facet normal 0 0 0\nouter loop\n";
      for (size_t k = 0; k < 3; ++k) stl += "vertex " + words(corners[i + k]) + "\n";
      stl += "endloop\nendfacet\n";
    }
    return stl + "endsolid s\n";
  }
  // Corners of triangles, three each.
  std::vector<glm::vec3> soup() const {
    std::vector<glm::vec3> soup;
    for (size_t i = 0; i + 3 < corners_.size(); i += 4) {
      for (const size_t k : {0, 1, 2, 0, 2, 3}) soup.push_back(corners_[i + k]);
    }
    return soup;
  }

 private:
  static std::string words(glm::vec3 p) {
    return std::to_string(p.x) + " " + std::to_string(p.y) + " " + std::to_string(p.z);
  }
  std::string text_;
  std::vector<glm::vec3> corners_;  // of quads
};

class DefaultView : public ::testing::Test {
 protected:
  void bake(const Mesh& mesh, const std::string& name = "mesh.obj") {
    if (name == "mesh.obj") std::ofstream(folder_ / name) << mesh.text();
    if (name == "mesh.stl") std::ofstream(folder_ / name) << mesh.stl();
    if (name == "mesh.gltf") write_gltf(mesh.soup());
    ASSERT_EQ(test::shell("lsp-bake " + file(name) + " -o " + file("mesh.lsp") + " --base wide --quiet"), 0);
  }
  void write_gltf(const std::vector<glm::vec3>& soup) {
    const size_t bytes = soup.size() * sizeof soup[0];
    std::ofstream(folder_ / "mesh.bin", std::ios::binary)
        .write(reinterpret_cast<const char*>(soup.data()), static_cast<std::streamsize>(bytes));
    std::ofstream(folder_ / "mesh.gltf") << nlohmann::json{
        {"asset", {{"version", "2.0"}}},
        {"buffers", {{{"uri", "mesh.bin"}, {"byteLength", bytes}}}},
        {"bufferViews", {{{"buffer", 0}, {"byteLength", bytes}}}},
        {"accessors",
         {{{"bufferView", 0}, {"componentType", 5126}, {"count", soup.size()}, {"type", "VEC3"}}}},
        {"meshes", {{{"primitives", {{{"attributes", {{"POSITION", 0}}}}}}}}},
        {"nodes", {{{"mesh", 0}}}}};
  }
  nlohmann::json render(const std::string& options = "") {
    EXPECT_EQ(test::shell("lsp-render " + file("mesh.lsp") + " -o " + file("x.png") + " -o " + file("x.pfm") +
                          " --size 64x36 --json " +
                          (options.find("--samples") == options.npos ? "--samples 4 " : "") + options +
                          " > " + file("out") + " 2> " + file("err")),
              0);
    std::ifstream out(folder_ / "out");
    return nlohmann::json::parse(out);
  }
  glm::vec3 eye(const nlohmann::json& report) {
    glm::vec3 eye;
    EXPECT_EQ(
        std::sscanf(report.at("camera").get<std::string>().c_str(), "%f,%f,%f:", &eye.x, &eye.y, &eye.z), 3);
    return eye;
  }
  std::string errors() const { return test::read_bytes(folder_ / "err"); }
  std::string file(const std::string& name) const { return (folder_ / name).string(); }

  const test::TemporaryFolder temporary_;
  const std::filesystem::path folder_ = temporary_.path();
};

TEST_F(DefaultView, AnObjectFillsThePicture) {
  for (const glm::vec3 size :
       {glm::vec3(1, 1, 1), glm::vec3(1e-4f, 5e-4f, 1e-4f), glm::vec3(3000, 20, 100)}) {
    SCOPED_TRACE(size.x);
    Mesh mesh;
    mesh.add_box(glm::vec3(7) * size, glm::vec3(8) * size, false);
    bake(mesh);
    const Camera camera = parse_camera(render("--up y").at("camera"));
    const glm::vec3 forward = glm::normalize(camera.target - camera.eye);
    const glm::vec3 right = glm::normalize(glm::cross(forward, camera.up));
    const float tangent = std::tan(glm::radians(0.5f * camera.fov_degrees));
    glm::vec2 lo(2);
    glm::vec2 hi(-2);
    for (int i = 0; i < 8; ++i) {
      const glm::vec3 corner = glm::vec3(7 + (i & 1), 7 + (i >> 1 & 1), 7 + (i >> 2)) * size;
      const glm::vec3 way = corner - camera.eye;
      const float depth = glm::dot(way, forward);
      ASSERT_GT(depth, 0.0f);
      // From -1 to 1 over a picture of 16 : 9.
      const glm::vec2 at =
          glm::vec2(glm::dot(way, right) * 9 / 16, glm::dot(way, glm::cross(right, forward))) /
          (depth * tangent);
      lo = glm::min(lo, at);
      hi = glm::max(hi, at);
    }
    EXPECT_GT(std::min(lo.x, lo.y), -1.0f) << "nothing is cut off";
    EXPECT_LT(std::max(hi.x, hi.y), 1.0f);
    const glm::vec2 share = 0.5f * (hi - lo);
    EXPECT_GT(std::max(share.x, share.y), 0.8f);
  }
}

TEST_F(DefaultView, AnOpenBoxIsLookedInto) {
  Mesh mesh;
  mesh.add_box(glm::vec3(-1), glm::vec3(1), true, true);
  bake(mesh);
  EXPECT_LT(eye(render()).z, -1.0f);
}

// As Cornell's: what stands in it is no wall of a hall.
TEST_F(DefaultView, AnOpenBoxWithThingsInItIsLookedInto) {
  Mesh mesh;
  mesh.add_box(glm::vec3(-1), glm::vec3(1), true, true);
  mesh.add_box(glm::vec3(-0.3f, -1, -0.6f), glm::vec3(0.4f, -0.3f, -0.2f), false);
  mesh.add_box(glm::vec3(-0.6f, -1, 0.3f), glm::vec3(0, 0.2f, 0.8f), false);
  bake(mesh);
  const Camera camera = parse_camera(render().at("camera"));
  EXPECT_LT(camera.eye.z, -1.5f);
  EXPECT_LT(glm::length(glm::vec2(camera.eye)), 0.5f) << "straight";
  EXPECT_NE(errors().find("a lamp hangs in its middle"), std::string::npos) << errors();
}

TEST_F(DefaultView, ARingHasNoFloorAndIsNoHall) {
  Mesh ring;
  ring.add_pipe();
  bake(ring);
  EXPECT_GT(glm::length(eye(render())), 3.0f) << errors();
  ring.add_quad({glm::vec3(-2, -1, 2), glm::vec3(2, -1, 2), glm::vec3(2, -1, -2), glm::vec3(-2, -1, -2)});
  bake(ring);
  EXPECT_LT(glm::length(eye(render())), 2.0f) << "with a floor it is one";
}

TEST_F(DefaultView, WindowsDoNotLetTheCameraOut) {
  Mesh room;
  for (const bool inward : {true, false}) {
    const float thick = inward ? 0.0f : 0.2f;
    const glm::vec3 hi = glm::vec3(4, 3, 4) + thick;
    for (const float side : {-1.0f, 1.0f})
      room.add_window_wall(side * hi.x, {-hi.y, -hi.z}, {hi.y, hi.z}, (side > 0) != inward);
    room.add_quad({glm::vec3(-hi.x, -hi.y, -hi.z), glm::vec3(-hi.x, -hi.y, hi.z),
                   glm::vec3(hi.x, -hi.y, hi.z), glm::vec3(hi.x, -hi.y, -hi.z)});
    room.add_quad({glm::vec3(-hi.x, hi.y, -hi.z), glm::vec3(hi.x, hi.y, -hi.z), glm::vec3(hi.x, hi.y, hi.z),
                   glm::vec3(-hi.x, hi.y, hi.z)});
    room.add_quad({glm::vec3(-hi.x, -hi.y, hi.z), glm::vec3(-hi.x, hi.y, hi.z), glm::vec3(hi.x, hi.y, hi.z),
                   glm::vec3(hi.x, -hi.y, hi.z)});
    room.add_quad({glm::vec3(-hi.x, -hi.y, -hi.z), glm::vec3(hi.x, -hi.y, -hi.z),
                   glm::vec3(hi.x, hi.y, -hi.z), glm::vec3(-hi.x, hi.y, -hi.z)});
  }
  bake(room);
  const glm::vec3 p = glm::abs(eye(render()));
  EXPECT_LT(std::max({p.x, p.y, p.z}), 4.0f) << errors();
}

TEST_F(DefaultView, ARoomIsSeenFromInsideABodyFromOutside) {
  const auto is_inside = [&] {
    const glm::vec3 p = glm::abs(eye(render()));
    return std::max({p.x, p.y, p.z}) < 4.0f;
  };
  Mesh body;
  body.add_box(glm::vec3(-4), glm::vec3(4), false);
  bake(body);
  EXPECT_FALSE(is_inside());
  Mesh turned_inside_out;
  turned_inside_out.add_box(glm::vec3(-4), glm::vec3(4), true);
  bake(turned_inside_out);
  EXPECT_FALSE(is_inside());
  Mesh walls;
  walls.add_box(glm::vec3(-4), glm::vec3(4), true);
  walls.add_box(glm::vec3(-4.1f), glm::vec3(4.1f), false);
  bake(walls);
  EXPECT_TRUE(is_inside());
  EXPECT_NE(errors().find("a lamp hangs in its middle"), std::string::npos) << errors();
  Mesh furnished;
  furnished.add_box(glm::vec3(-4), glm::vec3(4), true);
  for (const float x : {-3.0f, -1.5f, 1.5f, 3.0f}) {
    for (const float z : {-3.0f, -1.5f, 1.5f, 3.0f})
      furnished.add_box(glm::vec3(x - 0.3f, -4, z - 0.3f), glm::vec3(x + 0.3f, -3, z + 0.3f), false);
  }
  bake(furnished);
  EXPECT_TRUE(is_inside());
}

TEST_F(DefaultView, FindsAndTakesTheAxisThatIsUp) {
  Mesh plan;
  plan.add_terrain(0.5f, true);
  bake(plan);
  const nlohmann::json found = render();
  EXPECT_EQ(found.at("up"), "z");
  EXPECT_GT(eye(found).z, 3.0f) << "from above";
  EXPECT_NE(errors().find("z is taken to be up"), std::string::npos) << errors();
  const nlohmann::json named = render("--up y");
  EXPECT_EQ(named.at("up"), "y");
  EXPECT_EQ(errors().find("taken to be up"), std::string::npos) << errors();
  EXPECT_EQ(render("--camera 0,0,9:5,5,0:60").at("up"), "y") << "who says where says how";
  EXPECT_EQ(render("--camera 0,0,9:5,5,0:60 --up z").at("up"), "z");
  EXPECT_EQ(test::shell("lsp-render " + file("mesh.lsp") + " -o " + file("x.png") + " --up w 2>/dev/null"),
            1);
  Mesh terrain;
  terrain.add_terrain(0.5f, false);
  bake(terrain);
  const nlohmann::json usual = render();
  EXPECT_EQ(usual.at("up"), "y");
  EXPECT_GT(eye(usual).y, 3.0f);
  Mesh cube;
  cube.add_box(glm::vec3(-1), glm::vec3(1), false);
  bake(cube);
  EXPECT_EQ(render().at("up"), "y");
}

// What the file was says more than its shape: glTF has y up by its standard, .stl comes from programs with z.
TEST_F(DefaultView, TheAxisIsThatOfTheSource) {
  Mesh plan;
  plan.add_terrain(0.5f, true);
  bake(plan, "mesh.gltf");
  EXPECT_EQ(render().at("up"), "y");
  Mesh cube;
  cube.add_box(glm::vec3(-1), glm::vec3(1), false);
  bake(cube, "mesh.stl");
  EXPECT_EQ(render().at("up"), "z");
  EXPECT_NE(errors().find("comes from .stl: z is taken to be up"), std::string::npos) << errors();
  ASSERT_EQ(test::shell("lsp-render " + file("mesh.lsp") + " -o " + file("x.png") +
                        " --size 8x8 --samples 1 > " + file("out") + " 2>/dev/null"),
            0);
  std::ifstream out(folder_ / "out");
  const std::string said{std::istreambuf_iterator<char>(out), {}};
  EXPECT_NE(said.find(":38 --up z\n"), std::string::npos) << "to be given again: " << said;
  EXPECT_EQ(render("--up y").at("up"), "y");
  Mesh terrain;
  terrain.add_terrain(0.5f, false);
  bake(terrain, "mesh.stl");
  EXPECT_EQ(render().at("up"), "y") << "it lies flat in x and z";
}

TEST_F(DefaultView, WhatStandsIsSeenStanding) {
  for (const bool z_up : {true, false}) {
    Mesh bust;
    bust.add_bust(z_up);
    bake(bust);
    EXPECT_EQ(render().at("up"), z_up ? "z" : "y");
    EXPECT_EQ(errors().find("stands on what is flat along z") != std::string::npos, z_up) << errors();
    bake(bust, "mesh.stl");
    EXPECT_EQ(render().at("up"), z_up ? "z" : "y");
  }
}

TEST(Exposure, BrightestTenthStaysBelowWhite) {
  EXPECT_EQ(chosen_exposure(0.3, 5.0), 0.0f) << "within the range nothing is changed";
  EXPECT_FLOAT_EQ(chosen_exposure(0.0375, 0.1), 2.0f);
  EXPECT_FLOAT_EQ(chosen_exposure(0.0375, 0.5), 1.0f) << "a stop less";
  EXPECT_EQ(chosen_exposure(0.0375, 4.0), 0.0f) << "but not darker than it is";
  EXPECT_FLOAT_EQ(chosen_exposure(1.4, 9.0), -1.0f);
  EXPECT_GT(chosen_exposure(1e-5, 1e-4), 13.0f);
  EXPECT_EQ(chosen_exposure(0.0, 0.0), 0.0f);
}

// The picture of a z-up scene is that of the same one y-up, turned.
TEST_F(DefaultView, LightTurnsWithTheAxis) {
  Mesh up_y;
  up_y.add_terrain(2.0f, false);
  bake(up_y);
  const double y = render("--up y --effect direct --samples 64").at("mean_luminance");
  Mesh up_z;
  up_z.add_terrain(2.0f, true);
  bake(up_z);
  const double z = render("--up z --effect direct --samples 64").at("mean_luminance");
  EXPECT_NEAR(z / y, 1.0, 0.02);
}

TEST_F(DefaultView, ExposureBringsDarkPicturesIntoRange) {
  Mesh cube;
  cube.add_box(glm::vec3(-1), glm::vec3(1), false);
  bake(cube);
  EXPECT_EQ(render("--camera 3,3,5:0,0,0:40").at("exposure"), 0.0);
  EXPECT_EQ(render("--exposure -1.5").at("exposure"), -1.5);
  const double lit = render().at("exposure");
  EXPECT_LT(std::abs(lit), 2.5);
  Mesh cave;  // lit through a slit
  cave.add_box(glm::vec3(-1), glm::vec3(1), true, true);
  cave.add_quad(
      {glm::vec3(-1, -1, -1), glm::vec3(1, -1, -1), glm::vec3(1, 0.98f, -1), glm::vec3(-1, 0.98f, -1)});
  bake(cave);
  const std::string inside = "--camera 0,0,-0.9:0,0,1:60 ";
  const double dark = render(inside + "--exposure auto --effect direct --samples 64").at("exposure");
  EXPECT_GT(dark, 1.0);
  for (const char* bad : {"bright", "1x", "21", "nan"}) {
    EXPECT_EQ(test::shell("lsp-render " + file("mesh.lsp") + " -o " + file("x.png") + " --exposure " + bad +
                          " 2>/dev/null"),
              1)
        << bad;
  }
}

}  // namespace
}  // namespace lsp::sample
