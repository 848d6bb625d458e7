#include "writer.h"

#include <xxhash.h>
#include <zstd.h>

#include <algorithm>
#include <cstring>
#include <functional>
#include <memory>
#include <span>

#include "lsp/program.h"
#include "lsp/sections.h"

namespace lsp {
namespace {

struct Section {
  const format::KindInfo& known;
  std::span<const std::byte> bytes;
  std::function<void()> release;  // after reading a piece of `bytes`; may be empty
  std::vector<std::byte> packed;
  std::span<const std::byte> stored() const {
    return packed.empty() ? bytes : std::span<const std::byte>(packed);
  }
};

// Hands the section's bytes to `f` piece by piece, so that a section in a file need not be in memory as a
// whole.
template <typename F>
void for_each_piece(std::span<const std::byte> bytes, const std::function<void()>& release, F&& f) {
  constexpr size_t kPiece = size_t{16} << 20;
  for (size_t done = 0; done < bytes.size(); done += kPiece) {
    f(bytes.subspan(done, std::min(kPiece, bytes.size() - done)));
    if (release) release();
  }
}

XXH128_hash_t hash_of(const Section& s) {
  const std::unique_ptr<XXH3_state_t, XXH_errorcode (*)(XXH3_state_t*)> state(XXH3_createState(),
                                                                              XXH3_freeState);
  XXH3_128bits_reset(state.get());
  for_each_piece(s.bytes, s.release, [&](std::span<const std::byte> piece) {
    XXH3_128bits_update(state.get(), piece.data(), piece.size());
  });
  return XXH3_128bits_digest(state.get());
}

uint64_t align_up(uint64_t x, uint64_t alignment) { return (x + alignment - 1) / alignment * alignment; }

std::vector<std::byte> compress(std::span<const std::byte> bytes, int level) {
  const std::unique_ptr<ZSTD_CCtx, size_t (*)(ZSTD_CCtx*)> context(ZSTD_createCCtx(), ZSTD_freeCCtx);
  std::vector<std::byte> out(ZSTD_compressBound(bytes.size()));
  const size_t size =
      ZSTD_compressCCtx(context.get(), out.data(), out.size(), bytes.data(), bytes.size(), level);
  if (ZSTD_isError(size)) throw Failure(Exit::kInternal, "", std::string("zstd: ") + ZSTD_getErrorName(size));
  out.resize(size);
  return out;
}

// That of a page, so that the file can be imported into a device where it is mapped; a file that would be
// padding mostly is copied in no time.
uint32_t choose_alignment(const std::vector<Section>& sections) {
  constexpr uint64_t kSmall = 16384;
  uint64_t bytes = 0;
  for (const Section& s : sections) bytes += s.bytes.size();
  return bytes < kSmall ? 256 : 4096;
}

// What the content id covers of a section: nothing that depends on packing or alignment.
struct ContentEntry {
  uint32_t type, element_bytes;
  uint64_t element_count, bytes, hash_lo, hash_hi;
};
static_assert(sizeof(ContentEntry) == 40);

// All that are not empty; they point into `baked` and `meta`.
std::vector<Section> sections_of(const Baked& baked, const std::string& meta) {
  std::vector<Section> sections;
  const SectionArrays arrays{baked};
  const auto add = [&](format::Kind kind, const auto& elements) {
    if (elements.size() == 0) return;
    sections.push_back({info(kind), std::as_bytes(std::span(elements.data(), elements.size())), {}, {}});
    if constexpr (requires { elements.release(); })
      sections.back().release = [&elements] { elements.release(); };
  };
#define LSP_ARRAY_SECTION(Name, TYPE, code, Element, flag, base, feature, owed, member, ...) \
  add(format::Kind::k##Name, arrays.member);
#define LSP_BYTE_SECTION(Name, ...) add(format::Kind::k##Name, meta);
#include "lsp/sections.def"
  return sections;
}

// A file but for its bytes on disk.
struct Layout {
  std::vector<Section> sections;
  std::vector<LspSection> table;
  std::vector<std::byte> head;  // header and table
};

// Packs the sections if asked to, gives them their places and completes the header.
Layout lay_out(Baked& baked, const std::string& meta, const WriteOptions& options) {
  std::vector<Section> sections = sections_of(baked, meta);
  bool any_packed = false;
  if (options.zstd)
    for (Section& s : sections) {
      if (options.memory_limit && s.bytes.size() > options.memory_limit / 2)
        throw Failure(
            Exit::kLimit, "",
            std::string("packing section ") + s.known.name + " of " + std::to_string(s.bytes.size() >> 20) +
                " MiB needs more memory than --memory-limit leaves: raise it, or leave out --compress");
      s.packed = compress(s.bytes, options.zstd_level);
      if (s.packed.size() >= s.bytes.size()) s.packed.clear();
      any_packed |= !s.packed.empty();
    }

  // The header states the raw form's alignment; a packed file is never mapped and lies closer.
  const uint32_t raw_alignment = options.alignment ? options.alignment : choose_alignment(sections);
  const uint64_t alignment = any_packed ? 256 : raw_alignment;
  LspHeader& h = baked.header;
  h.magic_0 = LSP_MAGIC_0;
  h.magic_1 = LSP_MAGIC_1;
  h.version_major = LSP_VERSION_MAJOR;
  h.version_minor = lsp_version_minor(h.required_features);
  h.header_bytes = sizeof(LspHeader);
  h.section_count = uint32_t(sections.size());
  h.section_table_offset = sizeof(LspHeader);
  h.alignment = raw_alignment;

  std::vector<LspSection> table;
  std::vector<ContentEntry> content;
  uint64_t position = sizeof(LspHeader) + sections.size() * sizeof(LspSection);
  for (const Section& s : sections) {
    const XXH128_hash_t hash = hash_of(s);
    const format::KindInfo& known = s.known;
    const uint64_t count = s.bytes.size() / known.element_bytes;
    const uint32_t flags = known.flag == format::SectionFlag::kOptional ? 0 : LSP_SECTION_REQUIRED;
    position = align_up(position, alignment);
    table.push_back({known.type, flags, position, s.stored().size(), s.bytes.size(),
                     s.packed.empty() ? LSP_CODEC_NONE : LSP_CODEC_ZSTD, known.element_bytes, count,
                     hash.low64, hash.high64});
    content.push_back({known.type, known.element_bytes, count, s.bytes.size(), hash.low64, hash.high64});
    position += s.stored().size();
  }
  h.file_bytes = align_up(position, alignment);
  const XXH128_hash_t content_hash = XXH3_128bits(content.data(), content.size() * sizeof(ContentEntry));
  h.content_hash_lo = content_hash.low64;
  h.content_hash_hi = content_hash.high64;
  h.header_hash_lo = h.header_hash_hi = 0;
  std::vector<std::byte> head(sizeof h + table.size() * sizeof(LspSection));
  std::memcpy(head.data(), &h, sizeof h);
  std::memcpy(head.data() + sizeof h, table.data(), table.size() * sizeof(LspSection));
  const XXH128_hash_t header_hash = XXH3_128bits(head.data(), head.size());
  h.header_hash_lo = header_hash.low64;
  h.header_hash_hi = header_hash.high64;
  std::memcpy(head.data(), &h, sizeof h);
  return {std::move(sections), std::move(table), std::move(head)};
}

}  // namespace

uint64_t lsp_bytes(Baked& baked, const std::string& meta, const WriteOptions& options) {
  lay_out(baked, meta, options);
  return baked.header.file_bytes;
}

Written write_lsp(OutputFile& file, Baked& baked, const std::string& meta, const WriteOptions& options) {
  const auto [sections, table, head] = lay_out(baked, meta, options);
  file.write(head.data(), head.size());
  Written written{baked.header.file_bytes, {}};
  for (size_t i = 0; i < sections.size(); ++i) {
    file.pad_to(table[i].offset);
    for_each_piece(sections[i].stored(), sections[i].release,
                   [&](std::span<const std::byte> piece) { file.write(piece.data(), piece.size()); });
    written.sections.push_back(
        {sections[i].known.name, sections[i].bytes.size(), sections[i].stored().size()});
  }
  file.pad_to(baked.header.file_bytes);
  file.finish();
  return written;
}

Written write_lsp(const std::filesystem::path& path, Baked& baked, const std::string& meta,
                  const WriteOptions& options) {
  OutputFile file(path);
  const Written written = write_lsp(file, baked, meta, options);
  file.commit();
  return written;
}

}  // namespace lsp
