// The validator and the loader agree: what the validator passes, the loader opens and traces; what the loader
// refuses, the validator refuses. On the corpus, and on ten thousand files damaged at random.
#include <gtest/gtest.h>
#include <lsp/lsp.h>

#include <cstring>
#include <set>

#include "cells_scenes.h"
#include "check.h"
#include "mutations.h"
#include "ntree_scenes.h"
#include "opened.h"
#include "scenes.h"
#include "wide_scenes.h"

namespace {

using namespace lsp;
using namespace lsp::corpus;
using namespace lsp::format;

// Sixteen rays in every mode that the file allows; their answers make sense.
void trace(const lsp_scene& scene, const std::string& context) {
  const LspHeader& header = *scene.header;
  const std::array<LspRay, 16> rays = rays_through(header);
  LspHit hits[16];
  const bool exact = header.required_features & LSP_FEATURE_EXACT;
  const bool approximate = header.required_features & (LSP_FEATURE_LINE_SPACES | LSP_FEATURE_CELLS);
  for (uint32_t flags = 0; flags <= LSP_TRACE_ALL_FLAGS; ++flags) {
    const bool able = exact || (approximate && (flags & LSP_TRACE_APPROXIMATE));
    const lsp_trace_options options{flags, flags & LSP_TRACE_NEAR_APPROXIMATE ? 0.5f : 0.0f};
    lsp_trace_counts counts{};
    const lsp_status status = lsp_trace(&scene, &options, rays.data(), hits, 16, &counts, nullptr);
    ASSERT_EQ(status, able ? LSP_OK : LSP_ERROR_UNSUPPORTED) << context;
    if (!able) continue;
    for (const LspHit& hit : hits) {
      ASSERT_EQ(hit.flags & LSP_HIT_INCOMPLETE, 0u) << context << ", flags " << flags;
      if (hit.primitive == LSP_NONE) continue;
      ASSERT_TRUE(hit.t > 0) << context;
    }
  }
}

void expect_agreement(const Bytes& bytes, const std::string& context, uint64_t& valid,
                      uint64_t& opened_count) {
  const Report report = check_file(bytes, {.level = Level::kStructure, .memory_limit = kMemoryLimit});
  Opened opened = open(bytes);
  if (report.verdict() == Verdict::kValid) {
    ++valid;
    ASSERT_EQ(opened.status, LSP_OK) << context << ": valid, but refused: " << opened.error.message;
    trace(opened.scene, context);
  }
  if (opened.status == LSP_OK) {
    ++opened_count;
    // What was not validated may have wrong bounds, but never makes the tracer leave the file's bytes. A loop
    // bound that is too large would only take long.
    if (report.verdict() != Verdict::kValid && opened.scene.header->max_steps < 1000000) {
      LspRay ray = {{0, 1, 0}, 0, {0.1f, 0.2f, 0.3f}, INFINITY};
      LspHit hit;
      for (uint32_t flags = 0; flags <= LSP_TRACE_ALL_FLAGS; ++flags) {
        const lsp_trace_options options{flags, 0.25f};
        lsp_trace(&opened.scene, &options, &ray, &hit, 1, nullptr, nullptr);
      }
    }
  } else {
    ASSERT_NE(report.verdict(), Verdict::kValid)
        << context << ": refused by the loader: " << opened.error.message;
    ASSERT_FALSE(report.findings().empty()) << context;
  }
}

TEST(Loader, AgreesOnTheCorpus) {
  uint64_t valid = 0, opened = 0;
  for (const ValidFile& file : valid_files()) expect_agreement(file.bytes, file.name, valid, opened);
  EXPECT_EQ(valid, valid_files().size());
  for (const InvalidFile& file : invalid_files()) expect_agreement(file.bytes, file.name, valid, opened);
}

// What SPEC.md says a reader must refuse before it follows a reference. Each bounds a loop, a stack or a
// range: a file that opened with more could keep a tracer, or a device, busy for as long as it likes.
// Every number of a ray made of the same byte four times: zeros, the smallest and the largest, no numbers.
// Where a ray meets the scene may then be no number either.
TEST(Loader, AnyRayIsTraced) {
  std::array<LspRay, 512> rays;
  for (size_t i = 0; i < rays.size(); ++i) {
    std::memset(&rays[i], int(i & 0xFF), sizeof rays[i]);
    rays[i].tmin = 0;
    lsp_float3& d = rays[i].direction;
    if (i >= 256) d = {-d.x, -d.y, -d.z};  // back to where the scene is
    rays[i].tmax = INFINITY;
  }
  std::array<LspHit, 512> hits;
  for (const ValidFile& file : valid_files()) {
    const Opened opened = open(file.bytes);
    if (opened.status != LSP_OK) continue;
    for (uint32_t flags = 0; flags <= LSP_TRACE_ALL_FLAGS; ++flags) {
      const lsp_trace_options options{flags, 0.0f};
      if (lsp_trace(&opened.scene, &options, rays.data(), hits.data(), rays.size(), nullptr, nullptr) !=
          LSP_OK)
        continue;
      for (const LspHit& hit : hits)
        ASSERT_EQ(hit.flags & LSP_HIT_INCOMPLETE, 0u) << file.name << ", flags " << flags;
    }
    if (!(opened.scene.header->required_features & LSP_FEATURE_CELLS)) continue;
    // So small cells that a ray's beginning is infinitely far away, counted in them.
    LspHeader header = *opened.scene.header;
    header.cells.per_size = 1e30f;
    lsp_scene scene = opened.scene;
    scene.header = &header;
    const lsp_trace_options options{LSP_TRACE_APPROXIMATE, 0.0f};
    EXPECT_EQ(lsp_trace(&scene, &options, rays.data(), hits.data(), rays.size(), nullptr, nullptr), LSP_OK);
  }
}

TEST(Loader, RefusesWhatAReaderMustRefuse) {
  const std::set<RuleId> rules = {
      RuleId::kTooShort,        RuleId::kBadMagic,     RuleId::kOtherMajor,     RuleId::kUnknownRequired,
      RuleId::kHeaderBytes,     RuleId::kTableOffset,  RuleId::kTableOutside,   RuleId::kTruncated,
      RuleId::kExtraBytes,      RuleId::kAlignment,    RuleId::kMaxStack,       RuleId::kMaxLeaf,
      RuleId::kNtreeParameters, RuleId::kAddressable,  RuleId::kStepsBound,     RuleId::kSectionOutside,
      RuleId::kSectionOverlap,  RuleId::kElementCount, RuleId::kMissingSection, RuleId::kCountDiffers};
  size_t count = 0;
  for (const InvalidFile& file : invalid_files()) {
    if (!rules.contains(file.rule)) continue;
    EXPECT_NE(open(file.bytes).status, LSP_OK) << file.name << ": " << file.mutation;
    ++count;
  }
  EXPECT_GT(count, rules.size());
}

TEST(Loader, AgreesOnTenThousandRandomMutations) {
  std::vector<ValidFile> files = valid_files();
  // The largest differs from others by its padding only.
  std::erase_if(files, [](const ValidFile& file) { return file.bytes.size() > 65536; });
  uint64_t valid = 0, opened = 0;
  for (uint64_t seed = 0; seed < 10000; ++seed) {
    Random random(seed);
    const ValidFile& file = files[random.below(files.size())];
    Bytes bytes = file.bytes;
    mutate(bytes, random);
    expect_agreement(bytes, file.name + " with seed " + std::to_string(seed), valid, opened);
    if (HasFatalFailure()) return;
  }
  RecordProperty("valid", static_cast<int>(valid));
  RecordProperty("opened", static_cast<int>(opened));
  std::printf("of 10,000 mutations %llu are valid, %llu open\n", static_cast<unsigned long long>(valid),
              static_cast<unsigned long long>(opened));
  // The mutations are worth something only if many files pass and many fail.
  EXPECT_GT(valid, 500u);
  EXPECT_LT(valid, 9000u);
}

TEST(Loader, UnpackOfPackIsTheSameFile) {
  for (Image image :
       {full_scene(), full_ntree_scene(), full_cells_scene(), full_wide_scene(), wide_alone_scene()})
    for (uint32_t alignment : {256u, 4096u, 65536u}) {
      image.alignment = alignment;
      const Bytes raw = encode(image);
      Sections sections = to_sections(image);
      pack(sections);
      Opened opened = open(encode(sections));
      ASSERT_EQ(opened.status, LSP_OK) << opened.error.message;
      ASSERT_EQ(opened.bytes->size(), raw.size());
      EXPECT_EQ(std::memcmp(opened.bytes->data(), raw.data(), raw.size()), 0) << alignment;
    }
}

}  // namespace
