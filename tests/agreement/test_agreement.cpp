// CPU and Vulkan give the same hits, bit for bit: one body, with the way the scene gets to the device and the
// kind of trace as parameters. Skips where there is no Vulkan device.
#include <gtest/gtest.h>

#include <cstring>
#include <memory>
#include <sstream>

#include "hard_rays.h"
#include "lsp/lsp.h"
#include "lsp/program.h"
#include "lsp/vulkan_device.hpp"
#include "scene_builder.h"

namespace lsp::test {
namespace {

struct Device {
  const char* name;
  LoadPath path;
  bool discrete;   // treated as a GPU with memory of its own: staging buffers
  bool addresses;  // sections read through buffer addresses
};
constexpr Device kDevices[] = {{"import", LoadPath::kImport, false, false},
                               {"upload", LoadPath::kUpload, false, false},
                               {"staged", LoadPath::kUpload, true, false},
                               {"addresses", LoadPath::kUpload, true, true}};

struct Trace {
  const char* name;
  lsp_trace_options options;
};
constexpr Trace kTraces[] = {
    {"exact_closest", {0, 0}},
    {"exact_any", {LSP_TRACE_ANY_HIT, 0}},
    {"approximate_closest", {LSP_TRACE_APPROXIMATE, 0}},
    {"approximate_any", {LSP_TRACE_APPROXIMATE | LSP_TRACE_ANY_HIT, 0}},
    {"approximate_near", {LSP_TRACE_APPROXIMATE | LSP_TRACE_NEAR_APPROXIMATE, 0}},
    {"approximate_near_any", {LSP_TRACE_APPROXIMATE | LSP_TRACE_NEAR_APPROXIMATE | LSP_TRACE_ANY_HIT, 0}},
    {"approximate_skip", {LSP_TRACE_APPROXIMATE | LSP_TRACE_NEAR_SKIP, 0}},
    {"approximate_skip_any", {LSP_TRACE_APPROXIMATE | LSP_TRACE_NEAR_SKIP | LSP_TRACE_ANY_HIT, 0.5f}},
    {"approximate_lod", {LSP_TRACE_APPROXIMATE, 0.7f}},
    {"approximate_lod_near", {LSP_TRACE_APPROXIMATE | LSP_TRACE_NEAR_APPROXIMATE, 3.0f}},
};

std::string print(const LspHit& h) {
  std::ostringstream out;
  out << std::hexfloat << "t " << h.t << " primitive " << h.primitive << " u " << h.u << " v " << h.v
      << " normal " << h.normal.x << " " << h.normal.y << " " << h.normal.z << " flags " << std::hex
      << h.flags;
  return out.str();
}

std::string print(const LspRay& r) {
  std::ostringstream out;
  out << std::hexfloat << "origin " << r.origin.x << " " << r.origin.y << " " << r.origin.z << " tmin "
      << r.tmin << " direction " << r.direction.x << " " << r.direction.y << " " << r.direction.z << " tmax "
      << r.tmax;
  return out.str();
}

void expect_same(const std::vector<LspRay>& rays, const std::vector<LspHit>& cpu,
                 const std::vector<LspHit>& gpu) {
  size_t different = 0;
  for (size_t i = 0; i < rays.size(); ++i) {
    if (memcmp(&cpu[i], &gpu[i], sizeof(LspHit)) == 0) continue;
    if (++different <= 5) {
      ADD_FAILURE() << "ray " << i << ": " << print(rays[i]) << "\n  CPU    " << print(cpu[i])
                    << "\n  Vulkan " << print(gpu[i]);
    }
  }
  EXPECT_EQ(different, 0u) << "of " << rays.size();
}

class Agreement : public testing::TestWithParam<std::tuple<Device, Trace>> {
 protected:
  void SetUp() override {
    std::string why;
    if (!VulkanTracer::available(&why)) GTEST_SKIP() << why;
  }

  // Traces with both and compares hits and counts. Returns the number of rays that hit something.
  uint64_t compare(const Parts& parts, const std::vector<LspRay>& rays) {
    const auto& [device, trace] = GetParam();
    const Bytes bytes = write_raw(parts);
    lsp_scene scene;
    lsp_error error;
    EXPECT_EQ(lsp_open(bytes.data(), bytes.size(), &scene, &error), LSP_OK) << error.message;
    std::vector<LspHit> cpu(rays.size());
    std::vector<LspHit> gpu(rays.size());
    lsp_trace_counts counts{};
    EXPECT_EQ(lsp_trace(&scene, &trace.options, rays.data(), cpu.data(), rays.size(), &counts, &error),
              LSP_OK)
        << error.message;
    VulkanOptions options;
    options.discrete = device.discrete;
    options.addresses = device.addresses;
    std::unique_ptr<VulkanTracer> made;
    try {
      made = std::make_unique<VulkanTracer>(options);
    } catch (const Failure& failure) {
      if (!device.addresses) throw;
      skipped_ = failure.what();
      return 0;
    }
    VulkanTracer& tracer = *made;
    try {
      const bool approximate = (trace.options.flags & LSP_TRACE_APPROXIMATE) != 0;
      tracer.load(scene, approximate ? LSP_USE_APPROXIMATE : LSP_USE_EXACT, device.path);
    } catch (const Failure& failure) {
      if (device.path != LoadPath::kImport) throw;
      skipped_ = failure.what();
      return 0;
    }
    EXPECT_EQ(tracer.load_path(), device.path);
    tracer.trace(trace.options, rays, gpu);
    expect_same(rays, cpu, gpu);
    std::fill(gpu.begin(), gpu.end(), LspHit{});
    const VulkanTrace counted = tracer.trace(trace.options, rays, gpu, true);
    expect_same(rays, cpu, gpu);
    EXPECT_EQ(counted.counts.rays, counts.rays);
    EXPECT_EQ(counted.counts.invalid, counts.invalid);
    EXPECT_EQ(counted.counts.hits, counts.hits);
    EXPECT_EQ(counted.counts.nodes, counts.nodes);
    EXPECT_EQ(counted.counts.shafts, counts.shafts);
    EXPECT_EQ(counted.counts.triangles, counts.triangles);
    EXPECT_EQ(counted.retraced, 0u);
    return counts.hits;
  }
  std::string skipped_;
};

TEST_P(Agreement, HardRays) {
  for (const uint32_t triangles : {2000u, 9u, 1u, 0u}) {
    SCOPED_TRACE(triangles);
    BuildOptions options;
    options.triangles = triangles;
    options.line_space_depth = triangles > 100 ? 6 : 0;
    const Parts parts = build_parts(options);
    if (parts.line_spaces.empty() && (std::get<1>(GetParam()).options.flags & LSP_TRACE_APPROXIMATE) != 0)
      continue;
    const uint64_t hits = compare(parts, hard_rays(parts.triangles, 26000, 1 + triangles));
    if (!skipped_.empty()) GTEST_SKIP() << skipped_;
    if (triangles > 100) {
      EXPECT_GT(hits, 5000u);
    }
  }
}

// Scenes of any unit: where products of coordinates leave the range of normal numbers, too.
TEST_P(Agreement, ScenesOfEveryScale) {
  if (std::get<0>(GetParam()).path != LoadPath::kImport) return;  // how the scene got there has no part in it
  for (const float scale : {1e-30f, 1e-18f, 1e-9f, 1e6f, 1e12f, 1e18f}) {
    SCOPED_TRACE(scale);
    BuildOptions options;
    options.scale = scale;
    const Parts parts = build_parts(options);
    compare(parts, hard_rays(parts.triangles, 4000, 77, scale));
    if (!skipped_.empty()) GTEST_SKIP() << skipped_;
  }
}

INSTANTIATE_TEST_SUITE_P(All, Agreement,
                         testing::Combine(testing::ValuesIn(kDevices), testing::ValuesIn(kTraces)),
                         [](const auto& info) {
                           return std::string(std::get<0>(info.param).name) + "_" +
                                  std::get<1>(info.param).name;
                         });

}  // namespace
}  // namespace lsp::test
