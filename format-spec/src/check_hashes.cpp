// Hashes and the zstd codec. Unpacks the packed sections for the layers behind it.
#include <zstd.h>

#include <cstddef>
#include <cstring>
#include <new>

#include "layers.h"

namespace lsp::format {
namespace {

// A block of a zstd frame takes at least four bytes and unfolds to at most 128 KiB.
constexpr uint64_t kZstdMaxRatio = 32768;

class HashCheck {
 public:
  HashCheck(FileView& view, uint64_t memory_limit, Report& report)
      : view_(view), report_(report), memory_left_(memory_limit) {}

  void run() {
    for (uint64_t i = 0; i < view_.table.size(); ++i) section(i);
    const Hash128 content = content_hash(view_.table);
    if (content != Hash128{view_.header.content_hash_lo, view_.header.content_hash_hi})
      report_.add(RuleId::kContentHash, offsetof(LspHeader, content_hash_lo), 16, "/header/content_hash",
                  "should be " + to_hex(content));
    const Hash128 header = header_hash(view_.header, view_.table);
    if (header != Hash128{view_.header.header_hash_lo, view_.header.header_hash_hi})
      report_.add(RuleId::kHeaderHash, offsetof(LspHeader, header_hash_lo), 16, "/header/header_hash",
                  "should be " + to_hex(header) + ": the header or the section table was changed");
  }

 private:
  void section(uint64_t i) {
    const LspSection& section = view_.table[i];
    if (!in_range(section.offset, section.stored_bytes, view_.bytes.size())) return;
    std::span<const std::byte> data = view_.bytes.subspan(section.offset, section.stored_bytes);
    if (section.codec == LSP_CODEC_ZSTD) {
      if (!unpack(i, data)) return;
    } else if (section.codec != LSP_CODEC_NONE || section.stored_bytes != section.bytes) {
      return;
    }
    const Hash128 hash = hash_bytes(data);
    if (hash != Hash128{section.hash_lo, section.hash_hi})
      find(RuleId::kSectionHash, i, section.offset, section.stored_bytes, [&] {
        return "the bytes hash to " + to_hex(hash) + ", the table says " +
               to_hex({section.hash_lo, section.hash_hi}) + ": the section was changed";
      });
    hand_over(i, data);
  }

  // Replaces `data`, the stored bytes, by what they unfold to. Returns false after a finding.
  bool unpack(uint64_t i, std::span<const std::byte>& data) {
    const LspSection& section = view_.table[i];
    const auto fail = [&](RuleId id, const std::string& message) {
      find(id, i, section.offset, section.stored_bytes, [&] { return message; });
      return false;
    };
    uint32_t magic = 0;
    if (data.size() >= sizeof magic) std::memcpy(&magic, data.data(), sizeof magic);
    const size_t frame = ZSTD_findFrameCompressedSize(data.data(), data.size());
    if (magic != ZSTD_MAGICNUMBER || ZSTD_isError(frame))
      return fail(RuleId::kZstdFrame, "this is not a whole zstd frame");
    if (ZSTD_getDictID_fromFrame(data.data(), data.size()) != 0)
      return fail(RuleId::kZstdFrame, "the zstd frame asks for a dictionary");
    if (frame != data.size())
      return fail(RuleId::kZstdTrailing,
                  std::to_string(data.size() - frame) + " bytes follow the zstd frame");
    const unsigned long long declared = ZSTD_getFrameContentSize(data.data(), data.size());
    if (declared != section.bytes)
      return fail(RuleId::kZstdContentSize,
                  (declared == ZSTD_CONTENTSIZE_UNKNOWN
                       ? std::string("the zstd frame does not declare its content size")
                       : "the zstd frame declares " + std::to_string(declared) + " bytes") +
                      ", the table says " + std::to_string(section.bytes));
    if (section.bytes / kZstdMaxRatio > data.size())
      return fail(RuleId::kZstdBomb,
                  std::to_string(data.size()) + " bytes cannot unfold to " + std::to_string(section.bytes));
    if (section.bytes > memory_left_)
      return fail(RuleId::kMemoryLimit, "unfolds to " + std::to_string(section.bytes) +
                                            " bytes, which is over the limit: raise --memory-limit");
    std::unique_ptr<std::byte[]> out(new (std::nothrow) std::byte[section.bytes]);
    if (out == nullptr)
      return fail(RuleId::kMemoryLimit, "there is no memory for " + std::to_string(section.bytes) + " bytes");
    const size_t written = ZSTD_decompress(out.get(), section.bytes, data.data(), data.size());
    if (ZSTD_isError(written) || written != section.bytes)
      return fail(RuleId::kZstdFrame,
                  std::string("does not unfold: ") +
                      (ZSTD_isError(written) ? ZSTD_getErrorName(written) : "it is too short"));
    memory_left_ -= section.bytes;
    data = {out.get(), section.bytes};
    view_.owned.push_back(std::move(out));
    return true;
  }

  // Gives an unpacked section to the layers behind, and realigns a raw one that a damaged offset moved.
  void hand_over(uint64_t i, std::span<const std::byte> data) {
    const LspSection& section = view_.table[i];
    const int kind = kind_of(section.type);
    if (kind == kKinds) return;
    Part& part = view_.parts[kind];
    const bool counted = section.element_bytes == info(static_cast<Kind>(kind)).element_bytes &&
                         section.element_count == section.bytes / section.element_bytes &&
                         section.bytes % section.element_bytes == 0;
    if (part.offset != section.offset || part.packed != (section.codec != LSP_CODEC_NONE) || !counted) return;
    if (part.packed) {
      part.data = data;
      const std::optional<uint64_t> declared = declared_count(view_.header, static_cast<Kind>(kind));
      part.usable = !declared || *declared == section.element_count;
    }
    if (part.usable && reinterpret_cast<uintptr_t>(part.data.data()) % 16 != 0) {
      std::unique_ptr<std::byte[]> copy(new std::byte[part.data.size()]);
      std::memcpy(copy.get(), part.data.data(), part.data.size());
      part.data = {copy.get(), part.data.size()};
      view_.owned.push_back(std::move(copy));
    }
  }

  template <class Describe>
  void find(RuleId id, uint64_t i, uint64_t offset, uint64_t bytes, Describe&& message) {
    report_.add(id, offset, bytes, [&] {
      return std::pair{"/sections/" + type_name(view_.table[i].type), std::string(message())};
    });
  }

  FileView& view_;
  Report& report_;
  uint64_t memory_left_;
};

}  // namespace

void check_hashes_and_codec(FileView& view, uint64_t memory_limit, Report& report) {
  HashCheck(view, memory_limit, report).run();
}

}  // namespace lsp::format
