// What is loaded is what is asked for, and no more is read: sections and bytes of every use, tables first and
// exact data later while frames are traced, and what an unload gives back.
#include <gtest/gtest.h>
#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <map>
#include <optional>
#include <set>
#include <string>

#include "bake.h"
#include "device.h"
#include "hard_rays.h"
#include "lsp/scene_file.hpp"
#include "meshes.h"
#include "surface_rays.h"
#include "trace_shader.h"
#include "traced.h"
#include "writer.h"

// Drivers leave memory behind, in modules that are gone at the end: leaks are looked for in the other tests.
extern "C" const char* __lsan_default_options() { return "detect_leaks=0"; }

namespace lsp::test {
namespace {

namespace fs = std::filesystem;
using Names = std::set<std::string>;

constexpr lsp_vulkan_limits kLimits{1u << 30, 4096, 65535, 0};
constexpr uint32_t kAll = LSP_USE_EXACT | LSP_USE_APPROXIMATE;
constexpr uint32_t kAmbientOcclusion = LSP_USE_TABLES | LSP_USE_OCCLUSION;
constexpr Names::size_type kCellSections = 6;  // that every approximate ray of cells may read

// A smooth ball between two walls, in cells, with materials. `gaps`: its triangles are there in part.
lsp::Baked bake_ball(bool gaps) {
  Mesh mesh = sphere(gaps ? 6 : 14);
  for (size_t t = 0; t < mesh.triangles.size(); ++t)
    for (int k = 0; k < 3; ++k)
      mesh.normals[t][size_t(k)] = glm::normalize(mesh.positions[mesh.triangles[t][k]]);
  for (const float side : {-2.0f, 2.0f}) {
    add_triangle(mesh, {side, -2, -2}, {side, 2, -2}, {side, 2, 2});
    add_triangle(mesh, {side, -2, -2}, {side, 2, 2}, {side, -2, 2});
  }
  if (gaps) mesh.materials[0].opacity = 0.5f;
  BakeOptions options;
  options.base = Base::kCells;
  options.cells = gaps ? 3 : 5;
  return bake(mesh, options);
}

// A name of this process', removed at the end.
class UnnamedFile {
 public:
  UnnamedFile()
      : path_((fs::temp_directory_path() / ("lsp_test_loading_" + std::to_string(getpid()) + ".lsp"))
                  .string()) {}
  ~UnnamedFile() { fs::remove(path_); }
  UnnamedFile(const UnnamedFile&) = delete;
  UnnamedFile& operator=(const UnnamedFile&) = delete;
  const std::string& path() const { return path_; }

 private:
  std::string path_;
};

// A bake as a mapped file, whose name is gone.
class BakedScene {
 public:
  explicit BakedScene(bool gaps = false) : baked_(bake_ball(gaps)) {
    const UnnamedFile file;
    WriteOptions options;
    options.alignment = 4096;
    write_lsp(file.path(), baked_, "{}", options);
    file_.emplace(file.path());
  }
  const lsp_scene& operator*() const { return file_->scene(); }
  std::vector<LspRay> rays() const {
    std::vector<LspRay> rays = surface_rays(baked_, 3000, 1);
    const std::vector<LspRay> hard = hard_rays(baked_.triangles, 520, 3);
    rays.insert(rays.end(), hard.begin(), hard.end());
    return rays;
  }

 private:
  lsp::Baked baked_;
  std::optional<SceneFile> file_;
};

const BakedScene& cells() {
  static const BakedScene scene;
  return scene;
}

const BakedScene& with_gaps() {
  static const BakedScene scene(true);
  return scene;
}

SceneFile of_corpus(const char* name) { return SceneFile(LSP_CORPUS_DIR "/" + std::string(name) + ".lsp"); }

lsp_vulkan_plan plan_of(const lsp_scene& scene, uint32_t uses) {
  lsp_vulkan_plan plan;
  lsp_error error;
  EXPECT_EQ(lsp_vulkan_plan_buffers(&scene, uses, &kLimits, &plan, &error), LSP_OK) << error.message;
  return plan;
}

// Of a plan's buffers but the header's; checks that each is the file's section, whole, and the sum of bytes.
Names sections_of(const lsp_scene& scene, const lsp_vulkan_plan& plan) {
  Names names;
  uint64_t bytes = sizeof(LspHeader);
  EXPECT_EQ(plan.buffers[0].section, 0u);
  for (uint32_t i = 1; i < plan.buffer_count; ++i) {
    const lsp_vulkan_buffer& buffer = plan.buffers[i];
    names.emplace(reinterpret_cast<const char*>(&buffer.section), 4);
    bytes += buffer.bytes;
    for (uint32_t k = 0; k < scene.header->section_count; ++k) {
      if (scene.sections[k].type != buffer.section) continue;
      EXPECT_EQ(scene.sections[k].offset, buffer.file_offset);
      EXPECT_EQ(scene.sections[k].bytes, buffer.bytes);
    }
  }
  EXPECT_EQ(names.size() + 1, plan.buffer_count);
  EXPECT_EQ(bytes, plan.bytes);
  return names;
}

Names sections_for(const lsp_scene& scene, uint32_t uses) { return sections_of(scene, plan_of(scene, uses)); }

Names operator+(Names a, const Names& b) {
  a.insert(b.begin(), b.end());
  return a;
}

lsp_trace_options by_tables(uint32_t quality, uint32_t flags = 0) {
  return {LSP_TRACE_APPROXIMATE | flags, 0, quality};
}

// Of occlusion all that is asked is whether t is finite.
size_t differing(const std::vector<LspHit>& a, const std::vector<LspHit>& b, bool occlusion) {
  size_t count = a.size() == b.size() ? 0 : 1;
  for (size_t i = 0; i < a.size() && i < b.size(); ++i)
    count += occlusion ? std::isfinite(a[i].t) != std::isfinite(b[i].t)
                       : std::memcmp(&a[i], &b[i], sizeof a[i]) != 0;
  return count;
}

TEST(Loading, EveryUseHasItsSectionsOfCells) {
  const lsp_scene& scene = *cells();
  const Names tables{"CGRD", "CELT", "CENT", "CPLN", "CPRC", "CSPL"}, surfaces{"TRIA", "NRML"},
      exact_cells{"CNOD", "CREF"}, tree{"WNOD"};
  ASSERT_EQ(tables.size(), kCellSections);
  EXPECT_EQ(sections_for(scene, kAmbientOcclusion), tables);
  EXPECT_EQ(sections_for(scene, LSP_USE_TABLES), tables + surfaces);
  EXPECT_EQ(sections_for(scene, LSP_USE_APPROXIMATE), tables + surfaces + exact_cells);
  EXPECT_EQ(sections_for(scene, LSP_USE_APPROXIMATE | LSP_USE_OCCLUSION),
            tables + exact_cells + Names{"TRIA"});
  EXPECT_EQ(sections_for(scene, LSP_USE_EXACT), tree + surfaces);
  EXPECT_EQ(sections_for(scene, LSP_USE_EXACT | LSP_USE_OCCLUSION), tree + Names{"TRIA"});
  EXPECT_EQ(sections_for(scene, kAll), tables + surfaces + exact_cells + tree);
  lsp_vulkan_plan plan;
  lsp_error error;
  EXPECT_EQ(lsp_vulkan_plan_buffers(&scene, LSP_USE_EXACT | 0x40u, &kLimits, &plan, &error),
            LSP_ERROR_UNSUPPORTED);
  EXPECT_NE(std::string(error.message).find("does not know uses 0x40"), std::string::npos) << error.message;
  EXPECT_EQ(sections_for(scene, LSP_USE_TABLES | LSP_USE_MATERIALS), tables + surfaces + Names{"MATL"});
  EXPECT_LT(plan_of(scene, kAmbientOcclusion).bytes, plan_of(scene, LSP_USE_TABLES).bytes);
  EXPECT_LT(plan_of(scene, LSP_USE_TABLES).bytes, plan_of(scene, LSP_USE_APPROXIMATE).bytes);
}

// A plane of a triangle that is there in part is asked for it.
TEST(Loading, TrianglesWithGapsAreReadByOcclusionToo) {
  const Names names = sections_for(*with_gaps(), kAmbientOcclusion);
  EXPECT_EQ(names.size(), kCellSections + 1);
  EXPECT_TRUE(names.contains("TRIA"));
}

TEST(Loading, OfOtherStructuresTablesAreApproximateRays) {
  const Names surfaces{"TRIA", "NRML"}, line_spaces{"LSPC", "BITS", "CAND"};
  const SceneFile bvh = of_corpus("full"), ntree = of_corpus("ntree-full"), wide = of_corpus("wide-alone");
  const Names of_bvh = Names{"NODE"} + surfaces + line_spaces,
              of_ntree = Names{"GRID", "CELL", "REFS"} + surfaces + line_spaces;
  for (const uint32_t uses : {LSP_USE_TABLES, LSP_USE_APPROXIMATE, kAll}) {
    EXPECT_EQ(sections_for(bvh.scene(), uses), of_bvh);
    EXPECT_EQ(sections_for(ntree.scene(), uses), of_ntree);
    EXPECT_EQ(sections_for(wide.scene(), uses), Names{"WNOD"} + surfaces);
  }
  // These compare the normals at candidates; exact rays do not.
  EXPECT_EQ(sections_for(bvh.scene(), kAmbientOcclusion), of_bvh);
  EXPECT_EQ(sections_for(bvh.scene(), LSP_USE_EXACT | LSP_USE_OCCLUSION), (Names{"NODE", "TRIA"}));
  EXPECT_EQ(sections_for(wide.scene(), kAmbientOcclusion), (Names{"WNOD", "TRIA"}));
}

TEST(Loading, MoreKeepsWhatIsThereAndUploadsTheRest) {
  const lsp_scene& scene = *cells();
  const lsp_vulkan_plan first = plan_of(scene, LSP_USE_TABLES);
  lsp_vulkan_plan plan;
  lsp_vulkan_change change;
  ASSERT_EQ(lsp_vulkan_change_plan(&scene, &first, kAll, &kLimits, &plan, &change, nullptr), LSP_OK);
  EXPECT_EQ(sections_of(scene, plan), sections_for(scene, kAll));
  EXPECT_EQ(change.kept, first.buffer_count);
  EXPECT_EQ(change.bytes_kept, first.bytes);
  EXPECT_EQ(change.bytes_added, plan.bytes - first.bytes);
  EXPECT_EQ(change.bytes_dropped, 0u);
  for (uint32_t i = 0; i < change.kept; ++i)
    EXPECT_EQ(plan.buffers[i].section, first.buffers[change.from[i]].section);
  std::map<uint32_t, uint64_t> uploaded;
  lsp_vulkan_copy copy;
  for (uint64_t cursor = change.bytes_kept; lsp_vulkan_next_copy(&scene, &plan, 1000, &cursor, &copy) != 0;)
    uploaded[copy.buffer] += copy.bytes;
  EXPECT_EQ(uploaded.size(), plan.buffer_count - change.kept);
  for (const auto& [buffer, bytes] : uploaded) {
    EXPECT_GE(buffer, change.kept);
    EXPECT_EQ(bytes, plan.buffers[buffer].bytes);
  }
}

TEST(Loading, LessGivesBytesBack) {
  const lsp_scene& scene = *cells();
  const lsp_vulkan_plan all = plan_of(scene, kAll);
  lsp_vulkan_plan plan;
  lsp_vulkan_change change;
  ASSERT_EQ(lsp_vulkan_change_plan(&scene, &all, kAmbientOcclusion, &kLimits, &plan, &change, nullptr),
            LSP_OK);
  EXPECT_EQ(plan.bytes, plan_of(scene, kAmbientOcclusion).bytes);
  EXPECT_EQ(change.kept, plan.buffer_count);
  EXPECT_EQ(change.bytes_added, 0u);
  EXPECT_EQ(change.bytes_dropped, all.bytes - plan.bytes);
  EXPECT_EQ(sections_of(scene, plan), sections_for(scene, kAmbientOcclusion));
  // And back from one kind to another: both ways at once.
  lsp_vulkan_plan exact;
  ASSERT_EQ(lsp_vulkan_change_plan(&scene, &plan, LSP_USE_EXACT, &kLimits, &exact, &change, nullptr), LSP_OK);
  EXPECT_EQ(change.kept, 1u);  // the header
  EXPECT_EQ(change.bytes_dropped, plan.bytes - sizeof(LspHeader));
  EXPECT_EQ(sections_of(scene, exact), sections_for(scene, LSP_USE_EXACT));
}

// Buffers that were not made for addresses cannot be read through them.
TEST(Loading, NothingIsKeptWhereAddressesAreNewlyNeeded) {
  const lsp_scene& scene = *cells();
  const lsp_vulkan_plan first = plan_of(scene, LSP_USE_TABLES);
  lsp_vulkan_plan plan;
  lsp_vulkan_change change;
  constexpr uint32_t kUses = kAll | LSP_USE_ADDRESSES_ALWAYS;
  ASSERT_EQ(lsp_vulkan_change_plan(&scene, &first, kUses, &kLimits, &plan, &change, nullptr), LSP_OK);
  EXPECT_EQ(change.kept, 0u);
  EXPECT_EQ(change.bytes_added, plan.bytes);
  EXPECT_EQ(change.bytes_dropped, first.bytes);
  const lsp_vulkan_plan nothing{};
  ASSERT_EQ(lsp_vulkan_change_plan(&scene, &nothing, kAll, &kLimits, &plan, &change, nullptr), LSP_OK);
  EXPECT_EQ(change.bytes_added, plan.bytes);
  EXPECT_EQ(change.bytes_dropped, 0u);
  lsp_error error;
  constexpr lsp_vulkan_limits kSmall{256, 4096, 65535, 0};
  EXPECT_EQ(lsp_vulkan_change_plan(&scene, &first, kAll, &kSmall, &plan, &change, &error), LSP_ERROR_LIMIT);
}

TEST(Loading, WhatIsNotLoadedIsRefusedOrNotCompiledIn) {
  const lsp_scene& scene = *cells();
  lsp_vulkan_kind kind;
  lsp_error error;
  const auto ask = [&](uint32_t uses, const lsp_trace_options& options) {
    const lsp_vulkan_plan plan = plan_of(scene, uses);
    return lsp_vulkan_plan_trace(&scene, &plan, &options, &kind, &error);
  };
  // The dial is open where the cells' exact data is there, else it is that of tables alone.
  ASSERT_EQ(ask(LSP_USE_APPROXIMATE, by_tables(LSP_QUALITY_BALANCED)), LSP_OK) << error.message;
  EXPECT_EQ(kind.dial, LSP_DIAL(scene.header->quality[LSP_QUALITY_BALANCED],
                                scene.header->quality_part[LSP_QUALITY_BALANCED]));
  EXPECT_NE(kind.parts & LSP_PART_CELL_EXACT, 0u);
  EXPECT_EQ(kind.base_structure, uint32_t(LSP_BASE_CELLS));
  ASSERT_EQ(ask(LSP_USE_TABLES | LSP_USE_EXACT, by_tables(LSP_QUALITY_BALANCED)), LSP_OK) << error.message;
  EXPECT_EQ(kind.dial, uint32_t(LSP_DIAL_TABLES));
  EXPECT_EQ(kind.parts & LSP_PART_CELL_EXACT, 0u);
  ASSERT_EQ(ask(LSP_USE_EXACT, {0, 0}), LSP_OK) << error.message;
  EXPECT_EQ(kind.base_structure, uint32_t(LSP_BASE_WIDE));
  EXPECT_GE(kind.stack, scene.header->max_stack);

  const auto expect_refused = [&](uint32_t uses, const lsp_trace_options& options, const char* word) {
    EXPECT_EQ(ask(uses, options), LSP_ERROR_UNSUPPORTED);
    EXPECT_NE(std::string(error.message).find(word), std::string::npos) << error.message;
  };
  expect_refused(LSP_USE_TABLES, {0, 0}, "LSP_USE_EXACT");
  expect_refused(LSP_USE_EXACT, by_tables(LSP_QUALITY_FAST), "LSP_USE_APPROXIMATE");
  expect_refused(kAmbientOcclusion, by_tables(LSP_QUALITY_FAST), "LSP_USE_OCCLUSION");
  expect_refused(kAmbientOcclusion, by_tables(LSP_QUALITY_FAST, LSP_TRACE_ANY_HIT), "LSP_USE_OCCLUSION");
  expect_refused(LSP_USE_MATERIALS, {0, 0}, "LSP_USE_EXACT");
  expect_refused(kAll, {0x80000000u, 0}, "0x80000000");
  EXPECT_EQ(ask(kAmbientOcclusion, by_tables(LSP_QUALITY_FAST, LSP_TRACE_OCCLUSION)), LSP_OK);
  EXPECT_EQ(kind.flags, LSP_TRACE_APPROXIMATE | LSP_TRACE_ANY_HIT | LSP_TRACE_OCCLUSION);
}

// Makes the pages of all sections of a mapping unreadable but those of `names`, for as long as it lives.
class Unreadable {
 public:
  Unreadable(const lsp_scene& scene, const Names& names) : scene_(scene), names_(names) {
    protect(PROT_NONE);
  }
  ~Unreadable() { protect(PROT_READ); }
  Unreadable(const Unreadable&) = delete;
  Unreadable& operator=(const Unreadable&) = delete;

 private:
  void protect(int access) const {
    auto* bytes = static_cast<unsigned char*>(const_cast<void*>(scene_.bytes));
    for (uint32_t i = 0; i < scene_.header->section_count; ++i) {
      const LspSection& section = scene_.sections[i];
      if (names_.contains(std::string(reinterpret_cast<const char*>(&section.type), 4))) continue;
      EXPECT_EQ(section.offset % 4096, 0u);
      EXPECT_EQ(mprotect(bytes + section.offset, section.bytes, access), 0);
    }
  }
  const lsp_scene& scene_;
  const Names& names_;
};

// The CPU, which needs no plan, touches the pages of the same sections: others are never read from the disk.
TEST(Loading, TheCpuReadsTheSameSections) {
  if (sysconf(_SC_PAGESIZE) != 4096) GTEST_SKIP() << "sections begin on pages of 4096 bytes here";
  const lsp_scene& scene = *cells();
  const std::vector<LspRay> rays = cells().rays();
  for (const uint32_t kinds : {LSP_USE_EXACT, LSP_USE_TABLES, LSP_USE_APPROXIMATE})
    for (const uint32_t occlusion : {0u, LSP_USE_OCCLUSION}) {
      lsp_trace_options options{occlusion != 0 ? LSP_TRACE_OCCLUSION : 0u, 0, LSP_QUALITY_ACCURATE};
      if (kinds != LSP_USE_EXACT) options.flags |= LSP_TRACE_APPROXIMATE;
      if (kinds == LSP_USE_TABLES) options.quality = LSP_QUALITY_FAST;
      const std::vector<LspHit> truth = trace(scene, options, rays);
      const Names names = sections_for(scene, kinds | occlusion);
      const Unreadable others(scene, names);
      lsp_scene read = scene;
      // Or closest rays may go through the cells' trees.
      if (kinds == LSP_USE_EXACT) read.cell_references = nullptr;
      EXPECT_EQ(differing(trace(read, options, rays), truth, false), 0u);
      lsp_trace_counts counts{};  // counted rays go one after the other
      LspHit hit;
      EXPECT_EQ(lsp_trace(&read, &options, rays.data(), &hit, 1, &counts, nullptr), LSP_OK);
    }
}

// What a file is for: from its name to the first traced ray, in less than a fiftieth of the time that its
// tree takes to build from the mesh, which is in memory already. The file is in the system's cache.
TEST(Loading, AFirstRayIsFiftyTimesSoonerThanATree) {
  Mesh mesh = sphere(680);
  BakeOptions bake_options;
  bake_options.base = Base::kWide;
  lsp::Baked baked = bake(mesh, bake_options);
  const UnnamedFile file;
  const Written written = write_lsp(file.path(), baked, "{}", {});
  ASSERT_GE(written.file_bytes, 100'000'000u);
  using Clock = std::chrono::steady_clock;
  const auto seconds_since = [](Clock::time_point start) {
    return std::chrono::duration<double>(Clock::now() - start).count();
  };
  double best = HUGE_VAL;
  for (int i = 0; i < 5; ++i) {
    const auto start = Clock::now();
    lsp_mapping mapping;
    lsp_scene scene;
    ASSERT_EQ(lsp_map_file(file.path().c_str(), &mapping, nullptr), LSP_OK);
    ASSERT_EQ(lsp_open(mapping.bytes, mapping.size, &scene, nullptr), LSP_OK);
    const LspRay ray{{0.1f, 0.2f, 5}, 0, {0, 0, -1}, INFINITY};
    LspHit hit;
    const lsp_trace_options exact{0, 0};
    ASSERT_EQ(lsp_trace(&scene, &exact, &ray, &hit, 1, nullptr, nullptr), LSP_OK);
    best = std::min(best, seconds_since(start));
    EXPECT_NE(hit.primitive, LSP_NONE);
    lsp_unmap_file(&mapping);
  }
  std::printf("%.0f MB: the tree %.2f s, open and the first ray %.6f s\n", 1e-6 * double(written.file_bytes),
              baked.tree_seconds, best);
  EXPECT_LT(50 * best, baked.tree_seconds);
}

// The answers of what is loaded are those of the whole file at the same dial. Through addresses a missing
// section is at address 0: a read of it would end the program.
class LoadingOnVulkan : public testing::TestWithParam<uint32_t> {};

void expect_answers_of_the_whole_file(const BakedScene& scene, uint32_t uses, uint32_t addresses) {
  const bool occlusion = (uses & LSP_USE_OCCLUSION) != 0;
  const std::vector<LspRay> rays = scene.rays();
  std::vector<LspHit> hits(rays.size());
  VulkanTracer tracer;
  tracer.load(*scene, uses | addresses, LoadPath::kUpload);
  EXPECT_EQ(tracer.bytes_uploaded(), plan_of(*scene, uses).bytes);
  lsp_trace_options options = by_tables(LSP_QUALITY_ACCURATE, occlusion ? LSP_TRACE_OCCLUSION : 0u);
  if ((uses & LSP_USE_EXACT) != 0) options.flags &= ~LSP_TRACE_APPROXIMATE;
  tracer.trace(options, rays, hits);
  if ((uses & LSP_USE_TABLES) != 0) options.quality = LSP_QUALITY_FAST;
  EXPECT_EQ(differing(hits, trace(*scene, options, rays), occlusion), 0u) << uses;
}

TEST_P(LoadingOnVulkan, AnswersAreThoseOfTheWholeFile) {
  std::string why;
  if (!VulkanTracer::available(&why)) GTEST_SKIP() << why;
  for (const uint32_t uses : {kAmbientOcclusion, LSP_USE_TABLES, LSP_USE_EXACT | LSP_USE_OCCLUSION})
    expect_answers_of_the_whole_file(cells(), uses, GetParam());
  expect_answers_of_the_whole_file(with_gaps(), kAmbientOcclusion, GetParam());
}
INSTANTIATE_TEST_SUITE_P(Through, LoadingOnVulkan, testing::Values(0u, LSP_USE_ADDRESSES_ALWAYS));

// An engine in small: frames in flight, each with rays, hits and a descriptor set of its own.
class Engine {
 public:
  static constexpr size_t kFrames = 3;
  static constexpr VkDeviceSize kPiece = 4 << 10;

  struct Loaded {
    lsp_vulkan_plan plan{};
    std::vector<std::shared_ptr<Buffer>> buffers;  // those kept are shared with the plan before
    VkDescriptorSet sets[kFrames] = {};
  };
  struct Frame {
    explicit Frame(Device& device) : commands(device) {}
    Buffer rays, hits;
    Commands commands;
  };

  Engine(const lsp_scene& scene, const std::vector<LspRay>& rays, const VulkanOptions& options)
      : device_(options), scene_(scene), rays_(rays), shader_(device_, 4 * kFrames) {
    const VkDeviceSize bytes = rays.size() * sizeof(LspRay);
    for (Frame& frame : frames_) {
      frame.rays = Buffer(device_, bytes, VK_BUFFER_USAGE_STORAGE_BUFFER_BIT, kHostMemory, 0);
      frame.hits = Buffer(device_, bytes, VK_BUFFER_USAGE_STORAGE_BUFFER_BIT, kHostMemory, 0);
      std::memcpy(frame.rays.mapped(), rays.data(), bytes);
    }
  }
  ~Engine() {
    device_.vk.vkDeviceWaitIdle(device_.handle);
    for (VkPipeline pipeline : pipelines_) device_.vk.vkDestroyPipeline(device_.handle, pipeline, nullptr);
  }

  // From `old` to `uses`; between the pieces of the upload `meanwhile` is called.
  template <typename Meanwhile>
  Loaded change(const Loaded& old, uint32_t uses, lsp_vulkan_change& change, Meanwhile meanwhile) {
    Loaded next;
    lsp_error error;
    EXPECT_EQ(lsp_vulkan_change_plan(&scene_, &old.plan, uses, &device_.limits, &next.plan, &change, &error),
              LSP_OK)
        << error.message;
    for (uint32_t i = 0; i < next.plan.buffer_count; ++i)
      next.buffers.push_back(
          i < change.kept ? old.buffers[change.from[i]]
                          : std::make_shared<Buffer>(device_, next.plan.buffers[i].bytes, next.plan.usage,
                                                     VK_MEMORY_PROPERTY_DEVICE_LOCAL_BIT, 0));
    lsp_vulkan_copy piece;
    for (uint64_t cursor = change.bytes_kept;
         lsp_vulkan_next_copy(&scene_, &next.plan, kPiece, &cursor, &piece) != 0;) {
      upload(piece, *next.buffers[piece.buffer]);
      meanwhile();
    }
    make_sets(next);
    return next;
  }

  // Submits a frame and does not wait for it, but for the one that had its place before.
  void submit(const Loaded& loaded, const lsp_trace_options& options) {
    const size_t number = submitted_++ % kFrames;
    Frame& frame = frames_[number];
    collect(number);
    lsp_vulkan_kind kind;
    lsp_error error;
    ASSERT_EQ(lsp_vulkan_plan_trace(&scene_, &loaded.plan, &options, &kind, &error), LSP_OK) << error.message;
    const VkPipeline pipeline = make_pipeline(loaded.plan, kind);
    const lsp_vulkan_trace_constants constants{0, 0, static_cast<uint32_t>(rays_.size()), kind.dial};
    const VkCommandBuffer commands = frame.commands.record();
    lsp_vulkan_record_trace(&device_.functions, commands, pipeline, shader_.layout(), loaded.sets[number],
                            &constants);
    auto barrier = vk_make<VkMemoryBarrier>(VK_STRUCTURE_TYPE_MEMORY_BARRIER);
    barrier.srcAccessMask = VK_ACCESS_SHADER_WRITE_BIT;
    barrier.dstAccessMask = VK_ACCESS_HOST_READ_BIT;
    device_.vk.vkCmdPipelineBarrier(commands, VK_PIPELINE_STAGE_COMPUTE_SHADER_BIT,
                                    VK_PIPELINE_STAGE_HOST_BIT, 0, 1, &barrier, 0, nullptr, 0, nullptr);
    frame.commands.submit();
    in_flight_[number] = true;
  }

  // The hits of all frames so far, in their order; waits for those in flight.
  std::vector<std::vector<LspHit>> finish() {
    for (size_t i = 0; i < kFrames; ++i) collect((submitted_ + i) % kFrames);
    return std::exchange(hits_, {});
  }

  std::vector<std::string> messages() const {
    const std::lock_guard lock(device_.messages_mutex);
    return device_.messages;
  }

 private:
  void collect(size_t number) {
    if (!std::exchange(in_flight_[number], false)) return;
    frames_[number].commands.wait();
    const auto* hits = static_cast<const LspHit*>(frames_[number].hits.mapped());
    hits_.emplace_back(hits, hits + rays_.size());
  }
  void upload(const lsp_vulkan_copy& piece, const Buffer& destination) {
    const VkCommandBuffer commands = copies_.record();
    std::memcpy(staging_.mapped(), piece.source, piece.bytes);
    lsp_vulkan_record_copy(&device_.functions, commands, &piece, staging_.handle(), 0, destination.handle());
    lsp_vulkan_record_upload_barrier(&device_.functions, commands);
    copies_.submit();
  }
  void make_sets(Loaded& loaded) {
    std::vector<VkBuffer> handles;
    for (const auto& buffer : loaded.buffers) handles.push_back(buffer->handle());
    for (size_t i = 0; i < kFrames; ++i) {
      loaded.sets[i] = shader_.allocate_set();
      lsp_vulkan_write_descriptors(&device_.functions, device_.handle, loaded.sets[i], &loaded.plan,
                                   handles.data(), frames_[i].rays.handle(), frames_[i].hits.handle(),
                                   VK_NULL_HANDLE);
    }
  }
  VkPipeline make_pipeline(lsp_vulkan_plan plan, const lsp_vulkan_kind& kind) {
    plan.base_structure = kind.base_structure;
    size_t bytes = 0;
    const uint32_t* words = lsp_vulkan_trace_spirv(&plan, 0, &bytes);
    return pipelines_.emplace_back(shader_.create_pipeline(words, bytes, kind));
  }

  Device device_;
  const lsp_scene& scene_;
  const std::vector<LspRay>& rays_;
  TraceShader shader_;
  Buffer staging_{device_, kPiece, VK_BUFFER_USAGE_TRANSFER_SRC_BIT, kHostMemory, 0};
  Commands copies_{device_};
  Frame frames_[kFrames] = {Frame(device_), Frame(device_), Frame(device_)};
  bool in_flight_[kFrames] = {};
  size_t submitted_ = 0;
  std::vector<std::vector<LspHit>> hits_;
  std::vector<VkPipeline> pipelines_;
};

// Tables first, exact data while frames are in flight, then ambient occlusion alone: every frame has the
// answers of the whole file at its dial, and what is dropped is given back while others are in flight.
TEST(Loading, FinerDataArrivesAndLeavesBetweenFrames) {
  std::string why;
  if (!VulkanTracer::available(&why)) GTEST_SKIP() << why;
  const lsp_scene& scene = *cells();
  const std::vector<LspRay> rays = cells().rays();
  const lsp_trace_options balanced = by_tables(LSP_QUALITY_BALANCED);
  VulkanOptions options;
  options.validation = true;
  std::optional<Engine> engine;
  try {
    engine.emplace(scene, rays, options);
  } catch (const Failure& failure) {
    std::printf("without validation: %s\n", failure.what());
    engine.emplace(scene, rays, VulkanOptions{});
  }
  lsp_vulkan_change change;
  Engine::Loaded now = engine->change({}, LSP_USE_TABLES, change, [] {});
  const uint64_t resident_first = now.plan.bytes;
  EXPECT_EQ(change.bytes_added, resident_first);

  size_t frames = 0;
  Engine::Loaded next = engine->change(now, kAll, change, [&] {
    engine->submit(now, balanced);
    ++frames;
  });
  EXPECT_GT(frames, Engine::kFrames);
  EXPECT_EQ(change.bytes_kept, resident_first);
  EXPECT_EQ(next.plan.bytes, resident_first + change.bytes_added);
  engine->submit(next, balanced);
  engine->submit(next, {0, 0});
  now = std::move(next);  // the buffers are all kept
  const auto truth = trace(scene, by_tables(LSP_QUALITY_FAST), rays);
  const std::vector<std::vector<LspHit>> hits = engine->finish();
  ASSERT_EQ(hits.size(), frames + 2);
  for (size_t i = 0; i < frames; ++i) EXPECT_EQ(differing(hits[i], truth, false), 0u) << "frame " << i;
  EXPECT_EQ(differing(hits[frames], trace(scene, balanced, rays), false), 0u);
  EXPECT_EQ(differing(hits[frames + 1], trace(scene, {0, 0}, rays), false), 0u);

  const lsp_trace_options occlusion = by_tables(LSP_QUALITY_BALANCED, LSP_TRACE_OCCLUSION);
  engine->submit(now, balanced);  // the last that reads what goes
  next = engine->change(now, kAmbientOcclusion, change, [] {});
  engine->submit(next, occlusion);
  EXPECT_EQ(change.bytes_added, 0u);
  EXPECT_EQ(change.bytes_dropped, now.plan.bytes - next.plan.bytes);
  EXPECT_EQ(engine->finish().size(), 2u);
  now = std::move(next);  // here the dropped buffers end
  engine->submit(now, occlusion);
  const auto last = engine->finish();
  EXPECT_EQ(differing(last.at(0), trace(scene, by_tables(LSP_QUALITY_FAST, LSP_TRACE_OCCLUSION), rays), true),
            0u);
  for (const std::string& message : engine->messages()) ADD_FAILURE() << message;
}

}  // namespace
}  // namespace lsp::test
