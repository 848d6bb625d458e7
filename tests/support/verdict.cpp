#include "verdict.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

namespace lsp::bench {
namespace {

using Real = long double;

struct Vec {
  Real x, y, z;
};
Vec operator-(const Vec& a, const Vec& b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
Real dot(const Vec& a, const Vec& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
Vec cross(const Vec& a, const Vec& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
Real length(const Vec& a) { return std::sqrt(dot(a, a)); }
Real largest(const Vec& a) { return std::max({std::abs(a.x), std::abs(a.y), std::abs(a.z)}); }
Vec vec(const lsp_float3& a) { return {a.x, a.y, a.z}; }
Vec vec(const glm::vec3& a) { return {a.x, a.y, a.z}; }

bool same_t(float a, float b) {
  return std::abs(double{a} - double{b}) <=
         kTieTolerance * std::max(std::abs(double{a}), std::abs(double{b}));
}

}  // namespace

IdealHit ideal_hit(const LspRay& ray, const std::array<glm::vec3, 3>& corners) {
  // Differences of two floats are exact in extended precision unless their exponents are 40 apart, and the
  // products below lose no more than its last bits, some 2^-60: far below what single precision resolves.
  const Vec o = vec(ray.origin), d = vec(ray.direction);
  const Vec p[3] = {vec(corners[0]) - o, vec(corners[1]) - o, vec(corners[2]) - o};
  const Vec normal = cross(p[1] - p[0], p[2] - p[0]);
  const Real slope = dot(normal, d);
  const Real sign = slope < 0 ? Real{-1} : Real{1};
  IdealHit hit;
  hit.edge_distance = INFINITY;
  Real reach = largest(o);
  for (int k = 0; k < 3; ++k) {
    const Vec& a = p[k];
    const Vec& b = p[(k + 1) % 3];
    const Vec edge = b - a;
    const Real volume = sign * dot(d, cross(a, b));  // positive inside
    const Real span = length(cross(d, edge));
    const Real distance = span > 0 ? volume / span : (volume > 0 ? Real{INFINITY} : Real{-INFINITY});
    // A ray in the edge's own direction: its distance is that of the two parallel lines.
    hit.edge_distance = std::min(hit.edge_distance, static_cast<double>(span > 0 ? distance : -length(a)));
    reach = std::max({reach, largest(a), largest(vec(corners[k]))});
  }
  // Three float steps of the largest coordinate involved.
  hit.resolution = static_cast<double>(reach) * 3 * 0x1p-23;
  if (slope == 0 && !(length(normal) > 0)) return hit;
  if (slope == 0) {
    // Parallel to the plane: met where the line comes nearest to the triangle, a graze if that is near
    // enough.
    const Real per_length = 1 / (length(normal) * length(d));
    Real nearest_side = INFINITY, first = INFINITY;
    bool left = false, right = false;
    for (const Vec& corner : p) {
      const Real side = dot(cross(d, corner), normal) * per_length;
      left = left || side >= 0;
      right = right || side <= 0;
      nearest_side = std::min(nearest_side, std::abs(side));
      first = std::min(first, dot(corner, d) / dot(d, d));
    }
    const Real off = dot(normal, p[0]) / length(normal), beside = left && right ? 0 : nearest_side;
    hit.edge_distance = -static_cast<double>(std::sqrt(off * off + beside * beside));
    hit.t = static_cast<double>(first);
    return hit;
  }
  const Real t = dot(normal, p[0]) / slope;
  hit.t = static_cast<double>(t);
  const Real along = std::abs(slope) / (length(normal) * length(d));
  hit.t_resolution = hit.resolution / static_cast<double>(length(d) * along);
  hit.inside = hit.edge_distance >= 0 && t > Real{ray.tmin} && t < Real{ray.tmax};
  // Nearly in the plane: where along the ray it is met is ill-conditioned.
  if (along < Real{1e-6}) hit.resolution = INFINITY;
  return hit;
}

std::optional<uint32_t> ideal_closest(const Soup& soup, const LspRay& ray, IdealHit* hit) {
  std::optional<uint32_t> nearest;
  const glm::dvec3 o(ray.origin.x, ray.origin.y, ray.origin.z);
  const glm::dvec3 d(ray.direction.x, ray.direction.y, ray.direction.z);
  for (uint32_t i = 0; i < soup.size(); ++i) {
    // In double first, with a margin: only triangles near the ray are worth extended precision.
    const auto& c = soup.corners[i];
    const glm::dvec3 a = glm::dvec3(c[0]) - o, b = glm::dvec3(c[1]) - o, e = glm::dvec3(c[2]) - o;
    const double wa = glm::dot(d, glm::cross(e, b)), wb = glm::dot(d, glm::cross(a, e)),
                 wc = glm::dot(d, glm::cross(b, a));
    const double margin = 1e-9 * (std::abs(wa) + std::abs(wb) + std::abs(wc)) + 1e-300;
    if (std::min({wa, wb, wc}) < -margin && std::max({wa, wb, wc}) > margin) continue;
    const IdealHit candidate = ideal_hit(ray, c);
    if (candidate.inside && !candidate.graze() && !passes(soup, i, ray) &&
        (!nearest || candidate.t < hit->t)) {
      nearest = i;
      *hit = candidate;
    }
  }
  return nearest;
}

Verdict judge(const Soup& soup, const LspRay& ray, const LspHit& ours, const LspHit& reference) {
  if (ours.primitive == reference.primitive) return Verdict::kAgree;
  const bool we_hit = ours.primitive != LSP_NONE, it_hits = reference.primitive != LSP_NONE;
  if (we_hit && it_hits && same_t(ours.t, reference.t)) return Verdict::kTie;
  const auto triangle_of = [&](const LspHit& hit) -> const std::array<glm::vec3, 3>* {
    if (hit.primitive >= soup.triangle_of.size() || soup.triangle_of[hit.primitive] == LSP_NONE)
      return nullptr;
    return &soup.corners[soup.triangle_of[hit.primitive]];
  };
  if (we_hit && it_hits && triangle_of(ours) && triangle_of(reference)) {
    // Near the origin the rounding of t alone can exceed the tolerance: what the two triangles' own t are
    // decides whether they coincide.
    const IdealHit a = ideal_hit(ray, *triangle_of(ours)), b = ideal_hit(ray, *triangle_of(reference));
    if (a.inside && b.inside && same_t(a.t, b.t)) return Verdict::kTie;
  }
  // Right is the nearest triangle that the ray passes for certain, or one that it passes or grazes before it,
  // or so little behind it that no tracer in single precision can know.
  IdealHit ideal;
  const std::optional<uint32_t> nearest = ideal_closest(soup, ray, &ideal);
  bool grazed = false;
  const auto right = [&](const LspHit& hit) {
    if (hit.primitive == LSP_NONE) return !nearest;
    if (!triangle_of(hit)) return false;
    if (nearest && triangle_of(hit) == &soup.corners[*nearest]) return true;
    if (passes(soup, soup.triangle_of[hit.primitive], ray)) return false;
    const IdealHit own = ideal_hit(ray, *triangle_of(hit));
    grazed = grazed || own.graze();
    return (own.inside || own.graze()) &&
           (!nearest || own.t <= ideal.t + std::max(own.t_resolution, ideal.t_resolution));
  };
  const bool we_are = right(ours), it_is = right(reference);
  if (we_are && it_is) return grazed || !nearest ? Verdict::kGraze : Verdict::kUnresolved;
  if (we_are) return Verdict::kReferenceWrong;
  return it_is ? Verdict::kOursWrong : Verdict::kBothWrong;
}

Agreement compare_exact(const Soup& soup, std::span<const LspRay> rays, std::span<const LspHit> ours,
                        std::span<const LspHit> reference) {
  static constexpr const char* kNames[] = {
      "agree", "tie", "unresolved", "graze", "ours wrong", "reference wrong", "both wrong"};
  Agreement sum;
  sum.rays = rays.size();
  std::vector<float> our_depth, reference_depth;
  for (size_t i = 0; i < rays.size(); ++i) {
    const Verdict verdict = judge(soup, rays[i], ours[i], reference[i]);
    sum.agree += verdict == Verdict::kAgree;
    sum.ties += verdict == Verdict::kTie;
    sum.unresolved += verdict == Verdict::kUnresolved;
    sum.grazes += verdict == Verdict::kGraze;
    sum.ours_wrong += verdict == Verdict::kOursWrong;
    sum.reference_wrong += verdict == Verdict::kReferenceWrong;
    sum.both_wrong += verdict == Verdict::kBothWrong;
    if (verdict == Verdict::kAgree && ours[i].primitive != LSP_NONE) {
      const IdealHit ideal = ideal_hit(rays[i], soup.corners[soup.triangle_of[ours[i].primitive]]);
      if (ideal.t_resolution > 0 && std::isfinite(ideal.t_resolution)) {
        our_depth.push_back(static_cast<float>(std::abs(double{ours[i].t} - ideal.t) / ideal.t_resolution));
        reference_depth.push_back(
            static_cast<float>(std::abs(double{reference[i].t} - ideal.t) / ideal.t_resolution));
      }
    }
    if (verdict == Verdict::kAgree || verdict == Verdict::kTie) continue;
    sum.hit_or_miss += (ours[i].primitive == LSP_NONE) != (reference[i].primitive == LSP_NONE);
    const bool fault = verdict == Verdict::kOursWrong || verdict == Verdict::kBothWrong;
    if ((fault ? sum.faults : sum.examples).size() < 8) {
      char text[256];
      std::snprintf(text, sizeof text,
                    "ray %zu (%.9g %.9g %.9g) -> (%.9g %.9g %.9g): ours t %.9g primitive %d, reference t "
                    "%.9g primitive %d: %s",
                    i, rays[i].origin.x, rays[i].origin.y, rays[i].origin.z, rays[i].direction.x,
                    rays[i].direction.y, rays[i].direction.z, ours[i].t, static_cast<int>(ours[i].primitive),
                    reference[i].t, static_cast<int>(reference[i].primitive),
                    kNames[static_cast<int>(verdict)]);
      (fault ? sum.faults : sum.examples).push_back(text);
    }
  }
  sum.our_depth = spread_of(our_depth);
  sum.reference_depth = spread_of(reference_depth);
  return sum;
}

}  // namespace lsp::bench
