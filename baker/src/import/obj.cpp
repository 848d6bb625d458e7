// Wavefront OBJ: polygons, normals, materials, texture coordinates, vertex colours (ZBrush's, too). Lines,
// points, curves and surfaces hold no triangles.
#include <algorithm>
#include <charconv>
#include <cmath>
#include <map>
#include <set>

#include "import/find_file.h"
#include "import/mtl.h"
#include "import/mtl_textures.h"
#include "import/polygons.h"
#include "import/readers.h"
#include "import/source_file.h"
#include "import/text.h"
#include "lsp/program.h"

namespace lsp {
namespace {

constexpr std::string_view kDefaultMaterial{};

class ObjReader {
 public:
  ObjReader(const std::filesystem::path& path, MeshBuilder& builder)
      : path_(path), file_(path.string()), builder_(builder), textures_(file_, builder) {}

  void read() {
    const std::string text = read_text(path_, builder_.budget());
    std::string_view rest = text, line;
    std::string joined;
    while (take_joined_line(rest, line, joined)) read_line(line);
    if (soup_.positions.size() >= kNoIndex) {
      throw Failure(Exit::kLimit, file_, "holds more than 2^32 - 2 vertices, split the mesh");
    }
    resolve_materials();
    note_unread();
    if (other_elements_) {
      builder_.note(file_ + ": " + std::to_string(other_elements_) +
                    " lines, points, curves or surfaces hold no triangle");
    }
    note_lost_references();
    use_polypaint();
    soup_.make_colors_linear();
    add_polygons(file_, soup_, builder_);
  }

 private:
  void read_line(std::string_view line) {
    std::string_view word;
    if (!take_word(line, word)) return;
    if (word == "v") {
      push(soup_.positions, read_vector(line));
      read_vertex_color(line);
    } else if (word == "vn") {
      push(soup_.normals, glm::vec3(read_vector(line)));
    } else if (word == "vt") {
      const glm::dvec3 at = read_vector(line);
      push(soup_.texcoords, glm::dvec2(at.x, std::isnan(at.y) ? 1.0 : 1 - at.y));
    } else if (word == "f" || word == "fo") {
      read_face(line);
    } else if (word == "usemtl") {
      use_material(trim(line));
    } else if (word == "s") {
      use_smoothing(line);
    } else if (word == "mtllib") {
      builder_.budget().charge(file_, line.size() + 128);
      libraries_.emplace_back(trim(line));
    } else if (word == "#MRGB") {
      read_polypaint(line);
    } else if (word == "l" || word == "p" || word == "curv" || word == "curv2" || word == "surf") {
      ++other_elements_;
    } else if (!word.starts_with('#') && !says_no_surface(word)) {
      constexpr size_t kMostWords = 8, kLongest = 32;
      if (unknown_words_.size() < kMostWords) unknown_words_.emplace(printable(word.substr(0, kLongest)));
    }
  }

  // Names, groups and what curves and surfaces, which are counted, are made of.
  static bool says_no_surface(std::string_view word) {
    constexpr std::string_view kWords[] = {"o",        "g",          "mg",        "vp",    "deg",  "bmat",
                                           "step",     "cstype",     "parm",      "trim",  "hole", "scrv",
                                           "sp",       "end",        "con",       "bevel", "lod",  "c_interp",
                                           "d_interp", "shadow_obj", "trace_obj", "ctech", "stech"};
    return std::find(std::begin(kWords), std::end(kWords), word) != std::end(kWords);
  }

  template <typename T>
  void push(std::vector<T>& vector, const T& value) {
    builder_.budget().push_back(file_, vector, value);
  }

  // What is not there is NaN: a vertex that takes part in a face then has the face refused by name.
  glm::dvec3 read_vector(std::string_view& line) {
    glm::dvec3 vector(std::numeric_limits<double>::quiet_NaN());
    std::string_view word;
    for (int i = 0; i < 3 && take_word(line, word) && word.front() != '#'; ++i)
      vector[i] = numbers_.read(word);
    return vector;
  }

  // An index counts from 1, or from the end where it is negative. kNoIndex for what refers to nothing yet
  // cannot be told apart here from a vertex further down, which is permitted.
  static uint32_t resolve(std::string_view word, size_t count) {
    int64_t index = 0;
    if (!integer_of(word, index)) return kNoIndex;
    if (index < 0) index += int64_t(count) + 1;
    return index > 0 && index < int64_t{kNoIndex} ? uint32_t(index - 1) : kNoIndex;
  }

  // "v x y z r g b", an extension of many programs. Vertices without are white.
  void read_vertex_color(std::string_view line) {
    glm::vec3 color(1);
    std::string_view word;
    int count = 0;
    const auto take_value = [&] { return take_word(line, word) && word.front() != '#'; };
    for (; count < 3 && take_value(); ++count) color[count] = float(number_of(word));
    // A weight, which polygons do not have, or an alpha: 1 says nothing.
    values_left_ = values_left_ || count == 2 || (count == 1 && color.x != 1);
    if (count == 3 && take_value()) values_left_ = values_left_ || number_of(word) != 1;
    const bool given = count == 3 && std::isfinite(color.x + color.y + color.z);
    if (!given && soup_.colors.empty()) return;
    while (soup_.colors.size() + 1 < soup_.positions.size()) push(soup_.colors, kNoColor);
    push(soup_.colors, given ? color : kNoColor);
  }

  // "#MRGB" and for each of the next vertices eight hexadecimal digits: mask, red, green, blue. ZBrush writes
  // some 64 of them a line.
  void read_polypaint(std::string_view line) {
    constexpr size_t kDigits = 8;
    line = trim(line);
    for (; line.size() >= kDigits; line.remove_prefix(kDigits)) {
      uint32_t mrgb = 0;
      const auto result = std::from_chars(line.data(), line.data() + kDigits, mrgb, 16);
      if (result.ec != std::errc() || result.ptr != line.data() + kDigits) break;
      push(polypaint_, glm::vec3(mrgb >> 16 & 255, mrgb >> 8 & 255, mrgb & 255) / 255.0f);
    }
    bad_polypaint_ = bad_polypaint_ || !line.empty();
  }

  void note_unread() {
    std::string words;
    for (const std::string& word : unknown_words_) words += (words.empty() ? "" : ", ") + word;
    if (!words.empty()) builder_.note(file_ + ": lines that begin with " + words + " are not read");
    if (const std::string odd = numbers_.note(); !odd.empty()) builder_.note(file_ + ": " + odd);
    if (unread_groups_)
      builder_.note(file_ + ": smoothing groups that are no number and not off are not read");
    if (values_left_) builder_.note(file_ + ": weights and alpha of vertices are not read");
  }

  // Normals and texture coordinates may stand below the faces that refer to them.
  void note_lost_references() {
    const auto lost = [](const std::vector<uint32_t>& corners, size_t count) {
      return std::any_of(corners.begin(), corners.end(),
                         [&](uint32_t i) { return i != kNoIndex && i >= count; });
    };
    if (bad_normals_ || lost(soup_.corner_normals, soup_.normals.size()))
      builder_.note(file_ +
                    ": faces refer to normals that are not there, they are made as where none are given");
    if (bad_texcoords_ || lost(soup_.corner_texcoords, soup_.texcoords.size()))
      builder_.note(file_ + ": faces refer to texture coordinates that are not there");
  }

  // Colours that stand with the vertices themselves win.
  void use_polypaint() {
    if (bad_polypaint_)
      builder_.note(file_ + ": an #MRGB line is not eight hexadecimal digits a vertex, its rest is not read");
    if (polypaint_.empty()) return;
    if (!soup_.colors.empty()) {
      builder_.note(file_ + ": the colours of #MRGB lines are not read, those beside the vertices hold");
      return;
    }
    if (polypaint_.size() != soup_.positions.size()) {
      builder_.note(file_ + ": #MRGB lines colour " + std::to_string(polypaint_.size()) + " vertices of " +
                    std::to_string(soup_.positions.size()) + ", the others are white");
    }
    soup_.colors = std::move(polypaint_);
    soup_.colors.resize(std::min(soup_.colors.size(), soup_.positions.size()));
  }

  void read_face(std::string_view line) {
    std::string_view word;
    while (take_word(line, word)) {
      if (word.front() == '#') break;
      const size_t slash = word.find('/');
      push(soup_.corners, resolve(word.substr(0, slash), soup_.positions.size()));
      uint32_t normal = kNoIndex, texcoord = kNoIndex;
      if (slash != word.npos) {
        const size_t second = word.find('/', slash + 1);
        const std::string_view of_texture = word.substr(slash + 1, second - slash - 1);
        const std::string_view of_normal = second == word.npos ? "" : word.substr(second + 1);
        texcoord = resolve(of_texture, soup_.texcoords.size());
        normal = resolve(of_normal, soup_.normals.size());
        bad_texcoords_ = bad_texcoords_ || (texcoord == kNoIndex && !of_texture.empty());
        bad_normals_ = bad_normals_ || (normal == kNoIndex && !of_normal.empty());
      }
      if (texcoord != kNoIndex || !soup_.corner_texcoords.empty()) {
        while (soup_.corner_texcoords.size() + 1 < soup_.corners.size())
          push(soup_.corner_texcoords, kNoIndex);
        push(soup_.corner_texcoords, texcoord);
      }
      if (normal != kNoIndex || !soup_.corner_normals.empty()) {
        while (soup_.corner_normals.size() + 1 < soup_.corners.size()) push(soup_.corner_normals, kNoIndex);
        push(soup_.corner_normals, normal);
      }
    }
    if (!soup_.end_face(file_, builder_.budget())) return;
    push(soup_.materials, material_);
    if (smoothing_ == kNoGroup) return;
    while (soup_.smoothing.size() + 1 < soup_.face_ends.size()) push(soup_.smoothing, kNoGroup);
    push(soup_.smoothing, smoothing_);
  }

  void use_material(std::string_view name) {
    const auto [at, fresh] = names_.try_emplace(std::string(name), uint32_t(used_.size()));
    if (fresh) {
      builder_.budget().charge(file_, 2 * name.size() + 256);
      used_.push_back(at->first);
    }
    material_ = at->second;
  }

  // "s 3", or "s off" and "s 0" for faces that are flat.
  void use_smoothing(std::string_view line) {
    std::string_view word;
    int64_t group = 0;
    if (!take_word(line, word)) return;
    const bool off = equals_ignoring_case(word, "off");
    if (!off && !(integer_of(word, group) && group >= 0 && group < int64_t{kFlatGroup})) {
      unread_groups_ = true;
      return;
    }
    smoothing_ = group == 0 ? kFlatGroup : uint32_t(group);
  }

  // Reads the library `name`, if there is a file by that name.
  bool try_library(const std::string& name, std::map<std::string, MtlMaterial>& materials) {
    // A hostile line may name the same large file thousands of times.
    constexpr size_t kMaxTries = 1000;
    if (++libraries_tried_ > kMaxTries) return true;
    bool guessed = false;
    const std::filesystem::path path = find_file(path_.parent_path(), name, guessed);
    if (path.empty()) return false;
    if (guessed) builder_.note(file_ + ": the material library " + name + " is read from " + path.string());
    std::set<std::string> notes;
    std::map<std::string, MtlMaterial> found;
    read_mtl(path, builder_.budget(), found, notes);
    builder_.add_source(path);
    for (const std::string& note : notes) builder_.note(path.string() + ": " + note);
    for (auto& [material, entry] : found) {
      entry.folder = path.parent_path();
      materials.try_emplace(material, std::move(entry));
    }
    return true;
  }

  // A mtllib line names one file, which may hold spaces, or several.
  void read_libraries(const std::string& words, std::map<std::string, MtlMaterial>& materials) {
    if (words.empty() || try_library(std::string(unquoted(words)), materials)) return;
    std::string_view rest = words, word;
    while (take_word(rest, word) && !word.starts_with('#')) {
      if (!try_library(std::string(unquoted(word)), materials)) {
        builder_.note(file_ + ": the material library " + std::string(word) + " is not there");
        builder_.add_missing(path_beside(path_.parent_path(), std::string(unquoted(word))));
      }
    }
  }

  // Replaces the numbers of names that faces carry by the builder's materials.
  void resolve_materials() {
    std::map<std::string, MtlMaterial> defined;
    std::set<std::string> seen;
    for (const std::string& library : libraries_) {
      if (seen.insert(library).second) read_libraries(library, defined);
    }
    std::vector<uint32_t> ids(used_.size(), kNoIndex);
    uint64_t missing = 0;
    std::string missing_names;
    for (uint32_t& material : soup_.materials) {
      uint32_t& id = ids[material];
      if (id == kNoIndex) {
        const std::string& name = used_[material];
        auto found = defined.find(name);
        if (found == defined.end())  // a comment may stand behind it, but names hold '#', too
          found = defined.find(std::string(trim(std::string_view(name).substr(0, name.find(" #")))));
        Material fallback;
        fallback.name = name;
        if (found == defined.end() && !name.empty()) {
          constexpr size_t kLongest = 200;
          if (missing_names.size() < kLongest)
            missing_names += (missing++ ? ", " : "") + name.substr(0, kLongest);
        }
        id = name.empty() && found == defined.end() ? builder_.default_material()
             : found == defined.end()               ? builder_.add_material(file_, fallback)
                                                    : textures_.add(found->second, soup_.surfaces);
      }
      material = id;
    }
    if (missing) {
      builder_.note(file_ +
                    ": materials are named but not defined, they are taken as grey: " + missing_names);
    }
  }

  const std::filesystem::path& path_;
  const std::string file_;
  MeshBuilder& builder_;
  MtlTextures textures_;
  PolygonSoup soup_;
  // In order, not hashed: a file can choose names that a hash table takes ages over.
  std::map<std::string, uint32_t> names_{{std::string(kDefaultMaterial), 0}};
  std::vector<std::string> used_{std::string(kDefaultMaterial)};  // names, by the number in soup_.materials
  uint32_t material_ = 0;
  uint32_t smoothing_ = kNoGroup;
  bool unread_groups_ = false;
  std::vector<std::string> libraries_;
  size_t libraries_tried_ = 0;
  uint64_t other_elements_ = 0;
  bool bad_normals_ = false, bad_texcoords_ = false;  // a number of one that cannot be
  std::set<std::string> unknown_words_;
  NumberReader numbers_;
  bool values_left_ = false;          // behind the coordinates or colours of vertices
  std::vector<glm::vec3> polypaint_;  // of #MRGB lines, by vertex
  bool bad_polypaint_ = false;
};

}  // namespace

void read_obj(const std::filesystem::path& path, MeshBuilder& builder) { ObjReader(path, builder).read(); }

}  // namespace lsp
