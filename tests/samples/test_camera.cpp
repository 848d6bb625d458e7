// The view that lsp-render chooses for a scene that nobody has seen yet.
#include <gtest/gtest.h>

#include <array>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <nlohmann/json.hpp>

#include "camera.h"
#include "shell.h"

namespace lsp::sample {
namespace {

// An .obj file in the making.
class Mesh {
 public:
  // Corners of a quad, counter-clockwise from its front.
  void add_quad(const std::array<glm::vec3, 4>& corners) {
    for (const glm::vec3& p : corners)
      text_ += "v " + std::to_string(p.x) + " " + std::to_string(p.y) + " " + std::to_string(p.z) + "\n";
    text_ += "f -4 -3 -2 -1\n";
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
  const std::string& text() const { return text_; }

 private:
  std::string text_;
};

class DefaultView : public ::testing::Test {
 protected:
  void bake(const Mesh& mesh) {
    std::ofstream(folder_ / "mesh.obj") << mesh.text();
    ASSERT_EQ(
        test::shell("lsp-bake " + file("mesh.obj") + " -o " + file("mesh.lsp") + " --base wide --quiet"), 0);
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
