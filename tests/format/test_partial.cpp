// Reading one section of a mapped file brings in the pages of the header, the table and that section only:
// what starting sections on pages of their own is for.
#include <fcntl.h>
#include <gtest/gtest.h>
#include <lsp/lsp.h>
#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <numeric>

#include "image.h"
#include "scenes.h"

namespace {

using namespace lsp::corpus;

// For every page of the mapping: is it in memory?
std::vector<unsigned char> resident_pages(const lsp_mapping& mapping) {
  const size_t page = static_cast<size_t>(sysconf(_SC_PAGESIZE));
  std::vector<unsigned char> pages((mapping.size + page - 1) / page);
  if (mincore(const_cast<void*>(mapping.bytes), mapping.size, pages.data()) != 0) pages.clear();
  for (unsigned char& present : pages) present &= 1;
  return pages;
}

TEST(Partial, ReadingOneSectionTouchesItsPagesOnly) {
  Image image = full_scene();
  image.alignment = 4096;
  // Two sections of a megabyte, one after the other, of which one is read.
  image.materials.resize(25000, image.materials[0]);
  image.meta = "{\"note\":\"" + std::string(1 << 20, 'x') + "\"}";
  const Bytes bytes = encode(image);
  // Beside the test program: a file system on a disk, where pages can be dropped from memory.
  const std::string path = std::filesystem::current_path() / ("partial-" + std::to_string(getpid()) + ".lsp");
  std::ofstream(path, std::ios::binary)
      .write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  const int fd = open(path.c_str(), O_RDONLY);
  ASSERT_GE(fd, 0);
  fsync(fd);
  posix_fadvise(fd, 0, 0, POSIX_FADV_DONTNEED);
  close(fd);

  lsp_mapping mapping;
  lsp_error error;
  ASSERT_EQ(lsp_map_file(path.c_str(), &mapping, &error), LSP_OK) << error.message;
  std::filesystem::remove(path);
  const std::vector<unsigned char> before = resident_pages(mapping);
  if (before.empty() || std::accumulate(before.begin(), before.end(), 0) != 0) {
    lsp_unmap_file(&mapping);
    GTEST_SKIP() << "this file system keeps files in memory";
  }
  madvise(const_cast<void*>(mapping.bytes), mapping.size, MADV_RANDOM);  // nothing is read ahead

  lsp_scene scene;
  ASSERT_EQ(lsp_open(mapping.bytes, mapping.size, &scene, &error), LSP_OK) << error.message;
  const std::vector<unsigned char> opened = resident_pages(mapping);
  EXPECT_EQ(std::accumulate(opened.begin(), opened.end(), 0), 1) << "opening reads the header's page";

  float sum = 0;
  for (uint32_t i = 0; i < scene.header->material_count; ++i) sum += scene.materials[i].opacity;
  EXPECT_GT(sum, 0.0f);
  const std::vector<unsigned char> read = resident_pages(mapping);
  const auto materials = static_cast<size_t>(reinterpret_cast<const char*>(scene.materials) -
                                             static_cast<const char*>(mapping.bytes));
  const size_t first = materials / 4096, end = (materials + 25000 * sizeof(LspMaterial) + 4095) / 4096;
  for (size_t page = 0; page < read.size(); ++page)
    EXPECT_EQ(read[page] != 0, page == 0 || (page >= first && page < end)) << "page " << page;
  lsp_unmap_file(&mapping);
}

}  // namespace
