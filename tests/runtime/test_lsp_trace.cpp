// lsp-trace as its users run it: options, files, figures and exit codes.
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <cstring>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "lsp/instances.hpp"
#include "scene_builder.h"
#include "shell.h"

namespace lsp::test {
namespace {

namespace fs = std::filesystem;

class LspTrace : public testing::Test {
 protected:
  void SetUp() override {
    const Parts parts = build_parts({});
    raw_ = write_raw(parts);
    write("raw.lsp", raw_.data(), raw_.size());
    const Bytes packed = write_packed(parts);
    write("packed.lsp", packed.data(), packed.size());
    Random random(4);
    for (int i = 0; i < 10000; ++i) {
      rays_.push_back({{random.between(-2, 2), random.between(-2, 2), random.between(-2, 2)},
                       0,
                       {random.between(-1, 1), random.between(-1, 1), random.between(-1, 1)},
                       1e30f});
    }
    rays_[17].direction = {0, 0, 0};
    rays_[99].tmin = 2e30f;
    write("rays.bin", rays_.data(), rays_.size() * sizeof(LspRay));
  }
  void write(const char* name, const void* data, size_t bytes) {
    std::ofstream(folder_ / name, std::ios::binary)
        .write(static_cast<const char*>(data), static_cast<std::streamsize>(bytes));
  }

  // Runs "lsp-trace ARGUMENTS" in the folder; output and errors are left in out.txt and err.txt.
  int run(const std::string& arguments) {
    return shell("lsp-trace " + arguments + " > out.txt 2> err.txt", folder_);
  }
  std::string out() { return read_bytes(folder_ / "out.txt"); }
  std::string err() { return read_bytes(folder_ / "err.txt"); }

  std::vector<LspHit> expected(uint32_t flags, lsp_trace_counts* counts) {
    lsp_scene scene;
    lsp_open(raw_.data(), raw_.size(), &scene, nullptr);
    std::vector<LspHit> hits(rays_.size());
    const lsp_trace_options options{flags, 0};
    lsp_trace(&scene, &options, rays_.data(), hits.data(), hits.size(), counts, nullptr);
    return hits;
  }
  void expect_hits(const std::vector<LspHit>& hits) {
    const std::string got = read_bytes(folder_ / "hits.bin");
    ASSERT_EQ(got.size(), hits.size() * sizeof(LspHit));
    EXPECT_EQ(memcmp(got.data(), hits.data(), got.size()), 0);
  }

  const TemporaryFolder temporary_;
  const fs::path folder_ = temporary_.path();
  Bytes raw_;
  std::vector<LspRay> rays_;
};

constexpr const char* kFiles = " --rays rays.bin --hits hits.bin ";

TEST_F(LspTrace, WritesTheLibrarysHits) {
  const struct {
    const char* options;
    uint32_t flags;
  } cases[] = {
      {"", LSP_TRACE_APPROXIMATE},
      {"--mode exact", 0},
      {"--mode exact --query any", LSP_TRACE_ANY_HIT},
      {"--mode exact --query occlusion", LSP_TRACE_OCCLUSION},
      {"--mode approximate --near approximate", LSP_TRACE_APPROXIMATE | LSP_TRACE_NEAR_APPROXIMATE},
      {"--mode approximate --near skip", LSP_TRACE_APPROXIMATE | LSP_TRACE_NEAR_SKIP},
      {"--mode exact --threads 3", 0},
  };
  for (const auto& c : cases) {
    for (const char* file : {"raw.lsp", "packed.lsp"}) {
      SCOPED_TRACE(std::string(file) + " " + c.options);
      ASSERT_EQ(run(file + std::string(kFiles) + c.options), 0) << err();
      EXPECT_EQ(err(), "");
      expect_hits(expected(c.flags, nullptr));
    }
  }
}

TEST_F(LspTrace, ReportsWhatItDid) {
  ASSERT_EQ(run(std::string("raw.lsp") + kFiles + "--json --repeat 3 --mode exact"), 0) << err();
  lsp_trace_counts counts{};
  expected(0, &counts);
  const nlohmann::json json = nlohmann::json::parse(out());
  EXPECT_EQ(json["rays"], 10000);
  EXPECT_EQ(json["invalid"], 2);
  EXPECT_EQ(json["hits"], counts.hits);
  EXPECT_EQ(json["seconds"].size(), 3u);
  EXPECT_GT(json["mrays_per_second"], 0.0);
  EXPECT_EQ(json["mode"], "exact");
  EXPECT_EQ(json["load_path"], "mapped");
  EXPECT_EQ(json["bytes_mapped"], raw_.size());
  EXPECT_GT(json["bytes_paged_in"], 0);
  EXPECT_LE(json["bytes_paged_in"], raw_.size());
  EXPECT_EQ(json["bytes_uploaded"], 0);
  EXPECT_DOUBLE_EQ(json["nodes_per_ray"], static_cast<double>(counts.nodes) / 10000);
  EXPECT_DOUBLE_EQ(json["triangles_per_ray"], static_cast<double>(counts.triangles) / 10000);
  EXPECT_FALSE(json["device"].get<std::string>().empty());
}

TEST_F(LspTrace, ExitCodes) {
  write("odd.bin", rays_.data(), 33);
  write("none.bin", rays_.data(), 0);
  write("cut.lsp", raw_.data(), 1000);
  const auto files = [](const char* rays, const char* hits) {
    return std::string(" --rays ") + rays + " --hits " + hits + " ";
  };
  EXPECT_EQ(run("--help"), 0);
  EXPECT_EQ(run("--version"), 0);
  EXPECT_NE(out().find("0.1.0"), std::string::npos);
  EXPECT_EQ(run(""), 1);
  EXPECT_EQ(run("raw.lsp"), 1);
  EXPECT_EQ(run("raw.lsp --mode sideways" + files("rays.bin", "h")), 1);
  for (const std::string number : {"--max-loss nan", "--lod nan", "--max-loss -1", "--threads -1"})
    EXPECT_EQ(run("raw.lsp " + number + files("rays.bin", "h")), 1) << number;
  EXPECT_EQ(run("raw.lsp" + files("rays.bin", "rays.bin")), 1) << "the rays would be lost";
  EXPECT_EQ(run("raw.lsp" + files("rays.bin", "./raw.lsp")), 1) << "the scene would be lost";
  EXPECT_EQ(read_bytes(folder_ / "raw.lsp").size(), raw_.size());
  EXPECT_EQ(run("missing.lsp" + files("rays.bin", "h")), 2);
  EXPECT_EQ(err().rfind("lsp-trace: missing.lsp: ", 0), 0u) << err();
  EXPECT_EQ(run("raw.lsp" + files("missing.bin", "h")), 2);
  EXPECT_EQ(run("raw.lsp" + files("rays.bin", "no/such/folder/h")), 2);
  ASSERT_EQ(mkfifo((folder_ / "pipe").c_str(), 0600), 0);  // nobody writes to it
  EXPECT_EQ(run("raw.lsp" + files("pipe", "h")), 2);
  EXPECT_EQ(run("pipe" + files("rays.bin", "h")), 2);
  EXPECT_EQ(run("raw.lsp" + files("odd.bin", "h")), 3);
  EXPECT_EQ(run("cut.lsp" + files("rays.bin", "h")), 3);
  EXPECT_FALSE(fs::exists(folder_ / "h"));
  EXPECT_EQ(run("raw.lsp" + files("none.bin", "h")), 0) << err();
  EXPECT_EQ(fs::file_size(folder_ / "h"), 0u);
  EXPECT_EQ(run("raw.lsp --quiet" + files("rays.bin", "h")), 0);
  EXPECT_EQ(out() + err(), "");
}

TEST_F(LspTrace, FilesWithoutWhatIsAskedFor) {
  BuildOptions options;
  options.line_spaces = false;
  const Bytes exact = write_raw(build_parts(options));
  write("exact.lsp", exact.data(), exact.size());
  EXPECT_EQ(run(std::string("exact.lsp") + kFiles), 0) << err();  // exact by itself
  EXPECT_EQ(err(), "");
  EXPECT_EQ(run(std::string("exact.lsp --mode approximate") + kFiles), 0) << err();
  EXPECT_NE(err().find("exact.lsp: neither Line Spaces nor cells in the file: approximate rays are exact"),
            std::string::npos)
      << err();
  options.line_spaces = true;
  options.exact = false;
  const Bytes approximate = write_raw(build_parts(options));
  write("approximate.lsp", approximate.data(), approximate.size());
  EXPECT_EQ(run(std::string("approximate.lsp") + kFiles), 0) << err();
  EXPECT_EQ(run(std::string("approximate.lsp --mode exact") + kFiles), 5);
}

// A failed run leaves an older result as it was, and nothing beside it.
TEST_F(LspTrace, FailureLeavesOldHits) {
  write("hits.bin", "old", 3);
  EXPECT_EQ(run(std::string("missing.lsp") + kFiles), 2);
  EXPECT_EQ(read_bytes(folder_ / "hits.bin"), "old");
  for (const auto& entry : fs::directory_iterator(folder_)) {
    EXPECT_EQ(entry.path().string().find(".tmp"), std::string::npos) << entry.path();
  }
}

TEST_F(LspTrace, InstancesOfSeveralFiles) {
  const std::string scene =
      R"({"lsp_scene": 1, "name": "three", "assets": ["raw.lsp", "packed.lsp"], "instances": [
          {"asset": 0, "transform": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0]},
          {"asset": 1, "transform": [0, -1, 0, 3, 2, 0, 0, 0, 0, 0, 1, 0], "mask": 4, "user": 7, "name": "turned"},
          {"asset": 0, "transform": [-1, 0, 0, 0, 0, 1, 0, 3, 0, 0, 1, 0], "mask": 0}]})";
  write("scene.json", scene.data(), scene.size());
  lsp_scene asset;
  ASSERT_EQ(lsp_open(raw_.data(), raw_.size(), &asset, nullptr), LSP_OK);
  const lsp_instance places[] = {{0, {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0}, 255, 0},
                                 {1, {0, -1, 0, 3, 2, 0, 0, 0, 0, 0, 1, 0}, 4, 7},
                                 {0, {-1, 0, 0, 0, 0, 1, 0, 3, 0, 0, 1, 0}, 0, 0}};
  const Instances instances({&asset, &asset}, places);
  std::vector<LspHit> hits(rays_.size());
  for (const uint32_t flags : {0u, LSP_TRACE_APPROXIMATE}) {
    lsp_trace_counts counts{};
    instances.trace({flags, 0}, 255, rays_, hits, &counts);
    ASSERT_EQ(run(std::string("scene.json --json") + kFiles + (flags == 0 ? "--mode exact" : "")), 0)
        << err();
    expect_hits(hits);
    const nlohmann::json json = nlohmann::json::parse(out());
    EXPECT_EQ(json["instances"], 3);
    EXPECT_EQ(json["assets"], 2);
    EXPECT_EQ(json["mode"], flags == 0 ? "exact" : "approximate");
    EXPECT_EQ(json["hits"], counts.hits);
    EXPECT_EQ(json["invalid"], 2);
    EXPECT_EQ(json["bytes_mapped"], raw_.size());
  }
  bool seen[3] = {};
  for (const LspHit& hit : hits)
    if (hit.primitive != LSP_NONE) seen[hit.flags >> 8] = true;
  EXPECT_TRUE(seen[0] && seen[1] && !seen[2]);
  const std::string empty = R"({"lsp_scene": 1, "assets": [], "instances": []})";
  write("empty.json", empty.data(), empty.size());
  EXPECT_EQ(run(std::string("empty.json") + kFiles), 0) << err();
  EXPECT_EQ(run("scene.json --rays rays.bin --hits ./packed.lsp"), 1) << "an asset would be lost";
  EXPECT_EQ(read_bytes(folder_ / "packed.lsp").substr(1, 3), "LSP");
}

TEST_F(LspTrace, VulkanTracesInstances) {
  setenv("LSAN_OPTIONS", "detect_leaks=0", 1);  // drivers leave memory behind
  for (const char* name : {"wide.lsp", "wide-packed.lsp", "wide-alone.lsp"})
    fs::copy_file(fs::path(LSP_CORPUS_DIR) / name, folder_ / name);
  const std::string scene =
      R"({"lsp_scene": 1, "assets": ["wide.lsp", "wide-packed.lsp", "wide-alone.lsp"], "instances": [
      {"asset": 0, "transform": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0]},
      {"asset": 1, "transform": [0, -1, 0, 3, 2, 0, 0, 0, 0, 0, 1, 0]},
      {"asset": 2, "transform": [1, 0.5, 0, 0, 0, 1, 0, -3, 0, 0, 2, 0]},
      {"asset": 0, "transform": [-1, 0, 0, 0, 0, 1, 0, 3, 0, 0, 1, 0]},
      {"asset": 0, "transform": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0], "mask": 0}]})";
  write("scene.json", scene.data(), scene.size());
  for (const std::string how : {" --mode exact", " --mode approximate --load upload"}) {
    SCOPED_TRACE(how);
    ASSERT_EQ(run(std::string("scene.json --json") + kFiles + how), 0) << err();
    const nlohmann::json cpu = nlohmann::json::parse(out());
    const std::string hits = read_bytes(folder_ / "hits.bin");
    fs::remove(folder_ / "hits.bin");
    const int code = run(std::string("scene.json --json --repeat 2 --backend vulkan") + kFiles + how);
    if (code == 5) GTEST_SKIP() << err();
    ASSERT_EQ(code, 0) << err();
    EXPECT_EQ(read_bytes(folder_ / "hits.bin"), hits);
    const nlohmann::json json = nlohmann::json::parse(out());
    for (const char* same : {"instances", "assets", "mode", "rays", "invalid", "hits", "nodes_per_ray",
                             "shafts_per_ray", "triangles_per_ray", "bytes_mapped"})
      EXPECT_EQ(json[same], cpu[same]) << same;
    EXPECT_EQ(json["seconds"].size(), 2u);
    EXPECT_EQ(json["gpu_seconds"].size(), 2u);
    EXPECT_NE(json["device"], cpu["device"]);
    if (how.find("upload") == std::string::npos) continue;
    EXPECT_EQ(json["load_path"], "upload");
    EXPECT_EQ(json["bytes_imported"], 0);
    EXPECT_GT(json["bytes_uploaded"], sizeof(LspHeader));
  }
  // What no shader of instances walks, and what cannot be imported is named.
  const auto refused = [&](const std::string& assets, const std::string& options) {
    const std::string two = R"({"lsp_scene": 1, "assets": [)" + assets + R"(], "instances": [
        {"asset": 0, "transform": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0]}]})";
    write("two.json", two.data(), two.size());
    EXPECT_EQ(run("two.json --backend vulkan" + options + kFiles), 5);
    return err();
  };
  EXPECT_EQ(refused(R"("wide.lsp")", " --load import").rfind("lsp-trace: two.json: asset 0: ", 0), 0u)
      << err();
  EXPECT_NE(refused(R"("wide.lsp", "raw.lsp")", "").find("two.json: asset 1: no shader"), std::string::npos)
      << err();
  const std::string none = R"({"lsp_scene": 1, "assets": [], "instances": []})";
  write("none.json", none.data(), none.size());
  EXPECT_EQ(run(std::string("none.json --backend vulkan") + kFiles), 0) << err();
}

TEST_F(LspTrace, FaultsOfASceneAreNamedByPlace) {
  const std::string good = R"({"asset": 0, "transform": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0]})";
  const auto scene = [&](const std::string& instance, const std::string& asset = "\"raw.lsp\"") {
    return R"({"lsp_scene": 1, "assets": [)" + asset + R"(], "instances": [)" + good + ", " + instance + "]}";
  };
  const struct {
    std::string text;
    int exit;
    std::string place;
  } cases[] = {
      {"{\"lsp_scene\": 1,", 3, "is not JSON, byte "},
      {"[]", 3, "is no JSON object"},
      {"{}", 3, "/lsp_scene: is missing"},
      {R"({"lsp_scene": "1"})", 3, "/lsp_scene: "},
      {R"({"lsp_scene": 2})", 5, "/lsp_scene: is 2"},
      {R"({"lsp_scene": 1, "assets": {}})", 3, "/assets: "},
      {R"({"lsp_scene": 1, "assets": []})", 3, "/instances: is missing"},
      {R"({"lsp_scene": 1, "asets": []})", 3, "/asets: is not known"},
      {R"({"lsp_scene": 1, "origin": [1, 2], "assets": [], "instances": []})", 3, "/origin: "},
      {scene(good, "5"), 3, "/assets/0: "},
      {scene(good, "\"gone.lsp\""), 2, "/assets/0: gone.lsp: "},
      {scene(good, "\"rays.bin\""), 3, "/assets/0: rays.bin: "},
      {scene("7"), 3, "/instances/1: "},
      {scene(R"({"transform": []})"), 3, "/instances/1/asset: is missing"},
      {scene(R"({"asset": 1, "transform": []})"), 3, "/instances/1/asset: is 1"},
      {scene(R"({"asset": -1, "transform": []})"), 3, "/instances/1/asset: "},
      {scene(R"({"asset": 0})"), 3, "/instances/1/transform: is missing"},
      {scene(R"({"asset": 0, "transform": [1, 2, 3]})"), 3, "/instances/1/transform: "},
      {scene(R"({"asset": 0, "transform": [1, 0, 0, 0, 0, "1", 0, 0, 0, 0, 1, 0]})"), 3,
       "/instances/1/transform/5: "},
      {scene(R"({"asset": 0, "transform": [1, 0, 0, 1e39, 0, 1, 0, 0, 0, 0, 1, 0]})"), 3,
       "/instances/1/transform/3: "},
      {scene(R"({"asset": 0, "transform": [1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1, 0]})"), 3,
       "/instances/1/transform: has no inverse"},
      {scene(R"({"asset": 0, "transform": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0], "mask": 256})"), 3,
       "/instances/1/mask: "},
      {scene(R"({"asset": 0, "transform": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0], "user": 1.5})"), 3,
       "/instances/1/user: "},
      {scene(R"({"asset": 0, "transform": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0], "maks": 1})"), 3,
       "/instances/1/maks: is not known"},
  };
  for (const auto& c : cases) {
    SCOPED_TRACE(c.text);
    write("bad.json", c.text.data(), c.text.size());
    EXPECT_EQ(run(std::string("bad.json") + kFiles), c.exit);
    EXPECT_EQ(err().rfind("lsp-trace: bad.json: " + c.place, 0), 0u) << err();
  }
  EXPECT_EQ(run(std::string("none.json") + kFiles), 2);
  EXPECT_FALSE(fs::exists(folder_ / "hits.bin"));
}

TEST_F(LspTrace, VulkanGivesTheSameFile) {
  setenv("LSAN_OPTIONS", "detect_leaks=0", 1);  // drivers leave memory behind
  for (const char* load : {"import", "upload"}) {
    const int code = run(std::string("raw.lsp --backend vulkan --json --load ") + load + kFiles);
    if (code == 5) GTEST_SKIP() << err();
    ASSERT_EQ(code, 0) << err();
    expect_hits(expected(LSP_TRACE_APPROXIMATE, nullptr));
    const nlohmann::json json = nlohmann::json::parse(out());
    EXPECT_EQ(json["load_path"], load);
    EXPECT_EQ(json["bytes_imported"] == 0, std::string(load) == "upload");
    EXPECT_EQ(json["bytes_uploaded"] == 0, std::string(load) == "import");
    EXPECT_EQ(json["retraced"], 0);
    lsp_trace_counts counts{};
    expected(LSP_TRACE_APPROXIMATE, &counts);
    EXPECT_EQ(json["hits"], counts.hits);
    EXPECT_DOUBLE_EQ(json["shafts_per_ray"], static_cast<double>(counts.shafts) / 10000);
  }
}

}  // namespace
}  // namespace lsp::test
