// Parts of a bake as hostile bytes: what is damaged is refused, what is mended to pass is harmless.
#include <gtest/gtest.h>
#include <unistd.h>

#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>

#include "aligned_bytes.h"
#include "lsp/program.h"
#include "shard/join.h"
#include "wide_scenes.h"

namespace lsp::test {
namespace {

namespace fs = std::filesystem;
using corpus::AlignedBytes;

// Makes the hash of a part right again, and where it is wanted that of its scene.
void mend(AlignedBytes& bytes, const Part* scene = nullptr) {
  PartHeader h;
  std::memcpy(&h, bytes.data(), sizeof h);
  if (scene != nullptr) {
    const auto hash = bake_hash(scene->settings_text, scene->header, scene->sections);
    h.bake_lo = hash[0];
    h.bake_hi = hash[1];
    std::memcpy(bytes.data(), &h, sizeof h);
  }
  const auto hash = part_hash(bytes.bytes());
  h.hash_lo = hash[0];
  h.hash_hi = hash[1];
  std::memcpy(bytes.data(), &h, sizeof h);
}

AlignedBytes aligned(const std::string& text) { return {text.data(), text.size()}; }

// The corpus's scene of wide nodes with a second cell that is filled; `shard` of its cells.
Baked scene(const Shard& shard) {
  const corpus::Image image = corpus::full_wide_scene();
  Baked baked;
  baked.header = image.header;
  baked.wide.nodes = image.wide_nodes;
  baked.triangles = image.triangles;
  baked.normals = image.normals;
  baked.materials = image.materials;
  baked.cell_grid.words = {LSP_CELL_FILLED, LSP_CELL_FILLED | 1};
  const std::span<const uint32_t> entries = image.entries;
  CellPieces first = {1,
                      image.filled_cells[0].root,
                      entries.first(15),
                      entries.subspan(15),
                      image.planes,
                      image.plane_records,
                      image.splits,
                      image.cell_nodes,
                      image.cell_references};
  CellPieces second = first;
  second.sub_mask = 0;
  second.origin = {};
  CellTablesBuilder tables;
  for (size_t i = 0; i < shard.share_of(2); ++i) tables.add(shard.item(i) == 0 ? first : second);
  baked.cell_tables = tables.finish();
  baked.header.cells.origin_entry_first = baked.cell_tables.origin_entry_first;
  set_counts(baked);
  return baked;
}

PartSettings settings() {
  PartSettings s;
  s.meta = {{"source_hash", "0"}, {"options", {{"cells", 2}}}, {"error", nullptr}, {"qualities", nullptr}};
  return s;
}

std::string part_text(const Shard& shard, const PartSettings& s = settings()) {
  std::string name = (fs::temp_directory_path() / "lsp-part-XXXXXX").string();
  const int file = mkstemp(name.data());
  close(file);
  Baked baked = scene(shard);
  const uint64_t bytes = write_part(name, baked, shard, s);
  std::ifstream in(name, std::ios::binary);
  std::string text{std::istreambuf_iterator<char>(in), {}};
  fs::remove(name);
  EXPECT_EQ(text.size(), bytes);
  return text;
}

AlignedBytes part(const Shard& shard, const PartSettings& s = settings()) {
  return aligned(part_text(shard, s));
}

// What becomes of the parts, which are joined where they can be.
std::string outcome(const std::vector<std::span<const std::byte>>& parts) {
  try {
    std::vector<Part> read;
    for (size_t i = 0; i < parts.size(); ++i) read.push_back(read_part(parts[i], "file" + std::to_string(i)));
    check_parts(read);
    join_parts(read);
    return "joined";
  } catch (const Failure& e) {
    return std::to_string(int(e.exit())) + " " + e.file() + ": " + e.what();
  }
}

TEST(Parts, AnyOrderAndNumberIsTheWhole) {
  const Baked whole = scene({1, 1});
  for (const uint32_t count : {1u, 2u, 3u}) {  // a part without cells is the third
    std::vector<AlignedBytes> bytes;
    std::vector<Part> parts;
    for (uint32_t i = count; i >= 1; --i) bytes.push_back(part({i, count}));
    for (AlignedBytes& b : bytes) parts.push_back(read_part(b.bytes(), "part"));
    check_parts(parts);
    const Baked joined = join_parts(parts);
    EXPECT_EQ(std::memcmp(&joined.header, &whole.header, sizeof whole.header), 0);
    const format::Contents is = contents_of(joined), owed = contents_of(whole);
    for (size_t kind = 0; kind < is.size(); ++kind)
      EXPECT_TRUE(std::equal(is[kind].begin(), is[kind].end(), owed[kind].begin(), owed[kind].end())) << kind;
    EXPECT_EQ(parts[0].settings.meta, settings().meta);
  }
}

TEST(Parts, ThoseOfOneBakeAreWanted) {
  const AlignedBytes one = part({1, 2}), two = part({2, 2}), third = part({3, 3});
  EXPECT_EQ(outcome({two.bytes(), one.bytes()}), "joined");
  EXPECT_EQ(
      outcome({two.bytes()}),
      "1 file0: is one of 2 parts, of which 1/2 is missing: bake with --shard what is, and give all parts");
  EXPECT_EQ(outcome({third.bytes()}).substr(0, 50), "1 file0: is one of 3 parts, of which 1/3, 2/3 are ");
  EXPECT_EQ(outcome({one.bytes(), two.bytes(), two.bytes()}),
            "1 file2: is part 2/2, as is file1: give each part once");
  EXPECT_EQ(outcome({one.bytes(), third.bytes()}).substr(0, 44),
            "1 file1: is part 3/3, but file0 is 1/2: give");
  PartSettings other = settings();
  other.meta["options"]["cells"] = 3;
  const AlignedBytes finer = part({2, 2}, other);
  EXPECT_EQ(
      outcome({one.bytes(), finer.bytes()}),
      "3 file1: is not of the same bake as file0, cells is 2 there and 3 here: bake all parts with the same "
      "meshes and options");
  other = settings();
  other.meta["source_hash"] = "1";
  const AlignedBytes moved = part({2, 2}, other);
  EXPECT_NE(outcome({one.bytes(), moved.bytes()}).find("source_hash is \"0\" there and \"1\" here"),
            std::string::npos);
}

TEST(Parts, WhatIsDamagedIsRefused) {
  const std::string text = part_text({1, 1});
  AlignedBytes whole = aligned(text);
  ASSERT_EQ(outcome({whole.bytes()}), "joined");
  for (size_t size = 0; size < text.size(); size += size < 600 ? 1 : 61)
    EXPECT_EQ(outcome({whole.bytes().first(size)}).substr(0, 8), "3 file0:") << size;
  for (size_t at = 0; at < text.size(); ++at) {
    AlignedBytes flipped = aligned(text);
    flipped.data()[at] ^= std::byte(1 << at % 8);
    const std::string is = outcome({flipped.bytes()});
    // From the format's version on to the program's, others are not known to be damage.
    EXPECT_EQ(is.substr(0, 8), at >= 8 && at < 48 ? "5 file0:" : "3 file0:") << at << ": " << is;
  }
  AlignedBytes longer = aligned(text + "0123456789ABCDEF");
  mend(longer);
  EXPECT_EQ(outcome({longer.bytes()}).substr(0, 12), "3 file0: has");
}

// With a hash that is right, what a part says is believed as far as it is sound.
TEST(Parts, WhatIsMendedIsRefusedOrSound) {
  const std::string text = part_text({1, 1});
  size_t refused = 0, joined = 0;
  for (size_t at = 0; at < text.size(); ++at)
    for (const uint8_t change : {0x01, 0x80, 0xFF}) {
      AlignedBytes bytes = aligned(text);
      bytes.data()[at] ^= std::byte(change);
      mend(bytes);
      const std::string is = outcome({bytes.bytes()});
      (is == "joined" ? joined : refused)++;
      if (is != "joined") {
        EXPECT_EQ(is.substr(1, 7), " file0:") << is;
        EXPECT_TRUE(is[0] == '3' || is[0] == '5' || is[0] == '1') << is;
      }
    }
  EXPECT_GT(refused, joined) << "most of a part is not free to be anything";
  EXPECT_GT(joined, 0u) << "the hash alone was seen";
}

// Where its hash of the scene is right, too: the header, the grid and the tree say anything.
TEST(Parts, AMendedSceneIsRefusedOrSound) {
  const std::string text = part_text({1, 1});
  for (size_t at = sizeof(PartHeader); at < text.size(); ++at) {
    AlignedBytes bytes = aligned(text);
    bytes.data()[at] ^= std::byte{0x80};
    mend(bytes);
    try {
      const Part changed = read_part(bytes.bytes(), "part");
      mend(bytes, &changed);
    } catch (const Failure&) {
      continue;
    }
    const std::string is = outcome({bytes.bytes()});
    EXPECT_TRUE(is == "joined" || is[0] == '3') << at << ": " << is;
  }
}

TEST(Parts, AShardIsOfOneToAll) {
  const Shard shard = parse_shard("2/8");
  EXPECT_EQ(shard.number, 2u);
  EXPECT_EQ(shard.count, 8u);
  for (const char* text : {"", "2", "2/", "/8", "0/8", "9/8", "0/0", "-1/8", "1/8x", "1 /8", "1/1000001",
                           "1/99999999999", "1.0/8"})
    EXPECT_THROW(parse_shard(text), Failure) << text;
  // Every item is in one share.
  for (const size_t items : {0u, 1u, 7u, 8u, 9u})
    for (const uint32_t count : {1u, 3u, 8u}) {
      std::vector<int> seen(items);
      for (uint32_t number = 1; number <= count; ++number)
        for (size_t i = 0; i < Shard{number, count}.share_of(items); ++i)
          ++seen.at(Shard{number, count}.item(i));
      EXPECT_EQ(std::count(seen.begin(), seen.end(), 1), std::ptrdiff_t(items));
    }
}

}  // namespace
}  // namespace lsp::test
