// lsp-bake --shard and lsp-merge as their users run them.
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>

#include "grid_mesh.h"
#include "shell.h"

namespace lsp::test {
namespace {

namespace fs = std::filesystem;

class LspMerge : public ::testing::Test {
 protected:
  // An object.
  void write_object(const char* name, int size) { std::ofstream(folder_ / name) << grid_obj(size); }
  // A room with a coloured box in it.
  void write_room(const char* name) {
    std::ofstream(folder_ / "room.mtl") << "newmtl wall\nKd .8 .8 .8\nnewmtl box\nKd .8 .1 .1\nKe .2 0 0\n";
    std::ofstream obj(folder_ / name);
    obj << "mtllib room.mtl\n";
    const auto add_box = [&](double lo, double hi, const char* material) {
      for (int i = 0; i < 8; ++i)
        obj << "v " << (i & 1 ? hi : lo) << " " << (i & 2 ? hi : lo) << " " << (i & 4 ? hi : lo) << "\n";
      obj << "usemtl " << material << "\n";
      for (const char* face :
           {"-8 -6 -5 -7", "-4 -3 -1 -2", "-8 -7 -3 -4", "-6 -2 -1 -5", "-8 -4 -2 -6", "-7 -5 -1 -3"})
        obj << "f " << face << "\n";
    };
    add_box(-4, 4, "wall");
    add_box(-1.3, 0.9, "box");
  }

  int shell(const std::string& command) const {
    return test::shell("{ " + command + "\n} >out 2>err", folder_);
  }
  std::string read(const std::string& name) const { return read_bytes(folder_ / name); }

  // Bakes in one, and in `count` shards, of which the last are given first.
  void expect_the_one_bake(const std::string& mesh_and_options, int count) {
    SCOPED_TRACE(mesh_and_options + ", " + std::to_string(count) + " shards");
    if (!fs::exists(folder_ / "one.lsp")) {
      ASSERT_EQ(shell("lsp-bake --quiet -o one.lsp " + mesh_and_options), 0) << read("err");
    }
    std::string parts;
    for (int i = 1; i <= count; ++i) {
      const std::string number = std::to_string(i), part = number + ".part";
      ASSERT_EQ(shell("lsp-bake --quiet -o " + part + " --shard " + number + "/" + std::to_string(count) +
                      (i == 2 ? " --threads 1 " : " ") + mesh_and_options),
                0)
          << read("err");
      parts = part + " " + parts;
    }
    ASSERT_EQ(shell("lsp-merge " + parts + " -o merged.lsp" + (count == 2 ? " --threads 1" : "")), 0)
        << read("err");
    EXPECT_TRUE(read("merged.lsp") == read("one.lsp"));
    ASSERT_GT(read("one.lsp").size(), 4096u);
  }

  const TemporaryFolder temporary_;
  const fs::path folder_ = temporary_.path();
};

TEST_F(LspMerge, AnObjectIsTheOneBakeInAnyNumberOfParts) {
  write_object("object.obj", 6);
  for (const int count : {1, 2, 5}) expect_the_one_bake("object.obj --cells 3 --preset fast", count);
}

TEST_F(LspMerge, ARoomIsTheOneBakeWhateverIsAskedFor) {
  write_room("room.obj");
  for (const char* options : {"--compress zstd", "--no-exact --for ao --align 256", "--max-error 0.05"}) {
    fs::remove(folder_ / "one.lsp");
    expect_the_one_bake(std::string("room.obj --cells 3 --preset fast ") + options, 2);
  }
}

TEST_F(LspMerge, ThereMayBeMorePartsThanCells) {
  std::ofstream(folder_ / "corner.obj") << "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\nf 1 3 4\n";
  expect_the_one_bake("corner.obj --cells 1 --preset fast", 3);
}

TEST_F(LspMerge, SaysWhatIsWrong) {
  write_object("object.obj", 4);
  write_object("other.obj", 5);
  const auto bake = [&](const std::string& mesh, const std::string& part, const std::string& shard,
                        const std::string& options = "") {
    return shell("lsp-bake --quiet " + mesh + " -o " + part + " --cells 2 --preset fast --shard " + shard +
                 options);
  };
  ASSERT_EQ(bake("object.obj", "1.part", "1/2"), 0) << read("err");
  ASSERT_EQ(bake("object.obj", "2.part", "2/2"), 0);
  ASSERT_EQ(bake("other.obj", "moved.part", "2/2"), 0);
  ASSERT_EQ(bake("object.obj", "packed.part", "2/2", " --compress zstd"), 0);
  std::ofstream(folder_ / "cut.part") << read("2.part").substr(0, 1000);
  const auto expect = [&](const std::string& arguments, int exit, const std::string& says) {
    EXPECT_EQ(shell("lsp-merge " + arguments), exit) << arguments;
    EXPECT_NE(read("err").find("lsp-merge: " + says), std::string::npos) << arguments << ": " << read("err");
  };
  expect("1.part", 1, "--output is required");
  expect("2.part -o a.lsp", 1, "2.part: is one of 2 parts, of which 1/2 is missing");
  expect("1.part 2.part 1.part -o a.lsp", 1, "1.part: is part 1/2, as is 1.part");
  expect("1.part 2.part -o no/a.lsp", 2, "no/a.lsp: cannot be written");
  expect("1.part none.part -o a.lsp", 2, "none.part: ");
  expect("1.part object.obj -o a.lsp", 3, "object.obj: is no part of a bake");
  expect("1.part cut.part -o a.lsp", 3, "cut.part: has 1000 bytes, but at byte 56 states ");
  expect("1.part moved.part -o a.lsp", 3, "moved.part: is not of the same bake as 1.part, inputs is ");
  expect("1.part packed.part -o a.lsp", 3, "packed.part: is not of the same bake as 1.part, their options");
  EXPECT_FALSE(fs::exists(folder_ / "a.lsp"));
  for (const char* reader : {"lsp-validate ", "lsp-info ", "lsp-trace --rays a --hits b "}) {
    EXPECT_EQ(shell(reader + std::string("1.part")), 3) << reader;
    EXPECT_NE((read("out") + read("err")).find("is a part of a bake; lsp-merge makes"), std::string::npos)
        << reader;
  }
  for (const char* refused : {"3/2", "0/2", "2", "1/2 --base bvh", "1/2 --depth 4", "1/2 --max-size 1MB"}) {
    EXPECT_EQ(shell(std::string("lsp-bake object.obj -o a.part --shard ") + refused), 1) << refused;
    EXPECT_NE(read("err").find("--shard"), std::string::npos) << read("err");
  }
  EXPECT_FALSE(fs::exists(folder_ / "a.part"));
  ASSERT_EQ(shell("lsp-merge 2.part 1.part -o a.lsp --json"), 0);
  const auto report = nlohmann::json::parse(read("out"));
  EXPECT_EQ(report["parts"], 2);
  EXPECT_EQ(report["file_bytes"], fs::file_size(folder_ / "a.lsp"));
  EXPECT_EQ(report["error"]["rays"], 65536);
  ASSERT_EQ(shell("lsp-merge --help"), 0);
  std::istringstream lines(read("out"));
  for (std::string line; std::getline(lines, line);) EXPECT_LE(line.size(), 80u) << line;
  EXPECT_EQ(read("out").find("More options"), std::string::npos) << "an option has no group";
}

// The commands of README's section, with a stand-in for Slurm that runs each task of an array in turn.
TEST_F(LspMerge, TheCommandsOfTheReadmeAreTheOneBake) {
  if (std::system("parallel --version 2>/dev/null | grep -q '^GNU parallel'") != 0)
    GTEST_SKIP() << "GNU parallel is not here";
  write_room("hall.obj");
  std::ofstream(folder_ / "sbatch")
      << "#!/bin/sh\n"
         "for option; do case $option in --array=1-*) tasks=${option#--array=1-} ;; esac; done\n"
         "for command; do :; done  # the last\n"
         "for task in $(seq \"$tasks\"); do SLURM_ARRAY_TASK_ID=$task sh -c \"$command\" || exit; done\n";
  fs::permissions(folder_ / "sbatch", fs::perms::owner_all);
  ASSERT_EQ(shell("lsp-bake hall.obj -o one.lsp"), 0) << read("err");
  std::ifstream readme(LSP_SOURCE_DIR "/README.md");
  std::string line;
  while (std::getline(readme, line) && line != "## One bake on many machines") {
  }
  int merges = 0;
  while (std::getline(readme, line) && line.rfind("## ", 0) != 0) {
    if (line.rfind("    ", 0) != 0) continue;
    EXPECT_EQ(shell("PATH=$PWD:$PATH\n" + line), 0) << line << "\n" << read("err");
    if (line.find("lsp-merge") == std::string::npos) continue;
    ++merges;
    EXPECT_TRUE(read("hall.lsp") == read("one.lsp")) << line;
    for (const fs::directory_entry& file : fs::directory_iterator(folder_))
      if (file.path().extension() == ".part" || file.path().filename() == "hall.lsp") fs::remove(file);
  }
  EXPECT_EQ(merges, 2);
}

}  // namespace
}  // namespace lsp::test
