// The suite can fail: each fault put into the tracer is found by a check, and by the one that is there for
// it.
#include <gtest/gtest.h>

#include "variants.h"

namespace lsp::stress {
namespace {

constexpr uint64_t kRays = 40000;

const StressScene& room_scene() {
  static const StressScene scene("room", room());
  return scene;
}
const StressScene& away_scene() {
  static const StressScene scene("room_away", placed(room(), 3, glm::vec3(1000, -2000, 500)));
  return scene;
}
const StressScene& ntree_scene() {
  static const StressScene scene("room_ntree", room(), {Base::kNTree, 4, {}});
  return scene;
}

uint64_t failures(const char* name, const StressScene& scene, TraceRays trace) {
  return check_family(family(name), scene, trace, kRays, 7).failures;
}

TEST(Mutations, EveryFaultHasItsPlace) {
  constexpr const char* kLost =
#include "mutants_lost.inc"
      ;
  EXPECT_STREQ(kLost, "") << "the text has moved or changed: say it anew in tests/stress/mutants.cmake";
}

// The tracer's text as it is passes what the faults below fail, so that it is the fault that is found.
TEST(Mutations, TheTextWithoutAFaultPasses) {
  for (const StressScene* scene : {&room_scene(), &away_scene()}) {
    for (const Family& f : families()) {
      const Outcome outcome = check_family(f, *scene, sound::trace, kRays / 4, 7);
      EXPECT_EQ(outcome.failures, 0u) << f.name << ": " << outcome.first_failure;
    }
    EXPECT_EQ(check_closed(*scene, sound::trace, kRays, 7).failures, 0u);
    EXPECT_EQ(check_shafts(*scene, sound::shaft, 2000, 7).failures, 0u);
  }
}

TEST(Mutations, MissingBoxMarginIsFound) {
  EXPECT_GT(check_closed(room_scene(), no_box_margin::trace, kRays, 7).failures +
                check_closed(away_scene(), no_box_margin::trace, kRays, 7).failures,
            0u);
}
TEST(Mutations, LeakingEdgesAreFound) {
  EXPECT_GT(check_closed(room_scene(), edges_are_outside::trace, kRays, 7).failures, 0u);
}
TEST(Mutations, FlippedComparisonOfDepthIsFound) {
  EXPECT_GT(failures("lengths", room_scene(), farther_wins::trace), 0u);
}
TEST(Mutations, HitsBeforeTminAreFound) {
  EXPECT_GT(failures("intervals", room_scene(), tmin_ignored::trace), 0u);
}
TEST(Mutations, FlippedComparisonOfTheStackIsFound) {
  EXPECT_GT(failures("lengths", room_scene(), near_child_only::trace), 0u);
}
TEST(Mutations, MissingPatchClampIsFound) {
  EXPECT_GT(check_shafts(room_scene(), no_patch_clamp::shaft, 2000, 7).failures, 0u);
}
TEST(Mutations, MissingDepthClampIsFound) {
  EXPECT_GT(failures("triangles", away_scene(), no_depth_clamp::trace), 0u);
}
TEST(Mutations, FlippedComparisonOfASlabIsFound) {
  EXPECT_GT(failures("lengths", room_scene(), slab_flipped::trace), 0u);
}
TEST(Mutations, NonFiniteOriginIsFound) {
  EXPECT_GT(failures("invalid", room_scene(), infinite_origin::trace), 0u);
}
TEST(Mutations, SkippedCellIsFound) {
  EXPECT_GT(failures("lengths", ntree_scene(), cell_skipped::trace), 0u);
}

}  // namespace
}  // namespace lsp::stress
