// What is not asked for is not read: opening and tracing touch the pages of the sections they need and no
// other. The other pages are made unreadable, so that a touch ends the program. (What the kernel counts as
// present does not serve: it maps neighbours of a page that is read.)
#include <gtest/gtest.h>
#include <sys/mman.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <set>
#include <string>

#include "lsp/lsp.h"
#include "scene_builder.h"

namespace lsp::test {
namespace {

using Names = std::set<std::string>;

class Paging : public testing::Test {
 protected:
  void SetUp() override {
    GTEST_FLAG_SET(death_test_style, "threadsafe");
    const std::string path =
        (std::filesystem::temp_directory_path() / ("lsp_test_paging_" + std::to_string(getpid()) + ".lsp"))
            .string();
    Bytes bytes = write_raw(build_parts({}));
    std::ofstream(path, std::ios::binary)
        .write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
    ASSERT_EQ(lsp_map_file(path.c_str(), &mapping_, nullptr), LSP_OK);
    std::filesystem::remove(path);
    header_ = header_of(bytes);
    sections_.assign(sections_of(bytes), sections_of(bytes) + header_.section_count);
  }
  void TearDown() override { lsp_unmap_file(&mapping_); }

  // Makes the pages of all sections unreadable but those of `readable`.
  void protect_all_but(const Names& readable) {
    const auto page = static_cast<uint64_t>(sysconf(_SC_PAGESIZE));
    ASSERT_EQ(header_.alignment % page, 0u);
    for (const LspSection& s : sections_) {
      if (readable.count(std::string(reinterpret_cast<const char*>(&s.type), 4)) != 0) continue;
      auto* start = static_cast<unsigned char*>(const_cast<void*>(mapping_.bytes)) + s.offset;
      ASSERT_EQ(mprotect(start, (s.stored_bytes + page - 1) / page * page, PROT_NONE), 0);
    }
  }

  lsp_status open_and_trace(uint32_t flags) {
    lsp_scene scene;
    const lsp_status status = lsp_open(mapping_.bytes, mapping_.size, &scene, nullptr);
    if (status != LSP_OK) return status;
    Random random(5);
    for (int i = 0; i < 2000; ++i) {
      const LspRay ray{{random.between(-1, 1), random.between(-1, 1), random.between(-1, 1)},
                       0,
                       {random.between(-1, 1), random.between(-1, 1), random.between(0.1f, 1)},
                       100};
      LspHit hit;
      const lsp_trace_options options{flags, 0};
      lsp_trace(&scene, &options, &ray, &hit, 1, nullptr, nullptr);
    }
    return LSP_OK;
  }

  lsp_mapping mapping_{};
  LspHeader header_{};
  std::vector<LspSection> sections_;
};

using PagingDeathTest = Paging;

TEST_F(Paging, OpeningReadsNoSection) {
  protect_all_but({});
  lsp_scene scene;
  EXPECT_EQ(lsp_open(mapping_.bytes, mapping_.size, &scene, nullptr), LSP_OK);
}

TEST_F(Paging, ExactTracesReadTheTreeOnly) {
  protect_all_but({"NODE", "TRIA", "NRML"});
  EXPECT_EQ(open_and_trace(0), LSP_OK);
}

TEST_F(Paging, ApproximateTracesReadNoMaterialsAndNoMeta) {
  protect_all_but({"NODE", "TRIA", "NRML", "LSPC", "BITS", "CAND"});
  EXPECT_EQ(open_and_trace(LSP_TRACE_APPROXIMATE), LSP_OK);
}

// That a touch would have been noticed.
TEST_F(PagingDeathTest, UnreadableSectionsAreNoticed) {
  EXPECT_DEATH(
      {
        protect_all_but({"NODE", "TRIA", "NRML"});
        open_and_trace(LSP_TRACE_APPROXIMATE);
      },
      "");
}

}  // namespace
}  // namespace lsp::test
