// The suite's checks, as functions of the tracer they judge: the tests give them ours, the mutation tests one
// with a fault.
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "families.h"
#include "reference.h"

namespace lsp::stress {

// Traces rays[0, count) into hits; flags are LSP_TRACE_*.
using TraceRays = void (*)(const lsp_scene& scene, uint32_t flags, const LspRay* rays, LspHit* hits,
                           uint64_t count);
void trace_ours(const lsp_scene& scene, uint32_t flags, const LspRay* rays, LspHit* hits, uint64_t count);

// Which shaft a ray takes through a Line Space; false where it misses the box.
using FindShaft = bool (*)(const lsp_scene& scene, const LspRay& ray, uint32_t line_space, uint32_t* shaft);

struct Outcome {
  uint64_t cases = 0, failures = 0, undecided = 0, hits = 0;
  double worst = 0;         // deviation of t, in bands
  std::string worst_where;  // the ray, hexadecimal
  std::string first_failure;

  Outcome& operator+=(const Outcome& other);
  std::string summary() const;
};

// Rays, closest and any hit, against the reference; and that the answers of the approximate trace with
// `flags` are well formed.
Outcome check_rays(const StressScene& scene, TraceRays trace, std::span<const LspRay> rays, uint32_t flags);

// Rays of a family, closest and any hit, against the reference; and that approximate answers of every mode
// are well formed.
Outcome check_family(const Family& family, const StressScene& scene, TraceRays trace, uint64_t rays,
                     uint64_t seed);

// The room's walls are closed: rays from inside at their edges and corners hit.
Outcome check_closed(const StressScene& room_scene, TraceRays trace, uint64_t rays, uint64_t seed);

// Shafts are in range, for rays of all families.
Outcome check_shafts(const StressScene& scene, FindShaft find, uint64_t rays, uint64_t seed);

}  // namespace lsp::stress
