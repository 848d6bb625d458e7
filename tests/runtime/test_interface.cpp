// The C interface beside files and rays: versions, statuses, and options that are not known.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <set>
#include <string>

#include "lsp/lsp.hpp"
#include "lsp/program.h"
#include "scene_builder.h"

namespace lsp::test {
namespace {

TEST(Interface, StatesOneVersion) {
  EXPECT_EQ(lsp_version(), uint32_t{LSP_LIBRARY_VERSION});
  EXPECT_STREQ(LSP_LIBRARY_VERSION_STRING, LSP_PROJECT_VERSION);
  EXPECT_STREQ(kProgramVersion, LSP_PROJECT_VERSION);
  EXPECT_EQ(std::to_string(LSP_LIBRARY_VERSION_MAJOR) + "." + std::to_string(LSP_LIBRARY_VERSION_MINOR) +
                "." + std::to_string(LSP_LIBRARY_VERSION_PATCH),
            LSP_PROJECT_VERSION);
#if LSP_LIBRARY_VERSION < LSP_MAKE_VERSION(0, 1, 0) || LSP_LIBRARY_VERSION >= LSP_MAKE_VERSION(1000, 0, 0)
#error "not comparable"
#endif
}

TEST(Interface, NamesEveryStatus) {
  std::set<std::string> names;
  for (const lsp_status status : {LSP_OK, LSP_ERROR_FILE, LSP_ERROR_INVALID, LSP_ERROR_UNSUPPORTED,
                                  LSP_ERROR_LIMIT, static_cast<lsp_status>(4)})
    EXPECT_TRUE(names.insert(lsp_status_string(status)).second) << lsp_status_string(status);
  EXPECT_TRUE(names.count("unknown status"));
  // Instances answer it, too, where no file is at fault.
  EXPECT_STREQ(lsp_status_string(LSP_ERROR_INVALID), "not valid");
}

TEST(Interface, RefusesOptionsThatItDoesNotKnow) {
  Bytes bytes = write_raw(build_parts({}));
  lsp_scene scene;
  ASSERT_EQ(lsp_open(bytes.data(), bytes.size(), &scene, nullptr), LSP_OK);
  const LspRay ray = {{0, 0, -9}, 0, {0, 0, 1}, 100};
  LspHit hit = {};
  hit.primitive = 77;
  lsp_trace_counts counts = {};
  lsp_error error;
  const auto trace = [&](const lsp_trace_options& options) {
    return lsp_trace(&scene, &options, &ray, &hit, 1, &counts, &error);
  };
  EXPECT_EQ(trace({LSP_TRACE_APPROXIMATE | 0x40u, 0}), LSP_ERROR_UNSUPPORTED);
  EXPECT_NE(std::string(error.message).find("flags 0x40"), std::string::npos) << error.message;
  EXPECT_EQ(trace({0, 0, LSP_QUALITY_COUNT}), LSP_ERROR_UNSUPPORTED);
  EXPECT_NE(std::string(error.message).find("quality 3"), std::string::npos) << error.message;
  EXPECT_EQ(hit.primitive, 77u) << "nothing is traced";
  EXPECT_EQ(counts.rays, 0u);
  EXPECT_EQ(
      trace({LSP_TRACE_ALL_FLAGS | LSP_TRACE_MAX_LOSS | LSP_TRACE_OCCLUSION, 0, LSP_QUALITY_ACCURATE, 5}),
      LSP_OK);
  EXPECT_EQ(counts.rays, 1u);
}

// Of numbers out of their range a trace would be one that nobody asked for.
TEST(Interface, RefusesNumbersThatSayNothing) {
  Bytes bytes = write_raw(build_parts({}));
  lsp_scene scene;
  ASSERT_EQ(lsp_open(bytes.data(), bytes.size(), &scene, nullptr), LSP_OK);
  const LspRay ray = {{0, 0, -9}, 0, {0, 0, 1}, 100};
  LspHit hit = {};
  hit.primitive = 77;
  lsp_error error;
  const auto trace = [&](float lod, uint32_t flags, float max_loss) {
    const lsp_trace_options options{LSP_TRACE_APPROXIMATE | flags, lod, 0, max_loss};
    return lsp_trace(&scene, &options, &ray, &hit, 1, nullptr, &error);
  };
  for (const float lod : {NAN, -0.5f, INFINITY}) {
    EXPECT_EQ(trace(lod, 0, 0), LSP_ERROR_INVALID) << lod;
    EXPECT_EQ(std::string(error.message).rfind("lod is ", 0), 0u) << error.message;
  }
  for (const float max_loss : {NAN, -1.0f, 100.5f, INFINITY}) {
    EXPECT_EQ(trace(0, LSP_TRACE_MAX_LOSS, max_loss), LSP_ERROR_INVALID) << max_loss;
    EXPECT_EQ(std::string(error.message).rfind("max_loss is ", 0), 0u) << error.message;
    lsp_instances none{};
    const lsp_trace_options options{LSP_TRACE_MAX_LOSS, 0, 0, max_loss};
    EXPECT_EQ(lsp_trace_instances(&none, &options, 255, &ray, &hit, 1, nullptr, &error), LSP_ERROR_INVALID);
    LspHit cpp_hit[1];
    EXPECT_THROW(lsp::trace(scene, options, std::array{ray}, cpp_hit), lsp::Error);
  }
  EXPECT_EQ(hit.primitive, 77u) << "nothing is traced";
  EXPECT_EQ(trace(0, 0, NAN), LSP_OK) << "max_loss is not asked for";
  EXPECT_EQ(trace(1, LSP_TRACE_MAX_LOSS, 100), LSP_OK);
}

// One lsp_error serves call after call: what an earlier one said must not be read as the last one's.
TEST(Interface, SuccessClearsTheError) {
  Bytes bytes = write_raw(build_parts({}));
  lsp_scene scene;
  ASSERT_EQ(lsp_open(bytes.data(), bytes.size(), &scene, nullptr), LSP_OK);
  const LspRay ray = {{0, 0, -9}, 0, {0, 0, 1}, 100};
  LspHit hit;
  const lsp_trace_options exact = {}, approximate = {LSP_TRACE_APPROXIMATE, 0};
  const lsp_scene* const assets[] = {&scene};
  const lsp_instance place = {0, {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0}, 255, 0};
  alignas(16) unsigned char memory[512];
  lsp_instances instances;
  ASSERT_EQ(lsp_instances_build(assets, 1, &place, 1, memory, sizeof memory, &instances, nullptr), LSP_OK);
  const auto clears = [](auto call) {
    lsp_error error = {LSP_ERROR_FILE, 7, "an earlier failure"};
    return call(&error) == LSP_OK && error.status == LSP_OK && error.offset == 0 && error.message[0] == 0;
  };
  for (const uint64_t count : {0, 1}) {
    for (const lsp_trace_options* options : {&exact, &approximate}) {
      EXPECT_TRUE(clears(
          [&](lsp_error* error) { return lsp_trace(&scene, options, &ray, &hit, count, nullptr, error); }));
      EXPECT_TRUE(clears([&](lsp_error* error) {
        return lsp_trace_instances(&instances, options, 255, &ray, &hit, count, nullptr, error);
      }));
    }
  }
}

// A quality's dial is the file's, in sixteenths of a class; a loss between two limits is between two classes.
TEST(Interface, DialCountsInParts) {
  LspHeader header{};
  header.quality[LSP_QUALITY_BALANCED] = LSP_HEEDS(3u, 5u);
  header.quality_part[LSP_QUALITY_BALANCED] = LSP_HEEDS(8u, 15u);
  header.quality[LSP_QUALITY_FAST] = LSP_HEEDS_TABLES;
  const uint32_t reference = 0;
  lsp_scene scene = {};
  scene.header = &header;
  lsp_trace_options options = {};
  options.flags = LSP_TRACE_APPROXIMATE;
  EXPECT_EQ(lsp_dial(&scene, &options), uint32_t{LSP_DIAL_TABLES}) << "no exact data";
  scene.cell_references = &reference;
  EXPECT_EQ(lsp_dial(&scene, &options), (3u * 16 + 8) | (5u * 16 + 15) << 8);
  options.quality = LSP_QUALITY_FAST;
  EXPECT_EQ(lsp_dial(&scene, &options), uint32_t{LSP_DIAL_TABLES});

  options.flags |= LSP_TRACE_MAX_LOSS;
  const std::pair<float, uint32_t> dials[] = {{0.0f, 0},   {0.5f, 24},  {1.0f, 32},   {2.0f, 48},  {3.5f, 56},
                                              {10.0f, 80}, {20.0f, 96}, {60.0f, 104}, {99.9f, 111}};
  for (const auto& [loss, parts] : dials) {
    options.max_loss = loss;
    EXPECT_EQ(lsp_dial(&scene, &options), LSP_HEEDS(parts, parts)) << loss;
  }
  options.max_loss = 100;
  EXPECT_EQ(lsp_dial(&scene, &options), uint32_t{LSP_DIAL_TABLES});
}

TEST(Interface, OffsetIsLargerWhereATableAnswered) {
  LspHeader header = {};
  header.bounds_max = {3, 4, 12};
  lsp_scene scene = {};
  scene.header = &header;
  LspHit hit = {};
  EXPECT_FLOAT_EQ(lsp_hit_offset(&scene, &hit), 13 * LSP_OFFSET_EXACT);
  hit.flags = LSP_HIT_LINE_SPACE;
  EXPECT_FLOAT_EQ(lsp_hit_offset(&scene, &hit), 13 * LSP_OFFSET_LINE_SPACE);
  header.cells.size = 0.5f;
  EXPECT_FLOAT_EQ(lsp_hit_offset(&scene, &hit), 0.5f * LSP_OFFSET_CELL);
}

}  // namespace
}  // namespace lsp::test
