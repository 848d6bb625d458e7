#include "mutations.h"

#define ZSTD_STATIC_LINKING_ONLY
#include <zstd.h>

#include <cmath>
#include <cstring>
#include <functional>
#include <limits>

#include "collector.h"
#include "hash.h"
#include "ntree_scenes.h"
#include "scenes.h"

namespace lsp::corpus {
namespace {

using format::RuleId;
constexpr float kInfinity = std::numeric_limits<float>::infinity();

void identification(Collector& c) {
  c.raw(RuleId::kTooShort, "the file ends after 255 bytes", [](Bytes& b) { b.resize(255); });
  c.header(RuleId::kBadMagic, "the first byte is 8A", [](LspHeader& h) { h.magic_0 += 1; });
  c.raw(RuleId::kTextDamage, "CR LF of the signature became LF", [](Bytes& b) { b.erase(b.begin() + 4); });
  c.header(RuleId::kOtherMajor, "version_major is 1", [](LspHeader& h) { h.version_major = 1; });
  c.header(RuleId::kNewerMinor, "version_minor is 9", [](LspHeader& h) { h.version_minor = 9; });
  c.header(RuleId::kUnknownRequired, "bit 31 of required_features is set",
           [](LspHeader& h) { h.required_features |= 0x80000000u; });
  c.header(RuleId::kUnknownOptional, "bit 0 of optional_features is set",
           [](LspHeader& h) { h.optional_features = 1; });
}

void header(Collector& c) {
  c.header(RuleId::kHeaderBytes, "header_bytes is 128", [](LspHeader& h) { h.header_bytes = 128; });
  c.header(RuleId::kTableOffset, "section_table_offset is 2^64 - 64",
           [](LspHeader& h) { h.section_table_offset = ~uint64_t{63}; });
  c.header(RuleId::kTableOutside, "section_count is 2^32 - 1",
           [](LspHeader& h) { h.section_count = 0xFFFFFFFFu; });
  c.raw(RuleId::kTruncated, "the last 256 bytes are missing",
        [](Bytes& b) { b.erase(b.end() - 256, b.end()); });
  c.raw(RuleId::kExtraBytes, "256 zero bytes follow", [](Bytes& b) { b.resize(b.size() + 256); });
  c.header(RuleId::kAlignment, "alignment is 512", [](LspHeader& h) { h.alignment = 512; });
  c.bytes(RuleId::kFileNotPadded, "the padding at the end is 16 bytes short", [](Bytes& b) {
    b.erase(b.end() - 16, b.end());
    header_of(b).file_bytes -= 16;
  });
  c.header(RuleId::kBaseStructure, "base_structure is 4", [](LspHeader& h) { h.base_structure = 4; });
  c.header(RuleId::kReservedNotZero, "reserved_0 is 1", [](LspHeader& h) { h.reserved_0 = 1; });
  c.header(RuleId::kBoundsNotFinite, "bounds_max.x is infinite",
           [](LspHeader& h) { h.bounds_max.x = kInfinity; });
  c.header(RuleId::kTolerances, "normal_angle_cos is NaN",
           [](LspHeader& h) { h.normal_angle_cos = std::nanf(""); });
  c.header(RuleId::kMaxStack, "max_stack is 97", [](LspHeader& h) { h.max_stack = 97; });
  c.header(RuleId::kMaxLeaf, "max_leaf_triangles is 17", [](LspHeader& h) { h.max_leaf_triangles = 17; });
  c.header(RuleId::kRootReference, "root is 1", [](LspHeader& h) { h.root = 1; });
  c.header(RuleId::kRootLineSpace, "root_line_space is line_space_count",
           [](LspHeader& h) { h.root_line_space = h.line_space_count; });
  c.header(RuleId::kNtreeParameters, "ntree_branching is 2 in a BVH",
           [](LspHeader& h) { h.ntree_branching = 2; });
  c.header(RuleId::kFeatureSection, "the feature bit NORMALS is clear",
           [](LspHeader& h) { h.required_features &= ~LSP_FEATURE_NORMALS; });
  c.header(RuleId::kNothingToTrace, "the feature bits EXACT and LINE_SPACES are clear",
           [](LspHeader& h) { h.required_features &= ~(LSP_FEATURE_EXACT | LSP_FEATURE_LINE_SPACES); });
  c.header(RuleId::kBakeParameters, "resolution is 33", [](LspHeader& h) { h.resolution = 33; });
  c.header(RuleId::kDepthBound, "max_depth is 97", [](LspHeader& h) { h.max_depth = 97; });
  c.header(RuleId::kAddressable, "node_count is 2^30 + 1",
           [](LspHeader& h) { h.node_count = (1u << 30) + 1; });
  c.header(RuleId::kStepsBound, "max_steps is 2^32 - 1", [](LspHeader& h) { h.max_steps = 0xFFFFFFFFu; });
  c.sections(RuleId::kSectionCount, "249 unknown optional sections are added", [](Sections& s) {
    for (uint32_t i = 0; i < 249; ++i) s.sections.push_back(make_section(0x30303078u + (i << 8), 0, 1, {}));
  });
}

void section_table(Collector& c) {
  const std::byte one{1};
  c.sections(RuleId::kUnknownRequiredSection, "a required section \"xNEW\" is added", [&](Sections& s) {
    s.sections.push_back(make_section(0x57454E78u, 1, 1, {&one, 1}));
  });
  c.sections(RuleId::kUnknownOptionalSection, "an optional section \"xNEW\" is added", [&](Sections& s) {
    s.sections.push_back(make_section(0x57454E78u, 0, 1, {&one, 1}));
  });
  c.sections(RuleId::kDuplicateSection, "MATL is there twice",
             [](Sections& s) { s.sections.insert(s.sections.begin() + 3, s.sections[3]); });
  c.sections(RuleId::kSectionOrder, "TRIA stands before NODE",
             [](Sections& s) { std::swap(s.sections[0], s.sections[1]); });
  c.bytes(RuleId::kSectionMisaligned, "the offset of META is 16 too large",
          [](Bytes& b) { section_of(b, LSP_SECTION_META).offset += 16; });
  c.bytes(RuleId::kSectionOutside, "the offset of META is near 2^64",
          [](Bytes& b) { section_of(b, LSP_SECTION_META).offset = ~uint64_t{255}; });
  c.bytes(RuleId::kSectionOverlap, "META has the offset of CAND",
          [](Bytes& b) { section_of(b, LSP_SECTION_META).offset = section_of(b, LSP_SECTION_CAND).offset; });
  c.bytes(RuleId::kElementBytes, "element_bytes of NODE is 32, its element_count is doubled", [](Bytes& b) {
    section_of(b, LSP_SECTION_NODE).element_bytes = 32;
    section_of(b, LSP_SECTION_NODE).element_count *= 2;
  });
  c.bytes(RuleId::kElementCount, "element_count of NODE is 2^58 + 1, whose product wraps",
          [](Bytes& b) { section_of(b, LSP_SECTION_NODE).element_count |= uint64_t{1} << 58; });
  c.bytes(RuleId::kStoredBytes, "stored_bytes of CAND is one less than bytes",
          [](Bytes& b) { section_of(b, LSP_SECTION_CAND).stored_bytes -= 1; });
  c.bytes(RuleId::kUnknownCodec, "the codec of META is 7",
          [](Bytes& b) { section_of(b, LSP_SECTION_META).codec = 7; });
  c.sections(RuleId::kMissingSection, "TRIA is left out",
             [](Sections& s) { s.sections.erase(s.sections.begin() + 1); });
  c.bytes(RuleId::kSectionFlags, "REQUIRED is set on META",
          [](Bytes& b) { section_of(b, LSP_SECTION_META).flags = LSP_SECTION_REQUIRED; });
  c.header(RuleId::kCountDiffers, "node_count is one more", [](LspHeader& h) { h.node_count += 1; });
  c.bytes(RuleId::kPaddingNotZero, "the last byte of the file is 1",
          [](Bytes& b) { b.back() = std::byte{1}; });
  c.bytes(RuleId::kGap, "META moves up by 256 bytes", [](Bytes& b) {
    LspSection& meta = section_of(b, LSP_SECTION_META);
    const Bytes data(b.begin() + static_cast<ptrdiff_t>(meta.offset), b.end());
    const uint64_t offset = meta.offset;
    meta.offset += 256;
    header_of(b).file_bytes += 256;
    b.resize(offset);
    b.resize(offset + 256);
    b.insert(b.end(), data.begin(), data.end());
  });
}

// A frame whose header declares `size` bytes and that holds one empty block.
Bytes bomb(uint64_t size) {
  Bytes frame(4 + 1 + 8 + 3);
  const uint32_t magic = ZSTD_MAGICNUMBER;
  std::memcpy(frame.data(), &magic, 4);
  frame[4] = std::byte{0xE0};  // single segment, eight bytes of content size, no checksum
  std::memcpy(frame.data() + 5, &size, 8);
  frame[13] = std::byte{1};  // last block, raw, of no bytes
  return frame;
}

Bytes frame_without_size(const Bytes& data) {
  ZSTD_CCtx* context = ZSTD_createCCtx();
  ZSTD_CCtx_setParameter(context, ZSTD_c_contentSizeFlag, 0);
  Bytes frame(ZSTD_compressBound(data.size()));
  frame.resize(ZSTD_compress2(context, frame.data(), frame.size(), data.data(), data.size()));
  ZSTD_freeCCtx(context);
  return frame;
}

void hashes_and_codec(Collector& c) {
  c.raw(RuleId::kHeaderHash, "the low bit of header_hash_lo is flipped",
        [](Bytes& b) { header_of(b).header_hash_lo ^= 1; });
  c.raw(RuleId::kSectionHash, "the last byte of META is a space instead of }", [](Bytes& b) {
    const LspSection& meta = section_of(b, LSP_SECTION_META);
    b[meta.offset + meta.bytes - 1] = std::byte{' '};
  });
  c.raw(RuleId::kContentHash, "the low bit of content_hash_lo is flipped, header_hash is right",
        [](Bytes& b) {
          LspHeader& h = header_of(b);
          h.content_hash_lo ^= 1;
          const format::Hash128 hash = format::header_hash(h, table_of(b));
          h.header_hash_lo = hash.lo;
          h.header_hash_hi = hash.hi;
        });
  c.frame(RuleId::kZstdFrame, "the frame of NODE lacks its last byte",
          [](Section& s) { s.stored.pop_back(); });
  c.frame(RuleId::kZstdContentSize, "the frame of NODE does not declare its content size",
          [](Section& s) { s.stored = frame_without_size(s.data); });
  c.frame(RuleId::kZstdTrailing, "NODE has two frames", [](Section& s) {
    const Bytes frame = s.stored;
    s.stored.insert(s.stored.end(), frame.begin(), frame.end());
  });
  c.frame(RuleId::kZstdBomb, "NODE claims to unfold from 16 bytes to 4 GiB", [](Section& s) {
    s.entry.element_count = uint64_t{1} << 26;
    s.entry.bytes = s.entry.element_count * sizeof(LspNode);
    s.stored = bomb(s.entry.bytes);
  });
  c.frame(RuleId::kMemoryLimit, "checked with a limit of 64 bytes", [](Section&) {},
          {"--memory-limit", "64"});
}

// The nodes of the full scene, for orientation: 0 has children 1 and 4; 1 has 2 and 3; 4 has 5 and 6; the
// children of 2, 3, 5 and 6 are leaves of two triangles, or one.
void tree(Collector& c) {
  c.image(RuleId::kChildOutOfRange, "child1 of node 0 is node_count",
          [](Image& i) { i.nodes[0].child1 = static_cast<uint32_t>(i.nodes.size()); });
  c.image(RuleId::kChildNotAfterParent, "child0 of node 1 is node 0: a cycle",
          [](Image& i) { i.nodes[1].child0 = 0; });
  c.image(RuleId::kTwoParents, "child1 of node 0 is node 1, like child0",
          [](Image& i) { i.nodes[0].child1 = i.nodes[0].child0; });
  c.image(RuleId::kUnreachable, "child1 of node 0 is a leaf, nothing refers to the subtree",
          [](Image& i) { i.nodes[0].child1 = LSP_LEAF_BIT; });
  c.image(RuleId::kNotDepthFirst, "the children of node 0 change places", [](Image& i) {
    LspNode& n = i.nodes[0];
    std::swap(n.child0, n.child1);
    std::swap(n.lo0, n.lo1);
    std::swap(n.hi0, n.hi1);
    std::swap(n.line_space0, n.line_space1);
  });
  c.image(RuleId::kLeafOutOfRange, "a leaf begins at triangle_count",
          [](Image& i) { i.nodes.back().child1 = LSP_LEAF_BIT | static_cast<uint32_t>(i.triangles.size()); });
  c.image(RuleId::kLeafTooLarge, "max_leaf_triangles is 1",
          [](Image& i) { i.header.max_leaf_triangles = 1; });
  c.image(RuleId::kLeafOrder, "the leaves of node 2 change places",
          [](Image& i) { std::swap(i.nodes[2].child0, i.nodes[2].child1); });
  c.image(RuleId::kTrianglesUnused, "TRIA and NRML have one element more", [](Image& i) {
    i.triangles.push_back(i.triangles.back());
    i.normals.push_back(i.normals.back());
  });
  c.image(RuleId::kDepthExceeded, "max_depth is 1", [](Image& i) { i.header.max_depth = 1; });
  c.image(RuleId::kStackExceeded, "max_stack is 1", [](Image& i) { i.header.max_stack = 1; });
  c.image(RuleId::kStepsExceeded, "max_steps is 3", [](Image& i) { i.header.max_steps = 3; });
  c.image(RuleId::kBoxOutsideParent, "hi1.y of node 1 is 1000", [](Image& i) { i.nodes[1].hi1.y = 1000; });
  c.image(RuleId::kBoxNotFinite, "lo0.x of node 1 is NaN",
          [](Image& i) { i.nodes[1].lo0.x = std::nanf(""); });
  c.image(RuleId::kChildMissing, "the child beside a terminal Line Space is none", [](Image& i) {
    const uint32_t space = i.nodes[1].line_space0 & LSP_LINE_SPACE_MASK;
    i.nodes[1].child0 = LSP_NONE;
    i.line_spaces[space].child = LSP_NONE;
  });
  c.image(RuleId::kNodeEmpty, "both children of the last node are none",
          [](Image& i) { i.nodes.back().child0 = i.nodes.back().child1 = LSP_NONE; });
}

void line_spaces(Collector& c) {
  c.image(RuleId::kLineSpaceOutOfRange, "line_space0 of node 0 is line_space_count",
          [](Image& i) { i.nodes[0].line_space0 = static_cast<uint32_t>(i.line_spaces.size()); });
  c.image(RuleId::kLineSpaceUsedTwice, "line_space1 of node 0 is line_space0",
          [](Image& i) { i.nodes[0].line_space1 = i.nodes[0].line_space0; });
  c.image(RuleId::kLineSpaceUnused, "line_space0 of node 0 is none",
          [](Image& i) { i.nodes[0].line_space0 = LSP_NONE; });
  c.image(RuleId::kTerminalBit, "TERMINAL of line_space0 of node 0 is set",
          [](Image& i) { i.nodes[0].line_space0 |= LSP_TERMINAL_BIT; });
  c.image(RuleId::kLineSpaceOrder, "two Line Spaces change places with all they hold", [](Image& i) {
    const uint32_t a = i.nodes[1].line_space0 & LSP_LINE_SPACE_MASK,
                   b = i.nodes[1].line_space1 & LSP_LINE_SPACE_MASK;
    std::swap(i.line_spaces[a].child, i.line_spaces[b].child);
    std::swap(i.line_spaces[a].triangle_first, i.line_spaces[b].triangle_first);
    std::swap(i.line_spaces[a].triangle_count, i.line_spaces[b].triangle_count);
    std::swap(i.nodes[1].line_space0, i.nodes[1].line_space1);
  });
  c.image(RuleId::kLineSpaceChild, "child of Line Space 0 is none",
          [](Image& i) { i.line_spaces[0].child = LSP_NONE; });
  c.image(RuleId::kLineSpaceResolution, "the resolution of Line Space 0 is 33", [](Image& i) {
    i.line_spaces[0].format = (i.line_spaces[0].format & ~LSP_FORMAT_RESOLUTION_MASK) | 33;
  });
  c.image(RuleId::kEntryBytes, "an entry of Line Space 0 has 3 bytes", [](Image& i) {
    i.line_spaces[0].format = (i.line_spaces[0].format & ~(LSP_FORMAT_ENTRY_MASK << LSP_FORMAT_ENTRY_SHIFT)) |
                              3u << LSP_FORMAT_ENTRY_SHIFT;
  });
  c.image(RuleId::kFormatBits, "bit 31 of the format of Line Space 0 is set",
          [](Image& i) { i.line_spaces[0].format |= 0x80000000u; });
  c.image(RuleId::kLineSpaceTriangles, "triangle_count of Line Space 1 covers a triangle of its neighbour",
          [](Image& i) { i.line_spaces[1].triangle_count += 1; });
  c.image(RuleId::kBinaryFeature, "the feature bit BINARY is set",
          [](Image& i) { i.header.required_features |= LSP_FEATURE_BINARY; });
  c.image(RuleId::kLineSpaceBox, "the box of Line Space 0 is flat",
          [](Image& i) { i.line_spaces[0].hi.y = i.line_spaces[0].lo.y; });
}

void bits_and_candidates(Collector& c) {
  c.image(RuleId::kWordsNotCumulative, "word_first of Line Space 1 is 0",
          [](Image& i) { i.line_spaces[1].word_first = 0; });
  c.image(RuleId::kWordsOutside, "word_first of the last Line Space is 2^32 - 1",
          [](Image& i) { i.line_spaces.back().word_first = 0xFFFFFFFFu; });
  c.image(RuleId::kOffsetWrong, "the offset of bit word 0 is 1", [](Image& i) { i.bit_words[0].offset = 1; });
  c.image(RuleId::kTailBits, "bit 31 of bit word 0 is set, beyond 30 shafts",
          [](Image& i) { i.bit_words[0].bits |= 0x80000000u; });
  c.image(RuleId::kFilledWrong, "filled of Line Space 0 is one less",
          [](Image& i) { i.line_spaces[0].filled -= 1; });
  c.image(RuleId::kWordsUnused, "BITS has one word more", [](Image& i) { i.bit_words.push_back({0, 0}); });
  c.image(RuleId::kLineSpaceEmpty, "the last Line Space has no filled shaft", [](Image& i) {
    i.candidates.resize(i.line_spaces.back().candidate_first);
    i.line_spaces.back().candidate_first = 0;
    i.line_spaces.back().filled = 0;
    i.bit_words.back() = {0, 0};
  });
  c.image(RuleId::kEntriesNotCumulative, "candidate_first of Line Space 1 is 0",
          [](Image& i) { i.line_spaces[1].candidate_first = 0; });
  c.image(RuleId::kEntriesOutside, "candidate_first of the last Line Space is 2^32 - 1",
          [](Image& i) { i.line_spaces.back().candidate_first = 0xFFFFFFFFu; });
  c.image(RuleId::kEntryOutOfRange, "the first candidate entry is 255",
          [](Image& i) { i.candidates[0] |= 0xFF; });
  // One byte an entry: the last word of a Line Space whose filled is no multiple of four has bytes to spare.
  c.image(RuleId::kEntryTail, "a byte after the last entry of a Line Space is 1", [](Image& i) {
    for (const LspLineSpace& space : i.line_spaces)
      if (space.filled % 4 != 0) {
        i.candidates[space.candidate_first + space.filled / 4] |= 0x01000000u;
        return;
      }
  });
  c.image(RuleId::kEntriesUnused, "CAND has one word more", [](Image& i) { i.candidates.push_back(0); });
}

void geometry(Collector& c) {
  c.geometry(RuleId::kVertexNotFinite, "v1.z of triangle 3 is infinite",
             [](Image& i) { i.triangles[3].v1.z = kInfinity; });
  c.geometry(RuleId::kTriangleDegenerate, "v2 of triangle 3 is v1",
             [](Image& i) { i.triangles[3].v2 = i.triangles[3].v1; });
  c.geometry(RuleId::kPrimitiveOutOfRange, "primitive_count is one less",
             [](Image& i) { i.header.primitive_count -= 1; });
  c.geometry(RuleId::kMaterialOutOfRange, "the material of triangle 3 is 2",
             [](Image& i) { i.triangles[3].material = 2; });
  c.geometry(RuleId::kTriangleFlags, "flag 2 of triangle 3 is set",
             [](Image& i) { i.triangles[3].flags |= 2; });
  c.geometry(RuleId::kSmoothFlag, "SMOOTH of triangle 3 is the other way round",
             [](Image& i) { i.triangles[3].flags ^= LSP_TRIANGLE_SMOOTH; });
  c.geometry(RuleId::kCoverageFeature, "COVERAGE is set, all triangles are solid", [](Image& i) {
    for (LspMaterial& m : i.materials) m.opacity = 1;
    i.header.required_features |= LSP_FEATURE_COVERAGE;
  });
  c.geometry(RuleId::kGapsDiffer, "the gaps of triangle 3 are half of what its material leaves",
             [](Image& i) {
               i = partial(i);
               i.triangles[3].flags ^= 0xC000u << LSP_TRIANGLE_GAPS_SHIFT;
             });
  c.geometry(RuleId::kTriangleOutsideLeaf, "triangle 3 moves down by 100", [](Image& i) {
    for (lsp_float3* v : {&i.triangles[3].v0, &i.triangles[3].v1, &i.triangles[3].v2}) v->y -= 100;
  });
  c.geometry(RuleId::kPrimitiveUncovered, "v0 of triangle 3 moves down by 100",
             [](Image& i) { i.triangles[3].v0.y -= 100; });
  c.geometry(RuleId::kPrimitiveDiffers, "triangle 4 claims to be the primitive of triangle 3",
             [](Image& i) { i.triangles[4].primitive = i.triangles[3].primitive; });
  c.geometry(RuleId::kNormalInvalid, "a component of n0 of triangle 3 is -32768", [](Image& i) {
    i.normals[3].n0 = (i.normals[3].n0 & 0xFFFF0000u) | 0x8000u;
    i.triangles[3].flags |= LSP_TRIANGLE_SMOOTH;
  });
  c.geometry(RuleId::kMaterialRange, "roughness of material 1 is 1.5",
             [](Image& i) { i.materials[1].roughness = 1.5f; });
  c.geometry(RuleId::kMaterialReserved, "reserved[0] of material 1 is 1",
             [](Image& i) { i.materials[1].reserved[0] = 1; });
  c.geometry(RuleId::kLineSpaceNotAround, "lo.x of Line Space 0 is inside the box of its node", [](Image& i) {
    LspLineSpace& space = i.line_spaces[0];
    space.lo.x += 0.5f;
    space.scale.x = 1.0f / (space.hi.x - space.lo.x);
  });
  c.geometry(RuleId::kLineSpaceScale, "scale.y of Line Space 0 is doubled",
             [](Image& i) { i.line_spaces[0].scale.y *= 2; });
}

void metadata_and_source(Collector& c) {
  c.image(RuleId::kMetaEncoding, "META holds a byte FF", [](Image& i) { i.meta = "{\"tool\":\"\xFF\"}"; });
  c.image(RuleId::kMetaJson, "META lacks its closing brace", [](Image& i) { i.meta.pop_back(); });
  c.image(RuleId::kSourceStale, "the source is another file", [](Image&) {}, {"--mesh", kSourceName});
  c.image(RuleId::kSourceUnknown, "source_hash is zero",
          [](Image& i) { i.header.source_hash_lo = i.header.source_hash_hi = 0; }, {"--mesh", kSourceName});
}

}  // namespace

std::vector<InvalidFile> invalid_files() {
  Collector collector;
  identification(collector);
  header(collector);
  section_table(collector);
  hashes_and_codec(collector);
  tree(collector);
  line_spaces(collector);
  bits_and_candidates(collector);
  geometry(collector);
  metadata_and_source(collector);
  break_ntrees(collector);
  break_cells(collector);
  break_wide_nodes(collector);
  return std::move(collector.files);
}

}  // namespace lsp::corpus
