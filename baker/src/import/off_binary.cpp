#include "import/off_binary.h"

#include <bit>
#include <cstring>

#include "import/polygons.h"
#include "lsp/program.h"

namespace lsp {
namespace {

constexpr uint32_t kCounted = kNoIndex;  // of a face's colour: the number of its values stands before them

struct Layout {
  bool big_endian = true;
  uint32_t vertex_color = 4;  // values, where the keyword has a C
  uint32_t face_color = kCounted;

  bool is_geomview() const { return big_endian && vertex_color == 4 && face_color == kCounted; }
};

// Words of 32 bits, one after the other.
class BinaryWords {
 public:
  BinaryWords(std::string_view bytes, bool big_endian) : bytes_(bytes), big_endian_(big_endian) {}

  uint64_t left() const { return bytes_.size() / kWord; }
  size_t bytes_left() const { return bytes_.size(); }
  // The word in front, which must be there.
  uint32_t take() {
    uint32_t word = 0;
    std::memcpy(&word, bytes_.data(), kWord);
    bytes_.remove_prefix(kWord);
    return big_endian_ ? __builtin_bswap32(word) : word;
  }
  float take_float() { return std::bit_cast<float>(take()); }
  // False where there are not as many.
  bool skip(uint64_t words) {
    if (words > left()) return false;
    bytes_.remove_prefix(words * kWord);
    return true;
  }

 private:
  static constexpr size_t kWord = 4;
  std::string_view bytes_;
  bool big_endian_;
};

class BinaryOffReader {
 public:
  BinaryOffReader(const std::string& file, const OffKeyword& keyword, std::string_view body,
                  MeshBuilder& builder)
      : file_(file), keyword_(keyword), body_(body), builder_(builder) {}

  void read() {
    choose_layout();
    BinaryWords words(body_, layout_.big_endian);
    const uint32_t vertices = words.take(), faces = words.take();
    words.take();  // the number of edges, which nobody needs
    for (uint32_t i = 0; i < vertices; ++i) read_vertex(words);
    for (uint32_t i = 0; i < faces; ++i) read_face(words);
    if (words.bytes_left() > 0)
      builder_.note(file_ + ": " + std::to_string(words.bytes_left()) +
                    " bytes after the last face are not read");
    note_unread();
    use_colors();
    soup_.material = builder_.default_material();
    add_polygons(file_, soup_, builder_);
  }

 private:
  uint64_t vertex_words(const Layout& layout) const {
    return (keyword_.homogeneous ? 4u : 3u) + (keyword_.has_normals ? 3u : 0u) +
           (keyword_.has_colors ? layout.vertex_color : 0u) + (keyword_.has_texcoords ? 2u : 0u);
  }

  // Whether the vertices that are declared have room, and the faces could.
  bool counts_fit(const Layout& layout) const {
    BinaryWords words(body_, layout.big_endian);
    if (words.left() < 3) return false;
    const uint64_t vertices = words.take(), faces = words.take();
    words.take();
    return words.skip(vertices * vertex_words(layout)) && faces <= words.left();
  }

  // Whether the faces end where the file does, and have all their corners among the vertices.
  bool fits(const Layout& layout) const {
    if (!counts_fit(layout)) return false;
    BinaryWords words(body_, layout.big_endian);
    const uint32_t vertices = words.take(), faces = words.take();
    words.take();
    words.skip(vertices * vertex_words(layout));
    for (uint32_t face = 0; face < faces; ++face) {
      const uint32_t corners = words.left() > 0 ? words.take() : kNoIndex;
      if (corners > words.left()) return false;
      if (corners < 3 && !layout.is_geomview()) return false;  // a file cut short would fit by chance
      for (uint32_t i = 0; i < corners; ++i) {
        if (words.take() >= vertices) return false;
      }
      const bool counted = layout.face_color == kCounted;
      if (counted && words.left() == 0) return false;
      const uint32_t values = counted ? words.take() : layout.face_color;
      constexpr uint32_t kMostValues = 4;
      if (values > kMostValues || !words.skip(values)) return false;
    }
    return words.bytes_left() == 0;
  }

  void choose_layout() {
    // OpenMesh writes the C for colours of faces alone, too.
    for (const bool big_endian : {true, false}) {
      for (const uint32_t vertex_color : {4u, 3u, 0u}) {
        for (const uint32_t face_color : {kCounted, 0u, 3u, 4u}) {
          layout_ = {big_endian, vertex_color, face_color};
          if (!fits(layout_)) continue;
          if (!layout_.is_geomview()) note_layout();
          return;
        }
        if (!keyword_.has_colors) break;
      }
    }
    for (const bool big_endian : {true, false}) {
      layout_ = {big_endian};
      if (counts_fit(layout_)) return;
    }
    throw Failure(
        Exit::kInvalid, file_,
        "is a binary OFF file and, in either order of bytes, declares more vertices or faces than its "
        "bytes can hold: export or copy it again");
  }

  void note_layout() {
    builder_.note(file_ + ": its words are taken as OpenMesh writes them, " +
                  (layout_.big_endian ? "highest" : "lowest") + " byte first, and colours " +
                  (layout_.face_color == kCounted ? "with" : "without") + " their number of values");
  }

  void note_unread() {
    if (keyword_.has_texcoords) builder_.note(file_ + ": texture coordinates of vertices are not read");
    if (by_table_) builder_.note(file_ + ": colours of faces by their number in a table are not read");
    if (translucent_) builder_.note(file_ + ": alpha of vertices or faces is not read, all count as solid");
  }

  template <typename T>
  void push(std::vector<T>& vector, const T& value) {
    builder_.budget().push_back(file_, vector, value);
  }

  // A colour's words as they are: whether they are floats or, as OpenMesh writes them, whole numbers up to
  // 255, is known only when all are read.
  struct ColorWords {
    uint32_t words[3] = {kNone, kNone, kNone};
  };

  // `values`: three, or four with alpha.
  ColorWords read_color(BinaryWords& words, uint32_t values) {
    ColorWords color;
    for (uint32_t& word : color.words) {
      word = words.take();
      whole_ = whole_ && word <= 255;
    }
    if (values < 4) return color;
    const uint32_t alpha = words.take();
    translucent_ = translucent_ || (alpha != 255 && alpha != std::bit_cast<uint32_t>(1.0f) &&
                                    alpha != std::bit_cast<uint32_t>(255.0f));
    return color;
  }

  void read_vertex(BinaryWords& words) {
    glm::dvec3 position;
    for (int i = 0; i < 3; ++i) position[i] = double(words.take_float());
    if (keyword_.homogeneous) position /= double(words.take_float());
    push(soup_.positions, position);
    if (keyword_.has_normals) {
      glm::vec3 normal;
      for (int i = 0; i < 3; ++i) normal[i] = words.take_float();
      push(soup_.normals, normal);
    }
    if (keyword_.has_colors && layout_.vertex_color > 0)
      push(vertex_colors_, read_color(words, layout_.vertex_color));
    if (keyword_.has_texcoords) words.skip(2);
  }

  void need(const BinaryWords& words, uint64_t count) {
    if (count > words.left())
      throw Failure(Exit::kInvalid, file_,
                    "ends inside a face, it is cut short or damaged: export or copy it again");
  }

  void read_face(BinaryWords& words) {
    need(words, 1);
    const uint32_t corners = words.take();
    need(words, corners);
    for (uint32_t i = 0; i < corners; ++i) {
      push(soup_.corners, words.take());
      if (keyword_.has_normals) push(soup_.corner_normals, soup_.corners.back());
    }
    const bool counted = layout_.face_color == kCounted;
    need(words, counted ? 1 : 0);
    const uint32_t values = counted ? words.take() : layout_.face_color;
    need(words, values);
    ColorWords color;
    if (values == 3 || values == 4) {
      color = read_color(words, values);
      colored_ = true;
    } else {
      words.skip(values);
      by_table_ = by_table_ || values > 0;
    }
    if (soup_.end_face(file_, builder_.budget())) push(face_colors_, color);
  }

  void use_colors() {
    const auto convert = [&](const std::vector<ColorWords>& from, std::vector<glm::vec3>& to) {
      for (const ColorWords& color : from) {
        glm::vec3 value = kNoColor;
        for (int i = 0; i < 3 && color.words[0] != kNone; ++i)
          value[i] = whole_ ? float(color.words[i]) / 255.0f : std::bit_cast<float>(color.words[i]);
        push(to, value);
      }
    };
    convert(vertex_colors_, soup_.colors);
    if (colored_) convert(face_colors_, soup_.face_colors);
    soup_.make_colors_linear();
  }

  static constexpr uint32_t kNone = 0xFFFFFFFFu;  // no float that says anything, and no byte

  const std::string& file_;
  const OffKeyword keyword_;
  const std::string_view body_;
  MeshBuilder& builder_;
  Layout layout_;
  PolygonSoup soup_;
  std::vector<ColorWords> vertex_colors_, face_colors_;
  bool whole_ = true;     // every word of a colour so far could be a byte
  bool colored_ = false;  // some face is
  bool by_table_ = false, translucent_ = false;
};

}  // namespace

void read_binary_off(const std::string& file, const OffKeyword& keyword, std::string_view body,
                     MeshBuilder& builder) {
  BinaryOffReader(file, keyword, body, builder).read();
}

}  // namespace lsp
