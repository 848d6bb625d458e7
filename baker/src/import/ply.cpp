// PLY, ASCII and binary of either byte order: vertex x y z, nx ny nz, red green blue; face vertex_indices (or
// vertex_index); tristrips. With textures, which comments name: vertex s t (or u v, texture_u texture_v), or
// face texcoord, and face texnumber. Every other element and property is skipped by its type.
#include <algorithm>
#include <cmath>
#include <span>

#include "import/mtl_textures.h"
#include "import/ply_file.h"
#include "import/polygons.h"
#include "import/readers.h"
#include "import/source_file.h"
#include "import/text.h"
#include "lsp/program.h"

namespace lsp {
namespace {

using namespace ply;

class PlyReader {
 public:
  PlyReader(const std::filesystem::path& path, const std::string& file, Body& body, MeshBuilder& builder)
      : folder_(path.parent_path()), file_(file), body_(body), builder_(builder) {}

  void read(const Header& header) {
    textured_ = !header.textures.empty();
    for (const Element& element : header.elements) {
      if (element.name != "vertex") continue;
      has_normals_ = has_normals_ || holds_normals(element);
      vertices_placed_ = vertices_placed_ || holds_texcoords(element);
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
        if (element.count > 0) builder_.note(file_ + ": the element " + element.name + " is not read");
      }
    }
    note_unread_bytes();
    if (largest_short_ > 0 && largest_short_ <= 255)
      builder_.note(file_ + ": no colour of 16 bits is above 255, they are taken as bytes");
    if (translucent_) builder_.note(file_ + ": alpha of vertices or faces is not read, all count as solid");
    soup_.material = builder_.default_material();
    use_textures(header.textures);
    soup_.make_colors_linear();
    add_polygons(file_, soup_, builder_);
  }

 private:
  static bool holds_normals(const Element& element) {
    int found = 0;
    for (const Property& property : element.properties) {
      for (const std::string_view name : {"nx", "ny", "nz"})
        found += !property.is_list && equals_ignoring_case(property.name, name);
    }
    return found >= 3;
  }

  bool holds_texcoords(const Element& element) const {
    bool held[2] = {};
    for (const Property& property : element.properties) {
      if (const int place = texcoord_of(property); place >= 0) held[place] = true;
    }
    return held[0] && held[1];
  }

  void note_unread_bytes() {
    if (const std::string odd = body_.numbers().note(); !odd.empty()) builder_.note(file_ + ": " + odd);
    if (body_.passed_over())
      builder_.note(file_ + ": lines hold more values than the header declares, they are not read");
    if (const size_t bytes = body_.tail(); bytes > 0) {
      builder_.note(file_ + ": " + std::to_string(bytes) +
                    " bytes after what the header declares are not read");
    }
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

  // Where the properties of an element's colour are: their places, and what they are at their largest.
  struct ColorProperties {
    int places[4] = {-1, -1, -1, -1};
    double unit = 1;
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
    constexpr std::string_view kNames[] = {"red", "green", "blue", "alpha"}, kShort[] = {"r", "g", "b", "a"};
    ColorProperties out;
    for (size_t k = 0; k < element.properties.size(); ++k) {
      std::string_view name = element.properties[k].name;
      if (equals_ignoring_case(name.substr(0, 8), "diffuse_")) name.remove_prefix(8);
      for (int i = 0; i < 4; ++i) {
        const bool named = equals_ignoring_case(name, kNames[i]) || equals_ignoring_case(name, kShort[i]);
        if (!named || element.properties[k].is_list || out.places[i] >= 0) continue;
        out.places[i] = int(k);
        const Type type = element.properties[k].type;
        if (type != Type::kFloat32 && type != Type::kFloat64) out.unit = 255;
      }
    }
    return out;
  }

  // A component of a colour. Bytes above 127 are negative where the header calls them signed.
  double color_value(const Property& property) {
    const double value = body_.number(property.type);
    if (property.type == Type::kUint16) largest_short_ = std::max(largest_short_, value);
    return property.type == Type::kInt8 && value < 0 ? value + 256 : value;
  }

  glm::vec3 color_of(const glm::dvec4& color, double unit) {
    const bool solid = color.a == unit || color.a == 255 || color.a == 65535 || color.a == 4294967295.0;
    translucent_ = translucent_ || !solid;
    return glm::vec3(glm::dvec3(color));
  }

  // Names the properties of an element that `is_read` does not say are read.
  template <typename IsRead>
  void note_unread(const Element& element, const IsRead& is_read) {
    std::string names;
    for (size_t k = 0; k < element.properties.size() && names.size() < 200; ++k) {
      if (!is_read(k)) names += (names.empty() ? "" : ", ") + element.properties[k].name;
    }
    if (!names.empty() && element.count > 0)
      builder_.note(file_ + ": of each " + element.name + " " + names + " is not read");
  }

  // A property's place among texture coordinates, 0 or 1; -1: it is none.
  int texcoord_of(const Property& property) const {
    if (!textured_ || property.is_list) return -1;
    for (const std::string_view first : {"s", "u", "texture_s", "texture_u"}) {
      if (equals_ignoring_case(property.name, first)) return 0;
    }
    for (const std::string_view second : {"t", "v", "texture_t", "texture_v"}) {
      if (equals_ignoring_case(property.name, second)) return 1;
    }
    return -1;
  }

  // v grows upwards, as in OBJ.
  static glm::dvec2 from_upper_left(double u, double v) { return {u, 1 - v}; }

  void read_vertices(const Element& element) {
    // Where each property goes: 0..2 position, 3..5 normal, 6..9 colour, 10 and 11 texture coordinates, -1
    // nowhere.
    constexpr std::string_view kTargets[] = {"x", "y", "z", "nx", "ny", "nz"};
    const ColorProperties color = color_properties(element);
    std::vector<int> targets;
    int seen = 0;
    for (size_t k = 0; k < element.properties.size(); ++k) {
      const Property& property = element.properties[k];
      int target = -1;
      for (int i = 0; i < 6; ++i) {
        if (equals_ignoring_case(property.name, kTargets[i]) && !property.is_list && !(seen >> i & 1))
          target = i;
      }
      if (target >= 0) seen |= 1 << target;
      if (const int component = color.component(k); color.there() && component >= 0) target = 6 + component;
      if (const int place = texcoord_of(property); place >= 0) target = 10 + place;
      targets.push_back(target);
    }
    note_unread(element, [&](size_t k) { return targets[k] >= 0; });
    const bool placed = holds_texcoords(element);
    soup_.color_unit = std::max(soup_.color_unit, color.unit);
    if (element.count > 0 && (seen & 7) != 7) fail(file_, "has vertices without x, y and z");
    if (element.count >= kNoIndex - soup_.positions.size()) {
      throw Failure(Exit::kLimit, file_, "holds more than 2^32 - 2 vertices, split the mesh");
    }
    builder_.budget().charge(file_, element.count,
                             sizeof(glm::dvec3) + (has_normals_ ? sizeof(glm::vec3) : 0) +
                                 (color.there() ? sizeof(glm::vec3) : 0) + (placed ? sizeof(glm::dvec2) : 0));
    soup_.positions.reserve(soup_.positions.size() + element.count);
    if (has_normals_) soup_.normals.reserve(soup_.normals.size() + element.count);
    const size_t count = element.properties.size();
    for (uint64_t i = 0; i < element.count; ++i) {
      double values[12] = {0, 0, 0, 0, 0, 0, 0, 0, 0, color.unit, 0, 0};
      for (size_t k = 0; k < count; ++k) {
        if (targets[k] < 0) {
          body_.skip(element.properties[k]);
        } else {
          const bool of_color = targets[k] >= 6 && targets[k] < 10;
          values[targets[k]] =
              of_color ? color_value(element.properties[k]) : body_.number(element.properties[k].type);
        }
      }
      body_.end_element();
      soup_.positions.push_back({values[0], values[1], values[2]});
      if (has_normals_) soup_.normals.push_back(glm::vec3(values[3], values[4], values[5]));
      if (placed) {
        soup_.texcoords.resize(soup_.positions.size() - 1);
        soup_.texcoords.push_back(from_upper_left(values[10], values[11]));
      }
      if (!color.there()) continue;
      soup_.colors.resize(soup_.positions.size() - 1, kNoColor);
      soup_.colors.push_back(color_of({values[6], values[7], values[8], values[9]}, color.unit));
    }
  }

  // Which of a face's properties mean something.
  struct FaceProperties {
    size_t corners, texcoords, texture;  // the element's number of properties: not there
    ColorProperties color;
    bool holds(size_t k) const {
      return k == corners || k == texcoords || k == texture || (color.there() && color.component(k) >= 0);
    }
  };

  FaceProperties face_properties(const Element& element) const {
    const size_t none = element.properties.size();
    FaceProperties out{none, none, none, color_properties(element)};
    for (size_t k = 0; k < none; ++k) {
      const Property& property = element.properties[k];
      const auto is = [&](std::string_view name) { return equals_ignoring_case(property.name, name); };
      if (property.is_list && (is("vertex_indices") || is("vertex_index"))) out.corners = k;
      if (textured_ && property.is_list && is("texcoord")) out.texcoords = k;
      if (textured_ && !property.is_list && is("texnumber")) out.texture = k;
    }
    return out;
  }

  void read_faces(const Element& element, bool strips) {
    const FaceProperties properties = face_properties(element);
    note_unread(element, [&](size_t k) { return properties.holds(k); });
    if (properties.corners == element.properties.size()) return skip(element);
    const ColorProperties& color = properties.color;
    soup_.face_color_unit = std::max(soup_.face_color_unit, color.unit);
    std::vector<uint32_t> strip;
    std::vector<double> texcoords;
    for (uint64_t i = 0; i < element.count; ++i) {
      glm::dvec4 rgba(0, 0, 0, color.unit);
      const size_t first = soup_.corners.size();
      uint32_t texture = 0;
      texcoords.clear();
      for (size_t k = 0; k < element.properties.size(); ++k) {
        const Property& property = element.properties[k];
        if (const int component = color.component(k); color.there() && component >= 0) {
          rgba[component] = color_value(property);
        } else if (k == properties.corners) {
          read_corners(property, strips, strip);
        } else if (k == properties.texcoords) {
          const uint64_t length = body_.list_length(property);
          for (uint64_t c = 0; c < length; ++c) push(texcoords, body_.number(property.type));
        } else if (k == properties.texture) {
          const int64_t number = body_.index(property.type);
          texture = number >= 0 && number < int64_t{kNoIndex} ? uint32_t(number) : kNoIndex;
        } else {
          body_.skip(property);
        }
      }
      body_.end_element();
      if (strips) {
        end_strip(strip);
      } else {
        if (texcoords.size() == 2 * (soup_.corners.size() - first)) place_corners(first, texcoords);
        soup_.end_face(file_, builder_.budget());
      }
      if (textured_) {
        while (soup_.materials.size() < soup_.face_ends.size()) push(soup_.materials, texture);
      }
      if (!color.there()) continue;
      soup_.face_colors.resize(std::min(soup_.face_colors.size(), soup_.face_ends.size()));
      const glm::vec3 own = color_of(rgba, color.unit);
      while (soup_.face_colors.size() < soup_.face_ends.size()) push(soup_.face_colors, own);
    }
  }

  void read_corners(const Property& property, bool strips, std::vector<uint32_t>& strip) {
    const uint64_t length = body_.list_length(property);
    strip.clear();
    for (uint64_t c = 0; c < length; ++c) {
      const int64_t index = body_.index(property.type);
      // A strip ends with -1, whose bits unsigned types have, too.
      if (strips && (index < 0 || (property.type == Type::kUint32 && index == int64_t{kNoIndex}))) {
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
  }

  // Texture coordinates of a face's own, for its corners from `first` on.
  void place_corners(size_t first, const std::vector<double>& texcoords) {
    fill_up_texcoords();
    for (size_t c = first; c < soup_.corners.size(); ++c) {
      soup_.corner_texcoords[c] = uint32_t(soup_.texcoords.size());
      const double* uv = &texcoords[2 * (c - first)];
      push(soup_.texcoords, from_upper_left(uv[0], uv[1]));
    }
  }

  void fill_up_texcoords() {
    while (soup_.corner_texcoords.size() < soup_.corners.size()) push(soup_.corner_texcoords, kNoIndex);
  }

  // Makes materials of textures, and of the numbers that faces carry the materials'.
  void use_textures(const std::vector<std::string>& names) {
    if (names.empty()) return;
    if (soup_.corner_texcoords.empty()) {
      for (const std::string& name : names)
        builder_.note(file_ + ": the texture " + name + " is not read, there are no coordinates for it");
      soup_.materials.clear();
      return;
    }
    fill_up_texcoords();
    MtlTextures textures(file_, builder_);
    std::vector<uint32_t> materials;
    constexpr size_t kMostTextures =
        1000;  // a hostile header may name the same large file thousands of times
    for (const std::string& name : std::span(names).first(std::min(names.size(), kMostTextures))) {
      MtlMaterial source;
      source.material.name = name;
      source.material.base_color = glm::vec3(1);
      source.color.file = name;
      source.folder = folder_;
      const uint32_t material = textures.add(source, soup_.surfaces);
      materials.push_back(soup_.surfaces.contains(material) ? material : soup_.material);
    }
    bool without = false;
    for (uint32_t& material : soup_.materials) {
      without = without || material >= materials.size();
      material = material < materials.size() ? materials[material] : soup_.material;
    }
    if (without)
      builder_.note(file_ + ": faces have a texture's number that no comment names, they are grey");
    if (!soup_.surfaces.empty() && (!soup_.colors.empty() || !soup_.face_colors.empty())) {
      builder_.note(file_ + ": colours of vertices or faces are not read, textures say them");
      soup_.colors.clear();
      soup_.face_colors.clear();
    }
  }

  template <typename T>
  void push(std::vector<T>& vector, const T& value) {
    builder_.budget().push_back(file_, vector, value);
  }

  void add_corner(uint32_t corner) {
    push(soup_.corners, corner);
    if (has_normals_) push(soup_.corner_normals, corner);
    if (!vertices_placed_) return;
    while (soup_.corner_texcoords.size() + 1 < soup_.corners.size()) push(soup_.corner_texcoords, kNoIndex);
    push(soup_.corner_texcoords, corner);
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

  const std::filesystem::path folder_;
  const std::string& file_;
  Body& body_;
  MeshBuilder& builder_;
  PolygonSoup soup_;
  bool has_normals_ = false;
  bool translucent_ = false;
  double largest_short_ = 0;      // of colours of 16 bits
  bool textured_ = false;         // comments name textures
  bool vertices_placed_ = false;  // texture coordinates are the vertices'
};

}  // namespace

void read_ply(const std::filesystem::path& path, MeshBuilder& builder) {
  const std::string file = path.string();
  const std::string bytes = read_file(path, builder.budget());
  std::string_view text = bytes;
  const ply::Header header = ply::read_header(file, text);
  ply::Body body(file, text, header.encoding);
  PlyReader(path, file, body, builder).read(header);
}

}  // namespace lsp
