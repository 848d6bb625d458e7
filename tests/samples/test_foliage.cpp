// Leaves with and without their masks: the light that a baked grove lets through against the light that
// passes the leaves' own texels.
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <random>

#include "picture.h"
#include "render_scene.h"
#include "scene.h"
#include "shell.h"

namespace lsp::sample {
namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();

// A grove of few triangles, baked with its masks and without.
class Grove : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = std::filesystem::temp_directory_path() / ("lsp_foliage_" + std::to_string(::getpid()));
    std::filesystem::create_directories(folder_);
    for (const std::string masks : {"", "--no-masks"}) {
      const std::string name = file(masks.empty() ? "masked" : "solid");
      ASSERT_EQ(
          test::shell("lsp-sample-scene " + name + ".glb --quiet --scene grove --triangles 5000 " + masks),
          0);
      ASSERT_EQ(test::shell("lsp-bake " + name + ".glb -o " + name + ".lsp --quiet --resolution 4 --depth 6"),
                0);
      ASSERT_EQ(test::shell("lsp-validate " + name + ".lsp"), 0);
    }
  }
  static void TearDownTestSuite() { std::filesystem::remove_all(folder_); }

  static std::string file(const std::string& name) { return (folder_ / name).string(); }

  static Picture render(const std::string& scene, const std::string& options) {
    EXPECT_EQ(test::shell("lsp-render " + file(scene + ".lsp") + " -o " + file("picture.pfm") +
                          " --quiet --size 48x32 --samples 16 " + options),
              0);
    return read_pfm(file("picture.pfm"));
  }

  static std::filesystem::path folder_;
};

std::filesystem::path Grove::folder_;

// The grove as single triangles, for rays that ask each of them.
class Texels {
 public:
  explicit Texels(const Scene& scene) {
    for (const Node& node : scene.nodes) {
      for (const Part& part : scene.meshes[static_cast<size_t>(node.mesh)].parts) {
        const Material& material = scene.materials[static_cast<size_t>(part.material)];
        const Surface& s = part.surface;
        for (size_t i = 0; i < s.indices.size(); i += 3) {
          Triangle t{{}, {}, material.masked ? &material.texture : nullptr};
          for (size_t k = 0; k < 3; ++k) {
            const uint32_t corner = s.indices[i + k];
            t.at[k] = node.translation + node.rotation * (node.scale * s.positions[corner]);
            if (t.mask) t.uv[k] = s.uvs[corner];
          }
          triangles_.push_back(t);
        }
      }
    }
  }

  // Whether the ray meets something, by the texel that it meets.
  bool blocked(glm::vec3 origin, glm::vec3 direction) const {
    return std::any_of(triangles_.begin(), triangles_.end(),
                       [&](const Triangle& t) { return t.blocks(origin, direction); });
  }

 private:
  struct Triangle {
    glm::vec3 at[3];
    glm::vec2 uv[3];
    const Texture* mask;

    // Moeller and Trumbore's test.
    bool blocks(glm::vec3 origin, glm::vec3 direction) const {
      const glm::vec3 e1 = at[1] - at[0], e2 = at[2] - at[0], p = glm::cross(direction, e2);
      const float det = glm::dot(e1, p);
      if (std::abs(det) < 1e-12f) return false;
      const glm::vec3 from = origin - at[0], q = glm::cross(from, e1);
      const float u = glm::dot(from, p) / det, v = glm::dot(direction, q) / det;
      if (u < 0 || v < 0 || u + v > 1 || glm::dot(e2, q) / det <= 0) return false;
      if (!mask) return true;
      const glm::vec2 uv_here = uv[0] + u * (uv[1] - uv[0]) + v * (uv[2] - uv[0]);
      const auto texel = [](float x, int size) { return std::clamp(int(x * float(size)), 0, size - 1); };
      const int x = texel(uv_here.x, mask->width), y = texel(uv_here.y, mask->height);
      return mask->rgba[size_t(4 * (y * mask->width + x) + 3)] >= 128;
    }
  };
  std::vector<Triangle> triangles_;
};

// From the ground under the trees upwards, cosine-distributed.
std::vector<LspRay> rays_from_the_ground(size_t count) {
  std::mt19937 generator(7);
  std::uniform_real_distribution<float> random(0, 1);
  std::vector<LspRay> rays;
  for (size_t i = 0; i < count; ++i) {
    const glm::vec3 origin(8 * random(generator) - 4, 0.1f, 6 * random(generator) - 3);
    const glm::vec3 d = cosine_direction({0, 1, 0}, {random(generator), random(generator)});
    rays.push_back({from_glm(origin), 0.0f, from_glm(d), kInfinity});
  }
  return rays;
}

double mean(const Picture& picture, int channel = 0) {
  double sum = 0;
  for (const glm::vec3& pixel : picture.pixels) sum += static_cast<double>(pixel[channel]);
  return sum / static_cast<double>(picture.pixels.size());
}

TEST_F(Grove, AsMuchLightPassesAsThroughTheTexels) {
  const std::vector<LspRay> rays = rays_from_the_ground(20000);
  double open[2];
  for (const bool masks : {false, true}) {
    Scene scene = make_scene("grove", detail_for("grove", 5000));
    if (!masks) take_masks_off(scene);
    const Texels texels(scene);
    const RenderScene baked(file(masks ? "masked.lsp" : "solid.lsp"));
    for (const uint32_t mode : {0u, uint32_t{LSP_TRACE_APPROXIMATE}}) {
      std::vector<LspHit> hits(rays.size());
      lsp_trace_options options{};
      options.flags = LSP_TRACE_ANY_HIT | mode;
      lsp_error error{};
      ASSERT_EQ(lsp_trace(baked.single(), &options, rays.data(), hits.data(), rays.size(), nullptr, &error),
                LSP_OK)
          << error.message;
      size_t passed = 0, truly = 0, differ = 0;
      for (size_t i = 0; i < rays.size(); ++i) {
        const bool free = hits[i].primitive == LSP_NONE;
        const bool want = !texels.blocked(to_glm(rays[i].origin), to_glm(rays[i].direction));
        passed += free;
        truly += want;
        differ += free != want;
      }
      const auto count = static_cast<double>(rays.size());
      // Which rays pass a leaf is chance, how many is not: three standard deviations of 20,000 rays are 1 %.
      EXPECT_NEAR(double(passed) / count, double(truly) / count, 0.012) << "masks " << masks << ", " << mode;
      if (!masks && mode == 0) {
        EXPECT_LE(differ, 2u) << "solid leaves leave nothing to chance but edges";
      }
      open[masks] = double(truly) / count;
    }
  }
  EXPECT_GT(open[1], open[0] + 0.15) << "what the masks are there for";
}

TEST_F(Grove, MasksBrightenThePicture) {
  // From above the ground under the crowns, the sky as well.
  const std::string camera = " --camera 0,2.2,8.5:0,1.2,0:50 ";
  const double solid = mean(render("solid", "--effect ao --radius 1" + camera));
  for (const char* mode : {"exact", "approximate"}) {
    const double masked =
        mean(render("masked", std::string("--effect ao --radius 1 --mode ") + mode + camera));
    EXPECT_GT(masked, 1.08 * solid) << mode;
  }
}

TEST_F(Grove, LeavesHaveTheColourOfTheirTexels) {
  // Into the crown of a tree from near by: what is seen is the texture's green.
  const Picture picture = render("solid", "--effect direct --camera 0.5,3.2,4.2:0.5,3.2,1.7:20");
  EXPECT_GT(mean(picture, 1), 1.5 * mean(picture, 0));
  EXPECT_GT(mean(picture, 1), 4 * mean(picture, 2));
}

TEST_F(Grove, AnEmitterThatIsThereInPartShinesInPart) {
  // The same panel over the same floor, of which all is there or a quarter, in light that is sampled.
  double light[2];
  for (const bool part : {false, true}) {
    std::ofstream(file("lamp.mtl")) << "newmtl floor\nKd 0.5 0.5 0.5\nnewmtl lamp\nKd 0 0 0\nKe 40 40 40\n"
                                    << (part ? "d 0.25\n" : "");
    std::ofstream(file("lamp.obj"))
        << "mtllib lamp.mtl\nv -9 0 -9\nv 9 0 -9\nv 9 0 9\nv -9 0 9\nv -9 9 -9\nv 9 9 -9\nv 9 9 9\nv -9 9 9\n"
           "v -1 4 -1\nv 1 4 -1\nv 1 4 1\nv -1 4 1\n"
           "usemtl floor\nf 1 2 3 4\nf 5 6 7 8\nf 1 2 6 5\nf 3 4 8 7\nf 1 4 8 5\nf 2 3 7 6\n"
           "usemtl lamp\nf 9 10 11 12\n";
    ASSERT_EQ(
        test::shell("lsp-bake " + file("lamp.obj") + " -o " + file("lamp.lsp") + " --quiet --no-line-spaces"),
        0);
    light[part] = mean(render("lamp", "--effect direct --camera 0,2,0:0,0,0.1:60"));
  }
  EXPECT_GT(light[0], 0.1);
  EXPECT_NEAR(light[1] / light[0], 0.25, 0.01);
}

}  // namespace
}  // namespace lsp::sample
