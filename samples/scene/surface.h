// Triangle surfaces made from formulas: the pieces that the sample scenes are put together from.
//
// Every function is deterministic and returns vertices with unit normals; the triangles' winding
// (counter-clockwise seen from outside) agrees with the normals. Triangles without area are never made.
#pragma once

#include <cstdint>
#include <functional>
#include <glm/glm.hpp>
#include <vector>

namespace lsp::sample {

struct Surface {
  std::vector<glm::vec3> positions;
  std::vector<glm::vec3> normals;  // one per position
  std::vector<glm::vec2> uvs;      // none, or one per position: into the material's texture
  std::vector<uint32_t> indices;   // three per triangle
  uint64_t triangle_count() const { return indices.size() / 3; }
};

// Adds `other`, moved by `transform` (any affine map but a mirroring one), to `surface`. Both have texture
// coordinates, or neither.
void append(Surface& surface, const Surface& other, const glm::mat4& transform = glm::mat4(1.0f));

// A point of a surface over u, v in [0, 1].
using Patch = std::function<glm::vec3(float u, float v)>;

// How the grid of a patch is closed.
enum class Closing {
  kOpen,    // four free edges
  kTube,    // u = 1 is u = 0: a tube along v with two free ends
  kTorus,   // u and v both come round
  kSphere,  // u comes round, v = 0 and v = 1 are single points: closed
};

// Tessellates `patch` with steps_u x steps_v cells. The outside is on the side of d/du x d/dv. Vertices that
// coincide by `closing` are shared, so that kTorus and kSphere give closed surfaces.
Surface tessellate(int steps_u, int steps_v, const Patch& patch, Closing closing = Closing::kOpen);

// A polyline (radius, height) that is turned about the y axis. The outside is on the right when walking along
// it, so that an upward line at a positive radius faces away from the axis.
using Profile = std::vector<glm::vec2>;

// Turns each profile about the y axis by the angles [from_rad, to_rad] in `sides` steps. A profile is smooth;
// there is a crease wherever one profile ends and the next begins.
Surface lathe(const std::vector<Profile>& profiles, int sides, float from_rad = 0.0f,
              float to_rad = 6.28318530717958648f);

// Profiles of straight lines: one crease at each point of `points`.
std::vector<Profile> creased(const Profile& points);

Surface box(glm::vec3 lo, glm::vec3 hi);

// A box standing on its lower face (which is left out) whose upper edges are cut at 45 degrees.
Surface bevelled_slab(glm::vec3 lo, glm::vec3 hi, float bevel);

// A wall of the given width (x, centred), height (y, from 0) and thickness (z, centred) with a round-headed
// opening whose arch has the given radius and springs from y = 0. Only the two faces: soffit and mouldings
// are separate. Needs radius < width / 2 and radius < height.
Surface arched_wall(float width, float height, float thickness, float radius, int steps);

// A tube of varying radius about a curve. `closed` joins its ends.
Surface tube(const std::function<glm::vec3(float)>& curve, const std::function<float(float)>& radius,
             int steps_along, int steps_around, bool closed);

// A value that is negative inside.
using Field = std::function<float(glm::vec3)>;

// The zero surface of `field` in the cube [lo, hi]^3 by marching tetrahedra on `cells`^3 cubes; normals are
// the field's gradient. Closed if the field is positive on the cube's faces.
Surface implicit(const Field& field, float lo, float hi, int cells);

}  // namespace lsp::sample
