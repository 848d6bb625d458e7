// Packed files become, bit for bit, the raw files they were made from; damaged ones are refused.
#include <gtest/gtest.h>
#include <zstd.h>

#include <cstring>

#include "lsp/lsp.h"
#include "scene_builder.h"

namespace lsp::test {
namespace {

lsp_status unpack(const Bytes& packed, Bytes* raw, std::string* message) {
  lsp_error error{};
  uint64_t size = 0;
  lsp_status status = lsp_unpacked_size(packed.data(), packed.size(), &size, &error);
  if (status == LSP_OK) {
    raw->assign(size, 0xCD);
    status = lsp_unpack(packed.data(), packed.size(), raw->data(), size, &error);
  }
  *message = error.message;
  return status;
}

TEST(Unpack, IsTheInverseOfPacking) {
  for (const uint32_t alignment : {256u, 4096u, 65536u}) {
    for (const uint32_t triangles : {0u, 1u, 300u}) {
      BuildOptions options;
      options.alignment = alignment;
      options.triangles = triangles;
      const Parts parts = build_parts(options);
      Bytes raw;
      std::string message;
      ASSERT_EQ(unpack(write_packed(parts), &raw, &message), LSP_OK) << message;
      EXPECT_TRUE(raw == write_raw(parts)) << alignment << " " << triangles;
    }
  }
}

TEST(Unpack, RawFileStaysAsItIs) {
  const Bytes file = write_raw(build_parts({}));
  Bytes raw;
  std::string message;
  ASSERT_EQ(unpack(file, &raw, &message), LSP_OK) << message;
  EXPECT_TRUE(raw == file);
}

TEST(Unpack, WantsExactlyTheSizeItSaid) {
  const Bytes packed = write_packed(build_parts({}));
  uint64_t size = 0;
  ASSERT_EQ(lsp_unpacked_size(packed.data(), packed.size(), &size, nullptr), LSP_OK);
  Bytes raw(size + 4096);
  EXPECT_EQ(lsp_unpack(packed.data(), packed.size(), raw.data(), size - 1, nullptr), LSP_ERROR_LIMIT);
  EXPECT_EQ(lsp_unpack(packed.data(), packed.size(), raw.data(), size + 4096, nullptr), LSP_ERROR_LIMIT);
  EXPECT_EQ(lsp_unpack(packed.data(), packed.size(), raw.data() + 8, size, nullptr), LSP_ERROR_LIMIT);
}

// A packed file of one scene whose TRIA section is replaced by `stored`, with all hashes of the header right.
Bytes with_triangles(const std::string& stored, uint64_t claimed_bytes) {
  BuildOptions options;
  options.triangles = 1;
  options.line_spaces = options.normals = options.materials = false;
  Bytes bytes = write_packed(build_parts(options));
  LspSection& section = section_of(bytes, LSP_SECTION_TRIA);
  const uint64_t offset = bytes.size();
  section.offset = offset;
  section.stored_bytes = stored.size();
  section.bytes = claimed_bytes;
  section.element_count = claimed_bytes / section.element_bytes;
  header_of(bytes).triangle_count = static_cast<uint32_t>(section.element_count);
  bytes.resize(offset + (stored.size() + 255) / 256 * 256);
  memcpy(bytes.data() + offset, stored.data(), stored.size());
  header_of(bytes).file_bytes = bytes.size();
  repair_header_hash(bytes);
  return bytes;
}

std::string compress(const std::string& content) {
  std::string frame(ZSTD_compressBound(content.size()), '\0');
  frame.resize(ZSTD_compress(frame.data(), frame.size(), content.data(), content.size(), 3));
  return frame;
}

void expect_refused(const Bytes& bytes, const char* part) {
  Bytes raw;
  std::string message;
  EXPECT_EQ(unpack(bytes, &raw, &message), LSP_ERROR_INVALID);
  EXPECT_NE(message.find(part), std::string::npos) << message;
}

TEST(Unpack, RefusesFramesThatDoNotFit) {
  const std::string one(48, 'a');
  const std::string frame = compress(one);
  expect_refused(with_triangles(frame + frame, 96), "exactly one zstd frame");
  expect_refused(with_triangles(frame, 96), "does not state the size");
  expect_refused(with_triangles(frame.substr(0, frame.size() - 1), 48), "exactly one zstd frame");
  expect_refused(with_triangles("not zstd", 48), "not a zstd frame");
  expect_refused(with_triangles(std::string("\x50\x2A\x4D\x18\0\0\0\0", 8) + frame, 48), "not a zstd frame");
  expect_refused(with_triangles("", 48), "not a zstd frame");
  expect_refused(with_triangles(frame, 48), "hash");  // a good frame of other bytes
}

// The frame says a size that its bytes cannot give, or gives more than the file says.
TEST(Unpack, RefusesBombs) {
  const std::string big(48 << 20, '\0');
  const std::string frame = compress(big);
  ASSERT_LT(frame.size(), 8192u);
  expect_refused(with_triangles(frame, 48), "does not state the size");
  uint64_t size = 0;
  lsp_error error;
  const Bytes impossible = with_triangles(std::string(256, 'x'), 48ull << 22);
  EXPECT_EQ(lsp_unpacked_size(impossible.data(), impossible.size(), &size, &error), LSP_ERROR_INVALID);
  EXPECT_NE(std::string(error.message).find("more than its"), std::string::npos) << error.message;
}

TEST(Unpack, RefusesDamage) {
  const Bytes good = write_packed(build_parts({}));
  Bytes bytes = good;
  bytes[offsetof(LspHeader, source_hash_lo)] ^= 1;
  expect_refused(bytes, "hash");
  // Any flipped bit of any section shows: in the frame or in the hash.
  Random random(3);
  for (int i = 0; i < 500; ++i) {
    bytes = good;
    const LspSection& section = sections_of(bytes)[random.below(header_of(bytes).section_count)];
    bytes[section.offset + random.below(static_cast<uint32_t>(section.stored_bytes))] ^=
        static_cast<unsigned char>(1u << random.below(8));
    Bytes raw;
    std::string message;
    // A few bits of a frame's header have no meaning; then the bytes are right all the same.
    if (unpack(bytes, &raw, &message) == LSP_OK) {
      EXPECT_TRUE(raw == write_raw(build_parts({})));
    }
  }
}

}  // namespace
}  // namespace lsp::test
