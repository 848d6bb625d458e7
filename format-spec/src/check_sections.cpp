// The section table: types, ranges, sizes, order, and the padding between sections.
#include <algorithm>
#include <cstddef>
#include <cstring>
#include <set>

#include "layers.h"

namespace lsp::format {
namespace {

class TableCheck {
 public:
  TableCheck(FileView& view, Report& report) : view_(view), report_(report), size_(view.bytes.size()) {}

  void run() {
    for (uint64_t i = 0; i < view_.table.size(); ++i) entry(i);
    order();
    overlap_and_padding();
    counts();
  }

 private:
  // One finding about a field at `field_offset` of table entry i.
  void find(RuleId id, uint64_t i, size_t field_offset, size_t field_bytes, const char* field,
            const std::string& message) {
    report_.add(id, sizeof(LspHeader) + i * sizeof(LspSection) + field_offset, field_bytes, [&] {
      return std::pair{"/table/" + std::to_string(i) + "/" + field,
                       type_name(view_.table[i].type) + ": " + message};
    });
  }
#define LSP_TABLE_FINDING(id, i, field, message) \
  find(RuleId::id, i, offsetof(LspSection, field), sizeof(LspSection::field), #field, message)

  void entry(uint64_t i) {
    const LspSection& section = view_.table[i];
    const int kind = kind_of(section.type);
    bool sound = true;
    if (kind == kKinds) {
      if (section.flags & LSP_SECTION_REQUIRED)
        LSP_TABLE_FINDING(kUnknownRequiredSection, i, type, "this section is required but not known");
      else
        LSP_TABLE_FINDING(kUnknownOptionalSection, i, type, "this section is not known and was skipped");
      sound = false;
    }
    flags(i, kind);
    base(i, kind);
    if (section.codec > LSP_CODEC_ZSTD) {
      LSP_TABLE_FINDING(kUnknownCodec, i, codec, "codec " + std::to_string(section.codec) + " is not known");
      sound = false;
    }
    sound = sizes(i, kind) && sound;
    sound = place(i) && sound;
    const bool duplicate = !types_.insert(section.type).second;
    if (duplicate) LSP_TABLE_FINDING(kDuplicateSection, i, type, "there is another section of this type");
    if (kind == kKinds || duplicate) return;
    Part& part = view_.parts[kind];
    part.present = true;
    if (!sound) return;
    part.packed = section.codec != LSP_CODEC_NONE;
    part.offset = section.offset;
    part.stored_bytes = section.stored_bytes;
    if (part.packed) return;
    part.data = view_.bytes.subspan(section.offset, section.bytes);
    part.usable = true;
  }

  void flags(uint64_t i, int kind) {
    const LspSection& section = view_.table[i];
    const bool required = section.flags & LSP_SECTION_REQUIRED;
    bool wrong = (section.flags & ~LSP_SECTION_REQUIRED) != 0;
    if (kind != kKinds) {
      const SectionFlag expected = info(static_cast<Kind>(kind)).flag;
      wrong = wrong || (required ? expected == SectionFlag::kOptional : expected == SectionFlag::kRequired);
    }
    if (wrong) LSP_TABLE_FINDING(kSectionFlags, i, flags, "flags are " + std::to_string(section.flags));
  }

  // The tree of one base structure in the file of another.
  void base(uint64_t i, int kind) {
    if (kind != kKinds && !holds_base(view_.header, info(static_cast<Kind>(kind)).base))
      LSP_TABLE_FINDING(
          kOtherBase, i, type,
          "a file of base structure " + std::to_string(view_.header.base_structure) + " does not have it");
  }

  bool sizes(uint64_t i, int kind) {
    const LspSection& section = view_.table[i];
    bool sound = true;
    if (kind == kKinds ? section.element_bytes == 0
                       : section.element_bytes != info(static_cast<Kind>(kind)).element_bytes) {
      LSP_TABLE_FINDING(kElementBytes, i, element_bytes, "is " + std::to_string(section.element_bytes));
      sound = false;
    }
    uint64_t product = 0;
    if (__builtin_mul_overflow(section.element_count, uint64_t{section.element_bytes}, &product) ||
        product != section.bytes) {
      LSP_TABLE_FINDING(kElementCount, i, element_count,
                        std::to_string(section.element_count) + " elements of " +
                            std::to_string(section.element_bytes) + " bytes are not " +
                            std::to_string(section.bytes) + " bytes");
      sound = false;
    }
    if (section.codec == LSP_CODEC_NONE ? section.stored_bytes != section.bytes : section.stored_bytes == 0) {
      LSP_TABLE_FINDING(
          kStoredBytes, i, stored_bytes,
          "is " + std::to_string(section.stored_bytes) + " where bytes is " + std::to_string(section.bytes));
      sound = false;
    }
    return sound;
  }

  bool place(uint64_t i) {
    const LspSection& section = view_.table[i];
    bool sound = true;
    const uint64_t alignment = view_.section_alignment();
    if (alignment != 0 && section.offset % alignment != 0)
      LSP_TABLE_FINDING(
          kSectionMisaligned, i, offset,
          "is " + std::to_string(section.offset) + ", not a multiple of " + std::to_string(alignment));
    if (!in_range(section.offset, section.stored_bytes, size_) || section.offset < data_start()) {
      LSP_TABLE_FINDING(kSectionOutside, i, offset,
                        std::to_string(section.stored_bytes) + " bytes at " + std::to_string(section.offset) +
                            " do not lie between the table's end at " + std::to_string(data_start()) +
                            " and the file's at " + std::to_string(size_));
      sound = false;
    }
    return sound;
  }

  void order() {
    for (uint64_t i = 1; i < view_.table.size(); ++i) {
      const LspSection &before = view_.table[i - 1], &section = view_.table[i];
      if (kind_of(before.type) > kind_of(section.type))
        LSP_TABLE_FINDING(kSectionOrder, i, type, "stands after " + type_name(before.type));
      else if (before.offset > section.offset)
        LSP_TABLE_FINDING(kSectionOrder, i, offset, "lies before " + type_name(before.type));
    }
  }

  // Goes through the file from the table's end on: what is claimed twice, and what by nobody.
  void overlap_and_padding() {
    std::vector<uint64_t> by_offset;
    for (uint64_t i = 0; i < view_.table.size(); ++i)
      if (view_.table[i].stored_bytes != 0 &&
          in_range(view_.table[i].offset, view_.table[i].stored_bytes, size_))
        by_offset.push_back(i);
    std::stable_sort(by_offset.begin(), by_offset.end(),
                     [&](uint64_t a, uint64_t b) { return view_.table[a].offset < view_.table[b].offset; });
    uint64_t end = data_start();
    for (uint64_t i : by_offset) {
      const LspSection& section = view_.table[i];
      if (section.offset < end && section.offset >= data_start())
        LSP_TABLE_FINDING(kSectionOverlap, i, offset,
                          "begins at " + std::to_string(section.offset) + ", before " + std::to_string(end) +
                              ", where the section before it ends");
      if (section.offset > end) padding(end, section.offset);
      end = std::max(end, section.offset + section.stored_bytes);
    }
    const uint64_t file_end = std::min(size_, view_.header.file_bytes);
    if (file_end > end) padding(end, file_end);
  }

  void padding(uint64_t first, uint64_t end) {
    const uint64_t alignment = view_.section_alignment();
    const bool valid = alignment == 256 || alignment == 4096 || alignment == 65536;
    if (valid && end > align_up(first, alignment))
      report_.add(
          RuleId::kGap, first, end - first, "/padding",
          std::to_string(end - first) + " bytes where padding to " + std::to_string(alignment) + " would do");
    // memcmp of a range with itself shifted by one byte: all equal to the first, at memcpy's speed.
    const std::byte* bytes = view_.bytes.data() + first;
    const uint64_t length = end - first;
    if (bytes[0] == std::byte{0} && std::memcmp(bytes, bytes + 1, length - 1) == 0) return;
    uint64_t at = 0;
    while (bytes[at] == std::byte{0}) ++at;
    report_.add(RuleId::kPaddingNotZero, first + at, length - at, "/padding",
                "padding from " + std::to_string(first) + " to " + std::to_string(end) +
                    " holds other bytes than zero");
  }

  void counts() {
    for (int kind = 0; kind < kKinds; ++kind) {
      const std::optional<uint64_t> declared = declared_count(view_.header, static_cast<Kind>(kind));
      if (!declared) continue;
      const auto entry = std::find_if(view_.table.begin(), view_.table.end(), [&](const LspSection& section) {
        return kind_of(section.type) == kind;
      });
      if (entry == view_.table.end()) {
        const KindInfo& missing = info(static_cast<Kind>(kind));
        if (*declared != 0 && missing.owed == Owed::kByCount)  // of the others rule 217 speaks
          report_.add(RuleId::kMissingSection, sizeof(LspHeader), view_.table.size() * sizeof(LspSection),
                      "/table",
                      std::string(missing.name) + " is missing, but the header counts " +
                          std::to_string(*declared) + " of its elements");
      } else if (entry->element_count != *declared) {
        LSP_TABLE_FINDING(kCountDiffers, entry - view_.table.begin(), element_count,
                          "is " + std::to_string(entry->element_count) + ", but the header says " +
                              std::to_string(*declared));
        view_.parts[kind].usable = false;
      }
    }
  }

  uint64_t data_start() const { return sizeof(LspHeader) + view_.table.size() * sizeof(LspSection); }

  FileView& view_;
  Report& report_;
  uint64_t size_;
  std::set<uint32_t> types_;
};

}  // namespace

void check_sections(FileView& view, Report& report) { TableCheck(view, report).run(); }

}  // namespace lsp::format
