// --json of every program that fails: one object on standard output, which says the exit code and what is
// wrong.
#include <gtest/gtest.h>
#include <sys/wait.h>

#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>
#include <set>

#include "lsp/program.h"
#include "picture.h"
#include "shell.h"

namespace lsp::sample {
namespace {

using Json = nlohmann::ordered_json;

struct Outcome {
  int exit = -1;
  Json json;
  std::string errors;
};

class JsonOfFailures : public ::testing::Test {
 protected:
  Outcome run(const std::string& line) {
    Outcome run;
    run.exit = test::shell(line + " >out 2>err", folder_.path());
    const std::string out = test::read_bytes(folder_.path() / "out");
    run.json = Json::parse(out, nullptr, false);
    run.errors = test::read_bytes(folder_.path() / "err");
    EXPECT_TRUE(run.json.is_object()) << line << "\n" << out;
    return run;
  }

  // Runs PROGRAM --json WORDS, which has to fail with this exit code and with this in its message.
  Outcome expect_failure(const std::string& program, const std::string& words, int exit,
                         const std::string& message) {
    SCOPED_TRACE(program + " " + words);
    Outcome failed = run(program + " --json " + words);
    EXPECT_EQ(failed.exit, exit) << failed.errors;
    if (!failed.json.is_object()) return failed;
    EXPECT_EQ(failed.json.value("program", ""), program);
    EXPECT_EQ(failed.json.value("version", ""), kProgramVersion);
    EXPECT_EQ(failed.json.value("exit", -1), exit);
    const std::string error = failed.json.value("error", "");
    EXPECT_NE(error.find(message), std::string::npos) << error;
    EXPECT_NE(failed.errors.find(error), std::string::npos) << failed.errors;
    return failed;
  }

  void write(const std::string& name, const std::string& text) {
    std::ofstream(folder_.path() / name, std::ios::binary) << text;
  }

  test::TemporaryFolder folder_;
};

// What each is asked for that it cannot do.
struct Case {
  const char* program;
  const char* words;
  int exit;
  const char* message;
};
constexpr Case kCases[] = {
    {"lsp-bake", "none.obj -o out.lsp", 2, "cannot be"},
    {"lsp-bench", "none.obj -o report", 2, "does not exist"},
    {"lsp-compare", "none.pfm none.pfm", 2, "cannot be"},
    {"lsp-demo-report", "none -o page.html", 2, "cannot be read"},
    {"lsp-info", "none.lsp", 2, "cannot be"},
    {"lsp-merge", "none.part -o out.lsp", 2, "cannot be"},
    {"lsp-render", "none.lsp -o out.png", 2, "cannot be"},
    {"lsp-sample-scene", "no/such/folder/out.glb", 2, "cannot be"},
    {"lsp-trace", "none.lsp --rays none.bin --hits out.bin", 2, "cannot be"},
    {"lsp-validate", "none.lsp", 2, "cannot be"},
    {"lsp-view", "none.lsp", 2, "cannot be"},
};

TEST_F(JsonOfFailures, EveryProgram) {
  std::set<std::string> asked;
  for (const Case& c : kCases) {
    if (!std::filesystem::exists(std::filesystem::path(LSP_BIN_DIR) / c.program)) continue;
    asked.insert(c.program);
    const Outcome failed = expect_failure(c.program, c.words, c.exit, c.message);
    EXPECT_TRUE(failed.json.contains("file")) << c.program;
    expect_failure(c.program, std::string(c.words) + " --no-such-option", 1, "--no-such-option");
  }
  for (const auto& entry : std::filesystem::directory_iterator(LSP_BIN_DIR)) {
    const std::string program = entry.path().filename().string();
    EXPECT_TRUE(!program.starts_with("lsp-") || asked.contains(program)) << program << " has no case";
  }
}

// --json is heard wherever it stands, and a word after -- is a file.
TEST_F(JsonOfFailures, JsonIsHeardWhereverItStands) {
  const Outcome failed = run("lsp-info none.lsp --memory-limit much --json");
  EXPECT_EQ(failed.exit, 1);
  EXPECT_EQ(failed.json.value("exit", -1), 1);
  EXPECT_NE(failed.json.value("error", "").find("--memory-limit"), std::string::npos);
  EXPECT_EQ(test::shell("lsp-info -- --json >out 2>err", folder_.path()), 2);
  EXPECT_EQ(test::read_bytes(folder_.path() / "out"), "");
}

// An unset variable of a script is neither 0 nor an option left out.
TEST_F(JsonOfFailures, EmptyWordsAreRefused) {
  for (const Case& c : kCases) {
    if (!std::filesystem::exists(std::filesystem::path(LSP_BIN_DIR) / c.program)) continue;
    expect_failure(c.program, "''", 1, "a file's name is empty");
  }
  expect_failure("lsp-bake", "none.obj -o ''", 1, "-o has an empty value");
  expect_failure("lsp-bake", "none.obj -o out.lsp --threads ''", 1, "--threads has an empty value");
  expect_failure("lsp-bake", "none.obj -o out.lsp --shard=", 1, "--shard has an empty value");
  expect_failure("lsp-compare", "none.pfm none.pfm --max-rmse ''", 1, "--max-rmse has an empty value");
}

// The words are not those of the parser's types and checks.
TEST_F(JsonOfFailures, WhatIsWrongWithAValueIsSaidPlainly) {
  const std::pair<const char*, const char*> cases[] = {
      {"--cells 4.5", "--cells: 4.5 is no whole number from 0 to 1024; see lsp-bake --help"},
      {"--max-error 101", "--max-error: 101 is no number from 0 to 100;"},
      {"--threads -1", "--threads: -1 is no whole number from 0 to 1024;"},
      {"--triangles x", "--triangles: x is no whole number;"},
      {"--branching 17", "--branching: 17 is neither 0 nor a whole number from 2 to 16;"},
      {"--align x", "--align: x is none of its values;"},
      {"--max-size 0.5MB", "--max-size: 0.5 is no whole number, take a smaller unit;"},
      {"--memory-limit 3XB", "--memory-limit: xb is no unit of a size, give bytes or as 20MB or 2GiB;"},
      {"--max-size 99999999999GB", "--max-size: 99999999999 gb is too large;"},
      {"--max-size 99999999999999999999", "--max-size: 99999999999999999999 is too large;"},
      {"--cells 3 --cells 4", "--cells is given more than once;"},
      {"--cells", "--cells needs a value;"},
      {"--depth", "--depth needs a value;"}};
  for (const auto& [words, message] : cases)
    expect_failure("lsp-bake", std::string("none.obj -o out.lsp ") + words, 1, message);
  expect_failure("lsp-compare", "none.pfm none.pfm --max-rmse -1", 1, "-1 is no number from 0 to");
  expect_failure("lsp-compare", ". none.pfm", 2, "is a folder");
  expect_failure("lsp-sample-scene", "scene.obj", 1, "written as .glb");
}

// A judge of pictures does not call a broken one equal, and names it.
TEST_F(JsonOfFailures, PicturesThatCannotBeCompared) {
  Picture picture(3, 2);
  const auto save = [&](const char* name) {
    write_picture((folder_.path() / name).string(), picture, Transfer::kDisplay);
  };
  save("good.pfm");
  for (const float broken : {NAN, INFINITY, -INFINITY}) {
    picture.pixels[4].y = broken;
    save("broken.pfm");
    for (const char* words : {"good.pfm broken.pfm", "broken.pfm good.pfm", "broken.pfm broken.pfm"}) {
      const Outcome failed = expect_failure("lsp-compare", words, 3, "pixel 1,1 (from the upper left)");
      EXPECT_EQ(failed.json.value("file", ""), "broken.pfm");
    }
  }
  picture = Picture(2, 3);
  save("turned.pfm");
  const Outcome failed = expect_failure("lsp-compare", "good.pfm turned.pfm -o difference.png", 3,
                                        "has 2x3 pixels, good.pfm 3x2");
  EXPECT_EQ(failed.json.value("file", ""), "turned.pfm");
  EXPECT_FALSE(std::filesystem::exists(folder_.path() / "difference.png"));
}

// A difference is not written as 0, nor a share of a mean that is none.
TEST_F(JsonOfFailures, SmallDifferencesHaveDigits) {
  Picture picture(2, 2);
  write_picture((folder_.path() / "black.pfm").string(), picture, Transfer::kDisplay);
  for (glm::vec3& pixel : picture.pixels) pixel = glm::vec3(2e-7f);
  write_picture((folder_.path() / "near.pfm").string(), picture, Transfer::kDisplay);
  expect_failure("lsp-compare", "black.pfm near.pfm --max-rmse 1e-8", 7,
                 "RMSE 2e-07 against black.pfm is over 1e-08");
  EXPECT_EQ(test::shell("lsp-compare black.pfm near.pfm >out 2>err", folder_.path()), 0);
  EXPECT_EQ(test::read_bytes(folder_.path() / "out").find("of the mean"), std::string::npos);
}

// The page is not written over what it is made of, and broken pictures make none.
TEST_F(JsonOfFailures, PagesOfTheDemo) {
  for (const char* name : {"bake.json", "exact.json", "approx.json", "compare.json", "curve_fast.json"})
    write(name, "{}");
  for (const char* name : {"exact.png", "approx.png", "difference.png"}) write(name, "no picture");
  for (const char* name : {"bake.json", "compare.json", "curve_fast.json", "exact.png"}) {
    const std::string before = test::read_bytes(folder_.path() / name);
    expect_failure("lsp-demo-report", std::string(". -o ") + name, 1, "is read, too");
    EXPECT_EQ(test::read_bytes(folder_.path() / name), before) << name;
  }
  expect_failure("lsp-demo-report", ". -o no/such/folder/page.html", 2, "there is no folder");
  const Outcome failed = expect_failure("lsp-demo-report", ". -o page.html", 3, "is no .png picture");
  EXPECT_EQ(failed.json.value("file", ""), "./exact.png");
  EXPECT_FALSE(std::filesystem::exists(folder_.path() / "page.html"));
}

// An option that changes nothing says so, where the run is not to be quiet.
TEST_F(JsonOfFailures, WhatDoesNothingIsSaid) {
  write_picture((folder_.path() / "black.pfm").string(), Picture(2, 2), Transfer::kDisplay);
  const std::pair<const char*, const char*> lines[] = {
      {"lsp-compare black.pfm black.pfm --factor 9", "--factor does nothing"},
      {"lsp-sample-scene plane.glb --scene plane --no-masks", "--no-masks does nothing"}};
  for (const auto& [line, said] : lines) {
    EXPECT_EQ(test::shell(std::string(line) + " >out 2>err", folder_.path()), 0) << line;
    EXPECT_NE(test::read_bytes(folder_.path() / "err").find(said), std::string::npos) << line;
    EXPECT_EQ(test::shell(std::string(line) + " --quiet >out 2>err", folder_.path()), 0) << line;
    EXPECT_EQ(test::read_bytes(folder_.path() / "err"), "") << line;
  }
  EXPECT_EQ(test::shell("lsp-sample-scene grove.glb --scene grove --triangles 4000 --no-masks >out 2>err",
                        folder_.path()),
            0);
  EXPECT_EQ(test::read_bytes(folder_.path() / "err"), "");
}

// What was found out is there, too, in the same object.
TEST_F(JsonOfFailures, FiguresAndErrorAreOneObject) {
  Picture picture(2, 2);
  write_picture((folder_.path() / "black.pfm").string(), picture, Transfer::kDisplay);
  picture.pixels[0] = glm::vec3(1);
  write_picture((folder_.path() / "other.pfm").string(), picture, Transfer::kDisplay);
  const Outcome failed = expect_failure("lsp-compare", "black.pfm other.pfm --max-rmse 0.1", 7, "RMSE");
  EXPECT_GT(failed.json.value("rmse", 0.0), 0.1);
  const Outcome done = run("lsp-compare --json black.pfm black.pfm --max-rmse 0.1");
  EXPECT_EQ(done.exit, 0);
  EXPECT_EQ(done.json.value("exit", -1), 0);
  EXPECT_FALSE(done.json.contains("error"));

  write("no.lsp", "no such format");
  const Outcome judged = expect_failure("lsp-validate", "no.lsp", 3, "do not use it");
  EXPECT_EQ(judged.json.value("verdict", ""), "invalid");
  const Outcome several = expect_failure("lsp-validate", "no.lsp none.lsp", 3, "2 of 2 files");
  EXPECT_EQ(several.json["files"].size(), 2u);
  expect_failure("lsp-validate", "--rules", 1, "Markdown");
  EXPECT_EQ(test::shell("lsp-validate --rules no.lsp >out 2>err", folder_.path()), 1);
}

TEST_F(JsonOfFailures, AMemoryLimitIsNoDamage) {
  ASSERT_EQ(test::shell("lsp-sample-scene a.glb --quiet --scene plane && lsp-bake a.glb -o a.lsp --quiet "
                        "--base wide --compress zstd",
                        folder_.path()),
            0);
  const Outcome failed = expect_failure("lsp-info", "a.lsp --memory-limit 1", 6, "raise --memory-limit");
  EXPECT_TRUE(failed.json.contains("sections"));
  EXPECT_EQ(test::shell("lsp-info a.lsp --memory-limit 1 >out 2>err", folder_.path()), 6);
  EXPECT_EQ(test::read_bytes(folder_.path() / "out").find("damaged"), std::string::npos);
  EXPECT_EQ(test::shell("lsp-info a.lsp >out 2>err", folder_.path()), 0);
}

// An error that cannot be printed leaves the exit code that it has.
TEST_F(JsonOfFailures, StandardOutputIsFull) {
  if (!std::filesystem::exists("/dev/full")) GTEST_SKIP() << "no /dev/full";
  EXPECT_EQ(test::shell("lsp-sample-scene --json out.glb --scene plane >/dev/full 2>err", folder_.path()), 2);
  EXPECT_NE(test::read_bytes(folder_.path() / "err").find("standard output: cannot be written"),
            std::string::npos);
  EXPECT_EQ(test::shell("lsp-validate --json none.lsp none.lsp none.lsp >/dev/full 2>err", folder_.path()),
            2);
  EXPECT_EQ(test::shell("lsp-info --json --no-such-option >/dev/full 2>err", folder_.path()), 1);
}

}  // namespace
}  // namespace lsp::sample
