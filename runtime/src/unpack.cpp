// The raw form of a packed file: the same header and sections, uncompressed and laid out again.
//
//   packed | header | table | section (zstd) | section (zstd) |      sections at multiples of 256
//   raw    | header | table | pad | section  | pad | section  |      sections at multiples of
//   header.alignment
#include <cstring>

#ifdef LSP_PACKED
#define XXH_INLINE_ALL
#include <xxhash.h>
#include <zstd.h>
#endif

#include "container.h"
#include "error.h"

namespace lsp {
namespace {

// A zstd block is at least 4 bytes and gives at most 128 KiB: more than this no frame can hold. It keeps a
// file of a few bytes from asking for terabytes.
uint64_t most_unpacked_bytes(uint64_t stored) {
  return stored > UINT64_MAX >> 16 ? UINT64_MAX : (stored + 4) << 15;
}

bool round_up(uint64_t value, uint64_t alignment, uint64_t* result) {
  if (__builtin_add_overflow(value, alignment - 1, result)) return false;
  *result &= ~(alignment - 1);
  return true;
}

// Offsets of the sections in the raw form; sets *total to its length. False if they overflow.
template <class Visit>
bool lay_out(const Container& container, uint64_t* total, const Visit& visit) {
  const LspHeader& header = *container.header;
  uint64_t end = header.section_table_offset + uint64_t{header.section_count} * sizeof(LspSection);
  for (uint32_t i = 0; i < header.section_count; ++i) {
    uint64_t offset = 0;
    if (!round_up(end, header.alignment, &offset)) return false;
    if (__builtin_add_overflow(offset, container.sections[i].bytes, &end)) return false;
    visit(i, offset);
  }
  return round_up(end, header.alignment, total);
}

lsp_status check_codecs(const Container& container, lsp_error* error) {
  for (uint32_t i = 0; i < container.header->section_count; ++i) {
    const LspSection& section = container.sections[i];
    const SectionName name(section.type);
    if (section.codec != LSP_CODEC_NONE && section.codec != LSP_CODEC_ZSTD) {
      return fail(error, LSP_ERROR_UNSUPPORTED, section.offset,
                  "section %s is packed with codec %u, which is not known", name.text, section.codec);
    }
    if (section.codec == LSP_CODEC_ZSTD && section.bytes > most_unpacked_bytes(section.stored_bytes)) {
      return fail(error, LSP_ERROR_INVALID, section.offset,
                  "section %s claims %llu bytes, more than its %llu stored bytes can hold", name.text,
                  static_cast<unsigned long long>(section.bytes),
                  static_cast<unsigned long long>(section.stored_bytes));
    }
  }
  return LSP_OK;
}

#ifdef LSP_PACKED

constexpr uint32_t kZstdMagic = 0xFD2FB528u;

bool hash_is(const XXH128_hash_t& hash, uint64_t lo, uint64_t hi) {
  return hash.low64 == lo && hash.high64 == hi;
}

XXH128_hash_t header_hash(const LspHeader& header, const LspSection* sections) {
  LspHeader blank = header;
  blank.header_hash_lo = 0;
  blank.header_hash_hi = 0;
  XXH3_state_t state;
  XXH3_128bits_reset(&state);
  XXH3_128bits_update(&state, &blank, sizeof blank);
  XXH3_128bits_update(&state, sections, uint64_t{header.section_count} * sizeof(LspSection));
  return XXH3_128bits_digest(&state);
}

// One section of the packed file into out[0, section.bytes).
lsp_status unpack_section(const LspSection& section, const unsigned char* stored, unsigned char* out,
                          ZSTD_DCtx* zstd, lsp_error* error) {
  const SectionName name(section.type);
  if (section.codec == LSP_CODEC_NONE) {
    if (section.bytes != 0) memcpy(out, stored, section.bytes);
  } else {
    uint32_t magic = 0;
    if (section.stored_bytes >= sizeof magic) memcpy(&magic, stored, sizeof magic);
    if (magic != kZstdMagic) {
      return fail(error, LSP_ERROR_INVALID, section.offset, "section %s is not a zstd frame", name.text);
    }
    const size_t frame = ZSTD_findFrameCompressedSize(stored, section.stored_bytes);
    if (ZSTD_isError(frame) != 0 || frame != section.stored_bytes) {
      return fail(error, LSP_ERROR_INVALID, section.offset, "section %s is not exactly one zstd frame",
                  name.text);
    }
    if (ZSTD_getFrameContentSize(stored, section.stored_bytes) != section.bytes) {
      return fail(error, LSP_ERROR_INVALID, section.offset,
                  "section %s: its zstd frame does not state the size that the table does", name.text);
    }
    const size_t got = ZSTD_decompressDCtx(zstd, out, section.bytes, stored, section.stored_bytes);
    if (ZSTD_isError(got) != 0 || got != section.bytes) {
      return fail(error, LSP_ERROR_INVALID, section.offset, "section %s cannot be decompressed (%s)",
                  name.text, ZSTD_isError(got) != 0 ? ZSTD_getErrorName(got) : "too short");
    }
  }
  if (!hash_is(XXH3_128bits(out, section.bytes), section.hash_lo, section.hash_hi)) {
    return fail(error, LSP_ERROR_INVALID, section.offset, "section %s is damaged (its hash differs)",
                name.text);
  }
  return LSP_OK;
}

lsp_status unpack(const Container& container, const unsigned char* bytes, unsigned char* out,
                  uint64_t out_size, ZSTD_DCtx* zstd, lsp_error* error) {
  const LspHeader& source = *container.header;
  if (!hash_is(header_hash(source, container.sections), source.header_hash_lo, source.header_hash_hi)) {
    return fail(error, LSP_ERROR_INVALID, offsetof(LspHeader, header_hash_lo),
                "its header or section table is damaged (their hash differs)");
  }
  auto* header = reinterpret_cast<LspHeader*>(out);
  auto* sections = reinterpret_cast<LspSection*>(out + source.section_table_offset);
  *header = source;
  uint64_t written = source.section_table_offset + uint64_t{source.section_count} * sizeof(LspSection);
  lsp_status status = LSP_OK;
  uint64_t total = 0;
  lay_out(container, &total, [&](uint32_t i, uint64_t offset) {
    if (status != LSP_OK) return;
    const LspSection& section = container.sections[i];
    memset(out + written, 0, offset - written);
    status = unpack_section(section, bytes + section.offset, out + offset, zstd, error);
    written = offset + section.bytes;
    sections[i] = section;
    sections[i].offset = offset;
    sections[i].stored_bytes = section.bytes;
    sections[i].codec = LSP_CODEC_NONE;
  });
  if (status != LSP_OK) return status;
  memset(out + written, 0, out_size - written);
  header->file_bytes = out_size;
  const XXH128_hash_t hash = header_hash(*header, sections);
  header->header_hash_lo = hash.low64;
  header->header_hash_hi = hash.high64;
  return succeed(error);
}

#endif

}  // namespace
}  // namespace lsp

extern "C" lsp_status lsp_unpacked_size(const void* bytes, uint64_t size, uint64_t* unpacked,
                                        lsp_error* error) {
  *unpacked = 0;
  lsp::Container container;
  if (const lsp_status status = lsp::read_container(bytes, size, &container, error); status != LSP_OK)
    return status;
  if (const lsp_status status = lsp::check_codecs(container, error); status != LSP_OK) return status;
  if (!lsp::lay_out(container, unpacked, [](uint32_t, uint64_t) {})) {
    *unpacked = 0;
    return lsp::fail(error, LSP_ERROR_INVALID, 0, "its sections add up to more than a file can hold");
  }
  return lsp::succeed(error);
}

extern "C" lsp_status lsp_unpack(const void* bytes, uint64_t size, void* out, uint64_t out_size,
                                 lsp_error* error) {
  uint64_t unpacked = 0;
  if (const lsp_status status = lsp_unpacked_size(bytes, size, &unpacked, error); status != LSP_OK)
    return status;
  if (out == nullptr || reinterpret_cast<uintptr_t>(out) % 16 != 0 || out_size != unpacked) {
    return lsp::fail(error, LSP_ERROR_LIMIT, 0,
                     "its raw form needs %llu bytes at a multiple of 16, %llu were given",
                     static_cast<unsigned long long>(unpacked), static_cast<unsigned long long>(out_size));
  }
#ifdef LSP_PACKED
  lsp::Container container;
  lsp::read_container(bytes, size, &container, nullptr);
  ZSTD_DCtx* zstd = ZSTD_createDCtx();
  if (zstd == nullptr) return lsp::fail(error, LSP_ERROR_LIMIT, 0, "there is no memory to decompress it");
  const lsp_status status = lsp::unpack(container, static_cast<const unsigned char*>(bytes),
                                        static_cast<unsigned char*>(out), out_size, zstd, error);
  ZSTD_freeDCtx(zstd);
  return status;
#else
  return lsp::fail(
      error, LSP_ERROR_UNSUPPORTED, 0,
      "this library was built without LSP_PACKED and cannot unpack; bake the file with --compress none");
#endif
}
