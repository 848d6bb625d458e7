// lsp-info --annotate accounts for every byte: of the corpus, of every prefix of a file, of damaged files.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "annotate.h"
#include "cells_scenes.h"
#include "mutations.h"
#include "mutator.h"
#include "ntree_scenes.h"
#include "scenes.h"
#include "summary.h"
#include "wide_scenes.h"

namespace {

using namespace lsp;
using namespace lsp::corpus;
using namespace lsp::format;

void expect_all_accounted(const Bytes& bytes, const std::string& context, const std::string& section = {}) {
  uint64_t at = 0;
  annotate(bytes, {section}, [&](const Range& range) {
    EXPECT_EQ(range.offset, at) << context;
    EXPECT_GT(range.bytes, 0u) << context << " at " << at;
    EXPECT_FALSE(range.path.empty() || range.meaning.find('\n') != std::string::npos)
        << context << " at " << at;
    at = range.offset + range.bytes;
  });
  EXPECT_EQ(at, bytes.size()) << context;
}

TEST(Annotate, EveryByteOfTheCorpus) {
  for (const ValidFile& file : valid_files()) {
    expect_all_accounted(file.bytes, file.name);
    expect_all_accounted(file.bytes, file.name, "NODE");
    expect_all_accounted(file.bytes, file.name, "CAND");
  }
  for (const InvalidFile& file : invalid_files()) expect_all_accounted(file.bytes, file.name);
}

TEST(Annotate, EveryByteOfEveryPrefix) {
  const Bytes bytes = encode(full_ntree_scene());
  for (size_t size = 0; size < bytes.size(); ++size)
    expect_all_accounted(Bytes(bytes.begin(), bytes.begin() + static_cast<ptrdiff_t>(size)),
                         std::to_string(size));
}

TEST(Annotate, EveryByteOfDamagedFiles) {
  const Bytes good[] = {encode(full_scene()), encode(full_ntree_scene()), encode(full_cells_scene()),
                        encode(full_wide_scene())};
  for (uint64_t seed = 0; seed < 10000; ++seed) {
    Bytes bytes = good[seed % 4];
    Random random(seed);
    mutate(bytes, random);
    expect_all_accounted(bytes, "seed " + std::to_string(seed));
  }
}

// In a sound file nothing is unknown, cut off or extra.
TEST(Annotate, SoundFilesHaveNoUnknownBytes) {
  for (const ValidFile& file : valid_files())
    annotate(file.bytes, {}, [&](const Range& range) {
      EXPECT_NE(range.path, "/unknown") << file.name;
      EXPECT_NE(range.path, "/extra") << file.name;
      EXPECT_EQ(range.meaning.find("cut off"), std::string::npos) << file.name;
    });
}

TEST(Annotate, OneSectionInFull) {
  size_t nodes = 0;
  annotate(encode(full_scene()), {"NODE"},
           [&](const Range& range) { nodes += range.path.starts_with("/sections/NODE/"); });
  EXPECT_EQ(nodes, full_scene().nodes.size());
}

TEST(Info, CountsOfTheTreeAddUp) {
  for (const ValidFile& file : valid_files()) {
    const auto json = summarize(file.bytes, file.name, uint64_t{1} << 26);
    uint64_t nodes = 0, line_spaces = 0;
    for (const auto& row : json["depths"]) {
      nodes += row["nodes"].get<uint64_t>();
      line_spaces += row["line_spaces"].get<uint64_t>();
    }
    EXPECT_EQ(nodes, json["counts"]["nodes"].get<uint64_t>() + json["counts"]["wide_nodes"].get<uint64_t>())
        << file.name;
    EXPECT_EQ(line_spaces, json["counts"]["line_spaces"]) << file.name;
    EXPECT_EQ(json["findings"], 0) << file.name;
    EXPECT_FALSE(summary_text(json, "").empty());
  }
}

TEST(Info, SaysWhatCellsAre) {
  const Image scene = full_cells_scene();
  const auto json = summarize(encode(scene), "cells", uint64_t{1} << 26);
  EXPECT_EQ(json["base"], "cells");
  EXPECT_EQ(json["features"].back(), "cells");
  const auto& cells = json["cells"];
  EXPECT_EQ(cells["grid"][0], scene.header.cells.cells_x);
  uint64_t entries = 0;
  for (const char* table : {"origin", "far"})
    for (const auto& [loss, count] : cells["entries"][table].items()) entries += count.get<uint64_t>();
  EXPECT_EQ(entries, 2 * scene.entries.size());
  EXPECT_TRUE(cells["exact_above_loss"]["fast"]["far"].is_null());
}

// In the words of lsp-bake's report; META is hostile.
TEST(Info, SaysWhatQualitiesErrAndGain) {
  Image scene = full_cells_scene();
  EXPECT_EQ(summary_text(summarize(encode(scene), "cells", uint64_t{1} << 26), "").find("% wrong"),
            std::string::npos);
  scene.meta = R"({"qualities": {
      "fast": {"wrong_percent": 1.25, "depth_error_percent_of_diagonal": 0.5,
               "ambient_occlusion_error_percent": 3, "light_error_percent": 4,
               "estimated_times_exact_rays": {"vulkan": 2.5, "cpu": 1.75}},
      "balanced": {"wrong_percent": "none", "light_error_percent": 1e300, "estimated_times_exact_rays": 7}}})";
  const std::string text = summary_text(summarize(encode(scene), "cells", uint64_t{1} << 26), "");
  EXPECT_NE(
      text.find("fast        1.2 % wrong, depth off by 0.5 %, ambient occlusion by 3.0 %, light by 4.0 %; "
                "about 2.5x exact rays on Vulkan, 1.8x on the CPU\n"),
      std::string::npos)
      << text;
  EXPECT_NE(text.find("balanced    ? % wrong, depth off by ? %, ambient occlusion by ? %, light by 1e+300 %; "
                      "about ?x exact rays on Vulkan, ?x on the CPU\n"),
            std::string::npos)
      << text;
}

TEST(Info, SaysWhatWideNodesAre) {
  const auto json = summarize(encode(full_wide_scene()), "wide", uint64_t{1} << 26);
  EXPECT_EQ(json["format"], "2.3");
  EXPECT_EQ(json["features"].back(), "wide");
  EXPECT_EQ(json["wide"]["nodes"], 4);
  EXPECT_EQ(json["wide"]["children_per_node"], 2.5);
  EXPECT_EQ(json["wide"]["leaves"], 7);
  EXPECT_EQ(json["wide"]["triangles_per_leaf"], 2.0);
  EXPECT_EQ(json["wide"]["depth"], full_wide_scene().header.max_depth);
  uint64_t leaves = 0, triangles = 0;
  for (const auto& row : json["depths"]) {
    leaves += row["leaves"].get<uint64_t>();
    triangles += row["triangles"].get<uint64_t>();
  }
  EXPECT_EQ(leaves, 7u);
  EXPECT_EQ(triangles, 14u);
  EXPECT_NE(summary_text(json, "").find("4 wide nodes of 2.50 children"), std::string::npos);
  std::string meaning;
  annotate(encode(full_wide_scene()), {"WNOD"}, [&](const Range& range) {
    if (range.path == "/sections/WNOD/0") meaning = range.meaning;
  });
  EXPECT_NE(
      meaning.find("children leaf of 4 from +0; node +0; none; leaf of 1 from +4; none; node +1; none; none"),
      std::string::npos)
      << meaning;
}

TEST(Info, SummarisesDamagedFiles) {
  const Bytes good[] = {encode(full_scene()), encode(full_ntree_scene()), encode(full_cells_scene()),
                        encode(full_wide_scene())};
  for (uint64_t seed = 0; seed < 10000; ++seed) {
    Bytes bytes = good[seed % 4];
    Random random(seed);
    mutate(bytes, random);
    try {
      summary_text(summarize(bytes, "damaged", uint64_t{1} << 26), "");
    } catch (const std::runtime_error&) {
      // Refused as no .lsp file, or as one of another version.
    }
  }
}

}  // namespace
