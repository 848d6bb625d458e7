// What an exact trace may answer: every triangle tested in double precision on the single-precision inputs,
// with the error that runtime/NUMERICS.md allows a tracer in single precision as the band of the undecided.
#pragma once

#include <array>
#include <glm/glm.hpp>

#include "lsp/interface.h"
#include "soup.h"

namespace lsp::stress {

// u = 2^-24. The constants of the bounds derived in runtime/NUMERICS.md.
inline constexpr double kU = 0x1p-24;
inline constexpr double kEdgeBound = 8;   // a corner across the ray, in u R
inline constexpr double kDepthBound = 8;  // the plane's depth, in u R (1 + L / h) / |cos|

// A valid ray as the reference sees it: the direction scaled by a power of two, t with it.
struct ReferenceRay {
  glm::dvec3 origin, direction;
  double to_given = 1;  // t in lengths of the direction given = t * to_given
  double tmin = 0, tmax = 0;
  double length = 0;  // of direction
};

// False for what the contract calls invalid: NaN anywhere, a non-finite origin or direction, a direction
// whose largest component is zero or denormal, tmin > tmax.
bool reference_ray(const LspRay& ray, ReferenceRay* out);

// A triangle as the ideal ray meets it. Distances in scene units, t as ReferenceRay's.
struct Ideal {
  double edge =
      0;  // from the ray's line to the border of the triangle as seen along the ray, positive inside
  double edge_band = 0;
  double t = 0;  // of the plane
  double t_band = 0;
  double t_lo = 0, t_hi = 0;  // of the corners' depths along the direction's largest axis
  bool may_pass() const { return edge >= -edge_band; }
  bool passes() const { return edge > edge_band; }
};
Ideal ideal(const ReferenceRay& ray, const std::array<glm::vec3, 3>& corners);

enum class Answer {
  kRight,      // the only answer a tracer with this error may give
  kUndecided,  // one of several it may give
  kWrong,
};

struct Judgement {
  Answer answer = Answer::kRight;
  double deviation = 0;  // of t from the ideal one, in bands; 0 without a hit
  const char* why = "";  // of a wrong answer
};

// Judges the answers of the exact trace of a valid ray, closest hit and any hit, against all triangles of
// `soup`. The undecided and the deviation are those of the closest.
Judgement judge(const bench::Soup& soup, const ReferenceRay& ray, const LspHit& closest, const LspHit& any);

// What holds of every hit of every trace: no NaN, tmin < t < tmax, a primitive that exists, a unit normal; of
// a miss: t infinite. Null, or what is wrong.
const char* malformed(const bench::Soup& soup, const LspRay& ray, const LspHit& hit);

}  // namespace lsp::stress
