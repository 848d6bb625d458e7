// Every family of rays over scenes of every scale and both base structures, against the reference.
//
// LSP_STRESS_RAYS=10000000 sets the number of rays of a family (default 60,000).
#include <gtest/gtest.h>

#include <cstdlib>
#include <iostream>
#include <limits>

#include "checks.h"

namespace lsp::stress {
void PrintTo(const Family& family, std::ostream* out) { *out << family.what; }

namespace {

uint64_t rays_per_family() {
  const char* text = std::getenv("LSP_STRESS_RAYS");
  return text ? std::strtoull(text, nullptr, 10) : 60000;
}

const std::vector<StressScene>& scenes() {
  static const std::vector<StressScene> all = family_scenes();
  return all;
}

class Rays : public testing::TestWithParam<Family> {};

TEST_P(Rays, AreAnsweredRight) {
  Outcome sum;
  const Family& f = family(GetParam().name);
  for (const StressScene& scene : scenes()) {
    const Outcome outcome = check_family(f, scene, trace_ours, rays_per_family() / scenes().size(), 1);
    EXPECT_EQ(outcome.failures, 0u) << scene.name() << ": " << outcome.first_failure;
    sum += outcome;
  }
  std::cout << f.name << ": " << sum.summary() << "\n";
  if (std::string(f.name) != "invalid") {
    EXPECT_GT(sum.hits, 0u);
  }
}

// Rays that were answered wrong once.
TEST(KnownRays, AreAnsweredRight) {
  constexpr float kInfinity = std::numeric_limits<float>::infinity();
  const LspRay rays[] = {
      // A projected area so small that its reciprocal is infinite.
      {{0, 0, -0x1.409e76p-5f}, 0, {-0x1.16c2p-133f, 0x1p-149f, 0x1.0a04f4p+0f}, kInfinity},
      // In the plane of a triangle, beside it.
      {{0x1.4p-1f, 0x1.8p-2f, 0x1.934d5cp-1f}, 0, {0x1p-126f, -0x1p-149f, -0x1.4d357p-3f}, kInfinity},
      {{0x1.e114c2p+0f, 0x1p-1f, 0}, 0, {-0x1.6114c2p+0f, 0x1p-126f, 0x1p-149f}, kInfinity},
      // t is a denormal number, of one triangle zero.
      {{0x1.376084p-21f, 0x1.fe6b22p-21f, 0x1.158c48p-20f},
       0,
       {-0x1.376084p-21f, -0x1.fe6b22p-21f, -0x1.7be39p+125f},
       kInfinity}};
  for (const StressScene& scene : scenes()) {
    for (const LspRay& ray : rays) {
      const Outcome outcome = check_rays(scene, trace_ours, {&ray, 1}, LSP_TRACE_APPROXIMATE);
      EXPECT_EQ(outcome.failures, 0u) << outcome.first_failure;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Stress, Rays, testing::ValuesIn(families().begin(), families().end()),
                         [](const auto& info) { return std::string(info.param.name); });

}  // namespace
}  // namespace lsp::stress
