// Line Spaces one by one: their format, their bit words with offsets, and their candidate entries.
//
// Bit words and candidates of different Line Spaces are disjoint in a sound file. Only disjoint ranges are
// looked into, so that a hostile file with many Line Spaces over the same words costs no more than its size.
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstring>

#include "layers.h"
#include "line_space.h"

namespace lsp::format {
namespace {

// Written out so that the compiler makes vector code of it even where the target has no popcnt.
inline uint32_t bit_count(uint32_t bits) {
  bits -= bits >> 1 & 0x55555555u;
  bits = (bits & 0x33333333u) + (bits >> 2 & 0x33333333u);
  bits = (bits + (bits >> 4)) & 0x0F0F0F0Fu;
  bits += bits >> 8;
  return (bits + (bits >> 16)) & 0x3Fu;
}

// Whether each offset is the one before it plus the bits of the word before it.
bool offsets_sound(std::span<const LspBitWord> words) {
  uint32_t wrong = words[0].offset;
  for (size_t i = 1; i < words.size(); ++i)
    wrong |= (words[i].offset - words[i - 1].offset) ^ bit_count(words[i - 1].bits);
  return wrong == 0;
}

template <class Entry>
bool entries_sound(const Entry* entries, uint64_t count, uint32_t limit) {
  if (limit > static_cast<Entry>(~Entry{0})) return true;
  // Gathered in the entry's own width, so that the compiler compares as many at once as a vector holds.
  Entry wrong = 0;
  for (uint64_t i = 0; i < count; ++i)
    wrong = static_cast<Entry>(wrong | (entries[i] >= static_cast<Entry>(limit) ? Entry{1} : Entry{0}));
  return wrong == 0;
}

class LineSpaceCheck {
 public:
  LineSpaceCheck(const FileView& view, Report& report)
      : view_(view),
        report_(report),
        spaces_(view.elements<LspLineSpace>(Kind::kLspc)),
        words_(view.elements<LspBitWord>(Kind::kBits)),
        candidates_(view.elements<uint32_t>(Kind::kCand)) {}

  void run() {
    for (uint64_t i = 0; i < spaces_.size(); ++i) {
      const LineSpaceShape shape = shape_of(spaces_[i].format);
      any_binary_ = any_binary_ || shape.entry_bytes == 0;
      check_box(i);
      if (!check_format(i, shape)) {
        sound_ = false;
        resync_ = true;  // nobody knows where its words and entries end
        continue;
      }
      if (spaces_[i].filled == 0) find(i, RuleId::kLineSpaceEmpty, kFilled, "no shaft is filled");
      check_words(i, shape);
      check_entries(i, shape);
      resync_ = false;
    }
    check_ends();
    const bool declared = (view_.header.required_features & LSP_FEATURE_BINARY) != 0;
    if (declared != any_binary_)
      report_.add(RuleId::kBinaryFeature, offsetof(LspHeader, required_features), 4,
                  "/header/required_features",
                  declared ? "BINARY is set, but every Line Space has candidates"
                           : "BINARY is clear, but a Line Space has no candidates");
  }

 private:
  struct Field {
    const char* name;
    uint64_t offset;
    uint64_t bytes;
  };
  static constexpr Field kBox{"lo", offsetof(LspLineSpace, lo), 28};  // lo, word_first, hi
  static constexpr Field kWordFirst{"word_first", offsetof(LspLineSpace, word_first), 4};
  static constexpr Field kCandidateFirst{"candidate_first", offsetof(LspLineSpace, candidate_first), 4};
  static constexpr Field kFormat{"format", offsetof(LspLineSpace, format), 4};
  static constexpr Field kFilled{"filled", offsetof(LspLineSpace, filled), 4};

  void find(uint64_t i, RuleId id, const Field& field, const std::string& message) {
    report_.add(id, view_.offset_of(Kind::kLspc, i * sizeof(LspLineSpace) + field.offset),
                view_.length_of(Kind::kLspc, field.bytes), element_path(Kind::kLspc, i, field.name), message);
  }

  void check_box(uint64_t i) {
    const lsp_float3 &lo = spaces_[i].lo, &hi = spaces_[i].hi;
    if (!finite(lo) || !finite(hi) || !(lo.x < hi.x && lo.y < hi.y && lo.z < hi.z))
      find(i, RuleId::kLineSpaceBox, kBox, "the box is not finite, flat or inside out");
  }

  bool check_format(uint64_t i, const LineSpaceShape& shape) {
    const uint32_t format = spaces_[i].format;
    constexpr uint32_t kKnown = LSP_FORMAT_RESOLUTION_MASK | LSP_FORMAT_ENTRY_MASK << LSP_FORMAT_ENTRY_SHIFT |
                                LSP_FORMAT_DENSE | LSP_FORMAT_SYMMETRIC | LSP_FORMAT_RETIRED;
    bool sound = true;
    if (shape.resolution == 0 || shape.resolution > LSP_MAX_RESOLUTION) {
      find(i, RuleId::kLineSpaceResolution, kFormat, "the resolution is " + std::to_string(shape.resolution));
      sound = false;
    }
    const uint32_t bytes = shape.entry_bytes;
    const bool entry_sound =
        (bytes == 0 && !shape.dense) || ((bytes == 1 || bytes == 2 || bytes == 4) && !shape.symmetric);
    if (!entry_sound) {
      find(i, RuleId::kEntryBytes, kFormat,
           std::to_string(bytes) + " bytes an entry" + (shape.dense ? ", dense" : "") +
               (shape.symmetric ? ", symmetric" : ""));
      sound = false;
    }
    if (format & ~kKnown) {
      find(i, RuleId::kFormatBits, kFormat, "an unknown bit is set");
      sound = false;
    }
    return sound;
  }

  void check_words(uint64_t i, const LineSpaceShape& shape) {
    const LspLineSpace& space = spaces_[i];
    if (resync_ && shape.words != 0) next_word_ = std::max<uint64_t>(next_word_, space.word_first);
    const uint64_t expected = shape.words == 0 ? 0 : next_word_;
    if (space.word_first != expected)
      find(i, RuleId::kWordsNotCumulative, kWordFirst,
           "is " + std::to_string(space.word_first) + ", not " + std::to_string(expected));
    if (shape.words == 0) return;
    const bool disjoint = space.word_first >= next_word_;
    next_word_ = std::max(next_word_, space.word_first + shape.words);
    if (!view_.part(Kind::kBits).usable) return;
    if (!in_range(space.word_first, shape.words, words_.size())) {
      find(i, RuleId::kWordsOutside, kWordFirst,
           std::to_string(shape.words) + " words from " + std::to_string(space.word_first) +
               " on, BITS has " + std::to_string(words_.size()));
      return;
    }
    if (!disjoint) return;
    const std::span<const LspBitWord> words = words_.subspan(space.word_first, shape.words);
    if (!offsets_sound(words)) report_offsets(space.word_first, words);
    if (const uint64_t tail = shape.shafts % 32; tail != 0 && words.back().bits >> tail != 0)
      find_word(RuleId::kTailBits, space.word_first + shape.words - 1, 0, "bits",
                "bits from " + std::to_string(tail) + " on stand for no shaft, but some are set");
    uint64_t filled = 0;
    if (const LspBitWord& last = words.back(); offsets_were_sound_)
      filled = uint64_t{last.offset} + bit_count(last.bits);
    else
      for (const LspBitWord& word : words) filled += bit_count(word.bits);
    offsets_were_sound_ = true;
    if (filled != space.filled)
      find(i, RuleId::kFilledWrong, kFilled,
           "is " + std::to_string(space.filled) + ", but " + std::to_string(filled) + " bits are set");
  }

  void report_offsets(uint64_t word_first, std::span<const LspBitWord> words) {
    offsets_were_sound_ = false;
    uint64_t expected = 0;
    for (size_t k = 0; k < words.size(); ++k) {
      if (words[k].offset != expected)
        find_word(RuleId::kOffsetWrong, word_first + k, 4, "offset",
                  "is " + std::to_string(words[k].offset) + ", but " + std::to_string(expected) +
                      " bits are set before");
      expected += bit_count(words[k].bits);
    }
  }

  void find_word(RuleId id, uint64_t word, uint64_t field, const char* name, const std::string& message) {
    report_.add(id, view_.offset_of(Kind::kBits, word * sizeof(LspBitWord) + field),
                view_.length_of(Kind::kBits, 4), element_path(Kind::kBits, word, name), message);
  }

  void check_entries(uint64_t i, const LineSpaceShape& shape) {
    const LspLineSpace& space = spaces_[i];
    const uint64_t words = shape.candidate_words(space.filled);
    if (resync_ && words != 0) next_candidate_ = std::max<uint64_t>(next_candidate_, space.candidate_first);
    const uint64_t expected = words == 0 ? 0 : next_candidate_;
    if (space.candidate_first != expected)
      find(i, RuleId::kEntriesNotCumulative, kCandidateFirst,
           "is " + std::to_string(space.candidate_first) + ", not " + std::to_string(expected));
    if (words == 0) return;
    const bool disjoint = space.candidate_first >= next_candidate_;
    next_candidate_ = std::max(next_candidate_, space.candidate_first + words);
    if (!view_.part(Kind::kCand).usable) return;
    if (!in_range(space.candidate_first, words, candidates_.size())) {
      find(i, RuleId::kEntriesOutside, kCandidateFirst,
           std::to_string(words) + " words from " + std::to_string(space.candidate_first) + " on, CAND has " +
               std::to_string(candidates_.size()));
      return;
    }
    if (!disjoint) return;
    const uint32_t* first = candidates_.data() + space.candidate_first;
    switch (shape.entry_bytes) {
      case 1:
        check_entry_values(i, shape, reinterpret_cast<const uint8_t*>(first));
        break;
      case 2:
        check_entry_values(i, shape, reinterpret_cast<const uint16_t*>(first));
        break;
      case 4:
        check_entry_values(i, shape, first);
        break;
      default:
        break;
    }
  }

  template <class Entry>
  void check_entry_values(uint64_t i, const LineSpaceShape& shape, const Entry* entries) {
    const LspLineSpace& space = spaces_[i];
    const uint64_t count = shape.dense ? shape.shafts : space.filled;
    const uint64_t in_words = shape.candidate_words(space.filled) * 4 / sizeof(Entry);
    if (shape.dense) {
      check_dense(i, entries, count);
    } else if (!entries_sound(entries, count, space.triangle_count)) {
      for (uint64_t k = 0; k < count; ++k)
        if (entries[k] >= space.triangle_count) find_entry(i, entries, k);
    }
    for (uint64_t k = count; k < in_words; ++k)
      if (entries[k] != 0)
        report_.add(RuleId::kEntryTail, entry_offset(entries + k),
                    view_.length_of(Kind::kCand, sizeof(Entry)), element_path(Kind::kLspc, i, "entries"),
                    "bytes after the last entry are not zero");
  }

  template <class Entry>
  void check_dense(uint64_t i, const Entry* entries, uint64_t count) {
    constexpr Entry kEmpty = static_cast<Entry>(~Entry{0});
    uint64_t filled = 0;
    for (uint64_t k = 0; k < count; ++k) {
      if (entries[k] == kEmpty) continue;
      ++filled;
      if (entries[k] >= spaces_[i].triangle_count) find_entry(i, entries, k);
    }
    if (filled != spaces_[i].filled)
      find(i, RuleId::kFilledWrong, kFilled,
           "is " + std::to_string(spaces_[i].filled) + ", but " + std::to_string(filled) +
               " entries are not empty");
  }

  template <class Entry>
  uint64_t entry_offset(const Entry* entry) const {
    return view_.offset_of(Kind::kCand,
                           static_cast<uint64_t>(reinterpret_cast<const std::byte*>(entry) -
                                                 reinterpret_cast<const std::byte*>(candidates_.data())));
  }

  template <class Entry>
  void find_entry(uint64_t i, const Entry* entries, uint64_t k) {
    report_.add(RuleId::kEntryOutOfRange, entry_offset(entries + k),
                view_.length_of(Kind::kCand, sizeof(Entry)), [&] {
                  return std::pair{element_path(Kind::kLspc, i, "entries/") + std::to_string(k),
                                   "is " + std::to_string(entries[k]) + ", triangle_count is " +
                                       std::to_string(spaces_[i].triangle_count)};
                });
  }

  // Once every Line Space is sound, its words and those of CAND end where the sections end.
  void check_ends() {
    if (!sound_) return;
    if (view_.part(Kind::kBits).usable && next_word_ < words_.size())
      report_.add(RuleId::kWordsUnused, view_.offset_of(Kind::kBits, next_word_ * sizeof(LspBitWord)),
                  view_.length_of(Kind::kBits, (words_.size() - next_word_) * sizeof(LspBitWord)),
                  element_path(Kind::kBits, next_word_),
                  std::to_string(words_.size() - next_word_) + " words belong to no Line Space");
    if (view_.part(Kind::kCand).usable && next_candidate_ < candidates_.size())
      report_.add(RuleId::kEntriesUnused, view_.offset_of(Kind::kCand, next_candidate_ * 4),
                  view_.length_of(Kind::kCand, (candidates_.size() - next_candidate_) * 4),
                  element_path(Kind::kCand, next_candidate_),
                  std::to_string(candidates_.size() - next_candidate_) + " words belong to no Line Space");
  }

  const FileView& view_;
  Report& report_;
  std::span<const LspLineSpace> spaces_;
  std::span<const LspBitWord> words_;
  std::span<const uint32_t> candidates_;
  uint64_t next_word_ = 0;
  uint64_t next_candidate_ = 0;
  bool any_binary_ = false;
  bool sound_ = true;
  bool resync_ = false;
  bool offsets_were_sound_ = true;
};

}  // namespace

void check_line_spaces(const FileView& view, Report& report) { LineSpaceCheck(view, report).run(); }

}  // namespace lsp::format
