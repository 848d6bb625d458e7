// Geomview's OFF: [ST][C][N][4][n]OFF, of three dimensions, as text; what is binary goes on in
// off_binary.cpp. Texture coordinates are skipped.
#include <algorithm>
#include <cmath>

#include "import/off_binary.h"
#include "import/polygons.h"
#include "import/readers.h"
#include "import/source_file.h"
#include "import/text.h"
#include "lsp/program.h"

namespace lsp {
namespace {

// Words of the text in order; comments are skipped, and the end of a line can be asked for.
class Words {
 public:
  explicit Words(std::string_view text) : text_(text) {}

  bool next(std::string_view& word) {
    while (!take_word(line_, word)) {
      if (!next_line()) return false;
    }
    return true;
  }
  // Whether words are left on the line of the last one.
  bool line_goes_on() const { return !trim(line_).empty(); }
  // True where the line held words that are now skipped.
  bool skip_line() {
    const bool held = line_goes_on();
    line_ = {};
    return held;
  }
  size_t left_on_line() const {
    std::string_view rest = line_, word;
    size_t count = 0;
    while (take_word(rest, word)) ++count;
    return count;
  }
  void put_back(std::string_view rest_of_word) {
    line_ = {rest_of_word.data(), size_t(line_.data() + line_.size() - rest_of_word.data())};
  }
  // All that follows the line of the last word.
  std::string_view behind_line() const { return text_; }

 private:
  bool next_line() {
    if (!take_line(text_, line_)) return false;
    line_ = line_.substr(0, line_.find('#'));
    return true;
  }
  std::string_view text_, line_;
};

class OffReader {
 public:
  OffReader(const std::string& file, std::string_view text, MeshBuilder& builder)
      : file_(file), words_(text), text_bytes_(text.size()), builder_(builder) {}

  void read() {
    if (read_header()) return read_binary_off(file_, keyword_, words_.behind_line(), builder_);
    const uint64_t vertex_count = read_count("vertices"), face_count = read_count("faces");
    words_.skip_line();  // the number of edges, often missing and never needed
    // A vertex takes at least six bytes, a face two.
    if (vertex_count > text_bytes_ / 6 + 1 || face_count > text_bytes_ / 2 + 1) {
      throw Failure(Exit::kInvalid, file_,
                    "declares more vertices or faces than its bytes can hold: export it again");
    }
    for (uint64_t i = 0; i < vertex_count; ++i) read_vertex();
    for (uint64_t i = 0; i < face_count; ++i) read_face();
    note_unread();
    if (!colored_) soup_.face_colors.clear();
    soup_.make_colors_linear();
    soup_.material = builder_.default_material();
    add_polygons(file_, soup_, builder_);
  }

 private:
  void note_unread() {
    if (const std::string odd = numbers_.note(); !odd.empty()) builder_.note(file_ + ": " + odd);
    if (vertex_values_left_)
      builder_.note(file_ + ": texture coordinates or other values behind those of vertices are not read");
    if (face_values_left_)
      builder_.note(file_ + ": colours of faces by their number in a table are not read");
    if (translucent_) builder_.note(file_ + ": alpha of vertices or faces is not read, all count as solid");
    std::string_view word;
    if (words_.next(word)) builder_.note(file_ + ": what follows the last face is not read");
  }

  template <typename T>
  void push(std::vector<T>& vector, const T& value) {
    builder_.budget().push_back(file_, vector, value);
  }

  std::string_view word() {
    std::string_view word;
    if (!words_.next(word))
      throw Failure(Exit::kInvalid, file_,
                    vertex_values_left_
                        ? "ends too early, and lines hold more than a vertex: give each vertex a "
                          "line of its own, or export it again"
                        : "ends too early, it is cut short: export or copy it again");
    return word;
  }

  uint64_t read_count(const char* what) {
    int64_t value = 0;
    if (!integer_of(word(), value) || value < 0) {
      throw Failure(Exit::kInvalid, file_,
                    std::string("has no number of ") + what + " where one belongs: export it again");
    }
    return uint64_t(value);
  }

  // Whether what follows is binary.
  bool read_header() {
    std::string_view first = word();
    const std::string_view whole = first;
    const auto take = [&](std::string_view prefix) {
      if (first.substr(0, prefix.size()) != prefix) return false;
      first.remove_prefix(prefix.size());
      return true;
    };
    keyword_.has_texcoords = take("ST");
    keyword_.has_colors = take("C");
    keyword_.has_normals = take("N");
    keyword_.has_colors = take("C") || keyword_.has_colors;  // NCOFF occurs, its values in the order of CNOFF
    keyword_.homogeneous = take("4");
    const bool any_dimension = take("n");
    if (!take("OFF") && !take("off")) {
      // The keyword may be left out; the counts then come first.
      int64_t number = 0;
      if (!integer_of(whole, number))
        throw Failure(Exit::kInvalid, file_, "does not start as an OFF file: export it again");
      keyword_ = {};
      first = whole;
    }
    words_.put_back(first);  // "OFF8 6 12" occurs
    Words ahead = words_;
    std::string_view next;
    const bool binary = first.empty() && ahead.next(next) && equals_ignoring_case(next, "BINARY");
    if (any_dimension && binary)
      throw Failure(Exit::kUnsupported, file_, "is a binary nOFF file; give one as text, or an OFF file");
    if (any_dimension) {
      if (const uint64_t dimensions = read_count("dimensions"); dimensions != 3)
        throw Failure(
            Exit::kUnsupported, file_,
            "is an nOFF file of " + std::to_string(dimensions) + " dimensions; give one with three");
    }
    if (binary) words_ = ahead;
    return binary;
  }

  void read_vertex() {
    glm::dvec3 position;
    for (int i = 0; i < 3; ++i) position[i] = numbers_.read(word());
    if (keyword_.homogeneous) position /= numbers_.read(word());
    push(soup_.positions, position);
    if (keyword_.has_normals) {
      glm::vec3 normal;
      for (int i = 0; i < 3; ++i) normal[i] = float(numbers_.read(word()));
      push(soup_.normals, normal);
    }
    glm::vec3 color = kNoColor;
    // Texture coordinates stand behind the colour, which may have an alpha or not.
    const size_t behind = keyword_.has_texcoords ? 2 : 0;
    const bool given = keyword_.has_colors && read_color(color, behind);
    if (given || !soup_.colors.empty()) {
      while (soup_.colors.size() + 1 < soup_.positions.size()) push(soup_.colors, kNoColor);
      push(soup_.colors, color);
    }
    vertex_values_left_ = words_.skip_line() || vertex_values_left_;
  }

  // Three numbers and, where more than `behind` of them follow, alpha; the rest is left. False, with nothing
  // read, where there are not three.
  bool read_color(glm::vec3& color, size_t behind) {
    Words ahead = words_;
    double values[3];
    for (double& value : values) {
      std::string_view text;
      if (!ahead.line_goes_on() || !ahead.next(text)) return false;
      value = number_of(text);
      if (!std::isfinite(value)) return false;
    }
    words_ = ahead;
    color = glm::vec3(values[0], values[1], values[2]);
    std::string_view alpha;
    if (words_.left_on_line() > behind) {
      words_.next(alpha);
      const double value = number_of(alpha);
      translucent_ = translucent_ || (value != 255 && value != 1);
    }
    return true;
  }

  // "n i1 .. in", broken over lines as one likes, and a colour up to the end of the last line.
  void read_face() {
    const uint64_t count = read_count("corners");
    for (uint64_t i = 0; i < count; ++i) {
      int64_t index = -1;
      const bool good = integer_of(word(), index) && index >= 0 && index < int64_t{kNoIndex};
      push(soup_.corners, good ? uint32_t(index) : kNoIndex);
      if (keyword_.has_normals) push(soup_.corner_normals, soup_.corners.back());
    }
    glm::vec3 color = kNoColor;
    colored_ = read_color(color, 0) || colored_;
    face_values_left_ = words_.skip_line() || face_values_left_;
    if (soup_.end_face(file_, builder_.budget())) push(soup_.face_colors, color);
  }

  const std::string file_;
  Words words_;
  const uint64_t text_bytes_;
  MeshBuilder& builder_;
  PolygonSoup soup_;
  OffKeyword keyword_;
  NumberReader numbers_;
  bool colored_ = false;  // some face is
  bool vertex_values_left_ = false, face_values_left_ = false, translucent_ = false;
};

}  // namespace

void read_off(const std::filesystem::path& path, MeshBuilder& builder) {
  const std::string text = read_text(path, builder.budget());
  OffReader(path.string(), text, builder).read();
}

}  // namespace lsp
