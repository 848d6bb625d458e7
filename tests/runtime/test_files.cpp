// Files on disk: what cannot be mapped, and what SceneFile makes of raw, packed and bad ones.
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>

#include "lsp/failures.hpp"
#include "lsp/lsp.h"
#include "lsp/scene_file.hpp"
#include "resident.h"
#include "scene_builder.h"

namespace lsp::test {
namespace {

class Files : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = std::filesystem::temp_directory_path() / ("lsp_test_files_" + std::to_string(getpid()));
    std::filesystem::create_directory(folder_);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }
  std::string write(const char* name, const Bytes& bytes) {
    const std::filesystem::path path = folder_ / name;
    std::ofstream(path, std::ios::binary)
        .write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
    return path.string();
  }
  // Of a program that opens it.
  static Exit exit_code(const std::string& path, uint64_t limit = UINT64_MAX) {
    try {
      with_failures([&] { SceneFile(path, limit); });
      return Exit::kDone;
    } catch (const Failure& failure) {
      EXPECT_EQ(failure.file(), path);
      EXPECT_STRNE(failure.what(), "");
      return failure.exit();
    }
  }
  std::filesystem::path folder_;
};

TEST_F(Files, WhatCannotBeMapped) {
  lsp_mapping mapping;
  lsp_error error;
  EXPECT_EQ(lsp_map_file((folder_ / "missing").c_str(), &mapping, &error), LSP_ERROR_FILE);
  EXPECT_NE(std::string(error.message).find("No such file"), std::string::npos) << error.message;
  EXPECT_EQ(lsp_map_file(folder_.c_str(), &mapping, &error), LSP_ERROR_FILE);
  EXPECT_NE(std::string(error.message).find("directory"), std::string::npos) << error.message;
  EXPECT_EQ(lsp_map_file("/dev/null", &mapping, &error), LSP_ERROR_FILE);
  EXPECT_EQ(lsp_map_file(write("empty", {}).c_str(), &mapping, &error), LSP_ERROR_INVALID);
  EXPECT_EQ(mapping.bytes, nullptr);
  lsp_unmap_file(&mapping);  // nothing to do, and no harm
}

// Pages that were read are given back; the scene stays open and answers as before.
TEST_F(Files, ReleasedPagesComeInAgain) {
  BuildOptions options;
  options.triangles = 20000;
  const std::string path = write("pages.lsp", write_raw(build_parts(options)));
  lsp_mapping mapping;
  lsp_scene scene;
  ASSERT_EQ(lsp_map_file(path.c_str(), &mapping, nullptr), LSP_OK);
  ASSERT_EQ(lsp_open(mapping.bytes, mapping.size, &scene, nullptr), LSP_OK);
  const auto sum = [&] {
    uint64_t sum = 0;
    for (uint64_t i = 0; i < mapping.size; ++i) sum += static_cast<const unsigned char*>(mapping.bytes)[i];
    return sum;
  };
  const uint64_t before = sum();
  EXPECT_GE(resident_bytes(mapping.bytes), mapping.size);
  lsp_release_pages(&mapping);
  EXPECT_EQ(resident_bytes(mapping.bytes), 0u);
  EXPECT_EQ(scene.header->triangle_count, options.triangles);
  EXPECT_LT(resident_bytes(mapping.bytes), mapping.size);  // with neighbours of the page that was read
  EXPECT_EQ(sum(), before);
  lsp_unmap_file(&mapping);
  lsp_release_pages(&mapping);  // nothing to do, and no harm
}

// Sections beyond 4 GiB, in a file that is mostly a hole.
TEST_F(Files, BeyondFourGibibytes) {
  constexpr uint64_t kHole = uint64_t{5} << 30;
  Bytes raw = write_raw(build_parts({}));
  const std::string small = write("small.lsp", raw), large = (folder_ / "large.lsp").string();
  const uint64_t size = raw.size();
  auto& header = *reinterpret_cast<LspHeader*>(raw.data());
  auto* table = reinterpret_cast<LspSection*>(raw.data() + header.section_table_offset);
  const uint64_t first = table[0].offset;
  header.file_bytes += kHole;
  for (uint32_t i = 0; i < header.section_count; ++i) table[i].offset += kHole;
  {
    std::ofstream out(large, std::ios::binary);
    out.write(reinterpret_cast<const char*>(raw.data()), static_cast<std::streamsize>(first));
    out.seekp(static_cast<std::streamoff>(first + kHole));
    out.write(reinterpret_cast<const char*>(raw.data() + first), static_cast<std::streamsize>(size - first));
    if (!out) GTEST_SKIP() << "no file of 5 GiB here";
  }
  const SceneFile near_file(small), far_file(large);
  const LspHeader& h = near_file.scene().header[0];
  std::vector<LspRay> rays;
  for (int i = 0; i < 200; ++i) {
    const float a = 0.1f * static_cast<float>(i);
    rays.push_back({h.bounds_min, 0, {std::cos(a) + 1.1f, std::sin(a) + 1.1f, 1}, INFINITY});
  }
  for (const uint32_t flags : {0u, LSP_TRACE_APPROXIMATE}) {
    const lsp_trace_options options{flags, 0};
    std::vector<LspHit> a(rays.size()), b(rays.size());
    ASSERT_EQ(lsp_trace(&near_file.scene(), &options, rays.data(), a.data(), rays.size(), nullptr, nullptr),
              LSP_OK);
    ASSERT_EQ(lsp_trace(&far_file.scene(), &options, rays.data(), b.data(), rays.size(), nullptr, nullptr),
              LSP_OK);
    EXPECT_EQ(memcmp(a.data(), b.data(), a.size() * sizeof(LspHit)), 0);
  }
}

TEST_F(Files, RawIsMappedPackedIsUnpacked) {
  const Parts parts = build_parts({});
  const Bytes raw = write_raw(parts);
  const SceneFile mapped(write("raw.lsp", raw));
  EXPECT_FALSE(mapped.unpacked());
  EXPECT_EQ(mapped.bytes_mapped(), raw.size());
  const SceneFile unpacked(write("packed.lsp", write_packed(parts)));
  EXPECT_TRUE(unpacked.unpacked());
  EXPECT_EQ(unpacked.bytes_mapped(), 0u);
  ASSERT_EQ(unpacked.scene().size, raw.size());
  EXPECT_EQ(memcmp(unpacked.scene().bytes, mapped.scene().bytes, raw.size()), 0);
}

TEST_F(Files, ExitCodes) {
  const Parts parts = build_parts({});
  Bytes cut = write_raw(parts);
  cut.resize(cut.size() / 2);
  Bytes newer = write_raw(parts);
  header_of(newer).version_major = LSP_VERSION_MAJOR + 1;
  Bytes damaged = write_packed(parts);
  damaged[section_of(damaged, LSP_SECTION_NODE).offset + 9] ^= 0xFF;
  EXPECT_EQ(exit_code((folder_ / "missing.lsp").string()), Exit::kFile);
  EXPECT_EQ(exit_code(write("empty.lsp", {})), Exit::kInvalid);
  EXPECT_EQ(exit_code(write("cut.lsp", cut)), Exit::kInvalid);
  EXPECT_EQ(exit_code(write("newer.lsp", newer)), Exit::kUnsupported);
  EXPECT_EQ(exit_code(write("damaged.lsp", damaged)), Exit::kInvalid);
  EXPECT_EQ(exit_code(write("large.lsp", write_packed(parts)), 4096), Exit::kLimit);
}

}  // namespace
}  // namespace lsp::test
