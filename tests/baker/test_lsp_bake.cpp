// lsp-bake as its users run it.
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <cmath>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <random>
#include <sstream>
#include <thread>

#include "grid_mesh.h"
#include "lsp/layout.h"
#include "shell.h"

namespace lsp::test {
namespace {

namespace fs = std::filesystem;
const std::string kBake = std::string(LSP_BIN_DIR) + "/lsp-bake";

class LspBake : public ::testing::Test {
 protected:
  LspBake() { write_grid("grid.obj", 60); }
  // Enough triangles to give every option something to do.
  void write_grid(const char* name, int size) { std::ofstream(folder_ / name) << grid_obj(size); }

  int run(const std::string& arguments) const {
    return shell("lsp-bake " + arguments + " >out 2>err", folder_);
  }
  std::string read(const std::string& name) const { return read_bytes(folder_ / name); }
  size_t files() const {
    return size_t(std::distance(fs::directory_iterator(folder_), fs::directory_iterator()));
  }

  const TemporaryFolder temporary_;
  const fs::path folder_ = temporary_.path();
};

TEST_F(LspBake, GivesTheSameBytesOnAnyNumberOfThreads) {
  ASSERT_EQ(run("grid.obj -o a.lsp --depth 5"), 0);
  ASSERT_EQ(run("grid.obj -o b.lsp --depth 5 --threads 1"), 0);
  ASSERT_GT(read("a.lsp").size(), 4096u);
  EXPECT_TRUE(read("a.lsp") == read("b.lsp"));
}

TEST_F(LspBake, PresetsOfCellsDiffer) {
  write_grid("small.obj", 12);
  for (const std::string preset : {"fast", "accurate"})
    ASSERT_EQ(run("small.obj --base cells --cells 4 --preset " + preset + " -o " + preset + ".lsp"), 0);
  EXPECT_FALSE(read("fast.lsp") == read("accurate.lsp"));
}

TEST_F(LspBake, TheBaseFollowsFromTheOptions) {
  write_grid("small.obj", 6);
  const auto base = [&](const std::string& options) {
    EXPECT_EQ(run("small.obj -o a.lsp " + options), 0) << options << read("err");
    const std::string bytes = read("a.lsp");
    const size_t at = bytes.find("\"base\":\"");
    return at == std::string::npos ? "" : bytes.substr(at + 8, bytes.find('"', at + 8) - at - 8);
  };
  EXPECT_EQ(base(""), "wide") << "no table is worth its bytes";
  EXPECT_EQ(base("--preset accurate"), "cells");
  EXPECT_EQ(base("--base wide"), "wide");
  EXPECT_EQ(base("--max-error 50"), "cells");
  EXPECT_EQ(base("--cells 3 --preset fast"), "cells");
  EXPECT_EQ(base("--no-exact"), "cells");
  EXPECT_EQ(base("--resolution 3"), "bvh");
  EXPECT_EQ(base("--no-line-spaces"), "bvh");
  EXPECT_EQ(base("--for visibility"), "bvh");
  EXPECT_EQ(base("--base ntree"), "ntree");
  EXPECT_EQ(run("small.obj -o a.lsp --cells 3 --depth 4"), 1);
  EXPECT_NE(read("err").find("cells have tables of their own"), std::string::npos) << read("err");
  for (const char* option : {"--depth 4", "--no-exact", "--max-error 1"}) {
    EXPECT_EQ(run(std::string("small.obj -o a.lsp --base wide ") + option), 1) << option;
    EXPECT_NE(read("err").find("--base wide has no tables"), std::string::npos) << read("err");
  }
}

// Bytes of tables and of what exact rays need, by the report.
struct Bytes {
  uint64_t tables = 0, exact = 0, file = 0;
};
Bytes bytes_of(const nlohmann::json& report) {
  Bytes bytes;
  for (const auto& section : report["sections"]) {
    const std::string name = section["name"];
    const bool exact = name == "TRIA" || name == "NRML" || name == "MATL" || name == "WNOD";
    (exact ? bytes.exact : bytes.tables) += name == "META" ? 0 : section["bytes"].get<uint64_t>();
  }
  bytes.file = report["file_bytes"];
  return bytes;
}

TEST_F(LspBake, SmallThingsStaySmall) {
  write_grid("two.obj", 1);
  std::ofstream(folder_ / "dunes.obj")
      << grid_obj(48, [](int i, int j) { return 6 * std::sin(i * 0.13) * std::sin(j * 0.11); });
  for (const char* name : {"two", "dunes"}) {
    ASSERT_EQ(run(std::string(name) + ".obj -o a.lsp --preset fast --json"), 0) << read("err");
    const auto report = nlohmann::json::parse(read("out"));
    const Bytes bytes = bytes_of(report);
    EXPECT_LE(bytes.tables, 3 * bytes.exact) << name;
    if (name == std::string("dunes")) {
      EXPECT_LE(bytes.file, 4 * bytes.exact);
      EXPECT_GT(bytes.tables, bytes.exact) << "tables of as many cells as there is room for";
      continue;
    }
    EXPECT_EQ(bytes.tables, 0u);
    EXPECT_EQ(report["skipped"][0],
              "tables: of so small a mesh, they would be more than three times its exact data (--base cells "
              "asks for them)");
    EXPECT_LT(bytes.file, 4096u) << "mostly padding";
    EXPECT_TRUE(report["error"].is_null()) << "every ray is exact";
    const std::string file = read("a.lsp");
    LspHeader header;
    ASSERT_GE(file.size(), sizeof header);
    std::memcpy(&header, file.data(), sizeof header);
    EXPECT_EQ(header.filled_cell_count | header.entry_word_count | header.plane_count | header.split_count |
                  header.cell_node_count | header.cell_reference_count,
              0u)
        << "counts of sections that were left out";
  }
  // Here a cell's loss is everywhere, and rays leave soon.
  ASSERT_EQ(run("grid.obj -o b.lsp --preset fast --json"), 0) << read("err");
  EXPECT_EQ(nlohmann::json::parse(read("out"))["skipped"][0],
            "tables: a ray through them would take as long as an exact one (--base cells asks for them)");
  ASSERT_EQ(run("two.obj -o b.lsp --base cells --json"), 0) << read("err");
  EXPECT_GT(bytes_of(nlohmann::json::parse(read("out"))).tables, 0u) << "asked for";
}

// A cone whose triangles all meet at its tip, one whose tips differ by a rounding, and as many specks in one
// cell of any grid.
TEST_F(LspBake, WhatNoCellCanHoldHasExactRaysAlone) {
  constexpr int kTriangles = 9000;
  std::ofstream cone(folder_ / "cone.obj"), brush(folder_ / "brush.obj"), specks(folder_ / "specks.obj");
  cone << "v 0 1 0\n";
  specks << "v -9 -9 -9\nv 9 9 9\nv -9 9 9\nf 1 2 3\n";
  for (int i = 0; i < kTriangles; ++i) {
    const double angle = 6.283185307179586 * i / kTriangles, x = std::cos(angle), z = std::sin(angle);
    cone << "v " << x << " 0 " << z << "\n";
    cone << "f 1 " << i + 2 << " " << (i + 1) % kTriangles + 2 << "\n";
    brush << "v " << 1e-6 * x << " 1 " << 1e-6 * z << "\nv " << x << " 0 " << z << "\nv " << x - 1e-3 * z
          << " 0 " << z + 1e-3 * x << "\nf -3 -2 -1\n";
    specks << "v " << x / 1000 << " " << (i + 1) * 1e-6 << " " << z / 1000 << "\nv 0 " << i * 1e-6
           << " 1e-5\nv 0 " << i * 1e-6 << " 0\nf -3 -2 -1\n";
  }
  for (std::ofstream* file : {&cone, &brush, &specks}) file->close();
  const auto start = std::chrono::steady_clock::now();
  const std::pair<const char*, const char*> cases[] = {
      {"cone", "a cell of the finest grid would hold 9,000 triangles"},
      {"brush", "a cell of the finest grid would hold 9,000 triangles"},
      {"specks", "a cell of the finest grid would hold 9,00"}};
  for (const auto& [name, why] : cases) {
    ASSERT_EQ(run(std::string(name) + ".obj -o a.lsp --json"), 0) << read("err");
    const auto report = nlohmann::json::parse(read("out"));
    EXPECT_EQ(bytes_of(report).tables, 0u) << name;
    EXPECT_NE(report["skipped"].dump().find("tables: " + std::string(why)), std::string::npos)
        << report["skipped"];
    EXPECT_NE(read("a.lsp").find("\"base\":\"wide\""), std::string::npos);
  }
  EXPECT_LT(std::chrono::steady_clock::now() - start, std::chrono::seconds(60)) << "not by trying every grid";
  EXPECT_EQ(run("cone.obj -o b.lsp --base cells"), 6);
  EXPECT_NE(read("err").find("9,000 triangles, and it can hold 8,191: give --base wide"), std::string::npos)
      << read("err");
  EXPECT_EQ(run("cone.obj -o b.part --shard 1/2 --depfile b.d"), 6);
  EXPECT_FALSE(fs::exists(folder_ / "b.d")) << "the rule of a part that is not there";
}

// Slivers through one another, and a detail for whose sake the grid would be fine everywhere.
TEST_F(LspBake, WhatTakesTooLongToFillHasExactRaysAlone) {
  std::ofstream slivers(folder_ / "slivers.obj"), detail(folder_ / "detail.obj");
  std::mt19937 random(1);
  const auto number = [&](double size) { return (random() * 0x1p-31 - 1) * size; };
  const auto write = [&](std::ofstream& file, double size, double length, double width) {
    const double at[] = {number(size), number(size), number(size)};
    const double to[] = {at[0] + number(length), at[1] + number(length), at[2] + number(length)};
    file << "v " << at[0] << " " << at[1] << " " << at[2] << "\nv " << to[0] << " " << to[1] << " " << to[2]
         << "\nv " << to[0] + number(width) << " " << to[1] + number(width) << " " << to[2] + number(width)
         << "\nf -3 -2 -1\n";
  };
  for (int i = 0; i < 9000; ++i) write(slivers, 1, 2, 0.02);
  for (int i = 0; i < 20000; ++i) write(detail, 1e-2, 1e-3, 1e-3);
  detail << "v 1 1 1\nv 2 1 1\nv 1 2 1\nf -3 -2 -1\n";
  slivers.close();
  detail.close();
  const std::pair<const char*, const char*> cases[] = {
      {"slivers", "boxes and triangles in a cell, on average, and filling"},
      {"detail", "a grid of which no cell is too full has"}};
  for (const auto& [name, why] : cases) {
    const auto start = std::chrono::steady_clock::now();
    ASSERT_EQ(run(std::string(name) + ".obj -o a.lsp --json"), 0) << read("err");
    EXPECT_LT(std::chrono::steady_clock::now() - start, std::chrono::seconds(60)) << name;
    const auto report = nlohmann::json::parse(read("out"));
    EXPECT_EQ(bytes_of(report).tables, 0u) << name;
    EXPECT_NE(report["skipped"].dump().find(why), std::string::npos) << report["skipped"];
  }
}

// Beyond the range in which products of coordinates are floats every ray would miss.
TEST_F(LspBake, WhatNoRayCouldHitIsRefused) {
  const auto write = [&](const char* name, const char* scale) {
    std::ofstream(folder_ / name) << "v 0 0 0\nv " << scale << " 0 0\nv 0 " << scale << " 0\nf 1 2 3\n";
  };
  write("large.obj", "1e30");
  write("small.obj", "1e-30");
  for (const char* options : {"", "--base bvh", "--shard 1/2"}) {
    EXPECT_EQ(run(std::string("large.obj -o a.lsp ") + options), 3) << options;
    EXPECT_NE(read("err").find("large.obj: has a corner at (1e+30, 0, 0)"), std::string::npos) << read("err");
    EXPECT_EQ(run(std::string("small.obj -o a.lsp ") + options), 3) << options;
    EXPECT_NE(read("err").find("small.obj: is 1e-30 units long"), std::string::npos) << read("err");
  }
  EXPECT_FALSE(std::filesystem::exists(folder_ / "a.lsp"));
  for (const char* scale : {"1e17", "1e-14"}) {
    write("held.obj", scale);
    EXPECT_EQ(run("held.obj -o a.lsp"), 0) << read("err");
  }
}

TEST_F(LspBake, HelpBeginsWithWhatMostPeopleNeed) {
  ASSERT_EQ(run("--help"), 0);
  const std::string help = read("out");
  const size_t first = help.find("\nWhat most people need:\n"), second = help.find(":\n", first + 30);
  ASSERT_NE(second, std::string::npos);
  for (const char* option : {"INPUT...", "-o, --output FILE", "--preset fast|balanced|accurate",
                             "--max-error PERCENT", "--for ", "--compress none|zstd"})
    EXPECT_LT(help.find("\n  " + std::string(option)), second) << help;
  EXPECT_EQ(help.find("More options"), std::string::npos) << "an option has no group";
  std::istringstream lines(help);
  for (std::string line; std::getline(lines, line);) EXPECT_LE(line.size(), 80u) << line;
}

TEST_F(LspBake, PrintsOneJsonObject) {
  ASSERT_EQ(run("grid.obj -o a.lsp --depth 5 --json"), 0);
  const auto report = nlohmann::json::parse(read("out"));
  EXPECT_EQ(report["triangles"]["read"], 7200);
  EXPECT_EQ(report["file_bytes"], fs::file_size(folder_ / "a.lsp"));
  EXPECT_EQ(report["error"]["rays"], 65536);
  EXPECT_TRUE(report["qualities"].is_null()) << "Line Spaces have none";
  EXPECT_EQ(read("err"), "");
}

TEST_F(LspBake, StatesWhatItsQualitiesErrAndGain) {
  ASSERT_EQ(run("grid.obj -o a.lsp --cells 6 --json"), 0) << read("err");
  const auto qualities = nlohmann::ordered_json::parse(read("out"))["qualities"];
  for (const char* measure : {"wrong_percent", "depth_error_percent_of_diagonal",
                              "ambient_occlusion_error_percent", "light_error_percent"}) {
    EXPECT_GE(qualities["fast"][measure], qualities["balanced"][measure]) << measure;
    EXPECT_GE(qualities["balanced"][measure], qualities["accurate"][measure]) << measure;
  }
  EXPECT_LE(qualities["balanced"]["ambient_occlusion_error_percent"], 3.0);
  EXPECT_LE(qualities["accurate"]["ambient_occlusion_error_percent"], 1.5);
  const auto gain = [&](const char* quality, const char* device) {
    return double{qualities[quality]["estimated_times_exact_rays"][device]};
  };
  for (const char* device : {"vulkan", "cpu"}) {
    EXPECT_GE(gain("fast", device), gain("balanced", device)) << device;
    EXPECT_GE(gain("balanced", device), gain("accurate", device)) << device;
    EXPECT_GT(gain("accurate", device), 0) << device;
  }

  EXPECT_NE(read("a.lsp").find("\"qualities\":" + qualities.dump()), std::string::npos)
      << "META has them, too";

  ASSERT_EQ(run("grid.obj -o tables.lsp --cells 6 --no-exact --json"), 0) << read("err");
  const auto alone = nlohmann::json::parse(read("out"))["qualities"];
  EXPECT_EQ(alone["accurate"], alone["fast"]) << "tables alone are left";
  ASSERT_EQ(run("grid.obj -o wide.lsp --base wide --json"), 0) << read("err");
  EXPECT_TRUE(nlohmann::json::parse(read("out"))["qualities"].is_null()) << "every ray is exact";
  ASSERT_EQ(run("grid.obj -o a.lsp --cells 6"), 0) << read("err");
  EXPECT_NE(read("out").find("exact rays on Vulkan"), std::string::npos) << read("out");
}

TEST_F(LspBake, ExitsAsTheErrorIs) {
  EXPECT_EQ(run("grid.obj"), 1);
  EXPECT_NE(read("err").find("lsp-bake: "), std::string::npos);
  EXPECT_EQ(run("grid.obj -o a.lsp --resolution 0"), 1);
  EXPECT_EQ(run("missing.obj -o a.lsp"), 2);
  EXPECT_NE(read("err").find("missing.obj"), std::string::npos);
  EXPECT_EQ(run("grid.obj -o no/such/folder/a.lsp"), 2);
  std::ofstream(folder_ / "broken.ply") << "ply\nformat ascii 1.0\nelement vertex 3\n";
  EXPECT_EQ(run("broken.ply -o a.lsp"), 3);
  EXPECT_EQ(run("grid.obj -o a.lsp --memory-limit 1MiB"), 6);
  write_grid("small.obj", 12);
  EXPECT_EQ(run("small.obj -o a.lsp --max-error 1e-9"), 0) << "a scene too small to approximate is exact";
  fs::remove(folder_ / "a.lsp");
  EXPECT_FALSE(fs::exists(folder_ / "a.lsp"));
  EXPECT_EQ(files(), 5u) << "something was left behind";
  EXPECT_EQ(run("--version"), 0);
  EXPECT_EQ(run("--help"), 0);
}

TEST_F(LspBake, NumbersThatAreNoneAreRefused) {
  for (const std::string wrong : {"--max-size -5", "--memory-limit -1", "--crease-angle nan",
                                  "--max-error nan", "--plane-tolerance nan", "--threads -1", "--for 2"})
    EXPECT_EQ(run("grid.obj -o a.lsp " + wrong), 1) << wrong;
  EXPECT_EQ(run("grid.obj -o a.lsp --for shadows"), 1);
  EXPECT_NE(read("err").find("shadows not in {all,ao,diffuse,glossy,visibility}"), std::string::npos)
      << read("err");
  EXPECT_FALSE(fs::exists(folder_ / "a.lsp"));
}

TEST_F(LspBake, WhatIsReadIsNotOverwritten) {
  const std::string mesh = "mtllib a.mtl\nusemtl x\n" + read("grid.obj"), material = "newmtl x\nKd 1 0 0\n";
  std::ofstream(folder_ / "a.obj") << mesh;
  std::ofstream(folder_ / "a.mtl") << material;
  for (const std::string output :
       {"-o a.obj", "-o ./a.mtl", "-o a.lsp --depfile a.obj", "-o a.lsp --depfile a.mtl",
        "-o a.lsp --depfile a.lsp", "-o a.lsp --depfile ./a.lsp"}) {
    EXPECT_EQ(run("a.obj --base wide " + output), 1) << output;
    EXPECT_NE(read("err"), "") << output;
    EXPECT_EQ(read("a.obj"), mesh) << output;
    EXPECT_EQ(read("a.mtl"), material) << output;
    EXPECT_FALSE(fs::exists(folder_ / "a.lsp")) << output;
  }
}

TEST_F(LspBake, NamesNeedNotBeUtf8) {
  fs::copy_file(folder_ / "grid.obj", folder_ / "l\xE4n.obj");
  ASSERT_EQ(run("'l\xE4n.obj' -o 'l\xE4n.lsp' --base wide --json"), 0) << read("err");
  EXPECT_EQ(nlohmann::json::parse(read("out"))["output"], "l\xEF\xBF\xBDn.lsp");
  EXPECT_EQ(shell("lsp-validate 'l\xE4n.lsp' --mesh 'l\xE4n.obj'", folder_), 0);
}

// META is UTF-8 and has '?' for what is none: the file that it means is found all the same, and compared.
TEST_F(LspBake, NamesBesideAMeshNeedNotBeUtf8) {
  std::ofstream(folder_ / "gr\xFCn.mtl") << "newmtl a\nKd 0 1 0\n";
  std::ofstream(folder_ / "green.obj")
      << "mtllib gr\xFCn.mtl\nusemtl a\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
  ASSERT_EQ(run("green.obj -o green.lsp --base wide --json"), 0) << read("err");
  EXPECT_EQ(shell("lsp-validate green.lsp --mesh green.obj", folder_), 0);
  std::ofstream(folder_ / "gr\xFCn.mtl") << "newmtl a\nKd 0 0 1\n";
  EXPECT_EQ(shell("lsp-validate --quiet green.lsp --mesh green.obj 2>/dev/null", folder_), 7);
}

// A device that cannot be replaced is written to, and what was printed has come out or is no success.
TEST_F(LspBake, AFullDeviceIsAnError) {
  fs::create_symlink("/dev/full", folder_ / "full");
  EXPECT_EQ(run("grid.obj -o full --base wide"), 2);
  EXPECT_TRUE(fs::is_symlink(folder_ / "full"));
  EXPECT_EQ(run("grid.obj -o a.lsp --base wide --depfile full"), 2);
  EXPECT_FALSE(fs::exists(folder_ / "a.lsp"));
  for (const std::string arguments : {"--help", "--version", "grid.obj -o a.lsp --base wide"})
    EXPECT_EQ(shell("lsp-bake " + arguments + " >/dev/full 2>err", folder_), 2) << arguments;
}

TEST_F(LspBake, FilesAreNoLongerThanAskedFor) {
  const auto grid_of = [&](const char* file) {
    EXPECT_EQ(shell(std::string("lsp-info --json ") + file + " >info", folder_), 0);
    return nlohmann::json::parse(read("info"))["provenance"]["options"]["cells"].get<int>();
  };
  write_grid("hills.obj", 24);
  ASSERT_EQ(run("hills.obj -o all.lsp --preset fast --base cells"), 0) << read("err");
  const uint64_t all = fs::file_size(folder_ / "all.lsp"), half = all / 2;
  ASSERT_EQ(run("hills.obj -o half.lsp --preset fast --max-size " + std::to_string(half)), 0) << read("err");
  EXPECT_LE(fs::file_size(folder_ / "half.lsp"), half);
  EXPECT_GT(fs::file_size(folder_ / "half.lsp"), half / 2);
  EXPECT_LT(grid_of("half.lsp"), grid_of("all.lsp"));
  ASSERT_EQ(run("hills.obj -o same.lsp --preset fast --max-size " + std::to_string(all)), 0) << read("err");
  EXPECT_EQ(read("same.lsp"), read("all.lsp")) << "there was room";
  EXPECT_EQ(run("hills.obj -o none.lsp --preset fast --max-size 100KB"), 6);
  EXPECT_NE(read("err").find("hills.obj: needs a file of"), std::string::npos) << read("err");
  EXPECT_NE(read("err").find("--no-exact"), std::string::npos) << read("err");
  EXPECT_FALSE(fs::exists(folder_ / "none.lsp"));
  EXPECT_EQ(run("hills.obj -o none.lsp --base bvh --max-size 100KB"), 6);
}

TEST_F(LspBake, NotesAreInTheReportAndStrictRefusesThem) {
  ASSERT_EQ(run("grid.obj -o a.lsp --depth 3 --strict"), 0);
  std::ofstream(folder_ / "lines.obj") << read("grid.obj") << "l 1 2\n";
  ASSERT_EQ(run("lines.obj -o b.lsp --depth 3 --json"), 0);
  const auto report = nlohmann::json::parse(read("out"));
  ASSERT_EQ(report["notes"].size(), 1u);
  EXPECT_NE(report["notes"][0].get<std::string>().find("1 lines, points"), std::string::npos);
  EXPECT_EQ(run("lines.obj -o c.lsp --depth 3 --strict"), 3);
  EXPECT_NE(read("err").find("1 lines, points"), std::string::npos);
  EXPECT_NE(read("err").find("lsp-bake: lines.obj: led to 1 note, which"), std::string::npos) << read("err");
  EXPECT_FALSE(fs::exists(folder_ / "c.lsp"));
  EXPECT_EQ(run("grid.obj lines.obj -o c.lsp --depth 3 --strict"), 3);
  EXPECT_NE(read("err").find("lsp-bake: grid.obj, lines.obj: led to 1 note, which"), std::string::npos)
      << read("err");
}

TEST_F(LspBake, AnAnimationsTimeIsInMeta) {
  // A triangle that moves from z = 0 to 4 in two seconds.
  std::ofstream(folder_ / "moves.gltf") << R"({"asset": {"version": "2.0"},
    "buffers": [{"byteLength": 68, "uri": "data:application/octet-stream;base64,)"
                                           R"(AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA)"
                                           R"(AAAAAAAAAEAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAgEA="}],
    "bufferViews": [{"buffer": 0, "byteLength": 36}, {"buffer": 0, "byteOffset": 36, "byteLength": 8},
                    {"buffer": 0, "byteOffset": 44, "byteLength": 24}],
    "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"},
                  {"bufferView": 1, "componentType": 5126, "count": 2, "type": "SCALAR"},
                  {"bufferView": 2, "componentType": 5126, "count": 2, "type": "VEC3"}],
    "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}], "nodes": [{"mesh": 0}],
    "animations": [{"name": "Rise", "samplers": [{"input": 1, "output": 2}],
                    "channels": [{"sampler": 0, "target": {"node": 0, "path": "translation"}}]}]})";
  ASSERT_EQ(run("moves.gltf -o a.lsp --time 1.5 --strict"), 0) << read("err");
  EXPECT_NE(read("a.lsp").find("\"time\":1.5,\"animation\":\"\""), std::string::npos);
  ASSERT_EQ(run("moves.gltf -o b.lsp --animation Rise --time -1 --strict"), 0) << read("err");
  EXPECT_NE(read("b.lsp").find("\"time\":-1.0,\"animation\":\"Rise\""), std::string::npos);
  ASSERT_EQ(run("moves.gltf -o b.lsp"), 0);
  EXPECT_EQ(read("b.lsp").find("\"time\""), std::string::npos);
  EXPECT_EQ(run("moves.gltf -o c.lsp --time 1 --animation Fall"), 1);
  EXPECT_NE(read("err").find("no input has the animation Fall, choose of 0 (Rise)"), std::string::npos)
      << read("err");
  EXPECT_EQ(run("grid.obj -o c.lsp --time 1"), 1);
  EXPECT_EQ(run("moves.gltf -o c.lsp --animation Rise"), 1);
  for (const char* time : {"nan", "inf", "soon"})
    EXPECT_EQ(run(std::string("moves.gltf -o c.lsp --time ") + time), 1) << time;
  EXPECT_FALSE(fs::exists(folder_ / "c.lsp"));
}

TEST_F(LspBake, EveryFileReadIsInTheHashAndTheDepfile) {
  fs::create_directory(folder_ / "my scene");
  std::ofstream(folder_ / "my scene/a.mtl") << "newmtl x\nKd 1 0 0\n";
  std::ofstream(folder_ / "my scene/a.obj") << "mtllib a.mtl\nusemtl x\n" << read("grid.obj");
  ASSERT_EQ(run("'my scene/a.obj' grid.obj -o a.lsp --depth 3 --depfile a.d"), 0);
  EXPECT_EQ(read("a.d"), "a.lsp: \\\n  my\\ scene/a.obj \\\n  my\\ scene/a.mtl \\\n  grid.obj\n");
  ASSERT_EQ(run("'my scene/a.obj' -o b.lsp --depth 3 --compress zstd"), 0);
  const auto validate = [&](const std::string& file, const std::string& meshes) {
    return shell("lsp-validate --quiet " + file + " --mesh " + meshes + " 2>/dev/null", folder_);
  };
  EXPECT_EQ(validate("a.lsp", "'my scene/a.obj' grid.obj"), 0);
  EXPECT_EQ(validate("a.lsp", "grid.obj 'my scene/a.obj'"), 7) << "the order counts";
  EXPECT_EQ(validate("b.lsp", "'my scene/a.obj'"), 0);
  std::ofstream(folder_ / "my scene/a.mtl") << "newmtl x\nKd 0 1 0\n";
  EXPECT_EQ(validate("a.lsp", "'my scene/a.obj' grid.obj"), 7);
  EXPECT_EQ(validate("b.lsp", "'my scene/a.obj'"), 7);
}

// They are no dependencies, without which Make would give up, but a bake is stale once they are there.
TEST_F(LspBake, FilesThatAreMissingMakeItStaleOnceTheyAreThere) {
  const std::string triangle = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nusemtl x\nf 1/1 2/1 3/1\n";
  std::ofstream(folder_ / "a.obj") << "mtllib a.mtl b.mtl\n" << triangle;
  std::ofstream(folder_ / "a.mtl") << "newmtl x\nmap_Kd maps\\no.png\nmap_Ke maps\n";
  fs::create_directory(folder_ / "maps");
  const std::string picture = R"({"uri": "no%20way.png"})";
  std::ofstream(folder_ / "a.gltf") << R"({"asset": {"version": "2.0"}, "nodes": [{"mesh": 0}], "meshes": [
    {"primitives": [{"attributes": {"POSITION": 0}, "material": 0}]}], "materials": [{"pbrMetallicRoughness":
    {"baseColorTexture": {"index": 0}}}], "textures": [{"source": 0}], "images": [)"
                                    << picture << R"(],
    "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}],
    "bufferViews": [{"buffer": 0, "byteLength": 36}], "buffers": [{"byteLength": 36, "uri":
    "data:;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA"}]})";
  ASSERT_EQ(run("a.obj -o a.lsp --base wide --depfile a.d"), 0);
  EXPECT_EQ(read("a.d"), "a.lsp: \\\n  a.obj \\\n  a.mtl\n");
  ASSERT_EQ(run("a.gltf -o b.lsp --base wide"), 0);
  const auto validate = [&](const std::string& arguments) {
    return shell("lsp-validate --quiet " + arguments + " 2>/dev/null", folder_);
  };
  for (const char* missing : {"b.mtl", "maps/no.png"}) {
    EXPECT_EQ(validate("a.lsp --mesh a.obj"), 0);
    std::ofstream(folder_ / missing) << "x";
    EXPECT_EQ(validate("a.lsp --mesh a.obj"), 7) << missing;
    fs::remove(folder_ / missing);
  }
  EXPECT_EQ(validate("b.lsp --mesh a.gltf"), 0);
  std::ofstream(folder_ / "no way.png") << "x";
  EXPECT_EQ(validate("b.lsp --mesh a.gltf"), 7);
}

// Names with what means something else in a rule: they are up to date after the bake, and not once a file
// changed.
TEST_F(LspBake, NinjaAndMakeReadTheDepfile) {
  const std::string scene = "my $cene #1: a";
  fs::create_directory(folder_ / scene);
  std::ofstream(folder_ / scene / "b #$:.mtl") << "newmtl x\nKd 1 0 0\n";
  std::ofstream(folder_ / scene / "b.obj") << "mtllib b #$:.mtl\nusemtl x\n" << read("grid.obj");
  ASSERT_EQ(run("'" + scene + "/b.obj' -o 'o $ #:.lsp' --depth 3 --depfile a.d"), 0);
  std::ofstream(folder_ / "Makefile") << "o\\ $$\\ \\#\\:.lsp:\n\tfalse\n-include a.d\n";
  std::ofstream(folder_ / "build.ninja") << "rule bake\n  command = touch 'o $$ #:.lsp'\n  depfile = a.d\n"
                                            "build o$ $$$ #$:.lsp: bake\n";
  const auto is_new = [&](const std::string& tool) {
    return tool == "make" ? shell("make -q >/dev/null 2>&1", folder_) == 0
                          : shell("ninja -n | grep -q 'no work'", folder_) == 0;
  };
  for (const std::string tool : {"make", "ninja"}) {
    if (shell("command -v " + tool + " >/dev/null") != 0) GTEST_SKIP() << "no " << tool;
    SCOPED_TRACE(tool);
    ASSERT_EQ(shell(tool == "ninja" ? "ninja >/dev/null" : "touch 'o $ #:.lsp'", folder_), 0);
    EXPECT_TRUE(is_new(tool));
    for (const char* changed : {"b.obj", "b #$:.mtl"}) {
      const fs::path path = folder_ / scene / changed;
      const fs::file_time_type before = fs::last_write_time(path);
      fs::last_write_time(path, fs::file_time_type::clock::now() + std::chrono::hours(1));
      EXPECT_FALSE(is_new(tool)) << changed;
      fs::last_write_time(path, before);
      EXPECT_TRUE(is_new(tool)) << changed;
    }
  }
}

TEST_F(LspBake, AMeshIsNotTheNameOfABake) {
  fs::copy(folder_ / "grid.obj", folder_ / "other.obj");
  EXPECT_EQ(run("-o other.obj grid.obj --base wide"), 1) << "as from -o *.obj";
  EXPECT_NE(read("err").find("other.obj: is the name of a mesh"), std::string::npos) << read("err");
  EXPECT_EQ(read("other.obj"), read("grid.obj"));
}

TEST_F(LspBake, ErrorsOfABakeNameItsInputAndARemedyThatIs) {
  const std::pair<const char*, const char*> cases[] = {{"--cells 4", "or split the mesh"},
                                                       {"--depth 4", "or lower --depth or --resolution"}};
  for (const auto& [options, remedy] : cases) {
    EXPECT_EQ(run("grid.obj -o a.lsp --memory-limit 10MiB " + std::string(options)), 6);
    EXPECT_NE(read("err").find("lsp-bake: grid.obj: the bake needs"), std::string::npos) << read("err");
    EXPECT_NE(read("err").find(remedy), std::string::npos) << read("err");
  }
  EXPECT_EQ(run(". -o a.lsp"), 2);
  EXPECT_NE(read("err").find("is a folder"), std::string::npos) << read("err");
  EXPECT_EQ(run("grid.obj -o a.lsp --no-line-spaces --samples 3"), 1);
}

TEST_F(LspBake, ADepfileHasNoNameOfTwoLines) {
  EXPECT_EQ(run("grid.obj -o 'a\nb.lsp' --base wide --depfile a.d"), 1);
  EXPECT_NE(read("err").find("has a line break in its name"), std::string::npos) << read("err");
  EXPECT_EQ(files(), 3u) << "neither the rule nor the bake is there";  // grid.obj, out and err
}

TEST_F(LspBake, KeepsWhatTheErrorAllows) {
  ASSERT_EQ(run("grid.obj -o a.lsp --base bvh --max-error 20 --json"), 0);
  EXPECT_LE(nlohmann::json::parse(read("out"))["error"]["wrong_percent"], 20.0);
  // Of cells it is the point of the dial that is chosen.
  for (const double allowed : {20.0, 0.5}) {
    ASSERT_EQ(run("grid.obj -o b.lsp --base cells --cells 4 --preset fast --json --max-error " +
                  std::to_string(allowed)),
              0);
    EXPECT_LE(nlohmann::json::parse(read("out"))["error"]["wrong_percent"], allowed);
  }
}

TEST_F(LspBake, WritesBinaryLineSpaces) {
  for (const char* base : {"bvh --depth 4", "ntree --levels 2"}) {
    SCOPED_TRACE(base);
    ASSERT_EQ(run(std::string("grid.obj -o a.lsp --for visibility --resolution 4 --base ") + base), 0);
    EXPECT_EQ(shell("lsp-validate --level geometry a.lsp", folder_), 0);
  }
}

TEST_F(LspBake, LeavesTheOldFileWholeWhenKilled) {
  ASSERT_EQ(run("grid.obj -o a.lsp --depth 4"), 0);
  const std::string before = read("a.lsp");
  for (const int signal : {SIGINT, SIGTERM, SIGKILL}) {
    const pid_t child = fork();
    if (child == 0) {
      if (chdir(folder_.c_str()) != 0) _exit(99);
      execl(kBake.c_str(), kBake.c_str(), "grid.obj", "-o", "a.lsp", "--resolution", "12", "--depth", "8",
            "--quiet", nullptr);
      _exit(99);
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(150));
    kill(child, signal);
    int status = 0;
    waitpid(child, &status, 0);
    ASSERT_TRUE(WIFSIGNALED(status)) << "the bake was over before it could be killed";
    EXPECT_TRUE(read("a.lsp") == before);
  }
}

TEST_F(LspBake, ReportsAFullDisk) {
  // No file may grow beyond 64 kB: the write fails as on a full disk.
  EXPECT_EQ(shell("trap '' XFSZ && ulimit -f 64 && lsp-bake grid.obj -o a.lsp --depth 4 --quiet 2>/dev/null",
                  folder_),
            2);
  EXPECT_EQ(files(), 1u) << "something was left behind";
}

}  // namespace
}  // namespace lsp::test
