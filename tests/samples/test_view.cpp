// lsp-view and its parts, on a display of their own (Xvfb). Skips where there is no Xvfb or no Vulkan device.
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#define GLFW_INCLUDE_NONE
#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdlib>
#include <fstream>
#include <memory>
#include <nlohmann/json.hpp>
#include <sstream>
#include <thread>

#include "bake_first.h"
#include "controls.h"
#include "device_scene.h"
#include "exposure_meter.h"
#include "lsp/vulkan_device.hpp"
#include "shell.h"
#include "viewer.h"

#define STB_IMAGE_IMPLEMENTATION
#define STB_IMAGE_STATIC
#define STBI_ONLY_PNG
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wunused-function"
#pragma GCC diagnostic ignored "-Wsign-compare"
#include <stb/stb_image.h>
#pragma GCC diagnostic pop

#include <GLFW/glfw3.h>

// Drivers and window libraries leave memory behind at the end.
extern "C" const char* __lsan_default_options() { return "detect_leaks=0"; }

namespace lsp::sample {
namespace {

constexpr int kWidth = 160, kHeight = 90;

// An X server without a screen, for as long as it lives.
class Xvfb {
 public:
  Xvfb() {
    int numbers[2];
    if (pipe(numbers) != 0) return;
    server_ = fork();
    if (server_ == 0) {
      close(numbers[0]);
      const std::string descriptor = std::to_string(numbers[1]);
      if (freopen("/dev/null", "w", stderr) == nullptr) _exit(127);
      execlp("Xvfb", "Xvfb", "-displayfd", descriptor.c_str(), "-screen", "0", "800x600x24", "-nolisten",
             "tcp", nullptr);
      _exit(127);
    }
    close(numbers[1]);
    // It answers once it is ready; hung up before the end of the line it would die.
    std::string number;
    for (char c = 0; ::read(numbers[0], &c, 1) == 1 && c != '\n';) number += c;
    close(numbers[0]);
    if (!number.empty()) display_ = std::string(":").append(number);
  }
  ~Xvfb() {
    if (server_ <= 0) return;
    kill(server_, SIGTERM);
    waitpid(server_, nullptr, 0);
  }
  Xvfb(const Xvfb&) = delete;
  Xvfb& operator=(const Xvfb&) = delete;
  const std::string& display() const { return display_; }  // empty: there is none

 private:
  pid_t server_ = -1;
  std::string display_;
};

using Shot = Viewer::Screenshot;

Shot read_png(const std::string& path) {
  Shot shot;
  int channels = 0;
  stbi_uc* bytes = stbi_load(path.c_str(), &shot.width, &shot.height, &channels, 4);
  if (bytes != nullptr) shot.rgba.assign(bytes, bytes + size_t{4} * shot.width * shot.height);
  stbi_image_free(bytes);
  return shot;
}

// Mean and largest difference of the bytes of columns [first, last).
struct Difference {
  double mean = 0;
  int most = 0;
};
Difference difference(const Shot& a, const Shot& b, int first, int last) {
  EXPECT_EQ(a.rgba.size(), b.rgba.size());
  Difference result;
  for (int y = 0; y < a.height; ++y) {
    for (int i = 4 * (y * a.width + first); i < 4 * (y * a.width + last); ++i) {
      const int off = std::abs(int{a.rgba[i]} - int{b.rgba[i]});
      result.mean += off;
      result.most = std::max(result.most, off);
    }
  }
  result.mean /= 3.0 * a.height * std::max(last - first, 1);
  return result;
}

class View : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    server_ = std::make_unique<Xvfb>();
    if (server_->display().empty()) return;
    setenv("DISPLAY", server_->display().c_str(), 1);
    unsetenv("WAYLAND_DISPLAY");
    folder_ = std::filesystem::temp_directory_path() / ("lsp_view_" + std::to_string(::getpid()));
    std::filesystem::create_directories(folder_);
    std::ofstream(file("corner.obj")) << "v 0 0 0\nv 4 0 0\nv 4 0 4\nv 0 0 4\nv 0 3 0\nv 4 3 0\nv 0 3 4\n"
                                         "f 4 3 2 1\nf 1 2 6 5\nf 1 5 7 4\n";
    const std::string mesh = file("s.glb");
    ASSERT_EQ(test::shell("lsp-sample-scene " + mesh + " --quiet --triangles 8000 --scene spheres"), 0);
    ASSERT_EQ(test::shell("lsp-bake " + mesh + " -o " + file("cells.lsp") +
                          " --quiet --base cells --cells 12 --preset fast"),
              0);
    ASSERT_EQ(test::shell("lsp-bake " + mesh + " -o " + file("bvh.lsp") +
                          " --quiet --base bvh --resolution 4 --depth 3,6"),
              0);
    ASSERT_EQ(test::shell("lsp-bake " + mesh + " -o " + file("ntree.lsp") + " --quiet --base ntree"), 0);
    ASSERT_EQ(test::shell("lsp-bake " + mesh + " -o " + file("wide.lsp") + " --quiet --base wide"), 0);
    // One moved by its origin, one mirrored and stretched, of cells and of wide nodes; and one that is a BVH.
    write_scene("placed.json", R"(["cells.lsp", "wide.lsp"])");
    write_scene("refused.json", R"(["cells.lsp", "bvh.lsp"])");
  }
  static void write_scene(const std::string& name, const std::string& assets) {
    std::ofstream(file(name)) << R"({"lsp_scene": 1, "assets": )" << assets << R"(, "instances": [
        {"asset": 0, "transform": [1,0,0,0, 0,1,0,0, 0,0,1,0]},
        {"asset": 1, "transform": [0,0,-0.5,-3, 0,0.8,0,0.5, -0.5,0,0,5]}]})";
  }
  static void TearDownTestSuite() {
    if (!folder_.empty()) std::filesystem::remove_all(folder_);
    server_.reset();
  }
  void SetUp() override {
    if (server_->display().empty()) GTEST_SKIP() << "no Xvfb (Debian: xvfb)";
    std::string why;
    if (!VulkanTracer::available(&why)) GTEST_SKIP() << why;
  }

  static std::string file(const std::string& name) { return (folder_ / name).string(); }

  // Runs lsp-view in a small window near the spheres; its report is in report_.
  int view(const std::string& arguments) {
    const int exit = test::shell("lsp-view --json --size 160x90 --camera 9,7,14:0,1,0:40 " + arguments +
                                 " > " + file("report.json"));
    report_ = exit == 0 ? nlohmann::json::parse(test::read_bytes(file("report.json"))) : nlohmann::json{};
    return exit;
  }
  Shot shot(const std::string& scene, const std::string& arguments) {
    EXPECT_EQ(view(file(scene) + " --quiet --frames 4 --screenshot " + file("shot.png") + " " + arguments), 0)
        << arguments;
    return read_png(file("shot.png"));
  }

  nlohmann::json report_;
  static std::unique_ptr<Xvfb> server_;
  static std::filesystem::path folder_;
};

std::unique_ptr<Xvfb> View::server_;
std::filesystem::path View::folder_;

double mean(const Shot& shot) {
  double sum = 0;
  for (const uint8_t byte : shot.rgba) sum += byte;
  return (sum / static_cast<double>(shot.rgba.size()) * 4 - 255) / 3;
}

// Of every structure and effect: the left half is the exact picture, the right half the approximate one.
TEST_F(View, HalvesAreTheWholePictures) {
  for (const std::string scene : {"cells.lsp", "bvh.lsp", "ntree.lsp", "wide.lsp", "placed.json"}) {
    for (const std::string effect : {"light", "diffuse", "ao", "heat"}) {
      if (scene != "cells.lsp" && effect != "light" && effect != "heat") continue;
      SCOPED_TRACE(scene + " " + effect);
      const std::string options = "--quality fast --near approximate --effect " + effect;
      const Shot exact = shot(scene, options + " --split 1");
      const Shot approximate = shot(scene, options + " --split 0");
      const Shot both = shot(scene, options + " --split 0.5");
      EXPECT_EQ(report_["samples"], 4);
      EXPECT_EQ(report_["incomplete"], 0);
      ASSERT_EQ(both.width, kWidth);
      ASSERT_EQ(both.height, kHeight);
      // Two columns beside the line on either side are its own.
      EXPECT_EQ(difference(both, exact, 0, kWidth / 2 - 2).most, 0);
      EXPECT_EQ(difference(both, approximate, kWidth / 2 + 2, kWidth).most, 0);
      EXPECT_GT(mean(both), 4.0) << "it is black";
      if (scene == "wide.lsp") {
        EXPECT_EQ(difference(exact, approximate, 0, kWidth).most, 0) << "without tables both are exact";
      } else {
        EXPECT_GT(difference(exact, approximate, 0, kWidth).mean, 0.0) << "both halves are traced alike";
        if (effect == "heat")
          EXPECT_LT(mean(approximate), mean(exact)) << "tables take fewer steps";
        else
          EXPECT_LT(difference(exact, approximate, 0, kWidth).mean, 12.0);
      }
    }
  }
}

// lsp-render is the reference: the same random numbers, on the CPU.
TEST_F(View, AmbientOcclusionIsThatOfLspRender) {
  const std::string options = "--effect ao --radius 0.2 ";
  for (const std::string scene : {"cells.lsp", "placed.json"})
    for (const std::string mode : {"exact", "approximate"}) {
      const Shot seen = shot(scene, options + "--split " + (mode == "exact" ? "1" : "0"));
      ASSERT_EQ(test::shell("lsp-render " + file(scene) + " -o " + file("r.png") + " --quiet --samples 4 " +
                            "--size 160x90 --camera 9,7,14:0,1,0:40 --mode " + mode + " " + options),
                0);
      const Difference off = difference(seen, read_png(file("r.png")), 0, kWidth);
      // Sines and cosines differ in their last bits: a few rays hit another thing.
      EXPECT_LT(off.mean, 0.5) << scene << " " << mode;
    }
}

// What has tables is shown by them at first, and as bright as by lsp-render; what has none has no line.
TEST_F(View, StartsApproximateAndWellExposed) {
  const std::string quiet = " --quiet --size 160x90 ";
  for (const std::string scene : {"cells.lsp", "placed.json", "wide.lsp"}) {
    SCOPED_TRACE(scene);
    const auto json_of = [&](const std::string& command) {
      EXPECT_EQ(test::shell(command + quiet + "--json > " + file("report.json")), 0);
      return nlohmann::json::parse(test::read_bytes(file("report.json")));
    };
    const nlohmann::json seen = json_of("lsp-view " + file(scene) + " --frames 1");
    const nlohmann::json rendered = json_of("lsp-render " + file(scene) + " --samples 4 -o " + file("r.png"));
    EXPECT_EQ(seen["camera"], rendered["camera"]);
    EXPECT_FLOAT_EQ(seen["exposure"].get<float>(), rendered["exposure"].get<float>());
    const bool tables = scene != "wide.lsp";
    EXPECT_EQ(seen["split"], tables ? 0 : 1);
    EXPECT_GT(seen[tables ? "approximate" : "exact"]["rays"], 0);
    EXPECT_EQ(seen[tables ? "exact" : "approximate"]["rays"], 0);
  }
  // On the right of the line it has no tables to answer from, and says so.
  ASSERT_EQ(view(file("wide.lsp") + " --frames 1 --split 0"), 0);
  EXPECT_EQ(report_["dial"], "exact, no tables");
  // With a camera it is as it is, unless it is asked for.
  ASSERT_EQ(view(file("cells.lsp") + " --quiet --frames 1"), 0);
  EXPECT_EQ(report_["exposure"], 0);
  std::ofstream(file("dark.mtl")) << "newmtl dark\nKd 0.01 0.01 0.01\n";
  std::ofstream(file("dark.obj")) << "mtllib dark.mtl\nusemtl dark\n" << test::read_bytes(file("corner.obj"));
  ASSERT_EQ(test::shell("lsp-bake " + file("dark.obj") + " -o " + file("dark.lsp") + " --quiet"), 0);
  ASSERT_EQ(view(file("dark.lsp") + " --quiet --frames 1 --exposure auto"), 0);
  EXPECT_GT(report_["exposure"], 0.5);
}

// A line says what cannot be shown, and of which asset.
TEST_F(View, SaysWhatCannotBeShown) {
  EXPECT_EQ(view(file("refused.json") + " --frames 1 2> " + file("said")), 5);
  const std::string said = test::read_bytes(file("said"));
  EXPECT_NE(said.find("refused.json: asset 1: no shader of instances walks its BVH; bake it with --base"),
            std::string::npos)
      << said;
}

// So is the bounce: its random numbers are the same, too, where nothing shines. Camera, sky and sun go with
// the axis that is up.
TEST_F(View, BounceIsThatOfLspRender) {
  ASSERT_EQ(test::shell("lsp-bake " + file("corner.obj") + " -o " + file("corner.lsp") +
                        " --quiet --base bvh --resolution 4"),
            0);
  std::vector<Shot> seen;
  for (const std::string up : {"--up y", "--up z"}) {
    const std::string options = " --quiet --effect diffuse --exposure 0 --size 160x90 " + up;
    ASSERT_EQ(test::shell("lsp-view " + file("corner.lsp") + options + " --frames 4 --split 1 --screenshot " +
                          file("v.png")),
              0);
    ASSERT_EQ(
        test::shell("lsp-render " + file("corner.lsp") + " -o " + file("r.png") + options + " --samples 4"),
        0);
    seen.push_back(read_png(file("v.png")));
    EXPECT_GT(mean(seen.back()), 4.0) << "it is black";
    EXPECT_LT(difference(seen.back(), read_png(file("r.png")), 0, kWidth).mean, 0.5) << up;
  }
  EXPECT_GT(difference(seen[0], seen[1], 0, kWidth).mean, 1.0) << "both axes look the same";
}

// Every instance is lit with its own asset's materials, where its transform has put them.
TEST_F(View, BounceOfInstancesIsThatOfLspRender) {
  std::ofstream(file("red.mtl")) << "newmtl white\nKd 0.9 0.9 0.9\nnewmtl red\nKd 0.9 0.1 0.1\n";
  std::ofstream(file("red.obj")) << "mtllib red.mtl\nusemtl red\n" << test::read_bytes(file("corner.obj"));
  for (const std::string name : {"corner", "red"})
    ASSERT_EQ(test::shell("lsp-bake " + file(name + ".obj") + " -o " + file(name + "_wide.lsp") +
                          " --quiet --base wide"),
              0);
  std::ofstream(file("two.json")) << R"({"lsp_scene": 1, "assets": ["corner_wide.lsp", "red_wide.lsp"],
      "instances": [{"asset": 1, "transform": [0,0,-1.5,5, 0,1,0,0, -0.7,0,0,5]},
                    {"asset": 0, "transform": [1,0,0,0, 0,1,0,0, 0,0,1,0]},
                    {"asset": 1, "transform": [1,0,0,-5, 0,2,0,0, 0,0,1,0]}]})";
  const std::string options =
      " --quiet --effect diffuse --exposure 0 --size 160x90 --camera 9,9,14:1,1,2:50 ";
  ASSERT_EQ(
      test::shell("lsp-view " + file("two.json") + options + "--frames 4 --screenshot " + file("v.png")), 0);
  ASSERT_EQ(test::shell("lsp-render " + file("two.json") + options + "--samples 4 -o " + file("r.png")), 0);
  const Shot seen = read_png(file("v.png"));
  EXPECT_LT(difference(seen, read_png(file("r.png")), 0, kWidth).mean, 0.05);
  size_t red = 0, grey = 0;
  for (size_t i = 0; i < seen.rgba.size(); i += 4) {
    red += seen.rgba[i] > 2 * seen.rgba[i + 1] + 20;
    grey += seen.rgba[i] > 20 && seen.rgba[i] < 2 * seen.rgba[i + 1];
  }
  EXPECT_GT(std::min(red, grey), 200u);
}

// The dial, lod and the line do what they say.
TEST_F(View, OptionsReachTheShaders) {
  const Shot fast = shot("cells.lsp", "--split 0 --quality fast");
  EXPECT_EQ(report_["dial"], "fast");
  const Shot tables = shot("cells.lsp", "--split 0 --max-loss 100");
  EXPECT_EQ(report_["dial"], "max loss 100 %");
  const Shot strict = shot("cells.lsp", "--split 0 --max-loss 0");
  EXPECT_GT(difference(tables, strict, 0, kWidth).mean, difference(fast, strict, 0, kWidth).mean * 0.5);
  EXPECT_GT(difference(tables, strict, 0, kWidth).mean, 0.0);
  EXPECT_GT(difference(shot("bvh.lsp", "--split 0"), shot("bvh.lsp", "--split 0 --lod 1"), 0, kWidth).mean,
            0.0);
  EXPECT_GT(mean(shot("cells.lsp", "--exposure 1")), mean(shot("cells.lsp", "--exposure 0")));
}

// What the device's storage buffers cannot hold is an error that says what can be done.
TEST_F(View, RefusesWhatNoBufferHolds) {
  ASSERT_EQ(glfwInit(), GLFW_TRUE);
  glfwWindowHint(GLFW_CLIENT_API, GLFW_NO_API);
  GLFWwindow* window = glfwCreateWindow(kWidth, kHeight, "test", nullptr, nullptr);
  ASSERT_NE(window, nullptr);
  {
    Gpu gpu(window, false);
    gpu.properties.limits.maxStorageBufferRange = 4096;
    for (const char* name : {"cells.lsp", "placed.json"}) {
      SCOPED_TRACE(name);
      const RenderScene scene(file(name));
      try {
        const DeviceScene on_device(gpu, scene);
        ADD_FAILURE() << "loaded";
      } catch (const Failure& failure) {
        EXPECT_EQ(failure.exit(), Exit::kLimit);
        EXPECT_EQ(failure.file(), file(name));
        const std::string message = failure.what();
        for (const char* part : {"4096", "--max-size", "lsp-render"})
          EXPECT_NE(message.find(part), std::string::npos) << message;
      }
    }
  }
  glfwDestroyWindow(window);
  glfwTerminate();
}

// In one process: samples add up while nothing changes, the line and the window's size move, and the
// validation layer has nothing to say.
TEST_F(View, LivesThroughMovesAndResizing) {
  const RenderScene scene(file("cells.lsp"));
  ASSERT_EQ(glfwInit(), GLFW_TRUE);
  glfwWindowHint(GLFW_CLIENT_API, GLFW_NO_API);
  GLFWwindow* window = glfwCreateWindow(kWidth, kHeight, "test", nullptr, nullptr);
  ASSERT_NE(window, nullptr);
  {
    std::unique_ptr<Gpu> gpu;
    try {
      gpu = std::make_unique<Gpu>(window, true);
    } catch (const Failure& failure) {
      gpu = std::make_unique<Gpu>(window, false);
      std::printf("without validation: %s\n", failure.what());
    }
    Viewer viewer(*gpu, window, scene, Sky{});
    ViewState state;
    state.camera = parse_camera("9,7,14:0,1,0:40");
    const auto show = [&](bool moving) {
      bool shown = false;
      for (int i = 0; i < 10 && !shown; ++i) {
        glfwPollEvents();
        shown = viewer.frame(state, moving);
      }
      EXPECT_TRUE(shown);
    };
    for (int i = 0; i < 3; ++i) show(false);
    EXPECT_EQ(viewer.report().samples, 3u);
    const Shot before = viewer.screenshot();

    state.exposure = 1.0f;
    show(false);
    EXPECT_EQ(viewer.report().samples, 4u) << "how samples are shown changes none of them";
    EXPECT_GT(mean(viewer.screenshot()), mean(before) + 10);
    state.exposure = 0.0f;

    state.split = 0.25f;
    show(true);
    EXPECT_EQ(viewer.report().samples, 1u) << "a moved line begins anew";
    do {
      show(false);
    } while (viewer.report().samples < 3);
    EXPECT_EQ(viewer.report().scale, 1u) << "at rest every pixel is traced";
    const Shot moved = viewer.screenshot();
    EXPECT_EQ(difference(before, moved, 0, kWidth / 4 - 2).most, 0);
    EXPECT_EQ(difference(before, moved, kWidth / 2 + 2, kWidth).most, 0);
    EXPECT_EQ(moved.rgba[4 * (kWidth / 4)], 255) << "the line";

    glfwSetWindowSize(window, 222, 131);
    for (int i = 0; i < 20; ++i) {
      glfwWaitEventsTimeout(0.02);
      viewer.frame(state, false);
    }
    show(false);
    const Shot larger = viewer.screenshot();
    EXPECT_EQ(larger.width, 222);
    EXPECT_EQ(larger.height, 131);
    EXPECT_NEAR(mean(larger), mean(moved), 12.0);

    EXPECT_FALSE(viewer.frame(state, false, [] { return true; }) && viewer.report().samples == 0)
        << "a sample that was interrupted is not shown";
    EXPECT_EQ(gpu->messages, std::vector<std::string>{});
  }
  glfwDestroyWindow(window);
  glfwTerminate();
}

TEST_F(View, MeshesAreBakedFirst) {
  ASSERT_EQ(view(file("corner.obj") + " --quiet --frames 1 --screenshot " + file("m.png")), 0);
  EXPECT_GT(mean(read_png(file("m.png"))), 4.0);
  // What the mesh lacks is said here as by lsp-bake.
  std::ofstream(file("plain.obj")) << "mtllib none.mtl\nusemtl red\n" << test::read_bytes(file("corner.obj"));
  ASSERT_EQ(view(file("plain.obj") + " --frames 1 2> " + file("said")), 0);
  EXPECT_NE(test::read_bytes(file("said"))
                .find("note: " + file("plain.obj") + ": the material library none.mtl is not there"),
            std::string::npos)
      << test::read_bytes(file("said"));
  std::filesystem::path left;
  {
    const BakedFile baked(file("corner.obj"), true);
    left = baked.path();
    EXPECT_TRUE(std::filesystem::exists(left));
  }
  EXPECT_FALSE(std::filesystem::exists(left.parent_path()));
  std::ofstream(file("bad.obj")) << "f 1 2 3\n";
  EXPECT_EQ(view(file("bad.obj") + " --quiet --frames 1 2>/dev/null"), 3);
}

// Who ends it while it bakes finds nothing left of that; what is wrong with a mesh is in the report, too.
TEST_F(View, BakesThatComeToNothing) {
  ASSERT_EQ(test::shell("lsp-sample-scene " + file("hall.glb") + " --quiet"), 0);
  std::filesystem::create_directories(file("temporary"));
  for (const char* signal : {"TERM", "INT"}) {
    EXPECT_EQ(test::shell("TMPDIR=" + file("temporary") + " timeout -s " + signal + " 1 lsp-view " +
                          file("hall.glb") + " --frames 1 --quiet"),
              124);
    EXPECT_TRUE(std::filesystem::is_empty(file("temporary"))) << signal;
  }
  const auto failed = [&](const std::string& where, const char* mesh, int exit) {
    EXPECT_EQ(test::shell("TMPDIR=" + where + " lsp-view " + file(mesh) + " --frames 1 --json 2>/dev/null >" +
                          file("report.json")),
              exit);
    return nlohmann::json::parse(test::read_bytes(file("report.json")));
  };
  const nlohmann::json report = failed("/nonexistent", "hall.glb", 2);
  EXPECT_EQ(report.value("file", ""), file("hall.glb"));
  EXPECT_NE(report.value("error", "").find("set TMPDIR"), std::string::npos) << report;
  std::ofstream(file("bad.obj")) << "f 1 2 3\n";
  const nlohmann::json bad = failed(file("temporary"), "bad.obj", 3);
  EXPECT_NE(bad.value("error", "").find("could not bake it: "), std::string::npos) << bad;
  EXPECT_TRUE(std::filesystem::is_empty(file("temporary")));
}

TEST_F(View, ValidationHasNothingToSay) {
  for (const std::string scene : {"cells.lsp", "placed.json"}) {
    const int exit = view(file(scene) + " --quiet --frames 2 --split 0.5 --validation 2> " + file("said"));
    if (exit == 5 && test::read_bytes(file("said")).find("not installed") != std::string::npos)
      GTEST_SKIP() << test::read_bytes(file("said"));
    EXPECT_EQ(exit, 0) << test::read_bytes(file("said"));
  }
}

TEST_F(View, ExitCodes) {
  const std::string scene = file("cells.lsp"), none = " >/dev/null 2>&1";
  EXPECT_EQ(test::shell("lsp-view --help" + none), 0);
  EXPECT_EQ(test::shell("lsp-view --version" + none), 0);
  EXPECT_EQ(test::shell("lsp-view" + none), 1);
  for (const std::string bad :
       {"--split 2", "--effect gloss", "--frames 0", "--size 0x7", "--camera 1,2", "--up x", "--max-loss -1",
        "--radius 0", "--exposure 99", "--frames 1 --screenshot x.jpg", "--screenshot x.png"}) {
    EXPECT_EQ(test::shell("lsp-view " + scene + " " + bad + none), 1) << bad;
  }
  EXPECT_EQ(test::shell("lsp-view " + file("missing.lsp") + " --frames 1" + none), 2);
  EXPECT_EQ(test::shell("lsp-view " + file("missing.obj") + " --frames 1" + none), 2);
  EXPECT_EQ(
      test::shell("lsp-view " + scene + " --size 8x8 --frames 1 --screenshot /nonexistent/x.png" + none), 2);
  std::ofstream(file("text.lsp")) << "no scene";
  EXPECT_EQ(test::shell("lsp-view " + file("text.lsp") + " --frames 1" + none), 3);
  std::ofstream(file("scene.json")) << "{}";
  EXPECT_EQ(test::shell("lsp-view " + file("scene.json") + " --frames 1" + none), 3);
  const std::string display = getenv("DISPLAY");
  setenv("DISPLAY", ":no", 1);
  EXPECT_EQ(test::shell("lsp-view " + scene + " --frames 1" + none), 5) << "there is no display";
  setenv("DISPLAY", display.c_str(), 1);
}

// From one exposure to the next in small steps, and no further; keys add to it.
TEST(ViewExposure, FollowsTheCameraSmoothly) {
  ViewState state;
  state.exposure = 2.0f;
  std::atomic<int> measured = 0;
  ExposureMeter meter(state, [&](const ViewState& seen) {
    ++measured;
    return seen.camera.eye.x + (seen.effect == VIEW_DIFFUSE ? 3.0f : 0.0f);
  });
  for (int i = 0; i < 10; ++i) meter.follow(state, 0.1f);
  EXPECT_EQ(state.exposure, 2.0f) << "nothing has moved";
  EXPECT_EQ(measured, 0);
  const auto settle = [&](float wanted) {
    const float first = state.exposure;
    float largest = 0;
    for (int i = 0; i < 2000 && state.exposure != wanted; ++i) {
      const float before = state.exposure;
      meter.follow(state, 0.02f);
      largest = std::max(largest, std::abs(state.exposure - before));
      if (state.exposure == before) std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    EXPECT_EQ(state.exposure, wanted);
    EXPECT_LT(largest, 0.06f * std::abs(wanted - first)) << "a jump";
  };
  state.camera.eye.x = -1.0f;
  settle(-1.0f);
  EXPECT_EQ(measured, 1);
  state.exposure += 0.25f;  // a key
  meter.follow(state, 0.1f);
  EXPECT_EQ(state.exposure, -0.75f);
  state.camera.eye.x = 4.0f;
  settle(4.25f);
  state.effect = VIEW_DIFFUSE;
  settle(7.25f);
  EXPECT_EQ(measured, 3);
}

TEST(ViewControls, MaxLossMovesInSteps) {
  EXPECT_EQ(next_max_loss(5, true), 10);
  EXPECT_EQ(next_max_loss(5, false), 2);
  EXPECT_EQ(next_max_loss(3, true), 5);
  EXPECT_EQ(next_max_loss(100, true), 100);
  EXPECT_EQ(next_max_loss(0, false), 0);
}

}  // namespace
}  // namespace lsp::sample
