// The sample programs as a user runs them: scene, bake, render, compare.
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>

#include "compare.h"
#include "lsp/vulkan_device.hpp"
#include "scene.h"
#include "shell.h"

namespace lsp::sample {
namespace {

// A folder with a small baked scene, made once.
class Programs : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = std::filesystem::temp_directory_path() / ("lsp_samples_" + std::to_string(::getpid()));
    std::filesystem::create_directories(folder_);
    for (const char* scene : {"spheres", "plane"}) {
      ASSERT_EQ(
          test::shell("lsp-sample-scene " + file(scene) + ".glb --quiet --triangles 8000 --scene " + scene),
          0);
      ASSERT_EQ(test::shell("lsp-bake " + file(scene) + ".glb -o " + file(scene) +
                            ".lsp --quiet --resolution 4 --depth 6"),
                0);
      ASSERT_EQ(test::shell("lsp-validate " + file(scene) + ".lsp"), 0);
    }
  }
  static void TearDownTestSuite() { std::filesystem::remove_all(folder_); }

  static std::string file(const std::string& name) { return (folder_ / name).string(); }

  // atrium.lsp, in few cells.
  static void bake_hall() {
    if (std::filesystem::exists(file("atrium.lsp"))) return;
    ASSERT_EQ(
        test::shell("lsp-sample-scene " + file("atrium.glb") + " --quiet --triangles 14056 --scene atrium"),
        0);
    ASSERT_EQ(test::shell("lsp-bake " + file("atrium.glb") + " -o " + file("atrium.lsp") +
                          " --preset fast --cells 4 --quiet"),
              0);
  }

  // Renders `scene` into NAME.pfm and reads it back.
  static Picture render(const std::string& scene, const std::string& name, const std::string& options,
                        int samples = 4) {
    EXPECT_EQ(test::shell("lsp-render " + file(scene) + ".lsp -o " + file(name) +
                          ".pfm --quiet --size 64x36 --samples " + std::to_string(samples) + " " + options),
              0);
    return read_pfm(file(name) + ".pfm");
  }

  static std::filesystem::path folder_;
};

std::filesystem::path Programs::folder_;

TEST_F(Programs, PictureDoesNotDependOnThreads) {
  for (const char* mode : {"exact", "approximate"}) {
    const std::string options = std::string("--bounces 2 --denoise --mode ") + mode;
    render("spheres", "one", options + " --threads 1");
    render("spheres", "three", options + " --threads 3");
    EXPECT_EQ(test::read_bytes(file("one.pfm")), test::read_bytes(file("three.pfm"))) << mode;
  }
}

TEST_F(Programs, AllIsTheSumOfItsParts) {
  const Picture direct = render("spheres", "direct", "--effect direct");
  const Picture diffuse = render("spheres", "diffuse", "--effect diffuse");
  const Picture glossy = render("spheres", "glossy", "--effect glossy");
  const Picture all = render("spheres", "all", "--effect all");
  for (size_t i = 0; i < all.pixels.size(); ++i) {
    const glm::vec3 sum = direct.pixels[i] + diffuse.pixels[i] + glossy.pixels[i];
    for (int c = 0; c < 3; ++c) ASSERT_NEAR(all.pixels[i][c], sum[c], 1e-4f + 1e-4f * sum[c]);
  }
}

TEST_F(Programs, OpenPlaneIsNearlyUnoccluded) {
  // The plane rolls by 8 cm: hardly anything is in the way of a ray.
  const Picture ao = render("plane", "ao", "--effect ao");
  double sum = 0;
  for (const glm::vec3& p : ao.pixels) sum += static_cast<double>(p.x);
  EXPECT_GT(sum / static_cast<double>(ao.pixels.size()), 0.97);
}

// So is what glTF has where a file gives no material: white, of metallic and roughness 1.
TEST_F(Programs, ARoughMetalIsSeenAsDiffuse) {
  for (const std::string metal : {"0", "1"}) {
    Scene scene = make_scene("plane", detail_for("plane", 1000));
    scene.materials[0].roughness = 1.0f;
    scene.materials[0].metallic = std::stof(metal);
    std::ofstream(file("metal" + metal + ".glb"), std::ios::binary) << to_glb(scene);
    ASSERT_EQ(test::shell("lsp-bake " + file("metal" + metal) + ".glb -o " + file("metal" + metal) +
                          ".lsp --quiet"),
              0);
    render("metal" + metal, "metal" + metal, "");
  }
  EXPECT_EQ(test::read_bytes(file("metal0.pfm")), test::read_bytes(file("metal1.pfm")));
}

TEST_F(Programs, ApproximateIsCloseAndPrimaryRaysAreExact) {
  const Comparison direct = compare(render("spheres", "a", "--effect direct"),
                                    render("spheres", "b", "--effect direct --mode approximate"));
  EXPECT_EQ(direct.mean_absolute, 0.0) << "direct light is exact in both modes";
  const Comparison all = compare(render("spheres", "a", "--effect all", 16),
                                 render("spheres", "b", "--effect all --mode approximate", 16));
  EXPECT_GT(all.psnr_db, 25.0);
  EXPECT_NEAR(all.mean_test / all.mean_reference, 1.0, 0.02);
}

// A scene of one instance that is not moved is the file; of two places the picture shows both.
TEST_F(Programs, InstancesAreRendered) {
  const auto write = [](const std::string& name, const std::string& transforms) {
    std::ofstream(file(name)) << R"({"lsp_scene": 1, "assets": ["spheres.lsp"], "instances": [)" << transforms
                              << "]}";
  };
  const std::string here = R"({"asset": 0, "transform": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0]})";
  const std::string beside = R"({"asset": 0, "transform": [-0.5, 0, 0, 2, 0, 0.5, 0, 1, 0, 0, 0.5, 2]})";
  write("one.json", here);
  write("two.json", here + ", " + beside);
  write("hidden.json", here + ", " + beside.substr(0, beside.size() - 1) + R"(, "mask": 0})");
  const auto picture = [](const std::string& scene, const std::string& options) {
    EXPECT_EQ(test::shell("lsp-render " + file(scene) + " -o " + file("p.pfm") +
                          " --quiet --size 64x36 --samples 8 --camera 4,3,6:0,0.5,0:45 " + options),
              0);
    return read_pfm(file("p.pfm"));
  };
  for (const std::string options : {"--effect direct", "--effect all", "--effect all --mode approximate",
                                    "--effect glossy --mode approximate", "--effect diffuse --bounces 2"}) {
    SCOPED_TRACE(options);
    const Picture alone = picture("spheres.lsp", options);
    EXPECT_GT(compare(alone, picture("one.json", options)).psnr_db, 35.0);
    EXPECT_LT(compare(alone, picture("two.json", options)).psnr_db, 35.0);
  }
  EXPECT_GT(
      compare(picture("one.json", "--effect direct"), picture("hidden.json", "--effect direct")).psnr_db,
      35.0);
  picture("two.json", "--effect ao");
  picture("two.json", "--heat steps --mode approximate");
  bake_hall();
  std::ofstream(file("halls.json")) << R"({"lsp_scene": 1, "assets": ["atrium.lsp"], "instances": [)" << here
                                    << ", " << beside << "]}";
  std::string why;
  for (const std::string mode : {"exact", "approximate"}) {
    if (!VulkanTracer::available(&why)) continue;  // VulkanGivesTheSamePicture says so
    picture("halls.json", "--mode " + mode);
    const std::string cpu = test::read_bytes(file("p.pfm"));
    picture("halls.json", "--backend vulkan --mode " + mode);
    EXPECT_EQ(test::read_bytes(file("p.pfm")), cpu) << mode;
    // No shader of instances walks a BVH.
    EXPECT_EQ(
        test::shell("lsp-render " + file("two.json") + " -o " + file("p.pfm") + " --quiet --backend vulkan"),
        5);
  }
  write("bad.json", "{}");
  EXPECT_EQ(test::shell("lsp-render " + file("bad.json") + " -o " + file("p.pfm") + " --quiet"), 3);
  EXPECT_EQ(test::shell("lsp-render " + file("none.json") + " -o " + file("p.pfm") + " --quiet"), 2);
}

// Rays that go on from a table's plane begin in front of the surface (lsp_hit_offset): from behind it they
// would find themselves in its shadow, and the light of the next bounce was 5 % darker.
TEST_F(Programs, BouncesFromTablesAreNoDarker) {
  const auto mean = [](const Picture& picture) {
    glm::dvec3 sum(0.0);
    for (const glm::vec3& pixel : picture.pixels) sum += glm::dvec3(pixel);
    return (sum.x + sum.y + sum.z) / static_cast<double>(3 * picture.pixels.size());
  };
  ASSERT_EQ(
      test::shell("lsp-bake " + file("spheres.glb") + " -o " + file("fine.lsp") + " --base bvh --quiet"), 0);
  const double exact = mean(render("fine", "exact", "--effect diffuse", 512));
  const double approximate = mean(render("fine", "tables", "--effect diffuse --mode approximate", 512));
  EXPECT_NEAR(approximate, exact, 0.035 * exact);
}

TEST_F(Programs, VulkanGivesTheSamePicture) {
  std::string why;
  if (!VulkanTracer::available(&why)) GTEST_SKIP() << "no Vulkan device: " << why;
  for (const char* mode : {"exact", "approximate"}) {
    render("spheres", "cpu", std::string("--mode ") + mode);
    render("spheres", "vulkan", std::string("--backend vulkan --mode ") + mode);
    EXPECT_EQ(test::read_bytes(file("cpu.pfm")), test::read_bytes(file("vulkan.pfm"))) << mode;
  }
}

// A hall in tables so coarse that the picture by tables alone is far off: with a share of its paths verified
// its mean comes to the exact one's, and the rest is noise that goes as samples come.
TEST_F(Programs, VerifiedPathsMakeTheMeanExact) {
  bake_hall();
  const auto picture = [](const std::string& options, int samples) {
    EXPECT_EQ(test::shell("lsp-render " + file("atrium.lsp") + " -o " + file("p.pfm") +
                          " --quiet --size 24x14 --camera=-7.9,1.5,-0.9:3,3.1,0.35:66 --samples " +
                          std::to_string(samples) + " " + options),
              0);
    return read_pfm(file("p.pfm"));
  };
  const auto error_of_mean = [](const Comparison& c) { return std::abs(c.mean_test / c.mean_reference - 1); };
  const std::string tables = " --mode approximate --quality fast";
  for (const std::string effect : {"--effect all --bounces 2", "--effect ao"}) {
    SCOPED_TRACE(effect);
    const Picture exact = picture(effect, 1024);
    const Comparison wrong = compare(exact, picture(effect + tables, 1024));
    const Comparison right = compare(exact, picture(effect + tables + " --verify 50", 1024));
    EXPECT_GT(error_of_mean(wrong), 0.02);
    EXPECT_LT(error_of_mean(right), 0.003);
    EXPECT_LT(right.relative_mean, 0.3 * wrong.relative_mean);
    const Comparison early = compare(picture(effect, 64), picture(effect + tables + " --verify 50", 64));
    EXPECT_NEAR(early.relative_mean / right.relative_mean, 4.0, 1.0) << "noise falls as one over the root";
  }
  // Each kind of path by itself, verified always: the exact picture.
  for (const std::string effect : {"ao", "diffuse --bounces 3", "glossy --bounces 3"}) {
    SCOPED_TRACE(effect);
    const Comparison c = compare(picture("--effect " + effect, 4),
                                 picture("--effect " + effect + tables + " --verify 100", 4));
    EXPECT_GT(c.mean_reference, 0.0);
    EXPECT_LT(c.relative_mean, 1e-6);
  }
}

TEST_F(Programs, VerifyIsTheSameWhereverItRuns) {
  const std::string options = "--mode approximate --bounces 2 --verify 25 --denoise";
  render("spheres", "one", options + " --threads 1");
  render("spheres", "three", options + " --threads 3");
  EXPECT_EQ(test::read_bytes(file("one.pfm")), test::read_bytes(file("three.pfm")));
  std::string why;
  if (!VulkanTracer::available(&why)) GTEST_SKIP() << "no Vulkan device: " << why;
  for (const std::string effect : {"all", "ao"}) {
    render("spheres", "cpu", options + " --effect " + effect);
    render("spheres", "vulkan", options + " --backend vulkan --effect " + effect);
    EXPECT_EQ(test::read_bytes(file("cpu.pfm")), test::read_bytes(file("vulkan.pfm"))) << effect;
  }
}

TEST_F(Programs, VerifyIsAShareOfPathsAndSaysWhereItDoesNothing) {
  const std::string command =
      "lsp-render " + file("spheres.lsp") + " -o " + file("x.pfm") + " --size 64x36 --samples 16 ";
  ASSERT_EQ(test::shell(command + "--mode approximate --verify 12.5 --json > " + file("x.json")), 0);
  const nlohmann::json report = nlohmann::json::parse(test::read_bytes(file("x.json")));
  const double paths = report.at("paths").get<double>();
  EXPECT_GT(paths, 1000);
  EXPECT_NEAR(report.at("verified_paths").get<double>() / paths, 0.125, 0.025);
  for (const char* value : {"-1", "101", "all"})
    EXPECT_EQ(test::shell(command + "--mode approximate --verify " + value + " >/dev/null 2>&1"), 1) << value;
  for (const char* elsewhere : {"--mode exact", "--mode approximate --heat loss"}) {
    ASSERT_EQ(test::shell(command + "--verify 10 " + elsewhere + " >/dev/null 2> " + file("notes.txt")), 0);
    EXPECT_NE(test::read_bytes(file("notes.txt")).find("--verify does nothing"), std::string::npos)
        << elsewhere;
  }
}

// Of the picture's rays those to lights from where others land have a quality of their own.
TEST_F(Programs, RaysToLightsHaveAQualityOfTheirOwn) {
  bake_hall();
  const auto picture = [](const std::string& options) {
    return render("atrium", "light", "--camera=-7.9,1.5,-0.9:3,3.1,0.35:66 --effect diffuse " + options, 16);
  };
  const Picture exact = picture("");
  const auto off = [&](const std::string& options) {
    return compare(exact, picture("--mode approximate " + options)).relative_mean;
  };
  const double fast = off("--quality fast"), balanced = off("--quality balanced");
  EXPECT_EQ(off("--quality balanced --light-quality balanced"), balanced);
  EXPECT_EQ(off("--max-loss 100"), fast);
  EXPECT_EQ(off("--max-loss 0 --light-quality fast"),
            off("--max-loss 0 --quality fast --light-quality fast"));
  const double mixed = off("--quality balanced --light-quality fast");
  EXPECT_GT(mixed, balanced);
  EXPECT_LT(mixed, fast);
  EXPECT_LT(off("--quality balanced --light-quality exact"), balanced);
  EXPECT_EQ(test::shell("lsp-render " + file("atrium.lsp") + " -o " + file("x.pfm") +
                        " --mode approximate --light-quality best >/dev/null 2>&1"),
            1);
  for (const char* elsewhere : {"--mode exact", "--mode approximate --effect ao"}) {
    ASSERT_EQ(
        test::shell("lsp-render " + file("atrium.lsp") + " -o " + file("x.pfm") +
                    " --size 8x8 --light-quality fast " + elsewhere + " >/dev/null 2> " + file("notes.txt")),
        0);
    EXPECT_NE(test::read_bytes(file("notes.txt")).find("--light-quality does nothing"), std::string::npos)
        << elsewhere;
  }
  ASSERT_EQ(test::shell("lsp-render " + file("atrium.lsp") + " -o " + file("x.pfm") +
                        " --size 8x8 --mode approximate --quality fast --max-loss 1 >/dev/null 2> " +
                        file("notes.txt")),
            0);
  EXPECT_NE(test::read_bytes(file("notes.txt")).find("--quality does nothing: --max-loss sets the dial"),
            std::string::npos);
}

// However large the picture, a device gets it in pieces of at most 131,072 pixels.
TEST_F(Programs, DevicesGetThePictureInPieces) {
  std::string why;
  if (!VulkanTracer::available(&why)) GTEST_SKIP() << "no Vulkan device: " << why;
  const auto report = [](const std::string& options) {
    EXPECT_EQ(test::shell("lsp-render " + file("spheres.lsp") + " -o " + file("x.pfm") +
                          " --camera 0,1,0.1:0,0,0:100 --effect ao --samples 1 --json " + options + " > " +
                          file("x.json")),
              0);
    return nlohmann::json::parse(test::read_bytes(file("x.json")));
  };
  // 131,584 pixels: two pieces, for primary rays and for those of ambient occlusion, and one ray to try the
  // device.
  const uint64_t dispatches = report("--backend vulkan --size 512x257").at("dispatches");
  EXPECT_GE(dispatches, 3u);
  EXPECT_LE(dispatches, 5u);
  EXPECT_LE(report("--backend vulkan --size 64x36").at("dispatches"), 3u);
  const nlohmann::json usual = report("");
  EXPECT_EQ(usual.at("width"), 1280);
  EXPECT_EQ(usual.at("height"), 720);
  EXPECT_EQ(usual.at("dispatches"), 0u) << "the CPU's";
}

TEST_F(Programs, EndingsMayBeInCapitals) {
  for (const std::string ending : {".png", ".PNG", ".pfm", ".Pfm"})
    ASSERT_EQ(test::shell("lsp-render " + file("spheres.lsp") + " -o " + file("capitals" + ending) +
                          " --quiet --size 16x9 --samples 1"),
              0);
  EXPECT_EQ(test::read_bytes(file("capitals.png")), test::read_bytes(file("capitals.PNG")));
  EXPECT_EQ(test::read_bytes(file("capitals.pfm")), test::read_bytes(file("capitals.Pfm")));
  EXPECT_EQ(test::shell("lsp-compare " + file("capitals.pfm") + " " + file("capitals.Pfm") + " -o " +
                        file("difference.PNG") + " --quiet"),
            0);
  for (const std::string name : {"x.jpg", "png", "x.png.gz"})
    EXPECT_EQ(test::shell("lsp-compare " + file("capitals.pfm") + " " + file("capitals.pfm") + " -o " + name +
                          " 2>/dev/null"),
              1)
        << name;
}

TEST_F(Programs, HeatIsWhereTablesLoseAndWorkGoes) {
  const auto total = [](const Picture& picture) {
    double sum = 0;
    for (const glm::vec3& pixel : picture.pixels) sum += static_cast<double>(pixel.x);
    return sum;
  };
  EXPECT_EQ(total(render("spheres", "none", "--heat loss --mode exact")), 0.0);
  EXPECT_GT(total(render("spheres", "loss", "--heat loss --mode approximate --near approximate")), 0.0);
  const Picture exact = render("spheres", "exact", "--heat steps --mode exact");
  const Picture approximate =
      render("spheres", "approximate", "--heat steps --mode approximate --near approximate");
  EXPECT_GT(total(exact), total(approximate));
  EXPECT_GT(total(render("spheres", "triangles", "--heat exact --mode exact")), 0.0);
  EXPECT_EQ(
      test::shell("lsp-render " + file("spheres.lsp") + " -o " + file("x.png") + " --heat cold --quiet"), 1);
}

TEST_F(Programs, CompareExitsWith7WhereTheyDiffer) {
  render("spheres", "a", "--effect direct");
  render("spheres", "b", "--effect ao");
  EXPECT_EQ(test::shell("lsp-compare --quiet --max-rmse 0 " + file("a.pfm") + " " + file("a.pfm")), 0);
  EXPECT_EQ(
      test::shell("lsp-compare --quiet --max-rmse 0 " + file("a.pfm") + " " + file("b.pfm") + " 2>/dev/null"),
      7);
}

TEST_F(Programs, HelloTracesARay) {
  ASSERT_EQ(test::shell("hello " + file("plane.lsp") + " > " + file("hello.txt")), 0);
  EXPECT_EQ(test::read_bytes(file("hello.txt")).rfind("hit triangle", 0), 0u)
      << test::read_bytes(file("hello.txt"));
  EXPECT_EQ(test::shell("hello " + file("missing.lsp") + " 2> " + file("hello.txt")), 2);
  EXPECT_NE(test::read_bytes(file("hello.txt")).find("missing.lsp: "), std::string::npos);
}

// Of tables and of wide nodes alone, which have another shader; the layers have nothing to say of it.
TEST_F(Programs, HelloVulkanTracesTheSameRay) {
  std::string why;
  if (!VulkanTracer::available(&why)) GTEST_SKIP() << "no Vulkan device: " << why;
  ASSERT_EQ(test::shell("lsp-bake " + file("plane.glb") + " -o " + file("cells.lsp") + " --quiet --cells 6"),
            0);
  ASSERT_EQ(test::shell("lsp-bake " + file("plane.glb") + " -o " + file("wide.lsp") + " --quiet --base wide"),
            0);
  for (const std::string scene : {"plane.lsp", "cells.lsp", "wide.lsp"}) {
    SCOPED_TRACE(scene);
    ASSERT_EQ(test::shell("hello " + file(scene) + " > " + file("hello.txt")), 0);
    setenv("VK_INSTANCE_LAYERS", "VK_LAYER_KHRONOS_validation", 1);
    const int exit = test::shell("hello_vulkan " + file(scene) + " > " + file("hello_vulkan.txt") + " 2>&1");
    unsetenv("VK_INSTANCE_LAYERS");
    const std::string said = test::read_bytes(file("hello_vulkan.txt"));
    if (exit == 5 && said.find("LayerNotPresent") != std::string::npos) GTEST_SKIP() << said;
    ASSERT_EQ(exit, 0) << said;
    const std::string cpu = test::read_bytes(file("hello.txt"));
    EXPECT_EQ(said, cpu.substr(0, cpu.find_first_of(",\n")) + "\n");
  }
  EXPECT_EQ(test::shell("hello_vulkan " + file("missing.lsp") + " 2>/dev/null"), 2);
}

// They are read in a sitting.
TEST_F(Programs, HellosAreShort) {
  const auto lines = [](const char* name) {
    const std::string text = test::read_bytes(std::filesystem::path(LSP_SAMPLES_DIR) / "hello" / name);
    return std::ranges::count(text, '\n');
  };
  EXPECT_LE(lines("hello.c"), 30);
  EXPECT_LT(lines("hello_vulkan.cpp"), 120);
}

TEST_F(Programs, ExitCodes) {
  const std::string quiet = " >/dev/null 2>&1";
  const std::string scene = file("spheres.lsp");
  for (const char* program : {"lsp-render", "lsp-compare", "lsp-sample-scene"}) {
    EXPECT_EQ(test::shell(program + std::string(" --help") + quiet), 0) << program;
    EXPECT_EQ(test::shell(program + std::string(" --version") + quiet), 0) << program;
    EXPECT_EQ(test::shell(program + std::string(" --no-such-option") + quiet), 1) << program;
  }
  EXPECT_EQ(test::shell("lsp-render " + scene + " -o " + file("x.jpeg") + quiet), 1);
  EXPECT_EQ(test::shell("lsp-render " + scene + " -o " + file("x.png") + " --camera 1,2,3" + quiet), 1);
  EXPECT_EQ(test::shell("lsp-render " + scene + " -o " + file("x.png") + " --size 0x7" + quiet), 1);
  EXPECT_EQ(test::shell("lsp-render " + file("missing.lsp") + " -o " + file("x.png") + quiet), 2);
  EXPECT_EQ(test::shell("lsp-render " + scene + " -o /nonexistent/x.png --size 8x8 --samples 1" + quiet), 2);
  EXPECT_EQ(test::shell("lsp-render " + file("plane.glb") + " -o " + file("x.png") + quiet), 3);
  ASSERT_EQ(test::shell("lsp-bake " + file("spheres.glb") + " -o " + file("lean.lsp") +
                        " --quiet --resolution 4 --depth 6 --no-exact"),
            0);
  EXPECT_EQ(test::shell("lsp-render " + file("lean.lsp") + " -o " + file("x.png") + quiet), 5);
  EXPECT_FALSE(std::filesystem::exists(file("x.png")));
}

TEST_F(Programs, WithoutLineSpacesApproximateIsExact) {
  ASSERT_EQ(test::shell("lsp-bake " + file("spheres.glb") + " -o " + file("plain.lsp") +
                        " --quiet --no-line-spaces"),
            0);
  render("plain", "exact", "--mode exact");
  render("plain", "approximate", "--mode approximate");
  EXPECT_EQ(test::read_bytes(file("exact.pfm")), test::read_bytes(file("approximate.pfm")));
}

TEST_F(Programs, PackedFilesRenderTheSame) {
  ASSERT_EQ(test::shell("lsp-bake " + file("spheres.glb") + " -o " + file("packed.lsp") +
                        " --quiet --resolution 4 --depth 6 --compress zstd"),
            0);
  render("spheres", "raw", "--mode approximate");
  render("packed", "unpacked", "--mode approximate");
  EXPECT_EQ(test::read_bytes(file("raw.pfm")), test::read_bytes(file("unpacked.pfm")));
}

}  // namespace
}  // namespace lsp::sample
