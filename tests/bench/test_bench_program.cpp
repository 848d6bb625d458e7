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

// The rows of a table where row[key] is `value`.
Json rows_where(const Json& table, const char* key, const std::string& value) {
  Json rows = Json::array();
  for (const Json& row : table) {
    if (row[key] == value) rows.push_back(row);
  }
  return rows;
}

// The dial's points for a set of rays, and that they are ordered as a dial is.
void expect_a_dial(const Json& table, const std::string& rays) {
  const auto points = by_mode(rows_where(table, "rays", rays));
  ASSERT_EQ(points.size(), 12u) << rays;
  const auto figure = [&](const std::string& mode, const char* key) {
    return points.at(mode)[key].get<double>();
  };
  for (const auto& [mode, row] : points) {
    for (const char* key : {"times", "times_embree", "mrays", "file_mb"}) {
      EXPECT_GT(row[key].get<double>(), 0) << mode << " " << key;
    }
  }
  EXPECT_LT(figure("exact", "wrong_percent"), 0.01);
  EXPECT_EQ(figure("exact", "lookups"), 0);
  EXPECT_EQ(figure("max-loss 100", "exact_calls"), 0) << "tables alone";
  const char* const dial[] = {"max-loss 100", "max-loss 50", "max-loss 20", "max-loss 10",
                              "max-loss 5",   "max-loss 2",  "max-loss 1",  "max-loss 0"};
  for (size_t k = 1; k < std::size(dial); ++k) {
    EXPECT_GE(figure(dial[k], "exact_calls"), figure(dial[k - 1], "exact_calls")) << dial[k];
    EXPECT_LE(figure(dial[k], "wrong_percent"), figure(dial[k - 1], "wrong_percent") + 0.1) << dial[k];
  }
  EXPECT_GT(figure("max-loss 100", "wrong_percent"), figure("max-loss 0", "wrong_percent"));
  EXPECT_LT(figure("max-loss 0", "wrong_percent"), 0.1);
  EXPECT_LE(figure("accurate", "wrong_percent"), figure("fast", "wrong_percent"));
  EXPECT_GE(figure("accurate", "exact_calls"), figure("fast", "exact_calls"));
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

// A suite takes one word: the next may be a scene. And what cannot be written is known before the work.
TEST_F(BenchProgram, IsRefusedBeforeItMeasures) {
  const std::string input = (directory_ / "room.ply").string();
  write_ply(input, room_of_spheres(20));
  const fs::path out = directory_ / "out";
  fs::create_directories(out / "report.html");
  const ProcessResult run =
      bench({"--suite", "peers", input, "-o", out.string(), "--quick", "--no-vulkan", "--large"});
  EXPECT_EQ(run.exit_code, 2) << run.errors;
  EXPECT_NE(run.errors.find("report.html: is a folder"), std::string::npos) << run.errors;
  EXPECT_NE(run.errors.find("--large does nothing"), std::string::npos) << run.errors;
  EXPECT_FALSE(fs::exists(out / "peers.csv"));
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
  const Json& dial = json["sections"]["pareto"]["tables"]["pareto_dial"];
  expect_a_dial(dial, "diffuse, shuffled");
  expect_a_dial(dial, "surface");
  expect_a_dial(dial, "ambient occlusion, shuffled");
  const Json& fields = json["sections"]["peers"]["tables"]["peers_field"];
  ASSERT_EQ(fields.size(), 4u) << "two sets of rays, a field and cells: " << run.output;
  for (const Json& row : fields) {
    for (const char* key : {"megabytes", "bake_seconds", "mrays", "steps", "depth_mean_percent"})
      EXPECT_GT(row[key].get<double>(), 0) << row.dump();
    EXPECT_LT(row["wrong_percent"].get<double>(), 10) << row.dump();
    const bool is_field = row["peer"].get<std::string>().find("distance field") == 0;
    EXPECT_EQ(row.contains("threshold"), is_field);
  }
  for (const char* name : {"report.html", "report.json", "pareto.csv", "peers.csv", "pareto_frontier.svg",
                           "pareto_dial.csv", "pareto_dial_surface.svg", "peers_field.csv"}) {
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
  EXPECT_NE(bench(command).output.find("Of 4 bakes 4 are from an earlier run"), std::string::npos);
  write_ply(good, room_of_spheres(1500));
  EXPECT_NE(bench(command).output.find("Of 4 bakes 2 are from an earlier run"), std::string::npos);
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

TEST_F(BenchProgram, MeasuresTheDialOfAFileOfCells) {
  const fs::path input = directory_ / "room.ply", baked = directory_ / "room.lsp", out = directory_ / "out";
  write_ply(input, room_of_spheres(2000));
  ASSERT_EQ(run_process({program_path("lsp-bake").string(), input.string(), "-o", baked.string(), "--quiet",
                         "--preset", "fast", "--cells", "6"})
                .exit_code,
            0);
  const ProcessResult run = bench({baked.string(), "-o", out.string(), "--quick", "--json", "--no-vulkan",
                                   "--suite", "pareto", "--suite", "peers", "--suite", "pictures"});
  ASSERT_EQ(run.exit_code, 0) << run.errors;
  const Json json = Json::parse(run.output);
  expect_a_dial(json["sections"]["pareto"]["tables"]["pareto_dial"], "diffuse, shuffled");
  EXPECT_EQ(json["sections"]["pareto"]["tables"]["pareto"].size(), 0u) << "there are no Line Spaces";
  EXPECT_EQ(by_mode(json["sections"]["pictures"]["tables"]["pictures"]).size(), 4u);
  const Json fields = json["sections"]["peers"]["tables"]["peers_field"];
  EXPECT_EQ(fields.size(), 2u) << "of each set of rays the field alone";
  EXPECT_NE(json["answers"].dump().find("point of the dial of cells"), std::string::npos);
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

// What is baked by mesh answers as what is baked as one.
TEST_F(BenchProgram, InstancesAnswerAsOneBake) {
  const fs::path input = directory_ / "spheres.glb", out = directory_ / "out";
  ASSERT_EQ(run_process({program_path("lsp-sample-scene").string(), input.string(), "--quiet", "--scene",
                         "spheres", "--triangles", "8000"})
                .exit_code,
            0);
  const ProcessResult run =
      bench({input.string(), "-o", out.string(), "--quick", "--json", "--no-vulkan", "--suite", "instances"});
  ASSERT_EQ(run.exit_code, 0) << run.errors;
  const Json tables = Json::parse(run.output)["sections"]["instances"]["tables"];
  ASSERT_EQ(tables["instances_sizes"].size(), 1u);
  const Json& sizes = tables["instances_sizes"][0];
  EXPECT_GT(sizes["assets"].get<int>(), 1);
  EXPECT_GE(sizes["instances"].get<int>(), sizes["assets"].get<int>());
  for (const char* key : {"instanced_mb", "merged_mb", "embree_instanced_mb", "embree_merged_mb"})
    EXPECT_GT(sizes[key].get<double>(), 0) << key;
  const Json& rates = tables["instances"];
  ASSERT_EQ(rates.size(), 24u) << "four sets of rays, six tracers";
  for (const Json& row : rates) {
    const std::string tracer = row["tracer"].get<std::string>();
    EXPECT_GT(row["mrays"].get<double>(), 0) << row.dump();
    EXPECT_GT(row["times"].get<double>(), 0) << row.dump();
    const bool by_tables = tracer.find("balanced") != std::string::npos;
    EXPECT_LT(row["wrong_percent"].get<double>(), by_tables ? 5 : 0.02) << row.dump();
  }
  for (const char* tracer : {"merged, exact", "instances, exact", "merged, balanced", "instances, balanced",
                             "Embree, merged", "Embree, instances"})
    EXPECT_EQ(rows_where(rates, "tracer", tracer).size(), 4u) << tracer;
  EXPECT_TRUE(fs::exists(out / "instances.csv"));
}

}  // namespace
}  // namespace lsp::bench
