// lsp_open and lsp_unpack accept good files and refuse every kind of bad one, for the reason that it is bad.
#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <cstring>
#include <functional>

#include "lsp/lsp.h"
#include "scene_builder.h"

namespace lsp::test {
namespace {

TEST(Open, GivesPointersIntoTheBytes) {
  Bytes bytes = write_raw(build_parts({}));
  lsp_scene scene;
  lsp_error error;
  ASSERT_EQ(lsp_open(bytes.data(), bytes.size(), &scene, &error), LSP_OK) << error.message;
  EXPECT_EQ(scene.bytes, bytes.data());
  EXPECT_EQ(static_cast<const void*>(scene.header), bytes.data());
  const auto at = [&](format::Kind kind) -> const void* {
    // Of the base structures the builder makes a BVH.
    if (info(kind).base == LSP_BASE_NTREE || info(kind).base == LSP_BASE_CELLS ||
        info(kind).base == LSP_BASE_WIDE)
      return nullptr;
    return bytes.data() + section_of(bytes, info(kind).type).offset;
  };
#define LSP_ARRAY_SECTION(Name, TYPE, code, Element, flag, base, feature, owed, member, ...) \
  EXPECT_EQ(static_cast<const void*>(scene.member), at(format::Kind::k##Name)) << #TYPE;
#include "lsp/sections.def"
}

TEST(Open, SectionsThatAreNotThereAreNull) {
  BuildOptions options;
  options.line_spaces = options.normals = options.materials = false;
  Bytes bytes = write_raw(build_parts(options));
  lsp_scene scene;
  ASSERT_EQ(lsp_open(bytes.data(), bytes.size(), &scene, nullptr), LSP_OK);
  EXPECT_NE(scene.nodes, nullptr);
  EXPECT_EQ(scene.normals, nullptr);
  EXPECT_EQ(scene.materials, nullptr);
  EXPECT_EQ(scene.line_spaces, nullptr);
  EXPECT_EQ(scene.bit_words, nullptr);
  EXPECT_EQ(scene.candidates, nullptr);
}

TEST(Open, EmptySceneAndSingleLeaf) {
  for (const uint32_t triangles : {0u, 1u, 3u}) {
    BuildOptions options;
    options.triangles = triangles;
    Bytes bytes = write_raw(build_parts(options));
    lsp_scene scene;
    lsp_error error;
    EXPECT_EQ(lsp_open(bytes.data(), bytes.size(), &scene, &error), LSP_OK)
        << triangles << ": " << error.message;
  }
}

TEST(Open, EveryAlignment) {
  for (const uint32_t alignment : {256u, 4096u, 65536u}) {
    BuildOptions options;
    options.alignment = alignment;
    Bytes bytes = write_raw(build_parts(options));
    lsp_scene scene;
    EXPECT_EQ(lsp_open(bytes.data(), bytes.size(), &scene, nullptr), LSP_OK) << alignment;
  }
}

TEST(Open, UnknownOptionalSectionAndNewerMinorVersionAreFine) {
  Bytes bytes = write_raw(build_parts({}));
  section_of(bytes, LSP_SECTION_META).type = 0x58585858;
  section_of(bytes, 0x58585858).element_bytes = 1;
  header_of(bytes).version_minor = 9;
  header_of(bytes).optional_features = 0xFFFFFFFF;
  lsp_scene scene;
  lsp_error error;
  EXPECT_EQ(lsp_open(bytes.data(), bytes.size(), &scene, &error), LSP_OK) << error.message;
}

// A file with one fault, and what is said of it.
struct Fault {
  const char* name;
  std::function<void(Bytes&)> make;
  lsp_status status;
  const char* message;  // a part of it
};

LspSection& node_section(Bytes& b) { return section_of(b, LSP_SECTION_NODE); }

const Fault kFaults[] = {
    {"cut", [](Bytes& b) { b.resize(b.size() - 1); }, LSP_ERROR_INVALID, "cut"},
    {"cut to a header", [](Bytes& b) { b.resize(sizeof(LspHeader)); }, LSP_ERROR_INVALID, "cut"},
    {"cut in the header", [](Bytes& b) { b.resize(sizeof(LspHeader) - 1); }, LSP_ERROR_INVALID,
     "shorter than a header"},
    {"no bytes", [](Bytes& b) { b.resize(0); }, LSP_ERROR_INVALID, ""},
    {"extended", [](Bytes& b) { b.resize(b.size() + 4096); }, LSP_ERROR_INVALID, "extended"},
    {"magic", [](Bytes& b) { b[0] ^= 1; }, LSP_ERROR_INVALID, "not an .lsp file"},
    {"magic tail", [](Bytes& b) { b[7] ^= 1; }, LSP_ERROR_INVALID, "not an .lsp file"},
    {"part of a bake", [](Bytes& b) { std::memcpy(&b[4], "PART", 4); }, LSP_ERROR_INVALID, "lsp-merge makes"},
    {"major version", [](Bytes& b) { header_of(b).version_major = 3; }, LSP_ERROR_UNSUPPORTED, "version 3.0"},
    {"required feature", [](Bytes& b) { header_of(b).required_features |= 0x40000000; },
     LSP_ERROR_UNSUPPORTED, "0x40000000"},
    {"header size", [](Bytes& b) { header_of(b).header_bytes = 512; }, LSP_ERROR_INVALID, "header of 512"},
    {"alignment not a power", [](Bytes& b) { header_of(b).alignment = 5000; }, LSP_ERROR_INVALID,
     "alignment"},
    {"alignment small", [](Bytes& b) { header_of(b).alignment = 128; }, LSP_ERROR_INVALID, "alignment"},
    {"alignment zero", [](Bytes& b) { header_of(b).alignment = 0; }, LSP_ERROR_INVALID, "alignment"},
    {"alignment huge", [](Bytes& b) { header_of(b).alignment = 1u << 31; }, LSP_ERROR_INVALID, "alignment"},
    {"table offset", [](Bytes& b) { header_of(b).section_table_offset = sizeof(LspHeader) + 8; },
     LSP_ERROR_INVALID, "section table"},
    {"table overflow", [](Bytes& b) { header_of(b).section_table_offset = ~0ull - 63; }, LSP_ERROR_INVALID,
     "section table"},
    {"section count", [](Bytes& b) { header_of(b).section_count = 0xFFFFFFFF; }, LSP_ERROR_LIMIT, "sections"},
    {"base structure", [](Bytes& b) { header_of(b).base_structure = 7; }, LSP_ERROR_INVALID,
     "base structure"},
    {"base against features", [](Bytes& b) { header_of(b).base_structure = LSP_BASE_NTREE; },
     LSP_ERROR_INVALID, "base structure"},
    {"bounds NaN", [](Bytes& b) { header_of(b).bounds_min.y = NAN; }, LSP_ERROR_INVALID, "not finite"},
    {"bounds infinite", [](Bytes& b) { header_of(b).bounds_max.z = INFINITY; }, LSP_ERROR_INVALID,
     "not finite"},
    {"tolerance", [](Bytes& b) { header_of(b).plane_tolerance = NAN; }, LSP_ERROR_INVALID, "not finite"},
    {"stack", [](Bytes& b) { header_of(b).max_stack = LSP_MAX_STACK + 1; }, LSP_ERROR_LIMIT, "stack"},
    {"steps", [](Bytes& b) { header_of(b).max_steps = 0xFFFFFFFF; }, LSP_ERROR_INVALID, "steps"},
    {"leaf size", [](Bytes& b) { header_of(b).max_leaf_triangles = 17; }, LSP_ERROR_INVALID, "leaves"},
    {"root node", [](Bytes& b) { header_of(b).root = header_of(b).node_count; }, LSP_ERROR_INVALID, "root"},
    {"root leaf",
     [](Bytes& b) {
       header_of(b).root = LSP_LEAF_BIT | (1u << LSP_LEAF_COUNT_SHIFT) | (header_of(b).triangle_count - 1);
     },
     LSP_ERROR_INVALID, "root"},
    {"root Line Space", [](Bytes& b) { header_of(b).root_line_space = header_of(b).line_space_count; },
     LSP_ERROR_INVALID, "root"},
    {"node count", [](Bytes& b) { header_of(b).node_count += 1; }, LSP_ERROR_INVALID, "NODE"},
    {"triangle count", [](Bytes& b) { header_of(b).triangle_count -= 1; }, LSP_ERROR_INVALID, "TRIA"},
    {"Line Space count", [](Bytes& b) { header_of(b).line_space_count += 1; }, LSP_ERROR_INVALID, "LSPC"},
    {"bit word count", [](Bytes& b) { header_of(b).bit_word_count += 1; }, LSP_ERROR_INVALID, "BITS"},
    {"candidate count", [](Bytes& b) { header_of(b).candidate_word_count = 0; }, LSP_ERROR_INVALID, "CAND"},
    {"material count", [](Bytes& b) { header_of(b).material_count = 9; }, LSP_ERROR_INVALID, "MATL"},
    {"feature bit missing", [](Bytes& b) { header_of(b).required_features &= ~LSP_FEATURE_LINE_SPACES; },
     LSP_ERROR_INVALID, "feature bit"},
    {"normals missing", [](Bytes& b) { section_of(b, LSP_SECTION_NRML).type = 0x58585858; },
     LSP_ERROR_INVALID, "NRML"},
    {"unknown required section",
     [](Bytes& b) {
       section_of(b, LSP_SECTION_META).flags = LSP_SECTION_REQUIRED;
       section_of(b, LSP_SECTION_META).type = 0x31574E46;
     },
     LSP_ERROR_UNSUPPORTED, "FNW1"},
    {"section twice", [](Bytes& b) { section_of(b, LSP_SECTION_META) = node_section(b); }, LSP_ERROR_INVALID,
     "twice"},
    {"overlap", [](Bytes& b) { section_of(b, LSP_SECTION_META).offset = node_section(b).offset; },
     LSP_ERROR_INVALID, "overlaps"},
    {"offset into the table", [](Bytes& b) { node_section(b).offset = 0; }, LSP_ERROR_INVALID,
     "inside the file"},
    {"offset beyond", [](Bytes& b) { node_section(b).offset = header_of(b).file_bytes; }, LSP_ERROR_INVALID,
     "inside the file"},
    {"offset overflow", [](Bytes& b) { node_section(b).offset = ~0ull - 4095; }, LSP_ERROR_INVALID,
     "inside the file"},
    {"offset unaligned", [](Bytes& b) { section_of(b, LSP_SECTION_META).offset += 64; }, LSP_ERROR_INVALID,
     "multiple of 4096"},
    {"stored size", [](Bytes& b) { node_section(b).stored_bytes += 64; }, LSP_ERROR_INVALID, "two sizes"},
    {"stored size overflow", [](Bytes& b) { node_section(b).stored_bytes = ~0ull; }, LSP_ERROR_INVALID,
     "inside the file"},
    {"element count overflow", [](Bytes& b) { node_section(b).element_count += 1ull << 58; },
     LSP_ERROR_INVALID, "add up"},
    {"element size",
     [](Bytes& b) {
       node_section(b).element_bytes = 32;
       node_section(b).element_count *= 2;
     },
     LSP_ERROR_INVALID, "elements of 32"},
    {"unknown codec", [](Bytes& b) { node_section(b).codec = 2; }, LSP_ERROR_UNSUPPORTED, "codec 2"},
    {"length unaligned",
     [](Bytes& b) {
       b.resize(b.size() + 16);
       header_of(b).file_bytes += 16;
     },
     LSP_ERROR_INVALID, "length"},
};

TEST(Open, RefusesEveryFaultByName) {
  const Bytes good = write_raw(build_parts({}));
  for (const Fault& fault : kFaults) {
    SCOPED_TRACE(fault.name);
    Bytes bytes = good;
    fault.make(bytes);
    lsp_scene scene;
    lsp_error error;
    EXPECT_EQ(lsp_open(bytes.data(), bytes.size(), &scene, &error), fault.status) << error.message;
    EXPECT_EQ(error.status, fault.status);
    EXPECT_NE(std::string(error.message).find(fault.message), std::string::npos) << error.message;
    EXPECT_EQ(scene.header, nullptr);
  }
}

TEST(Open, RefusesMisalignedBytes) {
  const Bytes good = write_raw(build_parts({}));
  Bytes bytes(good.size() + 16);
  memcpy(bytes.data() + 8, good.data(), good.size());
  lsp_scene scene;
  EXPECT_EQ(lsp_open(bytes.data() + 8, good.size(), &scene, nullptr), LSP_ERROR_INVALID);
}

// No single flipped bit of header or table makes the loader read outside (the sanitizers watch) or fail
// oddly.
TEST(Open, SurvivesEveryFlippedBitOfHeaderAndTable) {
  BuildOptions options;
  options.triangles = 40;
  const Bytes good = write_raw(build_parts(options));
  Bytes bytes = good;
  const size_t end = sizeof(LspHeader) + header_of(bytes).section_count * sizeof(LspSection);
  for (size_t i = 0; i < end * 8; ++i) {
    bytes[i / 8] ^= static_cast<unsigned char>(1u << (i % 8));
    lsp_scene scene;
    lsp_error error;
    const lsp_status status = lsp_open(bytes.data(), bytes.size(), &scene, &error);
    EXPECT_TRUE(status == LSP_OK || error.message[0] != '\0');
    if (status == LSP_OK) {
      const LspRay ray{{0, 0, -5}, 0, {0.1f, 0.2f, 1}, 100};
      LspHit hit;
      const lsp_trace_options trace{LSP_TRACE_APPROXIMATE, 0};
      lsp_trace(&scene, &trace, &ray, &hit, 1, nullptr, nullptr);
    }
    bytes[i / 8] = good[i / 8];
  }
}

TEST(Open, PackedFileSaysToUnpack) {
  const Bytes packed = write_packed(build_parts({}));
  lsp_scene scene;
  lsp_error error;
  EXPECT_EQ(lsp_open(packed.data(), packed.size(), &scene, &error), LSP_ERROR_UNSUPPORTED);
  EXPECT_NE(std::string(error.message).find("unpack"), std::string::npos);
}

}  // namespace
}  // namespace lsp::test
