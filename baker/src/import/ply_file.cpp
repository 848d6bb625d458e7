#include "import/ply_file.h"

#include "import/source_file.h"
#include "lsp/program.h"

namespace lsp::ply {
namespace {

bool type_of(std::string_view word, Type& type) {
  constexpr std::pair<std::string_view, Type> kNames[] = {
      {"char", Type::kInt8},      {"int8", Type::kInt8},       {"uchar", Type::kUint8},
      {"uint8", Type::kUint8},    {"short", Type::kInt16},     {"int16", Type::kInt16},
      {"ushort", Type::kUint16},  {"uint16", Type::kUint16},   {"int", Type::kInt32},
      {"int32", Type::kInt32},    {"uint", Type::kUint32},     {"uint32", Type::kUint32},
      {"float", Type::kFloat32},  {"float32", Type::kFloat32}, {"double", Type::kFloat64},
      {"float64", Type::kFloat64}};
  for (const auto& [name, value] : kNames) {
    if (word == name) {
      type = value;
      return true;
    }
  }
  return false;
}

}  // namespace

void fail(const std::string& file, const std::string& what) {
  throw Failure(Exit::kInvalid, file, what + ": export or copy it again");
}

Header read_header(const std::string& file, std::string_view& text) {
  Header header;
  std::string_view line, word;
  if (text.starts_with("\xEF\xBB\xBF")) text.remove_prefix(3);
  if (!take_line(text, line) || trim(line) != "ply") fail(file, "does not start as a PLY file");
  const bool bare_cr = text.data() == line.data() + line.size() + 1 && text.data()[-1] == '\r';
  bool encoded = false;
  while (take_line(text, line)) {
    if (!take_word(line, word) || word == "obj_info") continue;
    if (word == "comment") {
      if (take_word(line, word) && word == "TextureFile") header.textures.emplace_back(unquoted(trim(line)));
      continue;
    }
    if (word == "end_header") {
      if (!encoded) fail(file, "names no format in its header");
      // Where lines end in CR alone, an LF behind the last is the body's first byte.
      if (bare_cr && header.encoding != Encoding::kAscii && text.data()[-1] == '\n')
        text = {text.data() - 1, text.size() + 1};
      return header;
    }
    if (word == "format") {
      take_word(line, word);
      if (word == "ascii") {
        header.encoding = Encoding::kAscii;
      } else if (word == "binary_little_endian") {
        header.encoding = Encoding::kLittle;
      } else if (word == "binary_big_endian") {
        header.encoding = Encoding::kBig;
      } else {
        throw Failure(Exit::kUnsupported, file,
                      "has the format " + printable(word) + ", which PLY does not know");
      }
      encoded = true;
    } else if (word == "element") {
      Element element;
      int64_t count = -1;
      if (take_word(line, word)) element.name = word;
      if (!take_word(line, word) || !integer_of(word, count) || count < 0) {
        fail(file, "has an element without a number in its header");
      }
      element.count = uint64_t(count);
      header.elements.push_back(std::move(element));
    } else if (word == "property") {
      Property property;
      take_word(line, word);
      property.is_list = word == "list";
      bool good = !header.elements.empty();
      if (property.is_list) {
        good = good && take_word(line, word) && type_of(word, property.count_type) && take_word(line, word);
      }
      if (!good || !type_of(word, property.type) || !take_word(line, word)) {
        fail(file, "has a property of type " + printable(word) + " in its header, which PLY does not know");
      }
      property.name = word;
      header.elements.back().properties.push_back(std::move(property));
    }  // anything else is passed over: exporters have written comments without that word
  }
  fail(file, "has a header without an end");
}

}  // namespace lsp::ply
