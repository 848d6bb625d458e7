#include "annotate.h"

#include <algorithm>
#include <cctype>
#include <cstring>

#include "fields.h"
#include "view.h"

namespace lsp::format {
namespace {

constexpr uint64_t kFirstElements = 4;     // listed of a folded section
constexpr uint64_t kMetaCharacters = 120;  // shown of folded META
constexpr uint64_t kWords = 8;             // of CAND and REFS, to a line

class Annotator {
 public:
  Annotator(std::span<const std::byte> file, const AnnotateOptions& options,
            const std::function<void(const Range&)>& visit)
      : file_(file), options_(options), visit_(visit), view_(view_file(file)) {}

  void run() {
    header();
    table();
    std::vector<uint64_t> order;
    for (uint64_t i = 0; i < view_.table.size(); ++i)
      if (view_.table[i].stored_bytes != 0 && view_.table[i].offset < file_.size()) order.push_back(i);
    std::stable_sort(order.begin(), order.end(),
                     [&](uint64_t a, uint64_t b) { return view_.table[a].offset < view_.table[b].offset; });
    for (uint64_t i : order) section(view_.table[i]);
    fill(file_.size());
  }

 private:
  // What has been accounted for so far ends here; ranges begin here.
  void put(uint64_t bytes, std::string path, std::string meaning) {
    if (bytes == 0) return;
    visit_({at_, bytes, std::move(path), std::move(meaning)});
    at_ += bytes;
  }

  // Accounts for the bytes up to `end` that nothing claims.
  void fill(uint64_t end) {
    const uint64_t declared = view_.header.file_bytes;
    if (at_ < declared && declared < end && file_.size() >= sizeof(LspHeader)) fill(declared);
    if (at_ >= end) return;
    const std::span<const std::byte> bytes = file_.subspan(at_, end - at_);
    const bool zero = std::all_of(bytes.begin(), bytes.end(), [](std::byte b) { return b == std::byte{0}; });
    if (file_.size() >= sizeof(LspHeader) && at_ >= declared)
      put(bytes.size(), "/extra", "behind the end of the file as the header states it");
    else if (zero)
      put(bytes.size(), "/padding", "zero");
    else
      put(bytes.size(), "/unknown", "claimed by nothing, not zero");
  }

  // The fields of a struct at at_, as far as the file goes.
  void fields(const Struct& owner, const std::string& path) {
    const uint64_t start = at_;
    for (const Field& field : owner.fields) {
      const uint64_t left = file_.size() - start;
      if (field.offset + uint64_t{field.bytes} > left) {
        put(left - std::min<uint64_t>(left, field.offset), path + "/" + field.name, "cut off");
        return;
      }
      put(field.bytes, path + "/" + field.name,
          value_text(field, file_.data() + start, is_ntree(view_.header)));
    }
  }

  void header() { fields(struct_named("LspHeader"), "/header"); }

  void table() {
    if (view_.table.empty() || view_.header.section_table_offset < at_) return;
    fill(view_.header.section_table_offset);
    for (uint64_t i = 0; i < view_.table.size(); ++i)
      fields(struct_named("LspSection"), "/table/" + std::to_string(i));
  }

  void section(const LspSection& entry) {
    fill(std::min<uint64_t>(entry.offset, file_.size()));
    const uint64_t end = in_range(entry.offset, entry.stored_bytes, file_.size())
                             ? entry.offset + entry.stored_bytes
                             : file_.size();
    if (end <= at_) return;  // wholly inside sections before it
    const std::string path = "/sections/" + type_name(entry.type);
    if (at_ > entry.offset) {
      put(end - at_, path, "the rest of a section that overlaps the one before it");
      return;
    }
    const bool whole = end - entry.offset == entry.stored_bytes;
    const int kind = kind_of(entry.type);
    if (!whole)
      put(end - at_, path, "a section of " + std::to_string(entry.stored_bytes) + " bytes, cut off");
    else if (entry.codec != LSP_CODEC_NONE)
      put(end - at_, path, "packed, unfolds to " + std::to_string(entry.bytes) + " bytes");
    else if (kind == kKinds)
      put(end - at_, path, "a section that is not known");
    else
      elements(static_cast<Kind>(kind), end, path);
  }

  void elements(Kind kind, uint64_t end, const std::string& path) {
    const bool full = options_.section == info(kind).name;
    if (kind == Kind::kMeta) return meta(end, path, full);
    const uint64_t size = is_words(kind) ? 4 * kWords : info(kind).element_bytes;
    const uint64_t count = (end - at_) / size;
    const bool folded = !full && count > kFirstElements + 2;
    for (uint64_t i = 0; i < count; ++i) {
      if (folded && i == kFirstElements) {
        const uint64_t skipped = count - 1 - kFirstElements;
        put(skipped * size, path + "/" + name(kind, i) + "...",
            std::to_string(skipped) + (is_words(kind) ? " times 8 words" : " more elements"));
        i += skipped;
      }
      put(size, path + "/" + name(kind, i), element(kind, size));
    }
    if (is_words(kind) && end > at_) put(end - at_, path + "/" + name(kind, count), element(kind, end - at_));
    if (end > at_) put(end - at_, path, "part of an element");
  }

  static std::string name(Kind kind, uint64_t i) { return std::to_string(is_words(kind) ? i * kWords : i); }

  std::string element(Kind kind, uint64_t size) const {
    std::string text;
    const Struct* owner = element_struct(kind);
    if (owner == nullptr) {
      for (uint64_t i = 0; i + 4 <= size; i += 4) {
        uint32_t word;
        std::memcpy(&word, file_.data() + at_ + i, 4);
        char hex[12];
        std::snprintf(hex, sizeof hex, "%s%08X", i == 0 ? "" : " ", word);
        text += hex;
      }
      return text;
    }
    for (const Field& field : owner->fields)
      text += std::string(text.empty() ? "" : ", ") + field.name + " " +
              value_text(field, file_.data() + at_, is_ntree(view_.header));
    return text;
  }

  void meta(uint64_t end, const std::string& path, bool full) {
    std::string text;
    for (uint64_t i = at_; i < end && (full || i < at_ + kMetaCharacters); ++i) {
      const char c = static_cast<char>(file_[i]);
      text += std::iscntrl(static_cast<unsigned char>(c)) ? ' ' : c;
    }
    put(end - at_, path, text + (text.size() < end - at_ ? "..." : ""));
  }

  std::span<const std::byte> file_;
  const AnnotateOptions& options_;
  const std::function<void(const Range&)>& visit_;
  FileView view_;
  uint64_t at_ = 0;
};

}  // namespace

void annotate(std::span<const std::byte> file, const AnnotateOptions& options,
              const std::function<void(const Range&)>& visit) {
  Annotator(file, options, visit).run();
}

}  // namespace lsp::format
