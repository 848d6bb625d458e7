#include "mutator.h"

#include <algorithm>
#include <bit>
#include <cstring>

#include "view.h"

namespace lsp::corpus {
namespace {

constexpr uint64_t kExtremes[] = {
    0,          1,          2,           0x7F,       0xFF,       0x7FFF,       0xFFFF,
    0x7FFFFFFF, 0x80000000, 0x80000001,  0xC0000000, 0x07FFFFFF, 0xFFFFFFFE,   0xFFFFFFFF,
    0x3F800000, 0x7F800000, 0xFF800000u, 0x7FC00000, 0x00800000, ~uint64_t{0}, ~uint64_t{255}};

// A place worth changing: the header, the table, or a section, each as likely as the others.
size_t choose_place(const Bytes& bytes, Random& random) {
  const format::FileView view = format::view_file(bytes);
  const uint64_t choice = random.below(3 + view.table.size());
  uint64_t first = 0, length = bytes.size();
  if (choice == 1) {
    length = std::min<uint64_t>(length, sizeof(LspHeader));
  } else if (choice == 2 && !view.table.empty()) {
    first = view.header.section_table_offset;
    length = view.table.size() * sizeof(LspSection);
  } else if (choice > 2) {
    const LspSection& section = view.table[choice - 3];
    if (section.stored_bytes != 0 && format::in_range(section.offset, section.stored_bytes, bytes.size())) {
      first = section.offset;
      length = section.stored_bytes;
    }
  }
  return first + random.below(length);
}

void change_word(Bytes& bytes, Random& random) {
  size_t at = choose_place(bytes, random);
  const size_t width = random.below(4) == 0 ? 1 : random.below(4) == 0 ? 8 : 4;
  at -= at % width;
  if (at + width > bytes.size()) return;
  uint64_t value = 0;
  std::memcpy(&value, bytes.data() + at, width);
  switch (random.below(6)) {
    case 0:
      value = kExtremes[random.below(std::size(kExtremes))];
      break;
    case 1:
      value += 1;
      break;
    case 2:
      value -= 1;
      break;
    case 3:
      value ^= uint64_t{1} << random.below(width * 8);
      break;
    case 4:
      value = random.next();
      break;
    default: {
      const size_t from = random.below(bytes.size() - width + 1) / width * width;
      std::memcpy(&value, bytes.data() + from, width);
    }
  }
  std::memcpy(bytes.data() + at, &value, width);
}

void exchange_entries(Bytes& bytes, Random& random) {
  const format::FileView view = format::view_file(bytes);
  if (view.table.empty()) return;
  std::byte* table = bytes.data() + view.header.section_table_offset;
  const size_t a = random.below(view.table.size()), b = random.below(view.table.size());
  const size_t field = random.below(sizeof(LspSection) / 8) * 8;
  std::swap_ranges(table + a * sizeof(LspSection) + field, table + a * sizeof(LspSection) + field + 8,
                   table + b * sizeof(LspSection) + field);
}

}  // namespace

void mutate(Bytes& bytes, Random& random, size_t max_size) {
  if (bytes.empty()) bytes.resize(std::min<size_t>(max_size, 256));
  if (bytes.empty()) return;
  const uint64_t changes = 1 + random.below(4);
  for (uint64_t i = 0; i < changes && !bytes.empty(); ++i) {
    const uint64_t kind = random.below(64);
    if (kind == 0)
      bytes.resize(random.below(bytes.size() + 1));
    else if (kind == 1)
      bytes.resize(std::min(max_size, bytes.size() + random.below(512)));
    else if (kind < 4 && bytes.size() >= sizeof(LspHeader))
      exchange_entries(bytes, random);
    else
      change_word(bytes, random);
  }
  if (bytes.size() >= sizeof(LspHeader) && random.below(16) == 0) return;
  if (bytes.size() >= sizeof(LspHeader) && random.below(4) != 0) {
    // What a length changed at random would be refused for at once.
    const uint64_t size = bytes.size();
    std::memcpy(bytes.data() + offsetof(LspHeader, file_bytes), &size, sizeof size);
  }
  repair_hashes(bytes);
}

}  // namespace lsp::corpus
