// Families of rays that are hard for a reason, each with a name.
#pragma once

#include <span>
#include <vector>

#include "pcg32.h"
#include "stress_scene.h"

namespace lsp::stress {

using bench::Random;

struct Family {
  const char* name;
  const char* what;
  LspRay (*make)(const StressScene& scene, Random& random);
};

// All of them; the order is part of what the seeds mean.
std::span<const Family> families();
const Family& family(const char* name);

// `count` rays of the family. The same for the same scene, seed and count.
std::vector<LspRay> rays_of(const Family& family, const StressScene& scene, size_t count, uint64_t seed);

}  // namespace lsp::stress
