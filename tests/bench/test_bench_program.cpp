// lsp-bench as its users run it, on a scene small enough for a test.
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <map>

#include "process.h"
#include "report.h"
#include "shapes.h"

namespace lsp::bench {
namespace {

namespace fs = std::filesystem;

// The rows of a table by their mode.
std::map<std::string, Json> by_mode(const Json& table) {
  std::map<std::string, Json> rows;
  for (const Json& row : table) rows[row["mode"].get<std::string>()] = row;
  return rows;
}

class BenchProgram : public testing::Test {
 protected:
  void SetUp() override {
    directory_ = fs::temp_directory_path() / ("lsp_bench_" + std::to_string(getpid()));
    fs::create_directories(directory_);
  }
  void TearDown() override { fs::remove_all(directory_); }

  ProcessResult bench(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), program_path("lsp-bench").string());
    return run_process(arguments);
  }
  fs::path directory_;
};

TEST_F(BenchProgram, SaysWhatIsWrong) {
  EXPECT_EQ(bench({"--help"}).exit_code, 0);
  EXPECT_EQ(bench({"--version"}).exit_code, 0);
  EXPECT_EQ(bench({"x.ply"}).exit_code, 1);
  EXPECT_EQ(bench({"x.ply", "-o", directory_.string(), "--suite", "no"}).exit_code, 1);
  const ProcessResult missing = bench({(directory_ / "x.ply").string(), "-o", (directory_ / "out").string()});
  EXPECT_EQ(missing.exit_code, 2);
  EXPECT_NE(missing.errors.find("x.ply"), std::string::npos);
  EXPECT_FALSE(fs::exists(directory_ / "out" / "report.html"));
}

TEST_F(BenchProgram, WritesAReport) {
  const fs::path input = directory_ / "room.ply", out = directory_ / "out";
  write_ply(input, room_of_spheres(3000));
  const ProcessResult run = bench({input.string(), "-o", out.string(), "--quick", "--json", "--no-vulkan",
                                   "--suite", "pareto", "--suite", "peers", "--suite", "paper"});
  ASSERT_EQ(run.exit_code, 0) << run.errors;
  const Json json = Json::parse(run.output);
  const std::string answers = json["answers"].dump();
  EXPECT_NE(answers.find("at 1 % wrong answers"), std::string::npos);
  EXPECT_NE(answers.find("Against Embree"), std::string::npos);
  EXPECT_FALSE(json["sections"].contains("stress"));
  const Json& peers = json["sections"]["peers"]["tables"]["peers"];
  size_t robust = 0;
  for (const Json& row : peers) {
    EXPECT_GT(row["mrays"].get<double>(), 0);
    EXPECT_TRUE(row["tracer"] != "lsp exact" || row["wrong_percent"].get<double>() < 0.01);
    robust += row["tracer"] == "Embree rtcIntersect1 robust";
  }
  EXPECT_GT(robust, 0u);
  for (const Json& row : json["sections"]["paper"]["tables"]["paper"]) {
    EXPECT_TRUE(row["mode"] != "exact" || row["wrong_percent"].get<double>() < 0.01);
    EXPECT_GT(row["nodes"].get<double>() + row["shafts"].get<double>(), 1);
  }
  for (const char* name : {"report.html", "report.json", "pareto.csv", "peers.csv", "pareto_frontier.svg"}) {
    EXPECT_TRUE(fs::exists(out / name)) << name;
  }
}

TEST_F(BenchProgram, OneSceneThatFailsDoesNotEndTheRun) {
  const fs::path good = directory_ / "room.ply", bad = directory_ / "bad.ply", out = directory_ / "out";
  fs::create_directories(directory_ / "other");
  const fs::path twin = directory_ / "other" / "room.ply";  // of the same name
  write_ply(good, room_of_spheres(1000));
  write_ply(twin, room_of_spheres(2000));
  std::ofstream(bad) << "ply\nformat ascii 1.0\nelement vertex 99\nend_header\n";
  const std::vector<std::string> command = {good.string(), bad.string(), twin.string(), "-o",
                                            out.string(),  "--quick",    "--no-vulkan", "--suite",
                                            "pareto",      "--json"};
  const ProcessResult run = bench(command);
  EXPECT_EQ(run.exit_code, 3) << run.errors;
  EXPECT_NE(run.errors.find("bad.ply"), std::string::npos);
  const Json json = Json::parse(run.output);
  EXPECT_NE(json["warnings"].dump().find("bad.ply: left out"), std::string::npos);
  const std::string rows = json["sections"]["pareto"]["tables"]["pareto"].dump();
  EXPECT_NE(rows.find("\"room\""), std::string::npos);
  EXPECT_NE(rows.find("\"room-2\""), std::string::npos);
  EXPECT_TRUE(fs::exists(out / "report.html"));
  EXPECT_EQ(json["warnings"].dump().find("earlier run"), std::string::npos);
  EXPECT_GT(json["sections"]["cost"]["tables"]["costs"].size(), 1u);
  // Once more: the bakes are there, and the report says so. Another input of that name is baked anew.
  EXPECT_NE(bench(command).output.find("Of 2 bakes 2 are from an earlier run"), std::string::npos);
  write_ply(good, room_of_spheres(1500));
  EXPECT_NE(bench(command).output.find("Of 2 bakes 1 are from an earlier run"), std::string::npos);
}

TEST_F(BenchProgram, MeasuresAFileAsItIs) {
  const fs::path input = directory_ / "room.ply", baked = directory_ / "room.lsp", out = directory_ / "out";
  write_ply(input, room_of_spheres(1000));
  ASSERT_EQ(run_process({program_path("lsp-bake").string(), input.string(), "-o", baked.string(), "--quiet",
                         "--resolution", "3", "--depth", "5"})
                .exit_code,
            0);
  const ProcessResult run = bench({baked.string(), "-o", out.string(), "--quick", "--quiet", "--no-vulkan",
                                   "--suite", "peers", "--suite", "pictures"});
  EXPECT_EQ(run.exit_code, 0) << run.errors;
  EXPECT_TRUE(fs::exists(out / "room-wide-ao-short-line-spaces-difference.jpg"));
  EXPECT_EQ(run.output, "");
  EXPECT_TRUE(fs::exists(out / "report.html"));
}

TEST_F(BenchProgram, PicturesAreOfCells) {
  const fs::path input = directory_ / "room.ply", out = directory_ / "out";
  write_ply(input, room_of_spheres(3000));
  const ProcessResult run =
      bench({input.string(), "-o", out.string(), "--quick", "--json", "--no-vulkan", "--suite", "pictures"});
  ASSERT_EQ(run.exit_code, 0) << run.errors;
  const Json tables = Json::parse(run.output)["sections"]["pictures"]["tables"];
  const auto same = by_mode(tables["pictures"]);
  ASSERT_EQ(same.size(), 5u) << "four points of the dial and Line Spaces";
  for (const auto& [mode, row] : same) {
    EXPECT_EQ(row["scene"], "room");
    EXPECT_EQ(row["light"], "ao-short");
    for (const char* key : {"seconds", "exact_seconds", "times"}) EXPECT_GT(row[key].get<double>(), 0) << key;
    for (const char* key : {"p99_percent", "blurred_p99_percent", "bias_percent", "ssim"})
      EXPECT_TRUE(row.contains(key));
    EXPECT_LE(row["blurred_percent"].get<double>(), row["mean_percent"].get<double>() * 1.001) << mode;
    EXPECT_LE(row["structure"].get<double>(), 1.001) << mode;
    EXPECT_GE(row["flip"].get<double>(), 0) << mode;
  }
  const auto error = [&](const char* mode) { return same.at(mode)["mean_percent"].get<double>(); };
  EXPECT_GT(error("fast"), 0);
  EXPECT_LE(error("balanced"), error("fast"));
  EXPECT_LE(error("accurate"), error("balanced"));
  EXPECT_LE(error("max-loss 0"), error("accurate"));

  const auto equal = by_mode(tables["pictures_equal_time"]);
  ASSERT_EQ(equal.size(), 3u);
  for (const auto& [mode, row] : equal) {
    EXPECT_GE(row["exact_samples"].get<int>(), 1) << mode;
    EXPECT_GT(row["exact_mean_percent"].get<double>(), 0) << mode;
    // Fewer samples are noise: less of it is left by a blur than of the error of tables.
    EXPECT_LT(row["exact_structure"].get<double>(), 0.6) << mode;
  }
  for (const char* name : {"exact", "fast", "balanced", "accurate"}) {
    const std::string id = std::string("room-wide-ao-short-") + name;
    EXPECT_TRUE(fs::exists(out / (id + ".jpg"))) << id;
    EXPECT_TRUE(fs::exists(out / (id + "-difference.jpg"))) << id;
    EXPECT_TRUE(fs::exists(out / (id + "-detail.png"))) << id;
  }
}

}  // namespace
}  // namespace lsp::bench
