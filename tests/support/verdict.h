// Who is right where two exact tracers disagree: a test in extended precision of every triangle.
#pragma once

#include <optional>
#include <span>
#include <string>

#include "ray_errors.h"
#include "soup.h"

namespace lsp::bench {

enum class Verdict {
  kAgree,           // both miss, or both hit the same primitive
  kTie,             // both hit, at the same t within kTieTolerance, reported or ideal: coincident triangles
  kUnresolved,      // both hit, at depths closer to each other than single precision can tell
  kGraze,           // both are defensible: an edge is closer to the ray than single precision can tell
  kOursWrong,       // extended precision agrees with the reference only
  kReferenceWrong,  // extended precision agrees with us only
  kBothWrong,
};

inline constexpr double kTieTolerance = 1e-5;  // relative, in t

// A triangle as an ideal ray meets it, in extended precision on the single-precision inputs.
struct IdealHit {
  bool inside = false;       // the ray passes the triangle, edges included, at a t in (tmin, tmax)
  double t = 0;              // of the plane
  double t_resolution = 0;   // what single precision can tell apart in t there
  double edge_distance = 0;  // from the ray's line to the nearest edge's line, scene units; negative outside
  double resolution = 0;     // what single precision can tell apart across the ray, scene units
  bool graze() const { return !(edge_distance > resolution || edge_distance < -resolution); }
};
IdealHit ideal_hit(const LspRay& ray, const std::array<glm::vec3, 3>& corners);

// The nearest triangle that an ideal ray passes for certain (no graze): index in `soup`, or nothing. Tests
// all.
std::optional<uint32_t> ideal_closest(const Soup& soup, const LspRay& ray, IdealHit* hit);

// Judges a pair of closest hits. Tests all triangles unless the two agree or tie.
Verdict judge(const Soup& soup, const LspRay& ray, const LspHit& ours, const LspHit& reference);

struct Agreement {
  uint64_t rays = 0, agree = 0, ties = 0, unresolved = 0, grazes = 0, ours_wrong = 0, reference_wrong = 0,
           both_wrong = 0;
  uint64_t hit_or_miss = 0;           // of the differences beyond ties: one hits, the other does not
  std::vector<std::string> faults;    // the first few wrong answers of ours in words, for the test's output
  std::vector<std::string> examples;  // the first few other differences
  // How far the depths lie from the ideal ones where both name the same primitive, in t_resolution.
  Spread our_depth, reference_depth;

  // What differs in hit, miss or primitive at a t that is not the same within kTieTolerance.
  uint64_t beyond_ties() const { return unresolved + grazes + ours_wrong + reference_wrong + both_wrong; }
};

// Judges all; ours[i] and reference[i] answer rays[i].
Agreement compare_exact(const Soup& soup, std::span<const LspRay> rays, std::span<const LspHit> ours,
                        std::span<const LspHit> reference);

}  // namespace lsp::bench
