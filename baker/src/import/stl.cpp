// STL, binary and ASCII.
#include <algorithm>
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

static_assert(sizeof(glm::vec3) == 12);

// Binary: 80 bytes of anything, a count, and 50 bytes a triangle (normal, corners, attribute), little-endian.
constexpr size_t kHeaderBytes = 84, kTriangleBytes = 50;

uint32_t binary_count(std::string_view bytes) {
  uint32_t count = 0;
  std::memcpy(&count, bytes.data() + 80, sizeof count);
  return count;
}

bool is_comment(std::string_view word) {
  return word.front() == '#' || word.front() == ';' || word.front() == '!' || word.starts_with("//");
}

// What follows the first "facet normal", which stands behind a solid's name where the whole file is one line;
// empty where there is none.
std::string_view from_facet(std::string_view line) {
  std::string_view word;
  for (bool facet = false; take_word(line, word); facet = equals_ignoring_case(word, "facet")) {
    if (facet && equals_ignoring_case(word, "normal")) return line;
  }
  return {};
}

// Whether this is text. Binary headers may start with "solid" too; behind them then no line starts with a
// facet, or the end of the solid, and none holds a facet's vertices.
bool looks_ascii(std::string_view bytes) {
  constexpr size_t kLook = 65536;
  std::string_view rest = bytes.substr(0, kLook), line, word;
  bool first = true, in_facet = false;
  while (take_line(rest, line)) {
    if (!take_word(line, word)) continue;
    if (is_comment(word)) continue;
    const bool keyword = equals_ignoring_case(word, "facet") || equals_ignoring_case(word, "endsolid");
    const char* body = bytes.data() + std::min(bytes.size(), kHeaderBytes);
    if (keyword && word.data() >= body) return true;
    if (first && !keyword && !equals_ignoring_case(word, "solid")) return false;
    first = false;
    // One line may hold the whole file.
    if (!in_facet) line = from_facet(line);
    in_facet = in_facet || !line.empty();
    while (take_word(line, word)) {
      const bool within = equals_ignoring_case(word, "vertex") || equals_ignoring_case(word, "endfacet");
      if (within && word.data() >= body) return true;
    }
  }
  return !first && bytes.size() < kHeaderBytes + kTriangleBytes;
}

// What bytes read as a triangle hold: anything else than triangles will look like noise.
enum class Looks { kTriangle, kZero, kNoise };
Looks look_at(std::string_view triangle) {
  float corners[9];
  std::memcpy(corners, triangle.data() + sizeof(glm::vec3), sizeof corners);
  Looks looks = Looks::kZero;
  for (const float value : corners) {
    if (!std::isfinite(value) || std::abs(value) > 1e20f || (value != 0 && std::abs(value) < 1e-20f))
      return Looks::kNoise;
    if (value != 0) looks = Looks::kTriangle;
  }
  return looks;
}

// How many triangles a binary file holds. Writers that stream leave the count 0 or at its largest, others
// count wrong; where whole triangles fill the file up, these are what was meant.
uint32_t count_triangles(const std::string& file, std::string_view bytes, MeshBuilder& builder) {
  const uint64_t declared = binary_count(bytes), fits = (bytes.size() - kHeaderBytes) / kTriangleBytes;
  const bool whole = (bytes.size() - kHeaderBytes) % kTriangleBytes == 0;
  if (declared == fits && whole) return uint32_t(declared);
  if (whole && fits > 0 && __builtin_bswap32(uint32_t(declared)) == fits) {
    throw Failure(Exit::kInvalid, file,
                  "has its bytes in the wrong order, the highest first; export it with the lowest first");
  }
  bool all = fits > 0 && fits < kNoIndex && (whole || declared == 0), any = declared > fits;
  for (uint64_t i = std::min(declared, fits); i < fits && all; ++i) {
    const Looks looks = look_at(bytes.substr(kHeaderBytes + i * kTriangleBytes, kTriangleBytes));
    // Zeros may be a triangle without an area, or padding behind those that are declared.
    all = looks == Looks::kTriangle || (looks == Looks::kZero && declared == 0);
    any = any || looks == Looks::kTriangle;
  }
  if (all && any) {
    builder.note(file + ": declares " + std::to_string(declared) + " triangles and holds " +
                 std::to_string(fits) + ", all of them are read");
    return uint32_t(fits);
  }
  if (declared > fits) {
    throw Failure(Exit::kInvalid, file,
                  "declares " + std::to_string(declared) + " triangles and has bytes for " +
                      std::to_string(fits) + ", it is cut short or no STL file: export or copy it again");
  }
  if (declared == 0 && fits > 0) {
    throw Failure(Exit::kInvalid, file,
                  "declares no triangle, and the bytes after its header are none: export or copy it again");
  }
  builder.note(file + ": bytes after the last triangle are not used");
  return uint32_t(declared);
}

// The two bytes behind a triangle, which some programs use for a colour of three times five bits. Magics says
// so in the header, "COLOR=" and four bytes for the triangles whose highest bit is set, red lowest; VisCAM
// and SolidView set that bit where there is a colour, blue lowest.
glm::vec3 color_of(uint16_t attribute, bool magics, const glm::vec3& whole) {
  const glm::vec3 fives(attribute & 31, attribute >> 5 & 31, attribute >> 10 & 31);
  const bool highest = attribute >> 15;
  if (magics) return highest ? whole : fives / 31.0f;
  return highest ? glm::vec3(fives.z, fives.y, fives.x) / 31.0f : kNoColor;
}

void read_colors(const std::string& file, std::string_view bytes, uint32_t count, PolygonSoup& soup,
                 MeshBuilder& builder) {
  const auto attribute = [&](size_t i) {
    uint16_t value = 0;
    std::memcpy(&value, bytes.data() + kHeaderBytes + (i + 1) * kTriangleBytes - sizeof value, sizeof value);
    return value;
  };
  constexpr std::string_view kColor = "COLOR=";
  const size_t found = bytes.substr(0, 80).find(kColor);
  const bool magics = found <= 80 - kColor.size() - 4;
  bool any = false, colored = magics;
  for (size_t i = 0; i < count; ++i) {
    any = any || attribute(i) != 0;
    colored = colored || attribute(i) >> 15;
  }
  if (!colored) {
    if (any) builder.note(file + ": attribute bytes of triangles are no colours known here and are not read");
    return;
  }
  uint8_t rgba[4] = {};
  if (magics) std::memcpy(rgba, bytes.data() + found + kColor.size(), sizeof rgba);
  if (magics && rgba[3] != 255) builder.note(file + ": the alpha of its colour is not read");
  if (!magics)
    builder.note(file +
                 ": attribute bytes of triangles are taken as colours, as VisCAM and SolidView write them");
  builder.budget().charge(file, count, sizeof(glm::vec3));
  for (size_t i = 0; i < count; ++i)
    soup.face_colors.push_back(color_of(attribute(i), magics, glm::vec3(rgba[0], rgba[1], rgba[2]) / 255.0f));
}

void read_binary(const std::string& file, std::string_view bytes, uint32_t count, PolygonSoup& soup,
                 MeshBuilder& builder) {
  constexpr uint64_t kSoupBytes = sizeof(glm::vec3) + 3 * sizeof(glm::dvec3) + 7 * sizeof(uint32_t);
  builder.budget().charge(file, count, kSoupBytes);
  soup.positions.reserve(size_t{3} * count);
  soup.corners.reserve(size_t{3} * count);
  soup.corner_normals.reserve(size_t{3} * count);
  soup.normals.reserve(count);
  soup.face_ends.reserve(count);
  for (size_t i = 0; i < count; ++i) {
    glm::vec3 vectors[4];
    std::memcpy(vectors, bytes.data() + kHeaderBytes + i * kTriangleBytes, sizeof vectors);
    for (int k = 1; k < 4; ++k) {
      soup.corners.push_back(uint32_t(soup.positions.size()));
      soup.positions.push_back(glm::dvec3(vectors[k]));
      soup.corner_normals.push_back(uint32_t(i));
    }
    soup.normals.push_back(vectors[0]);
    soup.end_face(file, builder.budget());
  }
  read_colors(file, bytes, count, soup, builder);
  soup.make_colors_linear();
}

glm::dvec3 read_vector(std::string_view& line, NumberReader& numbers) {
  glm::dvec3 vector(std::numeric_limits<double>::quiet_NaN());
  std::string_view word;
  for (int i = 0; i < 3 && take_word(line, word); ++i) vector[i] = numbers.read(word);
  return vector;
}

// Keywords in any case, one or more a line: any number of solids, their names free text to the end of the
// line or to a facet. A line that starts with another word is passed over, with a note. A loop with more than
// three vertices is taken as a polygon.
void read_ascii(const std::string& file, std::string_view text, PolygonSoup& soup, MeshBuilder& builder) {
  Budget& budget = builder.budget();
  std::string_view line, word;
  uint32_t normal = kNoIndex;
  std::set<std::string> unknown;
  NumberReader numbers;
  const auto start_facet = [&] {
    normal = uint32_t(soup.normals.size());
    budget.push_back(file, soup.normals, glm::vec3(read_vector(line, numbers)));
  };
  while (take_line(text, line)) {
    while (take_word(line, word)) {
      const auto is = [&](std::string_view keyword) { return equals_ignoring_case(word, keyword); };
      if (is("vertex")) {
        budget.push_back(file, soup.corners, uint32_t(soup.positions.size()));
        budget.push_back(file, soup.positions, read_vector(line, numbers));
        budget.push_back(file, soup.corner_normals, normal);
      } else if (is("facet")) {
        take_word(line, word);  // "normal"
        start_facet();
      } else if (is("endfacet")) {
        soup.end_face(file, budget);
        normal = kNoIndex;
      } else if (is("solid") || is("endsolid")) {
        line = from_facet(line);
        if (!line.empty()) start_facet();
      } else if (!is("outer") && !is("loop") && !is("endloop")) {
        constexpr size_t kMostWords = 8, kLongest = 32;
        if (!is_comment(word) && unknown.size() < kMostWords) unknown.emplace(word.substr(0, kLongest));
        break;
      }
    }
  }
  std::string words;
  for (const std::string& text_word : unknown) words += (words.empty() ? "" : ", ") + text_word;
  if (const std::string odd = numbers.note(); !odd.empty()) builder.note(file + ": " + odd);
  if (!words.empty()) builder.note(file + ": lines that begin with " + words + " are not read");
  if (soup.corners.size() != (soup.face_ends.empty() ? 0 : soup.face_ends.back())) {
    throw Failure(Exit::kInvalid, file, "ends inside a facet, it is cut short: export or copy it again");
  }
}

// A normal of zero length asks for the triangle's own; many programs write no other, and some write one for
// all. One that points to the wrong side is left.
void fill_normals(const std::string& file, PolygonSoup& soup, MeshBuilder& builder) {
  constexpr double kLeast = 0.9;  // the cosine to the triangle's own: what rounding does to slivers stays
  uint64_t wrong = 0;
  size_t begin = 0;
  for (const uint32_t end : soup.face_ends) {
    const uint32_t normal = soup.corner_normals[begin];
    const auto at = [&](size_t corner) { return soup.positions[soup.corners[corner]]; };
    const glm::dvec3 origin = at(begin);
    glm::dvec3 area(0);
    for (size_t i = begin + 2; i < end; ++i) area += glm::cross(at(i - 1) - origin, at(i) - origin);
    const double largest = std::max(std::abs(area.x), std::max(std::abs(area.y), std::abs(area.z)));
    if (normal != kNoIndex && largest > 0 && std::isfinite(largest)) {
      const glm::dvec3 own = area / largest, given(soup.normals[normal]);
      const double lengths = glm::length(own) * glm::length(given);
      const bool differs = std::isfinite(lengths) && !(std::abs(glm::dot(own, given)) >= kLeast * lengths);
      wrong += differs;
      if (differs || lengths == 0) soup.normals[normal] = glm::vec3(own);
    }
    begin = end;
  }
  if (wrong)
    builder.note(file + ": the normals of " + std::to_string(wrong) +
                 " facets do not stand on them, the facets' own take their place");
}

}  // namespace

void read_stl(const std::filesystem::path& path, MeshBuilder& builder) {
  const std::string file = path.string();
  const std::string bytes = read_file(path, builder.budget());
  // A byte order mark is text's.
  const std::string_view start = std::string_view(bytes).substr(0, 3);
  const bool marked =
      start == "\xEF\xBB\xBF" || start.starts_with("\xFF\xFE") || start.starts_with("\xFE\xFF");
  PolygonSoup soup;
  soup.material = builder.default_material();
  const bool has_header = bytes.size() >= kHeaderBytes;
  const bool fits =
      has_header && bytes.size() == kHeaderBytes + kTriangleBytes * uint64_t{binary_count(bytes)};
  if (!fits && (marked || looks_ascii(bytes))) {
    const std::string text = read_text(path, builder.budget());
    read_ascii(file, text, soup, builder);
  } else if (has_header) {
    read_binary(file, bytes, count_triangles(file, bytes, builder), soup, builder);
  } else {
    throw Failure(Exit::kInvalid, file,
                  "is no STL file, neither text nor long enough for a header: export it again");
  }
  fill_normals(file, soup, builder);
  add_polygons(file, soup, builder);
}

}  // namespace lsp
