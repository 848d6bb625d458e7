// What the validator passes also traces on a Vulkan device, with the CPU's answers to the bit: the valid
// corpus, and valid files made by random mutations.
#include <gtest/gtest.h>

#include <cstring>

#include "check.h"
#include "lsp/vulkan_device.hpp"
#include "opened.h"
#include "scenes.h"

namespace {

using namespace lsp;
using namespace lsp::corpus;
using namespace lsp::format;

constexpr int kMutatedFiles = 40;

void expect_same_answers(VulkanTracer& tracer, const lsp_scene& scene, const std::string& context) {
  const std::array<LspRay, 16> rays = rays_through(*scene.header);
  const bool exact = scene.header->required_features & LSP_FEATURE_EXACT;
  const bool approximate = scene.header->required_features & LSP_FEATURE_LINE_SPACES;
  tracer.load(scene, (exact ? LSP_USE_EXACT : 0u) | (approximate ? LSP_USE_APPROXIMATE : 0u));
  for (uint32_t flags = 0; flags < 8; ++flags) {
    if (!(flags & LSP_TRACE_APPROXIMATE ? approximate : exact)) continue;
    const lsp_trace_options options{flags, flags & LSP_TRACE_NEAR_APPROXIMATE ? 0.5f : 0.0f};
    std::array<LspHit, 16> on_cpu, on_device;
    ASSERT_EQ(lsp_trace(&scene, &options, rays.data(), on_cpu.data(), rays.size(), nullptr, nullptr), LSP_OK);
    tracer.trace(options, rays, on_device);
    for (size_t i = 0; i < rays.size(); ++i)
      ASSERT_EQ(std::memcmp(&on_cpu[i], &on_device[i], sizeof(LspHit)), 0)
          << context << ", flags " << flags << ", ray " << i << ": primitive " << on_cpu[i].primitive
          << " at " << on_cpu[i].t << ", on the device " << on_device[i].primitive << " at "
          << on_device[i].t;
  }
}

TEST(Vulkan, TracesWhatTheValidatorPasses) {
  std::string why;
  if (!VulkanTracer::available(&why)) GTEST_SKIP() << "no Vulkan device: " << why;
  VulkanTracer tracer;
  std::vector<ValidFile> files = valid_files();
  for (const ValidFile& file : files) {
    Opened opened = open(file.bytes);
    ASSERT_EQ(opened.status, LSP_OK) << file.name << ": " << opened.error.message;
    expect_same_answers(tracer, opened.scene, file.name);
    if (HasFatalFailure()) return;
  }
  std::erase_if(files, [](const ValidFile& file) { return file.bytes.size() > 65536; });
  int traced = 0;
  for (uint64_t seed = 0; seed < 10000 && traced < kMutatedFiles; ++seed) {
    Random random(seed);
    Bytes bytes = files[random.below(files.size())].bytes;
    mutate(bytes, random);
    if (check_file(bytes, {.memory_limit = kMemoryLimit}).verdict() != Verdict::kValid) continue;
    Opened opened = open(bytes);
    ASSERT_EQ(opened.status, LSP_OK) << "seed " << seed << ": " << opened.error.message;
    expect_same_answers(tracer, opened.scene, "seed " + std::to_string(seed));
    if (HasFatalFailure()) return;
    ++traced;
  }
  EXPECT_EQ(traced, kMutatedFiles);
}

}  // namespace
