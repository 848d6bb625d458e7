// Open, upload, trace, close, over and over: memory stays where it is after the first rounds, and Vulkan's
// validation has nothing to say.
//
// LSP_SOAK_SECONDS=3600 for an hour of it (default: 4 seconds).
#include <gtest/gtest.h>
#include <unistd.h>

#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iostream>

#include "lsp/scene_file.hpp"
#include "lsp/vulkan_device.hpp"
#include "rays.h"
#include "scene.h"

// Drivers leave memory behind, in modules that are gone at the end: here the resident size tells.
extern "C" const char* __lsan_default_options() { return "detect_leaks=0"; }

namespace lsp::stress {
namespace {

double seconds_to_run() {
  const char* text = std::getenv("LSP_SOAK_SECONDS");
  return text ? std::strtod(text, nullptr) : 4;
}

size_t resident_kb() {
  std::ifstream stream("/proc/self/statm");
  size_t size = 0, resident = 0;
  stream >> size >> resident;
  return resident * static_cast<size_t>(sysconf(_SC_PAGESIZE)) / 1024;
}
std::vector<LspRay> room_rays(const std::string& path, size_t count) {
  const SceneFile file(path);
  return bench::surface_rays(bench::soup_of(file.scene()), count, 1);
}
size_t open_files() {
  const std::filesystem::directory_iterator files("/proc/self/fd");
  return static_cast<size_t>(std::distance(begin(files), end(files)));
}

// Runs `round` for `seconds`; the resident size after a warm-up and at the end may differ by a megabyte and a
// tenth, whatever the number of rounds.
template <class Round>
void soak(double seconds, int warm_up, Round round) {
  for (int i = 0; i < warm_up; ++i) round();
  const size_t files = open_files(), before = resident_kb();
  size_t rounds = 0, peak = before;
  const auto start = std::chrono::steady_clock::now();
  do {
    round();
    ++rounds;
    peak = std::max(peak, resident_kb());
  } while (std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count() < seconds);
  const size_t after = resident_kb();
  std::cout << rounds << " rounds: resident " << before << " kB, then " << after << " kB, at most " << peak
            << " kB\n";
  EXPECT_GE(rounds, 3u);
  EXPECT_LE(after, before + before / 10 + 1024);
  EXPECT_EQ(open_files(), files);
}

class Soak : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    path_ =
        (std::filesystem::temp_directory_path() / ("lsp_soak_" + std::to_string(getpid()) + ".lsp")).string();
    bake_to(path_, room());
  }
  static void TearDownTestSuite() { std::filesystem::remove(path_); }
  static std::string path_;
};
std::string Soak::path_;

TEST_F(Soak, OnTheCpu) {
  const std::vector<LspRay> rays = room_rays(path_, 2000);
  std::vector<LspHit> hits(rays.size());
  soak(seconds_to_run() / 4, 50, [&] {
    const SceneFile file(path_);
    for (const uint32_t flags : {0u, LSP_TRACE_APPROXIMATE}) {
      const lsp_trace_options options{flags, 0};
      ASSERT_EQ(lsp_trace(&file.scene(), &options, rays.data(), hits.data(), rays.size(), nullptr, nullptr),
                LSP_OK);
    }
  });
}

void soak_vulkan(const std::string& path, LoadPath load, double seconds, bool new_device) {
  std::string why;
  if (!VulkanTracer::available(&why)) GTEST_SKIP() << why;
  const std::vector<LspRay> rays = room_rays(path, 500);
  std::vector<LspHit> cpu(rays.size()), gpu(rays.size());
  VulkanOptions options;
  options.validation = true;
  std::unique_ptr<VulkanTracer> tracer;
  try {
    tracer = std::make_unique<VulkanTracer>(options);
  } catch (const Failure&) {
    std::cout << "no validation layer here: runs without\n";
    options.validation = false;
    tracer = std::make_unique<VulkanTracer>(options);
  }
  std::vector<std::string> messages;
  size_t different = 0;
  try {
    const SceneFile file(path);
    tracer->load(file.scene(), LSP_USE_EXACT, load);
  } catch (const Failure& failure) {
    if (load != LoadPath::kImport) throw;
    GTEST_SKIP() << failure.what();
  }
  soak(seconds, 8, [&] {
    const SceneFile file(path);
    if (new_device) tracer = std::make_unique<VulkanTracer>(options);
    tracer->load(file.scene(), LSP_USE_EXACT | LSP_USE_APPROXIMATE, load);
    for (const uint32_t flags : {0u, LSP_TRACE_APPROXIMATE}) {
      const lsp_trace_options trace{flags, 0};
      lsp_trace(&file.scene(), &trace, rays.data(), cpu.data(), rays.size(), nullptr, nullptr);
      tracer->trace(trace, rays, gpu);
      for (size_t i = 0; i < rays.size(); ++i)
        different += cpu[i].t != gpu[i].t || cpu[i].primitive != gpu[i].primitive;
    }
    const std::vector<std::string> said = tracer->validation_messages();
    if (said.size() > messages.size() || (new_device && !said.empty())) messages = said;
    if (!new_device) return;
    tracer.reset();
  });
  EXPECT_EQ(different, 0u);
  for (const std::string& message : messages) ADD_FAILURE() << message;
}

TEST_F(Soak, OnVulkanUploading) { soak_vulkan(path_, LoadPath::kUpload, seconds_to_run() / 4, false); }
TEST_F(Soak, OnVulkanImporting) { soak_vulkan(path_, LoadPath::kImport, seconds_to_run() / 4, false); }
TEST_F(Soak, OnVulkanWithANewDeviceEveryTime) {
  soak_vulkan(path_, LoadPath::kUpload, seconds_to_run() / 4, true);
}

}  // namespace
}  // namespace lsp::stress
