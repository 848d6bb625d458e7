// The runtime from many threads at once: one scene that all of them trace, and the same file opened and
// closed meanwhile. Run under the thread sanitizer, too.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <filesystem>
#include <limits>
#include <thread>
#include <vector>

#include "lsp/lsp_instances.h"

namespace {

constexpr size_t kThreads = 6;
constexpr size_t kRays = 300;

// Through the scene's box from a spiral of points about it, and from within.
std::vector<LspRay> rays_about(const LspHeader& h) {
  const float mid[3] = {0.5f * (h.bounds_min.x + h.bounds_max.x), 0.5f * (h.bounds_min.y + h.bounds_max.y),
                        0.5f * (h.bounds_min.z + h.bounds_max.z)};
  const float size = 0.1f + (h.bounds_max.x - h.bounds_min.x) + (h.bounds_max.y - h.bounds_min.y) +
                     (h.bounds_max.z - h.bounds_min.z);
  std::vector<LspRay> rays;
  for (size_t i = 0; i < kRays; ++i) {
    const auto k = float(i);
    const float up = 2 * (k + 0.5f) / float(kRays) - 1, out = std::sqrt(1 - up * up);
    const float d[3] = {out * std::cos(2.4f * k), up, out * std::sin(2.4f * k)};
    const float back = i % 3 == 0 ? 0.0f : size;
    rays.push_back({{mid[0] - back * d[0], mid[1] - back * d[1], mid[2] - back * d[2]},
                    0.0f,
                    {d[0] + 0.05f * std::sin(k), d[1], d[2] + 0.05f * std::cos(k)},
                    std::numeric_limits<float>::infinity()});
  }
  return rays;
}

// Unmapped when it goes.
struct File {
  lsp_mapping mapping{};
  lsp_scene scene{};
  lsp_status status = LSP_OK;
  explicit File(const std::string& path) {
    status = lsp_map_file(path.c_str(), &mapping, nullptr);
    if (status == LSP_OK) status = lsp_open(mapping.bytes, mapping.size, &scene, nullptr);
  }
  ~File() { lsp_unmap_file(&mapping); }
};

std::vector<LspHit> trace(const lsp_scene& scene, uint32_t flags, const std::vector<LspRay>& rays) {
  std::vector<LspHit> hits(rays.size());
  lsp_trace_options options{};
  options.flags = flags;
  if (lsp_trace(&scene, &options, rays.data(), hits.data(), rays.size(), nullptr, nullptr) != LSP_OK)
    hits.clear();
  return hits;
}

TEST(Threads, OneSceneIsTracedByAllAndOpenedMeanwhile) {
  size_t scenes = 0;
  for (const auto& entry : std::filesystem::directory_iterator(LSP_CORPUS_DIR)) {
    const std::string path = entry.path().string();
    const File shared(path);
    if (shared.status != LSP_OK) continue;  // a packed one
    SCOPED_TRACE(path);
    ++scenes;
    const std::vector<LspRay> rays = rays_about(*shared.scene.header);
    const uint32_t modes[] = {0, LSP_TRACE_APPROXIMATE, LSP_TRACE_ANY_HIT};
    std::vector<std::vector<LspHit>> alone;
    for (const uint32_t flags : modes) alone.push_back(trace(shared.scene, flags, rays));
    bool same[kThreads] = {};
    {
      std::vector<std::jthread> threads;
      for (size_t me = 0; me < kThreads; ++me) {
        threads.emplace_back([&, me] {
          const File own(path);  // opened and closed while others trace
          bool all = own.status == LSP_OK;
          for (size_t i = 0; i < std::size(modes) && all; ++i) {
            const auto hits = trace(me % 2 ? own.scene : shared.scene, modes[i], rays);
            all = hits.size() == alone[i].size() &&
                  std::memcmp(hits.data(), alone[i].data(), hits.size() * sizeof(LspHit)) == 0;
          }
          same[me] = all;
        });
      }
    }
    for (size_t me = 0; me < kThreads; ++me) EXPECT_TRUE(same[me]) << "thread " << me;
  }
  EXPECT_GT(scenes, 10u);
}

TEST(Threads, InstancesAreTracedByAllAndBuiltMeanwhile) {
  const File file(LSP_CORPUS_DIR "/full.lsp");
  ASSERT_EQ(file.status, LSP_OK);
  const lsp_scene* const assets[] = {&file.scene};
  std::vector<lsp_instance> places;
  for (uint32_t i = 0; i < 20; ++i)
    places.push_back({0, {1, 0, 0, 0.3f * float(i), 0, 1, 0, 0, 0, 0, -1, 0}, 255, i});
  const auto build = [&](std::vector<uint64_t>& memory) {
    memory.resize(2 * (lsp_instances_bytes(20) / 16 + 1));  // at a multiple of 16, as all that is allocated
    lsp_instances instances;
    EXPECT_EQ(lsp_instances_build(assets, 1, places.data(), 20, memory.data(),
                                  memory.size() * sizeof(uint64_t), &instances, nullptr),
              LSP_OK);
    return instances;
  };
  const std::vector<LspRay> rays = rays_about(*file.scene.header);
  const auto trace_all = [&](const lsp_instances& instances) {
    std::vector<LspHit> hits(rays.size());
    const lsp_trace_options options{};
    lsp_trace_instances(&instances, &options, 255, rays.data(), hits.data(), rays.size(), nullptr, nullptr);
    return hits;
  };
  std::vector<uint64_t> memory;
  const lsp_instances shared = build(memory);
  const std::vector<LspHit> alone = trace_all(shared);
  bool same[kThreads] = {};
  {
    std::vector<std::jthread> threads;
    for (size_t me = 0; me < kThreads; ++me) {
      threads.emplace_back([&, me] {
        std::vector<uint64_t> own;
        const auto hits = trace_all(me % 2 ? build(own) : shared);
        same[me] = std::memcmp(hits.data(), alone.data(), hits.size() * sizeof(LspHit)) == 0;
      });
    }
  }
  for (size_t me = 0; me < kThreads; ++me) EXPECT_TRUE(same[me]) << "thread " << me;
}

}  // namespace
