// Polygons as files hold them, and their triangles.
#pragma once

#include <glm/glm.hpp>
#include <limits>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "import/ears.h"
#include "import/mesh_builder.h"
#include "import/surface_color.h"

namespace lsp {

inline const glm::vec3 kNoColor(std::numeric_limits<float>::quiet_NaN());

// Faces with any number of corners over shared positions and normals. Indices may be out of range; the
// builder rejects what refers to nothing.
struct PolygonSoup {
  std::vector<glm::dvec3> positions;
  std::vector<glm::vec3> normals;
  std::vector<uint32_t> corners;         // into positions, face after face
  std::vector<uint32_t> corner_normals;  // into normals (kNoIndex: none); empty or as long as corners
  std::vector<uint32_t> face_ends;       // one past the face's last corner
  std::vector<uint32_t> materials;       // per face; empty: all `material`
  uint32_t material = 0;
  std::vector<uint32_t> smoothing;  // groups per face; those beyond its end are of kNoGroup
  // What gives triangles colours of their own; all empty where nothing does.
  std::vector<glm::dvec2> texcoords;           // their origin at the picture's upper left
  std::vector<uint32_t> corner_texcoords;      // into texcoords (kNoIndex: none); empty or as long as corners
  std::vector<glm::vec3> colors;               // per position; linear once make_colors_linear() was called
  std::vector<glm::vec3> face_colors;          // per face, likewise
  std::map<uint32_t, Surface> surfaces;        // of materials with textures
  double color_unit = 1, face_color_unit = 1;  // what such a value is at its largest, or more
  bool colors_cut = false;                     // by make_colors_linear()
  uint64_t too_small = 0;                      // faces with fewer than three corners, not in the lists

  // Ends a face whose corners were appended since the last one. One with fewer than three is dropped and
  // counted: it holds no triangle. True where it was kept.
  bool end_face(const std::string& file, Budget& budget);
  uint64_t triangle_count() const;
  // Colours, as files give them, are on the sRGB curve: from 0 to their unit, or to 255, 65,535 or 2^32 - 1
  // where any is above twice what is less, and what is a little above is cut. What is no number (kNoColor)
  // stays so: the vertex's colour holds for a face, white for a vertex.
  void make_colors_linear();
  bool has_colors() const { return !colors.empty() || !face_colors.empty() || !surfaces.empty(); }
};

// Adds the soup's triangles to the builder. A polygon with n corners gives n - 2 triangles: a fan from its
// first corner where that is right, ears where the polygon is concave.
void add_polygons(const std::string& file, const PolygonSoup& soup, MeshBuilder& builder);

// Cuts a polygon into corners.size() - 2 triangles of corner numbers, appended to `out`. Convex polygons (and
// those without any area) become a fan from corner 0. `work` is what is left of the number of steps
// allowed, so that hostile polygons cost bounded time; at 0 only fans are made.
EarCut triangulate(std::span<const glm::dvec3> corners, std::vector<glm::uvec3>& out, uint64_t& work);

}  // namespace lsp
