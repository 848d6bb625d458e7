// What the validator passes also traces on a Vulkan device, with the CPU's answers to the bit: the valid
// corpus, and valid files made by random mutations.
#include <gtest/gtest.h>

#include <cstdlib>
#include <cstring>

#include "check.h"
#include "lsp/vulkan_device.hpp"
#include "opened.h"
#include "scenes.h"

namespace {

using namespace lsp;
using namespace lsp::corpus;
using namespace lsp::format;

void expect_same_answers(VulkanTracer& tracer, const lsp_scene& scene, const std::string& context) {
  const std::array<LspRay, 16> rays = rays_through(*scene.header);
  const bool exact = scene.header->required_features & LSP_FEATURE_EXACT;
  const bool approximate = scene.header->required_features & (LSP_FEATURE_LINE_SPACES | LSP_FEATURE_CELLS);
  tracer.load(scene, (exact ? LSP_USE_EXACT : 0u) | (approximate ? LSP_USE_APPROXIMATE : 0u));
  for (uint32_t flags = 0; flags <= LSP_TRACE_ALL_FLAGS; ++flags) {
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

// How many random mutations to try: LSP_AGREEMENT_MUTATIONS, or as many as a test run has time for.
uint64_t mutation_count() {
  const char* text = std::getenv("LSP_AGREEMENT_MUTATIONS");
  return text != nullptr ? std::strtoull(text, nullptr, 10) : 300;
}

TEST(Vulkan, TracesTheValidCorpus) {
  std::string why;
  if (!VulkanTracer::available(&why)) GTEST_SKIP() << "no Vulkan device: " << why;
  VulkanTracer tracer;
  for (const ValidFile& file : valid_files()) {
    Opened opened = open(file.bytes);
    ASSERT_EQ(opened.status, LSP_OK) << file.name << ": " << opened.error.message;
    expect_same_answers(tracer, opened.scene, file.name);
    if (HasFatalFailure()) return;
  }
}

// What the validator passes, the loader opens and the device traces with the CPU's answers; what the loader
// refuses, so that no device sees it, the validator refuses with an id.
TEST(Vulkan, AgreesOnRandomMutations) {
  std::string why;
  if (!VulkanTracer::available(&why)) GTEST_SKIP() << "no Vulkan device: " << why;
  VulkanTracer tracer;
  std::vector<ValidFile> files = valid_files();
  std::erase_if(files, [](const ValidFile& file) { return file.bytes.size() > 65536; });
  const uint64_t count = mutation_count();
  uint64_t traced = 0, refused = 0, by_validator_only = 0;
  for (uint64_t seed = 0; seed < count; ++seed) {
    Random random(seed);
    const ValidFile& file = files[random.below(files.size())];
    Bytes bytes = file.bytes;
    mutate(bytes, random);
    const std::string context = file.name + " with seed " + std::to_string(seed);
    const Report report = check_file(bytes, {.memory_limit = kMemoryLimit});
    Opened opened = open(bytes);
    if (report.verdict() == Verdict::kValid) {
      ASSERT_EQ(opened.status, LSP_OK) << context << ": " << opened.error.message;
      expect_same_answers(tracer, opened.scene, context);
      if (HasFatalFailure()) return;
      ++traced;
    } else {
      ASSERT_FALSE(report.findings().empty()) << context;
      ++(opened.status == LSP_OK ? by_validator_only : refused);
    }
  }
  std::printf(
      "of %llu mutations %llu are valid and traced on both, %llu refused by both, %llu by the validator "
      "only\n",
      static_cast<unsigned long long>(count), static_cast<unsigned long long>(traced),
      static_cast<unsigned long long>(refused), static_cast<unsigned long long>(by_validator_only));
  EXPECT_GT(traced, count / 20);
  EXPECT_GT(refused, count / 20);
}

}  // namespace
