// The packed form: the same content as the raw one, and every way in which a frame can lie.
#include <gtest/gtest.h>

#include <functional>

#include "check.h"
#include "hash.h"
#include "image.h"
#include "scenes.h"

namespace {

using namespace lsp;
using namespace lsp::corpus;
using namespace lsp::format;

Report check_packed(Sections sections, const std::function<void(Section&)>& change) {
  pack(sections);
  change(sections.sections[0]);
  return check_file(encode(sections), {.level = Level::kGeometry, .memory_limit = uint64_t{1} << 26});
}

TEST(Packed, HasTheContentHashOfTheRawForm) {
  for (uint32_t alignment : {256u, 4096u, 65536u}) {
    Image image = full_scene();
    image.alignment = alignment;
    Bytes raw = encode(image);
    Sections sections = to_sections(image);
    pack(sections);
    Bytes packed = encode(sections);
    EXPECT_EQ(header_of(raw).content_hash_lo, header_of(packed).content_hash_lo);
    EXPECT_EQ(header_of(raw).content_hash_hi, header_of(packed).content_hash_hi);
    EXPECT_EQ(header_of(packed).alignment, alignment);
    EXPECT_EQ(check_file(packed, {.level = Level::kGeometry}).findings().size(), 0u);
  }
}

TEST(Packed, SomeSectionsPackedAndSomeNot) {
  Sections sections = to_sections(full_scene());
  for (size_t i = 0; i < sections.sections.size(); i += 2) {
    sections.sections[i].stored = zstd_frame(sections.sections[i].data);
    sections.sections[i].entry.codec = LSP_CODEC_ZSTD;
  }
  EXPECT_EQ(check_file(encode(sections), {.level = Level::kGeometry}).findings().size(), 0u);
}

TEST(Packed, DeclaredSizeTooSmallOrTooLarge) {
  for (int64_t difference : {-64, -1, 1, 64}) {
    const Report report = check_packed(to_sections(full_scene()), [&](Section& section) {
      Bytes data = section.data;
      data.resize(data.size() + static_cast<size_t>(difference));
      section.stored = zstd_frame(data);
    });
    EXPECT_TRUE(report.has(RuleId::kZstdContentSize)) << difference;
  }
}

TEST(Packed, SeveralFrames) {
  const Report report = check_packed(to_sections(full_scene()), [](Section& section) {
    const std::span<const std::byte> data = section.data;
    section.stored = zstd_frame(data.first(64));
    const Bytes second = zstd_frame(data.subspan(64));
    section.stored.insert(section.stored.end(), second.begin(), second.end());
  });
  EXPECT_TRUE(report.has(RuleId::kZstdTrailing));
}

TEST(Packed, ASkippableFrameIsNoFrame) {
  const Report report = check_packed(to_sections(full_scene()), [](Section& section) {
    const Bytes skippable = {std::byte{0x50}, std::byte{0x2A}, std::byte{0x4D}, std::byte{0x18},
                             std::byte{0},    std::byte{0},    std::byte{0},    std::byte{0}};
    section.stored.insert(section.stored.begin(), skippable.begin(), skippable.end());
  });
  EXPECT_TRUE(report.has(RuleId::kZstdFrame));
}

// 64 MiB of zeros in a few kilobytes: sound as a frame, and held to the limit that was asked for.
TEST(Packed, ABombWithinTheRatioMeetsTheMemoryLimit) {
  const Report report = check_packed(to_sections(full_scene()), [](Section& section) {
    section.data.assign(size_t{65} << 20, std::byte{0});
    section.stored = zstd_frame(section.data);
    section.entry.bytes = section.data.size();
    section.entry.element_count = section.entry.bytes / sizeof(LspNode);
  });
  EXPECT_TRUE(report.has(RuleId::kMemoryLimit));
}

TEST(Packed, EveryFlippedByteOfAFrameIsSeen) {
  Sections sections = to_sections(full_scene());
  pack(sections);
  const Bytes good = encode(sections);
  for (size_t at = sizeof(LspHeader) + 8 * sizeof(LspSection); at < good.size(); ++at) {
    Bytes bytes = good;
    bytes[at] ^= std::byte{0x11};
    ASSERT_FALSE(check_file(bytes, {.level = Level::kContainer}).findings().empty()) << at;
  }
}

}  // namespace
