#include "checks.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <sstream>

namespace lsp::stress {
namespace {

constexpr uint64_t kBatch = 4096;

std::string print(const StressScene& scene, const LspRay& r) {
  std::ostringstream out;
  out << scene.name() << std::hexfloat << " origin " << r.origin.x << " " << r.origin.y << " " << r.origin.z
      << " tmin " << r.tmin << " direction " << r.direction.x << " " << r.direction.y << " " << r.direction.z
      << " tmax " << r.tmax;
  return out.str();
}

std::string print(const LspHit& h) {
  std::ostringstream out;
  out << "t " << std::hexfloat << h.t << std::defaultfloat << " (" << h.t << ") primitive "
      << static_cast<int>(h.primitive) << " u " << h.u << " v " << h.v << " flags " << h.flags;
  return out.str();
}

void fail(Outcome& outcome, const StressScene& scene, const LspRay& ray, const LspHit& hit, const char* why) {
  if (outcome.failures++ == 0)
    outcome.first_failure = std::string(why) + ": " + print(scene, ray) + ": " + print(hit);
}

void check_exact(Outcome& outcome, const StressScene& scene, const LspRay& ray, const LspHit& closest,
                 const LspHit& any) {
  for (const LspHit* hit : {&closest, &any}) {
    if (const char* why = malformed(scene.soup(), ray, *hit)) return fail(outcome, scene, ray, *hit, why);
    if (hit->flags != 0) return fail(outcome, scene, ray, *hit, "flags in an exact answer");
  }
  ReferenceRay reference;
  if (!reference_ray(ray, &reference)) {
    for (const LspHit* hit : {&closest, &any}) {
      if (hit->primitive != LSP_NONE) fail(outcome, scene, ray, *hit, "an invalid ray hits");
    }
    return;
  }
  outcome.hits += closest.primitive != LSP_NONE;
  if ((closest.primitive == LSP_NONE) != (any.primitive == LSP_NONE)) {
    return fail(outcome, scene, ray, any, "any hit and closest hit disagree");
  }
  const Judgement judgement = judge(scene.soup(), reference, closest, any);
  if (judgement.answer == Answer::kWrong) return fail(outcome, scene, ray, closest, judgement.why);
  outcome.undecided += judgement.answer == Answer::kUndecided;
  if (judgement.deviation > outcome.worst) {
    outcome.worst = judgement.deviation;
    outcome.worst_where = print(scene, ray);
  }
}

}  // namespace

void trace_ours(const lsp_scene& scene, uint32_t flags, const LspRay* rays, LspHit* hits, uint64_t count) {
  const lsp_trace_options options{flags, 0.5f};
  lsp_trace(&scene, &options, rays, hits, count, nullptr, nullptr);
}

Outcome& Outcome::operator+=(const Outcome& other) {
  cases += other.cases;
  failures += other.failures;
  undecided += other.undecided;
  hits += other.hits;
  if (other.worst > worst) {
    worst = other.worst;
    worst_where = other.worst_where;
  }
  if (first_failure.empty()) first_failure = other.first_failure;
  return *this;
}

std::string Outcome::summary() const {
  std::ostringstream out;
  out << cases << " cases, " << failures << " failures, " << undecided << " undecided, " << hits
      << " hits, worst deviation " << worst << " of the bound";
  if (!worst_where.empty()) out << " (" << worst_where << ")";
  if (!first_failure.empty()) out << "\nfirst failure: " << first_failure;
  return out.str();
}

Outcome check_rays(const StressScene& scene, TraceRays trace, std::span<const LspRay> rays, uint32_t flags) {
  Outcome outcome;
  outcome.cases = rays.size();
  std::vector<LspHit> closest(rays.size()), any(rays.size()), approximate(rays.size());
  trace(scene.scene(), 0, rays.data(), closest.data(), rays.size());
  trace(scene.scene(), LSP_TRACE_ANY_HIT, rays.data(), any.data(), rays.size());
  trace(scene.scene(), flags, rays.data(), approximate.data(), rays.size());
  for (size_t i = 0; i < rays.size(); ++i) {
    check_exact(outcome, scene, rays[i], closest[i], any[i]);
    ReferenceRay reference;
    const char* why = malformed(scene.soup(), rays[i], approximate[i]);
    if (!why && approximate[i].primitive != LSP_NONE && !reference_ray(rays[i], &reference)) {
      why = "an invalid ray hits";
    }
    if (why) fail(outcome, scene, rays[i], approximate[i], (std::string("approximate: ") + why).c_str());
  }
  return outcome;
}

Outcome check_family(const Family& family, const StressScene& scene, TraceRays trace, uint64_t rays,
                     uint64_t seed) {
  constexpr uint32_t kApproximate[] = {
      LSP_TRACE_APPROXIMATE, LSP_TRACE_APPROXIMATE | LSP_TRACE_NEAR_APPROXIMATE,
      LSP_TRACE_APPROXIMATE | LSP_TRACE_NEAR_SKIP, LSP_TRACE_APPROXIMATE | LSP_TRACE_ANY_HIT};
  Outcome outcome;
  for (uint64_t done = 0, batch = 0; done < rays; ++batch) {
    const uint64_t count = std::min(kBatch, rays - done);
    const std::vector<LspRay> set = rays_of(family, scene, count, seed + 1000003 * batch);
    outcome += check_rays(scene, trace, set, kApproximate[batch % 4]);
    done += count;
  }
  return outcome;
}

Outcome check_closed(const StressScene& room_scene, TraceRays trace, uint64_t rays, uint64_t seed) {
  // The first twelve triangles are the walls. A point in the room, a direction to an edge or corner of one.
  Random random(seed);
  const bench::Soup& soup = room_scene.soup();
  Outcome outcome;
  std::vector<LspRay> set;
  for (uint64_t i = 0; i < rays; ++i) {
    const auto& t = soup.corners[random.below(12)];
    const uint32_t k = random.below(3);
    const double along = random.below(3) == 0 ? 0.0 : random.uniform();
    const glm::dvec3 a(t[k]), b(t[(k + 1) % 3]);
    const glm::vec3 at(a + along * (b - a));
    glm::vec3 from;
    for (int j = 0; j < 3; ++j) {
      from[j] = static_cast<float>(soup.lo[j] + (0.02 + 0.96 * random.uniform()) * (soup.hi[j] - soup.lo[j]));
    }
    const glm::vec3 d(glm::dvec3(at) - glm::dvec3(from));
    set.push_back({{from.x, from.y, from.z}, 0.0f, {d.x, d.y, d.z}, INFINITY});
  }
  std::vector<LspHit> hits(set.size());
  for (const uint32_t flags : {0u, LSP_TRACE_ANY_HIT}) {
    trace(room_scene.scene(), flags, set.data(), hits.data(), set.size());
    for (size_t i = 0; i < set.size(); ++i) {
      ++outcome.cases;
      outcome.hits += hits[i].primitive != LSP_NONE;
      if (hits[i].primitive == LSP_NONE)
        fail(outcome, room_scene, set[i], hits[i], "a ray left the closed room");
    }
  }
  return outcome;
}

Outcome check_shafts(const StressScene& scene, FindShaft find, uint64_t rays, uint64_t seed) {
  Outcome outcome;
  const lsp_scene& s = scene.scene();
  for (const Family& family : families()) {
    for (const LspRay& ray : rays_of(family, scene, rays, seed)) {
      for (uint32_t k = 0; k < s.header->line_space_count; ++k) {
        uint32_t shaft = 0;
        if (!find(s, ray, k, &shaft)) continue;
        const uint32_t n = s.line_spaces[k].format & LSP_FORMAT_RESOLUTION_MASK;
        const bool symmetric = s.line_spaces[k].format & LSP_FORMAT_SYMMETRIC;
        ++outcome.cases;
        if (shaft >= (symmetric ? 15u : 30u) * n * n * n * n) {
          fail(outcome, scene, ray, {}, "the shaft is out of range");
        }
      }
    }
  }
  return outcome;
}

}  // namespace lsp::stress
