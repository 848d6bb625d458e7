// STL, binary and ASCII.
#include <cstring>

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

// Whether the text starts as ASCII STL does. Binary headers may start with "solid" too, so this is asked only
// where the size does not say that the file is binary.
bool looks_ascii(std::string_view bytes) {
  std::string_view rest = bytes.substr(0, 4096), line, word;
  while (take_line(rest, line)) {
    if (take_word(line, word))
      return equals_ignoring_case(word, "solid") || equals_ignoring_case(word, "facet");
  }
  return false;
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
}

glm::dvec3 read_vector(std::string_view line) {
  glm::dvec3 vector(std::numeric_limits<double>::quiet_NaN());
  std::string_view word;
  for (int i = 0; i < 3 && take_word(line, word); ++i) vector[i] = number_of(word);
  return vector;
}

// Keywords at the start of lines, in any case: any number of solids, their names free text. A loop with more
// than three vertices is taken as a polygon.
void read_ascii(const std::string& file, std::string_view text, PolygonSoup& soup, MeshBuilder& builder) {
  Budget& budget = builder.budget();
  std::string_view line, word;
  uint32_t normal = kNoIndex;
  while (take_line(text, line)) {
    if (!take_word(line, word)) continue;
    if (equals_ignoring_case(word, "vertex")) {
      budget.push_back(file, soup.corners, uint32_t(soup.positions.size()));
      budget.push_back(file, soup.positions, read_vector(line));
      budget.push_back(file, soup.corner_normals, normal);
    } else if (equals_ignoring_case(word, "facet")) {
      normal = uint32_t(soup.normals.size());
      take_word(line, word);  // "normal"
      budget.push_back(file, soup.normals, glm::vec3(read_vector(line)));
    } else if (equals_ignoring_case(word, "endfacet")) {
      soup.end_face(file, budget);
      normal = kNoIndex;
    }
  }
  if (soup.corners.size() != (soup.face_ends.empty() ? 0 : soup.face_ends.back())) {
    throw Failure(Exit::kInvalid, file, "ends inside a facet, it is cut short: export or copy it again");
  }
}

}  // namespace

void read_stl(const std::filesystem::path& path, MeshBuilder& builder) {
  const std::string file = path.string();
  const std::string bytes = read_file(path, builder.budget());
  PolygonSoup soup;
  soup.material = builder.default_material();
  const bool has_header = bytes.size() >= kHeaderBytes;
  const uint64_t fits = has_header ? (bytes.size() - kHeaderBytes) / kTriangleBytes : 0;
  const uint32_t count = has_header ? binary_count(bytes) : 0;
  if (has_header && bytes.size() == kHeaderBytes + kTriangleBytes * uint64_t{count}) {
    read_binary(file, bytes, count, soup, builder);
  } else if (looks_ascii(bytes)) {
    const std::string text = read_text(path, builder.budget());
    read_ascii(file, text, soup, builder);
  } else if (has_header && count <= fits) {
    builder.note(file + ": bytes after the last triangle are not used");
    read_binary(file, bytes, count, soup, builder);
  } else {
    throw Failure(Exit::kInvalid, file,
                  has_header
                      ? "declares " + std::to_string(count) + " triangles and has bytes for " +
                            std::to_string(fits) + ", it is cut short or no STL file: export or copy it again"
                      : "is no STL file, neither text nor long enough for a header: export it again");
  }
  add_polygons(file, soup, builder);
}

}  // namespace lsp
