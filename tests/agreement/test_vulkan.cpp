// How scenes get to a Vulkan device, and what happens at its limits. Skips where there is no device.
#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/mman.h>
#include <unistd.h>

#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>

#include "hard_rays.h"
#include "lsp/lsp.h"
#include "lsp/program.h"
#include "lsp/vulkan_device.hpp"
#include "scene_builder.h"

// Drivers leave memory behind, in modules that are gone at the end: leaks are looked for in the other tests.
extern "C" const char* __lsan_default_options() { return "detect_leaks=0"; }

namespace lsp::test {
namespace {

class Vulkan : public testing::Test {
 protected:
  void SetUp() override {
    std::string why;
    if (!VulkanTracer::available(&why)) GTEST_SKIP() << why;
  }
};

// A file of its own in the temporary folder, removed at the end.
class TemporaryFile {
 public:
  explicit TemporaryFile(const Bytes& bytes)
      : path_((std::filesystem::temp_directory_path() /
               ("lsp_test_vulkan_" + std::to_string(getpid()) + ".lsp"))) {
    std::ofstream(path_, std::ios::binary)
        .write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  }
  ~TemporaryFile() { std::filesystem::remove(path_); }
  std::string path() const { return path_.string(); }

 private:
  std::filesystem::path path_;
};

lsp_scene open_scene(const void* bytes, uint64_t size) {
  lsp_scene scene;
  lsp_error error;
  if (lsp_open(bytes, size, &scene, &error) != LSP_OK) throw Failure(Exit::kInvalid, "", error.message);
  return scene;
}

LspHit trace_one(VulkanTracer& tracer, const LspRay& ray) {
  LspHit hit{};
  tracer.trace({0, 0}, {&ray, 1}, {&hit, 1});
  return hit;
}

Parts one_triangle() {
  BuildOptions options;
  options.triangles = 1;
  options.line_spaces = options.normals = options.materials = false;
  return build_parts(options);
}

// A ray at the middle of the only triangle.
LspRay ray_at(const LspTriangle& t) {
  const lsp_float3 c{(t.v0.x + t.v1.x + t.v2.x) / 3, (t.v0.y + t.v1.y + t.v2.y) / 3,
                     (t.v0.z + t.v1.z + t.v2.z) / 3};
  return {{c.x, c.y, c.z - 5}, 0, {0, 0, 1}, 100};
}

// The proof of no copy: a byte of the file changed through another mapping is what the next dispatch reads.
TEST_F(Vulkan, ImportedMappingIsTheBuffer) {
  const Parts parts = one_triangle();
  const TemporaryFile file(write_raw(parts));
  lsp_mapping mapping;
  ASSERT_EQ(lsp_map_file(file.path().c_str(), &mapping, nullptr), LSP_OK);
  const lsp_scene scene = open_scene(mapping.bytes, mapping.size);
  const LspRay ray = ray_at(parts.triangles[0]);
  {
    VulkanTracer tracer;
    try {
      tracer.load(scene, LSP_USE_EXACT, LoadPath::kImport);
    } catch (const Failure& failure) {
      lsp_unmap_file(&mapping);
      GTEST_SKIP() << failure.what();
    }
    EXPECT_EQ(tracer.load_path(), LoadPath::kImport);
    EXPECT_EQ(tracer.bytes_imported(), mapping.size);
    EXPECT_EQ(tracer.bytes_uploaded(), 0u);
    EXPECT_EQ(trace_one(tracer, ray).primitive, 0u);

    const int handle = open(file.path().c_str(), O_RDWR);
    ASSERT_GE(handle, 0);
    void* writable = mmap(nullptr, mapping.size, PROT_READ | PROT_WRITE, MAP_SHARED, handle, 0);
    close(handle);
    ASSERT_NE(writable, MAP_FAILED);
    const auto offset = static_cast<size_t>(reinterpret_cast<const char*>(&scene.triangles[0].primitive) -
                                            static_cast<const char*>(mapping.bytes));
    static_cast<unsigned char*>(writable)[offset] = 42;
    EXPECT_EQ(trace_one(tracer, ray).primitive, 42u);
    munmap(writable, mapping.size);
  }
  lsp_unmap_file(&mapping);
}

// And the counter-proof: after an upload the file may change as it likes.
TEST_F(Vulkan, UploadIsACopy) {
  const Parts parts = one_triangle();
  for (const bool discrete : {false, true}) {
    Bytes bytes = write_raw(parts);
    VulkanOptions options;
    options.discrete = discrete;
    VulkanTracer tracer(options);
    tracer.load(open_scene(bytes.data(), bytes.size()), LSP_USE_EXACT, LoadPath::kUpload);
    EXPECT_EQ(tracer.load_path(), LoadPath::kUpload);
    EXPECT_EQ(tracer.bytes_imported(), 0u);
    EXPECT_EQ(tracer.bytes_uploaded(), sizeof(LspHeader) + sizeof(LspTriangle));
    bytes[section_of(bytes, LSP_SECTION_TRIA).offset + offsetof(LspTriangle, primitive)] = 42;
    EXPECT_EQ(trace_one(tracer, ray_at(parts.triangles[0])).primitive, 0u);
  }
}

TEST_F(Vulkan, UploadsOnlyTheSectionsOfTheFeature) {
  const Bytes bytes = write_raw(build_parts({}));
  const lsp_scene scene = open_scene(bytes.data(), bytes.size());
  const LspHeader& header = *scene.header;
  const uint64_t exact = sizeof(LspHeader) + header.node_count * sizeof(LspNode) +
                         header.triangle_count * (sizeof(LspTriangle) + sizeof(LspCornerNormals));
  const uint64_t line_spaces = header.line_space_count * sizeof(LspLineSpace) +
                               header.bit_word_count * sizeof(LspBitWord) + header.candidate_word_count * 4u;
  VulkanTracer tracer;
  tracer.load(scene, LSP_USE_EXACT, LoadPath::kUpload);
  EXPECT_EQ(tracer.bytes_uploaded(), exact);
  LspRay ray{};
  LspHit hit{};
  EXPECT_THROW(tracer.trace({LSP_TRACE_APPROXIMATE, 0}, {&ray, 1}, {&hit, 1}), Failure);
  tracer.load(scene, LSP_USE_APPROXIMATE | LSP_USE_MATERIALS, LoadPath::kUpload);
  EXPECT_EQ(tracer.bytes_uploaded(), exact + line_spaces + header.material_count * sizeof(LspMaterial));
}

// Automatic falls back to the upload where the bytes cannot be imported, and says why.
TEST_F(Vulkan, AutomaticFallsBack) {
  const Bytes good = write_raw(build_parts({}));
  Bytes shifted(good.size() + 256);
  memcpy(shifted.data() + 256, good.data(), good.size());
  const lsp_scene scene = open_scene(shifted.data() + 256, good.size());
  VulkanTracer tracer;
  tracer.load(scene, LSP_USE_EXACT, LoadPath::kAutomatic);
  EXPECT_EQ(tracer.load_path(), LoadPath::kUpload);
  EXPECT_FALSE(tracer.load_note().empty());
  EXPECT_THROW(tracer.load(scene, LSP_USE_EXACT, LoadPath::kImport), Failure);
  tracer.load(scene, LSP_USE_EXACT, LoadPath::kUpload);  // still usable after a failed load
  VulkanOptions discrete;
  discrete.discrete = true;
  VulkanTracer other(discrete);
  other.load(open_scene(good.data(), good.size()), LSP_USE_EXACT, LoadPath::kAutomatic);
  EXPECT_EQ(other.load_path(), LoadPath::kUpload);
}

// More rays than one batch holds, and more bytes than the staging ring.
TEST_F(Vulkan, ManyBatchesAndPieces) {
  BuildOptions build;
  build.triangles = 100000;
  build.line_spaces = false;
  const Parts parts = build_parts(build);
  const Bytes bytes = write_raw(parts);
  ASSERT_GT(bytes.size(), 6u << 20);
  const lsp_scene scene = open_scene(bytes.data(), bytes.size());
  std::vector<LspRay> rays((1u << 20) + 5000);
  const std::vector<LspRay> few = hard_rays(parts.triangles, 5000, 9);
  for (size_t i = 0; i < rays.size(); ++i) {
    rays[i] = few[i % few.size()];
    if (i >= few.size() && i < 1u << 20) rays[i].tmin = 1, rays[i].tmax = 0;  // invalid: quick
  }
  std::vector<LspHit> expected(rays.size());
  std::vector<LspHit> hits(rays.size());
  const lsp_trace_options trace{LSP_TRACE_ANY_HIT, 0};
  lsp_trace(&scene, &trace, rays.data(), expected.data(), rays.size(), nullptr, nullptr);
  VulkanOptions options;
  options.discrete = true;
  VulkanTracer tracer(options);
  tracer.load(scene, LSP_USE_EXACT);
  const VulkanTrace result = tracer.trace(trace, rays, hits);
  EXPECT_EQ(result.batches, 2u);
  EXPECT_EQ(memcmp(hits.data(), expected.data(), hits.size() * sizeof(LspHit)), 0);
}

// `count` copies of a ray along the axis of a stack of sheets, from before sheet `first`.
void add_axis_rays(std::vector<LspRay>& rays, uint32_t first, int count) {
  for (int i = 0; i < count; ++i) {
    rays.push_back({{static_cast<float>(first) - 0.5f, 0, 0}, 0, {1, 0, 0}, INFINITY});
  }
}

// lavapipe silently ends all loops of a vector of invocations after 65,535 iterations. Such rays are known by
// the work they left, and traced on the CPU.
TEST_F(Vulkan, RaysThatTheDeviceCutsShortAreTracedAgain) {
  constexpr uint32_t kSheets = 40000;
  const Bytes bytes = write_raw(build_stack_of_sheets(kSheets, 1));
  const lsp_scene scene = open_scene(bytes.data(), bytes.size());
  std::vector<LspRay> rays;
  for (int i = 0; i < 50; ++i) {
    add_axis_rays(rays, 0, 1);
    rays.push_back({{-1, -0.5f, 0.9f}, 0, {1, 0, 0}, INFINITY});  // into the first
  }
  std::vector<LspHit> expected(rays.size());
  std::vector<LspHit> hits(rays.size());
  lsp_trace_counts counts{};
  const lsp_trace_options trace{0, 0};
  lsp_trace(&scene, &trace, rays.data(), expected.data(), rays.size(), &counts, nullptr);
  EXPECT_EQ(counts.hits, rays.size());
  EXPECT_GT(counts.nodes, 50u * (kSheets - 1));
  VulkanTracer tracer;
  tracer.load(scene, LSP_USE_EXACT);
  const VulkanTrace result = tracer.trace(trace, rays, hits, true);
  EXPECT_EQ(memcmp(hits.data(), expected.data(), hits.size() * sizeof(LspHit)), 0);
  EXPECT_EQ(result.counts.hits, counts.hits);
  EXPECT_EQ(result.counts.nodes, counts.nodes);
  EXPECT_EQ(result.counts.triangles, counts.triangles);
  if (tracer.device_name().find("llvmpipe") != std::string::npos) {
    EXPECT_GE(result.retraced, 50u);
  }
}

// Wherever in its work the device's limit meets a ray, the last triangle of the last leaf included: no hit is
// lost without a word. Finds the length of traversal at which the limit is met and tries every one about it.
TEST_F(Vulkan, NoPlaceToCutLosesAHit) {
  constexpr uint32_t kSheets = 48000;
  constexpr int kLanes = 8;  // of a vector: all the same ray
  const Bytes bytes = write_raw(build_stack_of_sheets(kSheets, 16));
  const lsp_scene scene = open_scene(bytes.data(), bytes.size());
  VulkanTracer tracer;
  tracer.load(scene, LSP_USE_EXACT);
  const auto trace_from = [&](uint32_t begin, uint32_t end, uint32_t step) {
    std::vector<LspRay> rays;
    for (uint32_t first = begin; first < end; first += step) add_axis_rays(rays, first, kLanes);
    std::vector<LspHit> hits(rays.size());
    const VulkanTrace result = tracer.trace({0, 0}, rays, hits);
    size_t lost = 0;
    for (const LspHit& hit : hits) lost += hit.primitive == kSheets - 1 ? 0 : 1;
    EXPECT_EQ(lost, 0u) << "of " << hits.size() << " rays from sheet " << begin << " on";
    return result.retraced / kLanes;
  };
  // The rays that start first are the ones with too much work.
  const uint64_t cut = trace_from(0, kSheets, 500);
  if (cut == 0) GTEST_SKIP() << "this device cuts no loop short";
  const auto at = static_cast<uint32_t>(cut) * 500;
  EXPECT_GT(trace_from(at - 560, at + 40, 1), 0u);
}

TEST_F(Vulkan, SectionOverTheDevicesLimitIsNamed) {
  const Bytes bytes = write_raw(build_parts({}));
  const lsp_scene scene = open_scene(bytes.data(), bytes.size());
  const lsp_vulkan_limits limits{1024, 4096, 65535, 0};
  lsp_vulkan_plan plan;
  lsp_error error;
  EXPECT_EQ(lsp_vulkan_plan_buffers(&scene, LSP_USE_EXACT, &limits, &plan, &error), LSP_ERROR_LIMIT);
  EXPECT_NE(std::string(error.message).find("maxStorageBufferRange"), std::string::npos) << error.message;
  EXPECT_NE(std::string(error.message).find("NODE"), std::string::npos) << error.message;
  // With buffer addresses it is no limit, and they are used for no other reason.
  constexpr uint32_t kUses = LSP_USE_EXACT | LSP_USE_ADDRESSES_IF_NEEDED;
  ASSERT_EQ(lsp_vulkan_plan_buffers(&scene, kUses, &limits, &plan, &error), LSP_OK) << error.message;
  EXPECT_NE(plan.addresses, 0u);
  EXPECT_NE(plan.usage & VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT, 0u);
  const lsp_vulkan_limits large{1u << 27, 4096, 65535, 0};
  ASSERT_EQ(lsp_vulkan_plan_buffers(&scene, kUses, &large, &plan, &error), LSP_OK) << error.message;
  EXPECT_EQ(plan.addresses, 0u);
  EXPECT_EQ(plan.usage & VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT, 0u);
  // Addresses do not help where no buffer may be as large.
  const lsp_vulkan_limits small{512, 4096, 65535, 1024};
  EXPECT_EQ(lsp_vulkan_plan_buffers(&scene, kUses, &small, &plan, &error), LSP_ERROR_LIMIT);
  EXPECT_NE(std::string(error.message).find("at most 1024 (maxBufferSize)"), std::string::npos)
      << error.message;
}

// Candidates that lie beyond what a storage buffer of most devices may hold (128 MiB on lavapipe).
TEST_F(Vulkan, SectionBeyondTheStorageBufferRange) {
  constexpr uint32_t kBefore = 50'000'000;  // words
  Parts parts = build_parts({});
  const std::vector<LspRay> rays = hard_rays(parts.triangles, 2000, 5);
  std::vector<uint32_t> shifted(kBefore);
  shifted.insert(shifted.end(), parts.candidates.begin(), parts.candidates.end());
  parts.candidates = std::move(shifted);
  parts.header.candidate_word_count += kBefore;
  for (LspLineSpace& l : parts.line_spaces) l.candidate_first += kBefore;
  const Bytes bytes = write_raw(parts);
  const lsp_scene scene = open_scene(bytes.data(), bytes.size());
  const lsp_trace_options options{LSP_TRACE_APPROXIMATE | LSP_TRACE_NEAR_APPROXIMATE, 0};
  std::vector<LspHit> cpu(rays.size()), gpu(rays.size());
  ASSERT_EQ(lsp_trace(&scene, &options, rays.data(), cpu.data(), rays.size(), nullptr, nullptr), LSP_OK);
  for (const LoadPath path : {LoadPath::kImport, LoadPath::kUpload}) {
    VulkanTracer tracer;
    try {
      tracer.load(scene, LSP_USE_APPROXIMATE, path);
    } catch (const Failure& failure) {
      EXPECT_EQ(failure.exit(), Exit::kUnsupported) << failure.what();
      continue;
    }
    tracer.trace(options, rays, gpu);
    EXPECT_EQ(memcmp(cpu.data(), gpu.data(), cpu.size() * sizeof(LspHit)), 0);
  }
}

// The copies that the plan asks for are each buffer's bytes, once, whatever their size.
TEST(VulkanPlan, PiecesCoverEveryBufferOnce) {
  const Bytes bytes = write_raw(build_parts({}));
  const lsp_scene scene = open_scene(bytes.data(), bytes.size());
  const lsp_vulkan_limits limits{1u << 30, 4096, 65535, 0};
  lsp_vulkan_plan plan;
  ASSERT_EQ(lsp_vulkan_plan_buffers(&scene, LSP_USE_EXACT | LSP_USE_APPROXIMATE | LSP_USE_MATERIALS, &limits,
                                    &plan, nullptr),
            LSP_OK);
  EXPECT_EQ(plan.buffer_count, 8u);                                        // all that a BVH can have
  for (const uint64_t most : {0ull, 1ull, 100ull, 4096ull, 1ull << 20}) {  // 0: whole buffers
    std::vector<std::vector<unsigned char>> copies(plan.buffer_count);
    lsp_vulkan_copy copy;
    for (uint64_t cursor = 0; lsp_vulkan_next_copy(&scene, &plan, most, &cursor, &copy) != 0;) {
      ASSERT_GT(copy.bytes, 0u);
      EXPECT_LE(copy.bytes, most > 0 ? most : plan.buffers[copy.buffer].bytes);
      EXPECT_EQ(copy.buffer_offset, copies[copy.buffer].size());
      const auto* source = static_cast<const unsigned char*>(copy.source);
      copies[copy.buffer].insert(copies[copy.buffer].end(), source, source + copy.bytes);
    }
    for (uint32_t i = 0; i < plan.buffer_count; ++i) {
      ASSERT_EQ(copies[i].size(), plan.buffers[i].bytes);
      EXPECT_EQ(memcmp(copies[i].data(), bytes.data() + plan.buffers[i].file_offset, copies[i].size()), 0);
    }
  }
}

// Every path under the validation layer, core and synchronization: not a word.
TEST_F(Vulkan, ValidationHasNothingToSay) {
  const Parts parts = build_parts({});
  const Bytes bytes = write_raw(parts);
  const lsp_scene scene = open_scene(bytes.data(), bytes.size());
  const std::vector<LspRay> rays = hard_rays(parts.triangles, 1000, 5);
  std::vector<LspHit> hits(rays.size());
  for (const int kind : {0, 1, 2, 3}) {
    VulkanOptions options;
    options.validation = true;
    options.discrete = (kind & 1) != 0;
    options.addresses = (kind & 2) != 0;
    std::unique_ptr<VulkanTracer> tracer;
    try {
      tracer = std::make_unique<VulkanTracer>(options);
    } catch (const Failure& failure) {
      GTEST_SKIP() << failure.what();
    }
    for (const LoadPath path : {LoadPath::kAutomatic, LoadPath::kUpload}) {
      tracer->load(scene, LSP_USE_EXACT | LSP_USE_APPROXIMATE, path);
      for (const bool count : {false, true}) {
        tracer->trace({0, 0}, rays, hits, count);
        tracer->trace({LSP_TRACE_APPROXIMATE, 0.5f}, rays, hits, count);
      }
    }
    for (const std::string& message : tracer->validation_messages()) ADD_FAILURE() << message;
  }
}

// A damaged file whose indices lead anywhere: the device must survive it and the misses be plain.
TEST_F(Vulkan, WildIndicesStayInsideTheBuffers) {
  Parts parts = build_parts({});
  Random random(11);
  const std::vector<LspRay> rays = hard_rays(parts.triangles, 2000, 3);
  for (LspNode& node : parts.nodes) {
    if (random.below(4) == 0) node.child0 = random.next();
    if (random.below(4) == 0) node.line_space1 = random.next();
  }
  for (LspLineSpace& ls : parts.line_spaces)
    ls.candidate_first = random.next(), ls.word_first = random.next();
  const Bytes bytes = write_raw(parts);
  const lsp_scene scene = open_scene(bytes.data(), bytes.size());
  std::vector<LspHit> hits(rays.size());
  for (const bool addresses : {false, true}) {
    VulkanOptions device;
    device.addresses = addresses;
    VulkanTracer tracer(device);
    tracer.load(scene, LSP_USE_EXACT | LSP_USE_APPROXIMATE);
    tracer.trace({0, 0}, rays, hits);
    tracer.trace({LSP_TRACE_APPROXIMATE, 0}, rays, hits);
  }
  for (const lsp_trace_options& options :
       {lsp_trace_options{0, 0}, lsp_trace_options{LSP_TRACE_APPROXIMATE, 0}}) {
    EXPECT_EQ(lsp_trace(&scene, &options, rays.data(), hits.data(), rays.size(), nullptr, nullptr), LSP_OK);
  }
}

}  // namespace
}  // namespace lsp::test
