// lsp-bench as its users run it, on a scene small enough for a test.
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>

#include "process.h"
#include "report.h"
#include "shapes.h"

namespace lsp::bench {
namespace {

namespace fs = std::filesystem;

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
  EXPECT_TRUE(fs::exists(out / "room-ao-bvh-heat.jpg"));
  EXPECT_FALSE(fs::exists(directory_ / "room-polished.lsp"));
  EXPECT_EQ(run.output, "");
  EXPECT_TRUE(fs::exists(out / "report.html"));
}

}  // namespace
}  // namespace lsp::bench
