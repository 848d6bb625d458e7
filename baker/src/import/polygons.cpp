#include "import/polygons.h"

#include <algorithm>
#include <cmath>

#include "import/rounding.h"
#include "import/touching.h"
#include "lsp/program.h"

namespace lsp {
namespace {

// Steps allowed for one file's concave polygons: some for each corner, which are ten times what people's
// take.
constexpr uint64_t kEarWork = 300'000'000, kEarWorkACorner = 1'500;

void fan(std::span<const uint32_t> ring, std::vector<glm::uvec3>& out) {
  for (size_t i = 2; i < ring.size(); ++i) out.push_back({ring[0], ring[i - 1], ring[i]});
}

// The polygon seen along its normal (Newell's, the sum of the fan's cross products), counter-clockwise. False
// where it has no area.
bool project(std::span<const glm::dvec3> corners, std::vector<glm::dvec2>& flat) {
  const glm::dvec3 origin = corners[0];
  glm::dvec3 normal(0);
  for (size_t i = 2; i < corners.size(); ++i) {
    normal += glm::cross(corners[i - 1] - origin, corners[i] - origin);
  }
  const glm::dvec3 size = glm::abs(normal);
  const int axis = size.x > size.y ? (size.x > size.z ? 0 : 2) : (size.y > size.z ? 1 : 2);
  if (!(size[axis] > 0) || !std::isfinite(size[axis])) return false;
  const int u = (axis + 1) % 3, v = (axis + 2) % 3;
  flat.clear();
  for (const glm::dvec3& corner : corners) {
    const glm::dvec3 p = corner - origin;
    flat.push_back(normal[axis] > 0 ? glm::dvec2(p[u], p[v]) : glm::dvec2(p[v], p[u]));
  }
  return true;
}

bool is_line(std::span<const glm::dvec3> corners) {
  for (size_t i = 2; i < corners.size(); ++i) {
    if (!is_degenerate(corners[0], corners[i - 1], corners[i])) return false;
  }
  return true;
}

// Whether every turn is to the left or straight: then the fan is at least as good as any other cut.
bool is_convex(std::span<const glm::dvec2> flat) {
  const size_t n = flat.size();
  for (size_t i = 0; i < n; ++i) {
    if (area2(flat[i], flat[(i + 1) % n], flat[(i + 2) % n]) < 0) return false;
  }
  return true;
}

}  // namespace

bool PolygonSoup::end_face(const std::string& file, Budget& budget) {
  const size_t begin = face_ends.empty() ? 0 : face_ends.back();
  if (corners.size() - begin < 3) {
    ++too_small;
    corners.resize(begin);
    if (!corner_normals.empty()) corner_normals.resize(begin);
    if (!corner_texcoords.empty()) corner_texcoords.resize(begin);
    return false;
  }
  if (corners.size() >= kNoIndex)
    throw Failure(Exit::kLimit, file, "holds more than 2^32 - 2 corners, split the mesh");
  budget.push_back(file, face_ends, uint32_t(corners.size()));
  return true;
}

void PolygonSoup::make_colors_linear() {
  const std::pair<std::vector<glm::vec3>*, double> lists[] = {{&colors, color_unit},
                                                              {&face_colors, face_color_unit}};
  for (const auto& [list, unit] : lists) {
    float largest = 0;
    for (const glm::vec3& color : *list) {
      for (int i = 0; i < 3; ++i) largest = std::isfinite(color[i]) ? std::max(largest, color[i]) : largest;
    }
    constexpr double kMostOvershoot = 2;  // filters and tools that mix colours end a little above 1
    double scale = unit;
    for (const double larger : {255.0, 65535.0, 4294967295.0}) {
      if (double(largest) > kMostOvershoot * scale) scale = std::max(scale, larger);
    }
    colors_cut = colors_cut || double(largest) > double(float(scale));
    for (glm::vec3& color : *list) {
      for (int i = 0; i < 3; ++i)
        color[i] = float(linear_of_srgb(std::clamp(double(color[i]) / scale, 0.0, 1.0)));
    }
  }
}

uint64_t PolygonSoup::triangle_count() const { return corners.size() - 2 * face_ends.size(); }

EarCut triangulate(std::span<const glm::dvec3> corners, std::vector<glm::uvec3>& out, uint64_t& work) {
  static thread_local std::vector<uint32_t> ring;
  static thread_local std::vector<glm::dvec2> flat;
  static thread_local EarClipper clipper;
  ring.resize(corners.size());
  for (size_t i = 0; i < ring.size(); ++i) ring[i] = uint32_t(i);
  if (corners.size() < 4 || work == 0) {
    fan(ring, out);
    return work == 0 ? EarCut::kGaveUp : EarCut::kRight;
  }
  if (!project(corners, flat)) {  // no area: a line, or parts that turn either way and cancel out
    fan(ring, out);
    return is_line(corners) ? EarCut::kRight : EarCut::kCrossed;
  }
  if (is_convex(flat)) {
    fan(ring, out);
    return EarCut::kRight;
  }
  const size_t first = out.size();
  const EarCut cut = clipper.cut(flat, out, work);
  constexpr size_t kMostCorners = 2'000;  // all are compared with all
  const uint64_t steps = corners.size() * corners.size() / 4;
  if (cut != EarCut::kCrossed || corners.size() > kMostCorners || steps >= work) return cut;
  work -= steps;
  if (!part_touching(flat)) return cut;
  static thread_local std::vector<glm::uvec3> parted;
  parted.clear();
  if (clipper.cut(flat, parted, work) != EarCut::kRight) return cut;
  out.resize(first);
  out.insert(out.end(), parted.begin(), parted.end());
  return EarCut::kRight;
}

namespace {

// A triangle: three corners of a face.
struct Piece {
  uint32_t face;
  glm::uvec3 corners;  // into the soup's
};

uint32_t material_of(const PolygonSoup& soup, uint32_t face) {
  return face < soup.materials.size() ? soup.materials[face] : soup.material;
}

// Calls add(piece) for all triangles of all faces in order.
template <typename Add>
void cut_faces(const std::string& file, const PolygonSoup& soup, MeshBuilder& builder, const Add& add) {
  std::vector<glm::dvec3> polygon;
  std::vector<glm::uvec3> cut;
  uint64_t work = std::max(kEarWork, kEarWorkACorner * soup.corners.size()), crossed = 0;
  uint32_t begin = 0;
  for (uint32_t face = 0; face < soup.face_ends.size(); ++face) {
    const uint32_t end = soup.face_ends[face];
    polygon.clear();
    for (uint32_t k = begin; k < end && end - begin > 3 && soup.corners[k] < soup.positions.size(); ++k)
      polygon.push_back(soup.positions[soup.corners[k]]);
    cut.clear();
    if (polygon.size() == end - begin) {
      crossed += triangulate(polygon, cut, work) == EarCut::kCrossed;
    } else {  // a triangle, or one where the builder rejects what touches the missing corner, and keeps the
              // rest
      for (uint32_t i = 2; i < end - begin; ++i) cut.push_back({0, i - 1, i});
    }
    for (const glm::uvec3& local : cut) add(Piece{face, local + begin});
    begin = end;
  }
  if (crossed) {
    builder.note(file + ": " + std::to_string(crossed) +
                 " polygons cross themselves, their triangles do not fill them exactly");
  }
  if (work == 0) {
    builder.note(file + ": concave polygons are too many or too large to cut well, the last are cut as fans");
  }
}

// Whether a corner has texture coordinates that say something.
bool has_place(const PolygonSoup& soup, uint32_t corner) {
  const uint32_t uv = corner < soup.corner_texcoords.size() ? soup.corner_texcoords[corner] : kNoIndex;
  return uv < soup.texcoords.size() && std::isfinite(soup.texcoords[uv].x + soup.texcoords[uv].y);
}

// The face's colour, else the vertex's, else white.
glm::vec3 color_of(const PolygonSoup& soup, uint32_t face, uint32_t vertex) {
  const auto given = [](const std::vector<glm::vec3>& list, uint32_t i) {
    return i < list.size() && std::isfinite(list[i].x + list[i].y + list[i].z);
  };
  if (given(soup.face_colors, face)) return soup.face_colors[face];
  return given(soup.colors, vertex) ? soup.colors[vertex] : glm::vec3(1);
}

// A colour for each piece.
std::vector<TriangleColor> piece_colors(const std::string& file, const PolygonSoup& soup,
                                        std::span<const Piece> pieces, MeshBuilder& builder) {
  std::map<uint32_t, std::vector<uint32_t>> by_material;
  for (uint32_t i = 0; i < pieces.size(); ++i) by_material[material_of(soup, pieces[i].face)].push_back(i);
  bool unplaced = false;
  const bool by_vertex = !soup.colors.empty() || !soup.face_colors.empty();
  std::vector<TriangleColor> colors(pieces.size());
  for (const auto& [material, list] : by_material) {
    const Material& plain = builder.mesh().materials[material];
    Surface surface{plain.base_color, plain.emission, {AlphaMode::kBlend, plain.opacity}, {}, {}};
    // A grey that stands for no material must not darken what the vertices say.
    if (by_vertex && builder.is_default(material)) surface.base_color = glm::vec3(1);
    if (const auto found = soup.surfaces.find(material); found != soup.surfaces.end())
      surface = found->second;
    for (size_t t = 0; t < list.size() && surface.has_textures() && !unplaced; ++t) {
      for (int i = 0; i < 3; ++i) {
        const uint32_t corner = pieces[list[t]].corners[i];
        unplaced = unplaced || !has_place(soup, corner);
      }
    }
    const std::vector<TriangleColor> own =
        mean_colors(surface, list.size(), [&](size_t t, SurfaceCorner(&out)[3]) {
          const Piece& piece = pieces[list[t]];
          for (int i = 0; i < 3; ++i) {
            const uint32_t corner = piece.corners[i];
            const glm::dvec2 at =
                has_place(soup, corner) ? soup.texcoords[soup.corner_texcoords[corner]] : glm::dvec2(0);
            out[i].base_uv = surface.base.place(at);
            out[i].glow_uv = surface.glow.place(at);
            out[i].color = {color_of(soup, piece.face, soup.corners[corner]), 1};
          }
        });
    for (size_t i = 0; i < list.size(); ++i) colors[list[i]] = own[i];
  }
  if (unplaced)
    builder.note(
        file +
        ": faces have a texture and no texture coordinates, or no finite ones, its corner texel holds");
  return colors;
}

}  // namespace

void add_polygons(const std::string& file, const PolygonSoup& soup, MeshBuilder& builder) {
  builder.begin(file, soup.positions, soup.triangle_count(), MissingNormals::kSmooth);
  const auto add = [&](const Piece& piece, const TriangleColor* color) {
    glm::uvec3 triangle;
    glm::vec3 normals[3];
    for (int i = 0; i < 3; ++i) {
      const uint32_t corner = piece.corners[i];
      triangle[i] = soup.corners[corner];
      const uint32_t normal = soup.corner_normals.empty() ? kNoIndex : soup.corner_normals[corner];
      normals[i] = normal < soup.normals.size() ? soup.normals[normal]
                                                : glm::vec3(std::numeric_limits<float>::quiet_NaN());
    }
    const uint32_t smoothing = piece.face < soup.smoothing.size() ? soup.smoothing[piece.face] : kNoGroup;
    builder.add(triangle, normals, material_of(soup, piece.face), color, smoothing);
  };
  if (soup.has_colors()) {
    builder.budget().charge(file, soup.triangle_count(),
                            sizeof(Piece) + 2 * sizeof(TriangleColor) + sizeof(uint32_t));
    std::vector<Piece> pieces;
    pieces.reserve(soup.triangle_count());
    cut_faces(file, soup, builder, [&](const Piece& piece) { pieces.push_back(piece); });
    const std::vector<TriangleColor> colors = piece_colors(file, soup, pieces, builder);
    for (size_t i = 0; i < pieces.size(); ++i) add(pieces[i], &colors[i]);
  } else {
    cut_faces(file, soup, builder, [&](const Piece& piece) { add(piece, nullptr); });
  }
  builder.end();
  if (soup.face_ends.empty() && soup.too_small == 0 && !soup.positions.empty()) {
    builder.note(file + ": its " + std::to_string(soup.positions.size()) +
                 " vertices have no faces, they are a cloud of points");
  }
  if (!soup.colors.empty() && !soup.face_colors.empty())
    builder.note(file + ": colours of vertices are not read where faces have their own");
  if (soup.colors_cut) builder.note(file + ": colours above 1 are cut to it");
  if (soup.too_small) {
    builder.note(file + ": " + std::to_string(soup.too_small) +
                 " faces with fewer than three corners hold no triangle");
  }
}

}  // namespace lsp
