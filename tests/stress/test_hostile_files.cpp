// Mesh files made to cost an importer more than they are worth: each ends in seconds, within the memory
// limit, with a mesh or with the exit code that says what is wrong. Each is read in a process of its own,
// which the kernel would end if it went on.
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <bit>
#include <cmath>
#include <cstring>
#include <fstream>
#include <functional>
#include <iostream>
#include <string>

#include "import/import.h"
#include "lsp/program.h"
#include "sanitizer.h"

namespace lsp::stress {
namespace {

#ifdef LSP_ADDRESS_SANITIZER
constexpr double kSeconds = 60;
constexpr bool kMeasuresMemory = false;  // the sanitizer's own is in it
#else
constexpr double kSeconds = 10;
constexpr bool kMeasuresMemory = true;
#endif
constexpr uint64_t kMemoryLimit = uint64_t{1} << 30;

struct Hostile {
  const char* name;
  const char* extension;
  std::function<std::string()> make;
  std::vector<Exit> may_end_with;
};

std::string repeated(const std::string& text, size_t times) {
  std::string out;
  out.reserve(text.size() * times);
  for (size_t i = 0; i < times; ++i) out += text;
  return out;
}

// A glTF document around a buffer of 36 zeroes and more: `members` are those of the root, commas in front.
std::string gltf(const std::string& members) { return R"({"asset":{"version":"2.0"})" + members + "}"; }
const std::string kBuffer =
    R"(,"buffers":[{"byteLength":36,"uri":"data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA"}],)"
    R"("bufferViews":[{"buffer":0,"byteLength":36}])";
const std::string kTriangle = R"({"bufferView":0,"componentType":5126,"count":3,"type":"VEC3"})";  // accessor
const std::string kMesh = R"(,"meshes":[{"primitives":[{"attributes":{"POSITION":0}}]}])";

// Positions that all fell into one slot of the table that welds them, when its hash had no key.
std::string colliding_stl(uint32_t count) {
  std::string out(80, ' ');
  const uint32_t triangles = count / 3;
  out.append(reinterpret_cast<const char*>(&triangles), 4);
  const auto fits = [](uint32_t bits) {
    const float value = std::abs(std::bit_cast<float>(bits));
    return value > 1e-3f && value < 1e3f;
  };
  uint32_t corner = 0;
  for (uint32_t z = std::bit_cast<uint32_t>(0.01f); corner < triangles * 3; ++z) {
    const uint64_t xy = 0x123456789ABCDEFull ^ uint64_t { z } * 0x9E3779B97F4A7C15ull;
    const uint32_t bits[3] = {uint32_t(xy >> 32), uint32_t(xy), z};
    if (!fits(bits[0]) || !fits(bits[1])) continue;
    if (corner % 3 == 0) out.append(12, '\0');
    out.append(reinterpret_cast<const char*>(bits), 12);
    if (++corner % 3 == 0) out.append(2, '\0');
  }
  return out;
}

std::string comb(size_t teeth) {
  std::string vertices, face = "f";
  for (size_t i = 0; i < teeth; ++i) {
    vertices += "v " + std::to_string(i) + " 0 0\nv " + std::to_string(i) + ".5 9 0\n";
    face += " " + std::to_string(2 * i + 1) + " " + std::to_string(2 * i + 2);
  }
  vertices += "v " + std::to_string(teeth) + " -1 0\nv -1 -1 0\n";
  return vertices + face + " " + std::to_string(2 * teeth + 1) + " " + std::to_string(2 * teeth + 2) + "\n";
}

std::string chain(size_t nodes) {
  std::string list = R"({"mesh":0})";
  for (size_t i = 1; i < nodes; ++i) list += R"(,{"children":[)" + std::to_string(i - 1) + "]}";
  return gltf(kBuffer + kMesh + R"(,"accessors":[)" + kTriangle + R"(],"nodes":[)" + list + "]");
}
std::string doubling(size_t levels) {
  std::string list = R"({"mesh":0})";
  for (size_t i = 1; i < levels; ++i)
    list += R"(,{"children":[)" + std::to_string(i - 1) + "," + std::to_string(i - 1) + "]}";
  return gltf(kBuffer + kMesh + R"(,"accessors":[)" + kTriangle + R"(],"nodes":[)" + list + "]");
}
// Accessor 0 as given, under one triangle's mesh.
std::string accessor(const std::string& text) {
  return gltf(kBuffer + kMesh + R"(,"accessors":[)" + text + R"(],"nodes":[{"mesh":0}])");
}
// Many primitives of one mesh, the first with a triangle, and instances of them.
std::string instanced(const std::string& more, size_t primitives, size_t instances) {
  return gltf(
      kBuffer + R"(,"accessors":[)" + kTriangle + R"(,{"componentType":5126,"type":"VEC3","count":)" +
      std::to_string(instances) +
      R"(},{"componentType":5126,"count":1000000,"type":"VEC3"},{"componentType":5125,"count":2,"type":"SCALAR"},)"
      R"({"componentType":5125,"count":3,"type":"SCALAR"}],"meshes":[{"primitives":[{"attributes":{"POSITION":0}})" +
      repeated("," + more, primitives) +
      R"(]}],"nodes":[{"mesh":0,"extensions":{"EXT_mesh_gpu_instancing":{"attributes":{"TRANSLATION":1}}}}])");
}

// A table. NOLINTNEXTLINE(readability-function-size)
const std::vector<Hostile>& files() {
  using enum Exit;
  static const std::vector<Hostile> all = {
      {"json_a_million_deep",
       ".gltf",
       [] { return gltf(R"(,"extras":)" + std::string(1000000, '[')); },
       {kInvalid}},
      {"json_of_ten_million_nodes",
       ".gltf",
       [] { return gltf(R"(,"nodes":[{})" + repeated(",{}", 10000000) + "]"); },
       {kLimit}},
      {"json_string_of_64_mb",
       ".gltf",
       [] { return gltf(R"(,"extras":")" + std::string(64 << 20, 'x') + "\""); },
       {kInvalid}},
      {"json_number_of_8_mb",
       ".gltf",
       [] { return gltf(R"(,"buffers":[{"byteLength":)" + std::string(8 << 20, '1') + "}]"); },
       {kInvalid}},
      {"json_a_million_equal_keys",
       ".gltf",
       [] { return gltf(repeated(R"(,"extras":1)", 1000000)); },
       {kInvalid, kLimit}},
      {"nodes_in_a_chain_of_100000", ".gltf", [] { return chain(100000); }, {kDone}},
      {"nodes_that_double_60_times", ".gltf", [] { return doubling(60); }, {kLimit}},
      {"nodes_that_double_22_times", ".gltf", [] { return doubling(23); }, {kDone, kLimit}},
      {"accessor_of_4_gb_over_36_bytes",
       ".gltf",
       [] { return accessor(R"({"bufferView":0,"componentType":5126,"count":4294967295,"type":"VEC3"})"); },
       {kInvalid, kLimit}},
      {"accessor_of_4_gb_over_nothing",
       ".gltf",
       [] { return accessor(R"({"componentType":5126,"count":4294967295,"type":"VEC3"})"); },
       {kLimit}},
      {"sparse_accessor_over_nothing",
       ".gltf",
       [] {
         return accessor(
             R"({"componentType":5126,"count":4000000000,"type":"VEC3","sparse":{"count":1,"indices":{"bufferView":0,"componentType":5125},"values":{"bufferView":0}}})");
       },
       {kLimit}},
      {"sparse_accessor_of_4_gb",
       ".gltf",
       [] {
         return accessor(
             R"({"bufferView":0,"componentType":5126,"count":3,"type":"VEC3","sparse":{"count":4294967295,"indices":{"bufferView":0,"componentType":5125},"values":{"bufferView":0}}})");
       },
       {kInvalid, kLimit}},
      {"primitives_over_one_large_buffer",
       ".gltf",
       [] { return instanced(R"({"attributes":{"POSITION":2},"indices":4})", 10000, 1); },
       {kLimit}},
      {"primitives_without_triangles_instanced",
       ".gltf",
       [] { return instanced(R"({"attributes":{"POSITION":0},"indices":3})", 20000, 1000000); },
       {kDone, kInvalid, kLimit}},
      {"obj_line_of_32_mb",
       ".obj",
       [] { return "v 1 2 3\nf " + std::string(32 << 20, '1') + "\n"; },
       {kInvalid}},
      {"obj_number_of_8_mb",
       ".obj",
       [] { return "v " + std::string(8 << 20, '1') + " 2 3\nv 0 0 0\nv 1 0 0\nf 1 2 3\n"; },
       {kInvalid}},
      {"obj_face_of_four_million_corners",
       ".obj",
       [] { return "v 1 2 3\nf" + repeated(" 1", 4000000) + "\n"; },
       {kInvalid}},
      {"obj_concave_polygon_of_200000_corners", ".obj", [] { return comb(100000); }, {kDone}},
      {"obj_a_million_continuations",
       ".obj",
       [] { return "v 0 0 0\nf" + repeated(" 1\\\n", 1000000); },
       {kInvalid}},
      {"obj_a_million_libraries",
       ".obj",
       [] { return repeated("mtllib a b c d\n", 1000000) + "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"; },
       {kDone}},
      {"ply_of_four_billion_vertices",
       ".ply",
       [] {
         return std::string(
             "ply\nformat ascii 1.0\nelement vertex 4294967295\nproperty float x\nproperty float y\n"
             "property float z\nend_header\n0 0 0\n");
       },
       {kInvalid, kLimit}},
      {"ply_list_of_four_billion",
       ".ply",
       [] {
         return std::string(
                    "ply\nformat binary_little_endian 1.0\nelement face 1\nproperty list uint int "
                    "vertex_indices\nend_header\n") +
                std::string(8, '\xFF');
       },
       {kInvalid, kLimit}},
      {"ply_of_a_million_elements",
       ".ply",
       [] {
         return "ply\nformat ascii 1.0\n" + repeated("element a 18446744073709551615\n", 1000) +
                repeated("element a 9223372036854775807\n", 1000000) + "end_header\n";
       },
       {kInvalid, kLimit}},
      {"stl_of_four_billion_triangles",
       ".stl",
       [] { return std::string(80, ' ') + std::string(4, '\xFF') + std::string(50, '\0'); },
       {kInvalid}},
      {"stl_of_colliding_positions", ".stl", [] { return colliding_stl(300000); }, {kDone}},
      {"off_of_four_billion_vertices",
       ".off",
       [] { return std::string("OFF\n4294967295 4294967295 0\n0 0 0\n"); },
       {kInvalid, kLimit}},
      {"binary_off_of_four_billion_vertices",
       ".off",
       [] { return "OFF BINARY\n" + std::string(12, '\xFF') + std::string(1000, '\0'); },
       {kInvalid}},
      {"binary_off_of_ten_million_empty_faces",
       ".off",
       [] {
         return std::string("OFF BINARY\n\0\0\0\0\0\x98\x96\x80\0\0\0\0", 23) + std::string(80'000'000, '\0');
       },
       {kInvalid, kLimit}},
      {"off_face_of_four_billion_corners",
       ".off",
       [] { return std::string("OFF\n1 1 0\n0 0 0\n4294967295 0 0 0\n"); },
       {kInvalid}},
  };
  return all;
}

void PrintTo(const Hostile& file, std::ostream* out) { *out << file.name; }

class HostileFiles : public testing::TestWithParam<Hostile> {};

TEST_P(HostileFiles, EndInTimeAndMemoryWithTheRightExitCode) {
  const Hostile& hostile = GetParam();
  const std::filesystem::path path = std::filesystem::temp_directory_path() /
                                     ("lsp_hostile_" + std::to_string(getpid()) + hostile.extension);
  {
    const std::string bytes = hostile.make();
    std::ofstream(path, std::ios::binary).write(bytes.data(), std::streamsize(bytes.size()));
  }
  const pid_t child = fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    const rlimit seconds{rlim_t(kSeconds) + 1, rlim_t(kSeconds) + 1};
    setrlimit(RLIMIT_CPU, &seconds);
    int code = int(Exit::kInternal);
    try {
      import_meshes({&path, 1}, {.memory_limit = kMemoryLimit});
      code = int(Exit::kDone);
    } catch (const Failure& failure) {
      code = int(failure.exit());
      const std::string what = failure.what();
      if (what.empty() || what.size() > 1000) code = int(Exit::kInternal);
    }
    _exit(code);
  }
  int status = 0;
  rusage used{};
  ASSERT_EQ(wait4(child, &status, 0, &used), child);
  std::filesystem::remove(path);
  ASSERT_TRUE(WIFEXITED(status)) << "ended by signal " << WTERMSIG(status);
  const auto code = Exit(WEXITSTATUS(status));
  EXPECT_NE(std::find(hostile.may_end_with.begin(), hostile.may_end_with.end(), code),
            hostile.may_end_with.end())
      << "exit code " << int(code);
  const double seconds = double(used.ru_utime.tv_sec + used.ru_stime.tv_sec) +
                         1e-6 * double(used.ru_utime.tv_usec + used.ru_stime.tv_usec);
  EXPECT_LT(seconds, kSeconds);
  const uint64_t bytes = uint64_t(used.ru_maxrss) * 1024;
  if (kMeasuresMemory) {
    EXPECT_LT(bytes, kMemoryLimit);
  }
  std::cout << "exit " << int(code) << ", " << seconds << " s, " << (bytes >> 20) << " MiB\n";
}

INSTANTIATE_TEST_SUITE_P(Import, HostileFiles, testing::ValuesIn(files()),
                         [](const auto& given) { return given.param.name; });

}  // namespace
}  // namespace lsp::stress
