#include "reference.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

namespace lsp::stress {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

bool finite(const lsp_float3& v) { return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z); }
glm::dvec3 vec(const lsp_float3& v) { return {v.x, v.y, v.z}; }
double largest(const glm::dvec3& v) { return std::max({std::abs(v.x), std::abs(v.y), std::abs(v.z)}); }

}  // namespace

bool reference_ray(const LspRay& ray, ReferenceRay* out) {
  if (!finite(ray.origin) || !finite(ray.direction)) return false;
  if (std::isnan(ray.tmin) || std::isnan(ray.tmax) || ray.tmin > ray.tmax) return false;
  const double m = largest(vec(ray.direction));
  if (m < double{std::numeric_limits<float>::min()}) return false;
  out->origin = vec(ray.origin);
  out->to_given = std::ldexp(1.0, -std::ilogb(m));
  out->direction = vec(ray.direction) * out->to_given;
  out->length = glm::length(out->direction);
  out->tmin = ray.tmin / out->to_given;
  out->tmax = ray.tmax / out->to_given;
  return true;
}

Ideal ideal(const ReferenceRay& ray, const std::array<glm::vec3, 3>& corners) {
  const glm::dvec3& d = ray.direction;
  const glm::dvec3 p[3] = {glm::dvec3(corners[0]) - ray.origin, glm::dvec3(corners[1]) - ray.origin,
                           glm::dvec3(corners[2]) - ray.origin};
  Ideal result;
  double reach = 0, longest = 0;
  for (const glm::dvec3& q : p) reach = std::max(reach, largest(q));
  const int axis = largest(d) == std::abs(d.x) ? 0 : (largest(d) == std::abs(d.y) ? 1 : 2);
  const double z[3] = {p[0][axis] / d[axis], p[1][axis] / d[axis], p[2][axis] / d[axis]};
  result.t_lo = *std::min_element(z, z + 3);
  result.t_hi = *std::max_element(z, z + 3);
  const glm::dvec3 normal = glm::cross(p[1] - p[0], p[2] - p[0]);
  const double slope = glm::dot(normal, d);

  // Across the ray: the corners projected along it, in two axes perpendicular to it and to each other.
  const glm::dvec3 along = d / ray.length;
  const glm::dvec3 other = std::abs(along.x) < 0.6 ? glm::dvec3(1, 0, 0) : glm::dvec3(0, 1, 0);
  const glm::dvec3 e1 = glm::normalize(glm::cross(along, other)), e2 = glm::cross(along, e1);
  glm::dvec2 q[3];
  for (int k = 0; k < 3; ++k) q[k] = {glm::dot(p[k], e1), glm::dot(p[k], e2)};
  double shortest = kInfinity, to_line = kInfinity, to_side = kInfinity;
  int left = 0, right = 0;
  for (int k = 0; k < 3; ++k) {
    const glm::dvec2 a = q[k], side = q[(k + 1) % 3] - a;
    const double length = glm::length(side);
    const double area = side.x * -a.y - side.y * -a.x;
    left += area > 0;
    right += area < 0;
    longest = std::max(longest, glm::length(p[(k + 1) % 3] - p[k]));
    shortest = std::min(shortest, length);
    if (length > 0) to_line = std::min(to_line, std::abs(area) / length);
    const double at = length > 0 ? std::clamp(glm::dot(-a, side) / (length * length), 0.0, 1.0) : 0.0;
    to_side = std::min(to_side, glm::length(a + at * side));
  }
  result.edge = left == 3 || right == 3 ? to_line : -to_side;
  // The second term: where products of sheared coordinates leave the normal range.
  result.edge_band = kEdgeBound * kU * reach + 0x1p-146 / std::max(shortest, 0x1p-149);
  const double area2 = glm::length(normal);
  const double cosine = std::abs(slope) / (area2 * ray.length);
  if (!(cosine > 0)) {
    // In the plane: the projected triangle is a segment, and anywhere along it may be the answer.
    result.t = 0.5 * (result.t_lo + result.t_hi);
    result.t_band = kInfinity;
    return result;
  }
  result.t = glm::dot(normal, p[0]) / slope;
  const double needle = 1 + longest * longest / area2;  // 1 + L / h
  // The last term: t is given back in lengths of the direction, perhaps as a denormal.
  result.t_band = kDepthBound * kU * reach * needle / (ray.length * cosine) + 0x1p-148 / ray.to_given;
  return result;
}

namespace {

struct Case {
  uint32_t triangle;
  Ideal ideal;
  bool certain;
};

// All triangles the ray may pass at a t that may lie in its interval.
void find_possible_hits(const bench::Soup& soup, const ReferenceRay& ray, std::vector<Case>& cases) {
  cases.clear();
  for (uint32_t i = 0; i < soup.size(); ++i) {
    const Ideal it = ideal(ray, soup.corners[i]);
    if (!it.may_pass()) continue;
    // The depth never leaves the corners' depths, whatever the band says.
    const double slack = 8 * kU * std::max(std::abs(it.t_lo), std::abs(it.t_hi)) + 0x1p-148 / ray.to_given;
    const double least = std::max(it.t - it.t_band, it.t_lo - slack);
    const double most = std::min(it.t + it.t_band, it.t_hi + slack);
    if (most <= ray.tmin || least >= ray.tmax) continue;
    const double limit = double{std::numeric_limits<float>::max()} / ray.to_given;  // t given back is finite
    const bool certain = it.passes() && least > ray.tmin && most < ray.tmax && most < 0.5 * limit;
    cases.push_back({i, it, certain});
  }
}

Judgement judge_closest(const bench::Soup& soup, const ReferenceRay& ray, const std::vector<Case>& cases,
                        const LspHit& hit) {
  const Case* certain = nullptr;  // the one that ends first
  for (const Case& c : cases) {
    if (c.certain && (!certain || c.ideal.t + c.ideal.t_band < certain->ideal.t + certain->ideal.t_band)) {
      certain = &c;
    }
  }
  if (hit.primitive == LSP_NONE) {
    if (certain) return {Answer::kWrong, 0, "a surface is missed"};
    return {cases.empty() ? Answer::kRight : Answer::kUndecided, 0, ""};
  }
  const Case* ours = nullptr;
  bool alone = true;
  for (const Case& c : cases) {
    if (soup.primitives[c.triangle] == hit.primitive) {
      ours = &c;
    } else if (!certain || c.ideal.t - c.ideal.t_band <= certain->ideal.t + certain->ideal.t_band) {
      alone = alone && certain == &c;
    }
  }
  if (!ours) return {Answer::kWrong, 0, "the ray does not meet this triangle"};
  const double t = double{hit.t} / ray.to_given;
  if (certain && ours->ideal.t - ours->ideal.t_band > certain->ideal.t + certain->ideal.t_band) {
    return {Answer::kWrong, 0, "a nearer surface is missed"};
  }
  const double slack =
      8 * kU * std::max(std::abs(ours->ideal.t_lo), std::abs(ours->ideal.t_hi)) + 0x1p-148 / ray.to_given;
  if (t < ours->ideal.t_lo - slack || t > ours->ideal.t_hi + slack) {
    return {Answer::kWrong, 0, "the depth lies outside the corners' depths"};
  }
  Judgement judgement;
  judgement.deviation =
      std::isfinite(ours->ideal.t_band) ? std::abs(t - ours->ideal.t) / ours->ideal.t_band : 0;
  if (judgement.deviation > 1) return {Answer::kWrong, judgement.deviation, "the depth is off"};
  judgement.answer = certain == ours && alone ? Answer::kRight : Answer::kUndecided;
  return judgement;
}

Judgement judge_any(const bench::Soup& soup, const std::vector<Case>& cases, const LspHit& hit) {
  const bool certain = std::any_of(cases.begin(), cases.end(), [](const Case& c) { return c.certain; });
  if (hit.primitive == LSP_NONE) {
    if (certain) return {Answer::kWrong, 0, "any hit: a surface is missed"};
    return {cases.empty() ? Answer::kRight : Answer::kUndecided, 0, ""};
  }
  const bool ours = std::any_of(cases.begin(), cases.end(),
                                [&](const Case& c) { return soup.primitives[c.triangle] == hit.primitive; });
  if (!ours) return {Answer::kWrong, 0, "any hit: the ray does not meet this triangle"};
  return {certain ? Answer::kRight : Answer::kUndecided, 0, ""};
}

}  // namespace

Judgement judge(const bench::Soup& soup, const ReferenceRay& ray, const LspHit& closest, const LspHit& any) {
  thread_local std::vector<Case> cases;
  find_possible_hits(soup, ray, cases);
  const Judgement judged_any = judge_any(soup, cases, any);
  if (judged_any.answer == Answer::kWrong) return judged_any;
  return judge_closest(soup, ray, cases, closest);
}

const char* malformed(const bench::Soup& soup, const LspRay& ray, const LspHit& hit) {
  if (hit.primitive == LSP_NONE) {
    return hit.t == std::numeric_limits<float>::infinity() ? nullptr : "a miss with a finite t";
  }
  if (!std::isfinite(hit.t)) return "a hit at an infinite t or NaN";
  if (!(hit.t > ray.tmin && hit.t < ray.tmax)) return "t outside (tmin, tmax)";
  if (hit.primitive >= soup.triangle_of.size()) return "no such primitive";
  if (!std::isfinite(hit.u) || !std::isfinite(hit.v)) return "weights that are not finite";
  const double length = glm::length(vec(hit.normal));
  if (!(std::abs(length - 1) < 1e-5)) return "the normal has not unit length";
  return nullptr;
}

}  // namespace lsp::stress
