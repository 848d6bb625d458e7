// Damage of every kind, none of which may pass, fault or hang: cut files, flipped bits, extreme counts.
#include <gtest/gtest.h>

#include <cstring>

#include "cells_scenes.h"
#include "check.h"
#include "image.h"
#include "ntree_scenes.h"
#include "scenes.h"
#include "wide_scenes.h"

namespace {

using namespace lsp;
using namespace lsp::corpus;
using namespace lsp::format;

// A copy of exactly the right size, so that the sanitizers see any byte read beyond it.
Report check_exact(const Bytes& bytes, Level level = Level::kGeometry) {
  return check_file(Bytes(bytes), {.level = level, .memory_limit = uint64_t{1} << 26});
}

// Of every base structure: every test below runs on the full scene of each.
std::vector<Image> full_scenes() {
  return {full_scene(), full_ntree_scene(), full_cells_scene(), full_wide_scene(), wide_alone_scene()};
}

TEST(Damage, EveryPrefixOfAValidFileIsRefused) {
  for (const char* name :
       {"full", "packed", "ntree-full", "ntree-packed", "cells", "wide", "wide-packed", "wide-alone"}) {
    for (const ValidFile& file : valid_files()) {
      if (file.name != name) continue;
      for (size_t size = 0; size < file.bytes.size(); ++size) {
        const Bytes prefix(file.bytes.begin(), file.bytes.begin() + static_cast<ptrdiff_t>(size));
        ASSERT_NE(check_exact(prefix, Level::kContainer).verdict(), Verdict::kValid)
            << name << " cut to " << size;
        if (size % 7 != 0) continue;
        ASSERT_NE(check_exact(prefix).verdict(), Verdict::kValid) << name << " cut to " << size;
      }
    }
  }
}

// The hashes cover every byte but padding, and padding is checked to be zero.
TEST(Damage, EveryFlippedBitIsSeen) {
  for (const Image& scene : full_scenes()) {
    const Bytes good = encode(scene);
    for (size_t at = 0; at < good.size(); ++at) {
      Bytes bytes = good;
      bytes[at] ^= static_cast<std::byte>(1 << at % 8);
      const Report report = check_exact(bytes, Level::kContainer);
      ASSERT_FALSE(report.findings().empty()) << "byte " << at;
    }
  }
}

TEST(Damage, ExtraBytesAreRefused) {
  for (size_t extra : {1, 255, 256, 4096}) {
    Bytes bytes = encode(full_scene());
    bytes.resize(bytes.size() + extra);
    EXPECT_TRUE(check_exact(bytes).has(RuleId::kExtraBytes)) << extra;
  }
}

// Every 32-bit word of header and table, and every 64-bit field, set to extremes, with and without the hashes
// made right again: nothing may fault, and what changed a meaning may not pass unseen.
TEST(Damage, ExtremeValuesInHeaderAndTable) {
  for (const Image& scene : full_scenes()) {
    Bytes good = encode(scene);
    const size_t end = sizeof(LspHeader) + table_of(good).size() * sizeof(LspSection);
    for (size_t at = 0; at + 8 <= end; at += 4)
      for (uint64_t value :
           {uint64_t{0}, uint64_t{1}, uint64_t{0x7FFFFFFF}, uint64_t{0x80000000}, uint64_t{0xFFFFFFFF},
            ~uint64_t{0}, ~uint64_t{255}, uint64_t{1} << 63, uint64_t{1} << 58})
        for (size_t width : {4, 8})
          for (bool repaired : {false, true}) {
            Bytes bytes = good;
            std::memcpy(bytes.data() + at, &value, width);
            if (repaired) repair_hashes(bytes);
            if (bytes == good) continue;
            const Report report = check_exact(bytes);
            ASSERT_TRUE(repaired || report.verdict() != Verdict::kValid)
                << at << " " << value << " " << width;
          }
  }
}

// The same over the sections: any word of any section.
TEST(Damage, ExtremeValuesInSections) {
  for (const Image& scene : full_scenes()) {
    Bytes good = encode(scene);
    const size_t first = sizeof(LspHeader) + table_of(good).size() * sizeof(LspSection);
    for (size_t at = first; at + 4 <= good.size(); at += 4)
      for (uint32_t value : {0u, 1u, 0x7F800000u, 0x7FC00000u, 0x80000000u, 0xFFFFFFFFu}) {
        Bytes bytes = good;
        std::memcpy(bytes.data() + at, &value, 4);
        repair_hashes(bytes);
        check_exact(bytes);
      }
  }
}

TEST(Damage, ZeroCounts) {
  Bytes bytes = encode(full_scene());
  header_of(bytes).section_count = 0;
  repair_hashes(bytes);
  EXPECT_TRUE(check_exact(bytes).has(RuleId::kMissingSection));

  Sections empty;
  empty.header = full_scene().header;
  empty.header.alignment = 256;
  const Report report = check_exact(encode(empty));
  EXPECT_NE(report.verdict(), Verdict::kValid) << "root 0 without nodes";
}

TEST(Damage, SwappedSections) {
  for (const Image& scene : full_scenes()) {
    const Sections good = to_sections(scene);
    for (size_t a = 0; a < good.sections.size(); ++a)
      for (size_t b = a + 1; b < good.sections.size(); ++b) {
        Sections swapped = good;
        std::swap(swapped.sections[a], swapped.sections[b]);
        EXPECT_TRUE(check_exact(encode(swapped)).has(RuleId::kSectionOrder)) << a << " " << b;
        Bytes bytes = encode(good);
        std::swap(table_of(bytes)[a].offset, table_of(bytes)[b].offset);
        repair_hashes(bytes);
        EXPECT_NE(check_exact(bytes).verdict(), Verdict::kValid) << a << " " << b;
      }
  }
}

TEST(Damage, EveryPairOfSectionsOverlapping) {
  for (const Image& scene : full_scenes()) {
    const Bytes good = encode(scene);
    const size_t sections = to_sections(scene).sections.size();
    for (size_t a = 0; a < sections; ++a)
      for (size_t b = 0; b < sections; ++b) {
        if (a == b) continue;
        Bytes bytes = good;
        table_of(bytes)[a].offset = table_of(bytes)[b].offset;
        repair_hashes(bytes);
        // A long section moved to the place of the last one ends behind the file instead.
        const Report report = check_exact(bytes);
        EXPECT_TRUE(report.has(RuleId::kSectionOverlap) || report.has(RuleId::kSectionOutside))
            << a << " " << b;
      }
  }
}

// A section that is misaligned and counted wrong at once must not be read in place.
TEST(Damage, MisalignedSections) {
  for (const Image& scene : full_scenes())
    for (size_t section = 0; section < to_sections(scene).sections.size(); ++section)
      for (bool counted : {true, false}) {
        Bytes bytes = encode(scene);
        table_of(bytes)[section].offset -= 1;
        if (!counted) {
          LspHeader& h = header_of(bytes);
          h.line_space_count = h.node_count = h.cell_count = h.reference_count = h.wide_node_count = 0;
        }
        repair_hashes(bytes);
        EXPECT_TRUE(check_exact(bytes).has(RuleId::kSectionMisaligned)) << section;
      }
}

TEST(Damage, OffsetsNearTheEndOfTheNumbers) {
  for (uint64_t offset : {~uint64_t{0}, ~uint64_t{255}, uint64_t{1} << 63, (uint64_t{1} << 63) - 256}) {
    Bytes bytes = encode(full_scene());
    for (LspSection& section : table_of(bytes)) section.offset = offset;
    repair_hashes(bytes);
    EXPECT_TRUE(check_exact(bytes).has(RuleId::kSectionOutside)) << offset;
    bytes = encode(full_scene());
    header_of(bytes).section_table_offset = offset;
    EXPECT_TRUE(check_exact(bytes).has(RuleId::kTableOffset)) << offset;
  }
}

// Many Line Spaces that claim the same, largest tables: the check may not take longer than the file is large.
TEST(Damage, ManyLineSpacesOverTheSameWords) {
  Image image = full_scene();
  image.bit_words.resize(960000, {0, 0});
  LspLineSpace space = image.line_spaces[0];
  space.format = 32 | 4 << LSP_FORMAT_ENTRY_SHIFT;
  space.word_first = 0;
  image.line_spaces.assign(20000, space);
  const Report report = check_exact(encode(image));
  EXPECT_TRUE(report.has(RuleId::kWordsNotCumulative));
  EXPECT_TRUE(report.has(RuleId::kWordsOutside) || report.has(RuleId::kWordsNotCumulative));
}

// A chain as deep as it is long: no recursion, and the depth is reported.
TEST(Damage, AChainOfAMillionNodes) {
  Image image = full_scene();
  const LspNode link = image.nodes[0];
  image.nodes.assign(1000000, link);
  for (size_t i = 0; i < image.nodes.size(); ++i) {
    image.nodes[i].child0 = static_cast<uint32_t>(i + 1);
    image.nodes[i].child1 = LSP_NONE;
    image.nodes[i].line_space0 = image.nodes[i].line_space1 = LSP_NONE;
  }
  image.nodes.back().child0 = LSP_LEAF_BIT;
  const Report report = check_exact(encode(image));
  EXPECT_TRUE(report.has(RuleId::kDepthExceeded));
}

// The same of wide nodes, each the only child of the one before it.
TEST(Damage, AChainOfAMillionWideNodes) {
  Image image = full_wide_scene();
  LspWideNode link = image.wide_nodes[0];
  for (uint32_t k = 0; k < LSP_WIDE_CHILDREN; ++k) {
    set_child(link, k, LSP_WIDE_NO_CHILD);
    set_planes(link, k, {255, 255, 255, 0, 0, 0});
  }
  set_child(link, 4, LSP_WIDE_NODE_BIT);
  set_planes(link, 4, {0, 0, 0, 255, 255, 255});
  image.wide_nodes.assign(1000000, link);
  for (size_t i = 0; i < image.wide_nodes.size(); ++i)
    image.wide_nodes[i].node_first = static_cast<uint32_t>(i + 1);
  set_child(image.wide_nodes.back(), 4, 13u << LSP_WIDE_LEAF_COUNT_SHIFT);
  const Report report = check_exact(encode(image));
  EXPECT_TRUE(report.has(RuleId::kDepthExceeded));
  EXPECT_TRUE(report.has(RuleId::kStackExceeded));
  EXPECT_FALSE(report.has(RuleId::kNotDepthFirst));
}

// Nodes that name themselves, or all the same block: each is visited once all the same.
TEST(Damage, WideNodesThatNameOneAnother) {
  for (uint32_t first : {0u, 1u, LSP_NONE, LSP_NONE - 3}) {
    Image image = full_wide_scene();
    LspWideNode node = image.wide_nodes[0];
    for (uint32_t k = 0; k < LSP_WIDE_CHILDREN; ++k) {
      set_child(node, k, LSP_WIDE_NODE_BIT | k);
      set_planes(node, k, {0, 0, 0, 255, 255, 255});
    }
    node.node_first = first;
    image.wide_nodes.assign(100000, node);
    const Report report = check_exact(encode(image));
    EXPECT_TRUE(report.has(RuleId::kNotDepthFirst)) << first;
    EXPECT_TRUE(report.has(RuleId::kChildOutOfRange)) << first;
  }
}

// The same of an NTree: nodes below nodes, each in the only cell of the one before it.
TEST(Damage, AnNTreeOfAMillionLevels) {
  Image image = full_ntree_scene();
  image.line_spaces.clear();
  image.bit_words.clear();
  image.candidates.clear();
  image.references.clear();
  image.grid.clear();
  image.cells.clear();
  for (uint32_t i = 0; i < 1000000; ++i) {
    image.grid.push_back({1, i});
    image.cells.push_back({i + 1, 0, LSP_NONE});
  }
  image.cells.back() = {LSP_LEAF_BIT, 0, LSP_NONE};
  EXPECT_TRUE(check_exact(encode(image)).has(RuleId::kNtreeTooDeep));
}

// Many leaves over the same references: told from the cells, without looking into the references of each.
TEST(Damage, ManyLeavesOverTheSameReferences) {
  Image image = ntree_scene({.branching = 16, .levels = 1});
  image.grid.resize(128 * 200);
  for (uint32_t w = 0; w < image.grid.size(); ++w) image.grid[w] = {~0u, w * 32};
  image.references.assign(300000, 0);
  image.cells.assign(4096 * 200, {LSP_LEAF_BIT, 300000, LSP_NONE});
  image.header.max_leaf_triangles = 300000;
  EXPECT_TRUE(check_exact(encode(image)).has(RuleId::kReferencesNotCumulative));
}

// Triangles that no leaf holds, each reaching into every node of a large tree: one walk into one node tells.
TEST(Damage, TrianglesEverywhereThatNoLeafHolds) {
  Image image = ntree_scene({.branching = 16, .levels = 2, .leaf_triangles = 1});
  LspTriangle wide = image.triangles[0];
  for (lsp_float3* v : {&wide.v0, &wide.v1, &wide.v2}) v->y = image.header.ntree_lo.y + 1.0f;
  const size_t before = image.triangles.size();
  for (uint32_t i = 0; i < 20000; ++i) {
    wide.primitive = static_cast<uint32_t>(image.triangles.size());
    image.triangles.push_back(wide);
  }
  image.header.primitive_count = image.triangles.size();
  const Report report = check_exact(encode(image));
  ASSERT_TRUE(report.has(RuleId::kCellLacksTriangle));
  EXPECT_EQ(report.findings().at(RuleId::kCellLacksTriangle).count, image.triangles.size() - before);
}

}  // namespace
