// PLY, ASCII and binary of either byte order: vertex x y z, nx ny nz, red green blue; face vertex_indices (or
// vertex_index); tristrips. Every other element and property is skipped by its type.
#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <set>

#include "import/polygons.h"
#include "import/readers.h"
#include "import/source_file.h"
#include "import/text.h"
#include "lsp/program.h"

namespace lsp {
namespace {

enum class Type { kInt8, kUint8, kInt16, kUint16, kInt32, kUint32, kFloat32, kFloat64 };
enum class Encoding { kAscii, kLittle, kBig };

struct Property {
  std::string name;
  Type type = Type::kFloat32;
  bool is_list = false;
  Type count_type = Type::kUint8;
};

struct Element {
  std::string name;
  uint64_t count = 0;
  std::vector<Property> properties;
};

size_t size_of(Type type) {
  switch (type) {
    case Type::kInt8:
    case Type::kUint8:
      return 1;
    case Type::kInt16:
    case Type::kUint16:
      return 2;
    case Type::kFloat64:
      return 8;
    default:
      return 4;
  }
}

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

[[noreturn]] void fail(const std::string& file, const std::string& what) {
  throw Failure(Exit::kInvalid, file, what + ": export or copy it again");
}

struct Header {
  Encoding encoding = Encoding::kAscii;
  std::vector<Element> elements;
  std::set<std::string> textures;  // named by comments, as some programs do
};

Header read_header(const std::string& file, std::string_view& text) {
  Header header;
  std::string_view line, word;
  if (!take_line(text, line) || trim(line) != "ply") fail(file, "does not start as a PLY file");
  bool encoded = false;
  while (take_line(text, line)) {
    if (!take_word(line, word) || word == "obj_info") continue;
    if (word == "comment") {
      if (take_word(line, word) && word == "TextureFile") header.textures.insert(std::string(trim(line)));
      continue;
    }
    if (word == "end_header") {
      if (!encoded) fail(file, "names no format in its header");
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
        fail(file, "has a property without a known type in its header");
      }
      property.name = word;
      header.elements.back().properties.push_back(std::move(property));
    }  // anything else is passed over: exporters have written comments without that word
  }
  fail(file, "has a header without an end");
}

// Values of the body one after the other. An element of an ASCII body may be broken over lines; what its last
// line holds beyond the declared properties is passed over, as files with undeclared values exist.
class Body {
 public:
  Body(const std::string& file, std::string_view bytes, Encoding encoding)
      : file_(file), bytes_(bytes), encoding_(encoding) {}

  size_t left() const { return bytes_.size(); }

  double number(Type type) {
    if (encoding_ == Encoding::kAscii) return number_of(word());
    switch (type) {
      case Type::kInt8:
        return double(binary<int8_t>());
      case Type::kUint8:
        return double(binary<uint8_t>());
      case Type::kInt16:
        return double(binary<int16_t>());
      case Type::kUint16:
        return double(binary<uint16_t>());
      case Type::kInt32:
        return double(binary<int32_t>());
      case Type::kUint32:
        return double(binary<uint32_t>());
      case Type::kFloat32:
        return double(binary<float>());
      default:
        return binary<double>();
    }
  }

  // -1 for what is no whole number of 0 or more (strips end with -1).
  int64_t index(Type type) {
    if (encoding_ == Encoding::kAscii) {
      const std::string_view text = word();
      int64_t value = -1;
      if (integer_of(text, value)) return value;
      return whole(number_of(text));
    }
    return whole(number(type));
  }

  void end_element() {
    if (encoding_ != Encoding::kAscii) return;
    size_t end = 0;
    while (end < bytes_.size() && !is_line_end(bytes_[end])) ++end;
    bytes_.remove_prefix(end);
  }

  void skip(const Property& property) {
    const uint64_t count = property.is_list ? list_length(property) : 1;
    if (encoding_ != Encoding::kAscii) {
      take(count * size_of(property.type));
    } else {
      for (uint64_t i = 0; i < count; ++i) word();
    }
  }

  uint64_t list_length(const Property& property) {
    const int64_t count = index(property.count_type);
    const size_t least = encoding_ == Encoding::kAscii ? 1 : size_of(property.type);
    if (count < 0 || uint64_t(count) > left() / least)
      fail(file_, "has a list longer than what is left of it");
    return uint64_t(count);
  }

 private:
  static int64_t whole(double value) {
    return value >= 0 && value < 9e15 && value == std::floor(value) ? int64_t(value) : -1;
  }

  std::string_view word() {
    size_t begin = 0;
    const auto is_space = [](char c) { return is_blank(c) || is_line_end(c); };
    while (begin < bytes_.size() && is_space(bytes_[begin])) ++begin;
    size_t end = begin;
    while (end < bytes_.size() && !is_space(bytes_[end])) ++end;
    const std::string_view found = bytes_.substr(begin, end - begin);
    if (found.empty()) fail(file_, "holds less than its header says");
    bytes_.remove_prefix(end);
    return found;
  }

  std::string_view take(uint64_t count) {
    if (count > bytes_.size()) fail(file_, "holds less than its header says");
    const std::string_view taken = bytes_.substr(0, count);
    bytes_.remove_prefix(count);
    return taken;
  }

  template <typename T>
  T binary() {
    char raw[sizeof(T)];
    std::memcpy(raw, take(sizeof(T)).data(), sizeof(T));
    static_assert(std::endian::native == std::endian::little);
    if (encoding_ == Encoding::kBig) std::reverse(raw, raw + sizeof(T));
    T value;
    std::memcpy(&value, raw, sizeof(T));
    return value;
  }

  const std::string& file_;
  std::string_view bytes_;
  const Encoding encoding_;
};

class PlyReader {
 public:
  PlyReader(const std::string& file, Body& body, MeshBuilder& builder)
      : file_(file), body_(body), builder_(builder) {}

  void read(const Header& header) {
    for (const Element& element : header.elements) {
      has_normals_ = has_normals_ || (element.name == "vertex" && holds_normals(element));
    }
    for (const Element& element : header.elements) {
      check_size(element, header.encoding);
      if (element.name == "vertex") {
        read_vertices(element);
      } else if (element.name == "face") {
        read_faces(element, false);
      } else if (element.name == "tristrips") {
        read_faces(element, true);
      } else {
        skip(element);
      }
    }
    for (const std::string& name : header.textures)
      builder_.note(file_ + ": the texture " + name + " is not read, its coordinates neither");
    if (translucent_) builder_.note(file_ + ": alpha of vertices or faces is not read, all count as solid");
    soup_.material = builder_.default_material();
    add_polygons(file_, soup_, builder_);
  }

 private:
  static bool holds_normals(const Element& element) {
    int found = 0;
    for (const Property& property : element.properties) {
      found += !property.is_list && (property.name == "nx" || property.name == "ny" || property.name == "nz");
    }
    return found >= 3;
  }

  // So that a header cannot make the reader loop for ages over nothing.
  void check_size(const Element& element, Encoding encoding) {
    uint64_t least = 0;
    for (const Property& property : element.properties) {
      least +=
          encoding == Encoding::kAscii ? 2 : size_of(property.is_list ? property.count_type : property.type);
    }
    if (least > 0 && element.count > (body_.left() + 1) / least) {
      fail(file_, "declares " + std::to_string(element.count) + " of element " + printable(element.name) +
                      " and is too short for them");
    }
  }

  void skip(const Element& element) {
    if (element.properties.empty()) return;
    for (uint64_t i = 0; i < element.count; ++i) {
      for (const Property& property : element.properties) body_.skip(property);
      body_.end_element();
    }
  }

  // Where the properties of an element's colour are: their places, and what makes them 0 to 1.
  struct ColorProperties {
    int places[4] = {-1, -1, -1, -1};
    double scale = 1;
    bool there() const { return places[0] >= 0 && places[1] >= 0 && places[2] >= 0; }
    // Which component a property is, -1 for none.
    int component(size_t property) const {
      for (int i = 0; i < 4; ++i) {
        if (places[i] == int(property)) return i;
      }
      return -1;
    }
  };

  static ColorProperties color_properties(const Element& element) {
    constexpr std::string_view kNames[] = {"red", "green", "blue", "alpha"};
    ColorProperties out;
    for (size_t k = 0; k < element.properties.size(); ++k) {
      std::string_view name = element.properties[k].name;
      if (name.starts_with("diffuse_")) name.remove_prefix(8);
      for (int i = 0; i < 4; ++i) {
        if (name != kNames[i] || element.properties[k].is_list || out.places[i] >= 0) continue;
        out.places[i] = int(k);
        const Type type = element.properties[k].type;
        if (type == Type::kUint8) out.scale = 255;
        if (type == Type::kUint16) out.scale = 65535;
      }
    }
    return out;
  }

  // What was read of a colour, on the sRGB curve, in linear light.
  glm::vec3 linear_color(const glm::dvec4& color, double scale) {
    glm::vec3 out;
    for (int i = 0; i < 3; ++i) {
      const double value = color[i] / scale;
      out[i] = float(linear_of_srgb(std::isfinite(value) ? std::clamp(value, 0.0, 1.0) : 1.0));
    }
    translucent_ = translucent_ || color.a < scale;
    return out;
  }

  void read_vertices(const Element& element) {
    // Where each property goes: 0..2 position, 3..5 normal, 6.. colour, -1 nowhere.
    constexpr std::string_view kTargets[] = {"x", "y", "z", "nx", "ny", "nz"};
    const ColorProperties color = color_properties(element);
    std::vector<int> targets;
    int seen = 0;
    for (size_t k = 0; k < element.properties.size(); ++k) {
      const Property& property = element.properties[k];
      int target = -1;
      for (int i = 0; i < 6; ++i) {
        if (property.name == kTargets[i] && !property.is_list && !(seen >> i & 1)) target = i;
      }
      if (target >= 0) seen |= 1 << target;
      if (const int component = color.component(k); color.there() && component >= 0) target = 6 + component;
      targets.push_back(target);
    }
    if (element.count > 0 && (seen & 7) != 7) fail(file_, "has vertices without x, y and z");
    if (element.count >= kNoIndex - soup_.positions.size()) {
      throw Failure(Exit::kLimit, file_, "holds more than 2^32 - 2 vertices, split the mesh");
    }
    builder_.budget().charge(file_, element.count,
                             sizeof(glm::dvec3) + (has_normals_ ? sizeof(glm::vec3) : 0) +
                                 (color.there() ? sizeof(glm::vec3) : 0));
    soup_.positions.reserve(soup_.positions.size() + element.count);
    if (has_normals_) soup_.normals.reserve(soup_.normals.size() + element.count);
    const size_t count = element.properties.size();
    for (uint64_t i = 0; i < element.count; ++i) {
      double values[10] = {0, 0, 0, 0, 0, 0, 0, 0, 0, color.scale};
      for (size_t k = 0; k < count; ++k) {
        if (targets[k] < 0) {
          body_.skip(element.properties[k]);
        } else {
          values[targets[k]] = body_.number(element.properties[k].type);
        }
      }
      body_.end_element();
      soup_.positions.push_back({values[0], values[1], values[2]});
      if (has_normals_) soup_.normals.push_back(glm::vec3(values[3], values[4], values[5]));
      if (!color.there()) continue;
      soup_.colors.resize(soup_.positions.size() - 1, glm::vec3(1));
      soup_.colors.push_back(linear_color({values[6], values[7], values[8], values[9]}, color.scale));
    }
  }

  void read_faces(const Element& element, bool strips) {
    size_t list = element.properties.size();
    for (size_t k = 0; k < element.properties.size(); ++k) {
      const Property& property = element.properties[k];
      if (property.is_list && (property.name == "vertex_indices" || property.name == "vertex_index"))
        list = k;
    }
    const ColorProperties color = color_properties(element);
    if (list == element.properties.size()) return skip(element);
    std::vector<uint32_t> strip;
    for (uint64_t i = 0; i < element.count; ++i) {
      glm::dvec4 rgba(0, 0, 0, color.scale);
      for (size_t k = 0; k < element.properties.size(); ++k) {
        const Property& property = element.properties[k];
        if (const int component = color.component(k); color.there() && component >= 0) {
          rgba[component] = body_.number(property.type);
          continue;
        }
        if (k != list) {
          body_.skip(property);
          continue;
        }
        const uint64_t length = body_.list_length(property);
        strip.clear();
        for (uint64_t c = 0; c < length; ++c) {
          const int64_t index = body_.index(property.type);
          if (strips && index < 0) {
            end_strip(strip);
            continue;
          }
          const uint32_t corner = index >= 0 && index < int64_t{kNoIndex} ? uint32_t(index) : kNoIndex;
          if (strips) {
            push(strip, corner);
          } else {
            add_corner(corner);
          }
        }
        if (strips) {
          end_strip(strip);
        } else {
          soup_.end_face(file_, builder_.budget());
        }
      }
      body_.end_element();
      if (!color.there()) continue;
      soup_.face_colors.resize(std::min(soup_.face_colors.size(), soup_.face_ends.size()));
      const glm::vec3 linear = linear_color(rgba, color.scale);
      while (soup_.face_colors.size() < soup_.face_ends.size()) push(soup_.face_colors, linear);
    }
  }

  template <typename T>
  void push(std::vector<T>& vector, const T& value) {
    builder_.budget().push_back(file_, vector, value);
  }

  void add_corner(uint32_t corner) {
    push(soup_.corners, corner);
    if (has_normals_) push(soup_.corner_normals, corner);
  }

  // A strip's triangle k is (k, k+1, k+2), every second one turned round.
  void end_strip(std::vector<uint32_t>& strip) {
    for (size_t k = 0; k + 2 < strip.size(); ++k) {
      add_corner(strip[k]);
      add_corner(strip[k + 1 + k % 2]);
      add_corner(strip[k + 2 - k % 2]);
      soup_.end_face(file_, builder_.budget());
    }
    strip.clear();
  }

  const std::string& file_;
  Body& body_;
  MeshBuilder& builder_;
  PolygonSoup soup_;
  bool has_normals_ = false;
  bool translucent_ = false;
};

}  // namespace

void read_ply(const std::filesystem::path& path, MeshBuilder& builder) {
  const std::string file = path.string();
  const std::string bytes = read_file(path, builder.budget());
  std::string_view text = bytes;
  const Header header = read_header(file, text);
  Body body(file, text, header.encoding);
  PlyReader(file, body, builder).read(header);
}

}  // namespace lsp
